#include "draw/overlay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "common/progress.hpp"
#include "draw/encoded_file.hpp"
#include "draw/frame_times.hpp"
#include "draw/overlay_drawing.hpp"
#include "draw/pace.hpp"
#include "draw/residual_strip.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/moment.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tools {
namespace {

constexpr int kGoodWidthPx = 960;  // below this lines are coarse against the body
constexpr double kMostEnlarged = 3.0;
constexpr int kLargestWidthPx = 1920;
constexpr double kScreenRateHz = 60.0;
constexpr int kTrailFrames = 60;
const cv::Scalar kBand(34, 34, 34);

double enlargement_of(const tracking::VideoInfo& info) {
  if (info.width_px > kLargestWidthPx) return static_cast<double>(kLargestWidthPx) / info.width_px;
  return std::clamp(static_cast<double>(kGoodWidthPx) / info.width_px, 1.0, kMostEnlarged);
}

double text_size_px(int width_px) {
  return std::clamp(width_px / 72.0, 9.0, 16.0);
}

Stroke future_stroke() {
  return {.colour = palette::predicted, .width_px = 1, .halo_px = 1, .halo_alpha = 0.25};
}

std::optional<double> rate_of(const data::TrackFile& file) {
  for (const data::Track& track : file.tracks) {
    if (track.samples.size() < 2) continue;
    const data::TrackSample &first = track.samples.front(), &last = track.samples.back();
    if (first.frame >= 0 && last.frame > first.frame && last.t_s > first.t_s)
      return static_cast<double>(last.frame - first.frame) / (last.t_s - first.t_s);
  }
  return std::nullopt;
}

/// Seconds of the track as the frame it has first from then on, or last until then: the file may
/// play at another rate. What is a frame already, and what the track cannot tell, is left as it is.
std::string as_frame(const FrameTimes& times, const std::string& text, bool is_first) {
  const auto moment = data::parse_moment(text);
  if (!moment || !moment->t_s) return text;
  const auto at = times.frame_at(*moment->t_s);
  // A time below 0 is one of a track that counts from an event, or none at all.
  if (!at || (*moment->t_s < 0.0 && *at < 0.0)) return text;
  constexpr double kRounding = 1e-4;  // of a frame
  const double frame = is_first ? std::ceil(*at - kRounding) : std::floor(*at + kRounding);
  return fmt::format("f{:.0f}", std::max(0.0, frame));
}

/// Pictures a second that show every frame when it was: the camera's own rate, also where some of
/// its pictures were lost or it was slower at times.
double rate_shown_hz(const tracking::VideoInfo& info, const OverlayContent& content) {
  constexpr double kRounding = 0.02;
  const double step_s = content.usual_step_s();
  if (!(step_s > 0.0) || std::abs(step_s * info.frame_rate_hz - 1.0) < kRounding)
    return info.frame_rate_hz;
  return 1.0 / step_s;
}

/// Draws the pictures of an overlay one after the other; strokes of the past are kept between
/// calls.
class OverlayPainter {
 public:
  OverlayPainter(const OverlayContent& content, const tracking::VideoInfo& info, double slowed);
  [[nodiscard]] cv::Size size() const { return {view_.size().width, height_px_}; }
  [[nodiscard]] cv::Mat paint(const tracking::Frame& frame, double t_s);

 private:
  [[nodiscard]] int line_px() const { return 2 * static_cast<int>(std::lround(1.3 * text_px_)); }
  [[nodiscard]] double margin_px() const { return 1.2 * text_px_; }
  [[nodiscard]] std::string header_words(std::int64_t frame, double t_s) const;
  void draw_header(cv::Mat band, const tracking::Frame& frame, double t_s) const;
  void draw_predicted(cv::Mat& picture, const ObjectPaths& paths, double t_s) const;
  void draw_past(cv::Mat& picture, double t_s);
  void draw_trail(cv::Mat& picture, std::size_t object, double t_s) const;
  void draw_now(cv::Mat& picture, const ObjectPaths& paths, const tracking::Frame& frame,
                double t_s) const;
  void mark_missing(cv::Mat& picture) const;

  const OverlayContent& content_;
  Enlargement view_;
  double text_px_, slowed_, trail_s_;
  int header_px_, height_px_;  ///< the header has one line, or two where one has no room for all
  ResidualStrip strip_;
  Ink whole_prediction_, past_points_;
  std::vector<std::size_t> drawn_;  ///< observed points in past_points_, per object
};

OverlayPainter::OverlayPainter(const OverlayContent& content, const tracking::VideoInfo& info,
                               double slowed)
    : content_(content),
      view_{{0, 0, info.width_px, info.height_px}, enlargement_of(info)},
      text_px_(text_size_px(view_.size().width)),
      slowed_(slowed),
      trail_s_(kTrailFrames / std::max(1.0, info.frame_rate_hz)),
      header_px_(line_px()),
      height_px_(0),
      strip_(content, content.first_s(), content.last_s(), view_.size().width, text_px_),
      whole_prediction_(view_.size()),
      past_points_(view_.size()),
      drawn_(content.objects().size(), 0) {
  if (!legend_fits_beside(header_words(info.frames, content.last_s()), content,
                          view_.size().width - 2.0 * margin_px(), text_px_))
    header_px_ = 2 * line_px();
  height_px_ = header_px_ + view_.size().height + strip_.height_px();
  for (const ObjectPaths& paths : content_.objects())
    for (const PredictedLine& line : paths.predicted)
      whole_prediction_.polyline(thinned(line.px, view_, 1.0), future_stroke(), 0.55);
}

cv::Mat OverlayPainter::paint(const tracking::Frame& frame, double t_s) {
  cv::Mat page(height_px_, view_.size().width, CV_8UC3, kBand);
  cv::Mat picture = view_.picture(frame.bgr);
  whole_prediction_.lay_on(picture, future_stroke());
  for (const ObjectPaths& paths : content_.objects()) draw_predicted(picture, paths, t_s);
  draw_past(picture, t_s);
  for (std::size_t i = 0; i < content_.objects().size(); ++i) {
    draw_trail(picture, i, t_s);
    draw_now(picture, content_.objects()[i], frame, t_s);
  }
  draw_scale_bar(picture, content_.scale_px_per_m(), view_.factor, text_px_);
  if (!content_.detected(frame.index, t_s)) mark_missing(picture);
  picture.copyTo(page.rowRange(header_px_, header_px_ + picture.rows));
  draw_header(page.rowRange(0, header_px_), frame, t_s);
  strip_.draw(page.rowRange(header_px_ + picture.rows, height_px_), t_s);
  return page;
}

std::string OverlayPainter::header_words(std::int64_t frame, double t_s) const {
  std::string words = fmt::format("t = {:.4f} s   frame {}", t_s, frame);
  if (slowed_ > 1.001) words += fmt::format("   {:.3g} x slower", slowed_);
  return words;
}

void OverlayPainter::draw_header(cv::Mat band, const tracking::Frame& frame, double t_s) const {
  const double base = 0.5 * line_px() + 0.5 * text_px_;
  draw_text(band, header_words(frame.index, t_s), {margin_px(), base}, text_px_, palette::white);
  draw_legend(band, content_, {band.cols - margin_px(), base + band.rows - line_px()}, text_px_);
}

// The predicted path of the last moments, brighter towards now.
void OverlayPainter::draw_predicted(cv::Mat& picture, const ObjectPaths& paths, double t_s) const {
  const Stroke stroke = predicted_stroke();
  Ink ink(picture.size());
  for (const PredictedLine& line : paths.predicted) {
    const auto first = std::lower_bound(line.t_s.begin(), line.t_s.end(), t_s - trail_s_);
    const auto last = std::upper_bound(line.t_s.begin(), line.t_s.end(), t_s);
    for (auto at = first; at != last; ++at) {
      const auto i = static_cast<std::size_t>(at - line.t_s.begin());
      if (i == 0) continue;
      const double age = (t_s - line.t_s[i]) / trail_s_;
      ink.line(view_(line.px[i - 1]), view_(line.px[i]), stroke, 1.0 - 0.6 * age);
    }
  }
  ink.lay_on(picture, stroke);
}

// Every point up to now, of all objects at once: laid on for each, all would be as many times as
// opaque.
void OverlayPainter::draw_past(cv::Mat& picture, double t_s) {
  const Stroke faint{.colour = palette::observed, .width_px = 1, .halo_px = 0};
  for (std::size_t object = 0; object < drawn_.size(); ++object) {
    const std::vector<ObservedPoint>& points = content_.objects()[object].observed;
    std::size_t& next = drawn_[object];
    for (; next < points.size() && points[next].t_s <= t_s; ++next)
      past_points_.dot(view_(points[next].px), 1.0, faint, 0.5);
  }
  past_points_.lay_on(picture, faint);
}

// The last moments of the past, brighter towards now.
void OverlayPainter::draw_trail(cv::Mat& picture, std::size_t object, double t_s) const {
  const Stroke bright = observed_stroke();
  const std::vector<ObservedPoint>& points = content_.objects()[object].observed;
  Ink trail(picture.size());
  for (std::size_t i = drawn_[object]; i-- > 0;) {
    const double age = (t_s - points[i].t_s) / trail_s_;
    if (age > 1.0) break;
    trail.dot(view_(points[i].px), 1.9, bright, 0.95 - 0.75 * age);
  }
  trail.lay_on(picture, bright);
}

// Body edges, the predicted centre as a cross, the observed one as a ring around it.
void OverlayPainter::draw_now(cv::Mat& picture, const ObjectPaths& paths,
                              const tracking::Frame& frame, double t_s) const {
  const Stroke predicted = predicted_stroke(1);
  Ink ink(picture.size());
  const bool predicted_body = content_.prediction().arc_at(paths.object, t_s) != nullptr;
  Stroke body = predicted;
  if (!predicted_body) body.colour = palette::observed;
  add_wireframe(ink, content_.wireframe_at(paths.object, frame.index, t_s), view_, body);
  ink.lay_on(picture, body);
  ink.clear();
  if (const auto px = content_.predicted_px(paths.object, t_s)) {
    const Eigen::Vector2d at = view_(*px);
    ink.line(at - Eigen::Vector2d(6, 0), at + Eigen::Vector2d(6, 0), predicted, 1.0);
    ink.line(at - Eigen::Vector2d(0, 6), at + Eigen::Vector2d(0, 6), predicted, 1.0);
    ink.lay_on(picture, predicted);
    ink.clear();
  }
  const ObservedPoint* const seen = content_.observed_in(paths, frame.index, t_s);
  if (seen == nullptr) return;
  const Stroke observed{.colour = palette::observed, .width_px = 2, .halo_px = 1};
  ink.ring(view_(seen->px), 6.0, observed, 1.0);
  ink.lay_on(picture, observed);
}

void OverlayPainter::mark_missing(cv::Mat& picture) const {
  cv::rectangle(picture, {1, 1}, {picture.cols - 2, picture.rows - 2}, palette::yellow, 3);
  draw_text_with_halo(picture, "no detection", {0.5 * picture.cols, 2.4 * text_px_}, 1.1 * text_px_,
                      palette::yellow, Align::centre);
}

}  // namespace

void check_recording(const OverlayInput& input, const std::string& track) {
  const std::string& tracked = input.tracks.source_sha256;
  if (tracked.empty() || tracked == tracking::sha256_of_recording(input.video)) return;
  throw InputError(fmt::format("{}: was tracked in another recording than {}; track this one",
                               track, input.video.string()));
}

void check_overlay_name(const std::filesystem::path& path) {
  if (path.extension() != ".mp4")
    throw InputError(fmt::format("{}: an overlay is an mp4 file; name it .mp4", path.string()));
}

std::unique_ptr<tracking::FrameSource> open_recording(const OverlayInput& input,
                                                      const OverlayOptions& options) {
  tracking::SourceOptions source;
  source.colour = true;
  const FrameTimes times(input.tracks);
  (void)data::parse_window(options.from, options.to);  // what is wrong is told as it was given
  source.from = as_frame(times, options.from, true);
  source.to = as_frame(times, options.to, false);
  if (data::Window{data::parse_moment(source.from), data::parse_moment(source.to)}.reversed())
    throw InputError(fmt::format("no frame lies between from = {} and to = {}; make that longer",
                                 options.from, options.to));
  if (input.scene) source.frame_rate_hz = input.scene->camera.frame_rate_hz;
  if (input.scene) source.missing_frames = input.scene->camera.missing_frames;
  source.untimed_rate_hz = rate_of(input.tracks);
  return tracking::open_video(input.video, source);
}

OverlayFrames write_overlay(const OverlayInput& input, const OverlayOptions& options,
                            const std::filesystem::path& path) {
  check_overlay_name(path);
  auto source = tracking::decode_ahead(open_recording(input, options));
  const tracking::VideoInfo info = source->info();
  const OverlayContent content(input, info.width_px, info.height_px);
  content.check_pictures(info.width_px, info.height_px, input.video.string());
  const double rate_hz = rate_shown_hz(info, content);
  OverlayFrames written;
  written.slowed =
      options.slow > 0.0 ? options.slow : std::max(1.0, std::ceil(rate_hz / kScreenRateHz - 0.01));
  written.frame_rate_hz = rate_hz / written.slowed;
  OverlayPainter painter(content, info, written.slowed);
  written.width_px = painter.size().width;
  written.height_px = painter.size().height;
  EncodedFile overlay(path, painter.size(), written.frame_rate_hz, coding::kForViewing);
  Progress progress("overlay");
  constexpr double kLongestPause_s = 2.0;  // on the screen
  Pace pace(rate_hz, kLongestPause_s / written.slowed);
  // How many frames lie in a range is known when they are decoded.
  const std::int64_t total = options.from.empty() && options.to.empty() ? info.frames : 0;
  std::int64_t drawn = 0;
  cv::Mat picture;
  const auto show = [&](std::int64_t frame, double t_s) {
    if (options.between_pictures) options.between_pictures();
    overlay.write(picture);
    written.frame.push_back(frame);
    written.t_s.push_back(t_s);
  };
  while (const auto frame = source->next()) {
    const double t_s = content.time_of_frame(frame->index, frame->t_s);
    if (drawn > 0) {
      const std::int64_t before = written.frame.back();
      const double from_s = written.t_s.back();
      const int pictures = pace.pictures(t_s - from_s);
      for (int k = 1; k < pictures; ++k) show(before, from_s + (t_s - from_s) * k / pictures);
    }
    picture = painter.paint(*frame, t_s);
    show(frame->index, t_s);
    progress.update(++drawn, total);
  }
  overlay.finish();
  overlay.commit();
  return written;
}

}  // namespace trochoid::tools
