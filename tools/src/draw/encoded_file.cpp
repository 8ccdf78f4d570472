#include "draw/encoded_file.hpp"

#include <fmt/format.h>

#include <csignal>
#include <fstream>
#include <utility>

#include "common/outputs.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

// The encoder does not always tell that the disk is full: looks at what it left.
void check_whole(const fs::path& written, std::int64_t pictures, const fs::path& target) {
  std::int64_t promised = -1;
  try {
    const auto source = tracking::open_video(written);
    promised = source->info().frames;
    if (promised == 0)  // a container that does not count: Matroska, a picture
      while (source->next()) ++promised;
  } catch (const InputError&) {  // told below, with the name the user knows
  }
  if (promised != pictures)
    throw InputError(
        fmt::format("{}: cannot be written whole: {} (is the disk full?)", target.string(),
                    promised < 0 ? "what the encoder left holds no picture"
                                 : fmt::format("{} of {} pictures are in it", promised, pictures)));
}

}  // namespace

std::string coding::h264(int crf) {
  return fmt::format("-c:v libx264 -crf {} -pix_fmt yuv420p", crf);
}

Workshop::Workshop(const fs::path& target) : folder_(data::pending_neighbour(target)) {
  std::error_code code;
  if (fs::create_directory(folder_, code)) return;
  data::discard_pending(folder_);
  throw InputError(fmt::format("{}: cannot be written: {}", target.string(), code.message()));
}

Workshop::~Workshop() {
  data::discard_pending(folder_);
}

EncodedFile::EncodedFile(const fs::path& target, cv::Size size, double rate_hz,
                         const std::string& coding)
    : target_(target),
      pending_(target),
      workshop_(target),
      file_(workshop_.file("coded" + target.extension().string())),
      log_(workshop_.file("ffmpeg.log")) {
  const std::string command = fmt::format(
      "ffmpeg -y -loglevel error -f rawvideo -pix_fmt bgr24 -s {}x{} -r {:.9g} -i - {} {} 2>{}",
      size.width, size.height, rate_hz, coding, shell_quoted(file_.string()),
      shell_quoted(log_.string()));
  std::signal(SIGPIPE, SIG_IGN);  // a missing encoder is told by write()
  pipe_ = popen(command.c_str(), "w");
  if (pipe_ == nullptr) fail();
}

void EncodedFile::write(const cv::Mat& picture) {
  const std::size_t row_bytes = static_cast<std::size_t>(picture.cols) * picture.elemSize();
  for (int row = 0; row < picture.rows; ++row)
    if (std::fwrite(picture.ptr(row), 1, row_bytes, pipe_) != row_bytes) fail();
  ++pictures_;
}

void EncodedFile::finish() {
  if (close() != 0) fail();
  check_whole(file_, pictures_, target_);
}

void EncodedFile::commit() {
  fs::rename(file_, pending_.path());
  pending_.commit();
}

int EncodedFile::close() {
  std::FILE* pipe = std::exchange(pipe_, nullptr);
  return pipe != nullptr ? pclose(pipe) : 0;
}

// With what the encoder itself has to say, which it has said when it has ended.
void EncodedFile::fail() {
  close();
  std::ifstream log(log_);
  std::string words;
  std::getline(log, words);
  throw InputError(fmt::format(
      "{}: cannot be encoded: {}", target_.string(),
      words.empty() ? "ffmpeg does not say why; is the disk full?" : "ffmpeg: " + words));
}

void write_picture(const cv::Mat& picture, const fs::path& path) {
  const std::string extension = path.extension().string();
  const bool jpeg = extension == ".jpg" || extension == ".jpeg";
  if (!jpeg && extension != ".png")
    throw InputError(fmt::format("{}: a picture is a .png or .jpg file", path.string()));
  EncodedFile file(path, picture.size(), 1.0, jpeg ? coding::kJpeg : coding::kPng);
  file.write(picture);
  file.finish();
  file.commit();
}

}  // namespace trochoid::tools
