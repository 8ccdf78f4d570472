#include "link/expectation.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "geometry/pose_change.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/interpolate.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using Pose = data::Pose<>;

/// Where neighbours at a and b (and those before and after them) put the body at time t.
struct Neighbours {
  const Glimpse &before, &a, &b, &after;

  [[nodiscard]] double frame_s() const {
    return (b.frame->t_s - a.frame->t_s) / static_cast<double>(b.frame->index - a.frame->index);
  }
  [[nodiscard]] Pose at(double t_s, bool alike) const {
    constexpr double kSlowTurn_rad = 0.5;  // per frame: the axis draws a smooth curve
    constexpr double kNearlyUpright = 0.35;
    const std::vector<double> times = moments();
    const std::vector<Pose> poses = in_one_reading(alike);
    const double ta = a.frame->t_s, tb = b.frame->t_s, share = (t_s - ta) / (tb - ta);
    Pose pose = a.pose();
    const Pose& to = poses[static_cast<std::size_t>(&before != &a) + 1];
    std::vector<Eigen::Vector3d> centres;
    std::vector<Eigen::Vector2d> level;  // parts of the axis
    for (const Pose& p : poses) {
      centres.push_back(p.centre_m);
      level.emplace_back(axis_of(p).head<2>());
    }
    // Whatever rolls on its rim runs in circles: a chord would lead inside.
    pose.centre_m = data::polynomial_at<Eigen::Vector3d>(times, centres, t_s);
    const bool upright = axis_of(pose).z() >= 0.0;
    const double early = rate_between(before, a, alike), late = rate_between(b, after, alike);
    const bool slow = std::max(std::abs(early), std::abs(late)) * frame_s() < kSlowTurn_rad;
    if (goes_on(level) || (slow && std::min(level_of(pose), level_of(to)) < kNearlyUpright)) {
      const Eigen::Vector2d n = data::polynomial_at<Eigen::Vector2d>(times, level, t_s);
      const double z = std::sqrt(std::max(0.0, 1.0 - n.squaredNorm()));
      set_axis(Eigen::Vector3d(n.x(), n.y(), upright ? z : -z).normalized(), pose);
      return pose;
    }
    const double turns =
        std::round((0.5 * (early + late) * (tb - ta) - (to.phi_rad - pose.phi_rad)) / data::kTurn);
    pose.theta_rad += share * (to.theta_rad - pose.theta_rad);
    pose.phi_rad += share * (to.phi_rad - pose.phi_rad + turns * data::kTurn);
    return pose;
  }

 private:
  static double level_of(const Pose& pose) { return std::sin(pose.theta_rad); }
  [[nodiscard]] std::vector<double> moments() const {
    std::vector<double> times;
    if (&before != &a) times.push_back(before.frame->t_s);
    times.insert(times.end(), {a.frame->t_s, b.frame->t_s});
    if (&after != &b) times.push_back(after.frame->t_s);
    return times;
  }
  [[nodiscard]] std::vector<Pose> in_one_reading(bool alike) const {
    std::vector<Pose> poses;
    if (&before != &a) poses.push_back(before.pose());
    poses.insert(poses.end(), {a.pose(), b.pose()});
    if (&after != &b) poses.push_back(after.pose());
    for (Pose& pose : poses)
      if (alike) pose = nearer_face(pose, a.pose(), 0.0);
    return poses;
  }
  /// The axis moves on in about one direction, be it through the vertical, where tilt and
  /// precession do not; not so where it turns by much of a round from frame to frame.
  static bool goes_on(const std::vector<Eigen::Vector2d>& level) {
    constexpr double kStill = 0.02;
    for (std::size_t k = 2; k < level.size(); ++k) {
      const Eigen::Vector2d first = level[k - 1] - level[k - 2], then = level[k] - level[k - 1];
      if (std::max(first.norm(), then.norm()) < kStill) continue;
      if (first.dot(then) < 0.0) return false;
    }
    return true;
  }
  static double rate_between(const Glimpse& from, const Glimpse& to, bool alike) {
    const double step_s = to.frame->t_s - from.frame->t_s;
    if (step_s <= 0.0) return 0.0;
    Pose end = to.pose();
    if (alike) end = nearer_face(end, from.pose(), 0.0);
    return data::wrapped(end.phi_rad - from.pose().phi_rad) / step_s;
  }
};

/// The pairs of frames, one on either side of frame i and at most a few frames off, nearest first;
/// at an end of the recording the two nearest lead beyond themselves.
/// @param but frames that do not count.
std::vector<Neighbours> pairs_around(const std::vector<Glimpse>& glimpses, std::size_t i,
                                     const std::vector<bool>& but) {
  constexpr std::size_t kFarthest = 6, kSide = 3;
  std::vector<const Glimpse*> before, after;
  for (std::size_t k = 1; k <= kFarthest && k <= i && before.size() <= kSide; ++k)
    if (glimpses[i - k].posed() && !but[i - k]) before.push_back(&glimpses[i - k]);
  for (std::size_t k = 1; k <= kFarthest && i + k < glimpses.size() && after.size() <= kSide; ++k)
    if (glimpses[i + k].posed() && !but[i + k]) after.push_back(&glimpses[i + k]);
  if (before.empty() && after.size() > 1) return {{*after[0], *after[0], *after[1], *after[1]}};
  if (after.empty() && before.size() > 1) return {{*before[0], *before[0], *before[1], *before[1]}};
  std::vector<Neighbours> pairs;
  for (std::size_t span = 0; span < 2 * kSide - 1; ++span)
    for (std::size_t k = 0; k <= span; ++k) {
      const std::size_t l = span - k;
      if (k >= std::min(kSide, before.size()) || l >= std::min(kSide, after.size())) continue;
      pairs.push_back({*before[std::min(k + 1, before.size() - 1)], *before[k], *after[l],
                       *after[std::min(l + 1, after.size() - 1)]});
    }
  return pairs;
}

/// Value at time 0 of the parabola that fits values at these times best.
template <class Value>
Value led_to(const std::vector<double>& times, const std::vector<Value>& values) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  for (const double t : times) {
    const Eigen::Vector3d row(1.0, t, t * t);
    normal += row * row.transpose();
  }
  const Eigen::Vector3d first = normal.ldlt().solve(Eigen::Vector3d::UnitX());
  Value sum = 0.0 * values[0];
  for (std::size_t k = 0; k < times.size(); ++k)
    sum += first.dot(Eigen::Vector3d(1.0, times[k], times[k] * times[k])) * values[k];
  return sum;
}

}  // namespace

std::vector<bool> poor_fits(const std::vector<Glimpse>& glimpses) {
  constexpr std::size_t kReach = 12, kFewest = 8;
  constexpr double kOfUsual = 0.05, kDeviations = 2.5 * 1.48;
  std::vector<bool> poor(glimpses.size(), false);
  std::vector<double> around, off;
  for (std::size_t i = 0; i < glimpses.size(); ++i) {
    if (!glimpses[i].posed()) continue;
    around.clear(), off.clear();
    for (std::size_t k = i - std::min(i, kReach); k < std::min(glimpses.size(), i + kReach + 1);
         ++k)
      if (const Glimpse& g = glimpses[k]; g.posed()) around.push_back(g.seen->visible_support_px());
    if (around.size() < kFewest) continue;
    const double usual = data::median(around);
    for (const double value : around) off.push_back(std::abs(value - usual));
    poor[i] = glimpses[i].seen->visible_support_px() <
              usual - std::max(kOfUsual * usual, kDeviations * data::median(off));
  }
  return poor;
}

bool Expected::same_as(const Expected& other) const {
  const auto same = [](const Pose& a, const Pose& b) {
    return a.centre_m == b.centre_m && a.theta_rad == b.theta_rad && a.phi_rad == b.phi_rad;
  };
  return same(seen.pose->pose, other.seen.pose->pose) && same(earlier, other.earlier) &&
         spread_rad == other.spread_rad;
}

double off_rad(const Sighting& seen, const Sighting& expected, bool alike) {
  return std::max(
      between_axes(axis_of(seen.pose->pose), axis_of(expected.pose->pose), alike),
      2.0 * (seen.centre_px - expected.centre_px).norm() / expected.rim.semi_major_px());
}

std::optional<Expected> expected_at(const BodyFinder& finder, const std::vector<Glimpse>& glimpses,
                                    std::size_t i, const std::vector<bool>& but) {
  const bool alike = finder.faces_look_alike();
  const std::vector<Neighbours> pairs = pairs_around(glimpses, i, but);
  if (pairs.empty()) return std::nullopt;
  const double t_s = glimpses[i].frame->t_s;
  std::vector<Sighting> said;
  for (const Neighbours& pair : pairs) {
    said.push_back(*pair.a.seen);
    said.back().pose->pose = pair.at(t_s, alike);
    finder.place(said.back());
  }
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity(), spread = 0.0;
  for (std::size_t k = 0; k < said.size(); ++k) {
    std::vector<double> apart;
    for (std::size_t l = 0; l < said.size(); ++l)
      if (l != k) apart.push_back(off_rad(said[l], said[k], alike));
    const double sum = std::accumulate(apart.begin(), apart.end(), 0.0);
    if (sum >= least) continue;
    best = k, least = sum, spread = apart.empty() ? 0.0 : data::median(apart);
  }
  // Of those that agree the nearest in time knows best.
  for (std::size_t k = 0; k < best; ++k) {
    if (off_rad(said[k], said[best], alike) > spread) continue;
    best = k;
    break;
  }
  const Neighbours& pair = pairs[best];
  return Expected{said[best], pair.at(t_s - pair.frame_s(), alike), spread};
}

UsualMiss::UsualMiss(const BodyFinder& finder, const std::vector<Glimpse>& glimpses) {
  const std::vector<bool> none(glimpses.size(), false);
  std::vector<double> off;
  for (std::size_t i = 0; i < glimpses.size(); ++i) {
    if (!glimpses[i].posed()) continue;
    if (const auto expected = expected_at(finder, glimpses, i, none))
      off.push_back(off_rad(*glimpses[i].seen, expected->seen, finder.faces_look_alike()));
  }
  if (!off.empty()) off_rad_ = data::median(std::move(off));
}

std::optional<Sighting> led_to(const BodyFinder& finder, const std::vector<Glimpse>& glimpses,
                               std::size_t i, int side) {
  constexpr int kFrames = 5;
  std::vector<double> steps;
  std::vector<Eigen::Vector3d> centres, axes;
  const Glimpse* nearest = nullptr;
  for (int step = 1; step <= kFrames; ++step) {
    const auto k = static_cast<std::ptrdiff_t>(i) + side * step;
    if (k < 0 || k >= std::ssize(glimpses)) return std::nullopt;
    const Glimpse& g = glimpses[static_cast<std::size_t>(k)];
    if (!g.posed()) return std::nullopt;
    if (nearest == nullptr) nearest = &g;
    steps.push_back((g.frame->t_s - glimpses[i].frame->t_s) /
                    std::abs(nearest->frame->t_s - glimpses[i].frame->t_s));
    centres.push_back(g.pose().centre_m);
    axes.push_back(axis_of(g.pose()));
    if (finder.faces_look_alike() && axes.back().dot(axes.front()) < 0.0) axes.back() *= -1.0;
  }
  Sighting expected = *nearest->seen;
  expected.pose->pose.centre_m = led_to(steps, centres);
  set_axis(led_to(steps, axes).normalized(), expected.pose->pose);
  finder.place(expected);
  return expected;
}

bool is_led_to(const BodyFinder& finder, const std::vector<Glimpse>& glimpses, std::size_t i,
               double within_rad) {
  const auto leads = [&](int side) {
    const auto expected = led_to(finder, glimpses, i, side);
    return expected &&
           off_rad(*glimpses[i].seen, *expected, finder.faces_look_alike()) < within_rad;
  };
  return leads(1) || leads(-1);
}

}  // namespace trochoid::tracking
