#include "judge/straying.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "observe/arcs.hpp"
#include "observe/segments.hpp"
#include "observe/smoothing.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::fitting {
namespace {

// Where a body's centre is seen while it turns freely.
struct Places {
  std::vector<double> t_s;
  Eigen::MatrixX2d xy_m;
  std::vector<double> sigmas_m;  // where they are stated
};

Places places_of(const data::Track& track, const FitOptions& options) {
  SampleRange range = chosen_range(track, options.from, options.to);
  if (options.from.empty()) range.first = released_at(track, range);
  Places places;
  std::vector<Eigen::Vector2d> seen_m;
  for (int i = range.first; i < range.second; ++i) {
    const data::TrackSample& sample = track.samples[static_cast<std::size_t>(i)];
    if (!sample.has_metres()) continue;
    places.t_s.push_back(sample.t_s);
    seen_m.push_back(sample.centre_m);
    if (sample.has_covariance())
      places.sigmas_m.push_back(std::sqrt(0.5 * sample.covariance_m2.trace()));
  }
  places.xy_m.resize(static_cast<Eigen::Index>(seen_m.size()), 2);
  for (std::size_t i = 0; i < seen_m.size(); ++i)
    places.xy_m.row(static_cast<Eigen::Index>(i)) = seen_m[i].transpose();
  return places;
}

// The distance from their middle that nine tenths of them keep: a tracker's glitches are fewer.
double reach_m(const Places& places) {
  constexpr double kMost = 0.9;
  if (places.t_s.empty()) return 0.0;
  Eigen::RowVector2d middle_m;
  for (const int axis : {0, 1}) {
    const auto along = places.xy_m.col(axis);
    middle_m[axis] = data::median({along.begin(), along.end()});
  }
  const Eigen::VectorXd away_m = (places.xy_m.rowwise() - middle_m).rowwise().norm();
  return data::quantile({away_m.begin(), away_m.end()}, kMost);
}

// Of a coordinate: as stated, else the scatter about a smooth curve.
double usual_sigma_m(const Places& places) {
  if (!places.sigmas_m.empty()) return data::median(places.sigmas_m);
  return std::min(noise_about_smooth_curve(places.t_s, places.xy_m),
                  white_noise(places.t_s, places.xy_m));
}

}  // namespace

double straying_m(std::span<const data::Track> tracks, const FitOptions& options) {
  double most_m = 0.0;
  for (const data::Track& track : tracks)
    most_m = std::max(most_m, reach_m(places_of(track, options)));
  return most_m;
}

bool leaves_pivot(std::span<const data::Track> tracks, const data::Scene& scene,
                  const FitOptions& options) {
  // The scatter of nine tenths keeps within 2.1 sigmas.
  constexpr double kSigmas = 7.0, kOfRadius = 0.07;
  const double radius_m = scene.body ? scene.body->radius_m : 0.0;
  return std::any_of(tracks.begin(), tracks.end(), [&](const data::Track& track) {
    const Places places = places_of(track, options);
    return reach_m(places) > std::max(kSigmas * usual_sigma_m(places), kOfRadius * radius_m);
  });
}

}  // namespace trochoid::fitting
