#pragma once
#include <stdexcept>

namespace trochoid::tools {

/// Thrown by a command that finished but whose answer is not good (no convergence, broken track):
/// the files are written, the exit status is 3.
struct NotGood : std::runtime_error {
  using std::runtime_error::runtime_error;
};

}  // namespace trochoid::tools
