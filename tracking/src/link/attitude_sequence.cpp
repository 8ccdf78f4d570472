#include "link/attitude_sequence.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "geometry/pose_change.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using Pose = data::Pose<>;

/// A sighting with a pose, in its two readings.
struct AttitudeNode {
  std::size_t at;  ///< among the glimpses
  double t_s;
  std::array<Pose, 2> poses;  ///< as tracked, mirrored
  double tilt_rad;            ///< half the angle between the two axes
  bool weighed = false;
  double edge_score = 0.0;          ///< log odds of the first by its edges, -1.5..1.5
  double shadow_score = 0.0;        ///< the same by its shadow, -1.5..1.5
  double score = 0.0;               ///< the same by edges, shadow and size
  double weight = 0.0;              ///< of edges and size in a score, where it has any
  std::optional<Sighting> again{};  ///< the first measured afresh, where that scores higher
  std::optional<Sighting> other{};  ///< the second

  /// How well the two can be told apart by their edges, 0..1: what does it, the wall, is the
  /// narrower the less the body tilts, and errors of the edges are not.
  [[nodiscard]] double separability() const {
    constexpr double kSteep_rad = 0.75;
    const double share = std::min(1.0, tilt_rad / kSteep_rad);
    return share * share;
  }
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
    if (nodes_.size() < 2) return;
    frame_s_ = data::usual_step_s(nodes_, &AttitudeNode::t_s);
    lean_weight_ = lean_weight();
  }

  [[nodiscard]] std::vector<AttitudeDoubt> decide() {
    if (nodes_.size() < 3) return undecided();
    weigh_shadows();
    weigh(first_choice());
    compare_sizes();
    solve();
    weigh(in_doubt());
    compare_sizes();
    solve();
    const std::vector<double> chosen = margin_;
    discount();
    solve();
    keep_to(chosen);
    return apply();
  }

 private:
  static constexpr double kLeastTilt = 0.06;   // below, both readings are one
  static constexpr double kAnother_rad = 0.3;  // turned by this, a body is seen anew

  /// Two frames do not show how the body goes on, and no single picture is sure.
  [[nodiscard]] std::vector<AttitudeDoubt> undecided() {
    std::vector<std::size_t> all(nodes_.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    weigh(all);
    margin_.assign(nodes_.size(), 0.0);
    return apply();
  }

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

  /// Measures both readings and compares their scores.
  void weigh(const std::vector<std::size_t>& chosen) {
    constexpr double kPerShare = 9.0, kMost = 1.5, kNothingThere = 0.6;
    on_all_cores(background_, finder_, chosen.size(), [&](Measuring& measure, std::size_t k) {
      AttitudeNode& node = nodes_[chosen[k]];
      if (node.weighed || node.tilt_rad < kLeastTilt) return;
      node.weighed = true;
      const Glimpse& glimpse = glimpses_[node.at];
      if (auto again = measured(measure, chosen[k], 0);
          again && again->pose->score_px() > glimpse.seen->pose->score_px())
        node.again = std::move(again);
      node.other = measured(measure, chosen[k], 1);
      if (!node.other) {
        node.edge_score = node.separability() * kNothingThere;
        return;
      }
      const Sighting& own = first_of(node);
      const double ours = own.pose->score_px(), theirs = node.other->pose->score_px();
      const double share = (ours - theirs) / std::max({ours, theirs, 1e-9});
      node.edge_score = node.separability() * std::clamp(kPerShare * share, -kMost, kMost);
    });
  }

  /// Which side of the body is raised shows in the shadow that it throws.
  void weigh_shadows() {
    constexpr double kOfShadow = 2.5, kMost = 1.5;
    on_all_cores(background_, finder_, nodes_.size(), [&](Measuring& measure, std::size_t i) {
      AttitudeNode& node = nodes_[i];
      if (node.tilt_rad < kLeastTilt) return;
      const Glimpse& g = glimpses_[node.at];
      const double other = measure.shadow(*g.frame, *g.seen, node.poses[1]);
      node.shadow_score = std::clamp(kOfShadow * (g.seen->shadow - other), -kMost, kMost);
    });
  }

  [[nodiscard]] const Sighting& first_of(const AttitudeNode& node) const {
    return node.again ? *node.again : *glimpses_[node.at].seen;
  }

  /// A body has one size. The two readings of a picture lie at different heights: at the wrong one
  /// the rim looks too large or too small, by as much as the camera then shows it larger or
  /// smaller. Of all readings the right ones are those that agree.
  void compare_sizes() {
    constexpr std::size_t kFewest = 8;
    constexpr double kLeastSd_px = 0.1;
    const double least = least_accepted();
    std::vector<double> larger_px;
    for (AttitudeNode& node : nodes_) {
      node.score = node.edge_score + node.shadow_score;
      node.weight = node.separability();
      if (shows_size(node, least))
        larger_px.insert(larger_px.end(),
                         {first_of(node).pose->larger_px, node.other->pose->larger_px});
    }
    if (larger_px.size() < 2 * kFewest) return;
    const auto [usual_px, spread_px] = where_half_agree(std::move(larger_px));
    for (AttitudeNode& node : nodes_) {
      if (!shows_size(node, least)) continue;
      node.score += size_score(node, usual_px, std::max(kLeastSd_px, spread_px));
      node.weight += 1.0;
    }
  }

  /// Log odds of the first reading of a node by its size.
  [[nodiscard]] double size_score(const AttitudeNode& node, double usual_px, double sd_px) const {
    constexpr double kMost = 1.5;
    const Sighting &one = first_of(node), &other = *node.other;
    const double expected_px = one.rim.semi_major_px() - other.rim.semi_major_px();
    const double seen_px = other.pose->larger_px - one.pose->larger_px;
    if (expected_px * seen_px <= 0.0) return 0.0;
    // The middle of the two is half of what they differ by off the usual, on the side of the wrong
    // one.
    const double half_px =
        0.5 * std::copysign(std::min(std::abs(expected_px), std::abs(seen_px)), seen_px);
    const double middle_px = 0.5 * (one.pose->larger_px + other.pose->larger_px) - usual_px;
    const double off_one = std::pow((middle_px - half_px) / sd_px, 2);
    const double off_other = std::pow((middle_px + half_px) / sd_px, 2);
    return std::clamp(std::log1p(off_other) - std::log1p(off_one), -kMost, kMost);
  }

  /// So much of the outline is seen of a body that nothing hides: of part of it the size is not
  /// known apart from the place.
  [[nodiscard]] double least_accepted() const {
    constexpr double kOfUsual = 0.85;
    std::vector<double> accepted;
    for (const AttitudeNode& node : nodes_) accepted.push_back(first_of(node).accepted);
    return kOfUsual * data::median(std::move(accepted));
  }

  [[nodiscard]] bool shows_size(const AttitudeNode& node, double least_accepted) const {
    return node.other && std::min(first_of(node).accepted, node.other->accepted) >= least_accepted;
  }

  /// Mean of the half of the values that lie closest together, and the standard deviation of those
  /// that belong there.
  static std::pair<double, double> where_half_agree(std::vector<double> values) {
    constexpr double kDeviations = 3.0;  // that half, all of what belongs there, spans
    std::sort(values.begin(), values.end());
    const std::size_t half = values.size() / 2;
    std::size_t from = 0;
    for (std::size_t k = 0; k + half <= values.size(); ++k)
      if (values[k + half - 1] - values[k] < values[from + half - 1] - values[from]) from = k;
    const auto first = values.begin() + static_cast<std::ptrdiff_t>(from);
    const auto last = first + static_cast<std::ptrdiff_t>(half);
    const double mean = std::accumulate(first, last, 0.0) / static_cast<double>(half);
    return {mean, (*(last - 1) - *first) / kDeviations};
  }

  /// What pictures of one body say has errors that all of them share (a raised rim, a shadow): if
  /// they support the chosen sequence by no more than that, it is not known, however many.
  void discount() {
    constexpr double kShared = 0.15, kSure = 0.38;
    double edges = 0.0, separable = 1e-9, score = 0.0, weight = 1e-9;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (!nodes_[i].weighed) continue;
      const double chosen = std::copysign(1.0, margin_[i]);
      edges += chosen * nodes_[i].edge_score;
      separable += nodes_[i].separability();
      score += chosen * nodes_[i].score;
      weight += nodes_[i].weight;
    }
    // By the edges alone or together with sizes and shadows, whichever is clearer.
    const double share = std::max(edges / separable, score / weight);
    const double trust = std::clamp((share - kShared) / (kSure - kShared), 0.0, 1.0);
    for (AttitudeNode& node : nodes_) node.score *= trust;
  }

  /// What is too little to be sure of is still the best there is to choose by: the choice of before
  /// stands, no surer than it is now.
  void keep_to(const std::vector<double>& chosen) {
    constexpr double kUnsure = 1e-9;
    for (std::size_t i = 0; i < margin_.size(); ++i) {
      const bool agree = margin_[i] * chosen[i] > 0.0;
      margin_[i] = std::copysign(
          agree ? std::min(std::abs(margin_[i]), std::abs(chosen[i])) : kUnsure, chosen[i]);
    }
  }

  /// Where the body was one frame from node i, in the reading that takes less of a turn.
  [[nodiscard]] std::optional<Beside> near(std::size_t i, const Pose& pose) const {
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
      return Beside{alike_ ? nearer_face(nearer, pose, 0.0) : nearer, k < i ? 1 : -1};
    }
    return std::nullopt;
  }

  /// A reading of node i measured afresh; nothing if the picture leads elsewhere.
  [[nodiscard]] std::optional<Sighting> measured(Measuring& measure, std::size_t i,
                                                 std::size_t reading) const {
    const AttitudeNode& node = nodes_[i];
    const Pose &wanted = node.poses[reading], &unwanted = node.poses[1 - reading];
    Sighting guess = *glimpses_[node.at].seen;
    guess.pose->pose = wanted;
    auto seen = measure(*glimpses_[node.at].frame, guess, near(i, wanted));
    if (!seen || !seen->pose) return std::nullopt;
    // The centres of the two readings are apart by the thickness of the body at most.
    constexpr double kApart = 0.12;
    const Sighting& ours = *glimpses_[node.at].seen;
    if ((seen->centre_px - ours.centre_px).norm() > kApart * ours.rim.semi_major_px())
      return std::nullopt;
    const Eigen::Vector3d axis = axis_of(seen->pose->pose);
    if (between_axes(axis, axis_of(wanted), alike_) > between_axes(axis, axis_of(unwanted), alike_))
      return std::nullopt;
    seen->turned_rad = ours.turned_rad;
    return seen;
  }

  /// What it costs that node i does not go on from the two before it, in these readings.
  [[nodiscard]] double break_cost(std::size_t i, int a, int b, int c) const {
    constexpr double kMostFrames = 2.5, kLeast = 0.12, kOfStep = 0.35;
    constexpr double kMost = 12.0;  // no body leaps; a pose that is off by itself costs either way
    // All else equal, the slower motion: reading every other frame mirrored goes on evenly as well.
    constexpr double kPerRadian = 0.5;
    const AttitudeNode &first = nodes_[i - 2], &second = nodes_[i - 1], &third = nodes_[i];
    const double early = second.t_s - first.t_s, late = third.t_s - second.t_s;
    if (early > kMostFrames * frame_s_ || late > kMostFrames * frame_s_) return 0.0;
    const double ahead = late / early;
    const Pose &pb = second.poses[static_cast<std::size_t>(b)],
               &pc = third.poses[static_cast<std::size_t>(c)];
    Pose pa = first.poses[static_cast<std::size_t>(a)];
    if (alike_) pa = nearer_face(pa, pb, 0.0);
    const PoseChange change(pa, pb);
    const Eigen::Vector3d from = axis_of(pa), to = axis_of(pb), is = axis_of(pc);
    const double off = std::min(between_axes(change.axis_straight_on(pb, ahead), is, alike_),
                                between_axes(change.axis_turning_on(pb, ahead), is, alike_));
    // Of the two steps the smaller: a reading that leaps must not allow for itself.
    const double step = std::min(between_axes(from, to, alike_),
                                 between_axes(to, is, alike_) / std::max(ahead, 1e-9));
    const double allowed = kLeast + kOfStep * step;
    return std::min(kMost, 0.5 * off * off / (allowed * allowed)) +
           kPerRadian * between_axes(to, is, alike_) + tilt_cost(pb, pc);
  }

  /// Weight acts along the vertical: a body goes round that, and its tilt changes slowly. Going
  /// round the line of sight, as its mirror image does, it would bob up and down once a round.
  [[nodiscard]] double tilt_cost(const Pose& from, const Pose& to) const {
    constexpr double kLeast_rad = 0.02, kOfTurn = 0.15, kMost = 1.5;  // the rest nods
    const double turn_rad = between_axes(axis_of(from), axis_of(to), alike_);
    const double change_rad = between_tilts(from.theta_rad, to.theta_rad, alike_);
    return lean_weight_ * std::min(1.0, turn_rad / kAnother_rad) *
           std::min(kMost, change_rad / (kLeast_rad + kOfTurn * turn_rad));
  }

  /// The tilts of the two readings differ by up to twice as much as the line of sight leans. Tilts
  /// have errors, too, that go round with the axis (a lamp on one side of the body): what differs
  /// by no more than these tells nothing.
  [[nodiscard]] double lean_weight() const {
    constexpr double kErrors_rad = 0.05;
    double apart2 = 0.0;
    for (const AttitudeNode& node : nodes_)
      apart2 +=
          std::pow(between_tilts(node.poses[0].theta_rad, node.poses[1].theta_rad, alike_), 2);
    const double errors2 = kErrors_rad * kErrors_rad * static_cast<double>(nodes_.size());
    return apart2 > errors2 ? 1.0 - errors2 / apart2 : 0.0;
  }

  /// Pictures of nearly the same attitude share their errors: a node that was weighed tells as much
  /// of its own as the axis turns from one such node to the next, in the reading that takes less.
  [[nodiscard]] std::vector<double> turned_anew() const {
    constexpr double kLeast = 0.05;
    std::vector<std::size_t> weighed;
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (nodes_[i].weighed) weighed.push_back(i);
    const auto turn_rad = [&](std::size_t k) {
      const Eigen::Vector3d axis = axis_of(nodes_[weighed[k]].poses[0]);
      const auto& [one, other] = nodes_[weighed[k + 1]].poses;
      return std::min(between_axes(axis, axis_of(one), alike_),
                      between_axes(axis, axis_of(other), alike_));
    };
    std::vector<double> share(nodes_.size(), 1.0);
    for (std::size_t k = 0; weighed.size() > 1 && k < weighed.size(); ++k) {
      const double after = turn_rad(std::min(k, weighed.size() - 2));
      const double before = k > 0 ? turn_rad(k - 1) : after;
      share[weighed[k]] = std::clamp(0.5 * (before + after) / kAnother_rad, kLeast, 1.0);
    }
    return share;
  }

  /// Best sequences through every reading of every node, both ways; pairs of readings are the
  /// states.
  void solve() {
    using Costs = std::array<double, 4>;  // 2 * reading before + reading now
    const std::size_t n = nodes_.size();
    std::vector<Costs> until(n), beyond(n, Costs{});
    const std::vector<double> share = turned_anew();
    const auto own = [&](std::size_t i, int s) {
      const double score = share[i] * nodes_[i].score;
      return 0.5 * (s == 0 ? -score : score);
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

  std::vector<AttitudeDoubt> apply() {
    constexpr double kDoubtful = 2.0;
    std::vector<std::optional<AttitudeDoubt>> doubts(nodes_.size());
    on_all_cores(background_, finder_, nodes_.size(), [&](Measuring& measure, std::size_t i) {
      AttitudeNode& node = nodes_[i];
      if (node.tilt_rad < kLeastTilt) return;
      glimpses_[node.at].attitude_log_odds = std::abs(margin_[i]);
      auto& seen = glimpses_[node.at].seen;
      if (node.again) seen.swap(node.again);
      std::optional<Sighting>& other = node.other;
      if (margin_[i] < 0.0) {
        if (!other) other = measured(measure, i, 1);
        seen.swap(other);
      }
      if (std::abs(margin_[i]) >= kDoubtful) return;
      // What the picture does not bear out now, its neighbours may bring back.
      doubts[i] = AttitudeDoubt{node.at};
      if (!seen || !seen->pose) return;
      Sighting rival = other ? *other : *seen;
      if (!other) {
        rival.pose->pose = finder_.mirror_image(seen->pose->pose).value_or(seen->pose->pose);
        finder_.place(rival);
      }
      const Pose &chosen = seen->pose->pose, &mirrored = rival.pose->pose;
      doubts[i]->off_px = 0.5 * (rival.centre_px - seen->centre_px);
      doubts[i]->off_m = 0.5 * (mirrored.centre_m - chosen.centre_m).head<2>();
      doubts[i]->off_theta_rad = 0.5 * between_tilts(chosen.theta_rad, mirrored.theta_rad, alike_);
    });
    return with_frames_between(doubts);
  }

  /// A frame without the body, which its neighbours may bring back, is known no better than they
  /// are.
  [[nodiscard]] std::vector<AttitudeDoubt> with_frames_between(
      const std::vector<std::optional<AttitudeDoubt>>& of_nodes) const {
    std::vector<AttitudeDoubt> out;
    std::size_t next = 0;  // node
    for (std::size_t at = 0; at < glimpses_.size(); ++at) {
      const bool is_node = next < nodes_.size() && nodes_[next].at == at;
      if (is_node) {
        if (of_nodes[next]) out.push_back(*of_nodes[next]);
        ++next;
      } else if (!glimpses_[at].posed()) {
        for (const std::size_t k : {next - 1, next})
          if (k < nodes_.size() && of_nodes[k]) {
            out.push_back(*of_nodes[k]);
            out.back().at = at;
            break;
          }
      }
    }
    return out;
  }

  const Background& background_;
  const BodyFinder& finder_;
  std::vector<Glimpse>& glimpses_;
  bool alike_;
  double frame_s_ = 1.0;
  double lean_weight_ = 0.0;  ///< how much of what the two tilts differ by is more than errors
  std::vector<AttitudeNode> nodes_;
  std::vector<double> margin_;  ///< cost of the second reading beyond that of the first
};

}  // namespace

std::vector<AttitudeDoubt> decide_attitudes(const Background& background, const BodyFinder& finder,
                                            std::vector<Glimpse>& glimpses) {
  return Chain(background, finder, glimpses).decide();
}

void doubt_attitudes(const std::vector<AttitudeDoubt>& doubts, std::vector<Glimpse>& glimpses) {
  for (const AttitudeDoubt& doubt : doubts) {
    auto& seen = glimpses[doubt.at].seen;
    if (!seen || !seen->pose || seen->attitude_doubtful) continue;
    doubt_attitude(doubt.off_px, doubt.off_m, doubt.off_theta_rad, *seen);
  }
}

}  // namespace trochoid::tracking
