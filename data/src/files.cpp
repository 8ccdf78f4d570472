#include <fmt/format.h>
#include <openssl/evp.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <fstream>
#include <memory>
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

fs::path neighbour_of(const fs::path& target) {
  static std::atomic<int> counter{0};
  // The extension stays last: video encoders choose the container by it.
  const std::string name = fmt::format(".{}.{}-{}.partial{}", target.stem().string(), ::getpid(),
                                       counter++, target.extension().string());
  return (is_special(target) ? fs::temp_directory_path() : target.parent_path()) / name;
}

void check_target(const fs::path& target) {
  std::error_code code;
  if (target.filename().empty() || fs::is_directory(target, code))
    throw InputError(fmt::format("{}: is a folder, name a file to write", target.string()));
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, code))
    throw InputError(fmt::format("{}: cannot be written, the folder {} does not exist",
                                 target.string(), folder.string()));
  if (!is_special(target) && ::access(folder.c_str(), W_OK) != 0)
    throw InputError(fmt::format("{}: cannot be written, the folder {} does not allow it",
                                 target.string(), folder.string()));
}

// What a rename has to replace: the file a link points to, not the link.
fs::path resolved(const fs::path& target) {
  std::error_code code;
  if (!fs::is_symlink(fs::symlink_status(target, code))) return target;
  const fs::path real = fs::weakly_canonical(target, code);
  return code ? target : real;
}

}  // namespace

PendingFile::PendingFile(fs::path target) : target_(std::move(target)) {
  if (!is_special(target_)) target_ = resolved(target_);
  check_target(target_);
  temporary_ = neighbour_of(target_);
}

PendingFile::~PendingFile() {
  std::error_code ignored;
  if (!temporary_.empty()) fs::remove(temporary_, ignored);
}

void PendingFile::commit() {
  std::error_code code;
  if (is_special(target_)) {
    std::ifstream in(temporary_, std::ios::binary);
    std::ofstream out(target_, std::ios::binary);
    out << in.rdbuf() << std::flush;
    if (!out) throw InputError(fmt::format("{}: cannot be written", target_.string()));
    fs::remove(temporary_, code);
  } else {
    fs::rename(temporary_, target_, code);
    if (code)
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

std::string sha256_of_file(const fs::path& path) {
  std::error_code code;
  if (fs::is_directory(path, code))
    throw InputError(fmt::format("{}: is a folder, expected a file", path.string()));
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(fmt::format("{}: no such file, or it cannot be read", path.string()));
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context(EVP_MD_CTX_new(),
                                                                        EVP_MD_CTX_free);
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int length = 0;
  bool good = context && EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr) == 1;
  std::vector<char> chunk(std::size_t{1} << 18);
  while (good &&
         (file.read(chunk.data(), static_cast<std::streamsize>(chunk.size())) || file.gcount() > 0))
    good =
        EVP_DigestUpdate(context.get(), chunk.data(), static_cast<std::size_t>(file.gcount())) == 1;
  good = good && EVP_DigestFinal_ex(context.get(), digest.data(), &length) == 1;
  if (!good) throw InputError(fmt::format("{}: no SHA-256 could be computed", path.string()));
  std::string hex;
  for (unsigned int i = 0; i < length; ++i) hex += fmt::format("{:02x}", digest[i]);
  return hex;
}

}  // namespace trochoid::data
