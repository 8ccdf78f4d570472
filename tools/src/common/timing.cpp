#include "common/timing.hpp"

#include <nlohmann/json.hpp>
#include <system_error>

#include "trochoid/data/io.hpp"

namespace trochoid::tools {

namespace fs = std::filesystem;

fs::path timing_file(fs::path result) {
  std::error_code ignored;
  const fs::path folder =
      fs::weakly_canonical(fs::absolute(result, ignored).parent_path(), ignored);
  if (result.empty() || folder == "/dev" || folder.string().starts_with("/proc/") ||
      (fs::exists(result, ignored) && !fs::is_regular_file(result, ignored)))
    return {};
  const bool plain_fit = result.extension() == ".json" && result.stem().extension() != ".fit";
  return result.replace_extension(plain_fit ? ".fit.timing.json" : ".timing.json");
}

double Stopwatch::seconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

void write_timing(const fs::path& result, const nlohmann::json& timing) {
  if (const fs::path file = timing_file(result); !file.empty())
    data::write_text(timing.dump(2) + "\n", file);
}

}  // namespace trochoid::tools
