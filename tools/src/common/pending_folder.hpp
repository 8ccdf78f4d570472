#pragma once
#include <filesystem>
#include <string>

#include "trochoid/data/error.hpp"

namespace trochoid::tools {

/// A folder beside `target` that becomes `target` on commit() and vanishes otherwise, by Ctrl-C
/// too, so that a command leaves all files of a folder or none. An existing folder is replaced; of
/// a link, the folder it leads to.
class PendingFolder {
 public:
  /// @throws InputError if the target cannot be written.
  explicit PendingFolder(std::filesystem::path target);
  ~PendingFolder();
  PendingFolder(const PendingFolder&) = delete;
  PendingFolder& operator=(const PendingFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return temporary_; }
  void commit();
  /// Runs `write`; what it complains about names the folder as the user knows it.
  template <class Write>
  auto told_by_its_name(const Write& write) const {
    try {
      return write();
    } catch (const InputError& error) {
      throw InputError(with_own_name(error.what()));
    }
  }

 private:
  [[nodiscard]] std::string with_own_name(std::string message) const;
  std::filesystem::path target_;  ///< as it was named
  std::filesystem::path place_, temporary_;
};

}  // namespace trochoid::tools
