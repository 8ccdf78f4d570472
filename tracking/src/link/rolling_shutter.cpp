#include "link/rolling_shutter.hpp"

#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "geometry/outline_samples.hpp"
#include "geometry/pose_change.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using Pose = data::Pose<>;
using Step = data::PoseMotion::Step;
/// Velocity of the centre, then the rotation vector.
using Twist = Eigen::Matrix<double, 6, 1>;

class Undoing {
 public:
  Undoing(const RollingShutter& shutter, const data::Body& body, const data::Support& support,
          BodyPath& path)
      : shutter_(shutter),
        body_(body),
        alike_(body.faces_look_alike() && support.kind != data::SupportKind::pivot),
        share_per_px_(readout_share_per_px(shutter.video)),
        motions_{data::PoseMotion(body, support, shutter.camera),
                 data::PoseMotion(body, {data::SupportKind::flat, {}}, shutter.camera)} {
    for (auto& [index, at] : path.frames)
      if (at.seen.pose) seen_.push_back(&at);
    if (seen_.size() > 1)
      frame_s_ = data::usual_step_s(seen_, [](const BodyPath::At* at) { return at->t_s; });
  }

  void operator()() {
    std::vector<std::optional<Pose>> put;  // all from what was seen before any is
    for (std::size_t k = 0; k < seen_.size(); ++k) put.push_back(undone(k));
    for (std::size_t k = 0; k < seen_.size(); ++k)
      if (put[k]) place(*put[k], seen_[k]->seen);
  }

 private:
  [[nodiscard]] const PoseMeasurement& at(std::size_t k) const { return *seen_[k]->seen.pose; }

  /// When the row of its centre was read.
  [[nodiscard]] double time_s(std::size_t k) const {
    return seen_[k]->t_s +
           shutter_.readout_s * readout_share(shutter_.video, seen_[k]->seen.centre_px);
  }

  /// That by which the pose was measured.
  [[nodiscard]] const data::PoseMotion* motion_of(const PoseMeasurement& measured) const {
    for (const data::PoseMotion& motion : motions_)
      if (measured.sheared[0].rows() == motion.count()) return &motion;
    return nullptr;
  }

  /// Neighbours near enough to tell how the body moves at k.
  [[nodiscard]] std::vector<std::size_t> neighbours(std::size_t k) const {
    constexpr double kNear_frames = 2.5;
    std::vector<std::size_t> near;
    const auto add = [&](std::size_t i) {
      if (std::abs(seen_[i]->t_s - seen_[k]->t_s) < kNear_frames * frame_s_) near.push_back(i);
    };
    if (k > 0) add(k - 1);
    if (k + 1 < seen_.size()) add(k + 1);
    return near;
  }

  /// The mean over its neighbours of how fast something changes at k [1/s].
  template <class Change>
  [[nodiscard]] static auto mean_rate(const std::vector<std::size_t>& near, Change per_s) {
    auto sum = per_s(near.front());
    for (std::size_t i = 1; i < near.size(); ++i) sum += per_s(near[i]);
    return decltype(sum)(sum / static_cast<double>(near.size()));
  }

  [[nodiscard]] std::optional<Pose> undone(std::size_t k) const {
    const PoseMeasurement& here = at(k);
    const data::PoseMotion* motion = motion_of(here);
    const std::vector<std::size_t> near = neighbours(k);
    if (motion == nullptr || near.empty()) return std::nullopt;
    const Step rate = mean_rate(near, [&](std::size_t i) {
      const Pose from = alike_ ? nearer_face(at(i).pose, here.pose, 0.0) : at(i).pose;
      return Step(motion->step_between(from, here.pose) / (time_s(k) - time_s(i)));
    });
    const Step in_readout = shutter_.readout_s * rate;
    const Step off = share_per_px_.x() * (here.sheared[0] * in_readout) +
                     share_per_px_.y() * (here.sheared[1] * in_readout);
    Pose pose = here.rows_in_turn ? here.pose : motion->moved(here.pose, -off);
    pose.phi_rad = here.pose.phi_rad + data::wrapped(pose.phi_rad - here.pose.phi_rad);
    if (here.sigma_psi_rad)
      pose.psi_rad =
          spin_of_centre(k, near, motion->velocities(here.pose) * in_readout, pose.phi_rad);
    return pose;
  }

  /// Marks are read in rows of their own.
  /// @param in_readout how it moves until all rows are read, but for its spin.
  [[nodiscard]] double spin_of_centre(std::size_t k, const std::vector<std::size_t>& near,
                                      Twist in_readout, double phi_rad) const {
    const Pose& here = at(k).pose;
    const double cosine = std::cos(here.theta_rad);
    // Spin is counted from the node line: what that is moved by, it takes back.
    double psi_rad = here.psi_rad - cosine * (phi_rad - here.phi_rad);
    std::vector<std::size_t> told;
    for (const std::size_t i : near)
      if (at(i).sigma_psi_rad && (std::cos(at(i).pose.theta_rad) > 0.0) == (cosine > 0.0))
        told.push_back(i);
    if (told.empty()) return psi_rad;
    const double turns_rad_s = mean_rate(told, [&](std::size_t i) {
      const Pose& other = at(i).pose;
      return data::wrapped(here.psi_rad - other.psi_rad +
                           cosine * data::wrapped(here.phi_rad - other.phi_rad)) /
             (time_s(k) - time_s(i));
    });
    in_readout.tail<3>() += shutter_.readout_s * turns_rad_s * data::axis_of(here);
    return psi_rad - marks_turned_rad(here, in_readout);
  }

  /// By how much the marks that face the camera seem to have turned about the centre: from when its
  /// row is read to when theirs are, the body turns, goes on, and tilts.
  [[nodiscard]] double marks_turned_rad(const Pose& pose, const Twist& in_readout) const {
    const Eigen::Vector3d node = data::node_line(pose), axis = data::axis_of(pose),
                          ascent = axis.cross(node), towards = axis_towards(shutter_.camera, pose);
    const bool upper = axis.dot(towards) > 0.0;
    const Eigen::Vector2d centre = shutter_.camera.image_from_table<double>(pose.centre_m);
    double sum_rad = 0.0;
    int count = 0;
    for (const data::SpinMark& mark : body_.marks) {
      if (!(upper ? mark.on_upper_face : mark.on_lower_face) || !(mark.distance_m > 0.0)) continue;
      const double angle = pose.psi_rad + mark.angle_rad;
      const Eigen::Vector3d outwards = std::cos(angle) * node + std::sin(angle) * ascent,
                            at = body_.half_thickness_m() * towards + mark.distance_m * outwards;
      const Eigen::Vector3d at_m = pose.centre_m + at;
      const double share =
          share_per_px_.dot(shutter_.camera.image_from_table<double>(at_m) - centre);
      const Eigen::Vector3d goes = in_readout.head<3>() + in_readout.tail<3>().cross(at),
                            ray = direction_to(shutter_.camera, at_m);
      // It is looked for on the face as that is when the centre is read.
      const Eigen::Vector3d on_face = goes - axis.dot(goes) / axis.dot(ray) * ray;
      sum_rad += share * on_face.dot(axis.cross(outwards)) / mark.distance_m;
      ++count;
    }
    return count > 0 ? sum_rad / count : 0.0;
  }

  void place(const Pose& pose, Sighting& seen) const {
    seen.pose->pose = pose;
    const Eigen::Vector2d centre = shutter_.camera.image_from_table<double>(pose.centre_m);
    seen.rim.centre_px += centre - seen.centre_px;
    seen.centre_px = seen.pose->centre_px = centre;
  }

  const RollingShutter& shutter_;
  const data::Body& body_;
  bool alike_;
  Eigen::Vector2d share_per_px_;
  std::array<data::PoseMotion, 2> motions_;
  std::vector<BodyPath::At*> seen_;
  double frame_s_ = 0.0;
};

}  // namespace

void undo_rolling_shutter(const RollingShutter& shutter, const data::Body& body,
                          const data::Support& support, BodyPath& path) {
  if (shutter.readout_s > 0.0) Undoing(shutter, body, support, path)();
}

}  // namespace trochoid::tracking
