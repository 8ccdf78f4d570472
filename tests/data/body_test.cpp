#include "trochoid/data/body.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace trochoid::data {
namespace {

SpinMark mark_at(double angle_rad, bool upper, bool lower) {
  return {.distance_m = 0.02,
          .size_m = 0.004,
          .angle_rad = angle_rad,
          .on_upper_face = upper,
          .on_lower_face = lower};
}

Body disc() {
  Body body;
  body.radius_m = 0.03;
  return body;
}

TEST(FacesLookAlike, OnAPlainBodyAndWithOneMarkOnBothFaces) {
  Body body = disc();
  EXPECT_TRUE(body.faces_look_alike());
  body.marks = {mark_at(0.7, true, true)};
  EXPECT_TRUE(body.faces_look_alike());
}

TEST(FacesLookAlike, NotWithAMarkOnOneFaceOrAnAxleOutOfOne) {
  Body body = disc();
  body.marks = {mark_at(0.0, true, false)};
  EXPECT_FALSE(body.faces_look_alike());
  body.marks.clear();
  body.axle_above_m = 0.01;
  EXPECT_FALSE(body.faces_look_alike());
}

TEST(FacesLookAlike, WithSeveralMarksOnlyIfTurningOverMapsThemOntoEachOther) {
  Body body = disc();
  // A mirror-symmetric pattern on both faces turns over into itself; three marks without a mirror
  // line (different sizes) do not.
  body.marks = {mark_at(0.0, true, true), mark_at(1.0, true, true)};
  EXPECT_TRUE(body.faces_look_alike());
  body.marks.push_back(mark_at(2.5, true, true));
  body.marks[1].size_m = 0.002;
  body.marks[2].size_m = 0.006;
  EXPECT_FALSE(body.faces_look_alike());
  // One mark above and one below at any two angles: there is always a diameter to turn about.
  body.marks = {mark_at(0.3, true, false), mark_at(2.9, false, true)};
  EXPECT_TRUE(body.faces_look_alike());
}

TEST(FacesLookAlike, DoesNotCareForWholeTurns) {
  Body body = disc();
  body.marks = {mark_at(0.0, true, true), mark_at(2.0 * std::numbers::pi, true, true)};
  EXPECT_TRUE(body.faces_look_alike());
}

}  // namespace
}  // namespace trochoid::data
