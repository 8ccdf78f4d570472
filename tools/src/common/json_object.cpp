#include "common/json_object.hpp"

#include <fstream>

namespace trochoid::tools {

std::optional<nlohmann::ordered_json> read_json_object(const std::filesystem::path& path) {
  std::ifstream file(path);
  auto value = nlohmann::ordered_json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (!value.is_object()) return std::nullopt;
  return value;
}

std::string json_text(const nlohmann::ordered_json& value, int indent) {
  return value.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

std::string as_utf8(const std::string& text) {
  return nlohmann::ordered_json::parse(json_text(text)).get<std::string>();
}

}  // namespace trochoid::tools
