#include "csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
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

// Names without quotes hold none of these: where there is no comma, another one separates them.
char separator_of(std::string_view names) {
  std::string bare;
  bool quoted = false;
  for (const char c : names) {
    if (c == '"') quoted = !quoted;
    if (!quoted) bare += c;
  }
  for (const char separator : {',', ';', '\t'})
    if (bare.find(separator) != std::string::npos) return separator;
  return ',';
}

// A first line that tells spreadsheets what separates cells, as the names do.
bool tells_separator(std::string_view line) {
  constexpr std::string_view kWord = "sep=";
  return trimmed(line).starts_with(kWord) && trimmed(line).size() <= kWord.size() + 1;
}

void check_columns(const std::vector<std::string>& columns, const std::string& place) {
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (columns[i].empty())
      throw InputError(fmt::format(
          "{}: column {} has no name; give it one, or leave it out (pandas: index=False)", place,
          i + 1));
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
  bool any = next_content_line(line);
  if (any && tells_separator(line)) any = next_content_line(line);
  if (!any)
    throw InputError(fmt::format("{}: {}", where_,
                                 text_.empty() ? "the file is empty" : "holds no column names"));
  separator_ = separator_of(trimmed(line));
  for (const std::string_view name : split(line)) columns_.emplace_back(name);
  if (columns_.size() > kMaxColumns)
    throw InputError(
        fmt::format("{}: more than {} columns, not a file of this kind", place(), kMaxColumns));
  for (; columns_.size() > 1 && columns_.back().empty(); ++spare_) columns_.pop_back();
  check_columns(columns_, place());
}

bool CsvReader::next_content_line(std::string_view& line) {
  while (position_ < text_.size()) {
    const auto end = std::min(text_.find('\n', position_), text_.size());
    line = text_.substr(position_, end - position_);
    position_ = end + 1;
    ++line_;
    const std::string_view content = trimmed(line);
    if (content.empty()) continue;
    if (content.front() != '#' && !content.starts_with("\"#")) return true;
    keep_header(content);
  }
  return false;
}

// Outermost tabs are blanks unless they separate: then there is an empty cell beside them.
std::vector<std::string_view> CsvReader::split(std::string_view line) const {
  if (separator_ != '\t') line = trimmed(line);
  std::vector<std::string_view> cells;
  while (cells.size() <= kMaxColumns) {
    const auto end = line.find(separator_);
    cells.push_back(without_quotes(trimmed(line.substr(0, end))));
    if (end == std::string_view::npos) break;
    line.remove_prefix(end + 1);
  }
  return cells;
}

void CsvReader::keep_header(std::string_view line) {
  // Spreadsheets fill up all rows alike.
  while (line.ends_with(',') || line.ends_with(';')) line.remove_suffix(1);
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
    const std::size_t most = columns_.size() + spare_;
    while (cells_.size() > columns_.size() && cells_.size() <= most && cells_.back().empty())
      cells_.pop_back();
  } while (cells_.size() == columns_.size() && std::all_of(cells_.begin(), cells_.end(), is_empty));
  if (cells_.size() != columns_.size())
    throw InputError(fmt::format("{}: {}", place(), words_for_cells(cells_.size())));
  return true;
}

std::string CsvReader::words_for_cells(std::size_t count) const {
  const bool decimal_commas =
      separator_ == ',' && count > columns_.size() && count <= 2 * columns_.size();
  return fmt::format("{} cells where the header names {} columns{}",
                     count > kMaxColumns ? "too many" : std::to_string(count), columns_.size(),
                     decimal_commas ? "; if its numbers have decimal commas, separate the cells, "
                                      "their names too, by semicolons"
                                    : "");
}

// A comma beside points would separate thousands: read as a decimal one it is wrong by a thousand.
void CsvReader::note_decimal_mark(std::string_view cell) {
  const auto at = cell.find_first_of(".,");
  if (at == std::string_view::npos) return;
  if (decimal_mark_ == '\0') decimal_mark_ = cell[at];
  if (cell[at] != decimal_mark_)
    throw InputError(fmt::format(
        "{}: {} has a decimal {} where numbers before it have a {}; write all of them alike",
        place(), in_quotes(cell), cell[at] == ',' ? "comma" : "point",
        decimal_mark_ == ',' ? "comma" : "point"));
}

bool CsvReader::unknown(int column) const {
  constexpr std::string_view kNaN = "nan";
  std::string_view cell = column < 0 ? std::string_view() : cells_[column];
  if (cell.starts_with('-')) cell.remove_prefix(1);  // as some programs write 0 / 0
  return cell.empty() || std::equal(cell.begin(), cell.end(), kNaN.begin(), kNaN.end(),
                                    [](unsigned char a, char b) { return std::tolower(a) == b; });
}

double CsvReader::number(int column) {
  if (column < 0 || cells_[column].empty()) return std::numeric_limits<double>::quiet_NaN();
  std::string_view cell = cells_[column];
  if (cell.size() > 1 && cell.front() == '+' && cell[1] != '-') cell.remove_prefix(1);
  std::string with_point;
  if (separator_ != ',') {
    note_decimal_mark(cell);
    with_point = cell;
    std::replace(with_point.begin(), with_point.end(), ',', '.');
    cell = with_point;
  }
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
