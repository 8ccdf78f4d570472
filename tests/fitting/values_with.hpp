#pragma once
#include <Eigen/Core>
#include <map>
#include <string>

#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

/// Values of all parameters of a model: these by name, the others as the scene has them.
inline Eigen::VectorXd values_with(const model::Predictor& predictor,
                                   const std::map<std::string, double>& given) {
  Eigen::VectorXd values(static_cast<Eigen::Index>(predictor.parameters().size()));
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const model::ParameterInfo& info = predictor.parameters()[static_cast<std::size_t>(i)];
    const auto own = given.find(info.name);
    values[i] = own != given.end() ? own->second : info.value;
  }
  return values;
}

}  // namespace trochoid::fitting
