#include "study/high_precision.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "study/extrapolation.hpp"
#include "trochoid/model/inertia.hpp"

namespace trochoid::tools {
namespace {

using V3 = RealVector<3>;
using M3 = Eigen::Matrix<Real, 3, 3>;
constexpr Real kNudge = 1e-9L;
constexpr Real kTolerance = 1e-17L;

V3 axis_of(Real theta, Real phi) {
  return {std::sin(phi) * std::sin(theta), -std::cos(phi) * std::sin(theta), std::cos(theta)};
}
V3 node_of(Real phi) {
  return {std::cos(phi), std::sin(phi), 0};
}

/// Angular velocity in the table frame from the start's tilt, precession and spin rates.
V3 angular_velocity(const data::StartSettings& start, Real spin) {
  const Real theta = *start.theta_rad, phi = start.phi_rad.value_or(0.0);
  const V3 k = axis_of(theta, phi), n = node_of(phi), e2 = k.cross(n);
  const Real w1 = start.w1_rad_s.value_or(start.dtheta_rad_s.value_or(0.0));
  const Real w2 = start.w2_rad_s ? Real(*start.w2_rad_s)
                                 : Real(start.dphi_rad_s.value_or(0.0)) * std::sin(theta);
  return w1 * n + w2 * e2 + spin * k;
}

/// Contact vector r from the CoM to the lowest rim point and its rate, from k and dk/dt.
struct Contact {
  V3 r, dr;
};
Contact contact(Real R, Real h, const V3& k, const V3& dk) {
  const Real c = k.z(), s = std::sqrt(1 - c * c);
  const Real dc = dk.z(), ds = -c * dc / s;
  const V3 up = V3::UnitZ() - c * k, dup = -dc * k - c * dk;
  const V3 e2 = up / s, de2 = (dup - e2 * ds) / s;
  return {-R * e2 - h * k, -R * de2 - h * dk};
}

/// Runs y' = f from y0 on the scene's grid, once as given and once nudged.
template <int N, class Derivative, class Axis, class Path>
std::optional<ReferenceRun> run(const data::Scene& scene, Derivative f, const RealVector<N>& y0,
                                Axis axis, Path path) {
  const auto rows =
      static_cast<Eigen::Index>(std::llround(scene.run.until_s * scene.run.rate_hz)) + 1;
  ReferenceRun result;
  result.t_s.resize(rows);
  result.axis.resize(rows, 3);
  result.xy_m.resize(rows, 2);
  RealVector<N> y = y0, nudged = y0 * (1 + kNudge);
  Extrapolation<N, Derivative> exact(f, kTolerance), beside(f, kTolerance);
  Real t = 0, t_beside = 0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Real until = static_cast<Real>(i) / scene.run.rate_hz;
    if (!exact.advance(t, y, until) || !y.allFinite()) return std::nullopt;
    if (!beside.advance(t_beside, nudged, until)) return std::nullopt;
    result.t_s[i] = static_cast<double>(until);
    result.axis.row(i) = axis(y).template cast<double>().transpose();
    result.xy_m.row(i) = path(y).template cast<double>().transpose();
    const Real apart = (axis(nudged) - axis(y)).norm() / kNudge;
    result.growth = std::max(result.growth, static_cast<double>(apart));
  }
  return result;
}

// y = (ell, k, b): the top with drag; model/theory/top.md, (7).
std::optional<ReferenceRun> run_top(const data::Scene& scene) {
  const data::Body& body = *scene.body;
  const Real I = *body.I_kg_m2, Is = *body.Is_kg_m2, l = *body.l_m;
  const Real a = *body.mass_kg * Real(scene.model.gravity_m_s2) * l / I;
  const Real g1 = scene.model.drag_transverse_N_m_s.value_or(0.0) / I;
  const Real g3 = scene.model.drag_spin_N_m_s.value_or(0.0) / Is;
  const Real quadratic = scene.model.drag_spin_quadratic_N_m_s2.value_or(0.0) * I / (Is * Is);
  const Real b = Is * Real(*scene.start.omega_s_rad_s) / I;
  const auto f = [=](Real, const RealVector<7>& y) {
    const V3 ell = y.head<3>(), k = y.segment<3>(3);
    const Real lost = (g3 + quadratic * std::abs(y[6])) * y[6];
    RealVector<7> dy;
    dy << a * V3::UnitZ().cross(k) - g1 * (ell - y[6] * k) - lost * k, ell.cross(k), -lost;
    return dy;
  };
  RealVector<7> y0;
  const V3 k = axis_of(*scene.start.theta_rad, scene.start.phi_rad.value_or(0.0));
  y0 << angular_velocity(scene.start, b), k, b;
  const Eigen::Vector3d pivot = scene.support.pivot_m.value_or(Eigen::Vector3d::Zero());
  return run<7>(
      scene, f, y0, [](const auto& y) -> V3 { return y.template segment<3>(3); },
      [=](const auto& y) -> RealVector<2> {
        return l * y.template segment<2>(3) + pivot.head<2>().template cast<Real>();
      });
}

// y = (body rates, first two body axes in the table frame): no quaternion, no angle.
std::optional<ReferenceRun> run_free(const data::Scene& scene) {
  const V3 I = scene.start.moments_kg_m2->cast<Real>();
  const auto f = [=](Real, const RealVector<9>& y) {
    const V3 w = y.head<3>(), ex = y.segment<3>(3), ey = y.segment<3>(6);
    const V3 turn = w.x() * ex + w.y() * ey + w.z() * ex.cross(ey);
    RealVector<9> dy;
    dy << (I.y() - I.z()) / I.x() * w.y() * w.z(), (I.z() - I.x()) / I.y() * w.z() * w.x(),
        (I.x() - I.y()) / I.z() * w.x() * w.y(), turn.cross(ex), turn.cross(ey);
    return dy;
  };
  const Real theta = *scene.start.theta_rad, phi = scene.start.phi_rad.value_or(0.0);
  const Real psi = scene.start.psi_rad.value_or(0.0);
  const V3 n = node_of(phi), k = axis_of(theta, phi), e2 = k.cross(n);
  RealVector<9> y0;
  y0 << scene.start.w_body_rad_s->cast<Real>(), std::cos(psi) * n + std::sin(psi) * e2,
      std::cos(psi) * e2 - std::sin(psi) * n;
  return run<9>(
      scene, f, y0,
      [](const auto& y) -> V3 {
        return V3(y.template segment<3>(3)).cross(V3(y.template segment<3>(6)));
      },
      [](const auto&) -> RealVector<2> { return RealVector<2>::Zero(); });
}

/// Inertia and losses of a body with rim contact, in the table frame.
struct RimVectors {
  Real m, A, C, R, h, g, c1, c3, mu, eps_v;

  explicit RimVectors(const data::Scene& scene) {
    const model::CentralInertia inertia = model::central_inertia(*scene.body);
    m = inertia.mass_kg;
    A = inertia.transverse_kg_m2;
    C = inertia.axial_kg_m2;
    R = scene.body->radius_m;
    h = scene.body->half_thickness_m();
    g = scene.model.gravity_m_s2;
    const Eigen::Vector3d air = scene.model.air_linear_N_m_s.value_or(Eigen::Vector3d::Zero());
    c1 = air[0];
    c3 = air[2];
    mu = scene.model.friction.value_or(0.0);
    eps_v = scene.model.slip_regularisation_m_s.value_or(0.0);
  }
  [[nodiscard]] M3 inertia(const V3& k) const {
    return A * M3::Identity() + (C - A) * k * k.transpose();
  }
  /// Couples besides those of the contact force: air, and the gyroscopic -w x (I w).
  [[nodiscard]] V3 couple(const V3& w, const V3& k) const {
    const Real w3 = w.dot(k);
    return -c1 * (w - w3 * k) - c3 * w3 * k - w.cross(V3(inertia(k) * w));
  }
};

// y = (w, k, x, y): rolling, v = -w x r.
std::optional<ReferenceRun> run_rolling(const data::Scene& scene) {
  const RimVectors body(scene);
  const auto f = [body](Real, const RealVector<8>& y) {
    const V3 w = y.head<3>(), k = y.segment<3>(3), dk = w.cross(k);
    const auto [r, dr] = contact(body.R, body.h, k, dk);
    // I dw = r x m (a + g Z) + couples with a = -dw x r - w x dr
    const M3 mass =
        body.inertia(k) + body.m * (r.squaredNorm() * M3::Identity() - r * r.transpose());
    const V3 load = body.couple(w, k) + r.cross(V3(body.m * (body.g * V3::UnitZ() - w.cross(dr))));
    const V3 v = -w.cross(r);
    RealVector<8> dy;
    dy << mass.partialPivLu().solve(load), dk, v.x(), v.y();
    return dy;
  };
  RealVector<8> y0;
  y0 << angular_velocity(scene.start, scene.start.w3_rad_s.value_or(0.0)),
      axis_of(*scene.start.theta_rad, scene.start.phi_rad.value_or(0.0)),
      scene.start.x_m.value_or(0.0), scene.start.y_m.value_or(0.0);
  return run<8>(
      scene, f, y0, [](const auto& y) -> V3 { return y.template segment<3>(3); },
      [](const auto& y) -> RealVector<2> { return y.template tail<2>(); });
}

// y = (w, k, x, y, vx, vy): sliding with regularised Coulomb friction (none if mu = 0).
std::optional<ReferenceRun> run_sliding(const data::Scene& scene) {
  const RimVectors body(scene);
  const auto f = [body](Real, const RealVector<10>& y) {
    const V3 w = y.head<3>(), k = y.segment<3>(3), dk = w.cross(k), Z = V3::UnitZ();
    const auto [r, dr] = contact(body.R, body.h, k, dk);
    V3 slip = w.cross(r);
    slip.x() += y[8];
    slip.y() += y[9];
    slip.z() = 0;
    V3 f_per_N = V3::Zero();
    if (body.mu > 0)
      f_per_N = -body.mu * slip / std::sqrt(slip.squaredNorm() + body.eps_v * body.eps_v);
    // Height of the CoM: d2z = -(dw x r + w x dr).Z, N = m (g + d2z), torque N r x (Z + f).
    const V3 lever = r.cross(V3(Z + f_per_N)), arm = r.cross(Z);
    const Real weight = body.m * (body.g - w.cross(dr).dot(Z));
    const M3 mass = body.inertia(k) + body.m * lever * arm.transpose();
    const V3 dw = mass.partialPivLu().solve(V3(body.couple(w, k) + weight * lever));
    const V3 force = (weight - body.m * dw.dot(arm)) * f_per_N / body.m;
    RealVector<10> dy;
    dy << dw, dk, y[8], y[9], force.x(), force.y();
    return dy;
  };
  RealVector<10> y0;
  y0 << angular_velocity(scene.start, scene.start.w3_rad_s.value_or(0.0)),
      axis_of(*scene.start.theta_rad, scene.start.phi_rad.value_or(0.0)),
      scene.start.x_m.value_or(0.0), scene.start.y_m.value_or(0.0),
      scene.start.vx_m_s.value_or(0.0), scene.start.vy_m_s.value_or(0.0);
  return run<10>(
      scene, f, y0, [](const auto& y) -> V3 { return y.template segment<3>(3); },
      [](const auto& y) -> RealVector<2> { return y.template segment<2>(6); });
}

bool has_unknown_terms(const data::ModelSettings& model) {
  return model.air_quadratic_N_m_s2 || model.air_force_N_s_m || model.gap_viscosity_Pa_s ||
         model.rolling_friction_m || model.pivoting_friction_m || model.contour_friction_m ||
         model.drag_spin_dry_N_m;  // where that stops the spin the motion is not smooth
}

}  // namespace

std::optional<ReferenceRun> high_precision_run(const data::Scene& scene) {
  if (has_unknown_terms(scene.model)) return std::nullopt;
  const std::string& name = scene.model.name;
  if (name == "top" || name == "top-euler") return run_top(scene);
  if (name == "free") return run_free(scene);
  if (name == "rolling") return run_rolling(scene);
  if (name == "smooth" || (name == "sliding" && scene.model.slip_regularisation_m_s))
    return run_sliding(scene);
  return std::nullopt;
}

}  // namespace trochoid::tools
