#include "draw/plot.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "draw/trajectory_plots.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

TEST(Plot, NoLineIsDrawnAcrossATurn) {
  Series angle;
  angle.x = Eigen::Vector4d(0.0, 1.0, 2.0, 3.0);
  angle.y = Eigen::Vector4d(2.0, 3.0, -3.0, -2.0);
  const Series broken = with_gaps_at_turns(angle);
  ASSERT_EQ(broken.y.size(), 5);
  EXPECT_TRUE(std::isnan(broken.y[2]));
  EXPECT_EQ(broken.y[1], 3.0);  // no point is lost
  EXPECT_EQ(broken.y[3], -3.0);
}

/// Names of the plots of a body that moves along x at this height.
std::vector<std::string> plots_of(double speed_m_s, double rise_m_s) {
  data::Table table;
  table.columns = {"t_s", "x_m", "y_m", "z_m"};
  table.values.resize(9, 4);
  for (int i = 0; i < 9; ++i)
    table.values.row(i) << i, 0.1 + speed_m_s * i, 0.3, 0.002 + rise_m_s * i;
  const auto folder = std::filesystem::path(testing::TempDir()) / "trochoid_plots";
  std::vector<std::string> names;
  for (const auto& file : write_trajectory_plots(table, "moved", folder))
    names.push_back(file.stem().string());
  return names;
}

// A disc on a pin has no path, a puck none from the side.
TEST(Plot, WhatDoesNotMoveIsNotDrawn) {
  EXPECT_EQ(plots_of(0.0, 0.0), std::vector<std::string>{});
  EXPECT_EQ(plots_of(0.5, 0.0), std::vector<std::string>{"path_xy"});
  EXPECT_EQ(plots_of(0.5, 0.1), (std::vector<std::string>{"path_xy", "path_xz"}));
}

}  // namespace
}  // namespace trochoid::tools
