#include "draw/encoded_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>

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

bool is_jpeg(const fs::path& path) {
  return path.extension() == ".jpg" || path.extension() == ".jpeg";
}

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream words(line);
  return {std::istream_iterator<std::string>(words), {}};
}

[[noreturn]] void fail_to_start(const fs::path& target, int error) {
  throw InputError(fmt::format("{}: cannot be encoded: ffmpeg does not start: {}{}",
                               target.string(), std::strerror(error),
                               error == ENOENT ? "; is it installed?" : ""));
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
  std::vector<std::string> words = words_of(
      fmt::format("ffmpeg -y -loglevel error -f rawvideo -pix_fmt bgr24 -s {}x{} -r {:.9g} -i - {}",
                  size.width, size.height, rate_hz, coding));
  // Else a colon or a dash in the name would be ffmpeg's own.
  words.push_back("file:" + fs::absolute(file_).string());
  start(words);
}

void EncodedFile::start(const std::vector<std::string>& words) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  int ends[2];  // to read from, to write to
  if (pipe2(ends, O_CLOEXEC) != 0) fail_to_start(target_, errno);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, log_.c_str(), O_WRONLY | O_CREAT, 0600);
  const int error =
      posix_spawnp(&encoder_, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[0]);
  pipe_ = fdopen(ends[1], "w");
  const int cause = pipe_ == nullptr ? errno : error;
  if (pipe_ == nullptr) ::close(ends[1]);
  if (error != 0) encoder_ = 0;
  if (cause != 0) {
    close();
    fail_to_start(target_, cause);
  }
}

void EncodedFile::write(const cv::Mat& picture) {
  const std::size_t row_bytes = static_cast<std::size_t>(picture.cols) * picture.elemSize();
  for (int row = 0; row < picture.rows; ++row)
    if (std::fwrite(picture.ptr(row), 1, row_bytes, pipe_) != row_bytes) fail(close());
  ++pictures_;
}

void EncodedFile::finish() {
  if (const int status = close(); status != 0) fail(status);
  check_whole(file_, pictures_, target_);
}

void EncodedFile::commit() {
  fs::rename(file_, pending_.path());
  pending_.commit();
}

// Lets the encoder end. @returns its status as waitpid() has it.
int EncodedFile::close() {
  if (pipe_ != nullptr) std::fclose(std::exchange(pipe_, nullptr));
  int status = 0;
  const pid_t encoder = std::exchange(encoder_, 0);
  while (encoder > 0 && waitpid(encoder, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

// With what the encoder itself has to say, which it has said when it has ended.
void EncodedFile::fail(int status) {
  std::ifstream log(log_);
  std::string words;
  while (words.empty() && std::getline(log, words)) {
  }
  if (words.empty())
    words = (WIFSIGNALED(status) ? fmt::format("was ended by signal {}", WTERMSIG(status))
                                 : fmt::format("ended with status {}", WEXITSTATUS(status))) +
            " and does not say why; is the disk full?";
  throw InputError(fmt::format("{}: cannot be encoded: ffmpeg: {}", target_.string(), words));
}

void check_picture_name(const fs::path& path) {
  if (path.extension() != ".png" && !is_jpeg(path))
    throw InputError(fmt::format("{}: a picture is a .png or .jpg file", path.string()));
}

void write_picture(const cv::Mat& picture, const fs::path& path) {
  check_picture_name(path);
  EncodedFile file(path, picture.size(), 1.0, is_jpeg(path) ? coding::kJpeg : coding::kPng);
  file.write(picture);
  file.finish();
  file.commit();
}

}  // namespace trochoid::tools
