#pragma once
#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"

namespace trochoid::tracking {

/// Where a lamp stands: how far to the side of a place on the table, over how far above it.
using Lamp = Eigen::Vector2d;

/// All round, high and low: where a lamp is sought.
[[nodiscard]] const std::vector<Lamp>& lamps_all_round();

/// How much darker a floor is around a body than without it. Attitudes that look alike throw
/// different shadows: which side of a body is raised shows there.
class FloorDarkening {
 public:
  /// @param luma, plate CV_8UC1: the picture, and the scene without the body at its brightness.
  FloorDarkening(const cv::Mat& luma, const cv::Mat& plate, const data::Body& body,
                 const data::Pose<>& pose, const data::Camera& camera);
  /// Share of it, 0..1, that the shadow of the body under a lamp explains.
  [[nodiscard]] double explained(const Lamp& lamp) const;

 private:
  void look_around(const cv::Mat& luma, const cv::Mat& plate, const data::Camera& camera);

  /// The body stands in the way of a ray that meets its faces or the middle between them.
  [[nodiscard]] bool meets(const Eigen::Vector3d& from_m, const Eigen::Vector3d& towards,
                           double inner_m, double outer_m) const;
  double radius_m_, bore_m_;
  Eigen::Vector3d axis_;
  std::array<Eigen::Vector3d, 3> middles_m_;
  std::vector<Eigen::Vector3d> at_m_;  ///< points of the floor
  std::vector<double> darker_;         ///< there, as a share of the light, beyond its mean
  double square_ = 0.0;                ///< sum of squares of these
};

}  // namespace trochoid::tracking
