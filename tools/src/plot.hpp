#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace trochoid::tools {

/// One line or point set of a plot. NaN breaks a line.
struct Series {
  std::string label;
  Eigen::VectorXd x, y;
  bool points = false;  ///< markers instead of a line
  bool dashed = false;
};

struct Axes {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;
  bool equal = false;  ///< the same length unit on both axes
  std::vector<Series> series;
};

/// Draws panels below each other as SVG or PNG, by the file's ending, in colours that colour-blind
/// readers tell apart. Drawn by gnuplot; whole file or none.
/// @throws InputError if gnuplot is not installed or the ending is another.
void write_plot(const std::vector<Axes>& panels, const std::filesystem::path& path);

}  // namespace trochoid::tools
