#include "trochoid/data/fit.hpp"

#include <algorithm>

namespace trochoid::data {

const FitParameter* Fit::find(const std::string& name) const {
  const auto found = std::find_if(parameters.begin(), parameters.end(),
                                  [&](const FitParameter& p) { return p.name == name; });
  return found == parameters.end() ? nullptr : &*found;
}

}  // namespace trochoid::data
