#include "trochoid/model/mean_path.hpp"

#include <fmt/format.h>

#include <cmath>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/interpolate.hpp"

namespace trochoid::model {
namespace {

constexpr int kPerTurn = 256;  // samples per turn of phi; the average over a turn is then exact to
                               // the interpolation

void require_turns(const Eigen::VectorXd& phi) {
  const Eigen::Index n = phi.size();
  const double sign = n > 1 && phi[n - 1] < phi[0] ? -1.0 : 1.0;
  for (Eigen::Index i = 1; i < n; ++i)
    if (!(sign * (phi[i] - phi[i - 1]) > 0.0))
      throw InputError(fmt::format(
          "mean_path: phi is not monotonic at row {}; the mean path needs steady precession", i));
  if (n < 4 || std::abs(phi[n - 1] - phi[0]) <= 3.0 * data::kTurn)
    throw InputError("mean_path: the run spans less than three turns of phi; make it longer");
}

// Cubic Lagrange interpolation of a column given at increasing |phi|.
class Interpolator {
 public:
  explicit Interpolator(const Eigen::VectorXd& phi) : phi_(phi) {}
  [[nodiscard]] double operator()(const Eigen::VectorXd& column, double at,
                                  Eigen::Index& hint) const {
    const double sign = phi_[phi_.size() - 1] < phi_[0] ? -1.0 : 1.0;
    while (hint + 4 < phi_.size() && sign * (at - phi_[hint + 2]) > 0.0) ++hint;
    return data::polynomial_at<double>({phi_.data() + hint, 4}, {column.data() + hint, 4}, at);
  }

 private:
  const Eigen::VectorXd& phi_;
};

Eigen::VectorXd on_uniform_phi(const Eigen::VectorXd& phi, const Eigen::VectorXd& column,
                               const Eigen::VectorXd& grid) {
  const Interpolator interpolate(phi);
  Eigen::VectorXd values(grid.size());
  Eigen::Index hint = 0;
  for (Eigen::Index i = 0; i < grid.size(); ++i) values[i] = interpolate(column, grid[i], hint);
  return values;
}

// Trapezoidal mean over one turn; shorter by one turn.
Eigen::VectorXd turn_average(const Eigen::VectorXd& values) {
  const Eigen::Index n = values.size() - kPerTurn;
  Eigen::VectorXd mean(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto window = values.segment(i, kPerTurn + 1);
    mean[i] = (window.sum() - 0.5 * (window[0] + window[kPerTurn])) / kPerTurn;
  }
  return mean;
}

// Heading rate from the path's derivatives: (x' y'' - y' x'') / (x'^2 + y'^2).
Eigen::VectorXd heading_rate(const Eigen::VectorXd& x, const Eigen::VectorXd& y, double step) {
  const Eigen::Index n = x.size();
  Eigen::VectorXd rate(n);
  for (Eigen::Index i = 1; i + 1 < n; ++i) {
    const double dx = (x[i + 1] - x[i - 1]) / (2.0 * step),
                 dy = (y[i + 1] - y[i - 1]) / (2.0 * step);
    const double ddx = (x[i + 1] - 2.0 * x[i] + x[i - 1]) / (step * step);
    const double ddy = (y[i + 1] - 2.0 * y[i] + y[i - 1]) / (step * step);
    rate[i] = (dx * ddy - dy * ddx) / (dx * dx + dy * dy);
  }
  rate[0] = rate[1];
  rate[n - 1] = rate[n - 2];
  return rate;
}

}  // namespace

MeanPath mean_path(const Eigen::VectorXd& t_s, const Eigen::VectorXd& phi_rad,
                   const Eigen::VectorXd& x_m, const Eigen::VectorXd& y_m) {
  require_turns(phi_rad);
  const double span = phi_rad[phi_rad.size() - 1] - phi_rad[0];
  const double step = std::copysign(data::kTurn / kPerTurn, span);
  const auto points = static_cast<Eigen::Index>(std::floor(span / step)) + 1;
  const Eigen::VectorXd grid =
      phi_rad[0] +
      step * Eigen::VectorXd::LinSpaced(points, 0.0, static_cast<double>(points - 1)).array();
  const auto smooth = [&](const Eigen::VectorXd& column) {
    return turn_average(turn_average(on_uniform_phi(phi_rad, column, grid)));
  };
  MeanPath path;
  path.x_m = smooth(x_m);
  path.y_m = smooth(y_m);
  path.phi_rad = grid.segment(kPerTurn, path.x_m.size());
  path.t_s = on_uniform_phi(phi_rad, t_s, grid).segment(kPerTurn, path.x_m.size());
  path.heading_per_phi = heading_rate(path.x_m, path.y_m, step);
  return path;
}

std::optional<double> MeanPath::inflection_s() const {
  if (heading_per_phi.size() <= kPerTurn) return std::nullopt;
  const Eigen::VectorXd mean = turn_average(heading_per_phi);
  for (Eigen::Index i = 1; i < mean.size(); ++i) {
    if (!(mean[i - 1] > 0.0 && mean[i] <= 0.0)) continue;
    const Eigen::Index middle = i + kPerTurn / 2;
    const double part = mean[i - 1] / (mean[i - 1] - mean[i]);
    return t_s[middle - 1] + part * (t_s[middle] - t_s[middle - 1]);
  }
  return std::nullopt;
}

Eigen::VectorXd MeanPath::heading_in_parts(int parts) const {
  Eigen::VectorXd mean(parts);
  for (Eigen::Index i = 0; i < parts; ++i) {
    const Eigen::Index begin = i * heading_per_phi.size() / parts;
    const Eigen::Index end = (i + 1) * heading_per_phi.size() / parts;
    mean[i] = heading_per_phi.segment(begin, end - begin).mean();
  }
  return mean;
}

}  // namespace trochoid::model
