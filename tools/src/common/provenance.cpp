#include "common/provenance.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {

namespace fs = std::filesystem;

void add_checksum(std::map<std::string, std::string>& checksums, const fs::path& file) {
  const std::string digest = data::sha256_of_file(file), name = file.filename().string();
  const auto known = checksums.find(name);
  checksums[known == checksums.end() || known->second == digest ? name : file.string()] = digest;
}

void check_made_from(const data::Fit& fit, const fs::path& fit_path, const fs::path& track_path) {
  const bool tells = std::any_of(fit.inputs.begin(), fit.inputs.end(),
                                 [](const auto& input) { return input.first.ends_with(".csv"); });
  if (!tells) return;
  const std::string digest = data::sha256_of_file(track_path);
  if (std::none_of(fit.inputs.begin(), fit.inputs.end(),
                   [&](const auto& input) { return input.second == digest; }))
    throw InputError(fmt::format("{}: was not fitted to {} as it is now; fit this track",
                                 fit_path.string(), track_path.string()));
}

}  // namespace trochoid::tools
