#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <string>

#include "problem/prepare.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {
namespace {

constexpr double kSoft_m_s = 1e-3;

/// A disc that rolls and slips later, made by other equations (tests/independent), near what fits.
class ABodyThatRollsAtFirst : public testing::Test {
 protected:
  ABodyThatRollsAtFirst() {
    const std::string folder = TROCHOID_SOURCE_DIR "/tests/independent/cases/slides_later";
    track_ = data::read_track(folder + "/track.csv").tracks.front();
    scene_ = data::read_scene(folder + "/scene.toml");
    scene_.model.name = "sliding";
    scene_.model.friction = 0.331;
    scene_.model.rolling_friction_m = 1.27e-4;
    scene_.model.contour_friction_m = 1.86e-5;
    options_.rolls_at_first = true;
    options_.start = {{"theta_rad", 1.279}, {"phi_rad", -2.961}, {"w1_rad_s", -0.959},
                      {"w2_rad_s", -2.549}, {"w3_rad_s", 5.130}, {"x_m", -0.0212},
                      {"y_m", -0.0976}};
  }
  [[nodiscard]] Problem problem() {
    predictor_ = model::make_predictor(scene_);
    return prepare(std::span(&track_, 1), *predictor_, scene_, options_);
  }

  data::Track track_;
  data::Scene scene_;
  FitOptions options_;
  std::unique_ptr<model::Predictor> predictor_;
};

/// Largest difference between a column of the Jacobian and its central difference, of its size.
double worst_column(Problem problem) {
  constexpr double kStep = 1e-6;
  problem.tolerance = 1e-11;
  const Eigen::VectorXd u = problem.start();
  Eigen::VectorXd residuals, ahead, behind;
  Eigen::MatrixXd jacobian;
  EXPECT_TRUE(evaluate(problem, 0, u, residuals, &jacobian, true));
  double worst = 0.0;
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const double step = kStep * std::max(1.0, std::abs(u[i]));
    Eigen::VectorXd more = u, less = u;
    more[i] += step, less[i] -= step;
    EXPECT_TRUE(evaluate(problem, 0, more, ahead, nullptr, true));
    EXPECT_TRUE(evaluate(problem, 0, less, behind, nullptr, true));
    const Eigen::VectorXd difference = (ahead - behind) / (2.0 * step);
    worst = std::max(worst, (difference - jacobian.col(i)).norm() / difference.norm());
  }
  return worst;
}

// What a step of 1e-6 leaves of differences of an integration to 1e-11.
constexpr double kTolerance = 1e-3;

TEST_F(ABodyThatRollsAtFirst, HasNoVelocityOfItsOwnAndDerivativesThatHoldIt) {
  const Problem tied = problem();
  EXPECT_TRUE(tied.rolls_at_first);
  EXPECT_LT(worst_column(tied), kTolerance);
}

TEST_F(ABodyThatRollsAtFirst, HasNoneEitherWhereItCreepsAsFrictionSetsInSoftly) {
  scene_.model.slip_regularisation_m_s = kSoft_m_s;
  scene_.fit.free.emplace_back("slip_regularisation_m_s");
  const Problem tied = problem();
  EXPECT_TRUE(tied.rolls_at_first);
  EXPECT_LT(worst_column(tied), kTolerance);
}

TEST_F(ABodyThatRollsAtFirst, HasTheOneThatTheSceneSpeaksOf) {
  const data::FitSettings silent = scene_.fit;
  scene_.fit.prior["vx_m_s"] = {0.1, 0.01};
  EXPECT_FALSE(problem().rolls_at_first) << "prior";
  scene_.fit = silent;
  scene_.fit.bounds["vy_m_s"] = {-1.0, 1.0};
  EXPECT_FALSE(problem().rolls_at_first) << "bounds";
  scene_.fit = silent;
  scene_.fit.fixed["vy_m_s"] = 0.0;
  EXPECT_FALSE(problem().rolls_at_first) << "fixed";
}

}  // namespace
}  // namespace trochoid::fitting
