#include "judge/straying.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "observe/smoothing.hpp"

namespace trochoid::fitting {

double straying_m(std::span<const data::Track> tracks) {
  double squares = 0.0, rows = 0.0;
  for (const data::Track& track : tracks) {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    double count = 0.0;
    for (const data::TrackSample& sample : track.samples)
      if (sample.has_metres()) mean += sample.centre_m, count += 1.0;
    if (count == 0.0) continue;
    mean /= count;
    for (const data::TrackSample& sample : track.samples)
      if (sample.has_metres()) squares += (sample.centre_m - mean).squaredNorm();
    rows += 2.0 * count;
  }
  return rows > 0.0 ? std::sqrt(squares / rows) : 0.0;
}

bool leaves_pivot(std::span<const data::Track> tracks, const data::Scene& scene) {
  std::vector<double> sigmas_m;
  for (const data::Track& track : tracks)
    for (const data::TrackSample& sample : track.samples)
      if (sample.has_covariance())
        sigmas_m.push_back(std::sqrt(0.5 * sample.covariance_m2.trace()));
  const double radius_m = scene.body ? scene.body->radius_m : 0.0;
  return straying_m(tracks) > std::max(5.0 * median_or_zero(std::move(sigmas_m)), 0.05 * radius_m);
}

}  // namespace trochoid::fitting
