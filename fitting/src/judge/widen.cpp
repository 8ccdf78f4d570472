#include "judge/widen.hpp"

namespace trochoid::fitting {

void widen(data::FitParameter& parameter, double times, data::Fit& fit) {
  parameter.sigma *= times;
  for (Eigen::Index i = 0; i < fit.covariance.rows(); ++i) {
    if (fit.covariance_names[static_cast<std::size_t>(i)] != parameter.name) continue;
    fit.covariance.row(i) *= times;
    fit.covariance.col(i) *= times;
  }
}

}  // namespace trochoid::fitting
