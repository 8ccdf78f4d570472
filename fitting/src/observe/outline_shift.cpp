#include "observe/outline_shift.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/outline.hpp"

namespace trochoid::fitting {
namespace {

// The ways a body can move under its support, one in a column: velocity of its centre, and turning
// about the node line and about e2, the steepest ascent of its face.
struct Freedoms {
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 4> velocity;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 4> turning;
};

Freedoms freedoms_of(const data::Scene& scene, const data::Pose<>& pose,
                     const Eigen::Vector3d& node, const Eigen::Vector3d& e2) {
  const data::SupportKind on = scene.support.kind;
  const int count = on == data::SupportKind::flat ? 2 : on == data::SupportKind::pivot ? 3 : 4;
  Freedoms ways;
  ways.velocity.setZero(3, count);
  ways.turning.setZero(2, count);
  if (on == data::SupportKind::pivot) {
    const Eigen::Vector3d axis = data::symmetry_axis(pose.theta_rad, pose.phi_rad);
    const double along_m =
        (pose.centre_m - scene.support.pivot_m.value_or(Eigen::Vector3d::Zero())).dot(axis);
    ways.velocity << -along_m * e2, along_m * node, axis;
    ways.turning.leftCols<2>().setIdentity();
    return ways;
  }
  ways.velocity.topLeftCorner<2, 2>().setIdentity();
  if (count < 4) return ways;
  const double c = std::cos(pose.theta_rad), s = std::sin(pose.theta_rad);
  ways.velocity(2, 2) =
      scene.body->radius_m * c - std::copysign(scene.body->half_thickness_m(), c) * s;
  ways.turning.rightCols<2>().setIdentity();
  return ways;
}

// The outline that a camera shows of a body, and how that body may move.
class ShownOutline {
 public:
  ShownOutline(const data::Scene& scene, const data::Pose<>& pose, const data::Camera& camera)
      : body_(*scene.body),
        support_(scene.support.kind),
        pose_(pose),
        node_(std::cos(pose.phi_rad), std::sin(pose.phi_rad), 0.0),
        e2_(data::symmetry_axis(pose.theta_rad, pose.phi_rad).cross(node_)),
        ways_(freedoms_of(scene, pose, node_, e2_)) {
    constexpr double kPoints = 40.0;  // of a rim
    const double px_per_m = camera.jacobian_px_per_m(pose.centre_m).leftCols<2>().norm() / M_SQRT2;
    outline_ = data::visible_outline(body_, pose, camera,
                                     data::kTurn * body_.radius_m * px_per_m / kPoints);
    const auto count = ways_.velocity.cols();
    outwards_.resize(std::ssize(outline_), count);
    for (std::size_t i = 0; i < outline_.size(); ++i) {
      const data::OutlinePoint& point = outline_[i];
      const Eigen::RowVector3d by_m = point.normal_px.transpose() * point.px_per_m;
      const Eigen::Vector3d arm_m = point.table_m - pose.centre_m;
      const Eigen::RowVector2d by_turn(by_m.dot(node_.cross(arm_m)), by_m.dot(e2_.cross(arm_m)));
      outwards_.row(static_cast<Eigen::Index>(i)) = by_m * ways_.velocity + by_turn * ways_.turning;
    }
    // What the outline leaves open stays: a turn by a radian counts as much as a pixel all round.
    information_.compute(outwards_.transpose() * outwards_ +
                         Eigen::MatrixXd::Identity(count, count));
  }

  // The step from a pose, where the first one was filmed, towards where `other` shows the outline.
  [[nodiscard]] Eigen::VectorXd step(const data::Camera& other, const data::Pose<>& from) const {
    const Eigen::Matrix3d turn =
        Eigen::Quaterniond::FromTwoVectors(data::symmetry_axis(pose_.theta_rad, pose_.phi_rad),
                                           data::symmetry_axis(from.theta_rad, from.phi_rad))
            .toRotationMatrix();
    Eigen::VectorXd off_px(std::ssize(outline_));
    for (std::size_t i = 0; i < outline_.size(); ++i) {
      const Eigen::Vector3d at_m = from.centre_m + turn * (outline_[i].table_m - pose_.centre_m);
      off_px[static_cast<Eigen::Index>(i)] =
          outline_[i].normal_px.dot(outline_[i].image_px - other.image_from_table<double>(at_m));
    }
    return information_.solve(outwards_.transpose() * off_px);
  }

  [[nodiscard]] OutlineShift shift_by(const Eigen::VectorXd& step) const {
    const Eigen::Vector2d turns = ways_.turning * step;
    return {(ways_.velocity * step).head<2>(), turns[0], turns[1]};
  }

  [[nodiscard]] data::Pose<> moved(const data::Pose<>& from, const Eigen::VectorXd& step) const {
    const Eigen::Vector2d turns = ways_.turning * step;
    const Eigen::Vector3d axis =
        (data::symmetry_axis(from.theta_rad, from.phi_rad) - turns[0] * e2_ + turns[1] * node_)
            .normalized();
    data::Pose<> to = from;
    to.centre_m += ways_.velocity * step;
    to.theta_rad = std::acos(std::clamp(axis.z(), -1.0, 1.0));
    constexpr double kLeastSine = 1e-6;
    if (axis.head<2>().norm() > kLeastSine) to.phi_rad = std::atan2(axis.x(), -axis.y());
    if (support_ == data::SupportKind::floor)
      to.centre_m.z() =
          data::height_on_floor_m(to.theta_rad, body_.radius_m, body_.half_thickness_m());
    return to;
  }

 private:
  const data::Body& body_;
  data::SupportKind support_;
  const data::Pose<>& pose_;
  Eigen::Vector3d node_, e2_;
  Freedoms ways_;
  std::vector<data::OutlinePoint> outline_;
  Eigen::MatrixXd outwards_;  // px of each point by each freedom
  Eigen::LDLT<Eigen::MatrixXd> information_;
};

}  // namespace

std::vector<OutlineShift> outline_shifts(const data::Scene& scene, const data::Pose<>& pose,
                                         const data::Camera& camera,
                                         std::span<const data::Camera> others) {
  const ShownOutline outline(scene, pose, camera);
  std::vector<OutlineShift> shifts;
  for (const data::Camera& other : others)
    shifts.push_back(outline.shift_by(outline.step(other, pose)));
  return shifts;
}

std::optional<data::Pose<>> seen_by(const data::Scene& scene, const data::Pose<>& pose,
                                    const data::Camera& camera, const data::Camera& other) {
  constexpr int kMost = 20;
  constexpr double kSettled = 1e-7;  // m and rad
  const ShownOutline outline(scene, pose, camera);
  data::Pose<> there = pose;
  for (int i = 0; i < kMost; ++i) {
    const Eigen::VectorXd step = outline.step(other, there);
    there = outline.moved(there, step);
    if (step.cwiseAbs().maxCoeff() < kSettled) return there;
  }
  return std::nullopt;
}

}  // namespace trochoid::fitting
