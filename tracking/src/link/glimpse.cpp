#include "link/glimpse.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <vector>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/parallel.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {

void allow_for(const Eigen::Vector2d& off_px, const Eigen::Vector2d& off_m, Sighting& seen) {
  const Eigen::Matrix2d px2 = off_px * off_px.transpose(), m2 = off_m * off_m.transpose();
  seen.covariance_px2 += px2;
  seen.pose->covariance_px2 += px2, seen.pose->common.px2 += px2;
  seen.pose->covariance_m2 += m2, seen.pose->common.m2 += m2;
}

void doubt_attitude(const Eigen::Vector2d& off_px, const Eigen::Vector2d& off_m,
                    double off_tilt_rad, Sighting& seen) {
  seen.attitude_doubtful = true;
  allow_for(off_px, off_m, seen);
  seen.pose->sigma_theta_rad = std::hypot(seen.pose->sigma_theta_rad, off_tilt_rad);
  seen.pose->common.theta_rad2 += off_tilt_rad * off_tilt_rad;
  seen.pose->sigma_phi_rad = std::numeric_limits<double>::infinity();
}

Surroundings surroundings_of(const std::vector<Glimpse>& glimpses, std::size_t i) {
  constexpr std::size_t kReach = 6;
  Surroundings out;
  std::vector<double> blurs_px;
  for (std::size_t k = i - std::min(i, kReach); k < std::min(glimpses.size(), i + kReach + 1);
       ++k) {
    if (!glimpses[k].posed()) continue;
    const PoseMeasurement& pose = *glimpses[k].seen->pose;
    blurs_px.push_back(pose.blur_px);
    if (k != i && pose.shading) out.shading.add(*pose.shading);
  }
  out.blur_px = data::median(std::move(blurs_px));
  return out;
}

double between_axes(const Eigen::Vector3d& a, const Eigen::Vector3d& b, bool alike) {
  const double cosine = a.dot(b);
  return std::acos(std::clamp(alike ? std::abs(cosine) : cosine, -1.0, 1.0));
}

double between_tilts(double one_rad, double other_rad, bool alike) {
  const auto folded = [&](double tilt) { return alike ? std::min(tilt, data::kPi - tilt) : tilt; };
  return std::abs(folded(one_rad) - folded(other_rad));
}

double shadow_log_score_ratio(const Sighting& one, const Sighting& other) {
  // Shadows of two readings of a picture differ by about a half, their edges by a tenth.
  constexpr double kOfShadow = 0.5;
  // Beside a dark body that it does not cover, a fit would take that for its shadow.
  constexpr double kSamePlace = 0.12;
  const double apart_px = (one.centre_px - other.centre_px).norm();
  return apart_px < kSamePlace * other.rim.semi_major_px() ? kOfShadow * (one.shadow - other.shadow)
                                                           : 0.0;
}

double log_score_ratio(const Sighting& one, const Sighting& other) {
  constexpr double kLeast = 1e-9;
  return std::log(std::max(kLeast, one.pose->score_px()) /
                  std::max(kLeast, other.pose->score_px())) +
         shadow_log_score_ratio(one, other);
}

// From the middle of a body, over how far it reaches: what its outline needs, and its shadow.
constexpr double kBeside = 1.6, kAround = 2.5;

bool Measuring::prepare_plate(const Frame& frame, const Sighting& seen, double beside) {
  const double half_px = beside * finder_.reach_px(seen) + 24.0;
  const cv::Rect box = cv::Rect(static_cast<int>(seen.centre_px.x() - half_px),
                                static_cast<int>(seen.centre_px.y() - half_px),
                                static_cast<int>(2.0 * half_px), static_cast<int>(2.0 * half_px)) &
                       cv::Rect({}, frame.luma.size());
  if (box.width < 8 || box.height < 8) return false;
  background_.scaled_into(plate_, background_.gain(frame.luma), box);
  return true;
}

std::optional<FloorDarkening> Measuring::floor_around(const Frame& frame, const Sighting& seen,
                                                      const data::Pose<>& pose) {
  if (!prepare_plate(frame, seen, kAround)) return std::nullopt;
  return finder_.floor_around(frame, plate_, pose);
}

double Measuring::shadow(const Frame& frame, const Sighting& seen, const data::Pose<>& pose) {
  return background_.lamp() ? agreement(floor_around(frame, seen, pose)) : 0.0;
}

double Measuring::agreement(const std::optional<FloorDarkening>& floor) const {
  return floor ? floor->agrees(*background_.lamp()) : 0.0;
}

std::optional<Sighting> Measuring::operator()(const Frame& frame, Sighting guess,
                                              const std::optional<Beside>& near,
                                              const ShadingMemory* shading, bool there) {
  finder_.place(guess);
  if (!prepare_plate(frame, guess, background_.lamp() ? kAround : kBeside)) return std::nullopt;
  Look look{.frame = frame, .background = plate_};
  look.predicted = &guess;
  look.shading = shading;
  look.there = there;
  Sighting last = guess;
  if (near) {
    last.pose->pose = near->pose;
    finder_.place(last);
    look.last = &last;
    look.side_of_last = near->side;
    look.motion_px = guess.centre_px - last.centre_px;
  }
  auto seen = finder_.find(look);
  if (!seen || !seen->pose) return seen;
  seen->shadow =
      background_.lamp() ? agreement(finder_.floor_around(frame, plate_, seen->pose->pose)) : 0.0;
  return seen;
}

void on_all_cores(const Background& background, const BodyFinder& finder, std::size_t count,
                  const std::function<void(Measuring&, std::size_t)>& work) {
  std::mutex mutex;
  std::vector<std::unique_ptr<Measuring>> idle;  // as many as threads, each with room of its own
  const auto taken = [&] {
    const std::lock_guard lock(mutex);
    if (idle.empty()) return std::make_unique<Measuring>(background, finder);
    auto measuring = std::move(idle.back());
    idle.pop_back();
    return measuring;
  };
  data::in_parallel(count, 0, [&](std::size_t i) {
    auto measuring = taken();
    work(*measuring, i);
    const std::lock_guard lock(mutex);
    idle.push_back(std::move(measuring));
  });
}

}  // namespace trochoid::tracking
