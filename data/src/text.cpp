#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <numeric>
#include <utility>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {

std::string read_text(const std::filesystem::path& path, std::size_t limit_bytes) {
  std::error_code code;
  const auto status = std::filesystem::status(path, code);
  if (!std::filesystem::exists(status))
    throw InputError(fmt::format("{}: no such file", path.string()));
  if (std::filesystem::is_directory(status))
    throw InputError(fmt::format("{}: is a folder, expected a file", path.string()));
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(fmt::format("{}: cannot be read (permission?)", path.string()));
  std::string text;
  std::vector<char> chunk(std::size_t{1} << 16);
  while (file.read(chunk.data(), static_cast<std::streamsize>(chunk.size())) || file.gcount() > 0) {
    text.append(chunk.data(), static_cast<std::size_t>(file.gcount()));
    if (text.size() > limit_bytes)
      throw InputError(fmt::format("{}: larger than {} MiB, not a file of this kind", path.string(),
                                   limit_bytes >> 20));
  }
  if (file.bad()) throw InputError(fmt::format("{}: reading failed", path.string()));
  // Lines that end in a carriage return alone, as some spreadsheets still write them.
  if (text.find('\n') == std::string::npos) std::replace(text.begin(), text.end(), '\r', '\n');
  return text;
}

std::string one_line(std::string_view text, std::size_t limit) {
  std::string out(text.substr(0, limit));
  for (char& c : out)
    if (c < ' ' || c > '~') c = '?';
  if (text.size() > limit) out += "...";
  return out;
}

std::string in_quotes(std::string_view text) {
  return fmt::format("'{}'", one_line(text, 40));
}

namespace {

// Levenshtein distance; a key clipped to a sane length keeps hostile input cheap.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row.back();
}

}  // namespace

std::string guess_meant(std::string_view word, std::span<const std::string> candidates,
                        const std::string& otherwise) {
  const std::string_view clipped = word.substr(0, 64);
  const auto closer = [&](const std::string& a, const std::string& b) {
    return edit_distance(clipped, a) < edit_distance(clipped, b);
  };
  const auto best = std::min_element(candidates.begin(), candidates.end(), closer);
  if (best == candidates.end() ||
      2 * edit_distance(clipped, *best) > std::max(clipped.size(), best->size()))
    return otherwise;
  return fmt::format("; did you mean {}?", *best);
}

std::string join(std::span<const std::string> words, std::string_view separator) {
  return fmt::format("{}", fmt::join(words.begin(), words.end(), separator));
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::string shortest(double value) {
  return fmt::format("{}", value);
}

}  // namespace trochoid::data
