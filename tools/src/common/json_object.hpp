#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

namespace trochoid::tools {

/// Nothing if the file cannot be read or holds something else.
[[nodiscard]] std::optional<nlohmann::ordered_json> read_json_object(
    const std::filesystem::path& path);

}  // namespace trochoid::tools
