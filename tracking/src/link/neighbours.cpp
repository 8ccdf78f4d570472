#include "link/neighbours.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "find/forecast.hpp"
#include "geometry/pose_motion.hpp"
#include "trochoid/data/interpolate.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using Pose = data::Pose<>;
constexpr double kTurn = 2.0 * std::numbers::pi;

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
    pose.centre_m = data::through<Eigen::Vector3d>(times, centres, t_s);
    const bool upright = axis_of(pose).z() >= 0.0;
    const double early = rate_between(before, a, alike), late = rate_between(b, after, alike);
    const bool slow = std::max(std::abs(early), std::abs(late)) * frame_s() < kSlowTurn_rad;
    if (goes_on(level) || (slow && std::min(level_of(pose), level_of(to)) < kNearlyUpright)) {
      const Eigen::Vector2d n = data::through<Eigen::Vector2d>(times, level, t_s);
      const double z = std::sqrt(std::max(0.0, 1.0 - n.squaredNorm()));
      set_axis(Eigen::Vector3d(n.x(), n.y(), upright ? z : -z).normalized(), pose);
      return pose;
    }
    const double turns =
        std::round((0.5 * (early + late) * (tb - ta) - (to.phi_rad - pose.phi_rad)) / kTurn);
    pose.theta_rad += share * (to.theta_rad - pose.theta_rad);
    pose.phi_rad += share * (to.phi_rad - pose.phi_rad + turns * kTurn);
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
    return std::remainder(end.phi_rad - from.pose().phi_rad, kTurn) / step_s;
  }
};

/// Frames in which clearly less speaks for the fit than in those around: it may have settled
/// beside the body.
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
      if (const Glimpse& g = glimpses[k]; g.posed()) around.push_back(g.seen->plainness());
    if (around.size() < kFewest) continue;
    const double usual = data::median(around);
    for (const double value : around) off.push_back(std::abs(value - usual));
    poor[i] = glimpses[i].seen->plainness() <
              usual - std::max(kOfUsual * usual, kDeviations * data::median(off));
  }
  return poor;
}

/// Where the frames around one put the body in it.
struct Expected {
  Sighting seen;            ///< placed there
  Pose earlier;             ///< one frame before
  double spread_rad = 0.0;  ///< by how much the frames around usually differ on it

  /// Whether they cannot all be wrong about what was seen this far off.
  /// @param least_rad no contradiction if they agree perfectly.
  [[nodiscard]] bool contradicts(double off_rad, double least_rad) const {
    constexpr double kSpreads = 2.0;
    return off_rad >= least_rad + kSpreads * spread_rad;
  }
  [[nodiscard]] bool same_as(const Expected& other) const {
    const auto same = [](const Pose& a, const Pose& b) {
      return a.centre_m == b.centre_m && a.theta_rad == b.theta_rad && a.phi_rad == b.phi_rad;
    };
    return same(seen.pose->pose, other.seen.pose->pose) && same(earlier, other.earlier) &&
           spread_rad == other.spread_rad;
  }
};

/// How far a sighting is from a pose: in the attitude of the axis, or in place per size of the
/// body.
double off_rad(const Sighting& seen, const Sighting& expected, bool alike) {
  return std::max(
      between_axes(axis_of(seen.pose->pose), axis_of(expected.pose->pose), alike),
      2.0 * (seen.centre_px - expected.centre_px).norm() / expected.rim.semi_major_px());
}

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

/// What most of the pairs of frames around frame i agree on: some of these may be wrong themselves.
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

/// How far frames usually are from what those around them expect: where that is little, less is a
/// contradiction.
class Usual {
 public:
  Usual(const BodyFinder& finder, const std::vector<Glimpse>& glimpses) {
    const std::vector<bool> none(glimpses.size(), false);
    std::vector<double> off;
    for (std::size_t i = 0; i < glimpses.size(); ++i) {
      if (!glimpses[i].posed()) continue;
      if (const auto expected = expected_at(finder, glimpses, i, none))
        off.push_back(off_rad(*glimpses[i].seen, expected->seen, finder.faces_look_alike()));
    }
    if (!off.empty()) off_rad_ = data::median(std::move(off));
  }
  /// So far off a frame is measured again, or doubted.
  [[nodiscard]] double suspicious_rad() const {
    constexpr double kUsuals = 5.0, kLeast_rad = 0.04;
    return std::clamp(kUsuals * off_rad_, kLeast_rad, kMost_rad);
  }
  /// By which the likelihood of being so far off falls.
  [[nodiscard]] double scatter_rad() const {
    constexpr double kUsuals = 4.0, kLeast_rad = 0.03, kMostScatter_rad = 0.15;
    return std::clamp(kUsuals * off_rad_, kLeast_rad, kMostScatter_rad);
  }
  /// However much frames scatter, so far off is a contradiction.
  static constexpr double kMost_rad = 0.2;

 private:
  double off_rad_ = kMost_rad;
};

/// Where a body would have been one frame before `pose`, moving as between its neighbours.
Pose one_frame_before(const Pose& before, const Pose& pose, const Pose& after) {
  Pose earlier = pose;
  const double turn = 0.5 * std::remainder(after.phi_rad - before.phi_rad, kTurn);
  const double turned = std::remainder(pose.phi_rad - before.phi_rad, kTurn) +
                        std::remainder(after.phi_rad - pose.phi_rad, kTurn);
  // More than half a turn in two frames.
  earlier.phi_rad -= std::abs(turned) > 0.5 * kTurn ? 0.5 * turned : turn;
  earlier.theta_rad -= 0.5 * (after.theta_rad - before.theta_rad);
  earlier.centre_m -= 0.5 * (after.centre_m - before.centre_m);
  return earlier;
}

/// As far beyond `to` as that is from `from`.
Pose beyond(const Pose& from, const Pose& to) {
  Pose pose = to;
  pose.phi_rad += std::remainder(to.phi_rad - from.phi_rad, kTurn);
  pose.theta_rad += to.theta_rad - from.theta_rad;
  pose.centre_m += to.centre_m - from.centre_m;
  return pose;
}

/// Where the body of frame i would have been one frame before it; nothing if it is not seen on
/// either side.
std::optional<Pose> one_frame_before(const std::vector<Glimpse>& glimpses, std::size_t i,
                                     bool alike) {
  const Pose& pose = glimpses[i].pose();
  const auto at = [&](std::size_t k) -> std::optional<Pose> {
    if (k >= glimpses.size() || !glimpses[k].posed()) return std::nullopt;
    return alike ? nearer_face(glimpses[k].pose(), pose, 0.0) : glimpses[k].pose();
  };
  const std::optional<Pose> before = at(i - 1), after = at(i + 1);
  if (!before && !after) return std::nullopt;
  return one_frame_before(before ? *before : beyond(*after, pose), pose,
                          after ? *after : beyond(*before, pose));
}

/// Measures a frame again where its neighbours contradict it. Nothing if what was seen stands.
class Mending {
 public:
  /// @param closely see mend_from_neighbours.
  Mending(const BodyFinder& finder, const std::vector<Glimpse>& was, bool closely)
      : finder_(finder),
        was_(was),
        closely_(closely),
        poor_(poor_fits(was)),
        none_(was.size(), false),
        usual_(finder, was) {
    std::vector<double> plain;
    for (const Glimpse& g : was)
      if (g.posed()) plain.push_back(g.seen->plainness());
    usual_plainness_ = data::median(std::move(plain));
  }

  [[nodiscard]] std::optional<Sighting> operator()(Measuring& measure, std::size_t i) const {
    if (was_[i].seen && !was_[i].seen->pose) return std::nullopt;
    Found best;
    // Poor fits may mislead, or be all there is.
    std::optional<Expected> before;
    for (const std::vector<bool>* but : {&poor_, &none_}) {
      auto expected = expected_at(finder_, was_, i, *but);
      // Mostly none around is poor, and what both expect would be measured twice.
      if (!expected || (before && before->same_as(*expected))) continue;
      before = std::move(expected);
      Found found = better(measure, i, *before);
      if (found.seen && found.gain > best.gain) best = std::move(found);
    }
    return std::move(best.seen);
  }

 private:
  struct Found {
    std::optional<Sighting> seen;
    double gain = 0.0;  ///< in likelihood, over what was seen before
  };

  /// How likely it is to be so far from what is expected.
  [[nodiscard]] double likelihood(double off_rad, const Expected& expected) const {
    const double off = off_rad / (usual_.scatter_rad() + expected.spread_rad);
    return 1.0 / (1.0 + off * off);
  }

  /// How many times more speaks for one sighting than for another. From where the body is expected
  /// a close look finds no longer outline of another thing: how plainly it is seen need not count.
  [[nodiscard]] double speaks_for(const Sighting& one, const Sighting& other) const {
    constexpr double kLeast = 1e-9;
    const double plainer = std::max(kLeast, one.accepted) / std::max(kLeast, other.accepted);
    return std::exp(speaks_more(one, other)) * (closely_ ? std::max(plainer, 1.0) : plainer);
  }

  /// Looking right there cannot lead astray: less of a contradiction will do for that.
  [[nodiscard]] bool suspicious(double off_rad, const Expected& expected) const {
    constexpr double kOfSuspicious = 0.1;
    return closely_ ? off_rad >= kOfSuspicious * usual_.suspicious_rad()
                    : expected.contradicts(off_rad, usual_.suspicious_rad());
  }

  /// What is seen in frame i where the body is expected.
  [[nodiscard]] std::optional<Sighting> measured(Measuring& measure, std::size_t i,
                                                 const Expected& expected) const {
    if (!closely_) return measure(*was_[i].frame, expected.seen, expected.earlier);
    const Surroundings surroundings = surroundings_of(was_, i);
    Sighting guess = expected.seen;
    guess.pose->blur_px = surroundings.blur_px;
    return measure(*was_[i].frame, std::move(guess), expected.earlier, &surroundings.shading, true);
  }

  /// What is seen where the body is expected, if that explains frame i better than what it has.
  [[nodiscard]] Found better(Measuring& measure, std::size_t i, const Expected& expected) const {
    constexpr double kUsualShare = 0.5, kAsGood = 0.9, kBetter = 1.05;
    const auto& before = was_[i].seen;
    const bool alike = finder_.faces_look_alike();
    const double off = before ? off_rad(*before, expected.seen, alike) : 0.0;
    if (before && !poor_[i] && !suspicious(off, expected)) return {};
    auto seen = measured(measure, i, expected);
    if (!seen || !seen->pose) return {};
    const double now_off = off_rad(*seen, expected.seen, alike);
    if (expected.contradicts(now_off, Usual::kMost_rad)) return {};
    const double now = likelihood(now_off, expected);
    if (!before) {
      if (seen->plainness() < kUsualShare * usual_plainness_) return {};
      const double likely = now * seen->plainness();
      return {std::move(seen), likely};
    }
    const double more = speaks_for(*seen, *before);
    const double gain = more * now / likelihood(off, expected);
    if (gain < kBetter || more < kAsGood) return {};
    seen->turned_rad = before->turned_rad;
    return {std::move(seen), gain};
  }

  const BodyFinder& finder_;
  const std::vector<Glimpse>& was_;
  bool closely_;
  std::vector<bool> poor_, none_;
  Usual usual_;
  double usual_plainness_ = 0.0;  ///< of a sighting
};

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

/// Where the frames right after frame i (side 1) or right before it (side -1) lead; nothing if the
/// body was not seen in all of them.
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

/// Follows the body from one side into frames in which it was seen elsewhere, and keeps what it
/// finds as far as more speaks for that, taken together.
class Branch {
 public:
  Branch(const Background& background, const BodyFinder& finder, std::vector<Glimpse>& glimpses,
         int side)
      : measure_(background, finder),
        finder_(finder),
        glimpses_(glimpses),
        as_led_(glimpses),
        side_(side) {
    std::vector<double> usual;
    for (std::size_t i = 0; i < glimpses.size(); ++i)
      if (const auto off = leaves(i)) usual.push_back(off->second);
    // What a parabola through five noisy poses misses by as a rule is no break.
    constexpr double kLeast_rad = 0.1, kOfUsual = 3.0;
    apart_rad_ = std::max(kLeast_rad, usual.empty() ? 0.0 : kOfUsual * data::median(usual));
  }

  void run() {
    const std::size_t n = glimpses_.size();
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t i = side_ > 0 ? n - 1 - k : k;
      if (!goes_on(i)) close();
    }
    close();
  }

 private:
  /// Where the frames on its side put the body of frame i, and how far that is from what was seen.
  [[nodiscard]] std::optional<std::pair<Sighting, double>> leaves(std::size_t i) const {
    if (!glimpses_[i].posed()) return std::nullopt;
    auto expected = led_to(finder_, as_led_, i, side_);
    if (!expected) return std::nullopt;
    const double off = off_rad(*glimpses_[i].seen, *expected, finder_.faces_look_alike());
    return std::pair{std::move(*expected), off};
  }

  /// What is seen in frame i about where the body is expected; nothing if that is nearer to what
  /// was seen before.
  /// @param there nothing farther off is looked for.
  [[nodiscard]] std::optional<Sighting> nearer(std::size_t i,
                                               const std::pair<Sighting, double>& expected,
                                               bool there) {
    const auto& [where, off] = expected;
    const Glimpse& next = as_led_[i + static_cast<std::size_t>(side_)];
    auto seen = measure_(*glimpses_[i].frame, where, next.pose(), nullptr, there);
    if (!seen || !seen->pose || off_rad(*seen, where, finder_.faces_look_alike()) > 0.5 * off)
      return std::nullopt;
    return seen;
  }

  /// False where both are one again, or nothing is found, or too little speaks for it.
  [[nodiscard]] bool goes_on(std::size_t i) {
    // One frame's evidence scatters by a tenth or two: a stretch is given up at half of what it
    // had.
    constexpr double kGiveUp = 0.7, kOne = 0.5;
    const auto expected = leaves(i);
    if (!expected || expected->second < (led_.empty() ? 1.0 : kOne) * apart_rad_) return false;
    // A wide look may find again what the body was taken for; from next to it a close one does not.
    auto seen = nearer(i, *expected, false);
    if (!seen) seen = nearer(i, *expected, true);
    if (!seen) return false;
    seen->turned_rad = glimpses_[i].seen->turned_rad;
    // Not how plainly: the rim of a face in the light is plainer than that of a wall in the shade.
    gain_ += speaks_more(*seen, *glimpses_[i].seen);
    as_led_[i].seen = std::move(seen);
    led_.push_back(i);
    if (gain_ > best_) best_ = gain_, kept_ = led_.size();
    return gain_ > best_ - kGiveUp;
  }

  void close() {
    constexpr double kClearly = 0.1;  // as for a frame that its neighbours mend
    const std::size_t kept = best_ > kClearly ? kept_ : 0;
    for (std::size_t k = 0; k < led_.size(); ++k) {
      auto &was = glimpses_[led_[k]].seen, &now = as_led_[led_[k]].seen;
      (k < kept ? was : now) = k < kept ? now : was;
    }
    led_.clear();
    gain_ = best_ = 0.0;
    kept_ = 0;
  }

  Measuring measure_;
  const BodyFinder& finder_;
  std::vector<Glimpse>& glimpses_;
  std::vector<Glimpse> as_led_;  ///< with the branch in place of what was seen
  int side_;
  double apart_rad_ = 0.0;
  std::vector<std::size_t> led_;  ///< frames of the branch
  double gain_ = 0.0, best_ = 0.0;
  std::size_t kept_ = 0;  ///< frames of the branch up to the best
};

/// Whether the frames right before frame i or those right after it lead to what was seen in it: it
/// may be where the body was knocked, which none on the other side can know.
bool is_led_to(const BodyFinder& finder, const std::vector<Glimpse>& glimpses, std::size_t i,
               double within_rad) {
  const auto leads = [&](int side) {
    const auto expected = led_to(finder, glimpses, i, side);
    return expected &&
           off_rad(*glimpses[i].seen, *expected, finder.faces_look_alike()) < within_rad;
  };
  return leads(1) || leads(-1);
}

/// What the frames around still contradict may be where they say instead: its covariance holds
/// both. Where it does so for another reading already, which may be the same, the tilt's alone is
/// seen to.
void doubt_reading(const Expected& expected, Sighting& seen) {
  PoseMeasurement& pose = *seen.pose;
  const double off_rad = std::abs(expected.seen.pose->pose.theta_rad - pose.pose.theta_rad);
  if (seen.attitude_doubtful) {
    pose.sigma_theta_rad = std::max(pose.sigma_theta_rad, off_rad);
    return;
  }
  doubt_attitude(expected.seen.centre_px - seen.centre_px,
                 (expected.seen.pose->pose.centre_m - pose.pose.centre_m).head<2>(), off_rad, seen);
}

}  // namespace

void mend_from_neighbours(const Background& background, const BodyFinder& finder,
                          std::vector<Glimpse>& glimpses, bool closely) {
  constexpr int kRounds = 3;
  constexpr std::size_t kReach = 6;
  if (std::count_if(glimpses.begin(), glimpses.end(), [](const Glimpse& g) { return g.posed(); }) <
      4)
    return;
  // What was mended may tell its own neighbours more. Where the body was lost that goes on: it is
  // followed into a gap from both ends, by the attitudes that all of its frames decided on.
  std::vector<char> open(glimpses.size(), 1);
  for (int round = 0; std::count(open.begin(), open.end(), 1) > 0; ++round) {
    const std::vector<Glimpse> was = glimpses;
    const Mending mend(finder, was, closely);
    std::vector<char> mended(was.size(), 0);
    on_all_cores(background, finder, was.size(), [&](Measuring& measure, std::size_t i) {
      if (!open[i] || (round >= kRounds && was[i].seen)) return;
      if (auto seen = mend(measure, i)) glimpses[i].seen = std::move(seen), mended[i] = 1;
    });
    open.assign(was.size(), 0);
    for (std::size_t i = 0; i < was.size(); ++i)
      for (std::size_t k = i - std::min(i, kReach);
           mended[i] && k < std::min(was.size(), i + kReach + 1); ++k)
        open[k] = 1;
  }
}

void mend_from_one_side(const Background& background, const BodyFinder& finder,
                        std::vector<Glimpse>& glimpses) {
  for (const int side : {1, -1}) Branch(background, finder, glimpses, side).run();
}

void measure_again(const Background& background, const BodyFinder& finder, std::size_t settled,
                   std::vector<Glimpse>& glimpses) {
  constexpr double kAsGood = 0.8;  // the first look had half the places and scatters
  constexpr double kNear = 0.25;
  const bool alike = finder.faces_look_alike();
  const std::vector<Glimpse> was = glimpses;
  on_all_cores(background, finder, glimpses.size(), [&](Measuring& measure, std::size_t i) {
    if (i < settled || !was[i].posed() || was[i].seen->attitude_doubtful) return;
    const std::optional<Pose> before = one_frame_before(was, i, alike);
    if (!before) return;
    const Sighting& seen = *was[i].seen;
    const Surroundings surroundings = surroundings_of(was, i);
    Sighting guess = seen;
    guess.pose->blur_px = surroundings.blur_px;
    auto again = measure(*was[i].frame, std::move(guess), before, &surroundings.shading);
    if (!again || !again->pose || again->pose->evidence < kAsGood * seen.pose->evidence) return;
    const double off =
        std::max(between_axes(axis_of(again->pose->pose), axis_of(seen.pose->pose), alike),
                 (again->centre_px - seen.centre_px).norm() / seen.rim.semi_major_px());
    if (off > kNear) return;
    again->turned_rad = seen.turned_rad;
    glimpses[i].seen = std::move(again);
  });
}

void doubt_what_is_contradicted(const BodyFinder& finder, std::vector<Glimpse>& glimpses) {
  constexpr double kPoorOff_rad = 0.1;
  const std::vector<Glimpse> was = glimpses;
  const std::vector<bool> poor = poor_fits(was), none(was.size(), false);
  const double suspicious_rad = Usual(finder, was).suspicious_rad();
  for (std::size_t i = 0; i < was.size(); ++i) {
    if (!was[i].posed()) continue;
    std::optional<Expected> nearest;
    double least_rad = std::numeric_limits<double>::infinity();
    bool doubted = true;
    for (const std::vector<bool>& but : {poor, none}) {
      auto expected = expected_at(finder, was, i, but);
      if (!expected) continue;
      const double off = off_rad(*was[i].seen, expected->seen, finder.faces_look_alike());
      const bool suspicious =
          expected->contradicts(off, suspicious_rad) && !is_led_to(finder, was, i, suspicious_rad);
      doubted = doubted && (suspicious || expected->contradicts(off, Usual::kMost_rad) ||
                            (poor[i] && off > kPoorOff_rad));
      if (off < least_rad) least_rad = off, nearest = std::move(expected);
    }
    if (nearest && doubted) doubt_reading(*nearest, *glimpses[i].seen);
  }
}

}  // namespace trochoid::tracking
