#pragma once
#include <sys/types.h>

#include <cstdio>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "trochoid/data/io.hpp"

namespace trochoid::tools {

/// How ffmpeg is told to code, in words of its command line with a blank between two.
namespace coding {
/// H.264 for any player; `crf` from 0 (best) to 51. Sides must be even.
[[nodiscard]] std::string h264(int crf);
/// The same, coded fast, for what is drawn to be looked at.
inline constexpr const char* kForViewing = "-c:v libx264 -preset veryfast -crf 20 -pix_fmt yuv420p";
inline constexpr const char* kLossless = "-c:v ffv1 -pix_fmt bgr0";
/// One picture, whatever a % in its path may look like.
inline constexpr const char* kPng = "-update 1 -c:v png -pred mixed";
inline constexpr const char* kJpeg = "-update 1 -c:v mjpeg -q:v 2 -pix_fmt yuvj444p";
}  // namespace coding

/// A folder for what another process writes. Once it is gone, by its end or by Ctrl-C, a process
/// that was only just starting can leave nothing behind.
class Workshop {
 public:
  explicit Workshop(const std::filesystem::path& target);
  ~Workshop();
  Workshop(const Workshop&) = delete;
  Workshop& operator=(const Workshop&) = delete;
  [[nodiscard]] std::filesystem::path file(const std::filesystem::path& name) const {
    return folder_ / name;
  }

 private:
  std::filesystem::path folder_;
};

/// Pictures of one size on their way into a video, or a single one into a picture file, that comes
/// to be whole or not at all. An ffmpeg process codes them: libavcodec's own encoders would tie us
/// to one version of its options, OpenCV's writers load two hundred libraries into every command.
/// The program ignores SIGPIPE: an encoder that ended early is told by write().
class EncodedFile {
 public:
  /// The kind of file goes by the ending of `target`. @throws InputError naming `target`, here and
  /// below.
  EncodedFile(const std::filesystem::path& target, cv::Size size, double rate_hz,
              const std::string& coding);
  ~EncodedFile() { close(); }
  EncodedFile(const EncodedFile&) = delete;
  EncodedFile& operator=(const EncodedFile&) = delete;
  /// CV_8UC3 in OpenCV's order of colours, of the size promised.
  void write(const cv::Mat& picture);
  /// Ends the coding and looks whether every picture arrived.
  void finish();
  /// After finish(): the file takes its place.
  void commit();

 private:
  void start(const std::vector<std::string>& words);
  int close();
  [[noreturn]] void fail(int status);

  std::filesystem::path target_;
  data::PendingFile pending_;
  Workshop workshop_;
  std::filesystem::path file_, log_;
  std::FILE* pipe_ = nullptr;
  pid_t encoder_ = 0;
  std::int64_t pictures_ = 0;
};

/// Before the work. @throws InputError unless a picture is named .png or .jpg.
void check_picture_name(const std::filesystem::path& path);

/// Writes a picture whole or not at all. @throws InputError unless it is named so and can be
/// written.
void write_picture(const cv::Mat& picture, const std::filesystem::path& path);

}  // namespace trochoid::tools
