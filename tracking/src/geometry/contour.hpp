#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/outline_samples.hpp"

namespace trochoid::tracking {

/// One closed border of a body's silhouette or of its near face, star-shaped about its middle:
/// distances of points in the picture from it.
class Contour {
 public:
  enum class Of { rim, bore, near_rim, near_bore };
  struct Place {
    std::size_t at;   ///< the nearest point of the contour
    double off_px;    ///< distance, > 0 where what it borders is not
    double aside_px;  ///< along the contour from that point
  };

  /// Of the samples of an outline, which must outlive it, those that belong to it.
  Contour(const std::vector<OutlineSample>& outline, Of which);

  /// Too few points to be one; nothing else may be asked then.
  [[nodiscard]] bool empty() const { return points_.size() < kFewest; }
  [[nodiscard]] std::size_t size() const { return points_.size(); }
  [[nodiscard]] const OutlineSample& operator[](std::size_t k) const {
    return (*outline_)[points_[k].sample];
  }
  /// The place of that point in the outline.
  [[nodiscard]] std::size_t sample_of(std::size_t k) const { return points_[k].sample; }
  /// False if a point is farther away than this, at a glance.
  [[nodiscard]] bool may_be_within(double far_px, const Eigen::Vector2d& p) const;
  /// Sought along the contour from the point in the same direction from its middle.
  [[nodiscard]] Place nearest(const Eigen::Vector2d& p) const;

 private:
  static constexpr std::size_t kFewest = 8;
  static constexpr std::size_t kSectors = 64;
  struct Point {
    std::size_t sample;
    Eigen::Vector2d image_px, normal_px;
    double turn = 0.0;       // from the middle, as turn_of has it
    double radius_px = 0.0;  // of the circle that touches there, > 0 where the body is convex
  };
  [[nodiscard]] static std::size_t sector_of(double turn);
  void sort_by_turn();
  [[nodiscard]] double radius_at(std::size_t k) const;

  const std::vector<OutlineSample>* outline_;
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  double nearest_px_ = 0.0, farthest_px_ = 0.0;      // of its points, from the middle
  std::vector<Point> points_;                        // all round
  std::array<std::uint32_t, kSectors + 1> first_{};  // of them, in each sector
};

}  // namespace trochoid::tracking
