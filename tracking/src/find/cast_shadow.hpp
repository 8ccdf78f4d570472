#pragma once
#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"

namespace trochoid::tracking {

/// What lights a place on the table, from the direction (aside, 1).
struct Lamp {
  Eigen::Vector2d aside;  ///< how far to the side it stands, over how far above, along x and y
  double part = 0.0;      ///< of the light there that it gives, 0..1
};

/// Lamp::aside of all places at which a lamp is sought: all round, high and low.
[[nodiscard]] const std::vector<Eigen::Vector2d>& lamp_places();

/// How much darker a floor is around a body than without it. Attitudes that look alike throw
/// different shadows: which side of a body is raised shows there.
class FloorDarkening {
 public:
  /// Some thousand points of the floor, as far as they are in the picture and beside the body.
  /// @param luma, plate CV_8UC1: the picture, and the scene without the body at its brightness.
  FloorDarkening(const cv::Mat& luma, const cv::Mat& plate, const data::Body& body,
                 const data::Pose<>& pose, const data::Camera& camera);
  /// How well the shadow of the body under a lamp agrees with it: 1 if that is all there is, 0 if
  /// the body hides it or there are other shadows as large, down to -2 if it should be seen but is
  /// not.
  [[nodiscard]] double agrees(const Lamp& lamp) const;
  /// The part of the light that is missing in the shadow, and the share of the darkening that it
  /// explains, 0..1.
  struct Shadow {
    double part = 0.0, explained = 0.0;
  };
  [[nodiscard]] Shadow shadow_of(const Eigen::Vector2d& lamp_aside) const;

 private:
  /// Points in a shadow and out of it, and the sum of what is darker in it.
  struct Sums {
    double within = 0.0, without = 0.0, darker = 0.0;
    /// Whether enough are in either to compare.
    [[nodiscard]] bool tell() const;
    /// Sum of squares of being in it, beyond the mean.
    [[nodiscard]] double square() const { return within * without / (within + without); }
  };
  [[nodiscard]] Sums sums_under(const Eigen::Vector2d& lamp_aside) const;
  void look_around(const cv::Mat& luma, const cv::Mat& plate, const data::Camera& camera);
  [[nodiscard]] cv::Mat covered(const data::Camera& camera, const cv::Rect& box) const;

  double radius_m_, bore_m_, half_thickness_m_;
  Eigen::Vector3d centre_m_, axis_;
  std::vector<double> x_m_, y_m_;  ///< points of the floor
  std::vector<double> darker_;     ///< there, as a share of the light, beyond its mean
  double square_ = 0.0;            ///< sum of squares of these
};

}  // namespace trochoid::tracking
