#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace trochoid::tracking {

/// A recording stored as pictures, one to a file.
struct ImageSequence {
  /// By number where that alone tells their names apart (of "p9.png" and "p10.png" the latter comes
  /// second), else by name, numbers in it by value.
  std::vector<std::filesystem::path> pictures;
  /// The frames they show, from 0 on. A number that is missing is a frame that was lost; where more
  /// than half are, numbers count something else and only order the pictures. Every tenth picture
  /// kept, say, is no gap.
  std::vector<std::int64_t> frames;
  /// Of a folder, those of the same type that are named unlike the numbered ones, its majority.
  std::vector<std::filesystem::path> left_out;

  [[nodiscard]] std::int64_t missing() const {
    return frames.back() + 1 - static_cast<std::int64_t>(frames.size());
  }
};

/// The pictures of a folder (of the type it holds most of), of a numbered series ("img/%04d.png")
/// or that match a pattern ("img/*.png"); nothing for any other path.
/// @throws InputError if there are none, or two have the same number.
[[nodiscard]] std::optional<ImageSequence> find_image_sequence(const std::filesystem::path& path);

}  // namespace trochoid::tracking
