#include "link/lying.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using Pose = data::Pose<>;
constexpr double kAround_s = 0.1;  // a frame is judged with those so near

/// The frames within a tenth of a second of frame i.
struct Window {
  std::size_t from, to;

  Window(const std::vector<Glimpse>& glimpses, std::size_t i) : from(i), to(i + 1) {
    const double t_s = glimpses[i].frame->t_s;
    while (from > 0 && t_s - glimpses[from - 1].frame->t_s <= kAround_s) --from;
    while (to < glimpses.size() && glimpses[to].frame->t_s - t_s <= kAround_s) ++to;
  }
};

/// Whether the axis hardly changes its direction around frame i: at the slowest, a steady tilt of
/// 45 degrees precesses by about a radian in the time looked at, flatter ones faster.
bool axis_stays(const std::vector<Glimpse>& glimpses, std::size_t i) {
  constexpr std::size_t kFewest = 5;
  constexpr double kSteepest = 0.7, kOfTilt = 0.25, kLeast = 0.03, kLeastSpan_s = 0.8 * kAround_s;
  const Window window(glimpses, i);
  std::vector<double> x, y, off;
  for (std::size_t k = window.from; k < window.to; ++k) {
    if (!glimpses[k].posed()) continue;
    const Eigen::Vector3d axis = axis_of(glimpses[k].pose());
    const double up = axis.z() < 0.0 ? -1.0 : 1.0;
    x.push_back(up * axis.x()), y.push_back(up * axis.y());
  }
  if (x.size() < kFewest) return false;
  const double span_s = glimpses[window.to - 1].frame->t_s - glimpses[window.from].frame->t_s;
  if (span_s < kLeastSpan_s) return false;
  const Eigen::Vector2d middle(data::median(x), data::median(y));
  for (std::size_t k = 0; k < x.size(); ++k)
    off.push_back((Eigen::Vector2d(x[k], y[k]) - middle).norm());
  return middle.norm() < kSteepest &&
         data::median(std::move(off)) < std::max(kLeast, kOfTilt * middle.norm());
}

Pose lying(Pose pose) {
  pose.theta_rad = data::lying_theta_rad(pose.theta_rad);
  pose.phi_rad = 0.0;
  return pose;
}

/// The same body lying there one frame before or after frame i.
std::optional<Beside> neighbour(const std::vector<Glimpse>& glimpses, std::size_t i) {
  for (const std::size_t k : {i - 1, i + 1})
    if (k < glimpses.size() && glimpses[k].posed())
      return Beside{lying(glimpses[k].pose()), k < i ? 1 : -1};
  return std::nullopt;
}

}  // namespace

void measure_what_lies(const Background& background, const BodyFinder& finder,
                       std::vector<Glimpse>& glimpses) {
  constexpr double kAsGood = 0.9;         // a tilt is free to follow the shadow's edge as well
  constexpr double kFlatness_rad = 0.01;  // of a floor
  const BodyFinder* lying_finder = finder.lying();
  if (lying_finder == nullptr) return;
  std::vector<std::optional<Sighting>> found(glimpses.size());
  on_all_cores(background, *lying_finder, glimpses.size(), [&](Measuring& measure, std::size_t i) {
    if (!glimpses[i].posed() || !axis_stays(glimpses, i)) return;
    Sighting guess = *glimpses[i].seen;
    const Surroundings surroundings = surroundings_of(glimpses, i);
    guess.pose->pose = lying(guess.pose->pose);
    guess.pose->blur_px = surroundings.blur_px;
    auto seen = measure(*glimpses[i].frame, std::move(guess), neighbour(glimpses, i),
                        &surroundings.shading);
    if (seen && seen->pose) found[i] = std::move(seen);
  });
  const std::vector<Glimpse> was = glimpses;
  for (std::size_t i = 0; i < was.size(); ++i) {
    if (!found[i]) continue;
    double lies = 0.0, tilts = 0.0;
    const Window window(was, i);
    for (std::size_t k = window.from; k < window.to; ++k) {
      if (!found[k]) continue;
      const Sighting& seen = *was[k].seen;
      lies += found[k]->pose->score_px() * std::exp(shadow_log_score_ratio(*found[k], seen));
      tilts += seen.pose->score_px();
    }
    if (lies < kAsGood * tilts) continue;
    found[i]->turned_rad = was[i].seen->turned_rad;
    found[i]->pose->sigma_theta_rad = kFlatness_rad;
    glimpses[i].seen = std::move(found[i]);
  }
}

}  // namespace trochoid::tracking
