#include "edges/shading_prior.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>
#include <vector>

namespace trochoid::tracking {
namespace {

constexpr int kLooks = 300;
constexpr double kInformation = 40.0;  // of one look on each kind of shading

struct Drawn {
  std::vector<ShadingEvidence> looks;
  std::vector<Shading> truth;
};

// Looks at one curve whose shading is drawn with this standard deviation, of its most.
Drawn looks_beside(double shading_sd, unsigned seed, double of_look = kInformation) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Drawn drawn;
  for (int i = 0; i < kLooks; ++i) {
    // Slopes and bends go together, as they do in profiles a few pixels long.
    ShadingMatrix information = ShadingMatrix::Identity();
    information(0, 2) = information(2, 0) = information(1, 3) = information(3, 1) = 0.7;
    information *= of_look;
    Shading truth, noise;
    for (int k = 0; k < kShading; ++k) truth[k] = shading_sd * normal(random);
    for (int k = 0; k < kShading; ++k) noise[k] = normal(random);
    const ShadingMatrix root = information.llt().matrixL();
    drawn.looks.push_back({true, information, information * truth + root * noise, 0});
    drawn.truth.push_back(truth);
  }
  return drawn;
}

// Mean over the looks and the slopes and bends; the strip is never assumed to be small.
template <class Of>
double mean_over(const Drawn& drawn, const std::vector<ShadingEstimate>& estimates, const Of& of) {
  double sum = 0.0;
  for (size_t i = 0; i < estimates.size(); ++i)
    for (int k = 0; k + 1 < kShading; ++k) sum += of(estimates[i], drawn.truth[i], k);
  return sum / static_cast<double>((kShading - 1) * estimates.size());
}

double mean_variance(const Drawn& drawn, const std::vector<ShadingEstimate>& estimates) {
  return mean_over(drawn, estimates, [](const ShadingEstimate& e, const Shading& /*truth*/, int k) {
    return e.covariance(k, k);
  });
}

TEST(ShadingPrior, OnPlainSurfacesFreeShadingCostsLittle) {
  const Drawn drawn = looks_beside(0.0, 1);
  const double free = mean_variance(drawn, shadings_given(drawn.looks, 1.0));
  const double learnt = mean_variance(drawn, estimate_shadings(drawn.looks, {}));
  EXPECT_LT(learnt, 0.6 * free);
  const double square = mean_over(drawn, estimate_shadings(drawn.looks, {}),
                                  [](const ShadingEstimate& e, const Shading& /*truth*/, int k) {
                                    return e.shading[k] * e.shading[k];
                                  });
  // What is found of shading that is not there is a fraction of what single looks would find.
  EXPECT_LT(square, 0.35 * free);
}

constexpr double kClear = 400.0;  // information of one look at a picture with little noise

TEST(ShadingPrior, ACurveThatShowsNoShadingAnywhereIsTakenAsPlain) {
  const Drawn drawn = looks_beside(0.0, 6, kClear);
  const double free = mean_variance(drawn, shadings_given(drawn.looks, 1.0));
  EXPECT_LT(mean_variance(drawn, estimate_shadings(drawn.looks, {})), 0.3 * free);
}

TEST(ShadingPrior, WhereAPartOfACurveIsShadedNoneOfItIsTakenAsPlain) {
  Drawn drawn = looks_beside(0.0, 7, kClear);
  const Drawn shaded = looks_beside(0.8, 8, kClear);
  for (size_t i = 0; i < kLooks / 6; ++i) drawn.looks[i] = shaded.looks[i];
  const double free = shadings_given(drawn.looks, 1.0)[2 * kLooks / 3].covariance(0, 0);
  EXPECT_GT(estimate_shadings(drawn.looks, {})[2 * kLooks / 3].covariance(0, 0), 0.8 * free);
}

TEST(ShadingPrior, BesideShadowsShadingIsAsFreeAsItIsLarge) {
  const Drawn drawn = looks_beside(0.8, 2);
  const std::vector<ShadingEstimate> estimates = estimate_shadings(drawn.looks, {});
  const double free = mean_variance(drawn, shadings_given(drawn.looks, 1.0));
  EXPECT_GT(mean_variance(drawn, estimates), 0.85 * free);
  const double normalised =
      mean_over(drawn, estimates, [](const ShadingEstimate& e, const Shading& truth, int k) {
        return (e.shading[k] - truth[k]) * (e.shading[k] - truth[k]) / e.covariance(k, k);
      });
  constexpr double kTolerance = 0.2;  // 1200 values, the variances themselves from 70 looks
  EXPECT_NEAR(normalised, 1.0, kTolerance);
}

TEST(ShadingPrior, AShadowBesideOneSideLeavesTheOtherPlain) {
  Drawn plain = looks_beside(0.0, 3);
  const Drawn shaded = looks_beside(0.8, 4);
  for (size_t i = 0; i < kLooks / 3; ++i) plain.looks[i] = shaded.looks[i];
  const std::vector<ShadingEstimate> estimates = estimate_shadings(plain.looks, {});
  const auto variance = [&](size_t i) { return estimates[i].covariance(0, 0); };
  EXPECT_GT(variance(kLooks / 6), 1.3 * variance(2 * kLooks / 3));
}

TEST(ShadingPrior, UnusableLooksAreLeftAlone) {
  Drawn drawn = looks_beside(0.5, 5);
  drawn.looks[7].usable = false;
  drawn.looks[7].right.setConstant(1e6);
  const std::vector<ShadingEstimate> estimates = estimate_shadings(drawn.looks, {});
  EXPECT_EQ(estimates[7].shading, Shading(Shading::Zero()));
  EXPECT_LT(estimates[8].shading.norm(), 10.0);
}

}  // namespace
}  // namespace trochoid::tracking
