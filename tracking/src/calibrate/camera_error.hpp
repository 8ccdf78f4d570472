#pragma once
#include <Eigen/Core>
#include <functional>
#include <vector>

#include "trochoid/data/camera.hpp"

namespace trochoid::tracking {

/// By how much a camera puts points elsewhere than they were seen, each number [px].
using CameraResiduals = std::function<Eigen::VectorXd(const data::Camera& camera)>;

/// The residuals of points of a plane at `height_m`, x and y of each in turn.
/// @param scale  from `table_m` to what the camera's shift is in.
[[nodiscard]] Eigen::VectorXd reprojection_px(const data::Camera& camera,
                                              const std::vector<Eigen::Vector2d>& table_m,
                                              const std::vector<Eigen::Vector2d>& image_px,
                                              double scale, double height_m);

/// A camera with its pose in one view, and what it leaves there.
struct PosedView {
  data::Camera camera;
  CameraResiduals residuals;
};

/// Sets the covariance of the optics of a camera that was fitted to several views of boards, k3
/// held, with a pose of its own for each; that of the pose is 0.
void set_optics_covariance(data::Camera& camera, const std::vector<PosedView>& views);

/// Completes the covariance of a camera by that of its pose, which was fitted to `residuals` with
/// the optics held: it follows what the optics may be off by, and has a scatter of its own.
/// @param sigma_px  of each residual at least, where these are too few to tell.
void add_pose_covariance(data::Camera& camera, const CameraResiduals& residuals, double sigma_px);

}  // namespace trochoid::tracking
