#include "geometry/contour.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace trochoid::tracking {

namespace {

constexpr double kStraight_px = 1e6;  // radius of what bends no more than noise

// Distance from the circle of this radius that touches a contour: of a point that far out of its
// tangent and aside of where it touches.
double off_circle(double out_px, double aside_px, double radius_px) {
  if (std::abs(radius_px) > kStraight_px) return out_px;
  const double from_middle_px = std::abs(radius_px) + (radius_px > 0.0 ? out_px : -out_px);
  if (from_middle_px < 0.0) return out_px;
  const double beyond_px =
      std::sqrt(from_middle_px * from_middle_px + aside_px * aside_px) - std::abs(radius_px);
  return radius_px > 0.0 ? beyond_px : -beyond_px;
}

// Grows from -2 to 2 with the angle of a direction as that does from -pi to pi, without its cost:
// only its order counts here.
double turn_of(const Eigen::Vector2d& direction) {
  const double size = direction.cwiseAbs().sum();
  const double off = size > 0.0 ? 1.0 - direction.x() / size : 0.0;
  return direction.y() < 0.0 ? -off : off;
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
    points_.push_back({i, outline[i].image_px, outline[i].normal_px});
    middle_ += outline[i].image_px;
  }
  if (empty()) return;
  middle_ /= static_cast<double>(points_.size());
  nearest_px_ = farthest_px_ = (points_.front().image_px - middle_).norm();
  for (Point& point : points_) {
    const Eigen::Vector2d off = point.image_px - middle_;
    const double radius_px = off.norm();
    point.turn = turn_of(off);
    nearest_px_ = std::min(nearest_px_, radius_px);
    farthest_px_ = std::max(farthest_px_, radius_px);
  }
  sort_by_turn();
  for (std::size_t k = 0; k < points_.size(); ++k) points_[k].radius_px = radius_at(k);
}

std::size_t Contour::sector_of(double turn) {
  constexpr double kPerTurn = 0.25 * kSectors;
  return std::min(static_cast<std::size_t>((turn + 2.0) * kPerTurn), kSectors - 1);
}

// By sectors, and within these one by one: an outline has a few parts, each in order.
void Contour::sort_by_turn() {
  for (const Point& point : points_) ++first_[sector_of(point.turn) + 1];
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  std::vector<Point> sorted(points_.size());
  auto next = first_;
  for (const Point& point : points_) {
    const std::size_t sector = sector_of(point.turn);
    std::size_t at = next[sector]++;
    for (; at > first_[sector] && sorted[at - 1].turn > point.turn; --at)
      sorted[at] = sorted[at - 1];
    sorted[at] = point;
  }
  points_ = std::move(sorted);
}

bool Contour::may_be_within(double far_px, const Eigen::Vector2d& p) const {
  const double radius_px = (p - middle_).norm();
  return radius_px > nearest_px_ - far_px && radius_px < farthest_px_ + far_px;
}

Contour::Place Contour::nearest(const Eigen::Vector2d& p) const {
  const double turn = turn_of(p - middle_);
  std::size_t at = first_[sector_of(turn)];
  while (at < size() && points_[at].turn < turn) ++at;
  if (at == size()) at = 0;
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
  const Point& point = points_[at];
  const Eigen::Vector2d off = p - point.image_px;
  const Eigen::Vector2d along(-point.normal_px.y(), point.normal_px.x());
  const double aside = along.dot(off);
  return {at, off_circle(point.normal_px.dot(off), aside, point.radius_px), std::abs(aside)};
}

double Contour::radius_at(std::size_t k) const {
  const Point& before = points_[(k + size() - 1) % size()];
  const Point& behind = points_[(k + 1) % size()];
  const Eigen::Vector2d chord = behind.image_px - before.image_px;
  const double bend = (behind.normal_px - before.normal_px).dot(chord);
  return bend != 0.0 ? chord.squaredNorm() / bend : std::numeric_limits<double>::infinity();
}

}  // namespace trochoid::tracking
