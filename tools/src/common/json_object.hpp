#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace trochoid::tools {

/// Nothing if the file cannot be read or holds something else.
[[nodiscard]] std::optional<nlohmann::ordered_json> read_json_object(
    const std::filesystem::path& path);

/// Names from outside may be broken UTF-8 (files of an old camera's or archive's): what is none
/// becomes U+FFFD, rather than ending the program when everything else is done.
[[nodiscard]] std::string json_text(const nlohmann::ordered_json& value, int indent = 1);
[[nodiscard]] std::string as_utf8(const std::string& text);

}  // namespace trochoid::tools
