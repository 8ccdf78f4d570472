#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "decode/libav_handles.hpp"

namespace trochoid::tracking {

/// How libavformat is to be asked for a path: a file, a numbered series ("img/%04d.png") or all
/// images that match a pattern ("img/*.png", in the order of their names).
struct ImageSequence {
  enum class Kind { file, numbered, pattern };
  Kind kind = Kind::file;
  std::string url;
  int first_number = 0;

  [[nodiscard]] bool is_sequence() const { return kind != Kind::file; }
};

/// A folder becomes the pattern of the image type it holds most of.
/// @throws InputError if a folder or series holds no image.
[[nodiscard]] ImageSequence find_image_sequence(const std::filesystem::path& path);

/// The pictures of a sequence in the order they are read.
[[nodiscard]] std::vector<std::filesystem::path> pictures_of(const ImageSequence& sequence);

/// @param frame_rate_hz rate given to a sequence.  @throws InputError in libav's words.
[[nodiscard]] InputHandle open_input(const ImageSequence& sequence,
                                     std::optional<double> frame_rate_hz, const std::string& name);

}  // namespace trochoid::tracking
