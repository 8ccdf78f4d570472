#pragma once
#include <Eigen/Core>
#include <array>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/tracking/detector.hpp"
#include "trochoid/tracking/effort.hpp"

namespace trochoid::tracking {

/// How light falls off beside an outline: what one frame's measurement hands to the next one's, and
/// nothing to look into.
class ShadingMemory;

/// An edge found in the image that the fit accepted.
struct EdgePoint {
  Eigen::Vector2d image_px;
  Eigen::Vector2d normal_px;  ///< of the predicted outline
  double sigma_px = 0.0;      ///< along the normal
  double residual_px = 0.0;   ///< along the normal, after the fit
};

/// Covariance of a pose in parts that add up.
struct PoseSpread {
  Eigen::Matrix2d m2 = Eigen::Matrix2d::Zero();   ///< of the centre's x, y [m^2]
  Eigen::Matrix2d px2 = Eigen::Matrix2d::Zero();  ///< of its projection [px^2]
  double theta_rad2 = 0.0;
  double across_rad2 = 0.0;  ///< of the axis, at right angles to theta
};

/// What the widths of edges say of how long the shutter is open: its time over the frame interval,
/// squared, less that of OutlineView::exposure_fraction, and the inverse of the variance of that;
/// 0 where they do not tell.
struct ExposureEvidence {
  double more = 0.0, information = 0.0;
};

/// What one frame says about the pose of the body, with the covariance of what was estimated.
struct PoseMeasurement {
  data::Pose<> pose;               ///< psi only if a mark was read
  Eigen::Vector2d centre_px;       ///< projection of the CoM
  Eigen::Matrix2d covariance_m2;   ///< of pose.centre_m x, y
  Eigen::Matrix2d covariance_px2;  ///< of centre_px
  double sigma_theta_rad = 0.0;    ///< infinite when the image does not tell
  double sigma_phi_rad = 0.0;
  std::optional<double> sigma_psi_rad;
  bool bright_marks = false;  ///< those that psi was read from look brighter than their face
  /// Of these, what does not come from the scatter of this frame's edges.
  PoseSpread common;
  /// What a rolling shutter does to the pose, along x (first) and y of the picture: by how much it
  /// comes out too far along each small motion (data::PoseMotion) if, from one pixel to the next,
  /// the body goes on by one unit of a small motion (its column).
  using PerMotion = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0,
                                  data::PoseMotion::kMost, data::PoseMotion::kMost>;
  std::array<PerMotion, 2> sheared{};
  bool rows_in_turn = false;  ///< a rolling shutter was allowed for
  /// Variance by which the scatter has been multiplied because parts of the outline contradict each
  /// other; noisy, frames of one clip have nearly the same: PoseMeasurement::inflate.
  double inflation = 1.0;
  /// How far edges lie towards their brighter side (> 0) of where the transfer curve puts them;
  /// what edges do not tell, a prior takes for 0.
  double polarity_px = 0.0;
  /// How much farther out the rim is seen than the body's radius and the height of this pose put it
  /// [px], as far as all of it agrees on that: an edge model may be wrong by so much, or the pose.
  double larger_px = 0.0;
  /// Replaces `inflation` by a better one.
  void inflate(double better);
  double rms_px = 0.0;    ///< of the accepted edge points about the outline
  double accepted = 0.0;  ///< fraction 0..1 of the silhouette with an accepted edge where it is
  /// Length of the outline [px] that edges support, >= 0: each piece counts by how much better its
  /// edge explains the picture than none would, less its misfit. Edges in colour count as well, so
  /// that it may be more than the whole outline.
  double support_px = 0.0;
  /// 0..1: how little of where its edges lie hangs on how the light changes beside them.
  double evenness = 1.0;
  /// Compares poses in the same picture [px], >= 0: the one with the higher score is the likelier.
  [[nodiscard]] double score_px() const { return support_px * evenness; }
  double blur_px = 0.0;  ///< of the edges of this picture, for the next one
  /// How far what colours show lies off what luma does, either coordinate by itself, and the
  /// inverse of its variance [px^-2]; 0 where they do not tell.
  Eigen::Array2d colour_off_px = Eigen::Array2d::Zero();
  Eigen::Array2d colour_information = Eigen::Array2d::Zero();
  /// Light beside the outline in this picture, for others.
  std::shared_ptr<const ShadingMemory> shading;
  ExposureEvidence exposure;
  std::vector<EdgePoint> edges;
};

/// The picture and what is known of it, for one measurement. `background` may be empty.
struct OutlineView {
  const cv::Mat& luma;                 ///< CV_8UC1
  const cv::Mat& background;           ///< CV_8UC1 of the same size, or empty
  std::optional<Detection> detection;  ///< used for a start when there is no prediction
  /// Nearly right in its attitude: the mirror image is not considered.
  std::optional<data::Pose<>> predicted;
  std::optional<data::Pose<>> previous{};  ///< one frame earlier or later: how fast it moves
  int side_of_previous = 1;                ///< -1: it is the later one
  /// Rolling shutter: by what part of the frame interval a pixel is read later than the one before
  /// it, along x and along y. Allowed for where it is known how the body moves.
  Eigen::Vector2d readout_per_px = Eigen::Vector2d::Zero();
  double exposure_fraction = 0.0;  ///< shutter time over frame interval: how far it smears
  cv::Mat chroma{};                ///< CV_8UC2 of half the size, or empty: Frame::chroma
  cv::Mat background_chroma{};     ///< what it would be without the body, or empty
  /// Where samples of chroma lie, from the middle of the four pixels they belong to.
  Eigen::Vector2d chroma_site_px = Eigen::Vector2d::Zero();
  /// PoseMeasurement::blur_px of the frame before; without, it is found by looking repeatedly.
  std::optional<double> blur_px{};
  const ShadingMemory* shading = nullptr;  ///< light beside the outline in other frames, if known
  Visit visit = Visit::only;
  /// The prediction is right to about the blur of the picture: nothing farther off is looked for.
  bool there = false;
};

/// Fits the projected cylinder to sub-pixel edges: (x, y, theta, phi) with the body resting on its
/// rim (floor) or lying on its face (flat); (theta, phi, s) with the axis through a pivot and the
/// distance s along the axis free, so that a track never assumes the l it is later asked for.
class OutlineFitter {
 public:
  /// @throws InputError if body has no shape, or support is pivot without pivot_m.
  OutlineFitter(data::Body body, data::Support support, data::Camera camera,
                Effort effort = Effort::normal);
  /// Nothing if the image does not hold the body there; never a guess.
  [[nodiscard]] std::optional<PoseMeasurement> measure(const OutlineView& view) const;

 private:
  data::Body body_;
  data::Support support_;
  data::Camera camera_;
  double most_looks_;
};

}  // namespace trochoid::tracking
