#include "attitude_sequence.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <future>
#include <limits>
#include <numbers>

#include "forecast.hpp"
#include "pose_motion.hpp"

namespace trochoid::tracking {
namespace {

using Pose = data::Pose<>;
constexpr double kTurn = 2.0 * std::numbers::pi;

Eigen::Vector3d axis_of(const Pose& pose) {
  return data::symmetry_axis(pose.theta_rad, pose.phi_rad);
}

double between_axes(const Eigen::Vector3d& a, const Eigen::Vector3d& b, bool alike) {
  const double cosine = a.dot(b);
  return std::acos(std::clamp(alike ? std::abs(cosine) : cosine, -1.0, 1.0));
}

/// Measures the body about a guess in one frame.
class Measuring {
 public:
  Measuring(const Background& background, const BodyFinder& finder)
      : background_(background), finder_(finder) {}

  /// @param near its pose one frame earlier or later, if known: how far it smears.
  [[nodiscard]] std::optional<Sighting> operator()(const Frame& frame, Sighting guess,
                                                   const std::optional<Pose>& near) {
    finder_.place(guess);
    const double half_px = 1.6 * guess.rim.semi_major_px() + 24.0;
    const cv::Rect box =
        cv::Rect(static_cast<int>(guess.centre_px.x() - half_px),
                 static_cast<int>(guess.centre_px.y() - half_px), static_cast<int>(2.0 * half_px),
                 static_cast<int>(2.0 * half_px)) &
        cv::Rect({}, frame.luma.size());
    if (box.width < 8 || box.height < 8) return std::nullopt;
    background_.scaled_into(plate_, background_.gain(frame.luma), box);
    Look look{.frame = frame, .background = plate_};
    look.predicted = &guess;
    Sighting last = guess;
    if (near) {
      last.pose->pose = *near;
      finder_.place(last);
      look.last = &last;
      look.motion_px = guess.centre_px - last.centre_px;
    }
    return finder_.find(look);
  }

 private:
  const Background& background_;
  const BodyFinder& finder_;
  Plate plate_;
};

/// Runs work(measuring, i) for i of 0..count on two cores.
template <class Work>
void on_both_cores(const Background& background, const BodyFinder& finder, std::size_t count,
                   const Work& work) {
  const auto every_other = [&](std::size_t first) {
    Measuring measuring(background, finder);
    for (std::size_t i = first; i < count; i += 2) work(measuring, i);
  };
  auto other = std::async(std::launch::async, every_other, 1);
  every_other(0);
  other.get();
}

/// A sighting with a pose, in its two readings.
struct Node {
  std::size_t at;  ///< among the glimpses
  double t_s;
  std::array<Pose, 2> poses;  ///< as tracked, mirrored
  double tilt_rad;            ///< half the angle between the two axes
  bool weighed = false;
  double speaks = 0.0;  ///< how much the picture speaks for the first
  std::optional<Sighting> other{};
};

class Chain {
 public:
  Chain(const Background& background, const BodyFinder& finder, std::vector<Glimpse>& glimpses)
      : background_(background),
        finder_(finder),
        glimpses_(glimpses),
        alike_(finder.faces_look_alike()) {
    for (std::size_t i = 0; i < glimpses.size(); ++i) {
      const auto& seen = glimpses[i].seen;
      if (!seen || !seen->pose) continue;
      const auto image = finder.mirror_image(seen->pose->pose);
      if (!image) continue;
      const double tilt = 0.5 * between_axes(axis_of(seen->pose->pose), axis_of(*image), alike_);
      nodes_.push_back({i, glimpses[i].frame->t_s, {seen->pose->pose, *image}, tilt});
    }
    std::vector<double> steps;
    for (std::size_t i = 1; i < nodes_.size(); ++i)
      steps.push_back(nodes_[i].t_s - nodes_[i - 1].t_s);
    if (steps.empty()) return;
    std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2),
                     steps.end());
    frame_s_ = steps[steps.size() / 2];
  }

  void decide() {
    if (nodes_.size() < 3) return;
    weigh(first_choice());
    solve();
    weigh(in_doubt());
    solve();
    apply();
  }

 private:
  static constexpr double kLeastTilt = 0.06;  // below, both readings are one

  /// Every eighth, and those about which the sequence as tracked does not go on as before.
  [[nodiscard]] std::vector<std::size_t> first_choice() const {
    constexpr std::size_t kStride = 8;
    constexpr double kBreak = 1.5;
    std::vector<bool> wanted(nodes_.size(), false);
    for (std::size_t i = 0; i < nodes_.size(); i += kStride) wanted[i] = true;
    for (std::size_t i = 2; i < nodes_.size(); ++i)
      if (break_cost(i, 0, 0, 0) > kBreak) wanted[i] = wanted[i - 1] = wanted[i - 2] = true;
    std::vector<std::size_t> chosen;
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (wanted[i]) chosen.push_back(i);
    return chosen;
  }

  [[nodiscard]] std::vector<std::size_t> in_doubt() const {
    constexpr double kSure = 6.0;
    std::vector<std::size_t> chosen;
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (std::abs(margin_[i]) < kSure) chosen.push_back(i);
    return chosen;
  }

  /// Measures the mirrored reading and compares what speaks for the two.
  void weigh(const std::vector<std::size_t>& chosen) {
    constexpr double kPerShare = 6.0, kMost = 1.5, kNothingThere = 0.6;
    on_both_cores(background_, finder_, chosen.size(), [&](Measuring& measure, std::size_t k) {
      Node& node = nodes_[chosen[k]];
      if (node.weighed || node.tilt_rad < kLeastTilt) return;
      node.weighed = true;
      const Glimpse& glimpse = glimpses_[node.at];
      node.other = measured_mirrored(measure, chosen[k]);
      if (!node.other) {
        node.speaks = kNothingThere;
        return;
      }
      const double ours = glimpse.seen->pose->evidence, theirs = node.other->pose->evidence;
      const double share = (ours - theirs) / std::max({ours, theirs, 1e-9});
      node.speaks = std::clamp(kPerShare * share, -kMost, kMost);
    });
  }

  /// Where the body was one frame from node i, in the reading that takes less of a turn.
  [[nodiscard]] std::optional<Pose> near(std::size_t i, const Pose& pose) const {
    constexpr double kNext = 1.5;
    for (const std::size_t k : {i - 1, i + 1}) {
      if (k >= nodes_.size() || std::abs(nodes_[k].t_s - nodes_[i].t_s) > kNext * frame_s_)
        continue;
      const Eigen::Vector3d axis = axis_of(pose);
      const auto& [one, other] = nodes_[k].poses;
      Pose nearer =
          between_axes(axis, axis_of(one), alike_) <= between_axes(axis, axis_of(other), alike_)
              ? one
              : other;
      return alike_ ? nearer_face(nearer, pose, 0.0) : nearer;
    }
    return std::nullopt;
  }

  /// The mirrored reading of node i; nothing if the picture leads elsewhere.
  [[nodiscard]] std::optional<Sighting> measured_mirrored(Measuring& measure, std::size_t i) const {
    const Node& node = nodes_[i];
    Sighting guess = *glimpses_[node.at].seen;
    guess.pose->pose = node.poses[1];
    auto seen = measure(*glimpses_[node.at].frame, guess, near(i, node.poses[1]));
    if (!seen || !seen->pose) return std::nullopt;
    // The centres of the two readings are apart by the thickness of the body at most.
    constexpr double kApart = 0.12;
    const Sighting& ours = *glimpses_[node.at].seen;
    if ((seen->centre_px - ours.centre_px).norm() > kApart * ours.rim.semi_major_px())
      return std::nullopt;
    const Eigen::Vector3d axis = axis_of(seen->pose->pose);
    if (between_axes(axis, axis_of(node.poses[1]), alike_) >
        between_axes(axis, axis_of(node.poses[0]), alike_))
      return std::nullopt;
    return seen;
  }

  /// What it costs that node i does not go on from the two before it, in these readings.
  [[nodiscard]] double break_cost(std::size_t i, int a, int b, int c) const {
    constexpr double kMostFrames = 2.5, kLeast = 0.12, kOfStep = 0.35, kMost = 12.0;
    // All else equal, the slower motion: reading every other frame mirrored goes on evenly as well.
    constexpr double kPerRadian = 0.5;
    const Node &first = nodes_[i - 2], &second = nodes_[i - 1], &third = nodes_[i];
    const double early = second.t_s - first.t_s, late = third.t_s - second.t_s;
    if (early > kMostFrames * frame_s_ || late > kMostFrames * frame_s_) return 0.0;
    const double ahead = late / early;
    const Pose &pa = first.poses[static_cast<std::size_t>(a)],
               &pb = second.poses[static_cast<std::size_t>(b)],
               &pc = third.poses[static_cast<std::size_t>(c)];
    const Eigen::Vector3d to = axis_of(pb);
    Eigen::Vector3d from = axis_of(pa);
    if (alike_ && from.dot(to) < 0.0) from = -from;
    const Eigen::Vector3d is = axis_of(pc);
    const Eigen::Vector3d straight = (to + ahead * (to - from)).normalized();
    Pose turning = pb;
    turning.phi_rad += ahead * std::remainder(pb.phi_rad - pa.phi_rad, kTurn);
    turning.theta_rad += ahead * (pb.theta_rad - pa.theta_rad);
    const double off =
        std::min(between_axes(straight, is, alike_), between_axes(axis_of(turning), is, alike_));
    // Of the two steps the smaller: a reading that leaps must not allow for itself.
    const double step = std::min(between_axes(from, to, alike_),
                                 between_axes(to, is, alike_) / std::max(ahead, 1e-9));
    const double allowed = kLeast + kOfStep * step;
    return std::min(kMost, 0.5 * off * off / (allowed * allowed)) +
           kPerRadian * between_axes(to, is, alike_);
  }

  /// Best sequences through every reading of every node, both ways; pairs of readings are the
  /// states.
  void solve() {
    using Costs = std::array<double, 4>;  // 2 * reading before + reading now
    const std::size_t n = nodes_.size();
    std::vector<Costs> until(n), beyond(n, Costs{});
    const auto own = [&](std::size_t i, int s) {
      return 0.5 * (s == 0 ? -nodes_[i].speaks : nodes_[i].speaks);
    };
    for (int s = 0; s < 4; ++s)
      until[1][static_cast<std::size_t>(s)] = own(0, s / 2) + own(1, s % 2);
    for (std::size_t i = 2; i < n; ++i)
      for (int s = 0; s < 4; ++s) {
        double least = std::numeric_limits<double>::infinity();
        for (int a = 0; a < 2; ++a)
          least = std::min(least, until[i - 1][static_cast<std::size_t>(2 * a + s / 2)] +
                                      break_cost(i, a, s / 2, s % 2));
        until[i][static_cast<std::size_t>(s)] = least + own(i, s % 2);
      }
    for (std::size_t i = n - 1; i >= 2; --i)
      for (int s = 0; s < 4; ++s) {  // the pair (i - 2, i - 1)
        double least = std::numeric_limits<double>::infinity();
        for (int c = 0; c < 2; ++c)
          least = std::min(least, beyond[i][static_cast<std::size_t>(2 * (s % 2) + c)] + own(i, c) +
                                      break_cost(i, s / 2, s % 2, c));
        beyond[i - 1][static_cast<std::size_t>(s)] = least;
      }
    margin_.assign(n, 0.0);
    for (std::size_t i = 1; i < n; ++i) {
      std::array<double, 2> now, before;
      now.fill(std::numeric_limits<double>::infinity());
      before = now;
      for (int s = 0; s < 4; ++s) {
        const double cost =
            until[i][static_cast<std::size_t>(s)] + beyond[i][static_cast<std::size_t>(s)];
        now[static_cast<std::size_t>(s % 2)] = std::min(now[static_cast<std::size_t>(s % 2)], cost);
        before[static_cast<std::size_t>(s / 2)] =
            std::min(before[static_cast<std::size_t>(s / 2)], cost);
      }
      margin_[i] = now[1] - now[0];
      if (i == 1) margin_[0] = before[1] - before[0];
    }
  }

  void apply() {
    constexpr double kDoubtful = 2.0;
    on_both_cores(background_, finder_, nodes_.size(), [&](Measuring& measure, std::size_t i) {
      Node& node = nodes_[i];
      if (node.tilt_rad < kLeastTilt) return;
      auto& seen = glimpses_[node.at].seen;
      std::optional<Sighting>& other = node.other;
      if (margin_[i] < 0.0) {
        if (!other) other = measured_mirrored(measure, i);
        if (other) other->turned_rad = seen->turned_rad;
        seen.swap(other);
      }
      if (!seen || !seen->pose || std::abs(margin_[i]) >= kDoubtful) return;
      seen->attitude_doubtful = true;
      seen->pose->sigma_phi_rad = std::numeric_limits<double>::infinity();
      if (!other) return;
      // Either of two places: half their distance is the standard deviation.
      const Eigen::Vector2d px = 0.5 * (other->centre_px - seen->centre_px);
      const Eigen::Vector2d m =
          0.5 * (other->pose->pose.centre_m - seen->pose->pose.centre_m).head<2>();
      const Eigen::Matrix2d px2 = px * px.transpose(), m2 = m * m.transpose();
      seen->covariance_px2 += px2;
      seen->pose->covariance_px2 += px2, seen->pose->common.px2 += px2;
      seen->pose->covariance_m2 += m2, seen->pose->common.m2 += m2;
    });
  }

  const Background& background_;
  const BodyFinder& finder_;
  std::vector<Glimpse>& glimpses_;
  bool alike_;
  double frame_s_ = 1.0;
  std::vector<Node> nodes_;
  std::vector<double> margin_;  ///< cost of the second reading beyond that of the first
};

/// Where neighbours at a and b (and those before and after them) put the body at time t.
struct Neighbours {
  const Glimpse &before, &a, &b, &after;

  /// Middle of what leads on from before and what leads back from after.
  [[nodiscard]] Pose at(double t_s, bool alike) const {
    const Pose pa = a.seen->pose->pose;
    Pose pb = b.seen->pose->pose;
    if (alike) pb = nearer_face(pb, pa, 0.0);
    const double ta = a.frame->t_s, tb = b.frame->t_s, share = (t_s - ta) / (tb - ta);
    const double rate = 0.5 * (rate_between(before, a, alike) + rate_between(b, after, alike));
    const double turns = std::round((rate * (tb - ta) - (pb.phi_rad - pa.phi_rad)) / kTurn);
    Pose pose = pa;
    pose.centre_m += share * (pb.centre_m - pa.centre_m);
    if (std::min(std::sin(pa.theta_rad), std::sin(pb.theta_rad)) < 0.15) {
      set_axis(((1.0 - share) * axis_of(pa) + share * axis_of(pb)).normalized(), pose);
      return pose;
    }
    pose.theta_rad += share * (pb.theta_rad - pa.theta_rad);
    pose.phi_rad += share * (pb.phi_rad - pa.phi_rad + turns * kTurn);
    return pose;
  }

 private:
  static double rate_between(const Glimpse& from, const Glimpse& to, bool alike) {
    const double step_s = to.frame->t_s - from.frame->t_s;
    if (step_s <= 0.0) return 0.0;
    Pose end = to.seen->pose->pose;
    if (alike) end = nearer_face(end, from.seen->pose->pose, 0.0);
    return std::remainder(end.phi_rad - from.seen->pose->pose.phi_rad, kTurn) / step_s;
  }
};

/// What speaks for a fit. A wrong pose may have the longer outline and so the more evidence: how
/// much of it is plainly seen counts as well.
double worth(const Sighting& seen) {
  return seen.pose->evidence * seen.accepted;
}

/// Frames in which clearly less speaks for the fit than in those around: it may have settled
/// beside the body.
std::vector<bool> poor_fits(const std::vector<Glimpse>& glimpses) {
  constexpr std::size_t kReach = 12, kFewest = 8;
  constexpr double kOfUsual = 0.05, kDeviations = 2.5 * 1.48;
  std::vector<bool> poor(glimpses.size(), false);
  std::vector<double> around, off;
  const auto median = [](std::vector<double>& values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  for (std::size_t i = 0; i < glimpses.size(); ++i) {
    if (!glimpses[i].seen || !glimpses[i].seen->pose) continue;
    around.clear(), off.clear();
    for (std::size_t k = i - std::min(i, kReach); k < std::min(glimpses.size(), i + kReach + 1);
         ++k)
      if (const Glimpse& g = glimpses[k]; g.seen && g.seen->pose) around.push_back(worth(*g.seen));
    if (around.size() < kFewest) continue;
    const double usual = median(around);
    for (const double value : around) off.push_back(std::abs(value - usual));
    poor[i] =
        worth(*glimpses[i].seen) < usual - std::max(kOfUsual * usual, kDeviations * median(off));
  }
  return poor;
}

/// The nearest frames with a good pose on either side, at most a few frames off; at an end, two on
/// the same side.
std::optional<Neighbours> neighbours_of(const std::vector<Glimpse>& glimpses,
                                        const std::vector<bool>& poor, std::size_t i) {
  constexpr std::size_t kFarthest = 6;
  std::array<const Glimpse*, 2> before{}, after{};
  std::size_t count = 0;
  for (std::size_t k = 1; k <= kFarthest && k <= i && count < 2; ++k)
    if (const Glimpse& g = glimpses[i - k]; g.seen && g.seen->pose && !poor[i - k])
      before[count++] = &g;
  const std::size_t earlier = count;
  if (count == 1) before[1] = before[0];
  count = 0;
  for (std::size_t k = 1; k <= kFarthest && i + k < glimpses.size() && count < 2; ++k)
    if (const Glimpse& g = glimpses[i + k]; g.seen && g.seen->pose && !poor[i + k])
      after[count++] = &g;
  // At an end the two nearest lead beyond themselves.
  if (earlier == 0 && count == 2) return Neighbours{*after[0], *after[0], *after[1], *after[1]};
  if (count == 0 && earlier == 2) return Neighbours{*before[0], *before[0], *before[1], *before[1]};
  if (earlier == 0 || count == 0) return std::nullopt;
  if (count == 1) after[1] = after[0];
  return Neighbours{*before[1], *before[0], *after[0], *after[1]};
}

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

/// Frames in which the body moves far during the exposure are measured again with how it moves as
/// the frames on both sides know it: while it was followed, only the past did.
void measure_smeared(const Background& background, const BodyFinder& finder,
                     std::vector<Glimpse>& glimpses) {
  constexpr double kLeastSmear_px = 1.5, kAsGood = 0.95, kNear = 0.25;
  const double fraction = finder.exposure_fraction();
  if (!(fraction > 0.0)) return;
  const bool alike = finder.faces_look_alike();
  const std::vector<Glimpse> was = glimpses;
  const auto posed = [&](std::size_t i) { return was[i].seen && was[i].seen->pose; };
  on_both_cores(background, finder, glimpses.size(), [&](Measuring& measure, std::size_t i) {
    if (i == 0 || i + 1 >= was.size() || !posed(i) || !posed(i - 1) || !posed(i + 1)) return;
    const Sighting& seen = *was[i].seen;
    if (seen.attitude_doubtful) return;
    const double way_px = apart_px(*was[i - 1].seen, seen) + apart_px(seen, *was[i + 1].seen);
    if (0.5 * fraction * way_px < kLeastSmear_px) return;
    const Pose pose = seen.pose->pose;
    Pose before = was[i - 1].seen->pose->pose, after = was[i + 1].seen->pose->pose;
    if (alike) before = nearer_face(before, pose, 0.0), after = nearer_face(after, pose, 0.0);
    auto again = measure(*was[i].frame, seen, one_frame_before(before, pose, after));
    if (!again || !again->pose || again->pose->evidence < kAsGood * seen.pose->evidence) return;
    const double off =
        std::max(between_axes(axis_of(again->pose->pose), axis_of(pose), alike),
                 (again->centre_px - seen.centre_px).norm() / seen.rim.semi_major_px());
    if (off > kNear) return;
    again->turned_rad = seen.turned_rad;
    glimpses[i].seen = std::move(again);
  });
}

}  // namespace

void decide_attitudes(const Background& background, const BodyFinder& finder,
                      std::vector<Glimpse>& glimpses) {
  Chain(background, finder, glimpses).decide();
}

void mend_from_neighbours(const Background& background, const BodyFinder& finder,
                          std::vector<Glimpse>& glimpses) {
  constexpr double kContradicted = 0.3, kNear = 0.35, kUsualShare = 0.5, kAsGood = 0.9;
  constexpr double kBetter = 1.02;
  const bool alike = finder.faces_look_alike();
  std::vector<double> evidences;
  for (const Glimpse& g : glimpses)
    if (g.seen && g.seen->pose) evidences.push_back(g.seen->pose->evidence);
  if (evidences.size() < 4) return;
  const auto middle = evidences.begin() + static_cast<std::ptrdiff_t>(evidences.size() / 2);
  std::nth_element(evidences.begin(), middle, evidences.end());
  const double usual = *middle;
  const std::vector<Glimpse> was = glimpses;
  const std::vector<bool> poor = poor_fits(was);
  on_both_cores(background, finder, glimpses.size(), [&](Measuring& measure, std::size_t i) {
    const auto around = neighbours_of(was, poor, i);
    if (!around) return;
    const auto& before = was[i].seen;
    if (before && !before->pose) return;
    Sighting guess = *around->a.seen;
    guess.pose->pose = around->at(was[i].frame->t_s, alike);
    finder.place(guess);
    const Eigen::Vector3d axis = axis_of(guess.pose->pose);
    const double step = between_axes(axis_of(around->a.seen->pose->pose),
                                     axis_of(around->b.seen->pose->pose), alike);
    const double size = guess.rim.semi_major_px();
    const auto off = [&](const Sighting& s) {
      return std::max(between_axes(axis_of(s.pose->pose), axis, alike),
                      2.0 * (s.centre_px - guess.centre_px).norm() / size);
    };
    const bool contradicted = before && off(*before) >= kContradicted + 0.5 * step;
    if (before && !contradicted && !poor[i]) return;
    const double frame_s = (around->b.frame->t_s - around->a.frame->t_s) /
                           static_cast<double>(around->b.frame->index - around->a.frame->index);
    auto seen = measure(*was[i].frame, guess, around->at(was[i].frame->t_s - frame_s, alike));
    if (!seen || !seen->pose || off(*seen) > kNear + 0.5 * step) return;
    if (!before && seen->pose->evidence < kUsualShare * usual) return;
    if (before && worth(*seen) < (contradicted ? kAsGood : kBetter) * worth(*before)) return;
    if (before) seen->turned_rad = before->turned_rad;
    glimpses[i].seen = std::move(seen);
  });
  measure_smeared(background, finder, glimpses);
}

}  // namespace trochoid::tracking
