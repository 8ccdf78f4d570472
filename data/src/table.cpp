#include "trochoid/data/table.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "text.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::data {

bool Table::has(const std::string& column) const {
  return std::find(columns.begin(), columns.end(), column) != columns.end();
}

Eigen::VectorXd Table::column(const std::string& name) const {
  const auto found = std::find(columns.begin(), columns.end(), name);
  if (found == columns.end())
    throw InputError(fmt::format("{}: there is no column {}; there are {}",
                                 file.empty() ? "table" : file, name, join(columns, ",")));
  return values.col(found - columns.begin());
}

void Table::set_rows(const std::vector<double>& cells) {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto width = static_cast<Eigen::Index>(columns.size());
  values = Eigen::Map<const RowMajor>(cells.data(), static_cast<Eigen::Index>(cells.size()) / width,
                                      width);
}

}  // namespace trochoid::data
