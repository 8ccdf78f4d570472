#include "trochoid/data/integral.hpp"

namespace trochoid::data {

Eigen::VectorXd running_integral(std::span<const double> t,
                                 const Eigen::Ref<const Eigen::VectorXd>& f) {
  Eigen::VectorXd sum(f.size());
  sum[0] = 0.0;
  for (Eigen::Index i = 1; i < f.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    sum[i] = sum[i - 1] + 0.5 * (t[n] - t[n - 1]) * (f[i] + f[i - 1]);
  }
  return sum;
}

}  // namespace trochoid::data
