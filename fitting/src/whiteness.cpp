#include "whiteness.hpp"

#include <algorithm>
#include <cmath>

namespace trochoid::fitting {

double chi2_upper_tail(double chi2, double dof) {
  if (!(chi2 > 0.0) || !(dof > 0.0)) return 1.0;
  const double spread = 2.0 / (9.0 * dof);
  const double z = (std::cbrt(chi2 / dof) - (1.0 - spread)) / std::sqrt(spread);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

Whiteness whiteness(const Eigen::MatrixXd& series, double step_s, double taken) {
  constexpr double kStructured = 1e-3;
  Whiteness result;
  const Eigen::Index n = series.rows();
  const double power = series.squaredNorm();
  if (n < 20 || !(power > 0.0)) return result;
  const auto correlation = [&](Eigen::Index lag) {
    return series.topRows(n - lag).cwiseProduct(series.bottomRows(n - lag)).sum() / power;
  };
  const Eigen::Index tested = std::min<Eigen::Index>(20, n / 5);
  double statistic = 0.0;
  for (Eigen::Index lag = 1; lag <= tested; ++lag) {
    const double rho = correlation(lag);
    statistic += rho * rho / static_cast<double>(n - lag);
  }
  const double columns = static_cast<double>(series.cols());
  statistic *= columns * static_cast<double>(n) * static_cast<double>(n + 2);
  result.p_value = chi2_upper_tail(statistic, static_cast<double>(tested));
  if (result.p_value > 0.01) return result;  // white as far as can be told: no inflation
  double sum = 0.0;
  const double noise = 2.0 / std::sqrt(columns * static_cast<double>(n));
  for (Eigen::Index lag = 1; lag < n / 3; ++lag) {
    const double rho = correlation(lag);
    if (rho < noise) break;
    sum += rho;
  }
  if (sum == 0.0 && result.p_value < kStructured) {
    // What swings about zero averages out of a mean, but not out of every parameter.
    for (Eigen::Index lag = 1; lag <= tested; ++lag)
      if (const double rho = std::abs(correlation(lag)); rho > noise) sum += rho;
    result.inflation = 1.0 + 2.0 * sum;
    result.correlation_time_s = static_cast<double>(tested) * step_s;
    return result;
  }
  // Each fitted parameter follows the slow part of the residuals and lowers the first correlation
  // by about (1 + rho)/n (Kendall, Biometrika 41, 403, 1954, for a mean and a trend); what that
  // does to the sum is taken from an autoregressive process of first order.
  const double seen = std::clamp(correlation(1), 0.0, 0.98), samples = static_cast<double>(n);
  const double true_rho =
      std::min((seen + (2.0 * seen + taken * (1.0 + seen)) / samples), 0.5 * (1.0 + seen));
  const auto growth = [](double rho) { return (1.0 + rho) / (1.0 - rho); };
  sum = std::min(sum * growth(true_rho) / growth(seen), samples);
  result.inflation = 1.0 + 2.0 * sum;
  result.correlation_time_s = sum * step_s;
  return result;
}

Whiteness channel_whiteness(const Problem& problem, const Linearised& all, Channel channel) {
  Whiteness worst;
  const int width = channel == Channel::position ? 2 : 1;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    std::vector<double> values;
    for (std::size_t row = 0; row < all.arc.size(); ++row)
      if (all.arc[row] == arc && all.channel[row] == channel) values.push_back(all.residuals[row]);
    const Eigen::Index n = static_cast<Eigen::Index>(values.size()) / width;
    if (n < 2) continue;
    const Eigen::MatrixXd series = Eigen::Map<Eigen::MatrixXd>(values.data(), width, n).transpose();
    // Parameters share themselves out among the coordinates.
    const double taken = static_cast<double>(problem.columns_of(arc).size()) /
                         static_cast<double>(problem.arcs[arc].observables.size());
    const Whiteness one =
        whiteness(series, problem.arcs[arc].duration_s() / static_cast<double>(n - 1), taken);
    if (one.p_value < worst.p_value) worst.p_value = one.p_value;
    if (one.inflation > worst.inflation) {
      worst.inflation = one.inflation;
      worst.correlation_time_s = one.correlation_time_s;
    }
  }
  return worst;
}

}  // namespace trochoid::fitting
