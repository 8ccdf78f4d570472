#include "link/spin_sequence.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

class SpinSequence {
 public:
  explicit SpinSequence(const std::vector<Glimpse>& glimpses) {
    for (std::size_t i = 0; i < glimpses.size(); ++i)
      if (glimpses[i].posed() && glimpses[i].seen->pose->sigma_psi_rad)
        readings_.push_back(
            {i, glimpses[i].frame->t_s, glimpses[i].pose(), glimpses[i].seen->pose->bright_marks});
    if (readings_.size() > 1) frame_s_ = data::usual_step_s(readings_, &Reading::t_s);
    for (const Reading& reading : readings_) {
      ++count_[reading.upper()];
      bright_[reading.upper()] += reading.bright;
    }
  }

  /// Frames whose spin is off.
  [[nodiscard]] std::vector<std::size_t> off() const {
    std::vector<std::size_t> frames;
    for (std::size_t k = 0; k < readings_.size(); ++k)
      if (contradicted(k)) frames.push_back(readings_[k].frame);
    return frames;
  }

 private:
  struct Reading {
    std::size_t frame;
    double t_s;
    data::Pose<> pose;
    bool bright;

    [[nodiscard]] std::size_t upper() const { return pose.theta_rad < 0.5 * data::kPi ? 1 : 0; }
  };

  /// About the body's own axis, modulo a turn: what precession turns the node line by, from which
  /// spin is counted, is part of it.
  static double turn_rad(const Reading& from, const Reading& to) {
    const double cosine = 0.5 * (std::cos(from.pose.theta_rad) + std::cos(to.pose.theta_rad));
    return data::wrapped(to.pose.psi_rad - from.pose.psi_rad +
                         cosine * data::wrapped(to.pose.phi_rad - from.pose.phi_rad));
  }

  /// The first and one beyond the last reading within so many frames of reading k.
  [[nodiscard]] std::pair<std::size_t, std::size_t> around(std::size_t k, double frames) const {
    const auto near = [&](std::size_t i) {
      return std::abs(readings_[i].t_s - readings_[k].t_s) < (frames + 0.5) * frame_s_;
    };
    std::size_t from = k, to = k + 1;
    while (from > 0 && near(from - 1)) --from;
    while (to < readings_.size() && near(to)) ++to;
    return {from, to};
  }

  /// What the body turns by in so long about reading k, by the others alone: of all their turns the
  /// one that the rest are closest to; nothing of only a few.
  [[nodiscard]] std::optional<double> usual_turn_rad(std::size_t k, double duration_s) const {
    constexpr double kReach_frames = 10.0;
    constexpr std::size_t kFewest = 3;
    const auto [from, to] = around(k, kReach_frames);
    std::vector<double> turns;
    for (std::size_t i = from; i < to; ++i)
      for (std::size_t j = i + 1; j < to; ++j)
        if (i != k && j != k &&
            std::abs(readings_[j].t_s - readings_[i].t_s - duration_s) < 0.1 * frame_s_)
          turns.push_back(turn_rad(readings_[i], readings_[j]));
    if (turns.size() < kFewest) return std::nullopt;
    std::optional<double> usual;
    double least = std::numeric_limits<double>::infinity();
    for (const double one : turns) {
      double apart = 0.0;
      for (const double other : turns) apart += std::abs(data::wrapped(other - one));
      if (apart < least) least = apart, usual = one;
    }
    return usual;
  }

  /// Whether the body turns by the same from the first of three readings one after the other, as
  /// far apart, to the second and from that to the third.
  [[nodiscard]] bool even(std::size_t first) const {
    constexpr double kEven_rad =
        0.7;  // a wrong mark is off by less in a quarter of cases, by chance
    if (first + 2 >= readings_.size()) return false;
    const Reading &a = readings_[first], &b = readings_[first + 1], &c = readings_[first + 2];
    return std::abs(c.t_s - b.t_s - (b.t_s - a.t_s)) < 0.1 * frame_s_ &&
           std::abs(data::wrapped(turn_rad(b, c) - turn_rad(a, b))) < kEven_rad;
  }

  /// Whether a reading goes with those right before, right after or on both sides of it: the rate
  /// may have changed there, or change fast.
  [[nodiscard]] bool goes_on(std::size_t k) const {
    return even(k) || (k >= 1 && even(k - 1)) || (k >= 2 && even(k - 2));
  }

  /// Whether a mark looks otherwise than nearly all that are seen of its face.
  [[nodiscard]] bool strange(std::size_t k) const {
    constexpr double kFew = 0.2;
    const Reading& reading = readings_[k];
    const int bright = bright_[reading.upper()], all = count_[reading.upper()];
    return (reading.bright ? bright : all - bright) < kFew * all;
  }

  [[nodiscard]] bool contradicted(std::size_t k) const {
    if (goes_on(k)) return false;
    if (strange(k)) return true;
    constexpr double kNext_frames = 3.0, kMost = 0.75;
    constexpr double kFar_rad = 1.0;  // no error of a mark that is the right one
    constexpr int kFewest = 3;
    const auto [from, to] = around(k, kNext_frames);
    int asked = 0, against = 0;
    for (std::size_t i = from; i < to; ++i) {
      if (i == k) continue;
      const Reading &early = readings_[std::min(i, k)], &late = readings_[std::max(i, k)];
      const auto usual = usual_turn_rad(k, late.t_s - early.t_s);
      if (!usual) continue;
      ++asked;
      against += std::abs(data::wrapped(turn_rad(early, late) - *usual)) > kFar_rad;
    }
    return asked >= kFewest && against >= kMost * asked;
  }

  std::vector<Reading> readings_;
  std::array<int, 2> count_{}, bright_{};  // of the lower and the upper face's readings
  double frame_s_ = 1.0;
};

}  // namespace

void forget_spins_off_their_sequence(std::vector<Glimpse>& glimpses) {
  for (const std::size_t frame : SpinSequence(glimpses).off())
    glimpses[frame].seen->pose->sigma_psi_rad.reset();
}

}  // namespace trochoid::tracking
