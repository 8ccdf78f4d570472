#include "draw/residual_strip.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "common/constants.hpp"
#include "draw/canvas.hpp"
#include "draw/round_lengths.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tools {
namespace {

const cv::Scalar kPaper(250, 250, 250);
const cv::Scalar kTwoSigma(232, 228, 226);
const cv::Scalar kOneSigma(212, 205, 200);
const cv::Scalar kAxis(90, 90, 90);
const cv::Scalar kWords(40, 40, 40);

// Half height of a row: room for two sigma and all but the wildest residuals.
double limit_mm(const std::vector<Residual>& list) {
  std::vector<double> sizes, sigmas;
  for (const Residual& residual : list)
    for (int axis = 0; axis < 2; ++axis) {
      sizes.push_back(std::abs(residual.value_m[axis]) * kMmPerM);
      if (std::isfinite(residual.sigma_m[axis])) sigmas.push_back(residual.sigma_m[axis] * kMmPerM);
    }
  const double limit = 1.15 * std::fmax(data::quantile(sizes, 0.995), 2.6 * data::median(sigmas));
  return limit > 0.0 ? limit : 1.0;
}

constexpr double kCaption = 2.4;           // of a row [heights of a capital]
constexpr double kKey = 3.4, kKeyY = 1.6;  // from the left ends of "x" and "y" to the bands' words

}  // namespace

double RowCaption::width_px(double text_px) const {
  return text_width_px(words, text_px) + (1.0 + kKey) * text_px + text_width_px(bands, text_px);
}

RowCaption row_caption(const std::string& name, double rms_mm, double width_px, double text_px) {
  const auto tried = [&](int brevity, const std::string& rms) {
    const std::string words = brevity == 4 ? name + "[mm]"
                              : brevity % 2 == 0
                                  ? name + "observed - predicted [mm]   rms per axis " + rms
                                  : name + "residual [mm], rms " + rms;
    return RowCaption{words, brevity < 2 ? "bands: 1, 2 sigma" : ""};
  };
  int brevity = 0;  // by the longest number, so that all rows say the same
  while (brevity < 4 && tried(brevity, "8.88e-88").width_px(text_px) > width_px) ++brevity;
  return tried(brevity, fmt::format("{:.3g}", rms_mm));
}

ResidualStrip::ResidualStrip(const OverlayContent& content, double from_s, double to_s,
                             int width_px, double text_px)
    : from_s_(from_s), to_s_(to_s > from_s ? to_s : from_s + 1.0), text_px_(text_px) {
  std::vector<const ObjectPaths*> with_residuals;
  for (const ObjectPaths& paths : content.objects())
    if (!paths.residuals.empty()) with_residuals.push_back(&paths);
  const double row_px = with_residuals.empty() ? 2.0 * text_px : 8.0 * text_px;
  const std::size_t rows = std::max<std::size_t>(1, with_residuals.size());
  const double pitch_px = row_px + kCaption * text_px;
  left_px_ = 6.5 * text_px;
  right_px_ = width_px - 1.2 * text_px;
  plot_top_px_ = (with_residuals.empty() ? 0.8 : 2.6) * text_px;
  plot_bottom_px_ =
      plot_top_px_ + static_cast<double>(rows - 1) * pitch_px + row_px + 0.8 * text_px;
  const int height = static_cast<int>(plot_bottom_px_ + 2.4 * text_px);
  picture_ = cv::Mat(height + height % 2, width_px, CV_8UC3, kPaper);
  for (std::size_t i = 0; i < with_residuals.size(); ++i) {
    Row row{};
    row.top_px = plot_top_px_ + static_cast<double>(i) * pitch_px;
    row.bottom_px = row.top_px + row_px;
    row.limit_mm = limit_mm(with_residuals[i]->residuals);
    const std::string name =
        with_residuals.size() > 1 ? fmt::format("object {}: ", with_residuals[i]->object) : "";
    draw_gaps(*with_residuals[i], row.top_px, row.bottom_px);
    draw_row(*with_residuals[i], row, name);
  }
  if (with_residuals.empty())
    for (const ObjectPaths& paths : content.objects())
      draw_gaps(paths, plot_top_px_, plot_top_px_ + row_px);
  draw_time_axis(plot_bottom_px_);
}

double ResidualStrip::x_of(double t_s) const {
  return left_px_ + (right_px_ - left_px_) * (t_s - from_s_) / (to_s_ - from_s_);
}

double ResidualStrip::y_of(const Row& row, double value_mm) const {
  const double clipped = std::clamp(value_mm, -row.limit_mm, row.limit_mm);
  return 0.5 * (row.top_px + row.bottom_px) -
         0.5 * (row.bottom_px - row.top_px) * clipped / row.limit_mm;
}

void ResidualStrip::draw_bands(const ObjectPaths& paths, const Row& row) {
  // A column of the strip shows the largest sigma of the samples that fall into it and both axes.
  const auto columns = static_cast<std::size_t>(picture_.cols);
  std::vector<double> sigma_mm(columns, 0.0);
  double last_x = -1.0, last_mm = 0.0;
  const double step_px = (x_of(paths.usual_step_s) - x_of(0.0)) * 1.5 + 1.0;
  for (const Residual& residual : paths.residuals) {
    const double mm = residual.sigma_m.maxCoeff() * kMmPerM;
    const double x = x_of(residual.t_s);
    if (!std::isfinite(mm) || x < left_px_ || x > right_px_) continue;
    const double start = last_x >= 0.0 && x - last_x <= step_px ? last_x : x;
    for (double column = std::floor(start); column <= x; ++column) {
      auto& cell = sigma_mm[static_cast<std::size_t>(column)];
      cell = std::max({cell, mm, last_x >= 0.0 ? std::min(last_mm, mm) : 0.0});
    }
    last_x = x;
    last_mm = mm;
  }
  for (const auto& [factor, colour] : {std::pair(2.0, kTwoSigma), std::pair(1.0, kOneSigma)})
    for (std::size_t column = 0; column < columns; ++column) {
      if (sigma_mm[column] <= 0.0) continue;
      const auto at = [&](double mm) { return static_cast<int>(std::lround(y_of(row, mm))); };
      const int x = static_cast<int>(column);
      cv::line(picture_, {x, at(-factor * sigma_mm[column])}, {x, at(factor * sigma_mm[column])},
               colour);
    }
}

void ResidualStrip::draw_row(const ObjectPaths& paths, const Row& row, const std::string& name) {
  draw_bands(paths, row);
  const auto pixel = [](double value) { return static_cast<int>(std::lround(value)); };
  const double step_mm = round_length(row.limit_mm);  // three numbers at least
  for (int k = -static_cast<int>(row.limit_mm / step_mm); k * step_mm <= row.limit_mm; ++k) {
    const double y = y_of(row, k * step_mm);
    cv::line(picture_, {pixel(left_px_) - 3, pixel(y)},
             {k == 0 ? pixel(right_px_) : pixel(left_px_), pixel(y)}, kAxis);
    draw_text(picture_, fmt::format("{:.4g}", k * step_mm), {left_px_ - 6.0, y + 0.4 * text_px_},
              0.85 * text_px_, kWords, Align::right);
  }
  cv::line(picture_, {pixel(left_px_), pixel(row.top_px)}, {pixel(left_px_), pixel(row.bottom_px)},
           kAxis);
  const double radius = std::clamp(0.14 * text_px_, 1.1, 2.5);
  for (int axis = 0; axis < 2; ++axis) {
    const Stroke stroke{.colour = axis == 0 ? palette::residual_x : palette::residual_y,
                        .halo_px = 0};
    Ink ink(picture_.size());
    for (const Residual& residual : paths.residuals) {
      const double mm = residual.value_m[axis] * kMmPerM;
      const Eigen::Vector2d at(x_of(residual.t_s), y_of(row, mm));
      if (at.x() < left_px_ || at.x() > right_px_) continue;
      // y is drawn as a small ring, so that shape tells the two apart as well as colour.
      if (axis == 0)
        ink.dot(at, radius, stroke, 0.9);
      else
        ink.ring(at, radius + 0.3, stroke, 0.9);
    }
    ink.lay_on(picture_, stroke);
  }
  const double base = row.top_px - 0.5 * text_px_;
  const RowCaption caption =
      row_caption(name, rms_m(paths.residuals) * kMmPerM, right_px_ - left_px_, text_px_);
  const double words_left = right_px_ - text_width_px(caption.bands, text_px_);
  draw_text(picture_, caption.words, {left_px_, base}, text_px_, kWords);
  draw_text(picture_, "x", {words_left - kKey * text_px_, base}, text_px_, palette::residual_x);
  draw_text(picture_, "y", {words_left - kKeyY * text_px_, base}, text_px_, palette::residual_y);
  draw_text(picture_, caption.bands, {right_px_, base}, text_px_, kWords, Align::right);
}

void ResidualStrip::draw_gaps(const ObjectPaths& paths, double top_px, double bottom_px) {
  const double usual_s = paths.usual_step_s;
  const auto hatch = [&](double from_s, double to_s) {
    const double x0 = std::max(x_of(from_s), left_px_), x1 = std::min(x_of(to_s), right_px_);
    for (double x = x0; x < x1; x += 4.0)
      cv::line(picture_, cv::Point2d(x, bottom_px), cv::Point2d(std::min(x + 4.0, x1), top_px),
               cv::Scalar(170, 170, 170), 1, cv::LINE_AA);
  };
  if (paths.observed.empty()) return;
  hatch(from_s_, paths.observed.front().t_s - 0.5 * usual_s);
  for (std::size_t i = 1; i < paths.observed.size(); ++i)
    if (paths.observed[i].t_s - paths.observed[i - 1].t_s > 1.5 * usual_s)
      hatch(paths.observed[i - 1].t_s + 0.5 * usual_s, paths.observed[i].t_s - 0.5 * usual_s);
  hatch(paths.observed.back().t_s + 0.5 * usual_s, to_s_);
}

void ResidualStrip::draw_time_axis(double top_px) {
  const auto pixel = [](double value) { return static_cast<int>(std::lround(value)); };
  cv::line(picture_, {pixel(left_px_), pixel(top_px)}, {pixel(right_px_), pixel(top_px)}, kAxis);
  const double step_s = round_step(to_s_ - from_s_, 8);
  for (double k = std::ceil(from_s_ / step_s - 1e-9) + 0.0; k * step_s <= to_s_ + 1e-9 * step_s;
       ++k) {
    const double x = x_of(k * step_s);
    cv::line(picture_, {pixel(x), pixel(top_px)}, {pixel(x), pixel(top_px) + 3}, kAxis);
    const std::string words = fmt::format("{:.{}f}", k * step_s, decimals_of_step(step_s));
    const double half_px = 0.5 * text_width_px(words, 0.85 * text_px_) + 1.0;
    draw_text(picture_, words, {std::min(x, picture_.cols - half_px), top_px + 1.7 * text_px_},
              0.85 * text_px_, kWords, Align::centre);
  }
  draw_text(picture_, "t [s]", {1.2 * text_px_, top_px + 1.7 * text_px_}, 0.85 * text_px_, kWords);
}

void ResidualStrip::draw(cv::Mat target, double t_s) const {
  picture_.copyTo(target);
  if (!(t_s >= from_s_ && t_s <= to_s_)) return;
  const int x = static_cast<int>(std::lround(x_of(t_s)));
  cv::line(target, {x, static_cast<int>(plot_top_px_)}, {x, static_cast<int>(plot_bottom_px_)},
           cv::Scalar(0, 0, 0), 1);
}

}  // namespace trochoid::tools
