#include "common/pending_folder.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <utility>

#include "trochoid/data/io.hpp"

namespace trochoid::tools {

namespace fs = std::filesystem;

namespace {

/// "ring" of ring/ and ring/. too.
fs::path without_end(fs::path folder) {
  while (folder.has_relative_path() && folder.has_parent_path() &&
         (!folder.has_filename() || folder.filename() == "."))
    folder = folder.parent_path();
  return folder;
}

/// Where a link leads, also if nothing is there yet.
fs::path behind_links(fs::path folder) {
  constexpr int kMost = 40;  // as the system has it
  std::error_code code;
  for (int i = 0; i < kMost && fs::is_symlink(fs::symlink_status(folder, code)); ++i)
    folder = folder.parent_path() / fs::read_symlink(folder, code);
  return without_end(folder);
}

}  // namespace

PendingFolder::PendingFolder(fs::path target) : target_(without_end(std::move(target))) {
  std::error_code code;
  if (fs::equivalent(target_, ".", code))
    throw InputError(
        fmt::format("{}: is the folder that this is run in and cannot be replaced; name "
                    "one with -o",
                    target_.string()));
  place_ = behind_links(target_);
  if (fs::is_symlink(fs::symlink_status(place_, code)))
    throw InputError(
        fmt::format("{}: is a link that leads round in a circle; give a folder", target_.string()));
  if (fs::exists(place_, code) && !fs::is_directory(place_, code))
    throw InputError(fmt::format("{}: names a file; give a folder", target_.string()));
  const fs::path parent = place_.has_parent_path() ? place_.parent_path() : fs::path(".");
  if (!fs::is_directory(parent, code))
    throw InputError(fmt::format("{}: cannot be made, the folder {} does not exist",
                                 target_.string(), parent.string()));
  if (::access(parent.c_str(), W_OK) != 0)
    throw InputError(fmt::format("{}: cannot be made, the folder {} does not allow it",
                                 target_.string(), parent.string()));
  temporary_ = data::pending_neighbour(place_);
  if (!fs::create_directory(temporary_, code)) {
    data::discard_pending(temporary_);
    throw InputError(fmt::format("{}: cannot be made: {}", target_.string(),
                                 code ? code.message() : "its neighbour exists"));
  }
}

PendingFolder::~PendingFolder() {
  if (!temporary_.empty()) data::discard_pending(temporary_);
}

std::string PendingFolder::with_own_name(std::string message) const {
  const std::string temporary = temporary_.string(), own = target_.string();
  for (std::size_t at = 0; (at = message.find(temporary, at)) != std::string::npos;
       at += own.size())
    message.replace(at, temporary.size(), own);
  return message;
}

void PendingFolder::commit() {
  if (const std::error_code code = data::rename_pending(temporary_, place_))
    throw InputError(fmt::format("{}: cannot be written: {}", target_.string(), code.message()));
  temporary_.clear();
}

}  // namespace trochoid::tools
