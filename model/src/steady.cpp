#include "trochoid/model/steady.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "rim_setup.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/sliding.hpp"

// Symbols of rim_body.hpp; W = dphi/dt; equation numbers of model/theory/steady.md.
namespace trochoid::model {
namespace {

using Lanes = Dual<4>;
constexpr double kUpright = 0.5 * data::kPi;
constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kNotDefined = std::numeric_limits<double>::quiet_NaN();

void require_tilt(double theta_rad) {
  if (!(theta_rad > 0.0 && theta_rad < kUpright))
    throw InputError(fmt::format("theta_rad = {} must lie between 0 and pi/2", theta_rad));
}

// d(dw1)/d(theta, w2, w3) at a steady state, with dw2 and dw3 per unit w1 (along a nutation w2 and
// w3 follow the tilt), give the restoring rate: nu^2 = -(d/dtheta + w2' d/dw2 + w3' d/dw3) dw1. (6)
template <class DualSystem, class Acceleration>
double nutation2(const DualSystem& system, State<double, DualSystem::kStates> at,
                 Acceleration acceleration) {
  State<Lanes, DualSystem::kStates> y;
  for (int i = 0; i < DualSystem::kStates; ++i) y[i] = at[i];
  y[Rim::theta] = Lanes::variable(at[Rim::theta], 0);
  y[Rim::w2] = Lanes::variable(at[Rim::w2], 1);
  y[Rim::w3] = Lanes::variable(at[Rim::w3], 2);
  const auto slope = acceleration(system, y).w1.derivative;
  at[Rim::w1] = 1.0;  // dw2 and dw3 are proportional to w1
  const auto rates = acceleration(system.values(), at);
  return -(slope[0] + rates.w2 * slope[1] + rates.w3 * slope[2]);
}

struct RollingAcceleration {
  template <class System, class Y>
  auto operator()(const System& system, const Y& y) const {
    return system.acceleration(system.motion(y));
  }
};
struct SmoothAcceleration {
  template <class System, class Y>
  auto operator()(const System& system, const Y& y) const {
    return system.contact(system.motion(y), system.slip(y)).a;
  }
};

using RoughFloor = Rolling<Lanes>;
using SmoothFloor = Sliding<Lanes, NoFriction>;

SteadyMotion rolling_motion(const RimBody& body, double theta, double W, double w3) {
  const RoughFloor system{.body = body, .losses = {}};
  State<double, RoughFloor::kStates> y{};
  y[Rim::theta] = theta;
  y[Rim::w2] = W * std::sin(theta);
  y[Rim::w3] = w3;
  const auto values = system.values();
  const auto motion = values.motion(y);
  const auto force = values.contact_force(motion, values.acceleration(motion));
  SteadyMotion result;
  result.theta_rad = theta;
  result.precession_rad_s = W;
  result.w3_rad_s = w3;
  const double radius = std::abs(motion.v1 / W);  // (3)
  const bool at_rest = radius < 1e-12 * body.R;   // rounding of the two terms of v1
  result.circle_radius_m = at_rest ? 0.0 : radius;
  result.kind = at_rest ? SteadyKind::tilted_spinning : SteadyKind::circular_rolling;
  result.normal_force_N = force.normal;
  result.friction_demand = std::hypot(force.along_n, force.along_mh) / force.normal;
  result.nutation2_1_s2 = nutation2(system, y, RollingAcceleration{});
  return result;
}

SteadyMotion smooth_motion(const RimBody& body, double theta, double W, double w3) {
  const SmoothFloor system{.body = body, .losses = {}, .friction = {}};
  State<double, SmoothFloor::kStates> y{};
  y[Rim::theta] = theta;
  y[Rim::w2] = W * std::sin(theta);
  y[Rim::w3] = w3;
  SteadyMotion result;
  result.floor = Floor::smooth;
  result.kind = SteadyKind::tilted_spinning;
  result.theta_rad = theta;
  result.precession_rad_s = W;
  result.w3_rad_s = w3;
  result.normal_force_N = body.m * body.g;
  result.nutation2_1_s2 = nutation2(system, y, SmoothAcceleration{});
  return result;
}

// A thin body stands on one point and needs speed; a thick one stands on its wall.
SteadyMotion upright_motion(const RimBody& body, SteadyKind kind, double rate) {
  const bool spins = kind == SteadyKind::upright_spinning;
  SteadyMotion result;
  result.kind = kind;
  result.theta_rad = kUpright;
  result.precession_rad_s = spins ? rate : 0.0;
  result.w3_rad_s = spins ? 0.0 : rate;
  result.circle_radius_m = spins ? 0.0 : kInfinite;
  result.normal_force_N = body.m * body.g;
  const double J = body.A + body.m * body.R * body.R;
  const double D = body.C + body.m * body.R * body.R;
  const double falling = body.m * body.g * body.R / J;
  result.nutation2_1_s2 = body.h > 0.0 ? kNotDefined
                          : spins      ? rate * rate - falling                          // (8)
                                       : body.C * D * rate * rate / (body.A * J) - falling;  // (7)
  return result;
}

SteadyMotion flat_motion(const RimBody& body, Floor floor) {
  SteadyMotion result;
  result.floor = floor;
  result.kind = SteadyKind::flat;
  result.normal_force_N = body.m * body.g;
  result.nutation2_1_s2 = kNotDefined;
  return result;
}

std::optional<SteadyMotion> on_circle(const RimBody& b, double theta, double radius) {
  const double s = std::sin(theta), c = std::cos(theta);
  const double reach = b.R * s + b.h * c;
  const double spin_per_W = (b.h * s - radius) / b.R;  // v = h W s - R w3 = radius W
  const double stiffness = b.A * s * c - b.C * s * spin_per_W + b.m * reach * radius;
  const double W2 = b.m * b.g * (b.R * c - b.h * s) / stiffness;  // (4)
  if (!(W2 > 0.0) || !std::isfinite(W2)) return std::nullopt;
  const double W = std::sqrt(W2);
  return rolling_motion(b, theta, W, spin_per_W * W);
}

std::vector<SteadyMotion> on_smooth_floor(const RimBody& b, double theta, double w3) {
  const double s = std::sin(theta), c = std::cos(theta);
  const double a = b.A * s * c, half_b = 0.5 * b.C * s * w3;
  const double constant = b.m * b.g * (b.h * s - b.R * c);
  const double discriminant = half_b * half_b - a * constant;  // (5)
  if (discriminant < 0.0) return {};
  const double root = std::sqrt(discriminant);
  // The sum of equal signs first, the other root from the product: no cancellation.
  const double far = (half_b + std::copysign(root, half_b)) / a;
  const double near = far == 0.0 ? 0.0 : constant / (a * far);
  std::vector<SteadyMotion> motions;
  for (const double W : {near, far})
    if (W != 0.0) motions.push_back(smooth_motion(b, theta, W, w3));
  return motions;
}

RimBody on_its_rim(RimBody body, double theta) {
  body.side = touching_side(theta, 0.0);
  return body;
}

double least_rolling(const RimBody& b) {
  return std::sqrt(b.m * b.g * b.R * b.A / (b.C * (b.C + b.m * b.R * b.R)));
}
double least_spinning(const RimBody& b) {
  return std::sqrt(b.m * b.g * b.R / (b.A + b.m * b.R * b.R));
}

}  // namespace

std::string_view name(SteadyKind kind) {
  switch (kind) {
    case SteadyKind::flat:
      return "flat at rest";
    case SteadyKind::straight_rolling:
      return "straight rolling";
    case SteadyKind::upright_spinning:
      return "upright spinning";
    case SteadyKind::circular_rolling:
      return "circular rolling";
    case SteadyKind::tilted_spinning:
      return "tilted spinning";
  }
  return "";
}

std::string_view name(Floor floor) {
  return floor == Floor::rough ? "rough" : "smooth";
}

double steady_rolling_spin(const RimBody& given, double theta_rad, double precession_rad_s) {
  const RimBody body = on_its_rim(given, theta_rad);
  const auto [s, c, z, slope] = tilt(body, theta_rad);
  const double W = precession_rad_s;
  const double pull =
      W * W * s * (body.A * c + body.m * z * body.signed_h()) - body.m * body.g * slope;
  return pull / (W * (body.C * s + body.m * body.R * z));  // (2)
}

std::vector<double> steady_rolling_precessions(const RimBody& given, double theta_rad,
                                               double along_m_s) {
  const RimBody body = on_its_rim(given, theta_rad);
  const auto [s, c, z, slope] = tilt(body, theta_rad);
  const double h = body.signed_h();
  // (1) with h W s - R w3 = v: a2 W^2 + a1 W + a0 = 0.
  const double a2 = body.A * s * c - body.C * s * s * h / body.R;
  const double a1 = (body.C * s / body.R + body.m * body.R * s + body.m * h * c) * along_m_s;
  const double a0 = -body.m * body.g * slope;
  const double discriminant = a1 * a1 - 4.0 * a2 * a0;
  if (discriminant < 0.0) return {};
  // The sum of equal signs first, the other root from the product: no cancellation. Where a2
  // vanishes only one is left.
  const double sum = -0.5 * (a1 + std::copysign(std::sqrt(discriminant), a1));
  std::array<double, 2> roots{sum / a2, a0 / sum};
  if (!std::signbit(a1)) std::swap(roots[0], roots[1]);  // that of + the square root first
  std::vector<double> precessions;
  for (const double root : roots)
    if (std::isfinite(root)) precessions.push_back(root);
  return precessions;
}

SteadyMotion steady_rolling(const data::Body& body, double gravity_m_s2, double theta_rad,
                            double precession_rad_s) {
  require_tilt(theta_rad);
  if (!(std::isfinite(precession_rad_s) && precession_rad_s != 0.0))
    throw InputError(
        fmt::format("precession_rad_s = {} must be finite and not 0", precession_rad_s));
  const RimBody rim = rim_body(body, gravity_m_s2);
  return rolling_motion(rim, theta_rad, precession_rad_s,
                        steady_rolling_spin(rim, theta_rad, precession_rad_s));
}

std::optional<SteadyMotion> steady_rolling_on_circle(const data::Body& body, double gravity_m_s2,
                                                     double theta_rad, double circle_radius_m) {
  require_tilt(theta_rad);
  return on_circle(rim_body(body, gravity_m_s2), theta_rad, circle_radius_m);
}

std::vector<SteadyMotion> steady_smooth(const data::Body& body, double gravity_m_s2,
                                        double theta_rad, double w3_rad_s) {
  require_tilt(theta_rad);
  return on_smooth_floor(rim_body(body, gravity_m_s2), theta_rad, w3_rad_s);
}

double least_rolling_rate_rad_s(const data::Body& body, double gravity_m_s2) {
  return least_rolling(rim_body(body, gravity_m_s2));
}

double least_spinning_rate_rad_s(const data::Body& body, double gravity_m_s2) {
  return least_spinning(rim_body(body, gravity_m_s2));
}

std::vector<SteadyMotion> steady_catalogue(const data::Body& body, double gravity_m_s2,
                                           const std::vector<double>& tilts_rad) {
  const RimBody rim = rim_body(body, gravity_m_s2);
  const auto upright = [&](SteadyKind kind, double rate) {
    return upright_motion(rim, kind, 2.0 * rate);
  };
  std::vector<SteadyMotion> motions{
      flat_motion(rim, Floor::rough),
      upright(SteadyKind::straight_rolling, least_rolling(rim)),
      upright(SteadyKind::upright_spinning, least_spinning(rim)),
  };
  for (const double theta : tilts_rad) {
    require_tilt(theta);
    for (const double radii : {0.0, 1.0, 2.0, 5.0, -1.0})
      if (const auto motion = on_circle(rim, theta, radii * rim.R)) motions.push_back(*motion);
  }
  motions.push_back(flat_motion(rim, Floor::smooth));
  const double fast = 5.0 * std::sqrt(rim.g / rim.R);
  for (const double theta : tilts_rad)
    for (const double w3 : {0.0, fast})
      for (const SteadyMotion& motion : on_smooth_floor(rim, theta, w3)) motions.push_back(motion);
  return motions;
}

}  // namespace trochoid::model
