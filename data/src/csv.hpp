#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace trochoid::data {

/// Line-wise reader of a table of numbers below '#' header lines and one line of column names.
/// Cells are separated by commas or, where the column names are, by semicolons or tabs; then
/// numbers may have decimal commas. Tolerates CRLF, a byte order mark, a first line "sep=;" as
/// spreadsheets have it, blanks around cells, empty lines and '#' lines anywhere, and separators at
/// the ends of '#' lines and, where that of the names has some, of rows; everything else is refused
/// with file and line.
class CsvReader {
 public:
  /// Reads up to the column names. `text` must outlive the reader; `where` names the file.
  /// @throws InputError if there are no column names, or some are empty or doubled.
  CsvReader(std::string_view text, std::string where);

  /// key and value of the "# key: value" lines met so far; value empty for "# words".
  [[nodiscard]] const std::vector<std::pair<std::string, std::string>>& header() const {
    return header_;
  }
  [[nodiscard]] const std::vector<std::string>& columns() const { return columns_; }
  /// Index of a column, -1 if absent.
  [[nodiscard]] int index_of(std::string_view column) const;

  /// Moves to the next row. @returns false at the end. @throws InputError on a wrong cell count.
  bool next();
  [[nodiscard]] std::string_view cell(int column) const { return cells_[column]; }
  /// Whether a cell holds no number: empty, NaN as any other tool writes it, or of a column that is
  /// absent (index -1).
  [[nodiscard]] bool unknown(int column) const;
  /// The number in a cell, NaN if the cell is empty or the column is absent (index -1).
  /// @throws InputError naming line and column if it is no finite number, or one with a decimal
  ///         comma where others have points.
  [[nodiscard]] double number(int column);
  /// "file:line" of the current row.
  [[nodiscard]] std::string place() const;

 private:
  bool next_content_line(std::string_view& line);
  void keep_header(std::string_view line);
  [[nodiscard]] std::vector<std::string_view> split(std::string_view line) const;
  void note_decimal_mark(std::string_view cell);
  [[nodiscard]] std::string words_for_cells(std::size_t count) const;

  std::string_view text_;
  std::string where_;
  std::size_t position_ = 0;
  std::size_t line_ = 0;
  char separator_ = ',';
  char decimal_mark_ = '\0';  ///< of the numbers so far; none while all were whole
  std::vector<std::pair<std::string, std::string>> header_;
  std::vector<std::string> columns_;
  std::size_t spare_ = 0;  ///< separators at the end of the line of names
  std::vector<std::string_view> cells_;
};

/// "# key: value\n" or "# key\n"; line breaks inside become blanks so that the file stays readable.
[[nodiscard]] std::string header_line(std::string_view key, std::string_view value = {});

}  // namespace trochoid::data
