#pragma once
#include <string>
#include <vector>

#include "trochoid/data/fit.hpp"

namespace trochoid::tools {

/// The models that were tried as a table for the terminal, a line each, the recommended one with a
/// star; empty without any.
[[nodiscard]] std::string comparison_table(const std::vector<data::ModelScore>& models);

}  // namespace trochoid::tools
