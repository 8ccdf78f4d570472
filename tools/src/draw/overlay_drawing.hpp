#pragma once
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "draw/canvas.hpp"
#include "draw/overlay_content.hpp"

namespace trochoid::tools {

/// Maps pixels of the recording to pixels of an enlarged cutting: pixel centres at integers in
/// both.
struct Enlargement {
  cv::Rect cutting;     ///< of the recording
  double factor = 1.0;  ///< output pixels per recording pixel
  [[nodiscard]] Eigen::Vector2d operator()(const Eigen::Vector2d& px) const {
    return ((px - Eigen::Vector2d(cutting.x, cutting.y)).array() + 0.5) * factor - 0.5;
  }
  [[nodiscard]] cv::Size size() const;
  [[nodiscard]] cv::Mat picture(const cv::Mat& bgr) const;
};

/// How observed and predicted look, in the overlay, the still and their legends alike.
[[nodiscard]] Stroke observed_stroke();
[[nodiscard]] Stroke predicted_stroke(int width_px = 2);

/// Edges of the body; hidden ones dotted.
void add_wireframe(Ink& ink, const std::vector<data::WireCurve>& curves, const Enlargement& view,
                   const Stroke& stroke);

/// A bar of a round length with its words in the lower left corner; pixels when metres are unknown.
void draw_scale_bar(cv::Mat picture, std::optional<double> scale_px_per_m, double enlargement,
                    double text_px);

/// Key to dots, line and wireframe, right-aligned so that it ends at `right`.
/// @returns where it begins, x [px].
double draw_legend(cv::Mat picture, const OverlayContent& content, const cv::Point2d& right,
                   double text_px);
/// Whether words and the key have room beside each other.
[[nodiscard]] bool legend_fits_beside(const std::string& words, const OverlayContent& content,
                                      double width_px, double text_px);

/// Points at least `spacing_px` apart (the last one kept), NaN points removed: what a screen can
/// show.
[[nodiscard]] std::vector<Eigen::Vector2d> thinned(const std::vector<Eigen::Vector2d>& points,
                                                   const Enlargement& view, double spacing_px);

}  // namespace trochoid::tools
