#include "scene_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "trochoid/data/moment.hpp"
#include "trochoid/data/scene_error.hpp"

namespace trochoid::data {

const toml::node* TableReader::find(std::string_view key) {
  known_.emplace_back(key);
  return table_ ? table_->get(key) : nullptr;
}

void TableReader::refuse_unknown() const {
  if (!table_) return;
  for (const auto& [key, node] : *table_) {
    const std::string name(key.str());
    if (std::find(known_.begin(), known_.end(), name) != known_.end()) continue;
    const auto line = key.source().begin.line;
    throw SceneError(where_, line,
                     fmt::format("{} is not a key of {}{}", in_quotes(name), name_,
                                 guess_meant(name, known_, "; it has " + join(known_, ", "))));
  }
}

void TableReader::fail(std::string_view key, const std::string& what) const {
  const toml::node* node = table_ ? table_->get(key) : nullptr;
  if (node) fail_at(*node, what);
  if (table_) fail_at(*table_, what);
  throw InputError(fmt::format("{}: {}", where_, what));
}

void TableReader::fail_at(const toml::node& node, const std::string& what) const {
  throw SceneError(where_, node.source().begin.line, what);
}

double TableReader::number(const std::string& key, const toml::node& node,
                           const Range& range) const {
  const auto value = node.value<double>();
  if (!node.is_number() || !value)
    fail_at(node, fmt::format("{} must be a number, {}", key, range.words));
  if (!std::isfinite(*value) || !range.holds(*value))
    fail_at(node, fmt::format("{} = {} must be {}", key, *value, range.words));
  return *value;
}

template <int N>
std::array<double, N> TableReader::numbers(const std::string& key, const toml::node& node,
                                           const Range& range, const char* form) const {
  const toml::array* list = node.as_array();
  if (!list || list->size() != N) fail_at(node, fmt::format("{} must be {}", key, form));
  std::array<double, N> values{};
  for (int i = 0; i < N; ++i) values[i] = number(key, (*list)[i], range);
  return values;
}

std::size_t TableReader::choice(const char* key, const toml::node& node,
                                const std::vector<std::string>& words) const {
  const auto word = node.value<std::string>();
  if (!node.is_string() || !word)
    fail_at(node, fmt::format("{} must be one of {}", key, join(words, ", ")));
  const auto found = std::find(words.begin(), words.end(), *word);
  if (found == words.end())
    fail_at(node, fmt::format("{} = {} must be one of {}{}", key, in_quotes(*word),
                              join(words, ", "), guess_meant(*word, words)));
  return static_cast<std::size_t>(found - words.begin());
}

const toml::table* TableReader::subtable(const char* key) {
  const toml::node* node = find(key);
  if (node && !node->is_table())
    fail_at(*node, fmt::format("{} must be a table, e.g. {} = {{ mass_kg = ... }}", key, key));
  return node ? node->as_table() : nullptr;
}

void TableReader::read(const char* key, double& value, const Range& range) {
  if (const toml::node* node = find(key)) value = number(key, *node, range);
}

void TableReader::read(const char* key, int& value, const Range& range) {
  const toml::node* node = find(key);
  if (!node) return;
  const double number_read = number(key, *node, range);
  if (number_read != std::floor(number_read))
    fail_at(*node, fmt::format("{} = {} must be {}", key, number_read, range.words));
  value = static_cast<int>(number_read);
}

void TableReader::read(const char* key, std::optional<double>& value, const Range& range) {
  if (const toml::node* node = find(key)) value = number(key, *node, range);
}

void TableReader::read(const char* key, std::optional<Eigen::Vector2d>& value, const Range& range) {
  if (const toml::node* node = find(key)) {
    const auto [x, y] = numbers<2>(key, *node, range, "two numbers, e.g. [1.0, 2.0]");
    value = Eigen::Vector2d(x, y);
  }
}

void TableReader::read(const char* key, std::optional<Eigen::Vector3d>& value, const Range& range) {
  if (const toml::node* node = find(key)) {
    const auto [x, y, z] = numbers<3>(key, *node, range, "three numbers, e.g. [1.0, 2.0, 3.0]");
    value = Eigen::Vector3d(x, y, z);
  }
}

void TableReader::read(const char* key, std::map<std::string, double>& values, const Range& range) {
  if (const toml::table* table = subtable(key))
    for (const auto& [name, node] : *table)
      values[std::string(name.str())] =
          number(fmt::format("{}.{}", key, one_line(name.str(), 40)), node, range);
}

void TableReader::read(const char* key, std::map<std::string, Prior>& values, const Range& range) {
  if (const toml::table* table = subtable(key))
    for (const auto& [name, node] : *table) {
      const std::string full = fmt::format("{}.{}", key, one_line(name.str(), 40));
      const auto [value, sigma] =
          numbers<2>(full, node, range, "[value, sigma], e.g. [0.0337, 0.0001]");
      if (!(sigma > 0.0))
        fail_at(node,
                fmt::format("{}: sigma = {} must be greater than 0; a sure value belongs into "
                            "fixed",
                            full, sigma));
      values[std::string(name.str())] = {value, sigma};
    }
}

void TableReader::read(const char* key, std::map<std::string, std::pair<double, double>>& values,
                       const Range& /*bounds may be infinite*/) {
  if (const toml::table* table = subtable(key))
    for (const auto& [name, node] : *table) {
      const std::string full = fmt::format("{}.{}", key, one_line(name.str(), 40));
      const toml::array* list = node.as_array();
      const auto bound = [&](std::size_t i) {
        return list && list->size() == 2 && (*list)[i].is_number()
                   ? (*list)[i].value<double>().value_or(std::nan(""))
                   : std::nan("");
      };
      const double lower = bound(0), upper = bound(1);
      if (!(lower < upper))
        fail_at(node,
                fmt::format("{} must be [lower, upper] with lower < upper (inf allowed)", full));
      values[std::string(name.str())] = {lower, upper};
    }
}

void TableReader::read(const char* key, bool& value, AnyText) {
  const toml::node* node = find(key);
  if (!node) return;
  if (!node->is_boolean()) fail_at(*node, fmt::format("{} must be true or false", key));
  value = node->value<bool>().value();
}

void TableReader::read(const char* key, std::string& value, AnyText) {
  const toml::node* node = find(key);
  if (!node) return;
  if (!node->is_string()) fail_at(*node, fmt::format("{} must be text in quotes", key));
  value = node->value<std::string>().value();
  if (value.empty() || value.find('\0') != std::string::npos)
    fail_at(*node, fmt::format("{} = {} must be a name; leave the key out if there is none", key,
                               in_quotes(value)));
}

void TableReader::read(const char* key, std::vector<std::string>& values, AnyText) {
  const toml::node* node = find(key);
  if (!node) return;
  const toml::array* list = node->as_array();
  if (!list) fail_at(*node, fmt::format("{} must be a list of names, e.g. [\"l_m\"]", key));
  for (const toml::node& item : *list) {
    if (!item.is_string()) fail_at(item, fmt::format("{} must hold names in quotes", key));
    const std::string name = item.value<std::string>().value();
    if (std::find(values.begin(), values.end(), name) != values.end())
      fail_at(item, fmt::format("{} names {} twice", key, in_quotes(name)));
    values.push_back(name);
  }
}

void TableReader::read(const char* key, std::vector<std::int64_t>& values, const Range& range) {
  const toml::node* node = find(key);
  if (!node) return;
  const toml::array* list = node->as_array();
  if (!list)
    fail_at(*node, fmt::format("{} must be a list of {}, e.g. [80, 159]", key, range.words));
  for (const toml::node& item : *list) {
    const auto whole = item.value_exact<std::int64_t>();
    if (!whole || !range.holds(static_cast<double>(*whole)))
      fail_at(item, fmt::format("{} must hold {}", key, range.words));
    values.push_back(*whole);
  }
}

void TableReader::read(const char* key, std::string& value, TimeOrFrame) {
  const toml::node* node = find(key);
  if (!node) return;
  if (node->is_number()) {
    value = shortest(number(key, *node, kNonNegative));
    return;
  }
  const std::string text = node->is_string() ? node->value<std::string>().value() : std::string();
  const auto moment = parse_moment(text);
  if (!moment || moment->t_s.value_or(0.0) < 0.0)
    fail_at(*node, fmt::format("{} = {} must be seconds (1.5) or a frame (\"f120\")", key,
                               in_quotes(text)));
  value = text;
}

}  // namespace trochoid::data
