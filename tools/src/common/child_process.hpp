#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace trochoid::tools {

/// How a program run on its own fared.
struct ChildRun {
  bool started = false;
  int exit_status = -1;
  double seconds = 0.0;      ///< wall time, start of the process included
  double peak_mb = 0.0;      ///< resident memory
  std::string error_output;  ///< what it wrote to stderr, why it did not start, what ended it
};

/// Runs a program (found on PATH) to its end with nothing on stdin and stdout going to a file
/// (nowhere by default). The child is told to end when the calling thread does.
[[nodiscard]] ChildRun run_child(const std::vector<std::string>& arguments,
                                 const std::filesystem::path& output = "/dev/null");

/// The last line with anything in it: what a program complained of when it ended.
[[nodiscard]] std::string last_line(const std::string& text);

/// The running program, as run_child() takes it: the one that runs, also once another lies in its
/// place or it has been moved.
[[nodiscard]] std::string own_path();

}  // namespace trochoid::tools
