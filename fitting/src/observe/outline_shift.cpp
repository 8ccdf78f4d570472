#include "observe/outline_shift.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/outline.hpp"
#include "trochoid/data/pose_motion.hpp"

namespace trochoid::fitting {
namespace {

// The outline that a camera shows of a body, and how that body may move.
class ShownOutline {
 public:
  ShownOutline(const data::Scene& scene, const data::Pose<>& pose, const data::Camera& camera)
      : motion_(*scene.body, scene.support, camera),
        pose_(pose),
        velocities_(motion_.velocities(pose)) {
    constexpr double kPoints = 40.0;  // of a rim
    const double px_per_m = camera.jacobian_px_per_m(pose.centre_m).leftCols<2>().norm() / M_SQRT2;
    outline_ = data::visible_outline(*scene.body, pose, camera,
                                     data::kTurn * scene.body->radius_m * px_per_m / kPoints);
    outwards_.resize(std::ssize(outline_), motion_.count());
    for (std::size_t i = 0; i < outline_.size(); ++i) {
      const data::OutlinePoint& point = outline_[i];
      const Eigen::Vector3d by_m = (point.normal_px.transpose() * point.px_per_m).transpose();
      Eigen::Matrix<double, 6, 1> by;
      by << by_m, (point.table_m - pose.centre_m).cross(by_m);
      outwards_.row(static_cast<Eigen::Index>(i)) = by.transpose() * velocities_;
    }
    // What the outline leaves open stays: a turn by a radian counts as much as a pixel all round.
    information_.compute(outwards_.transpose() * outwards_ +
                         Eigen::MatrixXd::Identity(motion_.count(), motion_.count()));
  }

  // From where the body is, `by` from where it was filmed, towards where `other` shows the outline.
  [[nodiscard]] data::PoseMotion::Step step(const data::Camera& other,
                                            const data::PoseMotion::Step& by) const {
    const data::Pose<> at = motion_.moved(pose_, by);
    const Eigen::Matrix3d turn =
        Eigen::Quaterniond::FromTwoVectors(data::axis_of(pose_), data::axis_of(at))
            .toRotationMatrix();
    Eigen::VectorXd off_px(std::ssize(outline_));
    for (std::size_t i = 0; i < outline_.size(); ++i) {
      const Eigen::Vector3d at_m = at.centre_m + turn * (outline_[i].table_m - pose_.centre_m);
      off_px[static_cast<Eigen::Index>(i)] =
          outline_[i].normal_px.dot(outline_[i].image_px - other.image_from_table<double>(at_m));
    }
    return information_.solve(outwards_.transpose() * off_px);
  }

  [[nodiscard]] data::PoseMotion::Step none() const {
    return data::PoseMotion::Step::Zero(motion_.count());
  }

  [[nodiscard]] OutlineShift shift_by(const data::PoseMotion::Step& step) const {
    const Eigen::Matrix<double, 6, 1> moved = velocities_ * step;
    const auto turned = moved.tail<3>();
    return {moved.head<2>(), data::node_line(pose_).dot(turned), data::ascent(pose_).dot(turned)};
  }

  [[nodiscard]] data::Pose<> moved(const data::PoseMotion::Step& step) const {
    return motion_.moved(pose_, step);
  }

 private:
  data::PoseMotion motion_;
  const data::Pose<>& pose_;
  data::PoseMotion::Velocities velocities_;
  std::vector<data::OutlinePoint> outline_;
  Eigen::MatrixXd outwards_;  // px of each point by each way to move
  Eigen::LDLT<Eigen::MatrixXd> information_;
};

}  // namespace

std::vector<OutlineShift> outline_shifts(const data::Scene& scene, const data::Pose<>& pose,
                                         const data::Camera& camera,
                                         std::span<const data::Camera> others) {
  const ShownOutline outline(scene, pose, camera);
  std::vector<OutlineShift> shifts;
  for (const data::Camera& other : others)
    shifts.push_back(outline.shift_by(outline.step(other, outline.none())));
  return shifts;
}

std::optional<data::Pose<>> seen_by(const data::Scene& scene, const data::Pose<>& pose,
                                    const data::Camera& camera, const data::Camera& other) {
  constexpr int kMost = 20;
  constexpr double kSettled = 1e-7;  // m and rad
  const ShownOutline outline(scene, pose, camera);
  data::PoseMotion::Step by = outline.none();
  for (int i = 0; i < kMost; ++i) {
    const data::PoseMotion::Step step = outline.step(other, by);
    by += step;
    if (step.cwiseAbs().maxCoeff() < kSettled) return outline.moved(by);
  }
  return std::nullopt;
}

}  // namespace trochoid::fitting
