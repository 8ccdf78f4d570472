#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <complex>

#include "observe/angles.hpp"
#include "observe/smoothing.hpp"
#include "start/starts.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/model/steady.hpp"

namespace trochoid::fitting {
namespace {

// An angle, and the same smoothed where there is enough of it.
struct SmoothAngle : AngleSeries {
  SmoothCurve curve;
};

SmoothAngle series_of(const ArcData& arc, Channel channel) {
  constexpr std::size_t kFewest = 8;
  SmoothAngle series{angle_series(arc, channel), {}};
  if (series.t_s.size() >= kFewest) series.curve = smooth_auto(series.t_s, series.angles());
  return series;
}

Eigen::Index nearest(const AngleSeries& series, double t_s) {
  const auto found = std::lower_bound(series.t_s.begin(), series.t_s.end(), t_s);
  return std::min<Eigen::Index>(found - series.t_s.begin(),
                                static_cast<Eigen::Index>(series.t_s.size()) - 1);
}

// Value and rate at an instant: the smoothed curve's nearest sample, carried there.
std::pair<double, double> at(const SmoothAngle& series, double t_s) {
  const Eigen::Index i = nearest(series, t_s);
  const double rate = series.curve.first(i, 0);
  return {series.curve.value(i, 0) + rate * (t_s - series.t_s[i]), rate};
}

struct Motion {
  SmoothCurve curve;
  Eigen::Vector2d position_m, velocity_m_s, acceleration_m_s2;
  double turning_rad_s = 0.0;   // median rate of the heading
  double veering_rad_s = 0.0;   // and of the acceleration's direction
  double strongest_m_s2 = 0.0;  // upper tenth of the acceleration
};

double cross(const Eigen::RowVector2d& a, const Eigen::RowVector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

Motion motion_of(const ArcData& arc) {
  SmoothCurve curve = smooth_auto(arc.t_s, arc.positions_m());
  std::vector<double> turning, veering, acceleration;
  for (Eigen::Index i = 0; i < curve.value.rows(); ++i) {
    const Eigen::RowVector2d v = curve.first.row(i), a = curve.second.row(i);
    const double speed2 = v.squaredNorm();
    acceleration.push_back(a.norm());
    if (speed2 > 0.0) turning.push_back(cross(v, a) / speed2);
    if (i == 0) continue;
    const Eigen::RowVector2d before = curve.second.row(i - 1);
    veering.push_back(std::atan2(cross(before, a), before.dot(a)) / (arc.t_s[i] - arc.t_s[i - 1]));
  }
  const auto upper =
      acceleration.begin() + static_cast<std::ptrdiff_t>(acceleration.size() * 9 / 10);
  std::nth_element(acceleration.begin(), upper, acceleration.end());
  const Eigen::Vector2d position = curve.value.row(0), velocity = curve.first.row(0),
                        pull = curve.second.row(0);
  return {.curve = std::move(curve),
          .position_m = position,
          .velocity_m_s = velocity,
          .acceleration_m_s2 = pull,
          .turning_rad_s = median_or_zero(std::move(turning)),
          .veering_rad_s = median_or_zero(std::move(veering)),
          .strongest_m_s2 = *upper};
}

// Spin of a body that rolls without slip with the measured velocity.
double spin_by_velocity(const Motion& motion, const model::RimBody& body, double phi, double w2) {
  const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
  return (body.signed_h() * w2 - motion.velocity_m_s.dot(n)) / body.R;
}

Start state(const Motion& motion, double theta, double phi, double w1, double w2, double w3,
            const char* path) {
  return {path,
          {{"theta_rad", theta},
           {"phi_rad", phi},
           {"w1_rad_s", w1},
           {"w2_rad_s", w2},
           {"w3_rad_s", w3},
           {"x_m", motion.position_m.x()},
           {"y_m", motion.position_m.y()},
           {"vx_m_s", motion.velocity_m_s.x()},
           {"vy_m_s", motion.velocity_m_s.y()}}};
}

// Spin at the window's first sample, whatever the rim does on the floor: the couples about the node
// line balance when (per mass)
//   A ddtheta = A w2 O3 - C w2 w3 - z' N + z Ft,  O3 = w2 cot theta,  N = g + d2z/dt2,
// and the force along the line, Fn, is what changes the spin: C dw3 = R Fn. Median over the window.
double spin_by_couples(const model::RimBody& q, const ArcData& arc, const SmoothAngle& tilts,
                       const SmoothAngle& turns, const Motion& motion) {
  std::vector<double> spins;
  double gained = 0.0, before = 0.0;  // spin since the first sample, and its rate at the last one
  for (std::size_t sample = 0; sample < arc.t_s.size(); ++sample) {
    const double t_s = arc.t_s[sample];
    const Eigen::Index i = nearest(tilts, t_s), k = nearest(turns, t_s);
    const double theta = tilts.curve.value(i, 0), w1 = tilts.curve.first(i, 0);
    const double dw1 = tilts.curve.second(i, 0), W = turns.curve.first(k, 0);
    const double s = std::sin(theta), c = std::cos(theta),
                 h = model::touching_side(theta, w1) * q.h;
    const double z = q.R * s + h * c, slope = q.R * c - h * s;
    const Eigen::Vector2d n =
        Eigen::Rotation2Dd(turns.curve.value(k, 0)) * Eigen::Vector2d::UnitX();
    const Eigen::Vector2d force = motion.curve.second.row(static_cast<Eigen::Index>(sample));
    const double Fn = n.dot(force), Ft = n.x() * force.y() - n.y() * force.x();
    const double N = q.g + slope * dw1 - z * w1 * w1, rate = q.R * Fn / q.C;
    if (sample > 0) gained += 0.5 * (before + rate) * (t_s - arc.t_s[sample - 1]);
    before = rate;
    const double pull = q.A * (W * W * s * c - dw1) - slope * N + z * Ft;
    spins.push_back(pull / (q.C * W * s) - gained);
  }
  return median_or_zero(std::move(spins));
}

// Median of the slopes between all pairs of the first `count` readings (Theil and Sen), and the
// line's value at an instant: a third of the readings may be wrong.
std::pair<double, double> robust_line(const AngleSeries& series, int count, double t_s) {
  std::vector<double> slopes, values;
  for (int i = 0; i < count; ++i)
    for (int k = i + 1; k < count; ++k)
      slopes.push_back((series.angle_rad[k] - series.angle_rad[i]) /
                       (series.t_s[k] - series.t_s[i]));
  const double slope = median_or_zero(std::move(slopes));
  for (int i = 0; i < count; ++i)
    values.push_back(series.angle_rad[i] - slope * (series.t_s[i] - t_s));
  return {median_or_zero(std::move(values)), slope};
}

// The same for an angle that turns up to a quarter of a turn per sample and may be half a turn off:
// the rate that aligns twice the angles best, then the side that more of them are on.
std::pair<double, double> robust_turning(const AngleSeries& series, int count, double t_s) {
  const double span_s = series.t_s[count - 1] - series.t_s[0];
  const double fastest = 0.5 * data::kPi * (count - 1) / span_s;
  constexpr int kPerPeak = 8;  // rates looked at over the width of a peak
  const int steps = kPerPeak * count;
  const auto aligned = [&](double rate, double times) {
    std::complex<double> sum = 0.0;
    for (int i = 0; i < count; ++i)
      sum += std::polar(1.0, times * (series.angle_rad[i] - rate * (series.t_s[i] - t_s)));
    return sum;
  };
  double best = 0.0, turning = 0.0;
  for (int i = -steps; i <= steps; ++i) {
    const double rate = fastest * i / steps, size = std::abs(aligned(rate, 2.0));
    if (size > best) best = size, turning = rate;
  }
  double azimuth = 0.5 * std::arg(aligned(turning, 2.0));
  if ((aligned(turning, 1.0) * std::polar(1.0, -azimuth)).real() < 0.0) azimuth += data::kPi;
  return {azimuth, turning};
}

// Usual number of readings of an angle in one of its turns.
double readings_a_turn(const AngleSeries& series) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < series.angle_rad.size(); ++i)
    steps.push_back(std::abs(series.angle_rad[i] - series.angle_rad[i - 1]));
  return data::kTurn / std::max(median_or_zero(std::move(steps)), 1e-9);
}

std::vector<Start> from_angles(const ArcData& arc, const model::RimBody& body, bool slides,
                               const Motion& motion) {
  const SmoothAngle theta = series_of(arc, Channel::theta), phi = series_of(arc, Channel::phi);
  const int fewest = static_cast<int>(std::min(theta.t_s.size(), phi.t_s.size()));
  if (fewest < 8) return {};
  std::vector<Start> starts;
  // A camera that is slow for the motion sees the angles well but no velocity: steady rolling is
  // the other guess of the spin. Where it is not, bodies that slide would be led astray by it.
  constexpr double kFew = 20.0;
  const bool slow = readings_a_turn(phi) < kFew;
  const double balanced = spin_by_couples(body, arc, theta, phi, motion);
  const auto add = [&](const std::pair<double, double>& tilt, const std::pair<double, double>& turn,
                       double share) {
    const double leaning = std::clamp(tilt.first, 0.03, data::kPi - 0.03), azimuth = turn.first;
    const double w1 = share * tilt.second, w2 = turn.second * std::sin(leaning);
    model::RimBody placed = body;
    placed.side = model::touching_side(leaning, w1);
    std::vector<double> spins{spin_by_velocity(motion, placed, azimuth, w2)};
    if (slow && turn.second != 0.0)
      spins.push_back(model::steady_rolling_spin(body, leaning, turn.second));
    if (slides && std::isfinite(balanced)) spins.push_back(balanced);
    for (const double w3 : spins)
      starts.push_back(state(motion, leaning, azimuth, w1, w2, w3, "windows"));
  };
  for (const double share : {1.0, 0.5})  // the rate at an edge of the window is its noisiest number
    add(at(theta, arc.start_s), at(phi, arc.start_s), share);
  for (const int count : {4, 8, 16, 32})
    if (count <= fewest && (slow || count > 4))
      add(robust_line(theta, count, arc.start_s), robust_turning(phi, count, arc.start_s), 1.0);
  return starts;
}

std::vector<Start> from_positions(const model::RimBody& body, const Motion& motion) {
  std::vector<Start> starts;
  const double speed = motion.velocity_m_s.norm();
  const double heading = std::atan2(motion.velocity_m_s.y(), motion.velocity_m_s.x());
  for (double theta = 0.15; theta < 1.5; theta += 0.15)
    for (int direction = 0; direction < 12; ++direction) {
      const double delta = data::kTurn * direction / 12;
      const double vn = speed * std::cos(delta), vt = speed * std::sin(delta);
      const double z = model::tilt(body, theta).z;
      std::vector<double> rates{0.8 * motion.turning_rad_s, motion.turning_rad_s,
                                1.25 * motion.turning_rad_s};
      for (const double rate : model::steady_rolling_precessions(body, theta, vn))
        rates.push_back(rate);
      for (const double rate : rates) {
        const double phi = heading - delta, w2 = rate * std::sin(theta);
        starts.push_back(state(motion, theta, phi, -vt / z, w2,
                               spin_by_velocity(motion, body, phi, w2), "multistart"));
      }
    }
  return starts;
}

// A rim that slips is braked against its slip, by friction times gravity: the acceleration at the
// window's first sample gives the slip's direction and the friction, a grid its speed. The spin and
// the tilting rate are those that let the contact point slip so.
std::vector<Start> from_slip(const model::RimBody& body, const Motion& motion) {
  constexpr double kSteepest = 0.5;  // tilting over turning: what spins does not fall over
  const double brake_m_s2 = motion.acceleration_m_s2.norm();
  if (!(brake_m_s2 > 0.0)) return {};
  const double heading = std::atan2(motion.acceleration_m_s2.y(), motion.acceleration_m_s2.x());
  const double friction = std::clamp(brake_m_s2 / body.g, 0.03, 0.9);
  std::vector<Start> starts;
  for (double theta = 0.15; theta < 1.5; theta += 0.15)
    for (int direction = 0; direction < 12; ++direction)
      for (const double share : {0.1, 0.2, 0.4, 0.8}) {
        const double phi = heading - data::kTurn * direction / 12;
        const Eigen::Vector2d along(std::cos(phi), std::sin(phi)), across(-along.y(), along.x());
        const Eigen::Vector2d slip =
            -share * std::sqrt(body.g * body.R) / brake_m_s2 * motion.acceleration_m_s2;
        const Eigen::Vector2d rolled = motion.velocity_m_s - slip;
        const double z = model::tilt(body, theta).z;
        const double w1 = -rolled.dot(across) / z;
        std::vector<double> rates{motion.turning_rad_s, motion.veering_rad_s};
        for (const double rate : model::steady_rolling_precessions(body, theta, rolled.dot(along)))
          rates.push_back(rate);
        for (const double rate : rates) {
          const double w2 = rate * std::sin(theta);
          if (std::abs(w1) > kSteepest * std::abs(w2)) continue;
          const double w3 = (body.h * w2 - rolled.dot(along)) / body.R;
          starts.push_back(state(motion, theta, phi, w1, w2, w3, "slip"));
          starts.back().values["friction"] = friction;
        }
      }
  return starts;
}

// A rim that slips because the body spins fast pulls its centre along the node line, and the pull
// veers as fast as the line turns. The spin is that at which gravity makes it turn so.
std::vector<Start> from_spin(const model::RimBody& body, const Motion& motion) {
  const double brake_m_s2 = motion.acceleration_m_s2.norm();
  const double heading = std::atan2(motion.acceleration_m_s2.y(), motion.acceleration_m_s2.x());
  std::vector<Start> starts;
  for (double theta = 0.15; theta < 1.5; theta += 0.15)
    for (const double share : {0.5, 0.7, 1.0, 1.4, 2.0}) {
      const double s = std::sin(theta), c = std::cos(theta), W = share * motion.veering_rad_s;
      const double pull = body.A * W * W * s * c + body.g * (body.h * s - body.R * c);
      const double w2 = W * s, w3 = pull / (body.C * w2);
      if (!std::isfinite(w3)) continue;
      const double phi = body.R * w3 < body.h * w2 ? heading : heading + data::kPi;
      starts.push_back(state(motion, theta, phi, 0.0, w2, w3, "spin"));
      starts.back().values["friction"] = std::clamp(brake_m_s2 / body.g, 0.03, 0.9);
    }
  return starts;
}

}  // namespace

std::vector<Start> rim_starts(const ArcData& window, const model::RimBody& body, bool slides) {
  if (window.t_s.size() < 12) return {};
  const Motion motion = motion_of(window);
  std::vector<Start> starts = from_angles(window, body, slides, motion);
  const bool seen = !starts.empty();
  if (!seen) starts = from_positions(body, motion);
  if (!slides) return starts;
  // Friction is what accelerates the centre, so it is at least that strong; the scene's own value
  // is the other guess.
  const std::size_t plain = starts.size();
  for (std::size_t i = 0; i < plain; ++i) {
    starts.push_back(starts[i]);
    starts.back().values["friction"] = std::clamp(1.1 * motion.strongest_m_s2 / body.g, 0.05, 0.9);
  }
  if (seen) return starts;
  for (const auto& slipping : {from_slip(body, motion), from_spin(body, motion)})
    starts.insert(starts.end(), slipping.begin(), slipping.end());
  return starts;
}

std::vector<Start> leaning_otherwise(const model::RimBody& body, const Start& known) {
  constexpr double kFlattest = 0.05, kSteepest = 1.55, kStep = 0.05;  // tilts looked at
  constexpr int kHalvings = 20;
  const double theta = known.values.at("theta_rad"), w2 = known.values.at("w2_rad_s");
  if (!(theta < 0.5 * data::kPi)) return {};
  const double along_m_s = body.h * w2 - body.R * known.values.at("w3_rad_s");
  const double rate = w2 / std::sin(theta);
  const auto spin = [&](double tilt) {  // the node line half a turn round
    return (body.h * rate * std::sin(tilt) + along_m_s) / body.R;
  };
  const auto unsteady = [&](double tilt) {
    return model::steady_rolling_spin(body, tilt, rate) - spin(tilt);
  };
  std::vector<Start> starts;
  for (double low = kFlattest; low < kSteepest; low += kStep) {
    double flat = low, steep = low + kStep;
    if (!(unsteady(flat) * unsteady(steep) <= 0.0)) continue;
    for (int i = 0; i < kHalvings; ++i) {
      const double middle = 0.5 * (flat + steep);
      (unsteady(flat) * unsteady(middle) <= 0.0 ? steep : flat) = middle;
    }
    Start& other = starts.emplace_back(known);
    other.values["theta_rad"] = flat;
    other.values["phi_rad"] += data::kPi;
    other.values["w1_rad_s"] *= -model::tilt(body, theta).z / model::tilt(body, flat).z;
    other.values["w2_rad_s"] = rate * std::sin(flat);
    other.values["w3_rad_s"] = spin(flat);
  }
  return starts;
}

}  // namespace trochoid::fitting
