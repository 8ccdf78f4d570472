#include <gtest/gtest.h>

#include <cmath>

#include "report/parts.hpp"

namespace trochoid::tools {
namespace {

// Each body of a recording is a track of its own to a fit.
TEST(ReportDynamics, ShowsTheEnergyOfEveryBodyOfARecording) {
  data::Fit fit;
  fit.model = "rolling";
  fit.scene_toml = R"([body]
kind = "disc"
radius_m = 0.0375
thickness_m = 0.006
mass_kg = 0.07
[support]
kind = "floor"
[model]
name = "rolling"
)";
  const auto add = [&](const char* name, double value) {
    fit.parameters.push_back({.name = name, .value = value, .unit = "", .note = {}});
  };
  add("theta_rad", 0.5);
  add("w2_rad_s", 15.0);
  add("theta_rad@1", 0.8);
  add("w2_rad_s@1", 20.0);
  ReportInput input;
  for (const int body : {0, 1}) {
    fit.arcs.push_back({.track = body, .object = body, .from_s = 0.0, .to_s = 0.2, .samples = 3});
    data::Track track;
    track.object = body;
    for (const double t_s : {0.0, 0.1, 0.2}) {
      track.samples.emplace_back();
      track.samples.back().t_s = t_s;
    }
    input.tracks.tracks.push_back(track);
  }
  input.fit = fit;
  const std::vector<double> times_s{0.0, 0.1, 0.2};
  std::vector<double> energies_mJ;
  for (const data::Track& track : input.tracks.tracks) {
    const std::vector<DynamicsChart> charts = dynamics_of(input, track, times_s);
    ASSERT_FALSE(charts.empty()) << "object " << track.object;
    EXPECT_EQ(charts[0].label, "energy [mJ]");
    energies_mJ.push_back(charts[0].values[1]);
  }
  EXPECT_GT(energies_mJ[0], 0.0);
  EXPECT_GT(energies_mJ[1], energies_mJ[0]);  // steeper, and faster
}

}  // namespace
}  // namespace trochoid::tools
