#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace trochoid::tracking {

/// One decoded picture: upright (rotation metadata applied), 8-bit luma in full range, its index as
/// decoded and its presentation time since the first frame.
struct Frame {
  cv::Mat luma;  ///< CV_8UC1
  cv::Mat bgr;   ///< CV_8UC3, empty unless asked for
  std::int64_t index = 0;
  double t_s = 0.0;
  bool damaged = false;  ///< the decoder reported an error in it
  /// Pictures between the one before and this one that the file lost, as far as stamps tell.
  std::int64_t missing_before = 0;
  /// CV_8UC2 (Cb, Cr) at half the size; empty unless asked for and coded as YUV with a luma plane.
  cv::Mat chroma{};
};

struct VideoInfo {
  int width_px = 0, height_px = 0;  ///< upright
  double frame_rate_hz = 0.0;       ///< average of the time stamps
  std::int64_t frames = 0;          ///< as the container says, 0 if it does not
  std::int64_t missing = 0;         ///< beside those, by the numbers of a series' pictures
  std::vector<std::filesystem::path> left_out{};  ///< of a folder: named unlike its series
  std::string codec;
  bool variable_rate = false;
  bool evened = false;      ///< it was variable, and a rate given instead takes it for even
  bool interlaced = false;  ///< by the stream's own word: two half pictures of different times
  std::optional<double> capture_rate_hz{};  ///< the camera's own, where the file tells it
  /// That of the file's time stamps where pictures are timed by the capture rate instead: slow
  /// motion, whose stamps are those of playing it.
  std::optional<double> played_rate_hz{};
  /// Width over height of a pixel of the upright picture, as the file says it is to be shown.
  double pixel_aspect = 1.0;
  int orientation = 1;  ///< how the stored pictures were turned to be upright, by Exif's numbers
};

/// Where in a rolling shutter's readout a point of the upright picture is exposed, 0 (first row) ..
/// 1: the rows are the stored picture's, whichever way it was turned.
[[nodiscard]] double readout_share(const VideoInfo& video, const Eigen::Vector2d& point_px);
/// How much that grows from one pixel to the next, along x and along y [1/px].
[[nodiscard]] Eigen::Vector2d readout_share_per_px(const VideoInfo& video);

struct SourceOptions {
  bool colour = false;
  std::optional<double>
      frame_rate_hz{};  ///< overrides the time stamps and the capture rate: slow motion, image
                        ///< sequences; a picture that is lost inside keeps its time all the same
  /// Just before each of these a picture is missing which the times do not show: those from there
  /// on are later than they say by the usual time between two.
  std::vector<std::int64_t> missing_frames{};
  std::optional<double>
      untimed_rate_hz{};     ///< of an image sequence where frame_rate_hz is not given
  std::string from{}, to{};  ///< "1.5" seconds or "f120" frames, inclusive; empty = all
  int decoder_threads = 0;   ///< 0 = the decoder's choice
  /// Only frames that decode alone, ever fewer of them the more there are, so that the others cost
  /// no decoding: a quick look over a long recording. Indices then count those handed out.
  bool key_frames_only = false;
  bool chroma = false;         ///< fill Frame::chroma where the coding has it
  bool apart_in_time = false;  ///< refuse a picture of the same time as the one before, or earlier
};

/// Frames in order from a video file or an image sequence: printf-style ("img/%04d.png"), a pattern
/// ("img/*.png") or a folder of images; a sequence needs one of the rates of SourceOptions.
/// Pictures whose names differ by a number come in its order, and those after one that is missing
/// keep index and time of theirs (where no more than half are).
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  [[nodiscard]] virtual const VideoInfo& info() const = 0;
  /// Next frame, or nothing at the end. Each returned frame owns its pixels.
  /// @throws InputError if the file breaks off before its promised end, or a picture of a series
  ///         cannot be decoded, has another size or was taken with the camera held another way, or
  ///         its pixel format cannot be read; the message says where. Also if no picture lies
  ///         between from and to.
  [[nodiscard]] virtual std::optional<Frame> next() = 0;
};

/// Silences the log of libavutil, which is the whole process': what is wrong with a recording is
/// told by what is thrown. Who wants that log sets its level again after each call.
/// @throws InputError (missing, not a video, no picture stream, no moments of a recording) before
/// any frame is handed out.
[[nodiscard]] std::unique_ptr<FrameSource> open_video(const std::filesystem::path& path,
                                                      const SourceOptions& options = {});
/// The files that hold a recording: itself, or the pictures of a sequence in the order they are
/// read and then those of its folder that are left out.  @throws InputError if a sequence has none.
[[nodiscard]] std::vector<std::filesystem::path> files_of_recording(
    const std::filesystem::path& path);
/// All pictures of a folder, by name. @throws InputError if there is none.
[[nodiscard]] std::vector<std::filesystem::path> pictures_in(const std::filesystem::path& folder);
/// SHA-256 of a video file; of an image sequence, of the list of its pictures' own in the order
/// they are read, one to a line.  @throws InputError if it is not there.
[[nodiscard]] std::string sha256_of_recording(const std::filesystem::path& path);
/// The same source decoded ahead in its own thread, with a bounded queue.
[[nodiscard]] std::unique_ptr<FrameSource> decode_ahead(std::unique_ptr<FrameSource> source,
                                                        int queue_length = 8);

}  // namespace trochoid::tracking
