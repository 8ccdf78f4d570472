#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "observe/angles.hpp"
#include "observe/decompositions.hpp"
#include "observe/smoothing.hpp"
#include "start/starts.hpp"
#include "trochoid/data/integral.hpp"

namespace trochoid::fitting {
namespace {

// Least-squares polynomial coefficients c_k of sum c_k (t - t0)^k; columns of y are independent.
Eigen::MatrixXd polynomial(const std::vector<double>& t_s, double t0, const Eigen::MatrixXd& y,
                           int degree) {
  const int n = static_cast<int>(t_s.size());
  const double scale = std::max(t_s.back() - t0, 1e-12);
  Eigen::MatrixXd basis(n, degree + 1);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k <= degree; ++k) basis(i, k) = std::pow((t_s[i] - t0) / scale, k);
  Eigen::MatrixXd c = LeastSquares(basis).solve_each(y);
  for (int k = 1; k <= degree; ++k) c.row(k) /= std::pow(scale, k);
  return c;
}

// Least squares with the first `losses` coefficients not negative: the best subset of those with
// all entries positive.
Eigen::VectorXd non_negative(const Eigen::MatrixXd& m, const Eigen::VectorXd& right, int losses) {
  const int columns = static_cast<int>(m.cols());
  Eigen::VectorXd best = Eigen::VectorXd::Zero(columns);
  double least = std::numeric_limits<double>::infinity();
  for (int subset = 0; subset < (1 << losses); ++subset) {
    std::vector<int> used;
    for (int c = 0; c < columns; ++c)
      if (c >= losses || (subset & (1 << c))) used.push_back(c);
    const Eigen::MatrixXd part = m(Eigen::all, used);
    const Eigen::VectorXd x = LeastSquares(part).solve(right);
    const double squares = (right - part * x).squaredNorm();
    const int positive = static_cast<int>(used.size()) - (columns - losses);
    if ((positive > 0 && x.head(positive).minCoeff() < 0.0) || squares >= least) continue;
    least = squares;
    best.setZero();
    for (std::size_t c = 0; c < used.size(); ++c) best[used[c]] = x[static_cast<int>(c)];
  }
  return best;
}

Eigen::VectorXd twice_integrated(const std::vector<double>& t_s, const Eigen::VectorXd& y) {
  return data::running_integral(t_s, data::running_integral(t_s, y));
}

}  // namespace

std::vector<Start> puck_starts(const ArcData& window, double gravity_m_s2) {
  if (window.t_s.size() < 5) return {};
  const Eigen::MatrixXd c = polynomial(window.t_s, window.start_s, window.positions_m(), 2);
  const Eigen::Vector2d v = c.row(1).transpose(), a = 2.0 * c.row(2).transpose();
  const double speed = std::max(v.norm(), 1e-9);
  // Coulomb: the acceleration is -mu g along the path; spin can only make it smaller.
  const double mu = std::max(-a.dot(v) / speed / gravity_m_s2, 1e-4);
  std::map<std::string, double> values{
      {"x_m", c(0, 0)}, {"y_m", c(0, 1)}, {"vx_m_s", v.x()}, {"vy_m_s", v.y()}};
  const AngleSeries spin = angle_series(window, Channel::psi);
  if (spin.t_s.size() >= 5) {
    const Eigen::MatrixXd p = polynomial(spin.t_s, window.start_s, spin.angles(), 2);
    values["psi_rad"] = p(0, 0);
    values["w3_rad_s"] = p(1, 0);
  }
  std::vector<Start> starts;
  for (const double factor : {1.0, 1.5, 3.0}) {
    values["friction"] = factor * mu;
    starts.push_back({"windows", values});
  }
  return starts;
}

// Integral matching: the angle is linear in the first state and in the couples' double integrals
// along the measured motion; nothing noisy is differentiated twice.
std::vector<Start> pivot_starts(const ArcData& window, bool unbalanced) {
  const AngleSeries spin = angle_series(window, Channel::psi);
  const int n = static_cast<int>(spin.t_s.size());
  if (n < 12) return {};
  const Eigen::VectorXd psi = spin.angles();
  // A window turns by a fraction of a radian only, so that it does not level out what swings.
  constexpr double kFraction_rad = 0.3;
  std::vector<double> turns;
  for (int i = 1; i < n; ++i) turns.push_back(std::abs(psi[i] - psi[i - 1]));
  const double reach = kFraction_rad / std::max(median_or_zero(std::move(turns)), 1e-9);
  const int half_width = static_cast<int>(std::clamp(reach, 3.0, std::max(3.0, n / 8.0)));
  const Eigen::VectorXd w = smooth(spin.t_s, psi, half_width).first.col(0);
  constexpr int kLosses = 3;
  Eigen::MatrixXd laws(n, unbalanced ? 7 : 5);
  const auto couple = [&](const Eigen::VectorXd& size) -> Eigen::VectorXd {
    return -twice_integrated(spin.t_s, size);
  };
  laws.col(0) = couple(w.unaryExpr([](double x) { return x < 0.0 ? -1.0 : 1.0; }));
  laws.col(1) = couple(w);
  laws.col(2) = couple(w.cwiseProduct(w.cwiseAbs()));
  laws.col(3).setOnes();
  laws.col(4) = Eigen::Map<const Eigen::VectorXd>(spin.t_s.data(), n).array() - window.start_s;
  if (unbalanced) {
    laws.col(5) = couple(psi.array().sin());
    laws.col(6) = couple(psi.array().cos());
  }
  const Eigen::VectorXd t = non_negative(laws, psi, kLosses);
  const double typical = std::max(w.cwiseAbs().maxCoeff(), 1e-9);
  const double duration = std::max(spin.t_s.back() - spin.t_s.front(), 1e-9);
  // Laws that came out zero start small, not at the logarithm of nothing.
  const double least = 1e-3 / duration;
  return {{"integrals",
           {{"psi_rad", t[3]},
            {"w3_rad_s", t[4]},
            {"spin_down_dry_rad_s2", std::max(t[0], least * typical)},
            {"spin_down_weakening_s_rad", 0.1 / typical},
            {"spin_down_viscous_1_s", std::max(t[1], least)},
            {"spin_down_quadratic_1_rad", std::max(t[2], least / typical)},
            {"spin_down_imbalance_sin_rad_s2", unbalanced ? t[5] : 0.0},
            {"spin_down_imbalance_cos_rad_s2", unbalanced ? t[6] : 0.0}}}};
}

}  // namespace trochoid::fitting
