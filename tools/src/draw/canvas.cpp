#include "draw/canvas.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string_view>

namespace trochoid::tools {
namespace {

constexpr int kShift = 6;  // 1/64 px, finer than an 8-bit edge can show
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr int kSupersample = 4;              // text is drawn this much larger, then averaged down
constexpr double kCapitalAtScaleOne = 21.0;  // height of a Hershey capital at scale 1 [px]

cv::Point fixed(const Eigen::Vector2d& point) {
  // Far outside the picture the fixed-point numbers would overflow; what is out of sight may move.
  constexpr double kFar = 30000.0;
  return {static_cast<int>(std::lround(std::clamp(point.x(), -kFar, kFar) * (1 << kShift))),
          static_cast<int>(std::lround(std::clamp(point.y(), -kFar, kFar) * (1 << kShift)))};
}

double level(double alpha) {
  return std::clamp(alpha, 0.0, 1.0) * 255.0;
}

// out = picture + alpha (colour - picture), alpha in 0..255; integers, rounded.
void blend(cv::Mat picture, const cv::Mat& alpha, const cv::Scalar& colour) {
  const int ink[3] = {cvRound(colour[0]), cvRound(colour[1]), cvRound(colour[2])};
  for (int row = 0; row < picture.rows; ++row) {
    auto* p = picture.ptr<cv::Vec3b>(row);
    const auto* a = alpha.ptr<std::uint8_t>(row);
    for (int column = 0; column < picture.cols; ++column) {
      const int weight = a[column];
      if (weight == 0) continue;
      for (int channel = 0; channel < 3; ++channel)
        p[column][channel] = static_cast<std::uint8_t>(
            (weight * ink[channel] + (255 - weight) * p[column][channel] + 127) / 255);
    }
  }
}

struct TextMask {
  cv::Mat alpha;       // CV_8UC1
  cv::Point baseline;  // of the left end of the base line inside the mask
};

// The font knows ASCII alone: accented Latin letters lose their accents, any other character
// becomes one question mark.
std::string plain_letters(const std::string& text) {
  // U+00C0 to U+017F
  static constexpr std::string_view kBase =
      "AAAAAAACEEEEIIIIDNOOOOOxOUUUUYTsaaaaaaaceeeeiiiidnooooo:ouuuuyty"
      "AaAaAaCcCcCcCcDdDdEeEeEeEeEeGgGgGgGgHhHhIiIiIiIiIiIiJjKkkLlLlLlL"
      "lLlNnNnNnnNnOoOoOoOoRrRrRrSsSsSsSsTtTtTtUuUuUuUuUuUuWwYyYZzZzZzs";
  std::string plain;
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const int more = byte < 0xC0 ? 0 : byte < 0xE0 ? 1 : byte < 0xF0 ? 2 : 3;
    unsigned code = more == 0 ? byte : byte & (0x3FU >> more);
    std::size_t next = i + 1;
    for (; next < text.size() && next <= i + static_cast<std::size_t>(more); ++next)
      code = code << 6U | (static_cast<unsigned char>(text[next]) & 0x3FU);
    i = next;
    plain += code < 0x80                                  ? static_cast<char>(code)
             : code >= 0xC0 && code < 0xC0 + kBase.size() ? kBase[code - 0xC0]
                                                          : '?';
  }
  return plain;
}

// Drawn kSupersample times larger and averaged down; `shift_*` is the sub-pixel part of the place.
TextMask text_mask(const std::string& words, double height_px, double shift_x, double shift_y) {
  const std::string text = plain_letters(words);
  const double scale = kSupersample * height_px / kCapitalAtScaleOne;
  const int thickness = std::max(1, static_cast<int>(std::lround(0.14 * kSupersample * height_px)));
  int below = 0;
  const cv::Size size = cv::getTextSize(text, kFont, scale, thickness, &below);
  const auto in_pixels = [](int large) { return (large + kSupersample - 1) / kSupersample; };
  const int margin = 2 + in_pixels(thickness);
  const cv::Point baseline(margin, margin + in_pixels(size.height));
  cv::Mat large = cv::Mat::zeros((baseline.y + in_pixels(below) + margin) * kSupersample,
                                 (in_pixels(size.width) + 2 * margin) * kSupersample, CV_8UC1);
  const cv::Point at(baseline.x * kSupersample + static_cast<int>(shift_x * kSupersample),
                     baseline.y * kSupersample + static_cast<int>(shift_y * kSupersample));
  cv::putText(large, text, at, kFont, scale, cv::Scalar(255), thickness, cv::LINE_AA);
  TextMask mask{.alpha = {}, .baseline = baseline};
  cv::resize(large, mask.alpha, {}, 1.0 / kSupersample, 1.0 / kSupersample, cv::INTER_AREA);
  return mask;
}

void put(cv::Mat& picture, const cv::Mat& alpha, const cv::Point& corner,
         const cv::Scalar& colour) {
  const cv::Rect inside = cv::Rect(corner, alpha.size()) & cv::Rect({0, 0}, picture.size());
  if (!inside.empty()) blend(picture(inside), alpha(inside - corner), colour);
}

void text_at(cv::Mat& picture, const std::string& text, cv::Point2d at, double height_px,
             const cv::Scalar& colour, Align align, bool halo) {
  if (text.empty()) return;
  const double width = text_width_px(text, height_px);
  if (align == Align::centre) at.x -= 0.5 * width;
  if (align == Align::right) at.x -= width;
  const cv::Point whole(cvFloor(at.x), cvFloor(at.y));
  const TextMask mask = text_mask(text, height_px, at.x - whole.x, at.y - whole.y);
  const cv::Point corner = whole - mask.baseline;
  if (halo) {
    cv::Mat dark;
    cv::dilate(mask.alpha, dark, cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3}));
    put(picture, dark * 0.75, corner, palette::black);
  }
  put(picture, mask.alpha, corner, colour);
}

}  // namespace

Ink::Ink(cv::Size size)
    : coverage_(cv::Mat::zeros(size, CV_8UC1)), halo_(cv::Mat::zeros(size, CV_8UC1)) {}

void Ink::touch(const Eigen::Vector2d& point, double reach_px) {
  const cv::Rect around(
      cv::Point(cvFloor(point.x() - reach_px), cvFloor(point.y() - reach_px)),
      cv::Point(cvCeil(point.x() + reach_px) + 1, cvCeil(point.y() + reach_px) + 1));
  const cv::Rect inside = around & cv::Rect({0, 0}, coverage_.size());
  touched_ = touched_.empty() ? inside : inside.empty() ? touched_ : touched_ | inside;
}

void Ink::line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const Stroke& stroke,
               double alpha) {
  if (!from.allFinite() || !to.allFinite()) return;
  cv::line(coverage_, fixed(from), fixed(to), level(alpha), stroke.width_px, cv::LINE_AA, kShift);
  if (stroke.halo_px > 0)
    cv::line(halo_, fixed(from), fixed(to), level(alpha * stroke.halo_alpha),
             stroke.width_px + 2 * stroke.halo_px, cv::LINE_AA, kShift);
  const double reach = stroke.width_px + 2.0 * stroke.halo_px + 2.0;
  touch(from, reach);
  touch(to, reach);
}

void Ink::polyline(std::span<const Eigen::Vector2d> points, const Stroke& stroke, double alpha) {
  for (std::size_t i = 1; i < points.size(); ++i) line(points[i - 1], points[i], stroke, alpha);
}

void Ink::dashes(std::span<const Eigen::Vector2d> points, const Stroke& stroke, double alpha,
                 double dash_px, double gap_px) {
  const double period = dash_px + gap_px;
  double walked = 0.0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Eigen::Vector2d step = points[i] - points[i - 1];
    const double length = step.norm();
    if (!std::isfinite(length) || length == 0.0) continue;
    double done = 0.0;
    while (done < length) {
      const double phase = std::fmod(walked, period);
      const bool on = phase < dash_px;
      const double piece = std::min(length - done, std::max(1e-3, (on ? dash_px : period) - phase));
      if (on)
        line(points[i - 1] + step * (done / length),
             points[i - 1] + step * ((done + piece) / length), stroke, alpha);
      done += piece;
      walked += piece;
    }
  }
}

void Ink::dot(const Eigen::Vector2d& centre, double radius_px, const Stroke& stroke, double alpha) {
  if (!centre.allFinite()) return;
  const auto radius = [](double px) { return static_cast<int>(std::lround(px * (1 << kShift))); };
  cv::circle(coverage_, fixed(centre), radius(radius_px), level(alpha), cv::FILLED, cv::LINE_AA,
             kShift);
  if (stroke.halo_px > 0)
    cv::circle(halo_, fixed(centre), radius(radius_px + stroke.halo_px),
               level(alpha * stroke.halo_alpha), cv::FILLED, cv::LINE_AA, kShift);
  touch(centre, radius_px + stroke.halo_px + 2.0);
}

void Ink::ring(const Eigen::Vector2d& centre, double radius_px, const Stroke& stroke,
               double alpha) {
  if (!centre.allFinite()) return;
  const int radius = static_cast<int>(std::lround(radius_px * (1 << kShift)));
  cv::circle(coverage_, fixed(centre), radius, level(alpha), stroke.width_px, cv::LINE_AA, kShift);
  if (stroke.halo_px > 0)
    cv::circle(halo_, fixed(centre), radius, level(alpha * stroke.halo_alpha),
               stroke.width_px + 2 * stroke.halo_px, cv::LINE_AA, kShift);
  touch(centre, radius_px + stroke.width_px + stroke.halo_px + 2.0);
}

void Ink::lay_on(cv::Mat& picture, const Stroke& stroke) const {
  if (touched_.empty()) return;
  if (stroke.halo_px > 0) blend(picture(touched_), halo_(touched_), palette::black);
  blend(picture(touched_), coverage_(touched_), stroke.colour);
}

void Ink::clear() {
  if (touched_.empty()) return;
  coverage_(touched_).setTo(0);
  halo_(touched_).setTo(0);
  touched_ = {};
}

void draw_text(cv::Mat& picture, const std::string& text, const cv::Point2d& at, double height_px,
               const cv::Scalar& colour, Align align) {
  text_at(picture, text, at, height_px, colour, align, false);
}

void draw_text_with_halo(cv::Mat& picture, const std::string& text, const cv::Point2d& at,
                         double height_px, const cv::Scalar& colour, Align align) {
  text_at(picture, text, at, height_px, colour, align, true);
}

double text_width_px(const std::string& text, double height_px) {
  int baseline = 0;
  const double scale = kSupersample * height_px / kCapitalAtScaleOne;
  return static_cast<double>(
             cv::getTextSize(plain_letters(text), kFont, scale, 1, &baseline).width) /
         kSupersample;
}

}  // namespace trochoid::tools
