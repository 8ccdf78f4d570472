#include "body_finder.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

namespace trochoid::tracking {
namespace {

class RimFinder final : public BodyFinder {
 public:
  explicit RimFinder(bool circle) : circle_(circle) {}

  [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
    RimSearch search{.reach_px = look.reach_px,
                     .noise_levels = look.noise_levels,
                     .circle = circle_,
                     .background = &look.background};
    Ellipse start;
    if (look.predicted != nullptr) {
      start = look.predicted->rim;
      search.known_shape_px = start.shape_px;
      search.known_shape_sigma_px = look.shape_sigma_px;
    } else if (look.detection) {
      const Detection& d = *look.detection;
      start = Ellipse::from_axes(d.centre_px, d.semi_major_px, d.semi_minor_px, d.angle_rad);
      search.reach_px = std::clamp(0.4 * d.semi_minor_px, 3.0, 30.0);
    } else {
      return std::nullopt;
    }
    auto fit = fit_rim(look.frame.luma, start, search);
    if (!fit || fit->rms_px > 0.08 * fit->ellipse.semi_minor_px() + 0.3) return std::nullopt;
    Sighting seen{.centre_px = fit->ellipse.centre_px,
                  .covariance_px2 = fit->covariance_px2,
                  .rim = fit->ellipse,
                  .pose = {},
                  .turned_rad = {},
                  .rms_px = fit->rms_px,
                  .accepted = fit->accepted,
                  .edges = std::move(fit->edges)};
    return seen;
  }

 private:
  bool circle_;
};

class CylinderFinder final : public BodyFinder {
 public:
  CylinderFinder(const data::Body& body, const data::Support& support, const data::Camera& camera,
                 double exposure_fraction)
      : body_(body),
        camera_(camera),
        exposure_fraction_(exposure_fraction),
        fitter_(body, support, camera) {}

  [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
    const OutlineEvidence evidence{.luma = look.frame.luma,
                                   .background = look.background,
                                   .detection = look.detection,
                                   .predicted = look.predicted != nullptr && look.predicted->pose
                                                    ? std::optional(look.predicted->pose->pose)
                                                    : std::nullopt,
                                   .smear_px = exposure_fraction_ * look.motion_px};
    auto measured = fitter_.measure(evidence);
    if (!measured) return std::nullopt;
    Sighting seen{.centre_px = measured->centre_px,
                  .covariance_px2 = measured->covariance_px2,
                  .rim = rim_of(measured->pose),
                  .pose = {},
                  .turned_rad = {},
                  .rms_px = measured->rms_px,
                  .accepted = measured->accepted,
                  .edges = std::move(measured->edges)};
    measured->edges.clear();
    seen.pose = std::move(*measured);
    return seen;
  }

 private:
  /// The ellipse the outer rim of the middle plane appears as, to first order.
  [[nodiscard]] Ellipse rim_of(const data::Pose<>& pose) const {
    const Eigen::Matrix<double, 2, 3> px_per_m = camera_.jacobian_px_per_m(pose.centre_m);
    const double cos_phi = std::cos(pose.phi_rad), sin_phi = std::sin(pose.phi_rad);
    const Eigen::Vector3d node(cos_phi, sin_phi, 0.0);
    const Eigen::Vector3d across = data::symmetry_axis(pose.theta_rad, pose.phi_rad).cross(node);
    Eigen::Matrix2d axes;
    axes << px_per_m * node * body_.radius_m, px_per_m * across * body_.radius_m;
    // axes u runs round the rim, and so does sqrt(axes axes^T) u: the symmetric root, in closed
    // form.
    const Eigen::Matrix2d square = axes * axes.transpose() + Eigen::Matrix2d::Identity();
    const double root = std::sqrt(square.determinant());
    return {camera_.image_from_table<double>(pose.centre_m),
            (square + root * Eigen::Matrix2d::Identity()) / std::sqrt(square.trace() + 2.0 * root)};
  }

  data::Body body_;
  data::Camera camera_;
  double exposure_fraction_;
  OutlineFitter fitter_;
};

}  // namespace

std::unique_ptr<BodyFinder> make_rim_finder(bool circle) {
  return std::make_unique<RimFinder>(circle);
}

std::unique_ptr<BodyFinder> make_cylinder_finder(const data::Body& body,
                                                 const data::Support& support,
                                                 const data::Camera& camera,
                                                 double exposure_fraction) {
  return std::make_unique<CylinderFinder>(body, support, camera, exposure_fraction);
}

}  // namespace trochoid::tracking
