#include "trochoid/data/camera.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <string>

#include "trochoid/data/error.hpp"

namespace trochoid::data {
namespace {

// Distorted normalised coordinates of undistorted ones, and the derivative.
struct Distorted {
  Eigen::Vector2d at;
  Eigen::Matrix2d derivative;
};

Distorted distort(const std::array<double, 5>& coefficients, double u, double v) {
  const auto [k1, k2, p1, p2, k3] = coefficients;
  const double r2 = u * u + v * v;
  const double d = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double d_prime = k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2);  // dd / dr2
  Distorted out;
  out.at = {u * d + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u),
            v * d + p1 * (r2 + 2.0 * v * v) + 2.0 * p2 * u * v};
  const double mixed = 2.0 * u * v * d_prime + 2.0 * p1 * u + 2.0 * p2 * v;
  out.derivative << d + 2.0 * u * u * d_prime + 2.0 * p1 * v + 6.0 * p2 * u, mixed,  //
      mixed, d + 2.0 * v * v * d_prime + 6.0 * p1 * v + 2.0 * p2 * u;
  return out;
}

// Newton from the distorted point itself; steps are halved while they do not help.
Eigen::Vector2d undistort(const std::array<double, 5>& coefficients,
                          const Eigen::Vector2d& target) {
  constexpr int kMaxIterations = 50;
  constexpr double kTolerance =
      1e-14;  // of a normalised coordinate, 1e-11 px at usual focal lengths
  Eigen::Vector2d p = target;
  Distorted now = distort(coefficients, p.x(), p.y());
  for (int i = 0; i < kMaxIterations; ++i) {
    const Eigen::Vector2d miss = target - now.at;
    if (miss.norm() <= kTolerance * (1.0 + target.norm())) break;
    Eigen::Vector2d step = now.derivative.inverse() * miss;
    Distorted next = distort(coefficients, p.x() + step.x(), p.y() + step.y());
    for (int halvings = 0; halvings < 30 && !((target - next.at).norm() < miss.norm());
         ++halvings) {
      step *= 0.5;
      next = distort(coefficients, p.x() + step.x(), p.y() + step.y());
    }
    if (!((target - next.at).norm() < miss.norm())) break;  // at the limit of rounding
    p += step;
    now = next;
  }
  // Beyond the fold of a polynomial distortion no point of space has this image; Newton may still
  // end at a root on the far side of the fold, where the (symmetric) derivative is not positive
  // definite.
  constexpr double kAccepted = 1e-9;
  const bool before_fold = now.derivative.determinant() > 0.0 && now.derivative.trace() > 0.0;
  if (!((target - now.at).norm() <= kAccepted * (1.0 + target.norm())) || !before_fold)
    throw NumericalError(
        fmt::format("camera: no ray has the distorted image ({}, {}) focal lengths from the "
                    "principal point; the "
                    "distortion coefficients do not hold that far out",
                    target.x(), target.y()));
  return p;
}

}  // namespace

Camera Camera::from_scale(int width_px, int height_px, double scale_px_per_m) {
  Camera camera;
  camera.projection = Projection::orthographic;
  camera.width_px = width_px;
  camera.height_px = height_px;
  camera.fx = camera.fy = scale_px_per_m;
  camera.cx = 0.5 * (width_px - 1);
  camera.cy = 0.5 * (height_px - 1);
  return camera;
}

Camera Camera::overhead(int width_px, int height_px, double scale_px_per_m, double height_m) {
  Camera camera = from_scale(width_px, height_px, scale_px_per_m);
  camera.projection = Projection::perspective;
  camera.fx = camera.fy = scale_px_per_m * height_m;
  camera.camera_from_table_m = {0.0, 0.0, height_m};
  return camera;
}

Camera Camera::moved(const Deviation& by) const {
  Camera out = *this;
  out.fx += by[0];
  out.fy += by[1];
  out.cx += by[2];
  out.cy += by[3];
  for (std::size_t i = 0; i < distortion.size(); ++i)
    out.distortion[i] += by[4 + static_cast<Eigen::Index>(i)];
  const Eigen::Vector3d turn = by.segment<3>(9);
  if (const double angle = turn.norm(); angle > 0.0)
    out.camera_from_table = Eigen::AngleAxisd(angle, turn / angle) * camera_from_table;
  out.camera_from_table_m += by.tail<3>();
  return out;
}

Eigen::Matrix<double, Camera::kNumbers, Eigen::Dynamic> Camera::likely_deviations() const {
  Eigen::Matrix<double, kNumbers, Eigen::Dynamic> out(kNumbers, 0);
  if (covariance.size() == 0) return out;
  // Pixels, radians and metres are told apart by their own standard deviations.
  const Eigen::VectorXd sd = covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  const Eigen::VectorXd inverse = (sd.array() > 0.0).select(sd.cwiseInverse(), 0.0);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(inverse.asDiagonal() * covariance *
                                                            inverse.asDiagonal());
  constexpr double kNothing = 1e-12;  // of a variance: rounding
  for (int i = kNumbers - 1; i >= 0 && axes.eigenvalues()[i] > kNothing; --i) {
    out.conservativeResize(Eigen::NoChange, out.cols() + 1);
    out.rightCols<1>() =
        std::sqrt(axes.eigenvalues()[i]) * sd.cwiseProduct(axes.eigenvectors().col(i));
  }
  return out;
}

void Camera::check_size(int recorded_width_px, int recorded_height_px,
                        const std::string& recording) const {
  if (width_px == 0 || (width_px == recorded_width_px && height_px == recorded_height_px)) return;
  const double x_scale = static_cast<double>(recorded_width_px) / width_px;
  const double y_scale = static_cast<double>(recorded_height_px) / height_px;
  const auto centre = [](double scale, double c) { return scale * (c + 0.5) - 0.5; };
  std::string words = "calibrate the camera at this size";
  if (std::abs(x_scale * height_px - recorded_height_px) <= 1.0)
    words += fmt::format(
        ", or if it is the same view scaled, nothing cut off, write a camera file with width {}, "
        "height {}, fx {:.7g}, fy {:.7g}, cx {:.7g}, cy {:.7g}, all else as it is{}",
        recorded_width_px, recorded_height_px, x_scale * fx, y_scale * fy, centre(x_scale, cx),
        centre(y_scale, cy), covariance.size() > 0 ? " but without the covariance" : "");
  throw InputError(fmt::format("{} is for {} x {} pictures, {} has {} x {}; {}",
                               file.empty() ? "the camera" : file + ": the camera", width_px,
                               height_px, recording, recorded_width_px, recorded_height_px, words));
}

double Camera::depth_m(const Eigen::Vector3d& point_m) const {
  return camera_from_table.row(2).dot(point_m) + camera_from_table_m.z();
}

Ray Camera::ray_from_image(const Eigen::Vector2d& image_px) const {
  const Eigen::Vector2d plane{(image_px.x() - cx) / fx, (image_px.y() - cy) / fy};
  if (projection == Projection::orthographic)
    return {camera_from_table.transpose() *
                (Eigen::Vector3d(plane.x(), plane.y(), 0.0) - camera_from_table_m),
            camera_from_table.row(2).transpose()};
  const Eigen::Vector2d ideal = undistort(distortion, plane);
  return {position_m(),
          camera_from_table.transpose() * Eigen::Vector3d(ideal.x(), ideal.y(), 1.0).normalized()};
}

Eigen::Vector3d Camera::table_from_image(const Eigen::Vector2d& image_px, double height_m) const {
  const Ray ray = ray_from_image(image_px);
  const double along_m = (height_m - ray.origin_m.z()) / ray.direction.z();
  const bool in_front = projection == Projection::orthographic || along_m > 0.0;
  if (!std::isfinite(along_m) || !in_front)
    throw NumericalError(
        fmt::format("camera: the ray through pixel ({}, {}) does not meet the plane z = {} m in "
                    "front of the camera",
                    image_px.x(), image_px.y(), height_m));
  return ray.origin_m + along_m * ray.direction;
}

Eigen::Matrix<double, 2, 3> Camera::jacobian_px_per_m(const Eigen::Vector3d& point_m) const {
  const Eigen::Vector2d focal{fx, fy};
  if (projection == Projection::orthographic)
    return focal.asDiagonal() * camera_from_table.topRows<2>();
  const Eigen::Vector3d c = camera_from_table * point_m + camera_from_table_m;
  const double inverse = 1.0 / c.z();
  const Eigen::Vector2d ideal = inverse * c.head<2>();
  const Eigen::Matrix<double, 2, 3> ideal_from_table =
      inverse * (camera_from_table.topRows<2>() - ideal * camera_from_table.row(2));
  if (!distorts()) return focal.asDiagonal() * ideal_from_table;
  const Eigen::Matrix2d bent =
      focal.asDiagonal() * distort(distortion, ideal.x(), ideal.y()).derivative;
  return bent * ideal_from_table;
}

Eigen::Vector3d Camera::position_m() const {
  return -(camera_from_table.transpose() * camera_from_table_m);
}

}  // namespace trochoid::data
