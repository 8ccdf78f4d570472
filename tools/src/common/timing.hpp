#pragma once
#include <chrono>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace trochoid::tools {

/// Run times live beside a result, so that the result itself is the same from run to run: those of
/// a track "NAME.csv" in "NAME.timing.json", of a fit "NAME.json" or "NAME.fit.json" in
/// "NAME.fit.timing.json". Beside a device or a pipe (/dev/stdout, also where it
/// leads into a file), or without a name, there is no place for them: empty.
[[nodiscard]] std::filesystem::path timing_file(std::filesystem::path result);

/// Measures from its construction on.
class Stopwatch {
 public:
  [[nodiscard]] double seconds() const;

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// Writes what a command took beside its result, if there is a place.
void write_timing(const std::filesystem::path& result, const nlohmann::json& timing);

}  // namespace trochoid::tools
