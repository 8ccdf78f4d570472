#include "common/json_object.hpp"

#include <fstream>

namespace trochoid::tools {

std::optional<nlohmann::ordered_json> read_json_object(const std::filesystem::path& path) {
  std::ifstream file(path);
  auto value = nlohmann::ordered_json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (!value.is_object()) return std::nullopt;
  return value;
}

}  // namespace trochoid::tools
