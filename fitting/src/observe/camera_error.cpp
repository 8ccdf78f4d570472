#include "observe/camera_error.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::fitting {
namespace {

using data::Camera;

// How a body is seen from another camera that shows it in the same place of the picture.
struct Shift {
  Eigen::Vector2d place_m;
  Eigen::Vector3d turn_rad;  // of all its directions
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

Shift shift_between(const Camera& camera, const Camera& moved, const Eigen::Vector2d& place_m) {
  const Eigen::Vector3d here(place_m.x(), place_m.y(), 0.0);
  const Eigen::Vector3d there = moved.table_from_image(camera.image_from_table<double>(here), 0.0);
  return {(there - here).head<2>(),
          turn_between(camera.jacobian_px_per_m(here), moved.jacobian_px_per_m(there))};
}

// Deviations are small; a part of one says what all of it does, and stays where the distortion
// holds.
constexpr double kPart = 1e-3;

// What was read of a sample, for what its axis is turned by.
struct Seen {
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
  double theta = 0.0, phi = 0.0;
};

std::vector<Seen> seen_in(const ArcData& arc) {
  std::vector<Seen> out(arc.t_s.size());
  for (const Reading& reading : arc.readings) {
    Seen& seen = out[static_cast<std::size_t>(reading.sample)];
    if (reading.channel == Channel::position) seen.place_m = reading.value;
    if (reading.channel == Channel::theta) seen.theta = reading.value[0];
    if (reading.channel == Channel::phi) seen.phi = reading.value[0];
  }
  return out;
}

// A turn of R = Rz(phi) Rx(theta) Rz(psi) by w: dtheta is its part along the node line, and of the
// rest spin takes what precession cannot.
Eigen::Matrix<double, 1, 5> row_of(const Shift& shift, const Seen& seen) {
  constexpr double kLeastSine = 0.1;  // nearly flat bodies turn about the vertical only
  const Eigen::Vector2d node(std::cos(seen.phi), std::sin(seen.phi));
  const Eigen::Vector2d across(-node.y(), node.x());
  const Eigen::Vector3d& turn = shift.turn_rad;
  const double sine = std::sin(seen.theta), along = across.dot(turn.head<2>());
  const double spin = std::abs(sine) < kLeastSine ? 0.0 : -along / sine;
  const double parallel = sine * turn.z() + std::cos(seen.theta) * along;
  Eigen::Matrix<double, 1, 5> out;
  out << shift.place_m.x(), shift.place_m.y(), node.dot(turn.head<2>()), parallel,
      std::abs(sine) < kLeastSine ? turn.z() : spin;
  return out / kPart;
}

CameraShifts shifts_by(const Camera& camera, const Camera& moved, const std::vector<Seen>& seen,
                       std::size_t step) {
  CameraShifts out = CameraShifts::Zero(static_cast<Eigen::Index>(seen.size()), 5);
  for (std::size_t i = 0; i < seen.size(); i += step)
    out.row(static_cast<Eigen::Index>(i)) =
        row_of(shift_between(camera, moved, seen[i].place_m), seen[i]);
  return out;
}

}  // namespace

std::optional<Camera> uncertain_camera(const data::Scene& scene) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(scene.camera.file, ignored)) return std::nullopt;
  Camera camera = data::read_camera(scene.camera.file);
  if (camera.covariance.size() == 0) return std::nullopt;
  return camera;
}

void note_camera_shifts(const Camera& camera, std::vector<ArcData>& arcs) {
  constexpr double kMatters = 3e-3;  // sigmas: of a thousand samples, a tenth of their mean's
  constexpr std::size_t kLook = 16;  // samples, before all of them are worked out
  const auto deviations = camera.likely_deviations();
  const auto shifts = [&](const ArcData& arc, Eigen::Index deviation, std::size_t step) {
    const std::vector<Seen> seen = seen_in(arc);
    if (!arc.filmed) return CameraShifts(CameraShifts::Zero(std::ssize(seen), 5));
    return shifts_by(camera, camera.moved(kPart * deviations.col(deviation)), seen, step);
  };
  const auto matters = [&](const ArcData& arc, Eigen::Index deviation) {
    const std::size_t step = std::max<std::size_t>(1, arc.t_s.size() / kLook);
    return whitened(arc, shifts(arc, deviation, step)).cwiseAbs().maxCoeff() > kMatters;
  };
  std::vector<ArcData> noted = arcs;
  try {
    for (Eigen::Index k = 0; k < deviations.cols(); ++k) {
      if (std::none_of(arcs.begin(), arcs.end(), [&](const auto& arc) { return matters(arc, k); }))
        continue;
      for (ArcData& arc : noted) arc.camera_shifts.push_back(shifts(arc, k, 1));
    }
  } catch (const NumericalError&) {  // positions of another tool that the camera cannot have seen
    return;
  }
  arcs = std::move(noted);
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
