#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>

#include "observe/angles.hpp"
#include "start/starts.hpp"
#include "trochoid/data/angle.hpp"

// A fast top precesses slowly and trembles: nutation with the frequency nu near b, too small and
// too fast for integrals over the path, but a line in its spectrum.
namespace trochoid::fitting {
namespace {

using Complex = std::complex<double>;

// Slow precession about the pivot, and what is left along and across it.
struct Slow {
  Eigen::VectorXd t_s, radial_m, across_m;
  double distance_m = 0.0, azimuth_rad = 0.0, rate_rad_s = 0.0;  // at t = 0, the first sample
};

Slow slow_part(const ArcData& arc, const Eigen::Vector2d& pivot_m) {
  const Eigen::MatrixX2d xy = arc.positions_m().rowwise() - pivot_m.transpose();
  const Eigen::Index n = xy.rows();
  const Eigen::VectorXd azimuth = precessions(xy), distance = xy.rowwise().norm();
  Eigen::MatrixX4d powers(n, 4);
  Slow slow;
  slow.t_s.resize(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = slow.t_s[i] = arc.t_s[static_cast<std::size_t>(i)] - arc.start_s;
    powers.row(i) << 1.0, t, t * t, t * t * t;
  }
  const auto qr = powers.colPivHouseholderQr();
  const Eigen::Vector4d r = qr.solve(distance), phi = qr.solve(azimuth);
  slow.radial_m = distance - powers * r;
  slow.across_m = distance.cwiseProduct(azimuth - powers * phi);
  slow.distance_m = r[0];
  slow.azimuth_rad = phi[0];
  slow.rate_rad_s = phi[1];
  return slow;
}

// Amplitude A of Re(A exp(i nu t)) in a series.
Complex amplitude(const Slow& slow, const Eigen::VectorXd& series, double nu_rad_s) {
  Complex sum = 0.0;
  for (Eigen::Index i = 0; i < series.size(); ++i)
    sum += series[i] * std::polar(1.0, -nu_rad_s * slow.t_s[i]);
  return 2.0 * sum / static_cast<double>(series.size());
}

double power_at(const Slow& slow, double nu_rad_s) {
  return std::norm(amplitude(slow, slow.radial_m, nu_rad_s)) +
         std::norm(amplitude(slow, slow.across_m, nu_rad_s));
}

// The highest of the powers at evenly spaced frequencies: cosines and sines go on by rotation from
// one frequency to the next.
double highest_of_scan(const Slow& slow, double from, double to, double step) {
  Eigen::ArrayXd cosine = (from * slow.t_s).array().cos(), sine = (from * slow.t_s).array().sin();
  const Eigen::ArrayXd turn_cos = (step * slow.t_s).array().cos(),
                       turn_sin = (step * slow.t_s).array().sin();
  double best = 0.0, highest = 0.0;
  Eigen::ArrayXd next(cosine.size());
  for (double nu = from; nu < to; nu += step) {
    double power = 0.0;
    for (const Eigen::VectorXd* series : {&slow.radial_m, &slow.across_m})
      power += std::pow(series->dot(cosine.matrix()), 2) + std::pow(series->dot(sine.matrix()), 2);
    if (power > highest) highest = power, best = nu;
    next = cosine * turn_cos - sine * turn_sin;
    sine = sine * turn_cos + cosine * turn_sin;
    cosine = next;
  }
  return best;
}

// The strongest line above the precession; 0 if there is none above the noise.
double strongest_line(const Slow& slow) {
  const auto n = static_cast<double>(slow.t_s.size());
  const double duration_s = slow.t_s[slow.t_s.size() - 1];
  const double least = std::max(3.0 * std::abs(slow.rate_rad_s), 8.0 * data::kPi / duration_s);
  const double most = data::kPi * (n - 1.0) / duration_s;
  const double quarter = 0.25 * data::kTurn / duration_s;  // of a line's width
  const double coarse = highest_of_scan(slow, least, most, 2.0 * quarter);
  double best = 0.0, highest = 0.0;
  for (const double nu : {coarse - quarter, coarse, coarse + quarter})
    if (const double power = power_at(slow, nu); nu > 0.0 && power > highest)
      highest = power, best = nu;
  // White noise of variance v gives each line a power of 4 v / n on average; the highest of n lines
  // stays below log(n) + 3 times that nineteen times in twenty.
  const double variance =
      0.5 * (slow.radial_m.squaredNorm() + slow.across_m.squaredNorm()) / std::max(1.0, n);
  return highest > 4.0 * variance / n * (std::log(n) + 3.0) ? best : 0.0;
}

}  // namespace

std::vector<Start> fast_top_starts(const ArcData& arc, const Eigen::Vector2d& pivot_m) {
  constexpr std::size_t kMost = 1500;  // samples: the scan costs their square
  std::vector<Start> starts;
  if (arc.t_s.size() < 40 || arc.t_s.size() > kMost) return starts;
  const Slow slow = slow_part(arc, pivot_m);
  const double nu = strongest_line(slow), W = slow.rate_rad_s;
  if (!(nu > 0.0) || W == 0.0) return starts;
  const Complex radial = amplitude(slow, slow.radial_m, nu);
  const Complex across = amplitude(slow, slow.across_m, nu);
  // Seen along the axis nutation is a circle: the radial part is foreshortened by cos(theta).
  const double seen = std::clamp(std::abs(radial) / std::max(std::abs(across), 1e-300), 0.05, 0.97);
  for (const double c : {seen, 0.95, 0.8, 0.5, 0.2}) {
    const double theta = std::acos(c), l = slow.distance_m / std::sin(theta);
    const double b = std::copysign(nu, W) + 2.0 * W * c;
    const Complex tilt = radial / (l * c), turn = across / slow.distance_m;
    starts.push_back({"spectrum",
                      {{"a_1_s2", W * (b - W * c)},
                       {"b_1_s", b},
                       {"l_m", l},
                       {"theta_rad", theta + tilt.real()},
                       {"phi_rad", slow.azimuth_rad + turn.real()},
                       {"dtheta_rad_s", -nu * tilt.imag()},
                       {"dphi_rad_s", W - nu * turn.imag()},
                       {"pivot_x_m", pivot_m.x()},
                       {"pivot_y_m", pivot_m.y()}}});
  }
  return starts;
}

}  // namespace trochoid::fitting
