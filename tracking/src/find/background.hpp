#pragma once
#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "find/cast_shadow.hpp"
#include "find/quantiles.hpp"
#include "find/rim_fit.hpp"

namespace trochoid::tracking {

/// The scene without the bodies, at the brightness of some frame.
struct Plate {
  cv::Mat luma;    ///< CV_8UC1
  cv::Mat chroma;  ///< CV_8UC2 of half the size as Frame::chroma, or empty
  /// Standard deviation of one pixel over time [levels].
  double noise_levels = 1.0, chroma_noise_levels = 1.0;
  /// Where samples of chroma lie, from the middle of the four pixels they belong to.
  Eigen::Vector2d chroma_site_px = Eigen::Vector2d::Zero();
};

/// Pictures spread over a recording: luma, and chroma of the same frames or none.
struct BackgroundSamples {
  std::vector<cv::Mat> luma, chroma;
};

/// What the camera sees without the moving bodies, from frames spread over a recording.
class Background {
 public:
  /// Number of frames the estimate works with; fewer are repeated.
  static constexpr int kSamples = Quantiles::kSamples;

  /// Per-pixel median of the samples, each brought to the brightness of one of them. Where pixels
  /// changed and the median does not look like the static surroundings - a body rested or hovered
  /// there most of the time - samples that do take its place; where none does and the picture never
  /// settles, the surroundings themselves do.
  /// Samples in which something else, a hand, covers much of the picture are left out, as long as
  /// most of the others agree; so are those far darker or brighter than most.
  /// Where the chroma of pixels changed - a body as dark as the floor - they changed as well.
  /// @param samples CV_8UC1 (and CV_8UC2) of one size, at least one.
  static Background from_samples(const BackgroundSamples& samples);

  /// Continues the floor beside a rim below it: for a body whose outline never moves, which is in
  /// the estimate itself.
  void clear_of(const Ellipse& rim);

  /// The same, lit by a lamp whose place is known.
  [[nodiscard]] Background lit_by(const std::optional<Lamp>& lamp) const {
    Background lit = *this;
    lit.lamp_ = lamp;
    return lit;
  }
  [[nodiscard]] const std::optional<Lamp>& lamp() const { return lamp_; }

  /// The same, with Plate::chroma_site_px known.
  [[nodiscard]] Background sited_at(const Eigen::Vector2d& chroma_site_px) const {
    Background sited = *this;
    sited.plate_.chroma_site_px = chroma_site_px;
    return sited;
  }

  /// At the brightness of one of the samples; noise at least 0.7 levels.
  [[nodiscard]] const Plate& plate() const { return plate_; }
  /// Pixels that changed in some sample by more than noise (CV_8UC1, 0 or 255).
  [[nodiscard]] const cv::Mat& active() const { return active_; }
  /// Share of the picture that changes most of the time: near 0 for a camera on a stand.
  [[nodiscard]] double restless() const { return restless_; }
  /// Nearly all of the picture changes, and by far more than noise: the camera is not on a stand.
  [[nodiscard]] bool camera_moves() const;

  /// Brightness of a frame relative to the plate: the median ratio over a coarse grid, so that a
  /// body, a hand or a shadow on less than half of the picture does not count.
  [[nodiscard]] double gain(const cv::Mat& luma) const;
  /// gain x plate within `box`, into a plate of the full size (pixels outside are left alone).
  void scaled_into(Plate& plate, double gain, const cv::Rect& box) const;
  /// All of the plate at the brightness of a frame.
  [[nodiscard]] Plate plate_of(const cv::Mat& luma) const {
    Plate plate;
    scaled_into(plate, gain(luma), cv::Rect({}, luma.size()));
    return plate;
  }

 private:
  static Background estimated(const BackgroundSamples& samples);
  void estimate_chroma(const std::vector<cv::Mat>& samples, const std::vector<double>& gains);

  Plate plate_;
  cv::Mat active_;
  double restless_ = 0.0;
  std::optional<Lamp> lamp_;
};

}  // namespace trochoid::tracking
