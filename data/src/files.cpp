#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <memory>
#include <mutex>
#include <set>
#include <sstream>
#include <vector>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {
namespace fs = std::filesystem;
namespace {

// A device or a pipe (/dev/stdout) must be written into, never replaced by a rename.
bool is_special(const fs::path& target) {
  std::error_code code;
  const auto status = fs::status(target, code);
  return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

/// Temporary paths of this process. Whoever turns one into its target or removes it holds the lock,
/// so that remove_pending() never meets a half-made change.
struct Pending {
  std::mutex mutex;
  std::set<fs::path> paths;
};
Pending& pending() {
  static Pending all;
  return all;
}

bool is_alive(long process) {
  return ::kill(static_cast<pid_t>(process), 0) == 0 || errno != ESRCH;
}

// ".STEM." of a temporary neighbour. A name has 255 bytes at most, and the neighbour's holds more
// than its target's: of a long one it has the beginning.
std::string head_of_pending(const fs::path& target) {
  constexpr std::size_t kLongest = 160;
  return fmt::format(".{}.", target.stem().string().substr(0, kLongest));
}

// What a killed process left beside the target: ".STEM.PID-N.partial.EXT" of no living process.
void sweep(const fs::path& target, const fs::path& folder) {
  const std::string head = head_of_pending(target);
  const std::string tail = ".partial" + target.extension().string();
  std::error_code code;
  for (fs::directory_iterator entry(folder, code), end; !code && entry != end;
       entry.increment(code)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with(head) || !name.ends_with(tail) ||
        name.size() <= head.size() + tail.size())
      continue;
    long process = 0;
    const char* last = name.data() + name.size() - tail.size();
    const auto [rest, error] = std::from_chars(name.data() + head.size(), last, process);
    std::error_code ignored;
    if (error == std::errc() && *rest == '-' && process > 0 && !is_alive(process))
      fs::remove_all(entry->path(), ignored);
  }
}

// What a rename has to replace: the file a link points to, not the link.
fs::path resolved(const fs::path& target) {
  std::error_code code;
  if (!fs::is_symlink(fs::symlink_status(target, code))) return target;
  const fs::path real = fs::weakly_canonical(target, code);
  return code ? target : real;
}

}  // namespace

void check_writable(const fs::path& given) {
  const fs::path target = is_special(given) ? given : resolved(given);
  std::error_code code;
  if (given.empty()) throw InputError("the name of a file to write is empty");
  if (target.filename().empty() || fs::is_directory(target, code))
    throw InputError(fmt::format("{}: is a folder, name a file to write", target.string()));
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, code))
    throw InputError(fmt::format(
        "{}: cannot be written, {}", target.string(),
        fs::exists(folder, code) ? folder.string() + " is no folder"
                                 : fmt::format("the folder {} does not exist", folder.string())));
  // A rename would replace it all the same; whoever protected it did not want that.
  if (fs::exists(target, code) && ::access(target.c_str(), W_OK) != 0)
    throw InputError(
        fmt::format("{}: cannot be written, the file is write-protected", target.string()));
  if (!is_special(target) && ::access(folder.c_str(), W_OK) != 0)
    throw InputError(fmt::format("{}: cannot be written, the folder {} does not allow it",
                                 target.string(), folder.string()));
}

fs::path pending_neighbour(const fs::path& target) {
  static std::atomic<int> counter{0};
  const fs::path folder = is_special(target)         ? fs::temp_directory_path()
                          : target.has_parent_path() ? target.parent_path()
                                                     : fs::path(".");
  sweep(target, folder);
  // The extension stays last: video encoders choose the container by it.
  const fs::path path = folder / fmt::format("{}{}-{}.partial{}", head_of_pending(target),
                                             ::getpid(), counter++, target.extension().string());
  const std::lock_guard lock(pending().mutex);
  pending().paths.insert(path);
  return path;
}

void discard_pending(const fs::path& path) noexcept {
  const std::lock_guard lock(pending().mutex);
  std::error_code ignored;
  fs::remove_all(path, ignored);
  pending().paths.erase(path);
}

std::error_code rename_pending(const fs::path& path, const fs::path& target) {
  const std::lock_guard lock(pending().mutex);
  std::error_code code;
  // A folder cannot be renamed over another; exchanged in one step, neither is ever missing.
  if (fs::is_directory(target, code) && fs::is_directory(path, code) &&
      !fs::is_empty(target, code)) {
    if (::renameat2(AT_FDCWD, path.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0) {
      fs::remove_all(path, code);
      code.clear();  // what is left of the old folder is no fault of the new one
    } else {         // a file system that cannot: the old one goes first
      fs::remove_all(target, code);
      if (!code) fs::rename(path, target, code);
    }
  } else {
    fs::rename(path, target, code);
  }
  if (!code) pending().paths.erase(path);
  return code;
}

void remove_pending_and_stop() {
  pending().mutex.lock();
  constexpr int kTries = 20;  // a writer may put a file into a folder while it is being emptied
  for (const fs::path& path : pending().paths) {
    std::error_code code;
    for (int i = 0; i < kTries && fs::exists(path, code); ++i) fs::remove_all(path, code);
  }
}

PendingFile::PendingFile(fs::path target) : target_(std::move(target)) {
  if (!is_special(target_)) target_ = resolved(target_);
  check_writable(target_);
  temporary_ = pending_neighbour(target_);
}

PendingFile::~PendingFile() {
  if (!temporary_.empty()) discard_pending(temporary_);
}

void PendingFile::commit() {
  if (is_special(target_)) {
    std::ifstream in(temporary_, std::ios::binary);
    std::ofstream out(target_, std::ios::binary);
    out << in.rdbuf() << std::flush;
    if (!out) throw InputError(fmt::format("{}: cannot be written", target_.string()));
    discard_pending(temporary_);
  } else if (const std::error_code code = rename_pending(temporary_, target_)) {
    throw InputError(fmt::format("{}: cannot be written: {}", target_.string(), code.message()));
  }
  temporary_.clear();
}

void write_text(const std::string& text, const fs::path& path) {
  PendingFile pending(path);
  std::ofstream out(pending.path(), std::ios::binary);
  out << text << std::flush;
  if (!out)
    throw InputError(fmt::format("{}: cannot be written (is the disk full?)", path.string()));
  out.close();
  pending.commit();
}

namespace {

std::string sha256_of_stream(std::istream& in, const std::string& name) {
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context(EVP_MD_CTX_new(),
                                                                        EVP_MD_CTX_free);
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int length = 0;
  bool good = context && EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr) == 1;
  std::vector<char> chunk(std::size_t{1} << 18);
  while (good &&
         (in.read(chunk.data(), static_cast<std::streamsize>(chunk.size())) || in.gcount() > 0))
    good =
        EVP_DigestUpdate(context.get(), chunk.data(), static_cast<std::size_t>(in.gcount())) == 1;
  if (in.bad()) throw InputError(fmt::format("{}: reading failed", name));
  good = good && EVP_DigestFinal_ex(context.get(), digest.data(), &length) == 1;
  if (!good) throw InputError(fmt::format("{}: no SHA-256 could be computed", name));
  std::string hex;
  for (unsigned int i = 0; i < length; ++i) hex += fmt::format("{:02x}", digest[i]);
  return hex;
}

}  // namespace

std::string sha256_of_file(const fs::path& path) {
  std::error_code code;
  if (fs::is_directory(path, code))
    throw InputError(fmt::format("{}: is a folder, expected a file", path.string()));
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(fmt::format("{}: no such file, or it cannot be read", path.string()));
  return sha256_of_stream(file, path.string());
}

std::string sha256_of_text(const std::string& text) {
  std::istringstream in(text);
  return sha256_of_stream(in, "text");
}

}  // namespace trochoid::data
