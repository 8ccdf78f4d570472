#include "common/outputs.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {

namespace fs = std::filesystem;

namespace {

fs::path plain(const fs::path& path) {
  std::error_code ignored;
  return fs::weakly_canonical(fs::absolute(path, ignored), ignored);
}

// A scene is read with the camera it names. What is wrong with it is told when it is read.
fs::path camera_of(const fs::path& input) {
  if (input.extension() != ".toml") return {};
  try {
    return data::read_scene(input).camera.file;
  } catch (const Error&) {
    return {};
  }
}

bool is_same(const fs::path& a, const fs::path& b) {
  if (a.empty() || b.empty()) return false;
  std::error_code ignored;
  return fs::equivalent(a, b, ignored) || plain(a) == plain(b);
}

}  // namespace

void refuse_dash(const fs::path& output) {
  if (output == "-")
    throw InputError("-: results are files; give a name (./- for a file called so)");
}

void check_output(const fs::path& output, const std::vector<fs::path>& inputs) {
  if (output.empty()) return;
  refuse_dash(output);
  data::check_writable(output);
  for (const fs::path& input : inputs) {
    if (is_same(output, input))
      throw InputError(
          fmt::format("{}: is read by this command; name another output", output.string()));
    if (is_same(output, camera_of(input)))
      throw InputError(
          fmt::format("{}: is the camera file of {}, which this command reads; name another output",
                      output.string(), input.string()));
  }
}

void check_outputs(const std::vector<fs::path>& outputs, const std::vector<fs::path>& inputs) {
  for (auto output = outputs.begin(); output != outputs.end(); ++output) {
    check_output(*output, inputs);
    if (std::any_of(outputs.begin(), output, [&](const auto& b) { return is_same(*output, b); }))
      throw InputError(
          fmt::format("{}: is named for two outputs; name two files", output->string()));
  }
}

void check_folder(const fs::path& folder) {
  refuse_dash(folder);
  std::error_code ignored;  // what cannot be looked at is not there
  const std::string ending = folder.extension().string();
  const bool is_folder = fs::is_directory(folder, ignored);
  const bool named_as_file =
      ending == ".svg" || ending == ".png" || ending == ".pdf" || ending == ".csv";
  if (!is_folder && (fs::exists(folder, ignored) || named_as_file))
    throw InputError(fmt::format("{}: names a file; give a folder", folder.string()));
  fs::path nearest = fs::absolute(folder, ignored);
  while (!fs::exists(nearest, ignored) && nearest.has_relative_path())
    nearest = nearest.parent_path();
  const char* wrong = !fs::is_directory(nearest, ignored)           ? "is a file"
                      : ::access(nearest.c_str(), W_OK | X_OK) != 0 ? "does not allow it"
                                                                    : nullptr;
  if (wrong != nullptr)
    throw InputError(fmt::format("{}: cannot be {}, {} {}", folder.string(),
                                 is_folder ? "written into" : "made", nearest.string(), wrong));
}

void make_folder(const fs::path& folder) {
  check_folder(folder);
  std::error_code code;
  fs::create_directories(folder, code);
  if (code)
    throw InputError(fmt::format("{}: cannot be made: {}", folder.string(), code.message()));
}

void check_length(const std::string& scene, double until_s, double rate_hz, double most,
                  const std::string& rows) {
  const double count = until_s * rate_hz;
  if (count > most)
    throw InputError(fmt::format(
        "{}: {:g} s at {:g} Hz make {:.2g} {}, more than {:g}; lower run.rate_hz (--rate) or "
        "run.until_s (--until)",
        scene, until_s, rate_hz, count, rows, most));
}

std::string shell_quoted(const std::string& word) {
  const bool plain = word.find_first_of(" \t\n\"'\\$`!*?[](){}<>|&;#~") == std::string::npos;
  if (plain) return word;
  std::string result = "'";
  for (const char c : word) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return result + "'";
}

}  // namespace trochoid::tools
