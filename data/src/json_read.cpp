#include "json_read.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "text.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {

namespace {

/// Refuses an object that has a key twice: the second value would silently take the first one's
/// place.
class KeysOnce {
 public:
  explicit KeysOnce(const std::string& where) : where_(where) {}
  bool operator()(int /*depth*/, nlohmann::json::parse_event_t event, const nlohmann::json& key) {
    using Event = nlohmann::json::parse_event_t;
    if (event == Event::object_start) open_.emplace_back();
    if (event == Event::object_end) open_.pop_back();
    if (event == Event::key && !open_.back().insert(key.get<std::string>()).second)
      throw InputError(fmt::format("{}: key \"{}\" is there twice; keep one", where_,
                                   one_line(key.get<std::string>(), 40)));
    return true;
  }

 private:
  const std::string& where_;
  std::vector<std::set<std::string>> open_;  ///< keys of the objects that are being read
};

}  // namespace

nlohmann::json parse_json_object(const std::string& text, const std::string& where) {
  try {
    KeysOnce once(where);
    nlohmann::json json = nlohmann::json::parse(text, std::ref(once));
    if (!json.is_object())
      throw InputError(fmt::format("{}: expected a JSON object {{...}}", where));
    return json;
  } catch (const nlohmann::json::parse_error& error) {
    const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(error.byte, text.size()));
    throw InputError(fmt::format("{}:{}: not JSON{}", where,
                                 1 + std::count(text.begin(), end, '\n'),
                                 text.empty()                ? ", the file is empty"
                                 : text.starts_with("# tro") ? ", but a table (CSV)"
                                                             : ""));
  } catch (const nlohmann::json::exception&) {  // a number out of range
    throw InputError(fmt::format("{}: not JSON: a number is out of range", where));
  }
}

nlohmann::json read_json_object(const std::filesystem::path& path) {
  return parse_json_object(read_text(path), path.string());
}

bool JsonReader::has(const char* key) const {
  return object_.contains(key) && !object_[key].is_null();
}

const nlohmann::json& JsonReader::at(const char* key) const {
  const auto found = object_.find(key);
  if (found == object_.end()) fail(fmt::format("key \"{}\" is missing", key));
  return *found;
}

double JsonReader::number(const char* key) const {
  const nlohmann::json& value = at(key);
  if (!value.is_number() || !std::isfinite(value.get<double>()))
    fail(fmt::format("\"{}\" must be a finite number", key));
  return value.get<double>();
}

double JsonReader::number_or(const char* key, double otherwise) const {
  return has(key) ? number(key) : otherwise;
}

std::vector<double> JsonReader::numbers(const char* key, std::size_t count) const {
  const nlohmann::json& list = at(key);
  const bool good = list.is_array() && list.size() == count &&
                    std::all_of(list.begin(), list.end(), [](const nlohmann::json& item) {
                      return item.is_number() && std::isfinite(item.get<double>());
                    });
  if (!good) fail(fmt::format("\"{}\" must be a list of {} finite numbers", key, count));
  return list.get<std::vector<double>>();
}

std::string JsonReader::text(const char* key) const {
  const nlohmann::json& value = at(key);
  if (!value.is_string()) fail(fmt::format("\"{}\" must be text", key));
  return value.get<std::string>();
}

std::string JsonReader::text_or(const char* key, const std::string& otherwise) const {
  return has(key) ? text(key) : otherwise;
}

void JsonReader::fail(const std::string& what) const {
  throw InputError(fmt::format("{}: {}", where_, what));
}

}  // namespace trochoid::data
