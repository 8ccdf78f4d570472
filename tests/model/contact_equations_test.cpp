#include <gtest/gtest.h>

#include <cmath>
#include <string>

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

struct Reference {
  data::Scene scene;
  data::Table table;
  explicit Reference(const std::string& name)
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
State<double, N> state_of(const Reference& file, Eigen::Index row) {
  static constexpr const char* kNames[] = {"phi", "theta", "psi", "w1", "w2", "w3", "x", "y"};
  State<double, N> y;
  for (int i = 0; i < 8; ++i) y[i] = file.at(row, kNames[i]);
  return y;
}

/// State of a sliding body: the files give the velocity of the centre.
State<double, 10> sliding_state(const Reference& file, const RimBody& body, Eigen::Index row) {
  auto y = state_of<10>(file, row);
  const World<double> v{file.at(row, "vx"), file.at(row, "vy")};
  const auto node = node_from_world(v, y[Rim::phi]);
  y[Rim::un] = node.along_n + body.R * y[Rim::w3] - body.signed_h() * y[Rim::w2];
  y[Rim::ut] = node.along_mh + tilt(body, y[Rim::theta]).z * y[Rim::w1];
  return y;
}

template <class System>
void expect_forces(const Reference& file, Eigen::Index row, const System& system,
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
void check_rolling(const Reference& file, const System& system) {
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
    EXPECT_NEAR(dy[Rim::phi], file.at(row, "dphi"), 1e-10);
    EXPECT_NEAR(dy[Rim::psi], file.at(row, "dpsi"), 1e-10);
  }
}

TEST(RollingEquations, GiveTheReferenceForcesOfADisc) {
  const Reference file("s06_roll_disc");
  check_rolling(file, Rolling<double>{body_of(file.scene), {}});
}

TEST(RollingEquations, GiveTheReferenceForcesOfAThinHoop) {
  const Reference file("s07_roll_hoop_thin");
  check_rolling(file, Rolling<double>{body_of(file.scene), {}});
}

TEST(RollingEquations, GiveTheReferenceForcesOfARingInAir) {
  const Reference file("s09_ring_retrograde_drag");
  Rolling<double, LinearAir> system{body_of(file.scene), {}};
  const auto& c = *file.scene.model.air_linear_N_m_s;
  system.losses.c1 = c[0];
  system.losses.c2 = c[1];
  system.losses.c3 = c[2];
  check_rolling(file, system);
}

TEST(SmoothEquations, GiveTheReferenceForces) {
  const Reference file("s05_smooth_disc");
  const Sliding<double, NoFriction> system{body_of(file.scene), {}, {}};
  for (Eigen::Index row = 0; row < file.table.values.rows(); ++row) {
    const auto q = system.motion(sliding_state(file, system.body, row));
    expect_forces(file, row, system, system.contact_force(q), q);
  }
}

TEST(SlidingEquations, GiveTheReferenceForcesWithCouplesAndAir) {
  const Reference file("s08_slide_disc");
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
    expect_forces(file, row, system, system.contact_force(q), q);
    const auto u = slip_velocity(system.body, q);
    EXPECT_NEAR(std::hypot(u.along_n, u.along_mh), file.at(row, "slip"), kFileDigits);
  }
}

}  // namespace
}  // namespace trochoid::model
