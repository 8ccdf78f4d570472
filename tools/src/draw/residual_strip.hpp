#pragma once
#include <opencv2/core.hpp>
#include <string>

#include "draw/overlay_content.hpp"

namespace trochoid::tools {

/// What stands above a row: words at its left end, and at its right one "x y" with the meaning of
/// the bands; the shorter, the narrower the row.
struct RowCaption {
  std::string words, bands;
  /// With x and y, and a gap before them.
  [[nodiscard]] double width_px(double text_px) const;
};
/// @param name  what the row is of, in front of the words.
[[nodiscard]] RowCaption row_caption(const std::string& name, double rms_mm, double width_px,
                                     double text_px);

/// Residuals (observed minus predicted) against time, x and y of every object, with bands of one
/// and two sigma and the frames without a detection hatched; without a fit only the hatched time
/// line.
class ResidualStrip {
 public:
  /// @param from_s, to_s span of the time axis, from_s < to_s.
  /// @param text_px height of a capital letter.
  ResidualStrip(const OverlayContent& content, double from_s, double to_s, int width_px,
                double text_px);
  /// Height it needs: a row per object with residuals, or one thin row.
  [[nodiscard]] int height_px() const { return picture_.rows; }
  /// Copies the strip into `target` (CV_8UC3 of its size), with a cursor at t_s unless NaN.
  void draw(cv::Mat target, double t_s) const;

 private:
  struct Row {
    double top_px, bottom_px;
    double limit_mm;
  };
  [[nodiscard]] double x_of(double t_s) const;
  [[nodiscard]] double y_of(const Row& row, double value_mm) const;
  void draw_row(const ObjectPaths& paths, const Row& row, const std::string& name);
  void draw_bands(const ObjectPaths& paths, const Row& row);
  void draw_gaps(const ObjectPaths& paths, double top_px, double bottom_px);
  void draw_time_axis(double top_px);

  cv::Mat picture_;
  double from_s_, to_s_, left_px_, right_px_, text_px_;
  double plot_top_px_, plot_bottom_px_;
};

}  // namespace trochoid::tools
