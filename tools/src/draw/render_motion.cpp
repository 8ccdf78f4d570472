#include "draw/render_motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "trochoid/data/error.hpp"
#include "trochoid/data/interpolate.hpp"

namespace trochoid::tools {

RenderedMotion::RenderedMotion(const model::Trajectory& run, double rate_hz)
    : model_(run.model), rate_hz_(rate_hz), outcome_(run.outcome) {
  for (const char* name : {"x_m", "y_m", "z_m", "theta_rad", "phi_rad", "psi_rad"}) {
    const auto at = std::find(run.columns.begin(), run.columns.end(), name);
    if (at == run.columns.end())
      throw InputError(
          fmt::format("render: model {} has no column {}; render needs a body that moves in space",
                      run.model, name));
    columns_.emplace_back(run.values.col(at - run.columns.begin()));
  }
}

double RenderedMotion::end_s() const {
  return static_cast<double>(columns_.front().size() - 1) / rate_hz_;
}

data::Pose<> RenderedMotion::at(double t_s) const {
  const auto last = columns_.front().size() - 1;
  const double place = t_s * rate_hz_;
  const auto i = std::clamp<Eigen::Index>(static_cast<Eigen::Index>(std::floor(place)) - 1, 0,
                                          std::max<Eigen::Index>(0, last - 3));
  // Half of the last picture's exposure lies beyond the end of a run that would have gone on.
  const double until =
      static_cast<double>(last) + (outcome_ == model::Outcome::reached_end ? 0.5 * kPerFrame : 0.0);
  const double u = std::min(place, until) - static_cast<double>(i);
  const auto value = [&](std::size_t column) {
    const Eigen::VectorXd& v = columns_[column];
    if (last < 3) return v[std::clamp<Eigen::Index>(std::lround(place), 0, last)];
    constexpr std::array kPlaces{0.0, 1.0, 2.0, 3.0};
    return data::polynomial_at<double>(kPlaces, {v.data() + i, kPlaces.size()}, u);
  };
  data::Pose<> pose;
  pose.centre_m = {value(0), value(1), value(2)};
  pose.theta_rad = value(3);
  pose.phi_rad = value(4);
  pose.psi_rad = value(5);
  return pose;
}

data::Camera camera_over(const RenderedMotion& motion, double radius_m, int width_px,
                         int height_px) {
  constexpr double kHeight_radii = 25.0, kMargin_radii = 1.8;
  constexpr int kLooks = 200;
  Eigen::Vector2d low = motion.at(0.0).centre_m.head<2>(), high = low;
  for (int i = 0; i <= kLooks; ++i) {
    const Eigen::Vector2d p = motion.at(motion.end_s() * i / kLooks).centre_m.head<2>();
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const Eigen::Vector2d size =
      high - low + Eigen::Vector2d::Constant(2.0 * kMargin_radii * radius_m);
  const double scale = std::min(width_px / size.x(), height_px / size.y());
  const Eigen::Vector2d middle = 0.5 * (low + high);
  const double height = std::max(kHeight_radii * radius_m, 2.0 * size.maxCoeff());
  data::Camera camera = data::Camera::overhead(width_px, height_px, scale, height);
  camera.camera_from_table_m -=
      camera.camera_from_table * Eigen::Vector3d(middle.x(), middle.y(), 0.0);
  return camera;
}

}  // namespace trochoid::tools
