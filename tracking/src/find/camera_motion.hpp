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
  /// By how much the picture is larger than at rest, and its standard deviation.
  double growth = 0.0, sigma_growth = 0.0;
  /// Where px and sigma_px hold: what lies elsewhere has gone by growth besides.
  Eigen::Vector2d about_px = Eigen::Vector2d::Zero();

  /// The same, told of another place of the picture.
  [[nodiscard]] PictureShift at(const Eigen::Vector2d& place_px) const;
};

/// A stand that sags, shakes or is knocked moves the picture by pixels, and every body in it; a
/// lens that focuses or zooms lets it grow. The floor tells, where it is not plain: in each frame
/// the shift (and contrast) that the steepest points of each quarter ask for, by least squares,
/// robust against what else changes there; quarters that part from each other tell of growth. Slow
/// changes of brightness, shadows for one, are left out: each point counts against its
/// surroundings.
class CameraMotion {
 public:
  /// @param plate         what the camera sees without bodies, CV_8UC1.
  /// @param noise_levels  of one of its pixels over time
  CameraMotion(const cv::Mat& plate, double noise_levels);

  /// @param bodies  centres and radii in the frame, which tell nothing of the camera
  void look(const Frame& frame, const Follower::Others& bodies);

  /// By index of the frames in which the floor tells, from where it was in the first tenth of them
  /// (eight at least) or, where it shakes about one place, from that. Empty where the camera stands
  /// still, or the floor does not tell: it moves where the shifts, or what growth makes of them in
  /// the quarters, are larger than 0.1 px rms and than twice what the quarters disagree by besides.
  [[nodiscard]] std::map<std::int64_t, PictureShift> shifts() const;

 private:
  static constexpr std::size_t kQuarters = 4;
  /// A point of the plate, against its surroundings.
  struct Point {
    Eigen::Vector2d at_px;
    Eigen::Vector3d by;  ///< levels by a shift along x, along y, by contrast
    double level = 0.0;
  };
  /// Of a quarter: where its points are in the middle, and how far they have gone there.
  struct Found {
    Eigen::Vector2d px;
    Eigen::Matrix2d information;
    Eigen::Vector2d about_px;
  };
  using Quarters = std::array<std::optional<Found>, kQuarters>;
  struct Look {
    Eigen::Vector2d shift_px;
    Eigen::Matrix<double, 2, kQuarters> of_quarters_px;  ///< but for growth
    double sigma_px = 0.0, growth = 0.0, sigma_growth = 0.0;
  };
  /// What the frames say if the picture but shifts, or if it may grow as well.
  struct Series {
    bool grows = false;
    std::map<std::int64_t, Look> looks{};
    std::array<Eigen::Vector2d, kQuarters> last_px{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(),
                                                   Eigen::Vector2d::Zero(),
                                                   Eigen::Vector2d::Zero()};
    double last_growth = 0.0;
  };
  /// A picture to look at, and what is around each of its places.
  struct Picture {
    const cv::Mat &luma, &surroundings;
  };

  [[nodiscard]] static std::optional<Found> shift_of(const std::vector<Point>& quarter,
                                                     const Picture& picture,
                                                     const Follower::Others& bodies,
                                                     Eigen::Vector2d from_px, double growth);
  [[nodiscard]] Look together(const Quarters& quarters, bool grows) const;
  [[nodiscard]] std::optional<Look> look_at(const Picture& picture, const Follower::Others& bodies,
                                            Series& series) const;
  [[nodiscard]] double reach_px() const;
  [[nodiscard]] bool moves(const Series& series, double& disagree_px) const;

  Eigen::Vector2d middle_px_;  ///< of the picture
  std::array<std::vector<Point>, kQuarters> quarters_;
  bool tells_ = false;  ///< enough of the picture has steep points
  Series shifted_, grown_{.grows = true};
};

}  // namespace trochoid::tracking
