#include "contour.hpp"

#include <algorithm>
#include <cmath>

namespace trochoid::tracking {

namespace {

// Distance from the circle that touches a contour: of a point that far out of its tangent and aside
// of where it touches.
double off_circle(double out_px, double aside_px, double curvature_per_px) {
  constexpr double kStraight = 1e-6;
  if (std::abs(curvature_per_px) < kStraight) return out_px;
  const double radius_px = 1.0 / std::abs(curvature_per_px);
  const double from_middle_px = curvature_per_px > 0.0 ? radius_px + out_px : radius_px - out_px;
  if (from_middle_px < 0.0) return out_px;
  const double beyond_px = std::hypot(from_middle_px, aside_px) - radius_px;
  return curvature_per_px > 0.0 ? beyond_px : -beyond_px;
}

bool belongs_to(const OutlineSample& sample, Contour::Of which) {
  switch (which) {
    case Contour::Of::rim:
      return sample.silhouette && !is_bore(sample.edge);
    case Contour::Of::bore:
      return sample.silhouette && is_bore(sample.edge);
    case Contour::Of::near_rim:
      return sample.edge == data::OutlinePoint::Edge::upper_rim;
    case Contour::Of::near_bore:
      return sample.edge == data::OutlinePoint::Edge::upper_bore;
  }
  return false;
}

}  // namespace

Contour::Contour(const std::vector<OutlineSample>& outline, Of which) : outline_(&outline) {
  for (std::size_t i = 0; i < outline.size(); ++i) {
    if (!belongs_to(outline[i], which)) continue;
    points_.push_back({i, outline[i].image_px});
    middle_ += outline[i].image_px;
  }
  if (empty()) return;
  middle_ /= static_cast<double>(points_.size());
  nearest_px_ = farthest_px_ = (points_.front().image_px - middle_).norm();
  for (Point& point : points_) {
    const double radius_px = (point.image_px - middle_).norm();
    point.angle_rad = angle_of(point.image_px);
    nearest_px_ = std::min(nearest_px_, radius_px);
    farthest_px_ = std::max(farthest_px_, radius_px);
  }
  std::sort(points_.begin(), points_.end(),
            [](const Point& a, const Point& b) { return a.angle_rad < b.angle_rad; });
  for (std::size_t k = 0; k < points_.size(); ++k) points_[k].curvature_per_px = curvature_at(k);
}

bool Contour::may_be_within(double far_px, const Eigen::Vector2d& p) const {
  const double radius_px = (p - middle_).norm();
  return radius_px > nearest_px_ - far_px && radius_px < farthest_px_ + far_px;
}

Contour::Place Contour::nearest(const Eigen::Vector2d& p) const {
  const auto behind = std::lower_bound(
      points_.begin(), points_.end(), angle_of(p),
      [](const Point& point, double angle_rad) { return point.angle_rad < angle_rad; });
  std::size_t at = static_cast<std::size_t>(behind - points_.begin()) % size();
  const auto square_to = [&](std::size_t k) { return (points_[k].image_px - p).squaredNorm(); };
  const std::size_t last = size() - 1;
  double least = square_to(at);
  for (const bool ahead : {true, false})
    while (true) {
      const std::size_t next = ahead ? (at == last ? 0 : at + 1) : (at == 0 ? last : at - 1);
      const double there = square_to(next);
      if (there >= least) break;
      at = next, least = there;
    }
  const OutlineSample& sample = (*this)[at];
  const Eigen::Vector2d off = p - sample.image_px;
  const Eigen::Vector2d along(-sample.normal_px.y(), sample.normal_px.x());
  const double aside = along.dot(off);
  return {at, off_circle(sample.normal_px.dot(off), aside, points_[at].curvature_per_px),
          std::abs(aside)};
}

double Contour::angle_of(const Eigen::Vector2d& p) const {
  return std::atan2(p.y() - middle_.y(), p.x() - middle_.x());
}

double Contour::curvature_at(std::size_t k) const {
  const OutlineSample& before = (*this)[(k + size() - 1) % size()];
  const OutlineSample& behind = (*this)[(k + 1) % size()];
  const Eigen::Vector2d chord = behind.image_px - before.image_px;
  const double square = chord.squaredNorm();
  return square > 0.0 ? (behind.normal_px - before.normal_px).dot(chord) / square : 0.0;
}

}  // namespace trochoid::tracking
