#include "outputs.hpp"

#include <fmt/format.h>

#include "trochoid/data/error.hpp"

namespace trochoid::tools {

namespace fs = std::filesystem;

void check_output(const fs::path& output, const std::vector<fs::path>& inputs) {
  if (output.empty()) return;
  std::error_code ignored;  // what cannot be looked at is neither an input nor a folder
  const fs::path folder = output.parent_path();
  if (!folder.empty() && !fs::is_directory(folder, ignored))
    throw InputError(fmt::format("{}: cannot be written, the folder {} does not exist",
                                 output.string(), folder.string()));
  if (fs::is_directory(output, ignored))
    throw InputError(fmt::format("{}: is a folder, name a file to write", output.string()));
  for (const fs::path& input : inputs)
    if (!input.empty() && fs::equivalent(output, input, ignored))
      throw InputError(fmt::format(
          "{}: is read by this command and would be lost; name another output", output.string()));
}

}  // namespace trochoid::tools
