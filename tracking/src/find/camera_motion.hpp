#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "find/follower.hpp"

namespace trochoid::tracking {

/// How far the picture of what stands still has gone from where it was at rest.
struct PictureShift {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;  ///< of either component
};

/// A stand that sags, shakes or is knocked moves the picture by pixels, and every body in it. The
/// floor tells, where it is not plain: in each frame the shift (and contrast) that its steepest
/// points ask for, by least squares, robust against what else changes there. Slow changes of
/// brightness, shadows for one, are left out: each point counts against its surroundings.
class CameraMotion {
 public:
  /// @param plate         what the camera sees without bodies, CV_8UC1.
  /// @param noise_levels  of one of its pixels over time
  CameraMotion(const cv::Mat& plate, double noise_levels);

  /// @param bodies  centres and radii in the frame, which tell nothing of the camera
  void look(const Frame& frame, const Follower::Others& bodies);

  /// By index of the frames in which the floor tells, from where it was in the first tenth of them
  /// (eight at least) or, where it shakes about one place, from that. Empty where the camera stands
  /// still, or the floor does not tell: it moves where the shifts are larger than 0.1 px rms and
  /// than twice what the quarters of the picture disagree by.
  [[nodiscard]] std::map<std::int64_t, PictureShift> shifts() const;

 private:
  static constexpr std::size_t kQuarters = 4;
  /// A point of the plate, against its surroundings.
  struct Point {
    Eigen::Vector2d at_px;
    Eigen::Vector3d by;  ///< levels by a shift along x, along y, by contrast
    double level = 0.0;
  };
  struct Found {
    Eigen::Vector2d px;
    Eigen::Matrix2d information;
  };
  struct Look {
    Eigen::Vector2d shift_px;
    Eigen::Matrix<double, 2, kQuarters> of_quarters_px;
    double sigma_px = 0.0;
  };

  [[nodiscard]] static std::optional<Found> shift_of(const std::vector<Point>& quarter,
                                                     const cv::Mat& luma,
                                                     const cv::Mat& surroundings,
                                                     const Follower::Others& bodies,
                                                     Eigen::Vector2d from_px);
  /// Median of what the first so many looks say.
  template <class ShiftOf>
  [[nodiscard]] Eigen::Vector2d usual_px(std::size_t looks, const ShiftOf& shift_of) const;
  [[nodiscard]] bool moves(double& disagree_px) const;
  [[nodiscard]] Eigen::Vector2d rest_px() const;

  std::array<std::vector<Point>, kQuarters> quarters_;
  bool tells_ = false;  ///< enough of the picture has steep points
  std::map<std::int64_t, Look> looks_;
  std::array<Eigen::Vector2d, kQuarters> last_px_ = {
      Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(),
      Eigen::Vector2d::Zero()};
};

}  // namespace trochoid::tracking
