#include "follower.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "silhouette.hpp"

namespace trochoid::tracking {
namespace {

cv::Rect box_around(const Eigen::Vector2d& centre_px, double half_px, const cv::Size& picture) {
  const cv::Rect box(static_cast<int>(centre_px.x() - half_px),
                     static_cast<int>(centre_px.y() - half_px), static_cast<int>(2 * half_px) + 1,
                     static_cast<int>(2 * half_px) + 1);
  return box & cv::Rect({}, picture);
}

bool inside(const Eigen::Vector2d& p, const cv::Size& picture, double margin_px) {
  return p.x() > -margin_px && p.y() > -margin_px && p.x() < picture.width + margin_px &&
         p.y() < picture.height + margin_px;
}

bool is_other(const Eigen::Vector2d& centre_px, const Follower::Others& others) {
  return std::any_of(others.begin(), others.end(), [&](const auto& other) {
    return (centre_px - other.first).norm() < 0.8 * other.second;
  });
}

/// Nearest value to `reference` among angle + k period.
double nearest(double angle, double reference, double period) {
  return angle + period * std::round((reference - angle) / period);
}

}  // namespace

Follower::Follower(const BodyFinder& finder, const Background& background,
                   std::shared_ptr<const SpinProfile> marks)
    : finder_(finder), background_(background), marks_(std::move(marks)) {}

void Follower::start(const Frame& frame, const Sighting& seen) {
  past_.clear();
  past_.push_back({frame.t_s, seen});
  usual_major_px_ = seen.rim.semi_major_px();
  usual_accepted_ = seen.accepted;
  mean_shape_px_ = seen.rim.shape_px;
  shape_scatter_px_ = 1.0;
  surprise_px_ = std::max(2.0, 0.15 * seen.rim.semi_minor_px());
  lost_ = 0;
}

/// Straight on at constant rates (centre, rim shape, pose, turn) from the last two sightings.
Sighting Follower::predict(double t_s) const {
  const Moment& last = past_.back();
  Sighting p = last.seen;
  p.edges.clear();
  if (past_.size() < 2) return p;
  const Moment& before = past_[past_.size() - 2];
  const double span = last.t_s - before.t_s;
  // Rates older than a few frames say little; fade them out while the body stays lost.
  const double frames_ahead = std::abs((t_s - last.t_s) / frame_s_);
  const double ahead = (t_s - last.t_s) / span * (frames_ahead > 6.0 ? 6.0 / frames_ahead : 1.0);
  p.centre_px += ahead * (last.seen.centre_px - before.seen.centre_px);
  p.rim.centre_px = p.centre_px + (last.seen.rim.centre_px - last.seen.centre_px);
  if (frames_ahead < 3.0) {
    const Eigen::Matrix2d shape =
        p.rim.shape_px + ahead * (last.seen.rim.shape_px - before.seen.rim.shape_px);
    if (shape.determinant() > 0.3 * p.rim.shape_px.determinant()) p.rim.shape_px = shape;
  }
  if (p.pose && before.seen.pose) {
    const data::Pose<>& a = before.seen.pose->pose;
    const data::Pose<>& b = last.seen.pose->pose;
    data::Pose<>& c = p.pose->pose;
    constexpr double kTurn = 2.0 * std::numbers::pi;
    c.centre_m = b.centre_m + ahead * (b.centre_m - a.centre_m);
    c.theta_rad =
        std::clamp(b.theta_rad + ahead * (b.theta_rad - a.theta_rad), 0.0, std::numbers::pi);
    c.phi_rad = b.phi_rad + ahead * (nearest(b.phi_rad, a.phi_rad, kTurn) - a.phi_rad);
    c.psi_rad = b.psi_rad + ahead * (b.psi_rad - a.psi_rad);
  }
  if (p.turned_rad && before.seen.turned_rad)
    *p.turned_rad += ahead * (*last.seen.turned_rad - *before.seen.turned_rad);
  return p;
}

bool Follower::plausible(const Sighting& seen, const Sighting& predicted, double reach_px) const {
  if (seen.accepted < 0.3) return false;
  if ((seen.centre_px - predicted.centre_px).norm() > reach_px) return false;
  const double ratio = seen.rim.semi_major_px() / usual_major_px_;
  return ratio > 0.7 && ratio < 1.4;
}

/// A body that lies flat keeps its outline: when the shapes seen hardly scatter, their mean is
/// known far better than one frame tells, and partly hidden or touching bodies are measured with
/// it.
void Follower::set_shape_knowledge(Look& look, Sighting& guess) const {
  const double size = guess.rim.semi_major_px();
  if (shape_scatter_px_ < 0.1 + 0.005 * size) {
    guess.rim.shape_px = mean_shape_px_;
    look.shape_sigma_px = std::max(0.02, 0.3 * shape_scatter_px_);
  } else {
    look.shape_sigma_px = std::clamp(1.5 * shape_surprise_px_, 0.06 + 0.002 * size, 0.3 * size);
  }
}

std::optional<Sighting> Follower::look_at(const Frame& frame, const Sighting& expected,
                                          double reach_px) {
  Sighting guess = expected;
  const double size = guess.rim.semi_major_px();
  const cv::Rect box = box_around(guess.centre_px, 1.6 * size + reach_px + 12.0, frame.luma.size());
  if (box.width < 8 || box.height < 8) return std::nullopt;
  background_.scaled_into(plate_, gain_, box);
  Look look{.frame = frame, .background = plate_, .noise_levels = background_.noise_levels()};
  look.predicted = &guess;
  look.reach_px = reach_px;
  set_shape_knowledge(look, guess);
  look.motion_px = guess.centre_px - past_.back().seen.centre_px;
  auto seen = finder_.find(look);
  if (!seen || !plausible(*seen, guess, reach_px + 0.3 * size)) return std::nullopt;
  return seen;
}

/// Where it should be if it goes on as before; if little of it is seen there, also where it would
/// be had it stopped or been slowed by half (an impact), and the best of these counts.
std::optional<Sighting> Follower::look_near(const Frame& frame, const Sighting& predicted,
                                            const Others& others) {
  const double largest = std::max(4.0, 0.6 * predicted.rim.semi_minor_px());
  const double reach = std::clamp(2.0 + 3.0 * surprise_px_ + lost_, 2.5, largest);
  std::optional<Sighting> best = look_at(frame, predicted, reach);
  if (best && is_other(best->centre_px, others)) best.reset();
  if (best && best->accepted > 0.8 * usual_accepted_) return best;
  if (lost_ > 2 || past_.size() < 2) return best;
  for (const double share : {1.0, 0.5}) {
    const Moment& last = past_.back();
    Sighting guess = share == 1.0 ? last.seen : predicted;
    if (share != 1.0)
      guess.rim.centre_px = guess.centre_px = 0.5 * (last.seen.centre_px + predicted.centre_px);
    const auto seen = look_at(frame, guess, std::max(reach, 0.3 * guess.rim.semi_minor_px()));
    if (seen && !is_other(seen->centre_px, others) &&
        (!best || seen->accepted > best->accepted + 0.05))
      best = seen;
  }
  return best;
}

std::optional<Sighting> Follower::look_about(const Frame& frame, const Sighting& predicted,
                                             const Others& others) {
  const double size = usual_major_px_;
  // The longer it has been lost, the farther it may have gone; after a while, anywhere.
  const double speed = (predicted.centre_px - past_.back().seen.centre_px).norm();
  const double gate = lost_ > 30 ? 1e9 : 0.5 * size + 0.5 * speed + 0.25 * size * lost_;
  cv::Rect box = gate > 1e8 ? cv::Rect({}, frame.luma.size())
                            : box_around(predicted.centre_px, gate + 2.2 * size, frame.luma.size());
  if (box.width < 8 || box.height < 8) return std::nullopt;
  background_.scaled_into(plate_, gain_, box);
  Look look{.frame = frame, .background = plate_, .noise_levels = background_.noise_levels()};
  for (const Silhouette& body : find_silhouettes(frame.luma, plate_, look.noise_levels, box)) {
    const Detection& d = body.detection;
    if (d.semi_major_px < 0.6 * size || d.semi_major_px > 2.0 * size) continue;
    if ((d.centre_px - predicted.centre_px).norm() > gate) continue;
    if (is_other(d.centre_px, others)) continue;
    look.detection = d;
    auto seen = finder_.find(look);
    if (seen && seen->accepted > 0.5 && plausible(*seen, predicted, gate) &&
        !is_other(seen->centre_px, others))
      return seen;
  }
  return std::nullopt;
}

void Follower::read_marks(const Frame& frame, Sighting& seen, double predicted_rad) const {
  if (!marks_) return;
  const double window = lost_ > 3 ? std::numbers::pi : 0.6;
  if (const auto turned = marks_->read(frame.luma, seen.rim, predicted_rad, window)) {
    seen.turned_rad = turned->angle_rad;
    seen.turned_sigma_rad = turned->sigma_rad;
  }
}

/// Learns from a sighting how far predictions miss. Of a body that is partly hidden only the
/// position is believed: what hides it bends the fitted shape, and the next prediction with it.
void Follower::accept(const Frame& frame, const Sighting& seen, const Sighting& predicted) {
  Sighting kept = seen;
  kept.edges.clear();
  const bool whole = seen.accepted > 0.75 * usual_accepted_;
  if (lost_ == 0 && past_.size() >= 2) {
    const double off = (seen.centre_px - predicted.centre_px).norm();
    surprise_px_ = std::max(off, 0.85 * surprise_px_ + 0.15 * off);
    const double shape_off = (seen.rim.shape_px - predicted.rim.shape_px).norm();
    if (whole)
      shape_surprise_px_ = std::max(0.5 * shape_off, 0.9 * shape_surprise_px_ + 0.1 * shape_off);
  }
  if (whole) {
    usual_major_px_ += 0.1 * (seen.rim.semi_major_px() - usual_major_px_);
    usual_accepted_ += 0.1 * (seen.accepted - usual_accepted_);
    const double off = (seen.rim.shape_px - mean_shape_px_).norm();
    shape_scatter_px_ += 0.1 * (off - shape_scatter_px_);
    mean_shape_px_ += 0.1 * (seen.rim.shape_px - mean_shape_px_);
  } else {
    kept.rim.shape_px = past_.back().seen.rim.shape_px;
  }
  if (!kept.turned_rad) kept.turned_rad = predicted.turned_rad;
  past_.push_back({frame.t_s, std::move(kept)});
  if (past_.size() > 3) past_.pop_front();
  lost_ = 0;
}

std::optional<Sighting> Follower::follow(const Frame& frame, const Others& others) {
  const double step_s = std::abs(frame.t_s - past_.back().t_s) / (lost_ + 1);
  if (step_s > 0.0) frame_s_ = frame_s_ > 0.0 ? 0.9 * frame_s_ + 0.1 * step_s : step_s;
  gain_ = background_.gain(frame.luma);
  const Sighting predicted = predict(frame.t_s);
  std::optional<Sighting> seen;
  if (inside(predicted.centre_px, frame.luma.size(), 0.5 * usual_major_px_))
    seen = look_near(frame, predicted, others);
  if (!seen) seen = look_about(frame, predicted, others);
  if (!seen) {
    ++lost_;
    return std::nullopt;
  }
  read_marks(frame, *seen, predicted.turned_rad.value_or(0.0));
  accept(frame, *seen, predicted);
  return seen;
}

}  // namespace trochoid::tracking
