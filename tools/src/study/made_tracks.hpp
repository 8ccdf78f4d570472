#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"

namespace trochoid::tools {

/// A recording that could have been: what a fit is told, and the truth it is not.
struct MadeTrack {
  data::Scene scene;  ///< body and model, no start
  data::Track track;
  std::map<std::string, double> truth;  ///< by parameter name
  std::vector<std::string> judged;      ///< the parameters one measures for
  double chi2_of_truth = 0.0;           ///< of the noise put in
};

/// What is asked of made tracks.
struct MadeTrackOptions {
  std::string model = "top";  ///< top | thesis | rolling | puck
  double noise = 0.01;  ///< standard deviation of a position over the body's length (l or radius)
  double duration_s = 0.0;  ///< 0: by the scene (2.5 nutations of a top)
  double rate_hz = 100.0;   ///< of the samples when a duration is given
};

/// Draws a scene and its noisy track, simulated by SUNDIALS from equations of motion of its own or
/// at a tolerance far below the noise, never by the integrator that fits it.
///   top      b log-uniform 0.5..40 1/s of either sign, a/b^2 log-uniform 0.015..0.75, tilt
///   0.25..1.2
///            rad, rates within 0.3 |b|, l log-uniform 10..200 mm; 150 samples over 2.5 nutations;
///            scenes from which l cannot be told to 10 % (Cramer-Rao) are drawn again
///   thesis   the thesis' base case (a = 0.098, b = 0.75, l = 0.1, released at 60 deg), 10 s
///   rolling  discs and rings of 15..50 mm near steady rolling, tilt 0.6..1.3 rad, with an air
///            couple of 0.1..1 % of m sqrt(g R^3); 150 samples over 8 turns of the node line
///   puck     sliding and spinning flat on the face, friction 0.05..0.4, spin angle seen to 1 deg
/// @throws InputError for an unknown model.
[[nodiscard]] MadeTrack make_track(const MadeTrackOptions& options, std::mt19937_64& generator);

/// Of the draws of one scene: scenes are independent of each other and of the order in which
/// threads take them.
[[nodiscard]] std::mt19937_64 generator_of(std::uint64_t seed, int scene);

/// A start that is 30-50 % off in every parameter (0.3-0.5 where the truth is zero).
[[nodiscard]] std::map<std::string, double> start_off(const MadeTrack& made,
                                                      std::mt19937_64& generator);

}  // namespace trochoid::tools
