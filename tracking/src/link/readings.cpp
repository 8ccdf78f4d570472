#include "link/readings.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "geometry/pose_change.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using Pose = data::Pose<>;

/// How far a pose is from where the two before it lead: of its axis and of its centre.
struct Miss {
  double axis_rad, centre_m;
};

/// A frame with the body, and what it may show: first as tracked.
struct ReadingNode {
  std::size_t at;  ///< among the glimpses
  double t_s;
  std::vector<Sighting> readings;
  std::optional<Pose> rejected;  ///< mirror image of the first, where that is surely wrong
  std::size_t chosen = 0;

  [[nodiscard]] const Sighting& seen() const { return readings[chosen]; }
  [[nodiscard]] const Pose& pose() const { return seen().pose->pose; }
};

/// What a frame shows when it is looked at in another reading.
struct Otherwise {
  double log_score_ratio;  ///< of this reading to the one chosen
  double share;            ///< how far off it is, of the way to that reading
};
using Otherwises =
    std::array<std::optional<Otherwise>, std::tuple_size_v<BodyFinder::OtherReadings>>;

/// A body seen in a frame, and where it was when: how it is followed on.
struct Start {
  std::size_t at;  ///< of the nodes
  int side;        ///< 1 ahead, -1 back
  Sighting seen;
  Pose before;
  double before_s;
};

class Readings {
 public:
  Readings(const Background& background, const BodyFinder& finder, std::vector<Glimpse>& glimpses)
      : background_(background),
        finder_(finder),
        glimpses_(glimpses),
        alike_(finder.faces_look_alike()) {
    for (std::size_t i = 0; i < glimpses.size(); ++i)
      if (glimpses[i].posed())
        nodes_.push_back(
            {i, glimpses[i].frame->t_s, {*glimpses[i].seen}, rejected_attitude(glimpses[i])});
    // Of short recordings a dozen frames: by one or two of a few nothing is told.
    constexpr std::size_t kMostStride = 12, kLooks = 12;
    stride_ = std::clamp<std::size_t>(nodes_.size() / kLooks, 1, kMostStride);
    if (nodes_.size() > 1) frame_s_ = data::usual_step_s(nodes_, &ReadingNode::t_s);
  }

  ReadingDoubt choose() {
    constexpr std::size_t kFewest = 8;
    constexpr int kRounds = 2;  // what was found may be followed on itself
    if (nodes_.size() < kFewest) return {};
    learn();
    follow(others());
    solve();
    for (int round = 0; round < kRounds; ++round) {
      const std::vector<std::size_t> before = path();
      learn();
      follow(breaks());
      solve();
      // A path that stays would be followed on from the same frames to the same ends again.
      if (path() == before) break;
    }
    ReadingDoubt doubt{.tallies = tallies()};
    for (ReadingNode& node : nodes_) {
      if (node.chosen == 0) continue;
      auto& seen = glimpses_[node.at].seen;
      node.readings[node.chosen].turned_rad = seen->turned_rad;
      seen = std::move(node.readings[node.chosen]);
      doubt.otherwise = true;
    }
    return doubt;
  }

 private:
  /// Whether frame k follows on the one before it, or nearly so.
  [[nodiscard]] bool follows(std::size_t k) const {
    constexpr double kMostFrames = 2.5;
    return k > 0 && k < nodes_.size() && nodes_[k].t_s - nodes_[k - 1].t_s < kMostFrames * frame_s_;
  }

  [[nodiscard]] bool same(const Sighting& a, const Sighting& b) const {
    constexpr double kSame_rad = 0.02;
    return between_axes(axis_of(a.pose->pose), axis_of(b.pose->pose), alike_) < kSame_rad &&
           (a.centre_px - b.centre_px).norm() < kSame_rad * a.rim.semi_major_px();
  }

  /// What was chosen of each frame.
  [[nodiscard]] std::vector<std::size_t> path() const {
    std::vector<std::size_t> chosen;
    for (const ReadingNode& node : nodes_) chosen.push_back(node.chosen);
    return chosen;
  }

  void add(std::size_t k, Sighting seen) {
    std::vector<Sighting>& known = nodes_[k].readings;
    if (std::none_of(known.begin(), known.end(),
                     [&](const Sighting& other) { return same(other, seen); }))
      known.push_back(std::move(seen));
  }

  /// The mirror image where all frames together clearly decided against it: by more than how well
  /// outlines fit, and by more than a leap costs there (12), which a body that rattles may do.
  [[nodiscard]] std::optional<Pose> rejected_attitude(const Glimpse& glimpse) const {
    constexpr double kSure = 18.0;
    return glimpse.attitude_log_odds > kSure ? finder_.mirror_image(glimpse.pose()) : std::nullopt;
  }

  [[nodiscard]] bool is_rejected(std::size_t k, const Sighting& seen) const {
    constexpr double kNearer = 0.5;
    const ReadingNode& node = nodes_[k];
    if (!node.rejected) return false;
    const Eigen::Vector3d axis = axis_of(seen.pose->pose);
    return between_axes(axis, axis_of(*node.rejected), alike_) <
           kNearer * between_axes(axis, axis_of(node.readings[0].pose->pose), alike_);
  }

  [[nodiscard]] std::optional<Sighting> measured(Measuring& measure, std::size_t k,
                                                 const Pose& pose, const Beside& near) const {
    Sighting guess = nodes_[k].seen();
    guess.pose->pose = pose;
    auto seen = measure(*glimpses_[nodes_[k].at].frame, std::move(guess), near);
    return seen && seen->pose && !is_rejected(k, *seen) ? std::move(seen) : std::nullopt;
  }

  /// A pose of frame k one frame earlier (side 1) or later, moving as the body was seen to.
  [[nodiscard]] std::optional<Pose> one_frame_off(std::size_t k, const Pose& pose, int side) const {
    const bool from_before = follows(k) && (side > 0 || !follows(k + 1));
    const std::size_t to = from_before ? k : k + 1;
    if (!follows(to)) return std::nullopt;
    const double share = -side * frame_s_ / (nodes_[to].t_s - nodes_[to - 1].t_s);
    return change(nodes_[to - 1].pose(), nodes_[to].pose(), PoseChange::kBeside).on(pose, share);
  }

  /// Frame k in another reading; nothing if there is none or the picture leads elsewhere.
  [[nodiscard]] std::optional<Sighting> read_otherwise(Measuring& measure, std::size_t k,
                                                       const std::optional<Pose>& other) const {
    const auto before = other ? one_frame_off(k, *other, 1) : std::nullopt;
    if (!before) return std::nullopt;
    auto seen = measured(measure, k, *other, {*before, 1});
    return seen && !same(*seen, nodes_[k].seen()) ? std::move(seen) : std::nullopt;
  }

  /// Compares what was seen in frame k with the reading in which it was looked at. Nothing for what
  /// is farther off than that: the mirror image, or another thing.
  [[nodiscard]] std::optional<Otherwise> compared(const Pose& reading, const Sighting& seen,
                                                  std::size_t k) const {
    constexpr double kFarthest = 2.0, kNear_radii = 0.25;
    const Sighting& chosen = nodes_[k].seen();
    const Eigen::Vector3d axis = axis_of(chosen.pose->pose);
    const double share = between_axes(axis_of(seen.pose->pose), axis, alike_) /
                         between_axes(axis_of(reading), axis, alike_);
    if (!(share < kFarthest) ||
        (seen.centre_px - chosen.centre_px).norm() > kNear_radii * chosen.rim.semi_major_px())
      return std::nullopt;
    return Otherwise{log_score_ratio(seen, chosen), share};
  }

  /// Other readings of every so many frames that score about as high.
  [[nodiscard]] std::vector<Start> others() {
    constexpr double kAsGood = -0.05;
    std::vector<std::vector<Start>> found(nodes_.size() / stride_);
    as_tracked_.resize(found.size());
    on_all_cores(background_, finder_, found.size(), [&](Measuring& measure, std::size_t i) {
      const std::size_t k = i * stride_ + stride_ / 2;
      const auto others = finder_.other_readings(nodes_[k].pose());
      for (std::size_t which = 0; which < others.size(); ++which) {
        const auto seen = read_otherwise(measure, k, others[which]);
        if (!seen) continue;
        as_tracked_[i][which] = compared(*others[which], *seen, k);
        if (log_score_ratio(*seen, nodes_[k].seen()) < kAsGood) continue;
        for (const int side : {1, -1})
          if (const auto off = one_frame_off(k, seen->pose->pose, side))
            found[i].push_back({k, side, *seen, *off, nodes_[k].t_s - side * frame_s_});
      }
    });
    std::vector<Start> starts;
    for (const auto& some : found) starts.insert(starts.end(), some.begin(), some.end());
    for (const Start& start : starts) add(start.at, start.seen);
    return starts;
  }

  /// Whether frame k and those beside it are still seen as they were tracked.
  [[nodiscard]] bool is_as_tracked(std::size_t k) const {
    const auto end = std::min(nodes_.size(), k + 2);
    for (std::size_t i = k - std::min<std::size_t>(k, 1); i < end; ++i)
      if (nodes_[i].chosen != 0) return false;
    return true;
  }

  /// Of every stride-th frame of the path that was chosen.
  [[nodiscard]] ReadingTallies tallies() const {
    std::vector<Otherwises> frames(nodes_.size() / stride_);
    on_all_cores(background_, finder_, frames.size(), [&](Measuring& measure, std::size_t i) {
      const std::size_t k = i * stride_ + stride_ / 2;
      if (is_as_tracked(k)) {
        frames[i] = as_tracked_[i];
        return;
      }
      const auto others = finder_.other_readings(nodes_[k].pose());
      for (std::size_t which = 0; which < others.size(); ++which)
        if (const auto seen = read_otherwise(measure, k, others[which]))
          frames[i][which] = compared(*others[which], *seen, k);
    });
    ReadingTallies sums;
    for (const Otherwises& frame : frames)
      for (std::size_t which = 0; which < sums.size(); ++which) {
        ReadingTally& sum = sums[which];
        sum.looked_at += 1.0;
        if (!frame[which]) continue;
        sum.found += 1.0;
        sum.log_score_ratio += frame[which]->log_score_ratio;
        sum.square += frame[which]->share * frame[which]->share;
      }
    return sums;
  }

  /// Where the path breaks, it may have gone on from either side.
  [[nodiscard]] std::vector<Start> breaks() const {
    constexpr double kBreak = 0.5 * kMost;
    const std::size_t n = nodes_.size();
    std::vector<char> ahead(n, 0), back(n, 0);
    for (std::size_t k = 2; k < n; ++k)
      if (break_cost(k, nodes_[k - 2].chosen, nodes_[k - 1].chosen, nodes_[k].chosen) > kBreak)
        ahead[k - 2] = ahead[k - 1] = back[k - 1] = back[k] = 1;
    std::vector<Start> starts;
    for (std::size_t k = 0; k < n; ++k) {
      if (ahead[k] && follows(k))
        starts.push_back({k, 1, nodes_[k].seen(), nodes_[k - 1].pose(), nodes_[k - 1].t_s});
      if (back[k] && follows(k + 1))
        starts.push_back({k, -1, nodes_[k].seen(), nodes_[k + 1].pose(), nodes_[k + 1].t_s});
    }
    return starts;
  }

  /// Adds what is found on the way from each start.
  void follow(const std::vector<Start>& starts) {
    std::vector<std::vector<std::pair<std::size_t, Sighting>>> found(starts.size());
    on_all_cores(background_, finder_, starts.size(), [&](Measuring& measure, std::size_t i) {
      found[i] = followed(measure, starts[i]);
    });
    for (auto& way : found)
      for (auto& [k, seen] : way) add(k, std::move(seen));
  }

  /// Until it is one with the path again, nothing is found, or its scores are too low.
  [[nodiscard]] std::vector<std::pair<std::size_t, Sighting>> followed(Measuring& measure,
                                                                       Start from) const {
    // One frame's score scatters by a tenth or two: a way is given up at half of what it had.
    constexpr double kGiveUp = 0.7;
    std::vector<std::pair<std::size_t, Sighting>> found;
    double sum = 0.0, best = 0.0;
    while (follows(from.side > 0 ? from.at + 1 : from.at)) {
      const std::size_t k = from.side > 0 ? from.at + 1 : from.at - 1;
      const Pose last = from.seen.pose->pose;
      const double last_s = nodes_[from.at].t_s;
      const double ahead = (nodes_[k].t_s - last_s) / (last_s - from.before_s);
      auto seen = measured(measure, k, change(from.before, last).on(last, ahead, centre_),
                           {last, from.side});
      if (!seen || same(*seen, nodes_[k].seen())) break;
      sum += log_score_ratio(*seen, nodes_[k].seen());
      best = std::max(best, sum);
      if (sum < best - kGiveUp) break;
      found.emplace_back(k, *seen);
      from = {k, from.side, std::move(*seen), last, last_s};
    }
    return found;
  }

  [[nodiscard]] PoseChange change(const Pose& from, const Pose& to,
                                  double least_sine = PoseChange::kBeyond) const {
    return {alike_ ? nearer_face(from, to, 0.0) : from, to, least_sine};
  }

  /// Straight on, and round with the precession.
  [[nodiscard]] std::pair<Miss, Miss> misses(std::size_t k, std::size_t a, std::size_t b,
                                             std::size_t c) const {
    const Pose &second = nodes_[k - 1].readings[b].pose->pose,
               &third = nodes_[k].readings[c].pose->pose;
    const PoseChange step = change(nodes_[k - 2].readings[a].pose->pose, second);
    const double ahead =
        (nodes_[k].t_s - nodes_[k - 1].t_s) / (nodes_[k - 1].t_s - nodes_[k - 2].t_s);
    const Eigen::Vector3d axis = axis_of(third), went = third.centre_m - second.centre_m;
    const auto miss = [&](const Eigen::Vector3d& expected, PoseChange::Centre centre) {
      return Miss{between_axes(expected, axis, alike_),
                  (went - step.shift_m(ahead, centre)).head<2>().norm()};
    };
    return {miss(step.axis_straight_on(second, ahead), PoseChange::Centre::straight),
            miss(step.axis_turning_on(second, ahead), PoseChange::Centre::turning)};
  }

  /// How the body moves: what its path misses by as a rule, and whether its centre goes round.
  void learn() {
    constexpr double kLeast_rad = 0.02, kOfUsual = 1.5, kSigmas = 2.0;
    std::vector<double> axis, centre, straight, round, sd;
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      sd.push_back(std::sqrt(0.5 * nodes_[k].seen().pose->covariance_m2.trace()));
      if (k < 2 || !follows(k) || !follows(k - 1)) continue;
      const auto [on, about] =
          misses(k, nodes_[k - 2].chosen, nodes_[k - 1].chosen, nodes_[k].chosen);
      axis.push_back(std::min(on.axis_rad, about.axis_rad));
      centre.push_back(std::min(on.centre_m, about.centre_m));
      straight.push_back(on.centre_m), round.push_back(about.centre_m);
    }
    if (axis.empty()) return;
    centre_ = data::median(std::move(round)) < data::median(std::move(straight))
                  ? PoseChange::Centre::turning
                  : PoseChange::Centre::straight;
    usual_ = {std::max(kLeast_rad, kOfUsual * data::median(std::move(axis))),
              std::max(kSigmas * data::median(std::move(sd)),
                       kOfUsual * data::median(std::move(centre)))};
  }

  /// What it costs that frame k does not go on from the two before it, in these readings.
  [[nodiscard]] double break_cost(std::size_t k, std::size_t a, std::size_t b,
                                  std::size_t c) const {
    if (!follows(k) || !follows(k - 1)) return 0.0;
    const auto [on, about] = misses(k, a, b, c);
    const double axis = std::min(on.axis_rad, about.axis_rad) / usual_.axis_rad;
    const double centre = std::min(on.centre_m, about.centre_m) / usual_.centre_m;
    return std::min(kMost, 0.5 * (axis * axis + centre * centre));
  }

  /// What it costs that a reading has a lower score than the frame as tracked.
  [[nodiscard]] double own_cost(std::size_t k, std::size_t c) const {
    constexpr double kPerLogRatio = 12.0;  // fits as good as each other scatter by a tenth or so
    return -kPerLogRatio * log_score_ratio(nodes_[k].readings[c], nodes_[k].readings[0]);
  }

  /// The best path; pairs of readings of successive frames are the states.
  void solve() {
    const std::size_t n = nodes_.size();
    const auto count = [&](std::size_t k) { return nodes_[k].readings.size(); };
    Eigen::MatrixXd until(count(0), count(1));
    for (std::size_t a = 0; a < count(0); ++a)
      for (std::size_t b = 0; b < count(1); ++b) until(a, b) = own_cost(0, a) + own_cost(1, b);
    std::vector<Eigen::MatrixX<std::size_t>> from(n);
    for (std::size_t k = 2; k < n; ++k) {
      Eigen::MatrixXd next(count(k - 1), count(k));
      from[k].resize(next.rows(), next.cols());
      for (std::size_t b = 0; b < count(k - 1); ++b)
        for (std::size_t c = 0; c < count(k); ++c) {
          double least = std::numeric_limits<double>::infinity();
          for (std::size_t a = 0; a < count(k - 2); ++a) {
            const double sum = until(a, b) + break_cost(k, a, b, c);
            if (sum < least) least = sum, from[k](b, c) = a;
          }
          next(b, c) = least + own_cost(k, c);
        }
      until = std::move(next);
    }
    Eigen::Index b = 0, c = 0;
    until.minCoeff(&b, &c);
    nodes_[n - 2].chosen = static_cast<std::size_t>(b);
    nodes_[n - 1].chosen = static_cast<std::size_t>(c);
    for (std::size_t k = n - 1; k >= 2; --k)
      nodes_[k - 2].chosen = from[k](nodes_[k - 1].chosen, nodes_[k].chosen);
  }

  /// A break costs at most what five frames gain in which another reading scores a tenth higher;
  /// a leap and the way back are four breaks.
  static constexpr double kMost = 6.0;
  std::size_t stride_ = 1;  ///< of the frames that are read otherwise

  const Background& background_;
  const BodyFinder& finder_;
  std::vector<Glimpse>& glimpses_;
  bool alike_;
  double frame_s_ = 1.0;
  std::vector<ReadingNode> nodes_;
  std::vector<Otherwises> as_tracked_;  ///< of every stride-th frame, beside how it was tracked
  Miss usual_{1.0, 1.0};
  PoseChange::Centre centre_ = PoseChange::Centre::straight;  ///< how it goes on
};

}  // namespace

ReadingDoubt choose_readings(const Background& background, const BodyFinder& finder,
                             std::vector<Glimpse>& glimpses) {
  return Readings(background, finder, glimpses).choose();
}

void place_other_readings(const BodyFinder& finder, std::size_t settled,
                          std::vector<Glimpse>& glimpses) {
  constexpr double kLying = 1e-6;  // found to lie on its face, by more than its edges
  for (std::size_t i = settled; i < glimpses.size(); ++i) {
    if (!glimpses[i].posed()) continue;
    Sighting& seen = *glimpses[i].seen;
    seen.other_readings = {};
    const Pose pose = seen.pose->pose;
    if (std::sin(pose.theta_rad) < kLying) continue;
    const auto others = finder.other_readings(pose);
    for (std::size_t which = 0; which < others.size(); ++which) {
      if (!others[which]) continue;
      const Eigen::Vector2d off_m = (others[which]->centre_m - pose.centre_m).head<2>();
      const double turn = data::wrapped(others[which]->phi_rad - pose.phi_rad);
      PoseSpread& spread = seen.other_readings[which];
      spread.m2 = off_m * off_m.transpose();
      spread.theta_rad2 = std::pow(others[which]->theta_rad - pose.theta_rad, 2);
      spread.across_rad2 = std::pow(std::sin(pose.theta_rad) * turn, 2);
    }
  }
}

PoseSpread spread_over_readings(const ReadingTallies& of_path, const Sighting& seen) {
  PoseSpread sum;
  for (std::size_t which = 0; which < of_path.size(); ++which) {
    const double square = of_path[which].expected_square();
    const PoseSpread& spread = seen.other_readings[which];
    sum.m2 += square * spread.m2;
    sum.theta_rad2 += square * spread.theta_rad2;
    sum.across_rad2 += square * spread.across_rad2;
  }
  return sum;
}

void ReadingTally::add(const ReadingTally& other) {
  looked_at += other.looked_at, found += other.found;
  log_score_ratio += other.log_score_ratio, square += other.square;
}

double ReadingTally::expected_square() const {
  // Between recordings, and between pictures: of 46 of the independent clips the mean score ratio
  // of the right reading was 0.12 at least and 1.0 as a rule, pictures of one scattered by 0.4. The
  // spread over what is hardly likely is no error bar: it would be as wide as nothing that was
  // seen.
  constexpr double kShared = 0.2, kOfOne = 0.2, kHardly = 0.02;
  constexpr double kChance = 1.0;  // frames
  if (found <= kChance) return 0.0;
  const double sd = std::sqrt(kShared * kShared + kOfOne * kOfOne / found);
  const double likely =
      found / looked_at * 0.5 * std::erfc(-log_score_ratio / found / (sd * std::numbers::sqrt2));
  return likely > kHardly ? likely * square / found : 0.0;
}

}  // namespace trochoid::tracking
