#include "link/chroma_site.hpp"

#include <gtest/gtest.h>

#include "drawn_shadow.hpp"
#include "glimpsed_sequence.hpp"

namespace trochoid::tracking {
namespace {

/// Sees colours off by where their samples are taken to lie beside where they do, and a little that
/// the light does to luma.
class ColourOracle final : public Oracle {
 public:
  ColourOracle(const Eigen::Array2d& site_px, const Eigen::Array2d& light_px, double information)
      : Oracle([](int) { return 0.0; }),
        site_px_(site_px),
        light_px_(light_px),
        information_(information) {}

  [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
    auto seen = Oracle::find(look);
    seen->pose->colour_off_px = off_px(look.background.chroma_site_px);
    seen->pose->colour_information.setConstant(information_);
    return seen;
  }
  [[nodiscard]] Eigen::Array2d off_px(const Eigen::Vector2d& taken_px) const {
    return taken_px.array() - site_px_ + light_px_;
  }

 private:
  Eigen::Array2d site_px_, light_px_;
  double information_;
};

class ChromaSite : public GlimpsedSequence {
 protected:
  std::optional<Eigen::Vector2d> found(const Eigen::Array2d& site_px,
                                       const Eigen::Array2d& light_px = {0.0, 0.0},
                                       double information = 100.0) {
    const ColourOracle finder(site_px, light_px, information);
    background_ = Background::from_samples({{drawn_floor()}, {}});
    for (Frame& frame : frames_) frame.luma = drawn_floor();
    auto all = tracked(finder, [](int) { return false; });
    for (Glimpse& g : all) {
      finder.place(*g.seen);
      g.seen->pose->colour_off_px = finder.off_px(Eigen::Vector2d::Zero());
      g.seen->pose->colour_information.setConstant(information);
    }
    return find_chroma_site(background_, finder, all);
  }
};

// As most cameras code, also of recordings turned by a quarter.
TEST_F(ChromaSite, SamplesThatLieAsideAreFound) {
  for (const Eigen::Vector2d& site_px :
       {Eigen::Vector2d(-0.5, 0.0), Eigen::Vector2d(0.0, 0.5), Eigen::Vector2d(-0.5, -0.5)}) {
    const auto site = found(site_px.array(), {0.1, 0.05});
    ASSERT_TRUE(site);
    EXPECT_EQ(*site, site_px);
  }
}

// Light shifts edges of luma by tenths of a pixel at most.
TEST_F(ChromaSite, WhatLightDoesToLumaIsNotTakenForIt) {
  const auto site = found({0.0, 0.0}, {0.15, -0.1});
  ASSERT_TRUE(site);
  EXPECT_EQ(*site, Eigen::Vector2d(0.0, 0.0));
}

TEST_F(ChromaSite, IsNotToldByBodiesWithoutColour) {
  EXPECT_FALSE(found({-0.5, 0.0}, {0.0, 0.0}, 0.0));
}

}  // namespace
}  // namespace trochoid::tracking
