#include "trochoid/tracking/frame_source.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <limits>
#include <new>
#include <optional>
#include <utility>

#include "decode/image_sequence.hpp"
#include "decode/libav_handles.hpp"
#include "decode/luma.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/moment.hpp"

namespace trochoid::tracking {
namespace {

namespace fs = std::filesystem;

bool before(const std::optional<data::Moment>& from, const Frame& frame) {
  return from && ((from->frame && frame.index < *from->frame) ||
                  (from->t_s && frame.t_s < *from->t_s - 1e-9));
}

bool after(const std::optional<data::Moment>& to, const Frame& frame) {
  return to &&
         ((to->frame && frame.index > *to->frame) || (to->t_s && frame.t_s > *to->t_s + 1e-9));
}

/// What makes a stored picture upright: columns taken for rows, then either turned round.
struct Turn {
  bool transposed = false, left_right = false, up_down = false;

  /// Nearest to a display matrix of libavutil, (p, q) -> (a p + c q, b p + d q) with a, b, -, c, d
  /// its first elements, which for photographs may mirror.
  static Turn of(const std::int32_t* matrix) {
    const std::int64_t a = matrix[0], b = matrix[1], c = matrix[3], d = matrix[4];
    if (std::abs(a) + std::abs(d) >= std::abs(b) + std::abs(c)) return {false, a < 0, d < 0};
    return {true, c < 0, b < 0};
  }
  /// As Exif numbers them, 1 to 8.
  [[nodiscard]] int orientation() const {
    constexpr int kNumbers[] = {1, 2, 4, 3, 5, 6, 8, 7};
    return kNumbers[(transposed ? 4 : 0) + (up_down ? 2 : 0) + (left_right ? 1 : 0)];
  }
  [[nodiscard]] cv::Size upright(int width, int height) const {
    return transposed ? cv::Size(height, width) : cv::Size(width, height);
  }
  void apply(cv::Mat& image) const {
    if (image.empty()) return;
    if (transposed) cv::transpose(image, image);
    if (left_right || up_down) cv::flip(image, image, !left_right ? 0 : up_down ? -1 : 1);
  }
};

/// A video's container tells; of photographs each picture itself (Exif).
Turn turn_of(const AVStream& stream, const AVFrame* photograph) {
  const std::uint8_t* matrix = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr);
  if (matrix == nullptr && photograph != nullptr)
    if (const auto* own = av_frame_get_side_data(photograph, AV_FRAME_DATA_DISPLAYMATRIX))
      matrix = own->data;
  return matrix != nullptr ? Turn::of(reinterpret_cast<const std::int32_t*>(matrix)) : Turn{};
}

/// Of the stored picture: width over height of a pixel, 1 where the file does not tell.
double stored_pixel_aspect(AVFormatContext& container, AVStream& stream) {
  const AVRational told = av_guess_sample_aspect_ratio(&container, &stream, nullptr);
  return told.num > 0 && told.den > 0 ? av_q2d(told) : 1.0;
}

/// Rate at which a phone says it filmed; slow motion may be stored at a lower one.
std::optional<double> capture_rate_hz(const AVFormatContext& container) {
  const AVDictionaryEntry* entry =
      av_dict_get(container.metadata, "com.android.capture.fps", nullptr, 0);
  if (entry == nullptr) return std::nullopt;
  const double rate = std::strtod(entry->value, nullptr);
  return rate > 0.0 ? std::optional(rate) : std::nullopt;
}

/// A file or an image sequence through libavformat and libavcodec.
class LibavSource final : public FrameSource {
 public:
  LibavSource(const fs::path& path, const SourceOptions& options)
      : name_(path.string()),
        options_(options),
        window_(data::parse_recording_window(options.from, options.to)) {
    av_log_set_level(AV_LOG_QUIET);  // what went wrong is said in our own words
    open_container(path);
    open_decoder();
    photographs_ = decoder_->codec_id == AV_CODEC_ID_MJPEG;
    first_is_decoded_ = photographs_ && decode_one();
    describe();
  }

  [[nodiscard]] const VideoInfo& info() const override { return info_; }

  [[nodiscard]] std::optional<Frame> next() override {
    while (!finished_) {
      if (!std::exchange(first_is_decoded_, false) && !decode_one()) break;
      check_in_place();
      Frame frame{.luma = {}, .bgr = {}, .index = index(), .t_s = 0.0, .damaged = false};
      ++frames_read_;
      const std::int64_t place_before = std::exchange(place_, place(frame.index));
      frame.missing_before = place_ - place_before - 1;
      last_s_ = frame.t_s = presentation_time_s() + lost_before_s(frame.index);
      last_index_ = frame.index;
      if (after(window_.to, frame)) {
        finished_ = true;
        check_any_chosen(false);
        return std::nullopt;
      }
      if (before(window_.from, frame)) continue;
      check_later(frame);
      convert(frame);
      any_chosen_ = true;
      return frame;
    }
    if (!finished_) {
      check_whole();
      check_any_chosen(true);
    }
    finished_ = true;
    return std::nullopt;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}: {}", name_, what));
  }

  /// Of a series the first picture, which tells how the others are coded.
  void open_container(const fs::path& path) {
    series_ = find_image_sequence(path);
    if (series_ && !options_.frame_rate_hz) options_.frame_rate_hz = options_.untimed_rate_hz;
    if (series_ && !options_.frame_rate_hz)
      fail(
          "an image sequence carries no times; give its rate, frame_rate_hz under [camera] or as "
          "an option");
    const fs::path& file = series_ ? series_->pictures.front() : path;
    if (!fs::exists(file)) fail("no such file");
    if (fs::is_regular_file(file) && fs::file_size(file) == 0)
      fail(series_ ? undecodable(0) : "the file is empty");
    container_ = open_input(file);
    if (const int status = avformat_find_stream_info(container_.get(), nullptr); status < 0)
      fail(not_readable(status));
  }
  [[nodiscard]] std::string not_readable(int status) const {
    return series_ ? undecodable(0) : fmt::format("not a readable video ({})", libav_words(status));
  }
  [[nodiscard]] InputHandle open_input(const fs::path& file) const {
    AVDictionary* options = nullptr;
    av_dict_set(&options, "pattern_type", "none", 0);  // %d in a picture's name is no series,
    const std::string url = "file:" + file.string();   // nor a colon in a file's a protocol
    AVFormatContext* raw = nullptr;
    const int status = avformat_open_input(&raw, url.c_str(), nullptr, &options);
    av_dict_free(&options);
    if (status < 0) fail(not_readable(status));
    return InputHandle(raw);
  }

  void open_decoder() {
    const AVCodec* codec = nullptr;
    const int best = av_find_best_stream(container_.get(), AVMEDIA_TYPE_VIDEO, -1, -1, &codec, 0);
    if (best == AVERROR_STREAM_NOT_FOUND) fail("holds no pictures (sound or text only)");
    if (best == AVERROR_DECODER_NOT_FOUND) fail("no decoder for its video codec");
    if (best < 0) fail(libav_words(best));
    stream_ = container_->streams[best];
    for (unsigned i = 0; i < container_->nb_streams; ++i)
      if (static_cast<int>(i) != best) container_->streams[i]->discard = AVDISCARD_ALL;
    decoder_.reset(avcodec_alloc_context3(codec));
    avcodec_parameters_to_context(decoder_.get(), stream_->codecpar);
    decoder_->thread_count = options_.decoder_threads;
    decoder_->flags |= AV_CODEC_FLAG_OUTPUT_CORRUPT;  // handed out, marked damaged
    decoder_->pkt_timebase = stream_->time_base;
    if (options_.key_frames_only) decoder_->skip_frame = AVDISCARD_NONKEY;
    if (const int status = avcodec_open2(decoder_.get(), codec, nullptr); status < 0)
      fail(fmt::format("cannot decode it ({})", libav_words(status)));
    packet_.reset(av_packet_alloc());
    picture_.reset(av_frame_alloc());
  }

  void describe() {
    if (decoder_->width <= 0 || decoder_->height <= 0)
      fail(series_ ? undecodable(0) : "no picture size: not a readable video");
    turn_ = turn_of(*stream_, photographs_ ? picture_.get() : nullptr);
    info_.orientation = turn_.orientation();
    const cv::Size upright = turn_.upright(decoder_->width, decoder_->height);
    info_.width_px = upright.width;
    info_.height_px = upright.height;
    info_.pixel_aspect = stored_pixel_aspect(*container_, *stream_);
    if (turn_.transposed) info_.pixel_aspect = 1.0 / info_.pixel_aspect;
    const double average = av_q2d(stream_->avg_frame_rate), base = av_q2d(stream_->r_frame_rate);
    const bool has_average = std::isfinite(average) && average > 0.0;
    info_.frame_rate_hz = has_average ? average : (std::isfinite(base) ? base : 0.0);
    info_.variable_rate =
        has_average && std::isfinite(base) && std::abs(average - base) > 0.02 * base;
    if (!info_.variable_rate) steady_rate_hz_ = steady_rate_hz();
    info_.capture_rate_hz = capture_rate_hz(*container_);
    take_capture_rate();
    if (options_.frame_rate_hz) {
      if (!(*options_.frame_rate_hz > 0.0)) fail("the frame rate must be positive");
      info_.frame_rate_hz = *options_.frame_rate_hz;
      info_.evened = std::exchange(info_.variable_rate, false);
    }
    const AVFieldOrder order = stream_->codecpar->field_order;
    info_.interlaced = order != AV_FIELD_UNKNOWN && order != AV_FIELD_PROGRESSIVE;
    info_.frames = series_ ? static_cast<std::int64_t>(series_->pictures.size()) : pictures_shown();
    if (series_) info_.missing = series_->missing();
    if (series_) info_.left_out = series_->left_out;
    info_.codec = avcodec_get_name(decoder_->codec_id);
  }

  /// Stamps of a film that was taken at one rate and plays at another say nothing of the motion; of
  /// one that lost a few pictures on its way they are right.
  void take_capture_rate() {
    constexpr double kClearly = 1.5;
    if (options_.frame_rate_hz || !info_.capture_rate_hz || !(info_.frame_rate_hz > 0.0)) return;
    const double times = *info_.capture_rate_hz / info_.frame_rate_hz;
    if (std::max(times, 1.0 / times) < kClearly) return;
    info_.played_rate_hz = info_.frame_rate_hz;
    options_.frame_rate_hz = info_.capture_rate_hz;
  }

  /// As many as the container says, without those that its edit list hides.
  [[nodiscard]] std::int64_t pictures_shown() const {
    std::int64_t hidden = 0;
    for (int i = 0; i < avformat_index_get_entries_count(stream_); ++i)
      hidden += (avformat_index_get_entry(stream_, i)->flags & AVINDEX_DISCARD_FRAME) != 0 ? 1 : 0;
    return std::max<std::int64_t>(0, stream_->nb_frames - hidden);
  }

  /// Rate by which the stamps of a video count its pictures; 0 where they do not: stamps coarser
  /// than half a picture may make two of one.
  [[nodiscard]] double steady_rate_hz() const {
    const double rate_hz = av_q2d(stream_->r_frame_rate);
    if (series_ || !std::isfinite(rate_hz) || !(rate_hz > 0.0)) return 0.0;
    const double ticks = 1.0 / (rate_hz * av_q2d(stream_->time_base));  // of a picture
    return ticks > 2.0 || std::abs(ticks - 1.0) < 1e-6 ? rate_hz : 0.0;
  }

  /// Next picture into picture_; false at the end of the stream.
  bool decode_one() {
    while (true) {
      const int status = avcodec_receive_frame(decoder_.get(), picture_.get());
      if (status == 0) return true;
      if (status == AVERROR_EOF) return false;
      if (!feed()) return false;
    }
  }

  /// One more packet, or the flush at the end, into the decoder; false when flushed before.
  bool feed() {
    if (flushing_) return false;
    if (series_) return feed_picture();
    while (true) {
      const int status = av_read_frame(container_.get(), packet_.get());
      if (status < 0) {
        if (status != AVERROR_EOF) read_error_ = libav_words(status);
        flushing_ = true;
        avcodec_send_packet(decoder_.get(), nullptr);
        return true;
      }
      const bool ours = packet_->stream_index == stream_->index;
      const bool wanted = ours && (!options_.key_frames_only ||
                                   ((packet_->flags & AV_PKT_FLAG_KEY) != 0 && is_its_turn()));
      if (wanted) avcodec_send_packet(decoder_.get(), packet_.get());
      av_packet_unref(packet_.get());
      if (wanted) return true;
    }
  }

  /// Of frames that decode alone, lest a recording of nothing else be decoded twice: sixteen, then
  /// every second until there are eight more, every fourth until there are eight more, ... Who
  /// drops every second one whenever he has sixteen keeps them evenly spread.
  bool is_its_turn() {
    constexpr std::int64_t kEach = 8;
    if (keys_++ % key_stride_ != 0) return false;
    if (++keys_taken_ > kEach && keys_taken_ % kEach == 0) key_stride_ *= 2;
    return true;
  }

  /// The next picture of a series, stamped with its place among those that are read.
  bool feed_picture() {
    constexpr std::streamoff kMostBytes = 1 << 30;
    while (options_.key_frames_only && next_picture_ < series_->pictures.size() && !is_its_turn())
      ++next_picture_;
    if (next_picture_ == series_->pictures.size()) {
      flushing_ = true;
      avcodec_send_packet(decoder_.get(), nullptr);
      return true;
    }
    std::ifstream file(series_->pictures[next_picture_], std::ios::binary | std::ios::ate);
    const std::streamoff bytes = file ? std::streamoff(file.tellg()) : 0;
    if (bytes <= 0 || bytes > kMostBytes) fail(undecodable(next_picture_));
    if (av_new_packet(packet_.get(), static_cast<int>(bytes)) < 0) throw std::bad_alloc();
    if (!file.seekg(0).read(reinterpret_cast<char*>(packet_->data), bytes))
      fail(undecodable(next_picture_));
    packet_->pts = packet_->dts = pictures_fed_++;
    ++next_picture_;
    packet_->flags |= AV_PKT_FLAG_KEY;
    avcodec_send_packet(decoder_.get(), packet_.get());
    av_packet_unref(packet_.get());
    return true;
  }

  /// Of the picture that was decoded last.
  [[nodiscard]] std::int64_t index() const {
    return series_ ? series_->frames[static_cast<std::size_t>(frames_read_)] : frames_read_;
  }

  /// Number of the picture that was decoded last, counted with those before it that are lost: a
  /// stamp some whole pictures after that of one in its place tells of them. Seen from one before,
  /// for a phone's rate wanders; any other step is of a camera that does not keep time.
  std::int64_t place(std::int64_t index) {
    constexpr double kNear = 0.25;
    if (series_) return index;
    const std::int64_t stamp = picture_->best_effort_timestamp, next = place_ + 1;
    if (steady_rate_hz_ == 0.0 || stamp == AV_NOPTS_VALUE) return next;
    std::int64_t place = next;
    if (anchor_stamp_ != AV_NOPTS_VALUE) {
      const double step =
          static_cast<double>(stamp - anchor_stamp_) * av_q2d(stream_->time_base) * steady_rate_hz_;
      const double whole = std::round(step);
      if (std::abs(step - whole) < kNear) {
        const std::int64_t told = anchor_place_ + static_cast<std::int64_t>(whole);
        if (told < next) return next;  // one stamp twice
        // Where stamps only jitter, those since the first tell of no loss.
        const double since = static_cast<double>(stamp - first_stamp_) *
                             av_q2d(stream_->time_base) * steady_rate_hz_;
        place = std::min(told, std::max<std::int64_t>(
                                   next, static_cast<std::int64_t>(std::floor(since + kNear))));
      }
    }
    anchor_stamp_ = stamp;
    anchor_place_ = place;
    return place;
  }

  /// Time since the first picture: the stamp in the file, or place / rate when overridden.
  double presentation_time_s() {
    const std::int64_t stamp = picture_->best_effort_timestamp;
    if (first_stamp_ == AV_NOPTS_VALUE) first_stamp_ = stamp;
    if (stamp != AV_NOPTS_VALUE) last_stamp_ = stamp;
    if (!options_.frame_rate_hz && stamp != AV_NOPTS_VALUE)
      return static_cast<double>(stamp - first_stamp_) * av_q2d(stream_->time_base);
    const double rate_hz = options_.frame_rate_hz.value_or(info_.frame_rate_hz);
    if (!(rate_hz > 0.0))
      fail("carries no time stamps; give its rate, frame_rate_hz under [camera] or as an option");
    return static_cast<double>(place_) / rate_hz;
  }

  /// Time of the pictures up to this one that are known to be missing without showing in the times.
  [[nodiscard]] double lost_before_s(std::int64_t index) const {
    const auto& missing = options_.missing_frames;
    const auto lost = std::count_if(missing.begin(), missing.end(),
                                    [&](std::int64_t frame) { return frame <= index; });
    if (lost == 0) return 0.0;
    // The average is lower where the times tell of other pictures that are missing.
    const double own_hz = steady_rate_hz_ > 0.0 ? steady_rate_hz_ : info_.frame_rate_hz;
    const double rate_hz = options_.frame_rate_hz.value_or(own_hz);
    if (!(rate_hz > 0.0))
      fail(
          "has no rate to tell the missing_frames' time by; give it, frame_rate_hz under [camera]");
    return static_cast<double>(lost) / rate_hz;
  }

  /// No motion can be told from pictures of one time.
  void check_later(const Frame& frame) {
    const double before_s = std::exchange(handed_out_s_, frame.t_s);
    if (!options_.apart_in_time || frame.t_s > before_s) return;
    fail(
        fmt::format("frame {} is shown at {:g} s and the one before it at {:g} s: the container's "
                    "clock is too coarse, or its stamps are wrong; give the true rate, "
                    "frame_rate_hz under [camera] or as an option",
                    frame.index, frame.t_s, before_s));
  }

  /// A picture of a series that cannot be decoded would shift all after it in time.
  void check_in_place() const {
    if (!series_) return;
    const std::int64_t place = picture_->best_effort_timestamp;
    const auto expected = static_cast<std::size_t>(frames_read_);
    if (expected >= series_->pictures.size() || (place != AV_NOPTS_VALUE && place != frames_read_))
      fail(undecodable(std::min(expected, series_->pictures.size() - 1)));
  }
  [[nodiscard]] std::string undecodable(std::size_t place) const {
    return fmt::format("picture {} of {}, {}, cannot be decoded", place + 1,
                       series_->pictures.size(), series_->pictures[place].filename().string());
  }

  /// Of a series, the file of the picture that was decoded last.
  [[nodiscard]] std::string name_of_picture() const {
    if (!series_) return "";
    const fs::path& file = series_->pictures[static_cast<std::size_t>(frames_read_ - 1)];
    return fmt::format(" ({})", file.filename().string());
  }

  /// A recording's camera stands still: what its pictures say of how it was held must agree.
  void check_orientation(std::int64_t index) const {
    if (!photographs_) return;
    const int orientation = turn_of(*stream_, picture_.get()).orientation();
    if (orientation != info_.orientation)
      fail(
          fmt::format("frame {}{}: the camera was held another way than for the first (Exif "
                      "orientation {} after {}); if it was not, remove what they say of it",
                      index, name_of_picture(), orientation, info_.orientation));
  }

  void convert(Frame& frame) {
    check_orientation(frame.index);
    const cv::Size size = turn_.upright(picture_->width, picture_->height);
    if (size != cv::Size(info_.width_px, info_.height_px))
      fail(fmt::format("frame {}{}: the picture size changes from {} x {} to {} x {}", frame.index,
                       name_of_picture(), info_.width_px, info_.height_px, size.width,
                       size.height));
    frame.damaged =
        (picture_->flags & AV_FRAME_FLAG_CORRUPT) != 0 || picture_->decode_error_flags != 0;
    fill(frame);
    for (cv::Mat* image : {&frame.luma, &frame.chroma, &frame.bgr}) turn_.apply(*image);
  }

  void fill(Frame& frame) try {
    frame.luma = luma_of(*picture_, scaler_);
    if (options_.colour) frame.bgr = bgr_of(*picture_, colour_scaler_);
    if (options_.chroma) frame.chroma = chroma_of(*picture_);
  } catch (const InputError& error) {
    fail(fmt::format("frame {}{}: {}", frame.index, name_of_picture(), error.what()));
  }

  /// A file cut short ends like a whole one; only the promised number of frames tells. Open groups
  /// of pictures may honestly hide a few frames, so a handful is forgiven.
  void check_whole() const {
    if (frames_read_ == 0) fail(series_ ? undecodable(0) : "holds no decodable picture");
    if (options_.key_frames_only) return;
    const std::int64_t missing = info_.frames - frames_read_;
    if (series_ && missing > 0) fail(undecodable(static_cast<std::size_t>(frames_read_)));
    const bool cut = missing > std::max<std::int64_t>(2, info_.frames / 50);
    if (cut || (!read_error_.empty() && missing > 0))
      fail(fmt::format(
          "breaks off after frame {} of {}{}; copy the whole file, or stop earlier (to)",
          frames_read_ - 1, info_.frames, read_error_.empty() ? "" : " (" + read_error_ + ")"));
    check_length();
  }

  /// Containers that do not count frames may promise a length (Matroska), by its own clock
  /// whatever rate is given.
  void check_length() const {
    const double rate_hz = av_q2d(stream_->avg_frame_rate);
    if (info_.frames != 0 || first_stamp_ == AV_NOPTS_VALUE || !(rate_hz > 0.0)) return;
    const std::optional<double> promised_s = promised_length_s();
    if (!promised_s) return;
    const double length_s = *promised_s;
    const double read_s =
        static_cast<double>(last_stamp_ - first_stamp_) * av_q2d(stream_->time_base);
    const double forgiven_s = std::max(3.0 / rate_hz, 0.02 * length_s);
    if (length_s - read_s > forgiven_s)
      fail(fmt::format(
          "breaks off at {:.3f} s of {:.3f} s; copy the whole file, or stop earlier (to)", read_s,
          length_s));
  }

  /// Of the pictures from the first on, as the container tells it, if it does. With sound beside
  /// them its whole length may be the sound's, but in Matroska the pictures have a tag of theirs
  /// that says when they end. (Copied into other containers it tells of the file it came from.)
  [[nodiscard]] std::optional<double> promised_length_s() const {
    const bool matroska =
        std::string_view(container_->iformat->name).find("matroska") != std::string_view::npos;
    const AVDictionaryEntry* tag =
        matroska ? av_dict_get(stream_->metadata, "DURATION", nullptr, 0) : nullptr;
    std::int64_t end_us = 0;
    if (tag != nullptr && av_parse_time(&end_us, tag->value, 1) >= 0)
      return static_cast<double>(end_us) / AV_TIME_BASE -
             static_cast<double>(first_stamp_) * av_q2d(stream_->time_base);
    const bool known = container_->nb_streams == 1 && container_->duration != AV_NOPTS_VALUE &&
                       container_->duration_estimation_method == AVFMT_DURATION_FROM_STREAM;
    if (!known) return std::nullopt;
    return static_cast<double>(container_->duration) / AV_TIME_BASE;
  }

  /// Whoever asks for a part of a recording wants some of it.
  void check_any_chosen(bool at_end) const {
    if (any_chosen_) return;
    const auto words = [](const char* name, const std::string& moment) {
      return moment.empty() ? "" : fmt::format(" {} = {}", name, moment);
    };
    fail(fmt::format("no picture lies{}{}: frame {}, at {:.4g} s, {}", words("from", options_.from),
                     words("to", options_.to), last_index_, last_s_,
                     at_end ? "is the last" : "is past the end"));
  }

  std::string name_;
  SourceOptions options_;
  data::Window window_;
  InputHandle container_;
  DecoderHandle decoder_;
  PacketHandle packet_;
  PictureHandle picture_;
  Scaler scaler_, colour_scaler_;
  AVStream* stream_ = nullptr;
  VideoInfo info_;
  std::optional<ImageSequence> series_;
  std::size_t next_picture_ = 0;  ///< of the series, to be decoded
  std::int64_t pictures_fed_ = 0;
  /// Frames that decode alone, and those of them that were decoded.
  std::int64_t keys_ = 0, keys_taken_ = 0, key_stride_ = 1;
  Turn turn_;
  bool photographs_ = false;
  bool first_is_decoded_ = false;  ///< ahead of its turn, for what it says of itself
  std::int64_t frames_read_ = 0;
  std::int64_t last_index_ = 0;  ///< of the picture that was decoded last
  double last_s_ = 0.0;          ///< its time
  double handed_out_s_ = -std::numeric_limits<double>::infinity();  ///< time of the last one
  bool any_chosen_ = false;                                         ///< of the window
  std::int64_t first_stamp_ = AV_NOPTS_VALUE, last_stamp_ = AV_NOPTS_VALUE;
  double steady_rate_hz_ = 0.0;  ///< 0 = stamps do not tell of a lost picture
  std::int64_t place_ = -1;      ///< in time, of the picture that was decoded last
  std::int64_t anchor_stamp_ = AV_NOPTS_VALUE, anchor_place_ = 0;  ///< a picture in its place
  std::string read_error_;
  bool flushing_ = false, finished_ = false;
};

}  // namespace

std::vector<fs::path> files_of_recording(const fs::path& path) {
  std::optional<ImageSequence> series = find_image_sequence(path);
  if (!series) return {path};
  std::vector<fs::path> files = std::move(series->pictures);
  std::move(series->left_out.begin(), series->left_out.end(), std::back_inserter(files));
  return files;
}

std::string sha256_of_recording(const fs::path& path) {
  const std::optional<ImageSequence> series = find_image_sequence(path);
  if (!series) return data::sha256_of_file(path);
  std::string list;
  for (const fs::path& picture : series->pictures) list += data::sha256_of_file(picture) + "\n";
  return data::sha256_of_text(list);
}

std::unique_ptr<FrameSource> open_video(const fs::path& path, const SourceOptions& options) {
  return std::make_unique<LibavSource>(path, options);
}

double readout_share(const VideoInfo& video, const Eigen::Vector2d& point_px) {
  const Eigen::Vector2d per_px = readout_share_per_px(video);
  const double share = per_px.dot(point_px);
  return std::clamp(per_px.sum() < 0.0 ? 1.0 + share : share, 0.0, 1.0);
}

Eigen::Vector2d readout_share_per_px(const VideoInfo& video) {
  const int turned = video.orientation;
  const bool along_x = turned >= 5,
             backwards = turned == 3 || turned == 4 || turned == 6 || turned == 7;
  const int rows = along_x ? video.width_px : video.height_px;
  const double per_px = (backwards ? -1.0 : 1.0) / std::max(1, rows - 1);
  return along_x ? Eigen::Vector2d(per_px, 0.0) : Eigen::Vector2d(0.0, per_px);
}

}  // namespace trochoid::tracking
