#include "observe/camera_error.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "observe/outline_shift.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/pose.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::fitting {
namespace {

using data::Camera;

// How a body is seen from another camera that shows it in the same place of the picture.
struct Shift {
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
  Eigen::Vector3d turn_rad = Eigen::Vector3d::Zero();  // of all its directions
};

// The turn w for which the body is seen, up to its size, as before: A' (I + [w]) = (1 + s) A, with
// A = d(image)/d(table), by least squares.
Eigen::Vector3d turn_between(const Eigen::Matrix<double, 2, 3>& before,
                             const Eigen::Matrix<double, 2, 3>& after) {
  Eigen::Matrix<double, 6, 4> slope;
  Eigen::Matrix<double, 6, 1> wanted;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k);
    for (int i = 0; i < 3; ++i)
      slope.block<2, 1>(2 * k, i) = after * Eigen::Vector3d::Unit(i).cross(axis);
    slope.block<2, 1>(2 * k, 3) = -before.col(k);
    wanted.segment<2>(2 * k) = before.col(k) - after.col(k);
  }
  return (slope.transpose() * slope).ldlt().solve(slope.transpose() * wanted).head<3>();
}

bool can_see(const Camera& camera, const Eigen::Vector3d& here) {
  return camera.projection == Camera::Projection::orthographic || camera.depth_m(here) > 0.0;
}

// None of a place that the camera cannot have seen: another tool's slip, which a fit gives up.
Shift shift_between(const Camera& camera, const Camera& moved, const Eigen::Vector3d& here) {
  if (!can_see(camera, here)) return {};
  try {
    const Eigen::Vector3d there =
        moved.table_from_image(camera.image_from_table<double>(here), here.z());
    return {(there - here).head<2>(),
            turn_between(camera.jacobian_px_per_m(here), moved.jacobian_px_per_m(there))};
  } catch (const NumericalError&) {
    return {};
  }
}

// Deviations are small; a part of one says what all of it does, and stays where the distortion
// holds.
constexpr double kPart = 1e-3;

// What was read of a sample, and how high its centre then was.
struct Seen {
  Eigen::Vector3d place_m = Eigen::Vector3d::Zero();
  std::optional<double> theta, phi;
};

// How far from its pivot a body's centre is along its axis, typically; 0 if no tilt tells.
double arm_m(const std::vector<Seen>& seen, const Eigen::Vector3d& pivot_m) {
  constexpr double kLeastSine = 0.2;
  std::vector<double> arms;
  for (const Seen& each : seen)
    if (each.theta && std::sin(*each.theta) > kLeastSine)
      arms.push_back((each.place_m - pivot_m).head<2>().norm() / std::sin(*each.theta));
  return arms.empty() ? 0.0 : data::median(std::move(arms));
}

// A body whose tilt was not read counts as lying.
void set_heights(const data::Scene& scene, std::vector<Seen>& seen) {
  if (scene.support.kind == data::SupportKind::pivot) {
    const Eigen::Vector3d pivot_m = scene.support.pivot_m.value_or(Eigen::Vector3d::Zero());
    const double arm = arm_m(seen, pivot_m);
    for (Seen& each : seen)
      each.place_m.z() = pivot_m.z() + arm * std::cos(each.theta.value_or(0.0));
  } else if (scene.body) {
    for (Seen& each : seen) {
      const double theta = std::abs(each.theta.value_or(0.0));
      each.place_m.z() =
          data::height_on_floor_m(theta, scene.body->radius_m, scene.body->half_thickness_m());
    }
  }
}

std::vector<Seen> seen_in(const ArcData& arc, const data::Scene& scene) {
  std::vector<Seen> out(arc.t_s.size());
  for (const Reading& reading : arc.readings) {
    Seen& seen = out[static_cast<std::size_t>(reading.sample)];
    if (reading.channel == Channel::position) seen.place_m.head<2>() = reading.value;
    if (reading.channel == Channel::theta) seen.theta = reading.value[0];
    if (reading.channel == Channel::phi) seen.phi = reading.value[0];
  }
  set_heights(scene, out);
  return out;
}

constexpr double kLeastSine = 0.02;  // nearly flat bodies: their azimuth means nothing

// A turn of R = Rz(phi) Rx(theta) Rz(psi) by w: dtheta is its part along the node line, and of the
// rest spin takes what precession cannot; all of it where no precession was read.
Eigen::Matrix<double, 1, 5> row_of(const Shift& shift, const Seen& seen) {
  const double theta = seen.theta.value_or(0.0), phi = seen.phi.value_or(0.0);
  const Eigen::Vector2d node(std::cos(phi), std::sin(phi));
  const Eigen::Vector2d across(-node.y(), node.x());
  const Eigen::Vector3d& turn = shift.turn_rad;
  const double sine = std::max(kLeastSine, std::sin(theta)), cosine = std::cos(theta);
  const double along = across.dot(turn.head<2>());
  Eigen::Matrix<double, 1, 5> out;
  out << shift.place_m.x(), shift.place_m.y(), node.dot(turn.head<2>()),
      sine * turn.z() + cosine * along,
      seen.phi ? -along / sine : std::copysign(turn.z(), cosine * turn.z());
  return out / kPart;
}

bool has_outline(const data::Scene& scene, const Seen& seen) {
  return scene.body && scene.body->kind != data::BodyKind::top && scene.body->radius_m > 0.0 &&
         (scene.support.kind == data::SupportKind::flat || (seen.theta && seen.phi));
}

// What each of some cameras shifts a sample by. A known outline does not only turn, it looks larger
// or smaller as well; spin takes what is left of the turn about the axis.
std::vector<Eigen::Matrix<double, 1, 5>> rows_of(const data::Scene& scene, const Camera& camera,
                                                 const std::vector<Camera>& moved,
                                                 const Seen& seen) {
  std::vector<Eigen::Matrix<double, 1, 5>> rows;
  std::vector<Shift> shifts;
  for (const Camera& other : moved) {
    shifts.push_back(shift_between(camera, other, seen.place_m));
    rows.push_back(row_of(shifts.back(), seen));
  }
  if (!has_outline(scene, seen) || !can_see(camera, seen.place_m)) return rows;
  const data::Pose<> pose{seen.place_m, seen.theta.value_or(0.0), seen.phi.value_or(0.0)};
  const auto by_outline = outline_shifts(scene, pose, camera, moved);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    rows[k].head<2>() = by_outline[k].place_m.transpose() / kPart;
    if (scene.support.kind == data::SupportKind::flat) continue;
    const double sine = std::max(kLeastSine, std::sin(pose.theta_rad));
    const Eigen::Vector3d axis = data::symmetry_axis(pose.theta_rad, pose.phi_rad);
    rows[k][2] = by_outline[k].theta / kPart;
    rows[k][3] = by_outline[k].sine_phi / kPart;
    rows[k][4] =
        (shifts[k].turn_rad.dot(axis) - std::cos(pose.theta_rad) * by_outline[k].sine_phi / sine) /
        kPart;
  }
  return rows;
}

std::vector<CameraShifts> shifts_by(const data::Scene& scene, const Camera& camera,
                                    const std::vector<Camera>& moved, const std::vector<Seen>& seen,
                                    std::size_t step) {
  std::vector<CameraShifts> out(moved.size(), CameraShifts::Zero(std::ssize(seen), 5));
  for (std::size_t i = 0; i < seen.size(); i += step) {
    const auto rows = rows_of(scene, camera, moved, seen[i]);
    for (std::size_t k = 0; k < rows.size(); ++k)
      out[k].row(static_cast<Eigen::Index>(i)) = rows[k];
  }
  return out;
}

// Which of some deviations show beside the readings' own errors; a few samples tell.
std::vector<Camera> those_that_matter(const data::Scene& scene, const Camera& camera,
                                      const std::vector<Camera>& moved,
                                      const std::vector<ArcData>& arcs,
                                      const std::vector<std::vector<Seen>>& seen) {
  constexpr double kMatters = 3e-3;  // sigmas: of a thousand samples, a tenth of their mean's
  constexpr std::size_t kLook = 16;
  std::vector<double> most(moved.size(), 0.0);
  for (std::size_t a = 0; a < arcs.size(); ++a) {
    const std::size_t step = std::max<std::size_t>(1, seen[a].size() / kLook);
    const auto few = shifts_by(scene, camera, moved, seen[a], step);
    for (std::size_t k = 0; k < moved.size(); ++k)
      most[k] = std::max(most[k], whitened(arcs[a], few[k]).cwiseAbs().maxCoeff());
  }
  std::vector<Camera> some;
  for (std::size_t k = 0; k < moved.size(); ++k)
    if (most[k] > kMatters) some.push_back(moved[k]);
  return some;
}

}  // namespace

std::optional<Camera> uncertain_camera(const data::Scene& scene) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(scene.camera.file, ignored)) return std::nullopt;
  Camera camera = data::read_camera(scene.camera.file);
  if (camera.covariance.size() == 0) return std::nullopt;
  return camera;
}

void note_camera_shifts(const Camera& camera, const data::Scene& scene, bool all,
                        std::vector<ArcData>& arcs) {
  std::vector<std::vector<Seen>> seen;
  for (const ArcData& arc : arcs) seen.push_back(seen_in(arc, scene));
  std::vector<Camera> moved;
  const auto deviations = camera.likely_deviations();
  for (const auto& deviation : deviations.colwise())
    moved.push_back(camera.moved(kPart * deviation));
  if (!all) moved = those_that_matter(scene, camera, moved, arcs, seen);
  for (std::size_t a = 0; a < arcs.size(); ++a)
    arcs[a].camera_shifts = shifts_by(scene, camera, moved, seen[a], 1);
}

data::TrackSample measured_by(const data::Scene& scene, data::TrackSample sample,
                              const Camera& camera, const Camera& other) {
  if (!sample.has_metres()) return sample;
  std::vector<Seen> seen(1);
  seen[0].place_m.head<2>() = sample.centre_m;
  if (sample.theta) seen[0].theta = sample.theta->value_rad;
  if (sample.phi) seen[0].phi = sample.phi->value_rad;
  set_heights(scene, seen);
  data::Pose<> pose{seen[0].place_m, seen[0].theta.value_or(0.0), seen[0].phi.value_or(0.0)};
  if (!can_see(camera, pose.centre_m)) return sample;
  const Shift shift = shift_between(camera, other, pose.centre_m);
  const Eigen::Vector3d axis = data::symmetry_axis(pose.theta_rad, pose.phi_rad);
  double turned_rad = 0.0;  // of the precession
  const auto there =
      has_outline(scene, seen[0]) ? seen_by(scene, pose, camera, other) : std::nullopt;
  if (there) {
    turned_rad = data::wrapped(there->phi_rad - pose.phi_rad);
    pose = *there;
  } else {
    pose.centre_m.head<2>() += shift.place_m;
  }
  sample.centre_m = pose.centre_m.head<2>();
  sample.centre_px = other.image_from_table<double>(pose.centre_m);
  if (sample.psi)
    sample.psi->value_rad += shift.turn_rad.dot(axis) - std::cos(pose.theta_rad) * turned_rad;
  if (!(sample.theta && sample.phi)) return sample;
  sample.theta->value_rad = pose.theta_rad;
  sample.phi->value_rad += turned_rad;
  return sample;
}

Eigen::VectorXd whitened(const ArcData& arc, const CameraShifts& shifts) {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(arc.rows);
  for (std::size_t i = 0; i < arc.readings.size(); ++i) {
    const Reading& reading = arc.readings[i];
    const auto shift = shifts.row(reading.sample);
    const double weight = reading.whitener(0, 0);
    if (reading.channel == Channel::position)
      out.segment<2>(reading.row) = reading.whitener.transpose() * shift.head<2>().transpose();
    else if (shows_direction(arc, i)) {
      const Reading& turned = arc.readings[++i];
      const Eigen::Vector2d weights = weights_of_direction(reading, turned);
      out[reading.row] = weights[0] * shift[2];
      out[turned.row] = weights[1] * shift[3];
    } else if (reading.channel == Channel::theta) {
      out[reading.row] = weight * shift[2];
    } else if (reading.channel == Channel::psi) {
      out[reading.row] = weight * shift[4];
    }
  }
  return out;
}

}  // namespace trochoid::fitting
