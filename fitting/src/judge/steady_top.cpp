#include "judge/steady_top.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "judge/degeneracies.hpp"
#include "observe/angles.hpp"
#include "observe/decompositions.hpp"
#include "observe/observed.hpp"

namespace trochoid::fitting {
namespace {

// A motion about the pivot without nutation: distance, azimuth and, where it is seen, tilt as
// polynomials in time since the start, constant but for the linear azimuth without drag; with drag
// the axis sinks or rises and the rate drifts.
struct Steady {
  Eigen::VectorXd distance_m, azimuth_rad, tilt_rad;
};

double at(const Eigen::VectorXd& coefficients, double t) {
  double value = 0.0;
  for (Eigen::Index k = coefficients.size() - 1; k >= 0; --k) value = value * t + coefficients[k];
  return value;
}

Eigen::MatrixXd powers_of(const std::vector<double>& t_s, double start_s, int highest) {
  Eigen::MatrixXd powers(static_cast<Eigen::Index>(t_s.size()), highest + 1);
  for (Eigen::Index i = 0; i < powers.rows(); ++i)
    for (int k = 0; k <= highest; ++k)
      powers(i, k) = std::pow(t_s[static_cast<std::size_t>(i)] - start_s, k);
  return powers;
}

Steady steady_through(const ArcData& arc, const Eigen::Vector2d& pivot_m, bool drag) {
  const Eigen::MatrixX2d xy = arc.positions_m().rowwise() - pivot_m.transpose();
  const int highest = drag ? 3 : 1;
  const Eigen::MatrixXd powers = powers_of(arc.t_s, arc.start_s, highest);
  Steady steady{LeastSquares(powers.leftCols(highest)).solve(xy.rowwise().norm()),
                LeastSquares(powers).solve(precessions(xy)),
                {}};
  if (const AngleSeries tilt = angle_series(arc, Channel::theta); !tilt.t_s.empty())
    steady.tilt_rad =
        LeastSquares(powers_of(tilt.t_s, arc.start_s, highest - 1)).solve(tilt.angles());
  return steady;
}

// What a model would predict that moves so.
Eigen::VectorXd values_of(const Steady& steady, const ArcData& arc,
                          const Eigen::Vector2d& pivot_m) {
  using model::Observable;
  std::vector<double> values;
  for (const double t_s : arc.t_s) {
    const double t = t_s - arc.start_s, phi = at(steady.azimuth_rad, t);
    const double distance_m = at(steady.distance_m, t);
    for (const Observable observable : arc.observables)
      values.push_back(observable == Observable::x_m   ? pivot_m.x() + distance_m * std::sin(phi)
                       : observable == Observable::y_m ? pivot_m.y() - distance_m * std::cos(phi)
                       : observable == Observable::phi_rad ? phi
                                                           : at(steady.tilt_rad, t));
  }
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

// The spin's readings left out, the others weighted as before.
Problem without_spin(const Problem& problem) {
  Problem path = problem;
  const ArcData& arc = problem.arcs[0];
  path.arcs[0] = arc.without(Channel::psi);
  if (problem.row_weights[0].size() == 0) return path;
  std::vector<double> weights;
  for (const Reading& reading : arc.readings)
    if (reading.channel != Channel::psi)
      weights.insert(weights.end(), static_cast<std::size_t>(rows_of(reading.channel)),
                     robust_weight(problem, 0, reading));
  path.row_weights[0] =
      Eigen::Map<const Eigen::VectorXd>(weights.data(), static_cast<Eigen::Index>(weights.size()));
  return path;
}

// The samples none of whose readings stand out.
ArcData without_glitches(const Problem& path) {
  constexpr double kStandsOut = 0.5;
  const ArcData& arc = path.arcs[0];
  std::vector<bool> good(arc.t_s.size(), true);
  for (const Reading& reading : arc.readings)
    if (robust_weight(path, 0, reading) < kStandsOut)
      good[static_cast<std::size_t>(reading.sample)] = false;
  std::vector<int> kept;
  for (std::size_t i = 0; i < good.size(); ++i)
    if (good[i]) kept.push_back(static_cast<int>(i));
  return arc.keep(kept);
}

bool known_beforehand(const Problem& problem, const char* name) {
  const int index = problem.predictor->index_of(name);
  for (const FreeParameter& parameter : problem.free)
    if (parameter.index == index) return parameter.prior.has_value();
  return true;  // not fitted at all
}

// What the recording's lengths and times are to true ones (observed.hpp), and where it shows the
// pivot.
struct Measure {
  double scale, factor;
  Eigen::Vector2d pivot_m;
};

Measure measure_of(const Problem& problem, const Eigen::VectorXd& values) {
  const auto value_or = [&](const char* name, double otherwise) {
    const int index = problem.predictor->index_of(name);
    return index >= 0 ? values[index] : otherwise;
  };
  const double scale = value_or(kScale, 1.0);
  return {scale, value_or(kTimeFactor, 1.0),
          scale * Eigen::Vector2d(value_or("pivot_x_m", 0.0), value_or("pivot_y_m", 0.0))};
}

// Weighted as in the fit. @pre problem's only arc has no spin.
double chi2_of(const Problem& problem, const Steady& steady, const Eigen::Vector2d& pivot_m) {
  const ArcData& arc = problem.arcs[0];
  Eigen::VectorXd residuals;
  whiten(arc, values_of(steady, arc, pivot_m), {}, residuals, nullptr);
  double chi2 = 0.0;
  for (const Reading& reading : arc.readings) {
    const double weight = robust_weight(problem, 0, reading) / noise_scale(arc, reading.channel);
    chi2 +=
        weight * weight * residuals.segment(reading.row, rows_of(reading.channel)).squaredNorm();
  }
  return chi2;
}

}  // namespace

void admit_steady_precession(const Problem& problem, const Eigen::VectorXd& u, data::Fit& fit) {
  using model::Observable;
  if (problem.arcs.size() != 1) return;
  const bool drag = std::any_of(fit.parameters.begin(), fit.parameters.end(),
                                [](const auto& one) { return one.name.starts_with("gamma"); });
  const ArcData& arc = problem.arcs[0];
  if (arc.observable_index(Observable::x_m) < 0) return;
  const bool tilt_seen = arc.observable_index(Observable::theta_rad) >= 0;
  // At a known tilt and rate either of a and b tells the other.
  if (tilt_seen && (known_beforehand(problem, "a_1_s2") || known_beforehand(problem, "b_1_s")))
    return;
  const auto [scale, factor, pivot_m] = measure_of(problem, problem.values(0, u));
  const Problem path = without_spin(problem);
  Eigen::VectorXd residuals;
  if (!evaluate(path, 0, u, residuals, nullptr)) return;
  const Steady steady = steady_through(without_glitches(path), pivot_m, drag);
  // Parameters that mean nothing lower chi-square by their number +- sqrt(2) times its root, 3
  // sigma; and of as many frequencies as there are samples nutation may take that of the noise's
  // strongest line. Of a, b, l, tilt and its rate a circle has its radius, and its tilt where seen.
  const double more = tilt_seen ? 3.0 : 4.0;
  const double bought_by_chance =
      more + 3.0 * std::sqrt(2.0 * more) + 2.0 * std::log(arc.t_s.size());
  if (chi2_of(path, steady, pivot_m) - residuals.squaredNorm() > bought_by_chance) return;
  std::vector<std::string> hidden{"a_1_s2", "b_1_s"};
  const std::vector<std::string> by_tilt{"l_m", "theta_rad"};
  if (!tilt_seen) hidden.insert(hidden.end(), by_tilt.begin(), by_tilt.end());
  for (data::FitParameter& parameter : fit.parameters) {
    if (std::find(hidden.begin(), hidden.end(), parameter.name) == hidden.end() &&
        parameter.status != data::ParameterStatus::derived)
      continue;
    parameter.identifiable = false;
    parameter.sigma = std::numeric_limits<double>::infinity();
    parameter.note += "; no nutation is seen";
  }
  const bool by_tilt_alone = std::none_of(
      by_tilt.begin(), by_tilt.end(),
      [&](const std::string& name) { return known_beforehand(problem, name.c_str()); });
  if (tilt_seen && by_tilt_alone) fit.broken_degeneracies.push_back(broken_by("tilt", by_tilt));
  fit.warnings.push_back(fmt::format(
      "no nutation is seen: steady precession determines {}l sin(theta) = {:.6g} m, the rate W = "
      "{:.6g} rad/s, and a + W^2 cos(theta) = b W; not {}",
      tilt_seen ? "the tilt, " : "", steady.distance_m[0] / scale, steady.azimuth_rad[1] / factor,
      tilt_seen ? "a and b" : "a, b and l"));
}

}  // namespace trochoid::fitting
