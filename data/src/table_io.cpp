#include <fmt/format.h>

#include <cmath>

#include "csv.hpp"
#include "text.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {

Table read_table(const std::filesystem::path& path) {
  const std::string text = read_text(path, std::size_t{1} << 30);
  CsvReader csv(text, path.string());
  Table table;
  table.file = path.string();
  table.columns = csv.columns();
  std::vector<double> cells;
  while (csv.next())
    for (int i = 0; i < static_cast<int>(table.columns.size()); ++i)
      cells.push_back(csv.unknown(i) ? std::numeric_limits<double>::quiet_NaN() : csv.number(i));
  table.header = csv.header();
  table.set_rows(cells);
  return table;
}

void write_table(const Table& table, const std::filesystem::path& path) {
  if (table.values.cols() != static_cast<Eigen::Index>(table.columns.size()))
    throw InputError(fmt::format("{}: {} columns of values for {} column names", path.string(),
                                 table.values.cols(), table.columns.size()));
  fmt::memory_buffer out;
  const auto end = std::back_inserter(out);
  for (const auto& [key, value] : table.header) fmt::format_to(end, "{}", header_line(key, value));
  fmt::format_to(end, "{}\n", join(table.columns, ","));
  for (Eigen::Index row = 0; row < table.values.rows(); ++row)
    for (Eigen::Index column = 0; column < table.values.cols(); ++column) {
      const double value = table.values(row, column);
      if (!std::isnan(value)) fmt::format_to(end, "{}", value);
      out.push_back(column + 1 < table.values.cols() ? ',' : '\n');
    }
  write_text(fmt::to_string(out), path);
}

}  // namespace trochoid::data
