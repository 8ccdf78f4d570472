#pragma once
#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

namespace trochoid::data {

/// Named numeric columns with '#' header lines: trajectories, studies, truth files. Units are in
/// the column names.
struct Table {
  /// A run that asks for more rows, a few GB of trajectory, is refused: surely a slip of the pen.
  static constexpr double kMostRows = 1e7;
  std::vector<std::pair<std::string, std::string>> header;  ///< key, value lines
  std::vector<std::string> columns;
  Eigen::MatrixXd values;  ///< rows x columns; NaN = empty cell
  std::string file{};      ///< where it was read from, for messages; empty if it was made

  [[nodiscard]] bool has(const std::string& column) const;
  /// @throws InputError naming the file, the column and those there are.
  [[nodiscard]] Eigen::VectorXd column(const std::string& name) const;
  /// Makes `values` of cells, row after row; their number is a multiple of that of the columns.
  void set_rows(const std::vector<double>& cells);
};

}  // namespace trochoid::data
