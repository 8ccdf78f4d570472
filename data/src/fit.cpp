#include "trochoid/data/fit.hpp"

#include <algorithm>
#include <string>

namespace trochoid::data {

const FitParameter* Fit::find(const std::string& name) const {
  const auto found = std::find_if(parameters.begin(), parameters.end(),
                                  [&](const FitParameter& p) { return p.name == name; });
  return found == parameters.end() ? nullptr : &*found;
}

const FitParameter* Fit::find(const std::string& name, std::size_t arc) const {
  const FitParameter* own = arc > 0 ? find(name + "@" + std::to_string(arc)) : nullptr;
  return own != nullptr ? own : find(name);
}

const FitParameter* Fit::find_state(const std::string& name, std::size_t arc) const {
  const FitParameter* found = find(name, arc);
  const bool of_first =
      found != nullptr && arc > 0 && found->name == name && found->status != ParameterStatus::fixed;
  return of_first ? nullptr : found;
}

}  // namespace trochoid::data
