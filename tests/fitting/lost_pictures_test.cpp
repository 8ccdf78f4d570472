#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>
#include <vector>

#include "reference_motion.hpp"
#include "trochoid/fitting/fit.hpp"

// Recorders that drop pictures, or write one twice, and time the others as if they had not.
namespace trochoid::fitting {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr double kSigma_m = 3e-4;  // not far below what the body rolls in a frame

class LostPictures : public testing::Test {
 protected:
  // As if this picture had never come.
  void drop(std::size_t sample) {
    auto& samples = motion_.track.samples;
    for (std::size_t i = samples.size() - 1; i > sample; --i) samples[i].t_s = samples[i - 1].t_s;
    samples.erase(samples.begin() + static_cast<std::ptrdiff_t>(sample));
  }
  // As if this one had come again in place of the next, and all others after it.
  void repeat(std::size_t sample) {
    auto& samples = motion_.track.samples;
    for (std::size_t i = samples.size() - 1; i > sample; --i) {
      const double t_s = samples[i].t_s;
      samples[i] = samples[i - 1];
      samples[i].t_s = t_s;
    }
  }
  [[nodiscard]] std::string time_s(std::size_t sample) const {
    return fmt::format("{:.4g} s", motion_.track.samples[sample].t_s);
  }
  [[nodiscard]] data::Fit found() const { return fit(std::span(&motion_.track, 1), motion_.scene); }

  void expect_two_told() {
    drop(100);
    drop(180);
    const data::Fit fit = found();
    EXPECT_EQ(fit.verdict, data::FitVerdict::doubtful);
    EXPECT_THAT(fit.verdict_words, AllOf(HasSubstr("1 frame too early from " + time_s(100)),
                                         HasSubstr("1 frame too early from " + time_s(180))));
  }

  NoisyMotion motion_ = noisy("s06_roll_disc", 2.0, kSigma_m, 2);
};

TEST_F(LostPictures, AreNotSeenWhereNoneIs) {
  const data::Fit fit = found();
  EXPECT_EQ(fit.verdict, data::FitVerdict::good) << fit.verdict_words;
}

// The parameters had been 4 error bars off, with a verdict of good_correlated.
TEST_F(LostPictures, AreToldWithTheTimesOfTheNext) {
  expect_two_told();
}

TEST_F(LostPictures, AreToldFromOneThatCameTwice) {
  repeat(150);
  const data::Fit fit = found();
  EXPECT_EQ(fit.verdict, data::FitVerdict::doubtful);
  EXPECT_THAT(fit.verdict_words, HasSubstr("1 frame too late from " + time_s(151)));
}

// What a frame of time does to positions had been weighed as if the coordinates' errors changed
// places: of two pictures lost none was found, and none was lost there.
TEST_F(LostPictures, AreToldWherePositionsErrMostlyAlongOneWay) {
  const Eigen::Vector2d along = Eigen::Vector2d::Ones().normalized();
  constexpr double kAlong_m = 4.0 * kSigma_m;
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal(0.0, kAlong_m);
  for (data::TrackSample& sample : motion_.track.samples) {
    sample.centre_m += normal(generator) * along;
    sample.covariance_m2 += kAlong_m * kAlong_m * along * along.transpose();
  }
  expect_two_told();
}

// Glitches had turned the parameters, by which frames were told that nothing had happened at.
TEST_F(LostPictures, AreToldBesideGlitches) {
  for (const std::size_t glitch : {40U, 130U, 220U})
    motion_.track.samples[glitch].centre_m.x() += 0.02;
  drop(100);
  drop(180);
  const data::Fit fit = found();
  EXPECT_EQ(fit.verdict, data::FitVerdict::doubtful);
  const auto told = testing::MatchesRegex(
      fmt::format(".*times are 1 frame too early from {} on, 1 frame too early from {} on: .*",
                  time_s(100), time_s(180)));
  EXPECT_THAT(fit.verdict_words, told);
}

// Their times alone do not say of which track they are.
TEST_F(LostPictures, AreToldOfTheirTrack) {
  const std::vector<data::Track> tracks{noisy("s06_roll_disc", 2.0, kSigma_m, 2, 8).track,
                                        (drop(100), motion_.track)};
  const data::Fit fit = fitting::fit(tracks, motion_.scene);
  EXPECT_THAT(fit.verdict_words, HasSubstr("1 frame too early in track 2 from " + time_s(100)));
}

// Half a frame is no picture: a shutter that was late, or a model that lacks something.
TEST_F(LostPictures, AreNoExplanationOfWhatIsNoWholeFrame) {
  auto& samples = motion_.track.samples;
  const double half_s = 0.5 * (samples[1].t_s - samples[0].t_s);
  for (std::size_t i = 150; i < samples.size(); ++i) samples[i].t_s += half_s;
  const data::Fit fit = found();
  EXPECT_THAT(fit.verdict_words, Not(HasSubstr("frame")));
}

// Where nothing explains the track it tells by itself.
TEST_F(LostPictures, AreAskedForWhereNothingExplainsTheTrack) {
  motion_ = noisy("s06_roll_disc", 2.0, 0.1 * kSigma_m, 2);
  drop(100);
  drop(180);
  const data::Fit fit = found();
  EXPECT_EQ(fit.verdict, data::FitVerdict::unexplained);
  EXPECT_THAT(fit.warnings,
              Contains(AllOf(HasSubstr("at " + time_s(100)), HasSubstr("at " + time_s(180)))));
}

}  // namespace
}  // namespace trochoid::fitting
