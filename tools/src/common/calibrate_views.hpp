#pragma once
#include <cstddef>
#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "trochoid/tracking/calibration.hpp"

namespace trochoid::tools {

/// Pictures with the board found in them, all of one size and taken with the camera held one way.
struct BoardViews {
  std::vector<tracking::BoardView> found;
  std::vector<cv::Mat> pictures;  ///< of `found`
  cv::Size size;
  std::string floor;  ///< the one of the floor, by its name in `found`; empty: not said
  std::string first;  ///< file that shows the floor if none is said to
  int looked_at = 0;
  std::string other_board;  ///< what is seen of one that was not looked for, in words
  std::optional<int> orientation;

  /// Turned upright, pictures taken with the camera the other way up are another camera's: its
  /// principal point is mirrored.
  /// @throws InputError naming the picture that was
  void held_alike(int one, const std::string& name);

  /// Looks for the board in a picture.
  /// @throws InputError naming a picture that has another size than those before it
  void look(const cv::Mat& luma, const std::string& name, const tracking::BoardPattern& pattern);
};

/// All pictures and videos, those of folders and patterns one by one; that of the floor first if it
/// is one.
/// @param floor  file, or name of one among the inputs, that shows the board on the floor; may be
///   empty
/// @throws InputError for files that are none
[[nodiscard]] std::vector<std::filesystem::path> board_files(
    const std::vector<std::filesystem::path>& inputs, const std::string& floor);

/// Looks for the board in all of board_files, each picture once.
/// @throws InputError for files that cannot be read, and for fewer than three views
[[nodiscard]] BoardViews look_at_inputs(const std::vector<std::filesystem::path>& inputs,
                                        const std::string& floor,
                                        const tracking::BoardPattern& pattern);

/// What contradicts the rest is told, and wrong corners are gone from their views.
void set_aside(const tracking::Calibration& result, BoardViews& views);

[[nodiscard]] bool is_left_out(const tracking::Calibration& result, std::size_t view);

/// Which of `found` shows the board on the floor.
/// @param floor  as board_files has it
/// @throws InputError where none does
[[nodiscard]] std::size_t floor_view(const std::string& floor, const BoardViews& views);

}  // namespace trochoid::tools
