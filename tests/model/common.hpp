#pragma once
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <string>

#include "trochoid/model/predictor.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::model {

/// A column of a run by its name; zeros and a failure where there is none.
inline Eigen::VectorXd column(const Trajectory& run, const std::string& name) {
  for (std::size_t c = 0; c < run.columns.size(); ++c)
    if (run.columns[c] == name) return run.values.col(static_cast<Eigen::Index>(c));
  ADD_FAILURE() << "no column " << name;
  return Eigen::VectorXd::Zero(run.values.rows());
}

/// Values of all parameters of a model as the scene has them.
inline Eigen::VectorXd defaults(const Predictor& predictor) {
  Eigen::VectorXd values(static_cast<Eigen::Index>(predictor.parameters().size()));
  for (Eigen::Index i = 0; i < values.size(); ++i)
    values[i] = predictor.parameters()[static_cast<std::size_t>(i)].value;
  return values;
}

}  // namespace trochoid::model
