#pragma once
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "find/rim_fit.hpp"

namespace trochoid::tracking {

/// An angle in the image: from x towards y (clockwise on the screen) [rad].
struct ImageAngle {
  double angle_rad = 0.0;
  double sigma_rad = 0.0;
  double correlation = 0.0;  ///< normalised correlation with the reference, -1..1
};

/// Reads how far a face has turned since a reference frame from whatever is painted on it: the face
/// is unrolled into a polar picture, shading is cut away below a threshold, and the rest correlated
/// with the reference. Always against the same reference, so that errors do not add up.
class SpinProfile {
 public:
  /// Nothing if the face bears no mark that stands out of noise and shading.
  static std::optional<SpinProfile> from_face(const cv::Mat& luma, const Ellipse& rim,
                                              double noise_levels);

  /// Angle turned since the reference, next to `predicted_rad`, at most `window_rad` from it.
  [[nodiscard]] std::optional<ImageAngle> read(const cv::Mat& luma, const Ellipse& rim,
                                               double predicted_rad, double window_rad) const;

  /// Direction of the marks in the reference frame, image angle: of the one mark, or of the line
  /// through two opposite ones (mod pi).
  [[nodiscard]] double reference_angle_rad() const { return reference_angle_; }
  /// Turned by half a turn the face looks the same.
  [[nodiscard]] bool two_fold() const { return two_fold_; }

 private:
  using Polar = std::vector<float>;  ///< kRings x kSpokes, ring by ring
  [[nodiscard]] static Polar unroll(const cv::Mat& luma, const Ellipse& rim);
  void cut(Polar& polar) const;
  [[nodiscard]] float correlation(const Polar& polar, int shift) const;
  void orient();

  Polar reference_;
  float power_ = 0.0F;        ///< sum of squares of the reference
  float slope_power_ = 0.0F;  ///< of its derivative by angle [levels^2/rad^2]
  float threshold_ = 0.0F;
  double noise_ = 1.0;
  double independent_share_ = 1.0;  ///< independent pixels per polar sample
  double reference_angle_ = 0.0;
  bool two_fold_ = false;
};

}  // namespace trochoid::tracking
