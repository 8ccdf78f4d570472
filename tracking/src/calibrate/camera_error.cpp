#include "calibrate/camera_error.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using data::Camera;

constexpr int kPose = 6;                           // a turn and a shift, the last numbers
constexpr int kOptics = Camera::kNumbers - kPose;  // k3 is the last of them
constexpr int kFitted = kOptics - 1;

// Residuals by the numbers of a camera, from central differences.
Eigen::MatrixXd slopes(const Camera& camera, const CameraResiduals& residuals) {
  const double near_m = std::max(camera.camera_from_table_m.norm(), 1e-6);
  constexpr double kPixel = 0.1, kBend = 1e-4, kTurn = 1e-5;  // far below where projections bend
  Camera::Deviation step;
  step << Eigen::Vector4d::Constant(kPixel), Eigen::Matrix<double, 5, 1>::Constant(kBend),
      Eigen::Vector3d::Constant(kTurn), Eigen::Vector3d::Constant(kTurn * near_m);
  Eigen::MatrixXd out(residuals(camera).size(), Camera::kNumbers);
  for (int i = 0; i < Camera::kNumbers; ++i) {
    const Camera::Deviation by = step[i] * Camera::Deviation::Unit(i);
    out.col(i) = (residuals(camera.moved(by)) - residuals(camera.moved(-by))) / (2.0 * step[i]);
  }
  return out;
}

// How the pose that fits best follows the optics, d pose / d optics.
Eigen::Matrix<double, kPose, kOptics> following(const Eigen::MatrixXd& slope) {
  return -slope.rightCols<kPose>().colPivHouseholderQr().solve(slope.leftCols<kOptics>());
}

}  // namespace

Eigen::VectorXd reprojection_px(const Camera& camera, const std::vector<Eigen::Vector2d>& table_m,
                                const std::vector<Eigen::Vector2d>& image_px, double scale,
                                double height_m) {
  Eigen::VectorXd out(2 * static_cast<Eigen::Index>(table_m.size()));
  for (std::size_t i = 0; i < table_m.size(); ++i)
    out.segment<2>(2 * static_cast<Eigen::Index>(i)) =
        camera.image_from_table<double>(
            {scale * table_m[i].x(), scale * table_m[i].y(), height_m}) -
        image_px[i];
  return out;
}

void set_optics_covariance(Camera& camera, const std::vector<PosedView>& views) {
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(kFitted, kFitted);
  double squares = 0.0;
  Eigen::Index rows = 0;
  for (const PosedView& view : views) {
    const Eigen::MatrixXd slope = slopes(view.camera, view.residuals);
    // What the optics change that the view's own pose does not make up for.
    const Eigen::MatrixXd left =
        (slope.leftCols<kOptics>() + slope.rightCols<kPose>() * following(slope)).leftCols(kFitted);
    information += left.transpose() * left;
    squares += view.residuals(view.camera).squaredNorm();
    rows += slope.rows();
  }
  const double free =
      static_cast<double>(rows) - kFitted - kPose * static_cast<double>(views.size());
  // In proportion to what each is known by: pixels and distortions differ by far.
  const Eigen::VectorXd unit = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = unit.asDiagonal() * information * unit.asDiagonal();
  const Eigen::MatrixXd inverse = scaled.ldlt().solve(Eigen::MatrixXd::Identity(kFitted, kFitted));
  camera.covariance = Eigen::MatrixXd::Zero(Camera::kNumbers, Camera::kNumbers);
  camera.covariance.topLeftCorner(kFitted, kFitted) =
      squares / std::max(1.0, free) * (unit.asDiagonal() * inverse * unit.asDiagonal());
}

void add_pose_covariance(Camera& camera, const CameraResiduals& residuals, double sigma_px) {
  if (camera.covariance.size() == 0)
    camera.covariance = Eigen::MatrixXd::Zero(Camera::kNumbers, Camera::kNumbers);
  const Eigen::MatrixXd slope = slopes(camera, residuals);
  const Eigen::MatrixXd follow = following(slope);
  const Eigen::VectorXd left = residuals(camera);
  const double free = static_cast<double>(left.size()) - kPose;
  // Four points leave two numbers to tell their scatter by.
  const double own_px =
      free > 0.0 ? data::student_factor(free) * std::sqrt(left.squaredNorm() / free) : 0.0;
  const double variance = std::pow(std::max(sigma_px, own_px), 2);
  // What each residual moves the pose by.
  const Eigen::MatrixXd moves = slope.rightCols<kPose>().colPivHouseholderQr().solve(
      Eigen::MatrixXd::Identity(slope.rows(), slope.rows()));
  const Eigen::MatrixXd optics = camera.covariance.topLeftCorner(kOptics, kOptics);
  camera.covariance.bottomLeftCorner(kPose, kOptics) = follow * optics;
  camera.covariance.topRightCorner(kOptics, kPose) = (follow * optics).transpose();
  camera.covariance.bottomRightCorner(kPose, kPose) =
      follow * optics * follow.transpose() + variance * moves * moves.transpose();
}

}  // namespace trochoid::tracking
