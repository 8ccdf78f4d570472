#include "observe/consensus.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>

#include "observe/observations.hpp"

namespace trochoid::fitting {
namespace {

struct Walk {
  std::vector<double> t_s, sigma_m;
  Eigen::MatrixX2d xy_m;
  std::set<int> wrong;
};

// A body going round on a path that drifts, seen with noise.
Walk walk(int samples, std::uint64_t seed) {
  constexpr double kSigma_m = 3e-4;
  Walk walk;
  walk.xy_m.resize(samples, 2);
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> noise(0.0, kSigma_m);
  for (int i = 0; i < samples; ++i) {
    const double t = i / 120.0;
    walk.t_s.push_back(t);
    walk.sigma_m.push_back(kSigma_m);
    walk.xy_m(i, 0) = 0.03 * std::cos(9.0 * t) + 0.05 * t + noise(generator);
    walk.xy_m(i, 1) = 0.03 * std::sin(9.0 * t) - 0.02 * t * t + noise(generator);
  }
  return walk;
}

// Runs of `length` samples moved by 8 to 50 mm each, until a share of all is wrong.
void go_wrong(Walk& walk, double share, int length, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  const int n = static_cast<int>(walk.t_s.size());
  std::uniform_int_distribution<int> anywhere(0, n - length);
  std::uniform_real_distribution<double> far_m(8e-3, 50e-3), way_rad(0.0, 2.0 * M_PI);
  while (static_cast<double>(walk.wrong.size()) < share * n) {
    const int first = anywhere(generator);
    const double distance_m = far_m(generator), angle_rad = way_rad(generator);
    for (int i = first; i < first + length; ++i)
      if (walk.wrong.insert(i).second)
        walk.xy_m.row(i) +=
            distance_m * Eigen::RowVector2d(std::cos(angle_rad), std::sin(angle_rad));
  }
}

TEST(Consensus, KeepsEverySampleOfANoisyPath) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Walk clean = walk(400, seed);
    EXPECT_EQ(consistent_path(clean.t_s, clean.xy_m, clean.sigma_m).size(), 400U) << seed;
  }
}

// Lies still for `rest` samples; struck, it turns nine times a second.
Walk struck(int rest, int samples) {
  constexpr double kSigma_m = 2e-5;
  Walk path = walk(samples, 3);
  std::mt19937_64 generator(4);
  std::normal_distribution<double> noise(0.0, kSigma_m);
  for (int i = 0; i < samples; ++i) {
    const double t = i < rest ? 0.0 : (i - rest) / 120.0;
    path.sigma_m[static_cast<std::size_t>(i)] = kSigma_m;
    path.xy_m(i, 0) = 0.03 * std::cos(56.0 * t) + 1.2 * t + noise(generator);
    path.xy_m(i, 1) = 0.03 * std::sin(56.0 * t) + noise(generator);
  }
  return path;
}

TEST(Consensus, ARestThatEndsIsNotTakenForAllThereIs) {
  // A short one, and one of ten seconds: how jerky the motion is shows at its end only.
  for (const auto& [rest, samples] : {std::pair{200, 500}, {1200, 1500}}) {
    const Walk path = struck(rest, samples);
    const std::vector<int> kept = consistent_path(path.t_s, path.xy_m, path.sigma_m);
    const auto moving =
        std::count_if(kept.begin(), kept.end(), [first = rest](int i) { return i >= first; });
    EXPECT_GT(moving, (samples - rest) * 9 / 10) << rest << " samples at rest";
  }
}

// Thrown, a body slides to a stop within few frames and wobbles on the spot from then on, slowly:
// by how evenly it does, all that was before looks torn.
Walk thrown(int sliding, int samples) {
  constexpr double kSigma_m = 8e-6, kFrame_s = 0.005, kThrown_m_s = 0.16, kWobble_m = 3e-4;
  Walk path = walk(samples, 5);
  std::mt19937_64 generator(6);
  std::normal_distribution<double> noise(0.0, kSigma_m);
  double x_m = 0.0;
  for (int i = 0; i < samples; ++i) {
    const double left = std::max(0.0, 1.0 - static_cast<double>(i) / sliding);
    const double since_s = kFrame_s * std::max(0, i - sliding);
    path.t_s[static_cast<std::size_t>(i)] = kFrame_s * i;
    path.sigma_m[static_cast<std::size_t>(i)] = kSigma_m;
    path.xy_m(i, 0) = x_m + kWobble_m * std::sin(20.0 * since_s) + noise(generator);
    path.xy_m(i, 1) = 0.8 * x_m + kWobble_m * std::cos(20.0 * since_s) + noise(generator);
    x_m += kFrame_s * kThrown_m_s * std::sqrt(left);
  }
  return path;
}

TEST(Consensus, ABriefSlideBeforeALongWobbleIsMotion) {
  constexpr int kSliding = 14, kSamples = 95;
  const Walk path = thrown(kSliding, kSamples);
  EXPECT_EQ(consistent_path(path.t_s, path.xy_m, path.sigma_m).size(), std::size_t{kSamples});
}

// As many, but elsewhere: the way back is a leap.
TEST(Consensus, AsManyWrongPlacesBeforeItAreNone) {
  constexpr int kWrong = 14, kSamples = 95;
  Walk path = thrown(kWrong, kSamples);
  path.xy_m.topRows(kWrong).col(1).array() -= 0.02;
  const std::vector<int> kept = consistent_path(path.t_s, path.xy_m, path.sigma_m);
  ASSERT_FALSE(kept.empty());
  EXPECT_GE(kept.front(), kWrong);
}

// Here and there, without any way, after a smooth path.
TEST(Consensus, PlacesScatteredAtAnEndAreWrong) {
  constexpr int kSamples = 300;
  for (const int wrong : {6, 10, 15, 20})
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      Walk path = walk(kSamples, seed);
      std::mt19937_64 generator(seed);
      std::uniform_real_distribution<double> anywhere_m(-0.1, 0.1);
      for (int i = kSamples - wrong; i < kSamples; ++i)
        path.xy_m.row(i) += Eigen::RowVector2d{anywhere_m(generator), anywhere_m(generator)};
      const std::vector<int> kept = consistent_path(path.t_s, path.xy_m, path.sigma_m);
      const auto wrongly =
          std::count_if(kept.begin(), kept.end(), [&](int i) { return i >= kSamples - wrong; });
      EXPECT_LT(2 * wrongly, wrong) << wrong << " scattered, seed " << seed;
    }
}

// No chain leads from one side of a cut to the other, but both have wrong places.
TEST(Consensus, DoubtsWrongPlacesOnBothSidesOfACut) {
  constexpr int kCut = 200, kSamples = 500;
  Walk path = walk(kSamples, 4);
  path.xy_m.bottomRows(kSamples - kCut).col(0).array() += 100.0;
  for (const int wrong : {60, 130, 300, 420})
    path.xy_m.row(wrong) += Eigen::RowVector2d(0.02, 0.01);
  const std::vector<int> kept = consistent_path(path.t_s, path.xy_m, path.sigma_m);
  for (const int wrong : {60, 130, 300, 420})
    EXPECT_FALSE(std::count(kept.begin(), kept.end(), wrong)) << wrong;
  EXPECT_GE(kept.size(), kSamples - 12U);
}

// An azimuth half a turn off, also where there are neighbours on one side only.
TEST(Consensus, DoubtsAnglesAtTheEndsOfARecordToo) {
  constexpr int kSamples = 60;
  const Walk path = walk(kSamples, 5);
  for (const int wrong : {0, 1, 30, kSamples - 2, kSamples - 1}) {
    data::Track track;
    for (int i = 0; i < kSamples; ++i) {
      data::TrackSample sample;
      sample.t_s = path.t_s[i];
      sample.centre_m = path.xy_m.row(i).transpose();
      sample.covariance_m2 = Eigen::Matrix2d::Identity() * path.sigma_m[i] * path.sigma_m[i];
      const double noise_rad = 0.02 * (i % 3 - 1) + 0.01 * (i % 7 - 3);
      sample.theta = data::MeasuredAngle{0.8 + noise_rad, 0.02};
      sample.phi =
          data::MeasuredAngle{0.4 * i + noise_rad + (i == wrong ? std::numbers::pi : 0.0), 0.02};
      track.samples.push_back(sample);
    }
    const std::vector<int> kept =
        consistent_samples(make_arc(track, 0, kSamples, {true, true, true, false}, true));
    EXPECT_FALSE(std::count(kept.begin(), kept.end(), wrong)) << wrong;
    EXPECT_GE(kept.size(), kSamples - 4U) << wrong;
  }
}

TEST(Consensus, OneWrongPlaceCostsNoOther) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Walk path = walk(400, seed);
    path.xy_m.row(200) += Eigen::RowVector2d(0.02, 0.01);
    const std::vector<int> kept = consistent_path(path.t_s, path.xy_m, path.sigma_m);
    EXPECT_FALSE(std::count(kept.begin(), kept.end(), 200)) << seed;
    EXPECT_GE(kept.size(), 397U) << seed;
  }
}

// A run that happens to lie on the way may be taken for part of it, and right samples beside a
// wrong one go with it: together two in a hundred.
TEST(Consensus, LeavesOutWrongPlacesSingleOnesAndRunsOfThem) {
  constexpr int kSamples = 400, kSeeds = 5;
  constexpr double kMistaken = 0.02 * kSamples * kSeeds;
  for (const int length : {1, 4, 10})
    for (const double share : {0.05, 0.15, 0.25}) {
      std::size_t wrong_kept = 0, right_lost = 0;
      for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
        Walk path = walk(kSamples, seed);
        go_wrong(path, share, length, seed);
        const std::vector<int> kept = consistent_path(path.t_s, path.xy_m, path.sigma_m);
        const auto wrong = static_cast<std::size_t>(
            std::count_if(kept.begin(), kept.end(), [&](int i) { return path.wrong.contains(i); }));
        wrong_kept += wrong;
        right_lost += kSamples - path.wrong.size() - (kept.size() - wrong);
      }
      EXPECT_LE(static_cast<double>(wrong_kept + right_lost), kMistaken)
          << length << " in a row, share " << share << ": " << wrong_kept << " wrong kept, "
          << right_lost << " right lost";
    }
}

TEST(Consensus, NeedsNoTrueNoiseToBeStated) {
  Walk path = walk(400, 3);
  go_wrong(path, 0.15, 4, 3);
  const std::vector<int> kept = consistent_path(path.t_s, path.xy_m, path.sigma_m);
  for (double& sigma : path.sigma_m) sigma *= 0.05;
  EXPECT_EQ(consistent_path(path.t_s, path.xy_m, path.sigma_m), kept);
}

}  // namespace
}  // namespace trochoid::fitting
