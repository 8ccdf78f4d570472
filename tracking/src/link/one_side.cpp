#include "link/one_side.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "link/expectation.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

/// Follows the body from one side into frames in which it was seen elsewhere, and keeps what it
/// finds as far as that scores higher, taken together.
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
    auto seen = measure_(*glimpses_[i].frame, where, Beside{next.pose(), -side_}, nullptr, there);
    if (!seen || !seen->pose || off_rad(*seen, where, finder_.faces_look_alike()) > 0.5 * off)
      return std::nullopt;
    return seen;
  }

  /// False where both are one again, or nothing is found, or it scores too low.
  [[nodiscard]] bool goes_on(std::size_t i) {
    // One frame's score scatters by a tenth or two: a stretch is given up at half of what it
    // had.
    constexpr double kGiveUp = 0.7, kOne = 0.5;
    const auto expected = leaves(i);
    if (!expected || expected->second < (led_.empty() ? 1.0 : kOne) * apart_rad_) return false;
    // A wide look may find again what the body was taken for; from next to it a close one does not.
    auto seen = nearer(i, *expected, false);
    if (!seen) seen = nearer(i, *expected, true);
    if (!seen) return false;
    seen->turned_rad = glimpses_[i].seen->turned_rad;
    // Not by accepted edges: the rim of a face in the light has more than a wall in the shade.
    log_ratio_ += log_score_ratio(*seen, *glimpses_[i].seen);
    as_led_[i].seen = std::move(seen);
    led_.push_back(i);
    if (log_ratio_ > best_log_ratio_) best_log_ratio_ = log_ratio_, kept_ = led_.size();
    return log_ratio_ > best_log_ratio_ - kGiveUp;
  }

  void close() {
    constexpr double kClearly = 0.1;  // as for a frame that its neighbours mend
    const std::size_t kept = best_log_ratio_ > kClearly ? kept_ : 0;
    for (std::size_t k = 0; k < led_.size(); ++k) {
      auto &was = glimpses_[led_[k]].seen, &now = as_led_[led_[k]].seen;
      (k < kept ? was : now) = k < kept ? now : was;
    }
    led_.clear();
    log_ratio_ = best_log_ratio_ = 0.0;
    kept_ = 0;
  }

  Measuring measure_;
  const BodyFinder& finder_;
  std::vector<Glimpse>& glimpses_;
  std::vector<Glimpse> as_led_;  ///< with the branch in place of what was seen
  int side_;
  double apart_rad_ = 0.0;
  std::vector<std::size_t> led_;  ///< frames of the branch
  double log_ratio_ = 0.0, best_log_ratio_ = 0.0;
  std::size_t kept_ = 0;  ///< frames of the branch up to the best
};

}  // namespace

void mend_from_one_side(const Background& background, const BodyFinder& finder,
                        std::vector<Glimpse>& glimpses) {
  for (const int side : {1, -1}) Branch(background, finder, glimpses, side).run();
}

}  // namespace trochoid::tracking
