#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"
#include "trochoid/model/inertia.hpp"
#include "trochoid/model/rolling.hpp"
#include "trochoid/model/sliding.hpp"

namespace trochoid::model {
namespace {

// The equations against the reference trajectories, row by row and without integrating: at each
// state the contact force, energy and contact point must be those of the file, which was made with
// independent code. Numbers in the files carry 15 digits; forces are O(1) N.
constexpr double kFileDigits = 1e-11;
// Rates of the angles are some ten times as large.
constexpr double kRateDigits = 10.0 * kFileDigits;

struct KnownMotion {
  data::Scene scene;
  data::Table table;
  explicit KnownMotion(const std::string& name)
      : scene(data::read_reference_case(path(name, ".json")).scene),
        table(data::read_table(path(name, ".csv"))) {}
  static std::string path(const std::string& name, const char* ending) {
    return std::string(TROCHOID_SOURCE_DIR) + "/data/reference/" + name + ending;
  }
  [[nodiscard]] double at(Eigen::Index row, const char* column) const {
    return table.column(column)[row];
  }
};

RimBody body_of(const data::Scene& scene) {
  const CentralInertia inertia = central_inertia(*scene.body);
  RimBody body;
  body.m = inertia.mass_kg;
  body.A = inertia.transverse_kg_m2;
  body.C = inertia.axial_kg_m2;
  body.R = scene.body->radius_m;
  body.h = scene.body->half_thickness_m();
  body.g = scene.model.gravity_m_s2;
  return body;
}

template <int N>
State<double, N> state_of(const KnownMotion& file, Eigen::Index row) {
  static constexpr const char* kNames[] = {"phi", "theta", "psi", "w1", "w2", "w3", "x", "y"};
  State<double, N> y;
  for (int i = 0; i < 8; ++i) y[i] = file.at(row, kNames[i]);
  return y;
}

/// State of a sliding body: the files give the velocity of the centre.
State<double, 10> sliding_state(const KnownMotion& file, const RimBody& body, Eigen::Index row) {
  auto y = state_of<10>(file, row);
  const World<double> v{file.at(row, "vx"), file.at(row, "vy")};
  const auto node = node_from_world(v, y[Rim::phi]);
  y[Rim::un] = node.along_n + body.R * y[Rim::w3] - body.signed_h() * y[Rim::w2];
  y[Rim::ut] = node.along_mh + tilt(body, y[Rim::theta]).z * y[Rim::w1];
  return y;
}

template <class System>
void expect_forces(const KnownMotion& file, Eigen::Index row, const System& system,
                   const ContactForce<double>& force, const NodeMotion<double>& q) {
  const double phi = file.at(row, "phi");
  const double fx = force.along_n * std::cos(phi) - force.along_mh * std::sin(phi);
  const double fy = force.along_n * std::sin(phi) + force.along_mh * std::cos(phi);
  EXPECT_NEAR(force.normal, file.at(row, "N"), kFileDigits) << "row " << row;
  EXPECT_NEAR(fx, file.at(row, "Fx"), kFileDigits) << "row " << row;
  EXPECT_NEAR(fy, file.at(row, "Fy"), kFileDigits) << "row " << row;
  EXPECT_NEAR(energy_J(system.body, q), file.at(row, "energy"), kFileDigits) << "row " << row;
  EXPECT_NEAR(q.at.z, file.at(row, "z"), kFileDigits) << "row " << row;
}

template <class System>
void check_rolling(const KnownMotion& file, const System& system) {
  for (Eigen::Index row = 0; row < file.table.values.rows(); ++row) {
    const auto y = state_of<8>(file, row);
    const auto q = system.motion(y);
    const auto a = system.acceleration(q);
    const auto force = system.contact_force(q, a);
    EXPECT_NEAR(a.normal, force.normal, kFileDigits) << "two forms of the normal force";
    expect_forces(file, row, system, force, q);
    State<double, 8> dy;
    system.derivative(0.0, y, dy);
    EXPECT_NEAR(dy[Rim::x], file.at(row, "vx"), kFileDigits);
    EXPECT_NEAR(dy[Rim::y], file.at(row, "vy"), kFileDigits);
    EXPECT_NEAR(dy[Rim::phi], file.at(row, "dphi"), kRateDigits);
    EXPECT_NEAR(dy[Rim::psi], file.at(row, "dpsi"), kRateDigits);
  }
}

TEST(RollingEquations, GiveTheReferenceForcesOfADisc) {
  const KnownMotion file("s06_roll_disc");
  check_rolling(file, Rolling<double>{body_of(file.scene), {}});
}

TEST(RollingEquations, GiveTheReferenceForcesOfAThinHoop) {
  const KnownMotion file("s07_roll_hoop_thin");
  check_rolling(file, Rolling<double>{body_of(file.scene), {}});
}

TEST(RollingEquations, GiveTheReferenceForcesOfARingInAir) {
  const KnownMotion file("s09_ring_retrograde_drag");
  Rolling<double, LinearAir> system{body_of(file.scene), {}};
  const auto& c = *file.scene.model.air_linear_N_m_s;
  system.losses.c1 = c[0];
  system.losses.c2 = c[1];
  system.losses.c3 = c[2];
  check_rolling(file, system);
}

/// Horizontal velocity of the contact point [m/s] (rolling.md, (3)).
Horizontal<double> slip_velocity(const RimBody& body, const NodeMotion<double>& q) {
  const Horizontal<double> v = horizontal_velocity(q);
  return {v.along_n + body.R * q.w3 - body.signed_h() * q.w2, v.along_mh + q.at.z * q.w1};
}

/// Power of all losses but sliding [W]: what they add to dE/dt, never positive (rolling.md, (11)).
template <class Losses>
double loss_power_W(const RimBody& body, const Losses& losses, const NodeMotion<double>& q,
                    double normal_N) {
  const Load<double> load = losses.load(body, q);
  const ContactCouple<double> couple = losses.contact_couple(q);
  return load.t1 * q.w1 + load.t2 * q.w2 + load.t3 * q.w3 + load.d1 * q.v1 + load.d2 * q.v2 +
         load.d3 * q.v3 + normal_N * (couple.k1 * q.w1 + couple.k2 * q.w2 + couple.k3 * q.w3);
}

/// Of a body that slides as fast as its velocities say.
template <class System>
auto force_at(const System& system, const NodeMotion<double>& q) {
  return system.contact(q, slip_velocity(system.body, q)).force;
}

TEST(SmoothEquations, GiveTheReferenceForces) {
  const KnownMotion file("s05_smooth_disc");
  const Sliding<double, NoFriction> system{body_of(file.scene), {}, {}};
  for (Eigen::Index row = 0; row < file.table.values.rows(); ++row) {
    const auto q = system.motion(sliding_state(file, system.body, row));
    expect_forces(file, row, system, force_at(system, q), q);
  }
}

TEST(SlidingEquations, GiveTheReferenceForcesWithCouplesAndAir) {
  const KnownMotion file("s08_slide_disc");
  Sliding<double, Coulomb, LinearAir, RollingFriction, PivotingFriction> system;
  system.body = body_of(file.scene);
  const auto& model = file.scene.model;
  system.losses.c1 = (*model.air_linear_N_m_s)[0];
  system.losses.c2 = (*model.air_linear_N_m_s)[1];
  system.losses.c3 = (*model.air_linear_N_m_s)[2];
  system.losses.mu_r = *model.rolling_friction_m;
  system.losses.mu_p = *model.pivoting_friction_m;
  system.friction = {*model.friction, *model.slip_regularisation_m_s};
  for (Eigen::Index row = 0; row < file.table.values.rows(); ++row) {
    const auto q = system.motion(sliding_state(file, system.body, row));
    expect_forces(file, row, system, force_at(system, q), q);
    const auto u = slip_velocity(system.body, q);
    EXPECT_NEAR(std::hypot(u.along_n, u.along_mh), file.at(row, "slip"), kFileDigits);
  }
}

/// A system with the work done on it as one more state.
template <class System>
struct WithWork {
  using Scalar = double;
  static constexpr int kStates = System::kStates + 1;
  System system;
  void derivative(double t_s, const State<double, kStates>& y, State<double, kStates>& dy) const {
    State<double, System::kStates> inner, rate;
    for (int i = 0; i < System::kStates; ++i) inner[i] = y[i];
    system.derivative(t_s, inner, rate);
    for (int i = 0; i < System::kStates; ++i) dy[i] = rate[i];
    dy[System::kStates] = power_W(inner);
  }
  [[nodiscard]] double power_W(const State<double, System::kStates>& y) const {
    const auto q = system.motion(y);
    if constexpr (System::kStates == 8) {
      return loss_power_W(system.body, system.losses, q, system.acceleration(q).normal);
    } else {
      const auto force = force_at(system, q);
      const auto u = slip_velocity(system.body, q);
      return loss_power_W(system.body, system.losses, q, force.normal) + force.along_n * u.along_n +
             force.along_mh * u.along_mh;
    }
  }
};

template <class System>
void expect_power_balance(const System& system, const State<double, System::kStates>& start) {
  constexpr double kBalance = 1e-9, kEnd_s = 0.5;
  constexpr int n = System::kStates;
  State<double, n + 1> y;
  for (int i = 0; i < n; ++i) y[i] = start[i];
  y[n] = 0.0;
  DormandPrince<WithWork<System>> stepper({system}, uniform_control<n + 1>(1e-13));
  stepper.start(0.0, y);
  const double before = energy_J(system.body, system.motion(start));
  while (stepper.t_s() < kEnd_s) ASSERT_EQ(stepper.step(kEnd_s), StepEnd::accepted);
  State<double, n> end;
  for (int i = 0; i < n; ++i) end[i] = stepper.y()[i];
  const double after = energy_J(system.body, system.motion(end));
  EXPECT_LT(after, 0.95 * before) << "the losses must matter";
  EXPECT_NEAR((after - before) / before, stepper.y()[n] / before, kBalance);
}

/// Every loss at once, each strong enough to be seen.
template <class System>
void fill_losses(System& system) {
  auto& l = system.losses;
  static_cast<LinearAir<double>&>(l) = {2e-6, 2e-6, 5e-6};
  static_cast<QuadraticAir<double>&>(l) = {4e-8, 4e-8, 2e-8};
  l.c_v = 5e-3;
  l.eta = 1.8e-5;
  l.mu_r = 1e-4;
  l.mu_p = 3e-4;
  l.mu_c = 2e-4;
}

TEST(PowerBalance, HoldsForARollingBodyWithEveryLoss) {
  const KnownMotion file("s06_roll_disc");
  Rolling<double, LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction, PivotingFriction,
          ContourFriction>
      system;
  system.body = body_of(file.scene);
  fill_losses(system);
  expect_power_balance(system, state_of<8>(file, 0));
}

TEST(PowerBalance, HoldsForASlidingBodyWithEveryLoss) {
  const KnownMotion file("s08_slide_disc");
  Sliding<double, Coulomb, LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction,
          PivotingFriction, ContourFriction>
      system;
  system.body = body_of(file.scene);
  fill_losses(system);
  system.friction = {0.3, 1e-3};
  expect_power_balance(system, sliding_state(file, system.body, 0));
}

TEST(CentralInertia, IsThatOfTheShapeUnlessGiven) {
  data::Body ring;
  ring.kind = data::BodyKind::ring;
  ring.radius_m = 0.03;
  ring.inner_radius_m = 0.027;
  ring.thickness_m = 0.008;
  ring.mass_kg = 0.03373693518837008;
  // The reference case's own moments of this ring, to the digits given.
  constexpr double kDigits = 1e-14;
  EXPECT_NEAR(central_inertia(ring).transverse_kg_m2, 1.3919297176468351e-05, 1e-5 * kDigits);
  EXPECT_NEAR(central_inertia(ring).axial_kg_m2, 2.7478733710927426e-05, 1e-5 * kDigits);
  ring.I_kg_m2 = 2e-5;
  EXPECT_EQ(central_inertia(ring).transverse_kg_m2, 2e-5);
  ring.mass_kg.reset();
  EXPECT_THROW((void)central_inertia(ring), InputError);
  ring.I_kg_m2.reset();
  EXPECT_FALSE(central_inertia(ring).mass_known);
  EXPECT_NEAR(central_inertia(ring).axial_kg_m2, 0.5 * (9e-4 + 7.29e-4), 1e-4 * kDigits);
  ring.radius_m = -1.0;
  EXPECT_THROW((void)central_inertia(ring), InputError);
}

}  // namespace
}  // namespace trochoid::model
