#include "trochoid/data/reference_case.hpp"

#include <gtest/gtest.h>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {
namespace {

ReferenceCase bundled(const std::string& name) {
  return read_reference_case(std::string(TROCHOID_SOURCE_DIR "/data/reference/") + name + ".json");
}

TEST(ReferenceCase, OfARollingRingKeepsItsBodyAndOnlyTheTermsThatAct) {
  const ReferenceCase ring = bundled("s09_ring_retrograde_drag");
  EXPECT_EQ(ring.scene.model.name, "rolling");
  ASSERT_TRUE(ring.scene.model.air_linear_N_m_s);
  EXPECT_EQ((*ring.scene.model.air_linear_N_m_s)[2], 1.5e-5);
  EXPECT_FALSE(ring.scene.model.gap_viscosity_Pa_s);
  EXPECT_FALSE(ring.scene.model.rolling_friction_m);
  EXPECT_EQ(ring.scene.body->thickness_m, 0.008);
  EXPECT_EQ(*ring.scene.body->I_kg_m2, 1.3919297176468351e-05);
}

TEST(ReferenceCase, ChoosesTheSlidingLawByItsRegularisation) {
  const ReferenceCase regularised = bundled("s08_slide_disc");
  EXPECT_EQ(regularised.scene.model.name, "sliding");
  EXPECT_EQ(*regularised.scene.model.slip_regularisation_m_s, 1e-3);
  EXPECT_EQ(*regularised.scene.model.couple_regularisation_rad_s, 0.01);
  const ReferenceCase exact = bundled("s10_stick_slip_event");
  EXPECT_EQ(exact.scene.model.name, "sliding");
  EXPECT_FALSE(exact.scene.model.slip_regularisation_m_s);
}

TEST(ReferenceCase, WithoutItsParametersIsRefusedByTheNameOfTheKey) {
  const auto path = std::filesystem::temp_directory_path() / "trochoid_reference_case_test.json";
  write_text(R"({"model": "M4", "params": {"m": 1}, "initial": {}, "t_end": 1, "fs": 10})", path);
  try {
    (void)read_reference_case(path);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("\"R\""), std::string::npos) << error.what();
  }
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace trochoid::data
