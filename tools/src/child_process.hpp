#pragma once
#include <string>
#include <vector>

namespace trochoid::tools {

/// How a program run on its own fared.
struct ChildRun {
  bool started = false;
  int exit_status = -1;
  double seconds = 0.0;      ///< wall time, start of the process included
  double peak_mb = 0.0;      ///< resident memory
  std::string error_output;  ///< what it wrote to stderr
};

/// Runs a program (found on PATH) to its end with stdin and stdout closed.
[[nodiscard]] ChildRun run_child(const std::vector<std::string>& arguments);

/// Path of the running program.
[[nodiscard]] std::string own_path();

}  // namespace trochoid::tools
