#include "common/pending_folder.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <utility>

#include "trochoid/data/io.hpp"

namespace trochoid::tools {

namespace fs = std::filesystem;

PendingFolder::PendingFolder(fs::path target) : target_(std::move(target)) {
  std::error_code code;
  if (!target_.has_filename()) target_ = target_.parent_path();
  const fs::path parent = target_.has_parent_path() ? target_.parent_path() : fs::path(".");
  if (!fs::is_directory(parent, code))
    throw InputError(fmt::format("{}: cannot be made, the folder {} does not exist",
                                 target_.string(), parent.string()));
  if (::access(parent.c_str(), W_OK) != 0)
    throw InputError(fmt::format("{}: cannot be made, the folder {} does not allow it",
                                 target_.string(), parent.string()));
  temporary_ = data::pending_neighbour(target_);
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
  if (const std::error_code code = data::rename_pending(temporary_, target_))
    throw InputError(fmt::format("{}: cannot be written: {}", target_.string(), code.message()));
  temporary_.clear();
}

}  // namespace trochoid::tools
