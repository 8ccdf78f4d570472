#include "trochoid/tracking/outline_fit.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <map>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

#include "drawn_clip.hpp"
#include "edges/edge_stretch.hpp"
#include "pose/arrow_system.hpp"

namespace trochoid::tracking {
namespace {

// A profile of a step at `offset` blurred by a Gaussian, with slopes outside and a dark strip.
StretchProfile profile_of(double offset_px, double blur_px, double outer_slope, double strip_px,
                          double noise, std::mt19937& random) {
  std::normal_distribution<double> normal(0.0, noise);
  StretchProfile p;
  constexpr double kReach_px = 4.0;
  constexpr double kSpacing_px = 0.8;
  p.profile.count = static_cast<int>(2.0 * kReach_px / kSpacing_px) + 1;
  p.profile.shared = 1.0;
  const auto beyond = [&](double s) {
    return 0.5 * std::erfc(-s / (blur_px * std::numbers::sqrt2));
  };
  for (int j = 0; j < p.profile.count; ++j) {
    p.profile.s_px[static_cast<size_t>(j)] = static_cast<float>(kSpacing_px * j - kReach_px);
    const double s = kSpacing_px * j - kReach_px - offset_px;
    double light = 30.0 + (70.0 + outer_slope * s) * beyond(s);
    if (strip_px > 0.0) light -= 15.0 * (beyond(s + strip_px) - beyond(s));
    p.profile.light[static_cast<size_t>(j)] = static_cast<float>(light + normal(random));
    p.profile.background[static_cast<size_t>(j)] = 0.0f;
  }
  p.blur_px = blur_px;
  p.strip_px = strip_px;
  return p;
}

double mean_offset_px(std::vector<StretchProfile>& profiles) {
  double sum = 0.0;
  for (const StretchProfile& p : profiles) sum += p.found ? p.edge.offset_px : 1e3;
  return sum / static_cast<double>(profiles.size());
}

constexpr int kProfiles = 60;

// A soft shadow beside an edge is a slope of the outer level: it must not pull the edge. A linear
// estimate falls short of an offset of a seventh of the blur by a fifth of it.
TEST(EdgeStretch, ASlopeBesideTheEdgeDoesNotPullIt) {
  std::mt19937 random(1);
  std::vector<StretchProfile> profiles;
  for (int i = 0; i < kProfiles; ++i)
    profiles.push_back(profile_of(0.1, 0.7, 6.0, 0.0, 0.5, random));
  fit_stretches(profiles);
  constexpr double kTolerance_px = 0.03;
  EXPECT_NEAR(mean_offset_px(profiles), 0.1, kTolerance_px);
}

// During the exposure a body goes six pixels, and its shadow with it: what is seen is the mean of
// many pictures in which the slope begins at the edge.
StretchProfile swept_profile(std::mt19937& random) {
  constexpr double kSweep_px = 6.0, kContrast = 70.0, kSlope = 1.5, kSharp_px = 0.7,
                   kReach_px = 9.0;
  constexpr int kMoments = 240;
  std::normal_distribution<double> normal(0.0, 0.5);
  StretchProfile p;
  p.profile.count = static_cast<int>(2.0 * kReach_px) + 1;
  p.profile.shared = 1.0;
  for (int j = 0; j < p.profile.count; ++j) {
    const double s = j - kReach_px;
    double light = 30.0;
    for (int m = 0; m < kMoments; ++m) {
      const double from_edge = s - kSweep_px * ((m + 0.5) / kMoments - 0.5);
      light += (kContrast + kSlope * from_edge) / kMoments * 0.5 *
               std::erfc(-from_edge / (kSharp_px * std::numbers::sqrt2));
    }
    p.profile.s_px[static_cast<size_t>(j)] = static_cast<float>(s);
    p.profile.light[static_cast<size_t>(j)] = static_cast<float>(light + normal(random));
    p.profile.background[static_cast<size_t>(j)] = 0.0f;
  }
  p.steps = StretchProfile::kMostSteps;
  for (int k = 0; k < p.steps; ++k)
    p.step_at_px[static_cast<size_t>(k)] =
        static_cast<float>(kSweep_px * ((k + 0.5) / p.steps - 0.5));
  p.sharp_px = kSharp_px;
  return p;
}

TEST(EdgeStretch, AShadowThatGoesAlongWithAFastEdgeDoesNotPullIt) {
  std::mt19937 random(7);
  constexpr int kFrames = 12;
  ShadingMemory known;
  double mean_px = 0.0;
  for (int k = 0; k < 2 * kFrames; ++k) {
    std::vector<StretchProfile> profiles;
    for (int i = 0; i < kProfiles; ++i) profiles.push_back(swept_profile(random));
    const StretchFit fit = fit_stretches(profiles, known);
    if (k < kFrames)
      for (const ShadingEvidence& look : fit.shading) known.add(look);
    else
      mean_px += mean_offset_px(profiles) / kFrames;
  }
  // Taken for a slope that stays where it is, it pulls by 0.06 px and more (6^2 x 1.5 / 12 / 70).
  constexpr double kTolerance_px = 0.02;
  EXPECT_NEAR(mean_px, 0.0, kTolerance_px);
}

// In one noisy frame a slope is taken for noise in part, and what is left of it pulls the edge; a
// dozen frames know the slope.
TEST(EdgeStretch, WhatOtherFramesShowOfTheLightTakesThePullOfASlopeAway) {
  std::mt19937 random(5);
  const auto frame = [&random] {
    std::vector<StretchProfile> profiles;
    for (int i = 0; i < kProfiles; ++i) {
      profiles.push_back(profile_of(0.0, 0.7, 3.0, 0.0, 6.0, random));
      profiles.back().direction_rad = 0.02 * i;
    }
    return profiles;
  };
  constexpr int kFrames = 12;
  ShadingMemory known;
  for (int k = 0; k < kFrames; ++k) {
    auto profiles = frame();
    for (const ShadingEvidence& look : fit_stretches(profiles).shading) known.add(look);
  }
  double alone_px = 0.0, helped_px = 0.0;
  for (int k = 0; k < kFrames; ++k) {
    auto profiles = frame();
    fit_stretches(profiles);
    alone_px += mean_offset_px(profiles) / kFrames;
    fit_stretches(profiles, known);
    helped_px += mean_offset_px(profiles) / kFrames;
  }
  EXPECT_GT(std::abs(alone_px), 0.03);
  EXPECT_LT(std::abs(helped_px), 0.5 * std::abs(alone_px));
}

// A wall two pixels wide between face and floor.
TEST(EdgeStretch, ANarrowStripIsNotTheEdge) {
  std::mt19937 random(2);
  std::vector<StretchProfile> profiles;
  for (int i = 0; i < kProfiles; ++i)
    profiles.push_back(profile_of(0.1, 0.7, 0.0, 2.0, 0.5, random));
  fit_stretches(profiles);
  constexpr double kTolerance_px = 0.03;
  EXPECT_NEAR(mean_offset_px(profiles), 0.1, kTolerance_px);
}

// A face in the light, a wall in the shade and a floor in the shadow: between the two dark ones
// there is next to no contrast, and what tells where both edges are is the wall's inner one.
TEST(EdgeStretch, AWallInTheShadeIsSeenByWhereItBegins) {
  constexpr double kFace = 85.0, kWall = 19.0, kFloor = 8.0, kWall_px = 1.9, kBlur_px = 0.6;
  std::mt19937 random(23);
  std::normal_distribution<double> noise(0.0, 0.7);
  const auto beyond = [](double s) {
    return 0.5 * std::erfc(-s / (kBlur_px * std::numbers::sqrt2));
  };
  for (const double offset_px : {-0.2, 0.0, 0.2}) {
    std::vector<StretchProfile> profiles;
    for (int i = 0; i < kProfiles; ++i) {
      profiles.push_back(profile_of(0.0, kBlur_px, 0.0, kWall_px, 0.0, random));
      Profile& p = profiles.back().profile;
      for (size_t j = 0; j < static_cast<size_t>(p.count); ++j) {
        const double s = static_cast<double>(p.s_px[j]) - offset_px;
        p.light[j] = static_cast<float>(kFace + (kWall - kFace) * beyond(s + kWall_px) +
                                        (kFloor - kWall) * beyond(s) + noise(random));
      }
    }
    fit_stretches(profiles);
    constexpr double kTolerance_px = 0.04;  // a fifth of how far it is off
    EXPECT_NEAR(mean_offset_px(profiles), offset_px, kTolerance_px);
    EXPECT_GT(profiles[kProfiles / 2].edge.strip_share, 0.5);
  }
}

double mean_square_px2(const std::vector<StretchProfile>& profiles) {
  double sum = 0.0;
  for (const StretchProfile& p : profiles) sum += p.edge.offset_px * p.edge.offset_px;
  return sum / static_cast<double>(profiles.size());
}

// Of profiles with their edge at 0, errors over what the profiles claim.
double mean_square_pull(const std::vector<StretchProfile>& profiles) {
  double square = 0.0;
  for (const StretchProfile& p : profiles)
    square += p.edge.offset_px * p.edge.offset_px /
              (p.edge.noise_variance_px2 + p.edge.shading_variance_px2);
  return square / static_cast<double>(profiles.size());
}

constexpr int kMany = 400;
constexpr double kPullTolerance = 0.2;  // three times what the mean of 400 squares scatters by

// The errors of single profiles are as large as they say.
TEST(EdgeStretch, OffsetsScatterAsTheirVariancesSay) {
  std::mt19937 random(3);
  std::vector<StretchProfile> profiles;
  for (int i = 0; i < kMany; ++i) profiles.push_back(profile_of(0.0, 0.7, 0.0, 0.0, 2.0, random));
  fit_stretches(profiles);
  EXPECT_NEAR(mean_square_pull(profiles), 1.0, kPullTolerance);
}

// A black edge on white with noise that is even in the levels of a picture, as a camera's is after
// its transfer curve: in the light it is many times larger on the bright side than on the dark one.
std::vector<StretchProfile> profiles_of_a_camera(bool curved) {
  constexpr double kBlur_px = 0.7, kBody = 0.04, kFloor = 0.85, kNoise_levels = 2.0,
                   kReach_px = 4.0;
  const auto level_of = [](double light) {
    return 255.0 * (1.055 * std::pow(light, 1.0 / 2.4) - 0.055);
  };
  const auto light_of = [](double level) { return std::pow((level / 255.0 + 0.055) / 1.055, 2.4); };
  std::mt19937 random(9);
  std::normal_distribution<double> noise(0.0, kNoise_levels);
  std::uniform_real_distribution<double> phase(0.0, 1.0);
  std::vector<StretchProfile> profiles;
  for (int i = 0; i < kMany; ++i) {
    StretchProfile p;
    p.profile.count = static_cast<int>(2.0 * kReach_px);
    p.profile.shared = 1.0;
    p.blur_px = kBlur_px;
    p.curved = curved;
    const double first_px = phase(random) - kReach_px;
    for (int j = 0; j < p.profile.count; ++j) {
      const auto k = static_cast<size_t>(j);
      const double s = first_px + j;
      const double share = 0.5 * std::erfc(-s / (kBlur_px * std::numbers::sqrt2));
      const double level = level_of(kBody + (kFloor - kBody) * share) + noise(random);
      p.profile.s_px[k] = static_cast<float>(s);
      p.profile.light[k] = static_cast<float>(255.0 * light_of(level));
      p.profile.background[k] = 0.0f;
    }
    profiles.push_back(p);
  }
  return profiles;
}

TEST(EdgeStretch, TheDarkSideOfAnEdgeCountsForMoreWherePicturesAreBrightByACurve) {
  std::vector<StretchProfile> curved = profiles_of_a_camera(true),
                              straight = profiles_of_a_camera(false);  // of the same noise
  fit_stretches(curved);
  fit_stretches(straight);
  EXPECT_NEAR(mean_square_pull(curved), 1.0, kPullTolerance);
  // Weights by side alone lose a sixth of what is to be known at these levels.
  EXPECT_LT(mean_square_px2(curved), 0.9 * mean_square_px2(straight));
}

// Coding leaves more noise where a picture changes than beside it. Taken for the noise of either
// side it would be shared with pixels that have none of it, and offsets claim too little.
TEST(EdgeStretch, OffsetsScatterAsTheirVariancesSayWherePixelsOnTheEdgeAreTheNoisiest) {
  constexpr int kPictures = 20;
  double square_pull = 0.0;
  for (int picture = 0; picture < kPictures; ++picture) {
    std::mt19937 random(static_cast<unsigned>(picture));
    std::normal_distribution<double> normal(0.0, 8.0);
    std::vector<StretchProfile> profiles;
    for (int i = 0; i < kMany; ++i) {
      StretchProfile p = profile_of(0.0, 0.7, 0.0, 0.0, 0.7, random);
      for (int j = 0; j < p.profile.count; ++j)
        if (std::abs(p.profile.s_px[static_cast<size_t>(j)]) < 1.0f)
          p.profile.light[static_cast<size_t>(j)] += static_cast<float>(normal(random));
      profiles.push_back(p);
    }
    fit_stretches(profiles);
    square_pull += mean_square_pull(profiles) / kPictures;
  }
  // The model lets noise go with how near a sample is to the edge; this one begins all at once, so
  // that offsets scatter by a fifth more than they say.
  constexpr double kTolerance = 0.3;
  EXPECT_NEAR(square_pull, 1.0, kTolerance);
}

// The least variance with which a profile_of with noise of 1 tells its offset if it knows nothing
// of its two levels but what its own samples say (Cramer-Rao).
double least_variance_alone_px2(const StretchProfile& p) {
  constexpr double kContrast = 70.0;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (int j = 0; j < p.profile.count; ++j) {
    const double z = static_cast<double>(p.profile.s_px[static_cast<size_t>(j)]) / p.blur_px;
    const double share = 0.5 * std::erfc(-z / std::numbers::sqrt2);
    const double density = std::exp(-0.5 * z * z) / std::sqrt(2.0 * std::numbers::pi) / p.blur_px;
    const Eigen::Vector3d slope(1.0 - share, share, kContrast * density);
    information += slope * slope.transpose();
  }
  return information.inverse()(2, 2);
}

TEST(EdgeStretch, ProfilesKnowTheLevelsOfPlainSurfacesFromEachOther) {
  constexpr double kNoise = 2.0;
  std::mt19937 random(5);
  std::vector<StretchProfile> profiles;
  for (int i = 0; i < kMany; ++i)
    profiles.push_back(profile_of(0.0, 0.7, 0.0, 0.0, kNoise, random));
  fit_stretches(profiles);
  const double alone_px2 = kNoise * kNoise * least_variance_alone_px2(profiles.front());
  // With both levels known it would be 0.72 of that.
  EXPECT_LT(mean_square_px2(profiles), 0.85 * alone_px2);
  EXPECT_NEAR(mean_square_pull(profiles), 1.0, kPullTolerance);
}

// What is not known of the shading makes the levels of single profiles scatter; taken for levels
// that differ along the outline, profiles would know little of them from each other.
TEST(EdgeStretch, LevelsThatScatterWithTheirShadingAreKnownFromEachOther) {
  constexpr int kPictures = 100, kOfAnOutline = 100;
  constexpr double kNoise = 2.0;
  std::mt19937 random(8);
  double of_alone = 0.0;
  for (int picture = 0; picture < kPictures; ++picture) {
    std::vector<StretchProfile> profiles;
    for (int i = 0; i < kOfAnOutline; ++i)
      profiles.push_back(profile_of(0.0, 0.7, 0.0, 0.0, kNoise, random));
    fit_stretches(profiles);
    of_alone += mean_square_px2(profiles) /
                (kNoise * kNoise * least_variance_alone_px2(profiles.front())) / kPictures;
  }
  // With both levels known it would be 0.72, with scatter taken for difference it is 0.86; ten
  // thousand profiles tell it to 0.012.
  EXPECT_LT(of_alone, 0.84);
}

// Profiles with their edge at 0 around a body; outside, a share of them in a shadow, or a level
// that comes and goes.
std::vector<StretchProfile> profiles_on_uneven_floor(bool shadow, double share = 0.25) {
  constexpr double kDims = 25.0;
  std::mt19937 random(6);
  std::vector<StretchProfile> profiles;
  for (int i = 0; i < kMany; ++i) {
    StretchProfile p = profile_of(0.0, 0.7, 0.0, 0.0, 1.0, random);
    const double turn = 2.0 * std::numbers::pi * i / kMany;
    const double darker = kDims * (shadow ? i < share * kMany : 0.5 + 0.5 * std::cos(turn));
    for (int j = 0; j < p.profile.count; ++j) {
      const auto k = static_cast<size_t>(j);
      const auto s = static_cast<double>(p.profile.s_px[k]);
      p.profile.light[k] -=
          static_cast<float>(0.5 * std::erfc(-s / (p.blur_px * std::numbers::sqrt2)) * darker);
    }
    profiles.push_back(p);
  }
  return profiles;
}

// A level that is 25 of 70 off moves such an edge by a third of a pixel.
TEST(EdgeStretch, LevelsThatDifferAlongTheOutlineDoNotPullIt) {
  constexpr double kTolerance_px = 0.02;  // four standard deviations of an eighth of all
  for (const bool shadow : {false, true}) {
    std::vector<StretchProfile> profiles = profiles_on_uneven_floor(shadow);
    fit_stretches(profiles);
    for (size_t first = 0; first < profiles.size(); first += kMany / 8) {
      const auto from = profiles.begin() + static_cast<std::ptrdiff_t>(first);
      std::vector<StretchProfile> part(from, from + kMany / 8);
      EXPECT_NEAR(mean_offset_px(part), 0.0, kTolerance_px)
          << (shadow ? "shadow, from " : "wave, from ") << first;
    }
  }
}

// Levels that differ by about as much as single profiles know them: hardly to be seen, and a pull
// of the whole outline to one side that no number of frames averages away.
TEST(EdgeStretch, LevelsThatDifferByLessThanAProfileKnowsHardlyMoveTheBody) {
  constexpr int kPictures = 200, kAround = 200;
  for (const bool outside : {false, true})
    for (const double differ : {2.0, 4.0}) {
      std::mt19937 random(7);
      double sum_px = 0.0;
      for (int picture = 0; picture < kPictures; ++picture) {
        std::vector<StretchProfile> profiles;
        for (int i = 0; i < kAround; ++i) {
          profiles.push_back(profile_of(0.0, 0.7, 0.0, 0.0, 2.0, random));
          Profile& p = profiles.back().profile;
          const double more = differ * std::cos(2.0 * std::numbers::pi * i / kAround);
          for (int j = 0; j < p.count; ++j) {
            const auto k = static_cast<size_t>(j);
            const double z = static_cast<double>(p.s_px[k]) / profiles.back().blur_px;
            p.light[k] += static_cast<float>(
                0.5 * std::erfc((outside ? -z : z) / std::numbers::sqrt2) * more);
          }
        }
        fit_stretches(profiles);
        for (int i = 0; i < kAround; ++i)
          sum_px += profiles[static_cast<size_t>(i)].edge.offset_px *
                    std::cos(2.0 * std::numbers::pi * i / kAround) * 2.0 / kAround;
      }
      // Half of what one picture leaves, 0.006 px; 200 pictures tell it to 0.0004 px.
      EXPECT_NEAR(sum_px / kPictures, 0.0, 0.0035) << (outside ? "outside " : "inside ") << differ;
    }
}

TEST(EdgeStretch, TellsWhereTheFloorIsDarkerThanElsewhere) {
  std::vector<StretchProfile> profiles = profiles_on_uneven_floor(true);
  fit_stretches(profiles, {}, false);
  EXPECT_EQ(profiles[kMany / 2].edge.dimmed, 1.0) << "not looked for: unknown";
  fit_stretches(profiles);
  // 25 of the 45 that are left of the contrast in the shadow.
  EXPECT_NEAR(profiles[kMany / 8].edge.dimmed, 25.0 / 45.0, 0.1);
  EXPECT_LT(profiles[kMany / 2].edge.dimmed, 0.02);
}

TEST(EdgeStretch, WhereMostOfTheFloorIsInShadowThatIsNotTakenForItsLight) {
  std::vector<StretchProfile> profiles = profiles_on_uneven_floor(true, 0.7);
  fit_stretches(profiles);
  EXPECT_GT(profiles[kMany / 3].edge.dimmed, 0.4);
  EXPECT_LT(profiles[kMany * 7 / 8].edge.dimmed, 0.02);
}

TEST(EdgeStretch, TellsThatEdgesAreWiderThanTheModel) {
  std::mt19937 random(4);
  std::vector<StretchProfile> profiles;
  for (int i = 0; i < kProfiles; ++i) {
    profiles.push_back(profile_of(0.0, 0.9, 0.0, 0.0, 0.5, random));
    profiles.back().blur_px = 0.75;
  }
  // The first step of an iteration in the right direction.
  const double wider_px = fit_stretches(profiles).wider_px;
  EXPECT_GT(wider_px, 0.07);
  EXPECT_LT(wider_px, 0.25);
}

// Half of the light is level 188 under the curve of video cameras (IEC 61966-2-1), 127.5 without.
TEST(LightWindow, IsInLinearLightWhateverCurveTheCameraApplies) {
  const cv::Mat half(4, 4, CV_8U, cv::Scalar(188));
  const LightWindow coded(half, {0, 0, 4, 4}, data::Transfer::srgb);
  const LightWindow linear(half, {0, 0, 4, 4}, data::Transfer::linear);
  constexpr float kLevelStep = 1.0F;  // 188 is half the light to the rounding of levels
  EXPECT_NEAR(coded.pixel({1, 1}), 127.5F, kLevelStep);
  EXPECT_EQ(linear.pixel({1, 1}), 188.0F);
}

// Pixels in the rows and columns that a round outline crosses lie at their distance from the
// circle, and near the outline each is read once.
TEST(Crossings, ReadEveryPixelBesideTheOutlineOnceAtItsDistance) {
  const double radius_px = 30.0;
  const Eigen::Vector2d centre_px(60.3, 59.4);
  data::Body body;
  body.radius_m = 0.03;
  body.thickness_m = 1e-6;
  const auto camera = data::Camera::from_scale(120, 120, 1000.0);
  const data::PoseMotion motion(body, {data::SupportKind::flat, {}}, camera);
  data::Pose<> pose;
  pose.centre_m = camera.table_from_image(centre_px, body.half_thickness_m());
  // A picture of its own pixel numbers.
  cv::Mat numbers(120, 120, CV_32FC1);
  for (int i = 0; i < 120 * 120; ++i) numbers.at<float>(i / 120, i % 120) = static_cast<float>(i);
  const LightWindow picture(numbers, cv::Point(0, 0));
  std::vector<Crossings> crossings;
  const auto samples = cross_pixels(outline_samples(body, pose, camera, motion, 2.0), 1, crossings);
  std::map<int, int> times;
  double arc_px = 0.0;
  for (const OutlineSample& sample : samples) arc_px += sample.arc_px;
  for (const Crossings& look : crossings) {
    Profile profile;
    ASSERT_TRUE(read_pixels(picture, {}, look, 0.0, {4.0, 4.0}, profile));
    for (int j = 0; j < profile.count; ++j) {
      const auto k = static_cast<size_t>(j);
      const int number = static_cast<int>(profile.light[k]);
      const Eigen::Vector2d at_px(number % 120, number / 120);
      // To second order: of a bend with 30 px, 4 px away.
      constexpr double kTolerance_px = 0.06;
      EXPECT_NEAR(profile.s_px[k], (at_px - centre_px).norm() - radius_px, kTolerance_px);
      if (std::abs(profile.s_px[k]) < 0.7f) ++times[number];
    }
  }
  int twice = 0;
  for (const auto& [number, count] : times) twice += count > 1 ? 1 : 0;
  // Where rows give way to columns a few are in both.
  EXPECT_LT(twice, 12);
  EXPECT_NEAR(static_cast<double>(times.size()), 2.0 * std::numbers::pi * radius_px * 1.4, 15.0);
  EXPECT_NEAR(arc_px, 2.0 * std::numbers::pi * radius_px, 6.0);
}

// Two rings of four unknowns and three common ones against a dense solver.
TEST(ArrowSystem, SolvesLikeADenseSolver) {
  constexpr int kRings = 2, kKnots = 4, kCommon = 3, kSize = kRings * kKnots + kCommon;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  ArrowSystem system(kRings, kKnots, kCommon);
  Eigen::MatrixXd dense = Eigen::MatrixXd::Identity(kSize, kSize);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(kSize);
  for (int i = 0; i < kSize; ++i) system(i, i) = 1.0;
  for (int equation = 0; equation < 50; ++equation) {
    const int ring = equation % kRings, knot = equation % kKnots;
    Eigen::VectorXd row = Eigen::VectorXd::Zero(kSize);
    row[ring * kKnots + knot] = normal(random);
    row[ring * kKnots + (knot + 1) % kKnots] = normal(random);
    for (int k = 0; k < kCommon; ++k) row[kRings * kKnots + k] = normal(random);
    const double offset = normal(random);
    dense += row * row.transpose();
    right += offset * row;
    for (int i = 0; i < kSize; ++i) {
      if (row[i] != 0.0) system.right(i) += row[i] * offset;
      for (int j = 0; j <= i; ++j)
        if (row[i] * row[j] != 0.0) system(i, j) += row[i] * row[j];
    }
  }
  ASSERT_TRUE(system.factorise());
  const ArrowSystem::Vector solved = system.solved_right();
  const Eigen::VectorXd expected = dense.ldlt().solve(right);
  for (int i = 0; i < kSize; ++i)
    EXPECT_NEAR(solved[static_cast<size_t>(i)], expected[i], 1e-10) << "unknown " << i;
}

// A disc lying flat under a camera of 1000 px/m, drawn on a mottled floor, measured from a
// prediction half a pixel off.
struct FlatDisc {
  data::Body body;
  data::Camera camera = data::Camera::from_scale(160, 140, 1000.0);

  FlatDisc() { body.radius_m = 0.03, body.thickness_m = 0.002; }
  /// The pose in which it leans on its rim and its centre is seen there.
  [[nodiscard]] data::Pose<> leaning(const Eigen::Vector2d& centre_px, double theta_rad) const {
    data::Pose<> pose;
    pose.theta_rad = theta_rad;
    pose.centre_m = camera.table_from_image(
        centre_px, data::height_on_floor_m(theta_rad, body.radius_m, body.half_thickness_m()));
    return pose;
  }
  [[nodiscard]] std::optional<PoseMeasurement> measure(const Eigen::Vector2d& centre_px,
                                                       std::mt19937& random,
                                                       Effort effort = Effort::normal) const {
    const cv::Mat floor = drawn_floor(160, 140, 150.0);
    cv::Mat picture = floor.clone(), plate;
    draw_disc(picture, centre_px.x(), centre_px.y(), 30.0, 30.0, 0.0, 60.0);
    floor.convertTo(plate, CV_8U);
    const cv::Mat luma = developed(picture, 2.0, random);
    data::Pose<> predicted;
    predicted.centre_m = camera.table_from_image(centre_px + Eigen::Vector2d(0.4, -0.3), 0.001);
    const OutlineFitter fitter(body, {data::SupportKind::flat, {}}, camera, effort);
    return fitter.measure(
        {.luma = luma, .background = plate, .detection = {}, .predicted = predicted});
  }
};

TEST(OutlineFitter, ErrorsOfAFlatDiscAreSmallAndAsLargeAsStated) {
  const FlatDisc disc;
  std::mt19937 random(6);
  std::uniform_real_distribution<double> within(-0.5, 0.5);
  constexpr int kDraws = 30;
  double square = 0.0, normalised = 0.0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Eigen::Vector2d centre{80.0 + within(random), 70.0 + within(random)};
    const auto seen = disc.measure(centre, random);
    ASSERT_TRUE(seen);
    const Eigen::Vector2d off = seen->centre_px - centre;
    square += 0.5 * off.squaredNorm();
    normalised += 0.5 * off.dot(seen->covariance_px2.ldlt().solve(off));
  }
  // Three times the 0.007 px that the noise of 2 levels leaves (step of 90 levels, 190 px of rim).
  EXPECT_LT(std::sqrt(square / kDraws), 0.02);
  // Never too small a sigma; a floor for what edge models may be wrong by makes it cautious here.
  EXPECT_LT(normalised / kDraws, 1.5);
  EXPECT_GT(normalised / kDraws, 0.03);
}

// All its edges are found where a body half a pixel larger has them, and seen as clearly.
TEST(OutlineFitter, LessSpeaksForABodyThatLooksSmallerThanItIs) {
  FlatDisc disc;
  disc.camera.transfer = data::Transfer::linear;  // as drawn
  std::mt19937 random(6);
  const auto seen = disc.measure({80.2, 70.3}, random);
  disc.body.radius_m += 0.0005;
  const auto of_larger = disc.measure({80.2, 70.3}, random);
  ASSERT_TRUE(seen && of_larger);
  EXPECT_NEAR(seen->larger_px, 0.0, 0.05);
  EXPECT_NEAR(of_larger->larger_px, -0.5, 0.1);
  EXPECT_LT(of_larger->support_px, 0.9 * seen->support_px);
}

// Shadows at the contact darken the floor there as well: on one as bright beside the body as
// elsewhere the lower half of the outline is taken as it is seen, like the upper one.
TEST(OutlineFitter, OnAnEvenFloorATiltedDiscIsNotMovedForTheSakeOfAContactShadow) {
  FlatDisc disc;
  disc.body.thickness_m = 0.0001;
  constexpr double kTilt_rad = 0.8;
  const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  const cv::Mat floor(140, 160, CV_64F, cv::Scalar(150.0)), plate(140, 160, CV_8U, 150);
  std::mt19937 random(8);
  std::uniform_real_distribution<double> within(-0.5, 0.5);
  constexpr int kDraws = 30;
  double sum_px = 0.0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const Eigen::Vector2d centre_px{80.0 + within(random), 70.0 + within(random)};
    cv::Mat picture = floor.clone();
    draw_disc(picture, centre_px.x(), centre_px.y(), 30.0, 30.0 * std::cos(kTilt_rad), 0.0, 60.0);
    data::Pose<> predicted;
    predicted.theta_rad = kTilt_rad;
    predicted.centre_m = disc.camera.table_from_image(centre_px, 0.03 * std::sin(kTilt_rad));
    const auto seen = fitter.measure({.luma = developed(picture, 2.0, random),
                                      .background = plate,
                                      .detection = {},
                                      .predicted = predicted});
    ASSERT_TRUE(seen);
    sum_px += (seen->centre_px - centre_px).y();
  }
  // Half of what the allowance for a shadow would do; the noise of so many leaves 0.0013 px.
  EXPECT_NEAR(sum_px / kDraws, 0.0, 0.008);
}

// A disc and its shadow under a lamp to the left that is seen from the floor as wide as it is high:
// nine lamps side by side, each with a shadow of its own. Drawn finely, then blurred.
cv::Mat disc_with_shadow(const Eigen::Vector2d& centre_px, double radius_px, double umbra_px,
                         double penumbra_px) {
  constexpr int kFine = 4, kLamps = 9;
  constexpr double kFloor = 150.0, kDisc = 60.0, kInShadow = 60.0, kBlurPx = 0.7;
  cv::Mat fine(140 * kFine, 160 * kFine, CV_64F);
  for (int y = 0; y < fine.rows; ++y)
    for (int x = 0; x < fine.cols; ++x) {
      const Eigen::Vector2d from =
          Eigen::Vector2d(x + 0.5, y + 0.5) / kFine - Eigen::Vector2d(0.5, 0.5) - centre_px;
      int hidden = 0;
      for (int lamp = 0; lamp < kLamps; ++lamp) {
        const double aside_px = umbra_px + penumbra_px * lamp / (kLamps - 1.0);
        hidden += (from - Eigen::Vector2d(aside_px, 0.0)).norm() < radius_px ? 1 : 0;
      }
      fine.at<double>(y, x) =
          from.norm() < radius_px ? kDisc : kFloor + (kInShadow - kFloor) * hidden / kLamps;
    }
  cv::GaussianBlur(fine, fine, {}, kFine * kBlurPx);
  cv::Mat picture;
  cv::resize(fine, picture, {}, 1.0 / kFine, 1.0 / kFine, cv::INTER_AREA);
  return picture;
}

// Between the disc and its penumbra lies a strip of full shadow, here as dark as the disc and too
// narrow to be seen apart: their common edge is not that of the disc.
TEST(OutlineFitter, AContactShadowAsDarkAsTheDiscHardlyPullsIt) {
  const FlatDisc disc;
  std::mt19937 random(9);
  const Eigen::Vector2d centre(80.2, 70.4);
  const cv::Mat plate(140, 160, CV_8U, cv::Scalar(150));
  data::Pose<> predicted;
  predicted.centre_m = disc.camera.table_from_image(centre, 0.001);
  const OutlineFitter fitter(disc.body, {data::SupportKind::flat, {}}, disc.camera);
  constexpr double kUmbraPx = 0.4;
  for (const double penumbra_px : {2.0, 4.0}) {
    const cv::Mat shown = disc_with_shadow(centre, 30.0, kUmbraPx, penumbra_px);
    const cv::Mat luma = developed(shown, 2.0, random);
    const auto seen = fitter.measure(
        {.luma = luma, .background = plate, .detection = {}, .predicted = predicted});
    ASSERT_TRUE(seen);
    // As far as half the strip: taken for the disc's, the edge would move it by the whole.
    EXPECT_LT((seen->centre_px - centre).norm(), 0.5 * kUmbraPx)
        << penumbra_px << " px of penumbra";
  }
}

constexpr double kCb = 118.0, kCr = 110.0;  // greenish

// A greenish ellipse in chroma planes of half the size.
void draw_on_chroma(cv::Mat& cb, cv::Mat& cr, const Eigen::Vector2d& centre_px, double a_px,
                    double b_px) {
  const Eigen::Vector2d at = 0.5 * (centre_px - Eigen::Vector2d(0.5, 0.5));
  draw_disc(cb, at.x(), at.y(), 0.5 * a_px, 0.5 * b_px, 0.0, kCb);
  draw_disc(cr, at.x(), at.y(), 0.5 * a_px, 0.5 * b_px, 0.0, kCr);
}

cv::Mat merged_chroma(const cv::Mat& cb, const cv::Mat& cr) {
  cv::Mat chroma;
  cv::merge(std::vector<cv::Mat>{cb, cr}, chroma);
  chroma.convertTo(chroma, CV_8U);
  return chroma;
}

// A tilted disc and beside it a shadow as dark as itself look like a disc that tilts less.
TEST(OutlineFitter, AShadowAsDarkAsTheDiscIsToldFromItByItsColour) {
  FlatDisc disc;
  disc.body.thickness_m = 1e-4;
  constexpr double kTheta = 0.7, kRadius_px = 30.0, kFloor = 150.0, kDark = 60.0;
  const double minor_px = kRadius_px * std::cos(kTheta);
  const Eigen::Vector2d centre(80.2, 70.4), aside(0.0, -4.0);
  cv::Mat picture(140, 160, CV_64F, cv::Scalar(kFloor)), cb(70, 80, CV_64F, cv::Scalar(128.0)),
      cr = cb.clone();
  constexpr int kSlices = 8;
  for (int k = 0; k <= kSlices; ++k) {
    const Eigen::Vector2d at = centre + k / static_cast<double>(kSlices) * aside;
    draw_disc(picture, at.x(), at.y(), kRadius_px, minor_px, 0.0, kDark);
  }
  draw_on_chroma(cb, cr, centre, kRadius_px, minor_px);
  constexpr double kCodedPx = 1.0;  // what coding leaves of colours
  cv::GaussianBlur(cb, cb, {}, kCodedPx);
  cv::GaussianBlur(cr, cr, {}, kCodedPx);
  std::mt19937 random(12);
  const cv::Mat luma = developed(picture, 2.0, random);
  const cv::Mat plate(140, 160, CV_8U, cv::Scalar(kFloor));
  data::Pose<> predicted;
  predicted.theta_rad = std::acos((minor_px + 2.0) / kRadius_px);
  predicted.centre_m = disc.camera.table_from_image(
      centre + 0.5 * aside, data::height_on_floor_m(predicted.theta_rad, disc.body.radius_m,
                                                    disc.body.half_thickness_m()));
  const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  const auto seen = fitter.measure({.luma = luma,
                                    .background = plate,
                                    .detection = {},
                                    .predicted = predicted,
                                    .chroma = merged_chroma(cb, cr)});
  ASSERT_TRUE(seen);
  constexpr double kTolerance_px = 0.4;  // of the 2 that half the shadow is wide
  EXPECT_LT((seen->centre_px - centre).norm(), kTolerance_px);
}

// A tilted disc with its wall in the shade, drawn as slices of the wall's level below the face.
void draw_cylinder(cv::Mat& picture, const Eigen::Vector2d& centre_px, double radius_px,
                   double half_thickness_px, double theta_rad, double wall, double face) {
  constexpr int kSlices = 8;
  for (int k = -kSlices; k <= kSlices; ++k)
    draw_disc(picture, centre_px.x(),
              centre_px.y() + k * half_thickness_px * std::sin(theta_rad) / kSlices, radius_px,
              radius_px * std::cos(theta_rad), 0.0, k < kSlices ? wall : face);
}

// Levels of a cylinder and the floor it is on.
struct Lit {
  double floor, wall, face;
};

// That of a disc 60 px across, with noise of 2 levels.
cv::Mat photograph_of_cylinder(const Eigen::Vector2d& centre_px, double half_thickness_px,
                               double theta_rad, const Lit& lit) {
  cv::Mat picture(140, 160, CV_64F, cv::Scalar(lit.floor));
  draw_cylinder(picture, centre_px, 30.0, half_thickness_px, theta_rad, lit.wall, lit.face);
  std::mt19937 random(15);
  return developed(picture, 2.0, random);
}

// What of each pixel of the chroma planes a cylinder covers, blended once.
cv::Mat covered_by_cylinder(const cv::Size& size, const Eigen::Vector2d& centre_px,
                            double radius_px, double half_thickness_px, double theta_rad) {
  constexpr int kSlices = 8;
  cv::Mat covered = cv::Mat::zeros(size, CV_64F);
  for (int k = -kSlices; k <= kSlices; ++k) {
    cv::Mat slice = cv::Mat::zeros(size, CV_64F);
    draw_disc(slice, centre_px.x(),
              centre_px.y() + k * half_thickness_px * std::sin(theta_rad) / kSlices, radius_px,
              radius_px * std::cos(theta_rad), 0.0, 1.0);
    covered = cv::max(covered, slice);
  }
  return covered;
}

// Blur takes more off the ends of a tilted disc, which curve the most, than off its long sides: it
// would look as if it were tilted less.
TEST(OutlineFitter, BlurDoesNotTiltASmallDisc) {
  constexpr int kFine = 8;
  constexpr double kTheta = 1.0, kRadius_px = 14.0, kBlur_px = 0.9, kFloor = 0.5, kDisc = 0.05;
  FlatDisc disc;
  disc.body.radius_m = 1e-3 * kRadius_px, disc.body.thickness_m = 1e-5;
  const Eigen::Vector2d centre(80.2, 70.4);
  cv::Mat fine(140 * kFine, 160 * kFine, CV_64F);
  for (int y = 0; y < fine.rows; ++y)
    for (int x = 0; x < fine.cols; ++x) {
      const double u = (x + 0.5) / kFine - 0.5 - centre.x();
      const double v = (y + 0.5) / kFine - 0.5 - centre.y();
      const bool within = std::hypot(u, v / std::cos(kTheta)) < kRadius_px;
      fine.at<double>(y, x) = within ? kDisc : kFloor;
    }
  cv::GaussianBlur(fine, fine, {}, kBlur_px * kFine);
  cv::Mat luma;
  cv::resize(255.0 * fine, luma, {160, 140}, 0.0, 0.0, cv::INTER_AREA);
  luma.convertTo(luma, CV_8U);
  disc.camera.transfer = data::Transfer::linear;
  data::Pose<> predicted;
  predicted.theta_rad = kTheta;
  predicted.centre_m = disc.camera.table_from_image(
      centre + Eigen::Vector2d(0.2, -0.2),
      data::height_on_floor_m(kTheta, disc.body.radius_m, disc.body.half_thickness_m()));
  const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  const cv::Mat no_plate;
  const auto seen = fitter.measure(
      {.luma = luma, .background = no_plate, .detection = {}, .predicted = predicted});
  ASSERT_TRUE(seen);
  // Two thirds of what half the curvature of the ends, 1 / (14 cos^2 1) px^-1, times the variance
  // of the blur does to the tilt: a tenth of a pixel there, a hundredth at the sides.
  constexpr double kTolerance_rad = 0.004;
  EXPECT_NEAR(seen->pose.theta_rad, kTheta, kTolerance_rad);
}

// The bright face stands out so much more than the wall beside it that the outline settles on its
// rim, as that of a disc that tilts more.
TEST(OutlineFitter, ABrightFaceIsNotTakenForTheWholeBody) {
  FlatDisc disc;
  disc.body.thickness_m = 0.008;
  constexpr double kTheta = 0.4, kFloor = 130.0;
  const Eigen::Vector2d centre(80.2, 70.4);
  const cv::Mat luma = photograph_of_cylinder(centre, 4.0, kTheta, {kFloor, 80.0, 230.0});
  const cv::Mat plate(140, 160, CV_8U, cv::Scalar(kFloor));
  const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  // cos 0.55 + 4 / 30 sin 0.55 = cos 0.4
  const data::Pose<> predicted =
      disc.leaning(centre + Eigen::Vector2d(0.0, 4.0 * std::sin(kTheta)), 0.55);
  const auto seen =
      fitter.measure({.luma = luma, .background = plate, .detection = {}, .predicted = predicted});
  ASSERT_TRUE(seen);
  constexpr double kTolerance_rad = 0.05, kTolerance_px = 0.4;
  EXPECT_NEAR(seen->pose.theta_rad, kTheta, kTolerance_rad);
  EXPECT_LT((seen->centre_px - centre).norm(), kTolerance_px);
}

// A border on the face that is about as bright as the floor, beside a bright wall: the inner edge
// of the border is the clearest there is.
struct BorderedDisc {
  static constexpr double kTheta = 0.7, kFloor = 130.0, kBorder = 0.88;
  Eigen::Vector2d centre{80.2, 70.4};

  /// @param known of the border, as a share of the radius; 0: nothing.
  [[nodiscard]] std::optional<PoseMeasurement> measure(double known) const {
    FlatDisc disc;
    disc.body.thickness_m = 0.006;
    disc.body.border_radius_m = known * disc.body.radius_m;
    constexpr double kRadius_px = 30.0, kHalf_px = 3.0;
    cv::Mat picture(140, 160, CV_64F, cv::Scalar(kFloor));
    draw_cylinder(picture, centre, kRadius_px, kHalf_px, kTheta, 70.0, 126.0);
    draw_disc(picture, centre.x(), centre.y() + kHalf_px * std::sin(kTheta), kBorder * kRadius_px,
              kBorder * kRadius_px * std::cos(kTheta), 0.0, 220.0);
    std::mt19937 random(15);
    const cv::Mat luma = developed(picture, 2.0, random);
    const cv::Mat plate(140, 160, CV_8U, cv::Scalar(kFloor));
    const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
    const Detection detection{
        .centre_px = centre, .semi_major_px = 30.0, .semi_minor_px = 28.0, .box = {50, 42, 61, 57}};
    return fitter.measure({.luma = luma, .background = plate, .detection = detection});
  }
};

TEST(OutlineFitter, ABorderOnTheFaceIsNotTakenForTheRimWhereItIsKnown) {
  const BorderedDisc scene;
  const auto seen = scene.measure(BorderedDisc::kBorder);
  ASSERT_TRUE(seen);
  constexpr double kTolerance_rad = 0.03, kTolerance_px = 0.3;
  EXPECT_NEAR(seen->pose.theta_rad, BorderedDisc::kTheta, kTolerance_rad);
  EXPECT_LT((seen->centre_px - scene.centre).norm(), kTolerance_px);
  EXPECT_GT(seen->accepted, 0.9);
  const auto unknown = scene.measure(0.0);
  EXPECT_TRUE(!unknown || unknown->accepted < 0.7);
}

// A wall hardly brighter than the floor: beside the face there is an outline as long as that with
// the wall, but the light has to change beside its edges to explain them.
struct FaintWall {
  static constexpr double kTheta = 0.6, kFloor = 130.0;
  FlatDisc disc;
  Eigen::Vector2d centre{80.2, 70.4};

  /// A look at it from a pose that is so far off.
  [[nodiscard]] std::optional<PoseMeasurement> measure(double off_px, bool there) const {
    FlatDisc thick = disc;
    thick.body.thickness_m = 0.008;
    cv::Mat picture;
    photograph_of_cylinder(centre, 4.0, kTheta, {kFloor, 140.0, 230.0}).convertTo(picture, CV_64F);
    std::mt19937 random(7);
    const cv::Mat luma = developed(picture, 3.0, random);
    const cv::Mat plate(140, 160, CV_8U, cv::Scalar(kFloor));
    const OutlineFitter fitter(thick.body, {data::SupportKind::floor, {}}, thick.camera);
    return fitter.measure(
        {.luma = luma,
         .background = plate,
         .detection = {},
         .predicted = thick.leaning(centre + Eigen::Vector2d(off_px, 0.0), kTheta),
         .there = there});
  }
};

TEST(OutlineFitter, AnOutlineBesideTheFaceIsNotTakenForThatWithTheWall) {
  const FaintWall scene;
  const auto seen = scene.measure(0.2, false);
  ASSERT_TRUE(seen);
  // Noise of 3 levels leaves .1 px and half a degree; the other outline is 2.3 px off.
  constexpr double kTolerance_rad = 0.03, kTolerance_px = 0.3;
  EXPECT_NEAR(seen->pose.theta_rad, FaintWall::kTheta, kTolerance_rad);
  EXPECT_LT((seen->centre_px - scene.centre).norm(), kTolerance_px);
}

TEST(OutlineFitter, ABodyThatIsSaidToBeThereIsNotSoughtElsewhere) {
  constexpr double kOff_px = 6.0;
  const FaintWall scene;
  const auto sought = scene.measure(kOff_px, false), there = scene.measure(kOff_px, true);
  ASSERT_TRUE(sought);
  EXPECT_LT((sought->centre_px - scene.centre).norm(), 0.3);
  EXPECT_TRUE(!there || (there->centre_px - scene.centre).norm() > 0.3 * kOff_px);
  const auto near = scene.measure(0.2, true);
  ASSERT_TRUE(near);
  EXPECT_LT((near->centre_px - scene.centre).norm(), 0.3);
}

// Where the light falls off beside the edges, by another slope at each place, it explains wrong
// edges as well as right ones.
TEST(OutlineFitter, LessSpeaksForAnOutlineBesideWhichTheLightIsUneven) {
  const FlatDisc disc;
  const Eigen::Vector2d centre(80.2, 70.3);
  const auto beside_slopes = [&](double levels_per_px) {
    cv::Mat picture = drawn_floor(160, 140, 150.0);
    for (int y = 0; y < picture.rows; ++y)
      for (int x = 0; x < picture.cols; ++x) {
        const Eigen::Vector2d off = Eigen::Vector2d(x, y) - centre;
        const double beyond_px = std::min(8.0, std::abs(off.norm() - 30.0));
        picture.at<double>(y, x) +=
            levels_per_px * (8.0 - beyond_px) * std::sin(5.0 * std::atan2(off.y(), off.x()));
      }
    draw_disc(picture, centre.x(), centre.y(), 30.0, 30.0, 0.0, 100.0);
    std::mt19937 random(6);
    const cv::Mat luma = developed(picture, 2.0, random);
    cv::Mat plate;
    drawn_floor(160, 140, 150.0).convertTo(plate, CV_8U);
    data::Pose<> predicted;
    predicted.centre_m = disc.camera.table_from_image(centre, 0.001);
    const OutlineFitter fitter(disc.body, {data::SupportKind::flat, {}}, disc.camera);
    return fitter.measure(
        {.luma = luma, .background = plate, .detection = {}, .predicted = predicted});
  };
  const auto even = beside_slopes(0.0), uneven = beside_slopes(8.0);
  ASSERT_TRUE(even && uneven);
  EXPECT_NEAR(uneven->support_px / even->support_px, 1.0, 0.15) << "as many edges";
  EXPECT_LT(uneven->score_px(), 0.8 * even->score_px());
  EXPECT_GT(even->evenness, 0.95);
}

// The wall lies in the shade and the floor beside it in the shadow. A disc half a pixel off and
// tilted more, beside a brighter wall, looks nearly like it.
TEST(OutlineFitter, AWallInTheShadeOverADarkFloorDoesNotTiltTheDisc) {
  FlatDisc disc;
  disc.body.thickness_m = 0.005;
  constexpr double kTheta = 0.4;
  const Eigen::Vector2d centre(80.2, 70.4);
  const cv::Mat luma = photograph_of_cylinder(centre, 2.5, kTheta, {10.0, 25.0, 120.0});
  const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  const data::Pose<> predicted = disc.leaning(centre + Eigen::Vector2d(0.0, 0.6), kTheta + 0.05);
  const cv::Mat no_plate;
  const auto seen = fitter.measure(
      {.luma = luma, .background = no_plate, .detection = {}, .predicted = predicted});
  ASSERT_TRUE(seen);
  // A third of how far off the other reading is.
  constexpr double kTolerance_rad = 0.02, kTolerance_px = 0.15;
  EXPECT_NEAR(seen->pose.theta_rad, kTheta, kTolerance_rad);
  EXPECT_LT((seen->centre_px - centre).norm(), kTolerance_px);
}

// A tilted disc whose wall lies in the shade and is as bright as the floor: the outline of its
// bright face alone is that of a disc tilted the other way.
TEST(OutlineFitter, AWallAsBrightAsTheFloorIsToldFromItByItsColour) {
  FlatDisc disc;
  disc.body.thickness_m = 0.008;
  constexpr double kTheta = 0.35, kRadius_px = 30.0, kFloor = 150.0, kFace = 210.0;
  const Eigen::Vector2d centre(80.2, 70.4);
  cv::Mat picture(140, 160, CV_64F, cv::Scalar(kFloor));
  draw_cylinder(picture, centre, kRadius_px, 4.0, kTheta, kFloor, kFace);
  const Eigen::Vector2d half = 0.5 * (centre - Eigen::Vector2d(0.5, 0.5));
  const cv::Mat covered = covered_by_cylinder({80, 70}, half, 0.5 * kRadius_px, 2.0, kTheta);
  const cv::Mat chroma =
      merged_chroma(128.0 + (kCb - 128.0) * covered, 128.0 + (kCr - 128.0) * covered);
  std::mt19937 random(13);
  const cv::Mat luma = developed(picture, 2.0, random);
  const cv::Mat plate(140, 160, CV_8U, cv::Scalar(kFloor));
  const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  const auto support_px = [&](double phi_rad) {
    data::Pose<> predicted;
    predicted.theta_rad = kTheta, predicted.phi_rad = phi_rad;
    predicted.centre_m = disc.camera.table_from_image(
        centre, data::height_on_floor_m(kTheta, disc.body.radius_m, disc.body.half_thickness_m()));
    const auto seen = fitter.measure({.luma = luma,
                                      .background = plate,
                                      .detection = {},
                                      .predicted = predicted,
                                      .chroma = chroma});
    return seen ? seen->support_px : 0.0;
  };
  constexpr double kClearly = 1.08;  // twice what readings may differ by and be as good
  EXPECT_GT(support_px(0.0), kClearly * support_px(std::numbers::pi));
}

// A disc with a dot on its upper face, predicted the wrong way up: its outline is the same.
TEST(OutlineFitter, AMarkTellsWhichFaceIsSeen) {
  constexpr double kTheta = 0.6, kPsi = 0.9, kRadius_px = 30.0, kDot_px = 16.0;
  constexpr double kTolerance_rad = 0.05;  // the dot is 3 px wide, the thin wall hardly shows
  FlatDisc disc;
  disc.body.thickness_m = 1e-4;
  disc.body.marks = {{.distance_m = 1e-3 * kDot_px, .size_m = 0.003, .on_lower_face = false}};
  const Eigen::Vector2d centre(80.2, 70.4);
  std::mt19937 random(12);
  const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  const cv::Mat floor = drawn_floor(160, 140, 150.0);
  cv::Mat plate;
  floor.convertTo(plate, CV_8U);
  data::Pose<> predicted;
  predicted.theta_rad = std::numbers::pi - kTheta;
  predicted.phi_rad = std::numbers::pi;
  predicted.centre_m = disc.camera.table_from_image(
      centre, data::height_on_floor_m(kTheta, disc.body.radius_m, disc.body.half_thickness_m()));
  for (const bool dotted : {true, false}) {
    cv::Mat picture = floor.clone();
    draw_disc(picture, centre.x(), centre.y(), kRadius_px, kRadius_px * std::cos(kTheta), 0.0,
              60.0);
    if (dotted)
      draw_disc(picture, centre.x() + kDot_px * std::cos(kPsi),
                centre.y() - kDot_px * std::sin(kPsi) * std::cos(kTheta), 3.0,
                3.0 * std::cos(kTheta), 0.0, 200.0);
    const cv::Mat luma = developed(picture, 2.0, random);
    const auto seen = fitter.measure(
        {.luma = luma, .background = plate, .detection = {}, .predicted = predicted});
    ASSERT_TRUE(seen);
    EXPECT_EQ(seen->sigma_psi_rad.has_value(), dotted);
    EXPECT_NEAR(seen->pose.theta_rad, dotted ? kTheta : std::numbers::pi - kTheta, kTolerance_rad);
    if (!dotted) continue;
    const double turned_rad = seen->pose.phi_rad + seen->pose.psi_rad - kPsi;
    EXPECT_NEAR(std::remainder(turned_rad, 2.0 * std::numbers::pi), 0.0, kTolerance_rad);
  }
}

// Of equal faces the one that is named upper is chosen last: what a rolling shutter does along the
// node line, which has the other way then, is told for the pose that is told.
TEST(OutlineFitter, SaysTheSameOfARollingShutterWhicheverFaceWasPredicted) {
  constexpr double kTheta_rad = 0.9;
  FlatDisc disc;
  disc.body.thickness_m = 1e-5;
  const Eigen::Vector2d centre_px(80.2, 69.7);
  const cv::Mat floor = drawn_floor(160, 140, 150.0);
  cv::Mat picture = floor.clone(), plate;
  draw_disc(picture, centre_px.x(), centre_px.y(), 30.0, 30.0 * std::cos(kTheta_rad), 0.0, 60.0);
  floor.convertTo(plate, CV_8U);
  std::mt19937 random(8);
  const cv::Mat luma = developed(picture, 1.0, random);
  const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  const auto seen_from = [&](const data::Pose<>& predicted) {
    return fitter.measure({.luma = luma,
                           .background = plate,
                           .detection = {},
                           .predicted = predicted,
                           .readout_per_px = {0.0, 1e-3}});
  };
  const data::Pose<> pose = disc.leaning(centre_px, kTheta_rad);
  const auto seen = seen_from(pose), over = seen_from(data::turned_over(pose, 0.0));
  ASSERT_TRUE(seen && over);
  EXPECT_NEAR(over->pose.theta_rad, seen->pose.theta_rad, 1e-6);
  constexpr double kOfLargest = 1e-3;
  for (const std::size_t axis : {0U, 1U}) {
    const Eigen::MatrixXd one = seen->sheared[axis], other = over->sheared[axis];
    ASSERT_GT(one.cwiseAbs().maxCoeff(), 0.0);
    EXPECT_LT((other - one).cwiseAbs().maxCoeff(), kOfLargest * one.cwiseAbs().maxCoeff()) << axis;
  }
}

TEST(OutlineFitter, TellsTheBlurForTheNextFrame) {
  const FlatDisc disc;
  std::mt19937 random(7);
  const auto seen = disc.measure({80.2, 70.4}, random);
  ASSERT_TRUE(seen);
  // 0.7 px as drawn; reading between pixels adds about a sixth of a pixel squared at most.
  EXPECT_GT(seen->blur_px, 0.6);
  EXPECT_LT(seen->blur_px, 0.95);
}

TEST(OutlineFitter, EffortChoosesHowManyEdgesAreRead) {
  const FlatDisc disc;
  std::mt19937 random(8);
  const auto quick = disc.measure({80.0, 70.0}, random, Effort::quick);
  const auto exact = disc.measure({80.0, 70.0}, random, Effort::exact);
  ASSERT_TRUE(quick && exact);
  EXPECT_GT(2 * exact->edges.size(), 3 * quick->edges.size());
}

}  // namespace
}  // namespace trochoid::tracking
