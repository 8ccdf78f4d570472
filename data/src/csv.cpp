#include "csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "text.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::data {
namespace {

constexpr std::size_t kMaxColumns = 4096;

// Spreadsheets put quotes round some texts; a cell that holds quotes or commas of its own is none
// of a table of numbers.
std::string_view without_quotes(std::string_view cell) {
  const bool quoted = cell.size() >= 2 && cell.front() == '"' && cell.back() == '"';
  return quoted ? trimmed(cell.substr(1, cell.size() - 2)) : cell;
}

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> cells;
  while (cells.size() <= kMaxColumns) {
    const auto comma = line.find(',');
    cells.push_back(without_quotes(trimmed(line.substr(0, comma))));
    if (comma == std::string_view::npos) break;
    line.remove_prefix(comma + 1);
  }
  return cells;
}

void check_columns(const std::vector<std::string>& columns, const std::string& place) {
  if (columns.size() > kMaxColumns)
    throw InputError(
        fmt::format("{}: more than {} columns, not a file of this kind", place, kMaxColumns));
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (columns[i].empty())
      throw InputError(fmt::format("{}: column {} has no name", place, i + 1));
    const auto starts_as_name = [](char c) {
      return std::isalpha(static_cast<unsigned char>(c)) || c == '_';
    };
    if (columns[i].front() == '{')
      throw InputError(fmt::format("{}: is JSON, where a table (CSV) is read", place));
    if (columns[i].front() == '"' || columns[i].front() == '\'')
      throw InputError(
          fmt::format("{}: {} is no column name; remove the quotes", place, in_quotes(columns[i])));
    if (!starts_as_name(columns[i].front()))
      throw InputError(fmt::format(
          "{}: {} is no column name; the first line must name the columns, e.g. t_s,x_m,y_m", place,
          in_quotes(columns[i])));
    if (std::find(columns.begin(), columns.begin() + static_cast<std::ptrdiff_t>(i), columns[i]) !=
        columns.begin() + static_cast<std::ptrdiff_t>(i))
      throw InputError(fmt::format("{}: column {} is there twice", place, in_quotes(columns[i])));
  }
}

}  // namespace

CsvReader::CsvReader(std::string_view text, std::string where)
    : text_(text), where_(std::move(where)) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text_.starts_with(kByteOrderMark)) text_.remove_prefix(kByteOrderMark.size());
  std::string_view line;
  if (!next_content_line(line))
    throw InputError(fmt::format("{}: {}", where_,
                                 text_.empty() ? "the file is empty" : "holds no column names"));
  for (const std::string_view name : split(line)) columns_.emplace_back(name);
  check_columns(columns_, place());
}

bool CsvReader::next_content_line(std::string_view& line) {
  while (position_ < text_.size()) {
    const auto end = std::min(text_.find('\n', position_), text_.size());
    line = trimmed(text_.substr(position_, end - position_));
    position_ = end + 1;
    ++line_;
    if (line.empty()) continue;
    if (line.front() != '#' && !line.starts_with("\"#")) return true;
    keep_header(line);
  }
  return false;
}

void CsvReader::keep_header(std::string_view line) {
  while (line.ends_with(',')) line.remove_suffix(1);  // spreadsheets fill up all rows alike
  line = without_quotes(line).substr(1);
  const auto colon = line.find(": ");
  const bool has_value = colon != std::string_view::npos;
  header_.emplace_back(one_line(trimmed(line.substr(0, colon))),
                       has_value ? std::string(trimmed(line.substr(colon + 2))) : std::string());
}

int CsvReader::index_of(std::string_view column) const {
  const auto found = std::find(columns_.begin(), columns_.end(), column);
  return found == columns_.end() ? -1 : static_cast<int>(found - columns_.begin());
}

bool CsvReader::next() {
  const auto is_empty = [](std::string_view cell) { return cell.empty(); };
  do {
    std::string_view line;
    if (!next_content_line(line)) return false;
    cells_ = split(line);
  } while (cells_.size() == columns_.size() && std::all_of(cells_.begin(), cells_.end(), is_empty));
  if (cells_.size() != columns_.size())
    throw InputError(fmt::format(
        "{}: {} cells where the header names {} columns", place(),
        cells_.size() > kMaxColumns ? "too many" : std::to_string(cells_.size()), columns_.size()));
  return true;
}

double CsvReader::number(int column) const {
  if (column < 0 || cells_[column].empty()) return std::numeric_limits<double>::quiet_NaN();
  std::string_view cell = cells_[column];
  if (cell.size() > 1 && cell.front() == '+' && cell[1] != '-') cell.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  const bool whole = error == std::errc() && end == cell.data() + cell.size();
  if (!whole || !std::isfinite(value))
    throw InputError(
        fmt::format("{}: {} = {} is not a finite number; leave the cell empty if unknown", place(),
                    columns_[column], in_quotes(cells_[column])));
  return value;
}

std::string CsvReader::place() const {
  return fmt::format("{}:{}", where_, line_);
}

std::string header_line(std::string_view key, std::string_view value) {
  std::string line = value.empty() ? fmt::format("# {}", key) : fmt::format("# {}: {}", key, value);
  for (char& c : line)
    if (c == '\n' || c == '\r') c = ' ';
  return line + '\n';
}

}  // namespace trochoid::data
