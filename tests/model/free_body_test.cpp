#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "trochoid/data/table.hpp"
#include "trochoid/model/simulate.hpp"

// Closed forms of the torque-free body; equation numbers of model/theory/torque_free.md.
namespace trochoid::model {
namespace {

constexpr double kTolerance = 1e-13;
// Some hundred steps, each within the tolerance, and angles of up to some tens of radians.
constexpr double kAllowed = 1e-10;

data::Table run(data::Scene scene, double until_s, double rows) {
  scene.run.until_s = until_s;
  scene.run.rate_hz = rows / until_s;
  scene.run.tolerance = kTolerance;
  const Trajectory trajectory = simulate(scene);
  EXPECT_EQ(trajectory.outcome, Outcome::reached_end);
  return {.header = {}, .columns = trajectory.columns, .values = trajectory.values};
}

/// A body with two equal moments, its angular momentum along the vertical.
data::Scene regular_precession(double A, double C, double theta, double momentum) {
  data::Scene scene;
  scene.model.name = "free";
  scene.start.moments_kg_m2 = Eigen::Vector3d(A, A, C);
  scene.start.theta_rad = theta;
  scene.start.phi_rad = 0.3;
  scene.start.psi_rad = -0.2;
  scene.start.dphi_rad_s = momentum / A;
  scene.start.w3_rad_s = momentum * std::cos(theta) / C;
  return scene;
}

// (6) and (7), for a flat and a slender body.
TEST(SymmetricFreeBody, PrecessesUniformlyAboutItsAngularMomentum) {
  for (const auto& [A, C] : {std::pair{1.0, 1.6}, {1.0, 0.3}}) {
    const double theta = 0.7, L = 5.0;
    const data::Table free = run(regular_precession(A, C, theta, L), 4.0, 200.0);
    const double wz = L * std::cos(theta) / C, turning = wz * (C - A) / A;
    const Eigen::ArrayXd t = free.column("t_s").array();
    const Eigen::ArrayXd phi = 0.3 + L / A * t, psi = -0.2 + wz * (1.0 - C / A) * t;
    EXPECT_LT((free.column("theta_rad").array() - theta).abs().maxCoeff(), kAllowed);
    EXPECT_LT((free.column("phi_rad").array() - phi).abs().maxCoeff(), kAllowed);
    EXPECT_LT((free.column("psi_rad").array() - psi).abs().maxCoeff(), kAllowed);
    const double across = L * std::sin(theta) / A;
    const Eigen::ArrayXd wx = across * (-0.2 - turning * t).sin();
    EXPECT_LT((free.column("wx_rad_s").array() - wx).abs().maxCoeff(), kAllowed);
  }
}

// (8): with L^2 > 2 T I2 the components about the axes of I1, I2, I3 are a1 cn, a2 sn, a3 dn of one
// argument that grows at the rate p; the amplitude of the argument is atan2(w2/a2, w1/a1).
TEST(FreeBody, FollowsJacobisFunctions) {
  const double I1 = 0.9, I2 = 1.5, I3 = 2.1;
  const Eigen::Vector3d w(0.8, 1.1, 1.3);
  data::Scene scene;
  scene.model.name = "free";
  scene.start.theta_rad = 0.8;
  scene.start.moments_kg_m2 = Eigen::Vector3d(I1, I2, I3);
  scene.start.w_body_rad_s = w;
  const Eigen::Vector3d moments(I1, I2, I3);
  const double energy2 = moments.dot(w.cwiseAbs2());
  const double momentum2 = moments.cwiseProduct(w).squaredNorm();
  ASSERT_GT(momentum2, energy2 * I2);
  const double spread = (I3 - I2) * (momentum2 - energy2 * I1);
  const double modulus = std::sqrt((I2 - I1) * (energy2 * I3 - momentum2) / spread);
  const double p = std::sqrt(spread / (I1 * I2 * I3));
  const double a1 = std::sqrt((energy2 * I3 - momentum2) / (I1 * (I3 - I1)));
  const double a2 = std::sqrt((energy2 * I3 - momentum2) / (I2 * (I3 - I2)));
  const double period_s = 4.0 * std::comp_ellint_1(modulus) / p;
  const data::Table free = run(scene, 2.0 * period_s, 400.0);
  const Eigen::VectorXd t = free.column("t_s"), w1 = free.column("wx_rad_s"),
                        w2 = free.column("wy_rad_s");
  const double sense = free.column("wz_rad_s")[0] > 0.0 ? 1.0 : -1.0;
  // dw1 = g w2 w3 with g = (I2 - I3)/I1 < 0: w1 falls while w2 w3 > 0, as cn does while sn > 0.
  double amplitude = std::atan2(sense * w2[0] / a2, w1[0] / a1);
  const double first = std::ellint_1(modulus, amplitude);
  for (Eigen::Index n = 1; n < t.size(); ++n) {
    const double raw = std::atan2(sense * w2[n] / a2, w1[n] / a1);
    amplitude += std::remainder(raw - amplitude, 2.0 * M_PI);
    EXPECT_NEAR(std::ellint_1(modulus, amplitude), first + p * t[n], kAllowed) << t[n];
  }
}

// Without weight the top is the symmetric body of the same moments turning about its pivot.
TEST(SymmetricFreeBody, IsTheTopWithoutGravity) {
  const double I = 1.2, Is = 0.5, theta = 0.9, L = 3.0;
  data::Scene scene = regular_precession(I, Is, theta, L);
  const data::Table free = run(scene, 5.0, 100.0);
  scene.model.name = "top";
  scene.model.gravity_m_s2 = 0.0;
  scene.body.emplace();
  scene.body->kind = data::BodyKind::top;
  scene.body->mass_kg = 0.4;
  scene.body->l_m = 0.1;
  scene.body->I_kg_m2 = I;
  scene.body->Is_kg_m2 = Is;
  const data::Table top = run(scene, 5.0, 100.0);
  for (const char* column : {"theta_rad", "phi_rad", "psi_rad", "dphi_rad_s", "energy_J"})
    EXPECT_LT((top.column(column) - free.column(column)).cwiseAbs().maxCoeff(), kAllowed) << column;
}

}  // namespace
}  // namespace trochoid::model
