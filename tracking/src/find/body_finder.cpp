#include "find/body_finder.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "pose/pose_start.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/outline.hpp"

namespace trochoid::tracking {
namespace {

/// Distance from an edge beyond the blur of optics, codec and motion during the exposure.
double gap_px(const Look& look, const Eigen::Vector2d& normal_px, double exposure_fraction) {
  constexpr double kStillPx = 2.0;
  return kStillPx + 0.5 * exposure_fraction * std::abs(normal_px.dot(look.motion_px));
}

class RimFinder final : public BodyFinder {
 public:
  [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
    RimSearch search{.reach_px = look.reach_px,
                     .noise_levels = look.background.noise_levels,
                     .background = &look.background.luma};
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
                  .contrast = contrast_of(look, fit->ellipse),
                  .edges = std::move(fit->edges)};
    return seen;
  }

  void place(Sighting& /*guess*/) const override {}

 private:
  /// Of a body known by its rim only a band inside it is sure to be there: the middle may be a
  /// hole.
  [[nodiscard]] static Contrast contrast_of(const Look& look, const Ellipse& rim) {
    constexpr int kPoints = 48;
    std::vector<Eigen::Vector2d> face;
    std::vector<Border> outline;
    const Eigen::Matrix2d inverse = rim.shape_px.inverse();
    for (int i = 0; i < kPoints; ++i) {
      const double angle = data::kTurn * i / kPoints;
      const Eigen::Vector2d u(std::cos(angle), std::sin(angle));
      face.emplace_back(rim.centre_px + 0.85 * (rim.shape_px * u));
      outline.push_back({rim.centre_px + rim.shape_px * u, (inverse * u).normalized(),
                         gap_px(look, (inverse * u).normalized(), 0.5)});
    }
    return measure_contrast(look.frame, look.background, face, outline);
  }
};

class CylinderFinder final : public BodyFinder {
 public:
  CylinderFinder(const data::Body& body, const data::Support& support, const data::Camera& camera,
                 double exposure_fraction, Effort effort, const Eigen::Vector2d& readout_per_px)
      : body_(body),
        camera_(camera),
        exposure_fraction_(exposure_fraction),
        readout_per_px_(readout_per_px),
        alike_(body.faces_look_alike() && support.kind != data::SupportKind::pivot),
        pivoted_(support.kind == data::SupportKind::pivot),
        motion_(body, support, camera),
        fitter_(body, support, camera, effort),
        looks_again_(effort != Effort::quick) {
    if (support.kind != data::SupportKind::floor) return;
    const data::Support flat{data::SupportKind::flat, {}};
    lying_ = std::make_unique<CylinderFinder>(body, flat, camera, exposure_fraction, effort,
                                              readout_per_px);
  }

  [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
    const OutlineView view{
        .luma = look.frame.luma,
        .background = look.background.luma,
        .detection = look.detection,
        .predicted = look.predicted != nullptr && look.predicted->pose
                         ? std::optional(look.predicted->pose->pose)
                         : std::nullopt,
        .previous = look.last != nullptr && look.last->pose ? std::optional(look.last->pose->pose)
                                                            : std::nullopt,
        .side_of_previous = look.side_of_last,
        .readout_per_px = readout_per_px_,
        .exposure_fraction = exposure_fraction_,
        .chroma = look.frame.chroma,
        .background_chroma = look.background.chroma,
        .chroma_site_px = look.background.chroma_site_px,
        .blur_px = look.last != nullptr && look.last->pose ? std::optional(look.last->pose->blur_px)
                                                           : std::nullopt,
        .shading = look.shading,
        .visit = looks_again_ ? look.shading != nullptr ? Visit::again : Visit::first : Visit::only,
        .there = look.there};
    auto measured = fitter_.measure(view);
    if (!measured) return std::nullopt;
    Sighting seen{.centre_px = measured->centre_px,
                  .covariance_px2 = measured->covariance_px2,
                  .rim = rim_of(measured->pose),
                  .pose = {},
                  .turned_rad = {},
                  .rms_px = measured->rms_px,
                  .accepted = measured->accepted,
                  .contrast = contrast_of(look, measured->pose),
                  .edges = std::move(measured->edges)};
    measured->edges.clear();
    seen.pose = std::move(*measured);
    return seen;
  }

  void place(Sighting& guess) const override {
    if (!guess.pose) return;
    guess.rim = rim_of(guess.pose->pose);
    guess.centre_px = guess.pose->centre_px = guess.rim.centre_px;
  }
  [[nodiscard]] std::optional<data::Pose<>> mirror_image(const data::Pose<>& pose) const override {
    if (motion_.rotation() < 0 || pivoted_) return std::nullopt;
    return tracking::mirrored(camera_, motion_, pose);
  }
  [[nodiscard]] OtherReadings other_readings(const data::Pose<>& pose) const override {
    if (motion_.rotation() < 0) return {};
    return {face_outlined_like(body_, camera_, motion_, pose, Side::same),
            outlined_like_face(body_, camera_, motion_, pose)};
  }
  [[nodiscard]] std::optional<FloorDarkening> floor_around(
      const Frame& frame, const Plate& background, const data::Pose<>& pose) const override {
    return FloorDarkening(frame.luma, background.luma, body_, pose, camera_);
  }
  [[nodiscard]] const BodyFinder* lying() const override { return lying_.get(); }
  [[nodiscard]] double expected_major_px(const Eigen::Vector2d& at_px) const override {
    try {
      const Eigen::Vector3d at = camera_.table_from_image(at_px, body_.half_thickness_m());
      const Eigen::Matrix2d J = camera_.jacobian_px_per_m(at).leftCols<2>();
      return body_.radius_m * std::sqrt(std::abs(J.determinant()));
    } catch (const NumericalError&) {  // looks above the horizon
      return 0.0;
    }
  }
  [[nodiscard]] double reach_px(const Sighting& seen) const override {
    return seen.rim.semi_major_px() * std::hypot(1.0, body_.half_thickness_m() / body_.radius_m);
  }
  [[nodiscard]] bool faces_look_alike() const override { return alike_; }
  [[nodiscard]] double mark_rad() const override {
    return body_.marks.empty() ? 0.0 : body_.marks.front().angle_rad;
  }

 private:
  [[nodiscard]] Contrast contrast_of(const Look& look, const data::Pose<>& pose) const {
    constexpr double kStepPx = 4.0;
    constexpr int kSpokes = 16;
    std::vector<Border> outline;
    for (const auto& point : data::visible_outline(body_, pose, camera_, kStepPx))
      if (point.silhouette)
        outline.push_back(
            {point.image_px, point.normal_px, gap_px(look, point.normal_px, exposure_fraction_)});
    std::vector<Eigen::Vector2d> face;
    const Eigen::Vector3d node = node_line(pose), across = axis_of(pose).cross(node);
    for (const double share : {0.25, 0.5, 0.75}) {
      const double radius = body_.inner_radius_m + share * (body_.radius_m - body_.inner_radius_m);
      for (int i = 0; i < kSpokes; ++i) {
        const double angle = data::kTurn * i / kSpokes;
        face.emplace_back(camera_.image_from_table<double>(
            pose.centre_m + radius * (std::cos(angle) * node + std::sin(angle) * across)));
      }
    }
    return measure_contrast(look.frame, look.background, face, outline);
  }

  /// The ellipse the outer rim of the middle plane appears as, to first order.
  [[nodiscard]] Ellipse rim_of(const data::Pose<>& pose) const {
    const Eigen::Matrix<double, 2, 3> px_per_m = camera_.jacobian_px_per_m(pose.centre_m);
    const Eigen::Vector3d node = node_line(pose), across = axis_of(pose).cross(node);
    Eigen::Matrix2d axes;
    axes << px_per_m * node * body_.radius_m, px_per_m * across * body_.radius_m;
    // axes u runs round the rim, and so does sqrt(axes axes^T) u: the symmetric root, in closed
    // form. A rim seen edge on has no inverse; a pixel squared more, far below what is measured,
    // gives it a width.
    const Eigen::Matrix2d square = axes * axes.transpose() + Eigen::Matrix2d::Identity();
    const double root = std::sqrt(square.determinant());
    return {camera_.image_from_table<double>(pose.centre_m),
            (square + root * Eigen::Matrix2d::Identity()) / std::sqrt(square.trace() + 2.0 * root)};
  }

  data::Body body_;
  data::Camera camera_;
  double exposure_fraction_;
  Eigen::Vector2d readout_per_px_;
  bool alike_, pivoted_;
  data::PoseMotion motion_;
  OutlineFitter fitter_;
  bool looks_again_;
  std::unique_ptr<CylinderFinder> lying_;
};

}  // namespace

std::unique_ptr<BodyFinder> make_rim_finder() {
  return std::make_unique<RimFinder>();
}

std::unique_ptr<BodyFinder> make_cylinder_finder(const data::Body& body,
                                                 const data::Support& support,
                                                 const data::Camera& camera,
                                                 double exposure_fraction, Effort effort,
                                                 const Eigen::Vector2d& readout_per_px) {
  return std::make_unique<CylinderFinder>(body, support, camera, exposure_fraction, effort,
                                          readout_per_px);
}

}  // namespace trochoid::tracking
