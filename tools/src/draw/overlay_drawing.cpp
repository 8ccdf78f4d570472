#include "draw/overlay_drawing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "draw/round_lengths.hpp"

namespace trochoid::tools {
namespace {

std::string scale_bar_words(double length_m) {
  if (length_m >= 1.0) return fmt::format("{:g} m", length_m);
  if (length_m >= 1e-3) return fmt::format("{:g} mm", length_m * 1e3);
  return fmt::format("{:g} um", length_m * 1e6);
}

}  // namespace

cv::Size Enlargement::size() const {
  const auto even = [this](int length) {
    return 2 * static_cast<int>(std::lround(0.5 * length * factor));
  };
  return {even(cutting.width), even(cutting.height)};
}

cv::Mat Enlargement::picture(const cv::Mat& bgr) const {
  cv::Mat large;
  cv::resize(bgr(cutting), large, size(), 0, 0, factor < 1.0 ? cv::INTER_AREA : cv::INTER_CUBIC);
  return large;
}

Stroke observed_stroke() {
  return {.colour = palette::observed, .width_px = 1, .halo_px = 1};
}

Stroke predicted_stroke(int width_px) {
  return {.colour = palette::predicted, .width_px = width_px, .halo_px = 1, .halo_alpha = 0.7};
}

void add_wireframe(Ink& ink, const std::vector<data::WireCurve>& curves, const Enlargement& view,
                   const Stroke& stroke) {
  for (const data::WireCurve& curve : curves) {
    std::vector<Eigen::Vector2d> hidden_run;
    for (std::size_t i = 1; i < curve.image_px.size(); ++i) {
      const Eigen::Vector2d from = view(curve.image_px[i - 1]), to = view(curve.image_px[i]);
      const bool hidden = curve.hidden[i - 1] || curve.hidden[i];
      if (!hidden) ink.line(from, to, stroke, 1.0);
      if (hidden && hidden_run.empty()) hidden_run.push_back(from);
      if (hidden) hidden_run.push_back(to);
      if (!hidden || i + 1 == curve.image_px.size()) {
        ink.dashes(hidden_run, stroke, 0.6, 2.0, 5.0);
        hidden_run.clear();
      }
    }
  }
}

void draw_scale_bar(cv::Mat picture, std::optional<double> scale_px_per_m, double enlargement,
                    double text_px) {
  constexpr double kLargestShare = 0.22;  // of the picture's width
  const double unit_px = enlargement * scale_px_per_m.value_or(1.0);
  const double length = round_length(kLargestShare * picture.cols / unit_px);
  const double length_px = length * unit_px;
  const double left = 1.6 * text_px, base = picture.rows - 1.6 * text_px;
  const Stroke stroke{.colour = palette::white, .width_px = 2, .halo_px = 1, .halo_alpha = 0.8};
  Ink ink(picture.size());
  ink.line({left, base}, {left + length_px, base}, stroke, 1.0);
  for (const double x : {left, left + length_px})
    ink.line({x, base - 0.4 * text_px}, {x, base + 0.4 * text_px}, stroke, 1.0);
  ink.lay_on(picture, stroke);
  draw_text_with_halo(
      picture, scale_px_per_m ? scale_bar_words(length) : fmt::format("{:g} px", length),
      {left + 0.5 * length_px, base - 0.9 * text_px}, text_px, palette::white, Align::centre);
}

double draw_legend(cv::Mat picture, const OverlayContent& content, const cv::Point2d& right,
                   double text_px) {
  const double middle = right.y - 0.45 * text_px;
  double x = right.x;
  const auto words = [&](const std::string& text) {
    draw_text(picture, text, {x, right.y}, text_px, palette::white, Align::right);
    x -= text_width_px(text, text_px) + 0.7 * text_px;
  };
  Ink ink(picture.size());
  if (content.has_prediction()) {
    words(fmt::format("predicted ({})", content.prediction().model));
    const Stroke line = predicted_stroke();
    ink.line({x - 2.4 * text_px, middle}, {x, middle}, line, 1.0);
    ink.lay_on(picture, line);
    ink.clear();
    x -= 4.0 * text_px;
  }
  words("observed");
  const Stroke dots = observed_stroke();
  for (const double at : {0.4, 1.3, 2.2})
    ink.dot({x - at * text_px, middle}, 0.28 * text_px, dots, 1.0 - 0.3 * at);
  ink.lay_on(picture, dots);
  return x - 2.6 * text_px;
}

bool legend_fits_beside(const std::string& words, const OverlayContent& content, double width_px,
                        double text_px) {
  cv::Mat scratch(1, 1, CV_8UC3);
  const double legend_px = -draw_legend(scratch, content, {0.0, 0.0}, text_px);
  return text_width_px(words, text_px) + text_px + legend_px <= width_px;
}

std::vector<Eigen::Vector2d> thinned(const std::vector<Eigen::Vector2d>& points,
                                     const Enlargement& view, double spacing_px) {
  std::vector<Eigen::Vector2d> kept;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) continue;
    const Eigen::Vector2d at = view(points[i]);
    if (kept.empty() || i + 1 == points.size() || (at - kept.back()).norm() >= spacing_px)
      kept.push_back(at);
  }
  return kept;
}

}  // namespace trochoid::tools
