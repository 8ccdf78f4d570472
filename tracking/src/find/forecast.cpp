#include "find/forecast.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "find/usual_frames.hpp"
#include "geometry/pose_change.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::tracking {
namespace {

using Pose = data::Pose<>;
constexpr double kFirstSurprise_px = 2.0;

double nearest(double angle, double reference, double period) {
  return angle + period * std::round((reference - angle) / period);
}

/// Three values a quantity took and when, oldest first; extrapolates by Newton's formula.
template <class Value>
struct Three {
  double t0, t1, t2;
  Value v0, v1, v2;

  [[nodiscard]] Value quadratic(double t) const {
    const Value late = (v2 - v1) / (t2 - t1), early = (v1 - v0) / (t1 - t0);
    return v2 + (t - t2) * late + (t - t2) * (t - t1) / (t2 - t0) * (late - early);
  }
};

/// Tilt and precession with their changes of rate; the centre's velocity turns with the precession,
/// as it does for whatever rolls on its rim.
Pose turning_on(const Three<Pose>& past, double t) {
  const Pose &a = past.v0, &b = past.v1, &c = past.v2;
  const double phi_b = b.phi_rad, phi_a = nearest(a.phi_rad, phi_b, data::kTurn),
               phi_c = nearest(c.phi_rad, phi_b + (phi_b - phi_a), data::kTurn);
  Pose next = c;
  const Three<double> phi{past.t0, past.t1, past.t2, phi_a, phi_b, phi_c};
  const Three<double> theta{past.t0, past.t1, past.t2, a.theta_rad, b.theta_rad, c.theta_rad};
  next.phi_rad = phi.quadratic(t);
  next.theta_rad = std::clamp(theta.quadratic(t), 0.0, data::kPi);
  const Eigen::Vector3d late = (c.centre_m - b.centre_m) / (past.t2 - past.t1);
  const double between = 0.5 * (phi_c + next.phi_rad) - 0.5 * (phi_b + phi_c);
  next.centre_m = c.centre_m + (t - past.t2) * data::turned_about_vertical(late, between);
  return next;
}

/// Axis and centre on parabolas: a body rocking over its face, where precession leaps.
Pose swinging_on(const Three<Pose>& past, double t) {
  const auto of = [&](const auto& quantity) {
    return Three<Eigen::Vector3d>{past.t0,           past.t1,           past.t2,
                                  quantity(past.v0), quantity(past.v1), quantity(past.v2)};
  };
  Pose next = past.v2;
  set_axis(of(data::axis_of).quadratic(t).normalized(), next);
  next.phi_rad = nearest(next.phi_rad, past.v2.phi_rad, data::kTurn);
  next.centre_m = of([](const Pose& p) { return p.centre_m; }).quadratic(t);
  return next;
}

}  // namespace

double apart_px(const Sighting& a, const Sighting& b) {
  double apart = (a.centre_px - b.centre_px).norm();
  if (a.pose && b.pose) {
    const Eigen::Vector3d one = axis_of(a.pose->pose), other = axis_of(b.pose->pose);
    apart = std::max(apart, one.cross(other).norm() * a.rim.semi_major_px());
  }
  return apart;
}

void Forecast::start(double t_s, const Sighting& seen) {
  past_.clear();
  past_.push_back({t_s, seen});
  missed_px_.fill(std::max(kFirstSurprise_px, 0.25 * seen.rim.semi_minor_px()));
  // Until it is seen to stand still or to turn, going on is the better guess.
  missed_px_[kStill] *= 1.5;
  missed_px_[kTurning] *= 2.0;
  missed_px_[kSwinging] *= 2.0;
  frame_s_ = 0.0;
}

double Forecast::frames_since(double t_s) const {
  return frame_s_ > 0.0 ? std::abs(t_s - past_.back().t_s) / frame_s_ : 1.0;
}

Forecast::Manner Forecast::trusted() const {
  if (past_.size() < 2) return kStill;
  // Where going on is no worse than standing still, it is right more often in the next frame.
  Manner best = kStraight;
  for (const Manner bent : {kTurning, kSwinging})
    if (past_.size() >= 3 && missed_px_[bent] < 0.9 * missed_px_[best]) best = bent;
  if (missed_px_[kStill] < 0.7 * missed_px_[best]) best = kStill;
  return best;
}

Sighting Forecast::guess(Manner manner, double t_s) const {
  const Moment& last = past_.back();
  Sighting p = last.seen;
  p.edges.clear();
  if (past_.size() < 2 || manner == kStill) return p;
  const Moment& before = past_[past_.size() - 2];
  // Rates older than a few usual frames say little; they fade while the body stays lost. What is
  // bent comes from three frames, and what they are wrong by grows with the square of the frames it
  // is carried on, however soon these follow each other.
  constexpr double kFadeAfter = 6.0;
  const double since = frames_since(t_s);
  const double fade_after = manner == kStraight ? kFadeAfter / usual_frames(frame_s_) : kFadeAfter;
  const double t = last.t_s + (t_s - last.t_s) * std::min(1.0, fade_after / std::max(since, 1.0));
  const double ahead = (t - last.t_s) / (last.t_s - before.t_s);
  const bool bent = manner != kStraight && past_.size() >= 3;
  const Moment& first = past_.front();
  const auto three = [&](const auto& of) {
    return Three<std::decay_t<decltype(of(first))>>{first.t_s, before.t_s, last.t_s,
                                                    of(first), of(before), of(last)};
  };
  p.centre_px = bent ? three([](const Moment& m) { return m.seen.centre_px; }).quadratic(t)
                     : Eigen::Vector2d(last.seen.centre_px +
                                       ahead * (last.seen.centre_px - before.seen.centre_px));
  p.rim.centre_px = p.centre_px + (last.seen.rim.centre_px - last.seen.centre_px);
  constexpr double kFewFrames = 3.0;  // farther on the noise of two shapes would outgrow both
  if (since < kFewFrames) {
    const Eigen::Matrix2d shape =
        p.rim.shape_px + ahead * (last.seen.rim.shape_px - before.seen.rim.shape_px);
    if (shape.determinant() > 0.3 * p.rim.shape_px.determinant()) p.rim.shape_px = shape;
  }
  if (p.pose && before.seen.pose) {
    const bool poses = bent && first.seen.pose;
    const Pose &from = before.seen.pose->pose, &to = last.seen.pose->pose;
    const bool steep = is_steep(from) || is_steep(to) || (poses && is_steep(first.seen.pose->pose));
    const auto pose_of = [](const Moment& m) { return m.seen.pose->pose; };
    if (poses && manner == kTurning && !steep)
      p.pose->pose = turning_on(three(pose_of), t);
    else if (poses && manner == kSwinging)
      p.pose->pose = swinging_on(three(pose_of), t);
    else
      p.pose->pose = PoseChange(from, to).on(to, ahead);
    finder_.place(p);
  }
  if (p.turned_rad && before.seen.turned_rad)
    *p.turned_rad += ahead * (*last.seen.turned_rad - *before.seen.turned_rad);
  return p;
}

Sighting Forecast::at(double t_s) const {
  return guess(trusted(), t_s);
}

std::vector<Sighting> Forecast::alternatives(double t_s) const {
  std::vector<Sighting> guesses;
  if (past_.size() < 2) return guesses;
  const Manner first = trusted();
  std::array<Manner, kManners> order{kStraight, kTurning, kSwinging, kStill};
  std::sort(order.begin(), order.end(),
            [&](Manner a, Manner b) { return missed_px_[a] < missed_px_[b]; });
  std::vector<Sighting> known{guess(first, t_s)};
  const auto differs = [&](const Sighting& s) {
    return std::all_of(known.begin(), known.end(),
                       [&](const Sighting& k) { return apart_px(s, k) > 1.0; });
  };
  for (const Manner manner : order) {
    if (manner == first) continue;
    Sighting other = guess(manner, t_s);
    if (!differs(other)) continue;
    known.push_back(other);
    guesses.push_back(std::move(other));
  }
  return guesses;
}

std::optional<Sighting> Forecast::one_frame_before(const Sighting& seen) const {
  constexpr double kSuccessive = 1.5;
  if (past_.size() < 2 || !seen.pose) return std::nullopt;
  const Moment &last = past_.back(), &before = past_[past_.size() - 2];
  if (!last.seen.pose || !before.seen.pose) return std::nullopt;
  if (std::abs(last.t_s - before.t_s) > kSuccessive * frame_s_) return std::nullopt;
  const Pose &from = before.seen.pose->pose, &to = last.seen.pose->pose;
  Sighting earlier = seen;
  earlier.pose->pose = PoseChange(from, to, PoseChange::kBeside).on(seen.pose->pose, -1.0);
  finder_.place(earlier);
  return earlier;
}

void Forecast::add(double t_s, const Sighting& seen, bool lasting) {
  const double step_s = std::abs(t_s - past_.back().t_s);
  if (frame_s_ <= 0.0) frame_s_ = step_s;
  const double since = frames_since(t_s);
  if (since < 1.5) frame_s_ = 0.9 * frame_s_ + 0.1 * step_s;
  if (past_.size() >= 2 && since < 3.0)
    for (const Manner manner : {kStraight, kTurning, kSwinging, kStill}) {
      if ((manner == kTurning || manner == kSwinging) && past_.size() < 3) continue;
      const double missed = apart_px(guess(manner, t_s), seen);
      missed_px_[manner] = std::max(0.7 * missed_px_[manner] + 0.3 * missed, 0.5 * missed);
    }
  Sighting kept = seen;
  kept.edges.clear();
  // What hides part of a body bends its fitted shape, and the next guess with it.
  if (!lasting) kept.rim.shape_px = past_.back().seen.rim.shape_px;
  past_.push_back({t_s, std::move(kept)});
  if (past_.size() > 3) past_.pop_front();
}

}  // namespace trochoid::tracking
