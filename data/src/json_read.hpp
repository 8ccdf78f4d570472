#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "trochoid/data/error.hpp"

/// Reading JSON with messages that name file and key; private to this module.
namespace trochoid::data {

/// Parses a text holding one object; `where` stands for its file in messages.
/// @throws InputError naming `where` and the line, or the key that an object has twice.
[[nodiscard]] nlohmann::json parse_json_object(const std::string& text, const std::string& where);
[[nodiscard]] nlohmann::json read_json_object(const std::filesystem::path& path);

/// One JSON object with its name for messages.
class JsonReader {
 public:
  JsonReader(const nlohmann::json& object, std::string where)
      : object_(object), where_(std::move(where)) {}

  [[nodiscard]] bool has(const char* key) const;
  /// The value of a key. @throws InputError if it is missing.
  [[nodiscard]] const nlohmann::json& at(const char* key) const;
  [[nodiscard]] double number(const char* key) const;
  [[nodiscard]] double number_or(const char* key, double otherwise) const;
  [[nodiscard]] std::vector<double> numbers(const char* key, std::size_t count) const;
  [[nodiscard]] std::string text(const char* key) const;
  [[nodiscard]] std::string text_or(const char* key, const std::string& otherwise) const;
  [[noreturn]] void fail(const std::string& what) const;
  [[nodiscard]] const std::string& where() const { return where_; }

 private:
  const nlohmann::json& object_;
  std::string where_;
};

}  // namespace trochoid::data
