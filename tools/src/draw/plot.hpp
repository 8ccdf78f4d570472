#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace trochoid::tools {

/// One line or point set of a plot. NaN breaks a line.
struct Series {
  std::string label;
  Eigen::VectorXd x, y;
  bool points = false;  ///< markers instead of a line
  bool dashed = false;
  int colour = -1;  ///< place in the palette; -1: the place in the list
};

/// The series of an angle within one turn, with a gap where it jumps from one end of the turn to
/// the other: no line is drawn across.
[[nodiscard]] Series with_gaps_at_turns(const Series& angle_rad);

struct Axes {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;
  bool equal = false;  ///< the same length unit on both axes; a path without width gets some room
  std::vector<Series> series;
  std::optional<Eigen::Vector2d> y_range{};  ///< lowest and highest y shown; all of it if absent
};

/// Draws panels below each other, more than three in two columns, as SVG or PNG, by the file's
/// ending, in colours that colour-blind readers tell apart. Drawn by gnuplot; whole file or none.
/// @throws InputError if gnuplot is not installed or draws nothing (with its own last word), or the
/// ending is another.
void write_plot(const std::vector<Axes>& panels, const std::filesystem::path& path);
/// To be known before long work. @throws InputError if the ending is neither .svg nor .png.
void check_plot_name(const std::filesystem::path& path);

}  // namespace trochoid::tools
