#include "files_for_tests.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {
namespace {

TEST(ObjectFile, GivesTheBodyAndWhatHoldsItButNotWhatAFitHasToFind) {
  const TestFolder folder;
  const Scene scene = read_object(folder.write("object.json", R"({
    "type": "disc", "R_m": 0.03, "thickness_m": 0.008, "mass_kg": 0.06, "com_to_pivot_m": 0.045,
    "pivot_m": [0.004, -0.003, 0.025], "axle_radius_m": 0.0013, "axle_above_upper_face_m": 0.015,
    "markers": [{"kind": "dot", "r_m": 0.02, "radius_m": 0.0045, "angle_deg": 180, "faces": [1]}],
    "dynamics": {"l_m": 0.045, "a_s2": 195.7, "state_at_frame0": {"theta0": 0.5}}})"));
  ASSERT_TRUE(scene.body);
  EXPECT_EQ(scene.body->radius_m, 0.03);
  EXPECT_EQ(scene.body->thickness_m, 0.008);
  EXPECT_EQ(scene.body->axle_above_m, 0.015);
  EXPECT_EQ(scene.body->mass_kg, 0.06);
  EXPECT_FALSE(scene.body->l_m) << "a track made with l given proves nothing";
  EXPECT_FALSE(scene.start.theta_rad);
  ASSERT_EQ(scene.body->marks.size(), 1u);
  EXPECT_TRUE(scene.body->marks[0].on_upper_face);
  EXPECT_FALSE(scene.body->marks[0].on_lower_face);
  EXPECT_EQ(scene.support.kind, SupportKind::pivot);
  EXPECT_EQ(scene.support.pivot_m, Eigen::Vector3d(0.004, -0.003, 0.025));
  EXPECT_EQ(scene.model.name, "top");
}

TEST(ObjectFile, OfARingSpellsItsSizesDifferently) {
  const TestFolder folder;
  const Scene scene = read_object(folder.write(
      "object.json",
      R"({"type": "ring", "R_outer_m": 0.045, "R_inner_m": 0.0375, "height_m": 0.012})"));
  EXPECT_EQ(scene.body->kind, BodyKind::ring);
  EXPECT_EQ(scene.body->inner_radius_m, 0.0375);
  EXPECT_EQ(scene.body->thickness_m, 0.012);
  EXPECT_EQ(scene.support.kind, SupportKind::floor);
}

TEST(ObjectFile, WithBrokenEntriesIsRefusedByKey) {
  const TestFolder folder;
  const auto message = [&](const std::string& text) {
    const auto path = folder.write("object.json", text);
    return refusal([&] { static_cast<void>(read_object(path)); });
  };
  EXPECT_NE(message("{}").find("\"type\""), std::string::npos);
  EXPECT_NE(message(R"({"type": "cube"})").find("disc or ring"), std::string::npos);
  EXPECT_NE(message(R"({"type": "disc"})").find("R_m"), std::string::npos);
  EXPECT_NE(message(R"({"type": "disc", "R_m": -1})").find("greater than 0"), std::string::npos);
  EXPECT_NE(message(R"({"type": "ring", "R_m": 1})").find("R_inner_m"), std::string::npos);
  EXPECT_NE(message(R"({"type": "disc", "R_m": 1, "markers": [3]})").find("markers"),
            std::string::npos);
  EXPECT_NE(message(R"({"type": "disc", "R_m": 1, "pivot_m": [1, 2]})").find("list of 3"),
            std::string::npos);
}

TEST(ObjectFile, IsHeldToTheRulesOfTheScene) {
  const TestFolder folder;
  const auto message = [&](const std::string& text) {
    const auto path = folder.write("object.json", text);
    return refusal([&] { static_cast<void>(read_object(path)); });
  };
  EXPECT_NE(message(R"({"type": "disc", "R_m": 45})").find("at most 10"), std::string::npos);
  EXPECT_NE(message(R"({"type": "disc", "R_m": 0.03, "thickness_m": 12})").find("0 to 10"),
            std::string::npos);
  EXPECT_NE(message(R"({"type": "disc", "R_m": 0.03, "axle_radius_m": 0.04})")
                .find(R"("axle_radius_m" = 0.04 must be smaller than "R_m" = 0.03)"),
            std::string::npos);
  EXPECT_NE(message(R"({"type": "ring", "R_outer_m": 0.03, "R_inner_m": 0.04})")
                .find(R"("R_inner_m" = 0.04 must not exceed "R_outer_m" = 0.03)"),
            std::string::npos);
  EXPECT_NE(message(R"({"type": "disc", "R_m": 0.03, "R_border_m": 0.03})")
                .find(R"("R_border_m" = 0.03 must lie between)"),
            std::string::npos);
  EXPECT_NE(
      message(R"({"type": "disc", "R_m": 0.03, "markers": [{"r_m": 0.05, "radius_m": 0.004}]})")
          .find(R"(the mark's "r_m" = 0.05 lies outside "R_m" = 0.03)"),
      std::string::npos);
}

}  // namespace
}  // namespace trochoid::data
