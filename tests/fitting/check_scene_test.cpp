#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/fitting/compare.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {
namespace {

data::Scene disc_to_fit(const std::string& fit) {
  return data::parse_scene(
      "[body]\nradius_m = 0.03\nthickness_m = 0.004\nmass_kg = 0.05\n[camera]\nrows = 480\n"
      "[model]\nname = \"rolling\"\nrolling_friction_m = 1e-5\n[fit]\n" +
          fit,
      "scene");
}

// Those of the way of measuring are no parameters of the model, but of its fit.
TEST(CheckScene, TakesWhatAFitCanFree) {
  EXPECT_NO_THROW(check_scene(disc_to_fit(
      "free = [\"rolling_friction_m\", \"readout_s\", \"angle_delay_s\"]\nfree_scale = true\n"
      "prior = { radius_m = [0.03, 0.0003], frame_rate_hz = [100, 1] }\n")));
}

// What the support leaves open is open: a name may be that of a disc on its pivot or of a top.
TEST(CheckScene, RefusesNamesThatNoneOfTheModelsComparedHas) {
  data::Scene scene = disc_to_fit("fixed = { friction = 0.2 }\nbounds = { slope_x = [0, 1] }\n");
  scene.model.name = "auto";
  EXPECT_NO_THROW(check_compared(scene));
  scene.fit.fixed["frictoin"] = 0.2;
  const auto refuses = testing::ThrowsMessage<InputError>(
      testing::HasSubstr("[fit] fixed: the models compared have no parameter 'frictoin'"));
  EXPECT_THAT([&] { check_compared(scene); }, refuses);
  scene.support.kind = data::SupportKind::pivot;
  scene.fit = {};
  scene.fit.fixed = {{"spin_down_viscous_1_s", 0.1}, {"l_m", 0.1}};
  EXPECT_NO_THROW(check_compared(scene));
  scene.fit.fixed["frictoin"] = 0.2;
  EXPECT_THAT([&] { check_compared(scene); }, refuses);
  scene.support.kind = data::SupportKind::floor;
  scene.body.reset();  // nothing is compared then, and compare() says so
  EXPECT_NO_THROW(check_compared(scene));
}

TEST(CheckScene, RefusesWhatNoTrackCouldMend) {
  const auto refusal = [](const data::Scene& scene) -> std::string {
    try {
      check_scene(scene);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal(disc_to_fit("fixed = { mas_kg = 1 }\n")),
              testing::StartsWith("[fit] fixed: model 'rolling' has no parameter 'mas_kg'"));
  data::Scene bodiless = disc_to_fit("");
  bodiless.body.reset();
  EXPECT_THAT(refusal(bodiless), testing::HasSubstr("[body] is missing"));
}

}  // namespace
}  // namespace trochoid::fitting
