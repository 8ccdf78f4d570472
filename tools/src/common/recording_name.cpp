#include "common/recording_name.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

bool names_many(const fs::path& path) {
  std::error_code ignored;
  return path.filename().string().find_first_of("%*?[") != std::string::npos &&
         !fs::exists(path, ignored);
}

}  // namespace

std::string recording_name(const fs::path& recording) {
  std::error_code ignored;
  fs::path path = fs::absolute(recording, ignored).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  if (!names_many(path)) return path.stem().string();
  while (names_many(path)) path = path.parent_path();
  return path.has_filename() ? path.filename().string() : "pictures";
}

}  // namespace trochoid::tools
