#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>

namespace trochoid::data {

/// A ray in the table frame: origin_m + s * direction, |direction| = 1.
struct Ray {
  Eigen::Vector3d origin_m;
  Eigen::Vector3d direction;
};

/// How a camera makes levels of light. Video cameras and telephones apply a curve close to sRGB's;
/// machine-vision cameras with their gamma correction off do not.
enum class Transfer { srgb, linear };

/// Pinhole camera with OpenCV's radial-tangential distortion (k1, k2, p1, p2, k3), or, when only a
/// scale is known, an orthographic camera looking straight down. Pixel centres are integers, x
/// right, y down; the table frame has z up and the floor at z = 0, right-handed seen from above.
///
///   X_c = R X_table + t,  u = X_c.x / X_c.z,  v = X_c.y / X_c.z,  r2 = u^2 + v^2,
///   d = 1 + k1 r2 + k2 r2^2 + k3 r2^3,  x_px = fx (u d + tangential) + cx,  likewise y_px.
/// Orthographic: x_px = fx X_c.x + cx, y_px = fy X_c.y + cy with fx, fy in px/m.
struct Camera {
  enum class Projection { perspective, orthographic };
  Projection projection = Projection::perspective;
  int width_px = 0;
  int height_px = 0;
  double fx = 0.0, fy = 0.0;           ///< focal lengths [px], or scale [px/m] when orthographic
  double cx = 0.0, cy = 0.0;           ///< principal point [px]
  std::array<double, 5> distortion{};  ///< k1, k2, p1, p2, k3
  Eigen::Matrix3d camera_from_table = Eigen::Vector3d(1, -1, -1).asDiagonal();
  Eigen::Vector3d camera_from_table_m = Eigen::Vector3d::Zero();
  /// What the file says of the recording, if anything; kept, but nothing is timed by it: times come
  /// from the recording or CameraSettings::frame_rate_hz.
  std::optional<double> frame_rate_hz;
  std::optional<double> exposure_fraction;  ///< shutter time as a fraction of the frame interval
  /// Rolling shutter: first to last row, > 0; that of CameraSettings counts instead, if there is.
  std::optional<double> readout_s;
  Transfer transfer = Transfer::srgb;
  bool metres_by_radius = false;  ///< as large as the known radius of the body filmed has them
  std::string file;               ///< where it was read from, for messages; empty if it was made

  /// By how much the numbers of a camera may be off: fx, fy, cx, cy (as above), k1, k2, p1, p2, k3,
  /// a turn along the camera's axes [rad], about the table's origin, and a shift along them [m]: a
  /// camera that is off by `turn` and `shift` has R = exp(turn) R, t = t + shift.
  static constexpr int kNumbers = 15;
  using Deviation = Eigen::Matrix<double, kNumbers, 1>;
  /// Of the deviations that its calibration allows for, kNumbers square; empty if it is exact.
  Eigen::MatrixXd covariance;

  /// Orthographic camera straight above: table origin at the centre of the image.
  /// @param scale_px_per_m pixels per metre on the floor, > 0.
  static Camera from_scale(int width_px, int height_px, double scale_px_per_m);
  /// Distortion-free pinhole straight above the image centre, `height_m` over the floor, that shows
  /// `scale_px_per_m` on the floor.
  static Camera overhead(int width_px, int height_px, double scale_px_per_m, double height_m);

  /// The camera with its numbers off by that much.
  [[nodiscard]] Camera moved(const Deviation& by) const;
  /// Independent deviations, one in a column, each as large as its standard deviation: their outer
  /// products sum up to the covariance. The largest in proportion first; none of an exact camera.
  [[nodiscard]] Eigen::Matrix<double, kNumbers, Eigen::Dynamic> likely_deviations() const;

  /// A camera that was calibrated for pictures of another size measures nothing in these.
  /// @throws InputError naming the camera's file and the recording, unless its size is unknown.
  void check_size(int recorded_width_px, int recorded_height_px,
                  const std::string& recording) const;

  /// Projects a point of the table frame into the distorted image [px]. Any scalar type.
  template <class Scalar>
  [[nodiscard]] Eigen::Matrix<Scalar, 2, 1> image_from_table(
      const Eigen::Matrix<Scalar, 3, 1>& point_m) const {
    const Eigen::Matrix<Scalar, 3, 1> c =
        camera_from_table.cast<Scalar>() * point_m + camera_from_table_m.cast<Scalar>();
    if (projection == Projection::orthographic) return {fx * c.x() + cx, fy * c.y() + cy};
    const Scalar u = c.x() / c.z(), v = c.y() / c.z();
    if (!distorts()) return {fx * u + cx, fy * v + cy};
    const auto [k1, k2, p1, p2, k3] = distortion;
    const Scalar r2 = u * u + v * v;
    const Scalar d = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    return {fx * (u * d + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u)) + cx,
            fy * (v * d + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v) + cy};
  }
  /// Whether any distortion coefficient differs from zero; a camera without is spared the
  /// polynomial.
  [[nodiscard]] bool distorts() const { return distortion != std::array<double, 5>{}; }
  /// Depth of a table point in front of the camera [m]; must be > 0 to be imaged (perspective).
  [[nodiscard]] double depth_m(const Eigen::Vector3d& point_m) const;
  /// Ray of the table frame through a pixel; inverts the distortion by Newton's method.
  [[nodiscard]] Ray ray_from_image(const Eigen::Vector2d& image_px) const;
  /// Where the ray through a pixel meets the plane z = height_m.
  /// @throws NumericalError if the ray does not meet it in front of the camera.
  [[nodiscard]] Eigen::Vector3d table_from_image(const Eigen::Vector2d& image_px,
                                                 double height_m = 0.0) const;
  /// d(image)/d(table) at a point [px/m], 2 x 3.
  [[nodiscard]] Eigen::Matrix<double, 2, 3> jacobian_px_per_m(const Eigen::Vector3d& point_m) const;
  /// Position of the optical centre in the table frame [m]; meaningless when orthographic.
  [[nodiscard]] Eigen::Vector3d position_m() const;
};

}  // namespace trochoid::data
