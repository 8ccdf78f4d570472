#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"

namespace trochoid::tools {

/// How a made recording looks. Colours are reflectances 0..1, red green blue.
struct RenderStyle {
  Eigen::Vector3f body{0.06F, 0.06F, 0.07F}, mark{0.85F, 0.85F, 0.82F}, floor{0.62F, 0.61F, 0.58F};
  double texture = 0.05;          ///< standard deviation of the floor's reflectance, relative
  double texture_size_m = 0.004;  ///< of its larger grains
  double gloss = 0.1;             ///< strength of highlights, 0 = matt
  Eigen::Vector3d light{0.4, 0.3, 1.0};  ///< direction towards the middle of the lamp
  double lamp_radius_rad = 0.12;         ///< half its apparent size: how soft shadows are
  double ambient = 0.35;                 ///< share of the light that comes from everywhere
  bool shadow = true;
  double blur_px = 0.5;             ///< of the lens, standard deviation, pixels themselves apart
  double noise_levels = 1.0;        ///< standard deviation of one 8-bit sample
  double exposure_fraction = 0.25;  ///< of the frame interval
  double flicker = 0.0;             ///< relative amplitude of the light at 100 Hz
  int samples = 8;                  ///< squared, per pixel on an edge
  int times = 5;                    ///< pictures averaged over the exposure
  std::uint64_t seed = 1;
};

/// Pictures of a cylinder on a floor by ray tracing, in linear light: perspective with distortion,
/// wall and bore, marks, a thin axle, an area lamp with soft shadows, floor texture. Independent of
/// the outline the tracker fits. Pixels an edge passes through are averages of samples x samples
/// rays, so that the picture of a flat disc has its centroid right to better than 0.01 px.
class PictureRenderer {
 public:
  /// @throws InputError if the body has no shape or the camera no size.
  PictureRenderer(data::Body body, data::Camera camera, RenderStyle style);

  /// Linear light (CV_32FC3, blue green red, 0..1), sharp but for the pixels, averaged over poses.
  [[nodiscard]] cv::Mat light(const std::vector<data::Pose<>>& during_exposure) const;
  /// The same of rows that are not exposed all at once. @param during_exposure of a row: poses.
  using ExposureOfRow = std::function<std::vector<data::Pose<>>(double row_px)>;
  [[nodiscard]] cv::Mat rolling_light(const ExposureOfRow& during_exposure) const;
  /// Blurred and through the camera's transfer, 0..255, before noise and rounding (CV_32FC3).
  [[nodiscard]] cv::Mat levels(const cv::Mat& light) const;
  /// What a camera makes of it: blur, transfer, noise of frame `index`, 8 bit.
  [[nodiscard]] cv::Mat picture(const cv::Mat& light, std::int64_t index) const;

 private:
  struct Posed;
  struct Seen;
  [[nodiscard]] Eigen::Vector3d direction(double x_px, double y_px) const;
  [[nodiscard]] Eigen::Vector3d eye(double x_px, double y_px) const;
  [[nodiscard]] Seen trace(double x_px, double y_px, const Posed& body) const;
  [[nodiscard]] bool shows_mark(const Seen& seen) const;
  [[nodiscard]] Eigen::Vector3f shade_body(const Seen& seen, const Posed& body) const;
  [[nodiscard]] bool may_hide_lamp(const Eigen::Vector3d& to_body_m) const;
  [[nodiscard]] float floor_light(const Eigen::Vector3d& at_m, const Posed& body) const;
  [[nodiscard]] Eigen::Vector3f floor_colour(const Eigen::Vector3d& at_m) const;
  [[nodiscard]] cv::Rect window(const data::Pose<>& pose) const;
  [[nodiscard]] int surface_at(double x_px, double y_px, const Posed& body) const;
  [[nodiscard]] cv::Vec3f light_of_pixel(const cv::Point& pixel, int across,
                                         const Posed& body) const;
  void draw_floor();
  void draw_body(const data::Pose<>& pose, const cv::Rect& within, float share, cv::Mat& sum) const;
  void draw_exposed(const std::vector<data::Pose<>>& poses, const cv::Rect& within,
                    cv::Mat& sum) const;

  data::Body body_;
  data::Camera camera_;
  RenderStyle style_;
  double reach_m_;                        ///< of the body, from its centre of mass
  Eigen::Vector3d to_lamp_;               ///< unit vector to its middle
  Eigen::Vector3d camera_m_;              ///< where it has a centre
  std::vector<Eigen::Vector3d> lamp_;     ///< directions towards points of the lamp
  std::vector<Eigen::Vector3d> corners_;  ///< ray directions at the pixels' corners
  cv::Mat texture_;                       ///< CV_32FC1, periodic
  cv::Mat floor_;                         ///< the lit floor without the body
};

}  // namespace trochoid::tools
