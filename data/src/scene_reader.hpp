#pragma once
#include <toml++/toml.h>

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "scene_keys.hpp"
#include "text.hpp"

namespace trochoid::data {

/// One TOML table being read: hands out values by key, remembers the keys it was asked for, and
/// refuses the rest. Every message begins with file:line.
class TableReader {
 public:
  /// @param name how messages call the table, e.g. "[body]"; `table` may be null: nothing is set.
  TableReader(const toml::table* table, std::string name, std::string where)
      : table_(table), name_(std::move(name)), where_(std::move(where)) {}

  /// The node of a key, null if absent; makes the key known.
  const toml::node* find(std::string_view key);
  /// @throws InputError for the first key of the table nobody asked for, with the nearest known
  /// one.
  void refuse_unknown() const;
  /// @throws InputError "file:line: <what>" at the key (at the table if the key is absent).
  [[noreturn]] void fail(std::string_view key, const std::string& what) const;
  [[nodiscard]] const std::string& where() const { return where_; }
  [[nodiscard]] bool has(std::string_view key) const { return table_ && table_->contains(key); }

  void read(const char* key, double& value, const Range& range);
  void read(const char* key, int& value, const Range& range);
  void read(const char* key, std::optional<double>& value, const Range& range);
  void read(const char* key, std::optional<Eigen::Vector2d>& value, const Range& range);
  void read(const char* key, std::optional<Eigen::Vector3d>& value, const Range& range);
  void read(const char* key, std::map<std::string, double>& values, const Range& range);
  void read(const char* key, std::map<std::string, Prior>& values, const Range& range);
  void read(const char* key, std::map<std::string, std::pair<double, double>>& values,
            const Range& range);
  void read(const char* key, bool& value, AnyText);
  void read(const char* key, std::string& value, AnyText);
  void read(const char* key, std::vector<std::string>& values, AnyText);
  void read(const char* key, std::string& value, TimeOrFrame);
  void read(const char* key, std::vector<std::int64_t>& values, const Range& range);

  template <std::size_t N>
  void read(const char* key, std::string& value, const Words<N>& words) {
    if (const toml::node* node = find(key)) value = words[choice(key, *node, words)];
  }
  template <class Enum, std::size_t N>
  requires std::is_enum_v<Enum>
  void read(const char* key, Enum& value, const Words<N>& words) {
    if (const toml::node* node = find(key)) value = static_cast<Enum>(choice(key, *node, words));
  }
  template <class Enum, std::size_t N>
  requires std::is_enum_v<Enum>
  void read(const char* key, std::optional<Enum>& value, const Words<N>& words) {
    if (const toml::node* node = find(key)) value = static_cast<Enum>(choice(key, *node, words));
  }

 private:
  template <std::size_t N>
  std::size_t choice(const char* key, const toml::node& node, const Words<N>& words) const {
    return choice(key, node, std::vector<std::string>(words.begin(), words.end()));
  }
  std::size_t choice(const char* key, const toml::node& node,
                     const std::vector<std::string>& words) const;
  double number(const std::string& key, const toml::node& node, const Range& range) const;
  template <int N>
  std::array<double, N> numbers(const std::string& key, const toml::node& node, const Range& range,
                                const char* form) const;
  const toml::table* subtable(const char* key);
  [[noreturn]] void fail_at(const toml::node& node, const std::string& what) const;

  const toml::table* table_;
  std::string name_, where_;
  std::vector<std::string> known_;
};

}  // namespace trochoid::data
