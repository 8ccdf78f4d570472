#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "trochoid/data/io.hpp"
#include "trochoid/fitting/compare.hpp"

// Tracks of tests/independent, made by other equations than the model's.
namespace trochoid::fitting {
namespace {

Comparison comparison_of(const std::string& name) {
  const std::string folder = TROCHOID_SOURCE_DIR "/tests/independent/cases/" + name;
  const data::TrackFile file = data::read_track(folder + "/track.csv");
  return compare(file.tracks, data::read_scene(folder + "/scene.toml"));
}

constexpr double kSigmas = 4.0;

void expect_found(const data::Fit& fit, const std::map<std::string, double>& truth) {
  for (const auto& [name, value] : truth) {
    const data::FitParameter* parameter = fit.find(name);
    ASSERT_NE(parameter, nullptr) << name;
    EXPECT_NEAR(parameter->value, value, kSigmas * parameter->sigma) << name;
    EXPECT_LT(parameter->sigma, 0.2 * value) << name;
  }
}

// Without the air's force on the centre a gap layer a thousand times as viscous as air and other
// couples had done as well, and pivoting friction had come out at an eighth, with a verdict of
// good.
TEST(Independent, AirThatSlowsTheCentreIsNotTakenForCouples) {
  const Comparison found = comparison_of("air_force");
  EXPECT_EQ(found.fit.verdict, "good");
  expect_found(found.fit, {{"air_force_N_s_m", 0.003979246288779953},
                           {"pivoting_friction_m", 2.5386966524556133e-05}});
}

}  // namespace
}  // namespace trochoid::fitting
