#pragma once
#include <Eigen/Core>
#include <array>
#include <complex>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "find/far_shift.hpp"
#include "find/follower.hpp"

namespace trochoid::tracking {

/// How far the picture of what stands still has gone from where it was at rest.
struct PictureShift {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;  ///< of either component
  double crept_px = 0.0;  ///< how much of it came little by little
  /// By how much the picture is larger than at rest and turned (right on the screen): what lies d =
  /// x + iy from about_px at rest lies factor d from where that has gone to.
  std::complex<double> factor = 1.0;
  double sigma_factor = 0.0;  ///< of either component
  /// Where px and sigma_px hold: what lies elsewhere has gone by the factor besides.
  Eigen::Vector2d about_px = Eigen::Vector2d::Zero();

  /// The same, told of another place of the picture.
  [[nodiscard]] PictureShift at(const Eigen::Vector2d& place_px) const;
};

/// A stand that sags, shakes or is knocked moves the picture by pixels and turns it, and every body
/// in it; a lens that focuses or zooms lets it grow. The floor tells, where it is not plain: in
/// each frame the shift (and contrast) that the steepest points of each quarter ask for, by least
/// squares, robust against what else changes there; quarters that part from each other tell of
/// growth and turning. Slow changes of brightness, shadows for one, are left out: each point counts
/// against its surroundings. Where a quarter is not found where it was last, after a knock, it is
/// sought all around.
class CameraMotion {
 public:
  /// @param plate         what the camera sees without bodies, CV_8UC1.
  /// @param noise_levels  of one of its pixels over time
  CameraMotion(const cv::Mat& plate, double noise_levels);

  /// @param bodies  centres and radii in the frame, which tell nothing of the camera
  void look(const Frame& frame, const Follower::Others& bodies);

  /// By index of the frames in which the floor tells, from where it was in the first tenth of them
  /// (eight at least) or, where it shakes about one place, from that. Empty where the camera stands
  /// still, or the floor does not tell: it moves where the shifts, or what growth and turning make
  /// of them in the quarters, are larger than 0.1 px rms and than twice what the quarters disagree
  /// by besides.
  [[nodiscard]] std::map<std::int64_t, PictureShift> shifts() const;

 private:
  static constexpr std::size_t kQuarters = 4;
  /// A point of the plate, against its surroundings.
  struct Point {
    Eigen::Vector2d at_px;
    Eigen::Vector3d by;  ///< levels by a shift along x, along y, by contrast
    double level = 0.0;
  };
  /// A quarter of the plate.
  struct Quarter {
    cv::Rect part;
    std::vector<Point> points{};
    std::optional<FarShift> pattern{};
  };
  /// Of a quarter: where its points are in the middle, how far they have gone there, and how far
  /// levels are from the plate's then.
  struct Found {
    Eigen::Vector2d px;
    Eigen::Matrix2d information;
    Eigen::Vector2d about_px;
    double off_levels = 0.0;
  };
  using Quarters = std::array<std::optional<Found>, kQuarters>;
  using Ways = Eigen::Matrix<double, 2, kQuarters>;  ///< of the quarters, in px
  struct Look {
    Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
    double sigma_px = 0.0;
    std::complex<double> factor = 1.0;
    double sigma_factor = 0.0;
    Ways gone_px = Ways::Zero();
    Ways of_quarters_px = Ways::Zero();  ///< the same but for the factor
    double off_levels = 0.0;             ///< mean of the quarters
  };
  /// What the frames say if the picture but shifts, or if it may grow and turn as well.
  struct Series {
    bool warps = false;
    std::map<std::int64_t, Look> looks{};
    Look last{};
    double usual_off_levels = 0.0;
  };
  /// A picture to look at, and what is around each of its places.
  struct Picture {
    const cv::Mat &luma, &surroundings;
  };

  [[nodiscard]] static std::optional<Found> shift_of(const Quarter& quarter, const Picture& picture,
                                                     const Follower::Others& bodies,
                                                     const Eigen::Vector2d& from_px,
                                                     std::complex<double> factor);
  void fit_together(const Quarters& quarters, bool warps, Look& look) const;
  [[nodiscard]] std::optional<Look> look_from(const Ways& from_px, bool warps,
                                              std::complex<double> factor, const Picture& picture,
                                              const Follower::Others& bodies) const;
  [[nodiscard]] std::optional<Look> look_around(const Picture& picture,
                                                const Follower::Others& bodies,
                                                const Series& series,
                                                std::optional<Look> best) const;
  /// Whether the floor is off by no more than so many times what is usual.
  [[nodiscard]] static bool as_usual(const std::optional<Look>& look, const Series& series,
                                     double times);
  static void take(const Look& look, std::int64_t frame, Series& series);
  [[nodiscard]] double reach_px() const;
  [[nodiscard]] bool moves(const Series& series, double& disagree_px) const;

  Eigen::Vector2d middle_px_;  ///< of the picture
  std::array<Quarter, kQuarters> quarters_;
  bool tells_ = false;  ///< enough of the picture has steep points
  Series shifted_, warped_{.warps = true};
};

}  // namespace trochoid::tracking
