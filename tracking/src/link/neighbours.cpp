#include "link/neighbours.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "link/expectation.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

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
    std::vector<double> supports_px;
    for (const Glimpse& g : was)
      if (g.posed()) supports_px.push_back(g.seen->visible_support_px());
    usual_visible_px_ = data::median(std::move(supports_px));
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
      if (found.seen && found.likelihood_ratio > best.likelihood_ratio) best = std::move(found);
    }
    return std::move(best.seen);
  }

 private:
  struct Found {
    std::optional<Sighting> seen;
    double likelihood_ratio = 0.0;  ///< to what was seen before; of nothing, its likelihood alone
  };

  /// How likely it is to be so far from what is expected.
  [[nodiscard]] double likelihood(double off_rad, const Expected& expected) const {
    const double off = off_rad / (usual_.scatter_rad() + expected.spread_rad);
    return 1.0 / (1.0 + off * off);
  }

  /// How much higher one sighting scores than another, > 0, times the ratio of their accepted
  /// edges. From where the body is expected a close look finds no longer outline of another thing:
  /// fewer accepted edges need not count.
  [[nodiscard]] double score_ratio(const Sighting& one, const Sighting& other) const {
    constexpr double kLeast = 1e-9;
    const double completer = std::max(kLeast, one.accepted) / std::max(kLeast, other.accepted);
    return std::exp(log_score_ratio(one, other)) *
           (closely_ ? std::max(completer, 1.0) : completer);
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
    if (!closely_) return measure(*was_[i].frame, expected.seen, Beside{expected.earlier, 1});
    const Surroundings surroundings = surroundings_of(was_, i);
    Sighting guess = expected.seen;
    guess.pose->blur_px = surroundings.blur_px;
    return measure(*was_[i].frame, std::move(guess), Beside{expected.earlier, 1},
                   &surroundings.shading, true);
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
    if (expected.contradicts(now_off, UsualMiss::kMost_rad)) return {};
    const double now = likelihood(now_off, expected);
    if (!before) {
      if (seen->visible_support_px() < kUsualShare * usual_visible_px_) return {};
      const double likely = now * seen->visible_support_px();
      return {std::move(seen), likely};
    }
    const double more = score_ratio(*seen, *before);
    const double gain = more * now / likelihood(off, expected);
    if (gain < kBetter || more < kAsGood) return {};
    seen->turned_rad = before->turned_rad;
    return {std::move(seen), gain};
  }

  const BodyFinder& finder_;
  const std::vector<Glimpse>& was_;
  bool closely_;
  std::vector<bool> poor_, none_;
  UsualMiss usual_;
  double usual_visible_px_ = 0.0;  ///< of Sighting::visible_support_px
};

/// What the frames around still contradict may be where they say instead: its covariance holds
/// both. Where it does so for another reading already, which may be the same, the tilt's alone is
/// seen to.
void doubt_reading(const Expected& expected, bool alike, Sighting& seen) {
  PoseMeasurement& pose = *seen.pose;
  const double off_rad =
      between_tilts(expected.seen.pose->pose.theta_rad, pose.pose.theta_rad, alike);
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

void doubt_what_is_contradicted(const BodyFinder& finder, std::vector<Glimpse>& glimpses) {
  constexpr double kPoorOff_rad = 0.1;
  const std::vector<Glimpse> was = glimpses;
  const std::vector<bool> poor = poor_fits(was), none(was.size(), false);
  const double suspicious_rad = UsualMiss(finder, was).suspicious_rad();
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
      doubted = doubted && (suspicious || expected->contradicts(off, UsualMiss::kMost_rad) ||
                            (poor[i] && off > kPoorOff_rad));
      if (off < least_rad) least_rad = off, nearest = std::move(expected);
    }
    if (nearest && doubted) doubt_reading(*nearest, finder.faces_look_alike(), *glimpses[i].seen);
  }
}

}  // namespace trochoid::tracking
