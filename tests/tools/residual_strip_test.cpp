#ifdef TROCHOID_HAS_TRACKING
#include "draw/residual_strip.hpp"

#include <gtest/gtest.h>

#include "draw/canvas.hpp"

namespace trochoid::tools {
namespace {

/// Pucks that slide at 1 m/s with next to no friction, each a micrometre off by turns.
OverlayInput sliding_pucks(int count) {
  OverlayInput input;
  data::Fit fit;
  fit.model = "puck";
  fit.converged = true;
  fit.scene_toml =
      "[body]\nradius_m = 0.03\nthickness_m = 0.006\nmass_kg = 0.05\n[support]\nkind = \"flat\"\n"
      "[model]\nname = \"puck\"\nfriction = 1e-9\n";
  for (int object = 0; object < count; ++object) {
    data::Track& track = input.tracks.tracks.emplace_back();
    track.object = object;
    for (int i = 0; i < 20; ++i) {
      data::TrackSample& sample = track.samples.emplace_back();
      sample.frame = i;
      sample.t_s = 0.01 * i;
      sample.centre_m = {sample.t_s, i % 2 == 0 ? 1e-6 : -1e-6};
      sample.centre_px = {100.0 + i, 50.0};
      sample.covariance_m2 = 1e-12 * Eigen::Matrix2d::Identity();
    }
    data::FitParameter& speed = fit.parameters.emplace_back();
    speed.name = object == 0 ? "vx_m_s" : "vx_m_s@1";
    speed.value = 1.0;
    fit.arcs.push_back(
        {.track = object, .object = object, .from_s = 0.0, .to_s = 0.2, .samples = 20});
  }
  input.fit = fit;
  return input;
}

constexpr double kText_px = 10.0;

int height_px(int pucks) {
  const OverlayContent content(sliding_pucks(pucks), 640, 480);
  EXPECT_TRUE(content.has_prediction());
  return ResidualStrip(content, 0.0, 0.2, 700, kText_px).height_px();
}

TEST(ResidualStrip, TheWordsOfASecondRowDoNotLieOnTheFirst) {
  constexpr double kRow = 8.0, kWords = 2.0;  // heights of a capital: the plot, words and gaps
  EXPECT_GE(height_px(2) - height_px(1), (kRow + kWords) * kText_px);
}

TEST(ResidualStrip, WordsAndKeyHaveRoomBesideEachOtherHoweverNarrow) {
  for (const std::string name : {"", "object 12: "})
    for (double width_px = 250.0; width_px < 1400.0; width_px += 50.0) {
      const RowCaption caption = row_caption(name, 0.0898, width_px, kText_px);
      EXPECT_LE(caption.width_px(kText_px), width_px) << caption.words << caption.bands;
      EXPECT_TRUE(caption.words.starts_with(name));
    }
  EXPECT_EQ(row_caption("", 0.0898, 1400.0, kText_px).bands, "bands: 1, 2 sigma");
}

}  // namespace
}  // namespace trochoid::tools
#endif
