#include "draw/svg.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <regex>

#include "draw/round_lengths.hpp"

namespace trochoid::tools {
namespace {

std::vector<double> ticks_of(const Range& range, bool logarithmic) {
  std::vector<double> ticks;
  if (logarithmic) {
    const int first = static_cast<int>(std::ceil(range.low - 1e-9));
    const int last = static_cast<int>(std::floor(range.high + 1e-9));
    const int stride = std::max(1, (last - first + 5) / 6);
    for (int decade = first; decade <= last; decade += stride) ticks.push_back(decade);
    return ticks;
  }
  const double step = round_step(range.span(), 6);
  for (double k = std::ceil(range.low / step); k * step <= range.high; ++k)
    ticks.push_back(k == 0.0 ? 0.0 : k * step);
  return ticks;
}

/// @param digits  as many as tell the ticks of the axis apart.
std::string tick_words(double tick, bool logarithmic, int digits) {
  return logarithmic ? fmt::format("10<tspan dy=\"-5\" font-size=\"9\">{:.0f}</tspan>", tick)
                     : fmt::format("{:.{}g}", tick, digits);
}

int digits_of(const std::vector<double>& ticks) {
  constexpr int kUsual = 6;
  if (ticks.size() < 2) return kUsual;
  const double largest = std::max(std::abs(ticks.front()), std::abs(ticks.back()));
  const double parts = largest / (ticks[1] - ticks[0]);
  return std::max(kUsual, 1 + static_cast<int>(std::ceil(std::log10(parts))));
}

/// Room around the data. Values that differ by rounding alone, as the places of a disc on a pin do,
/// are one value: ticks between them would have no end.
Range with_margin(const Range& data) {
  constexpr double kShare = 0.04, kOfOneValue = 0.5, kRounding = 1e-6;
  const double rounding = kRounding * std::max(std::abs(data.low), std::abs(data.high));
  const double margin =
      data.span() > rounding ? kShare * data.span() : std::max(kOfOneValue, rounding);
  return {data.low - margin, data.high + margin};
}

}  // namespace

void Range::include(double value) {
  if (!std::isfinite(value)) return;
  low = std::min(low, value);
  high = std::max(high, value);
}

Range Range::empty() {
  return {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
}

SvgPlot::SvgPlot(std::string id, Range x, Range y, AxisWords words, Scale scale, double width,
                 double height)
    : id_(std::move(id)), x_(x), y_(y), scale_(scale), width_(width), height_(height) {
  for (Range* range : {&x_, &y_}) {
    if (!(range->low <= range->high)) *range = {0.0, 1.0};
    *range = with_margin(*range);
  }
  if (scale_ == Scale::equal) {
    const double inner_width = width_ - left_ - right_, inner_height = height_ - top_ - bottom_;
    const double per_px = std::max(x_.span() / inner_width, y_.span() / inner_height);
    const double more_x = 0.5 * (per_px * inner_width - x_.span());
    const double more_y = 0.5 * (per_px * inner_height - y_.span());
    x_ = {x_.low - more_x, x_.high + more_x};
    y_ = {y_.low - more_y, y_.high + more_y};
  }
  axes(words);
}

double SvgPlot::px_x(double x) const {
  return left_ + (width_ - left_ - right_) * (x - x_.low) / x_.span();
}

double SvgPlot::px_y(double y) const {
  return height_ - bottom_ - (height_ - top_ - bottom_) * (y - y_.low) / y_.span();
}

void SvgPlot::axes(const AxisWords& words) {
  const bool logarithmic = scale_ == Scale::logarithmic;
  const double base = height_ - bottom_;
  const std::vector<double> across = ticks_of(x_, logarithmic), up = ticks_of(y_, logarithmic);
  for (const double tick : across) {
    const double x = px_x(tick);
    frame_ += fmt::format(
        "<line x1=\"{0:.2f}\" y1=\"{1:.2f}\" x2=\"{0:.2f}\" y2=\"{2:.2f}\" stroke=\"{3}\" "
        "stroke-width=\"0.5\"/>",
        x, top_, base, ink::faint);
    frame_ += fmt::format("<text x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"middle\">{}</text>", x,
                          base + 16.0, tick_words(tick, logarithmic, digits_of(across)));
  }
  for (const double tick : up) {
    const double y = px_y(tick);
    frame_ += fmt::format(
        "<line x1=\"{0:.2f}\" y1=\"{1:.2f}\" x2=\"{2:.2f}\" y2=\"{1:.2f}\" stroke=\"{3}\" "
        "stroke-width=\"0.5\"/>",
        left_, y, width_ - right_, ink::faint);
    frame_ += fmt::format("<text x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"end\">{}</text>",
                          left_ - 6.0, y + 4.0, tick_words(tick, logarithmic, digits_of(up)));
  }
  frame_ += fmt::format("<text x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"middle\">{}</text>",
                        0.5 * (left_ + width_ - right_), height_ - 6.0, escaped(words.x));
  frame_ += fmt::format(
      "<text transform=\"translate(13,{:.2f}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
      0.5 * (top_ + base), escaped(words.y));
}

void SvgPlot::line(std::span<const Eigen::Vector2d> points, const char* colour, double width,
                   const std::string& dash) {
  std::string path;
  bool pen_down = false;
  for (const Eigen::Vector2d& point : points) {
    if (!point.allFinite()) {
      pen_down = false;
      continue;
    }
    path += fmt::format("{}{:.2f} {:.2f}", pen_down ? "L" : "M", px_x(point.x()), px_y(point.y()));
    pen_down = true;
  }
  body_ += fmt::format(
      "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" "
      "stroke-linejoin=\"round\"{}/>",
      path, colour, width, dash.empty() ? "" : fmt::format(" stroke-dasharray=\"{}\"", dash));
}

void SvgPlot::dots(std::span<const Eigen::Vector2d> points, const char* colour, double radius) {
  // Lines of no length with round ends: a third of the bytes of as many circles.
  std::string path;
  for (const Eigen::Vector2d& point : points)
    if (point.allFinite())
      path += fmt::format("M{:.2f} {:.2f}h0", px_x(point.x()), px_y(point.y()));
  body_ += fmt::format(
      "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linecap=\"round\"/>",
      path, colour, 2.0 * radius);
}

void SvgPlot::bar(Range x, Range y, const char* colour) {
  body_ += fmt::format(
      "<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"{}\"/>",
      px_x(x.low), px_y(y.high), px_x(x.high) - px_x(x.low), px_y(y.low) - px_y(y.high), colour);
}

void SvgPlot::words(const Eigen::Vector2d& at, const std::string& text, const char* colour) {
  constexpr double kOff_px = 7.0, kLetter_px = 8.0;
  const bool fits =
      px_x(at.x()) + kOff_px + kLetter_px * static_cast<double>(text.size()) < width_ - right_;
  body_ += fmt::format(
      "<text x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"{}\" fill=\"{}\" stroke=\"{}\" "
      "stroke-width=\"4\" stroke-linejoin=\"round\" paint-order=\"stroke\">{}</text>",
      px_x(at.x()) + (fits ? kOff_px : -kOff_px), px_y(at.y()) - kOff_px, fits ? "start" : "end",
      colour, ink::paper, escaped(text));
}

void SvgPlot::key(const std::string& text, const char* colour, bool line) {
  const double y = top_ + 14.0 + 16.0 * key_count_++, x = width_ - right_ - 8.0;
  keys_ += fmt::format(
      "<text class=\"key\" x=\"{:.2f}\" y=\"{:.2f}\" text-anchor=\"end\" stroke=\"{}\" "
      "stroke-width=\"3\" paint-order=\"stroke\">{}</text>",
      x - 26.0, y, ink::paper, escaped(text));
  keys_ += fmt::format(
      "<path d=\"M{:.2f} {:.2f}h{}\" stroke=\"{}\" stroke-width=\"{}\" stroke-linecap=\"round\"/>",
      line ? x - 20.0 : x - 10.0, y - 4.0, line ? 20 : 0, colour, line ? 2 : 5);
}

void SvgPlot::cursor(const std::string& name, const char* colour) {
  body_ += fmt::format(
      "<circle id=\"{}-cursor-{}\" r=\"5\" fill=\"none\" stroke=\"{}\" stroke-width=\"2.5\" "
      "visibility=\"hidden\"/>",
      id_, name, colour);
}

std::string SvgPlot::text() const {
  // x_px = x0 + kx x and y_px = y0 + ky y, for scripts that place the cursor.
  const double kx = (width_ - left_ - right_) / x_.span(),
               ky = -(height_ - top_ - bottom_) / y_.span();
  return fmt::format(
      "<svg id=\"{0}\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {1:g} {2:g}\" "
      "role=\"img\" "
      "data-x0=\"{3:.9g}\" data-kx=\"{4:.9g}\" data-y0=\"{5:.9g}\" data-ky=\"{6:.9g}\" "
      "font-family=\"system-ui,sans-serif\" font-size=\"12\" fill=\"{7}\">"
      "<rect width=\"100%\" height=\"100%\" fill=\"{8}\"/>"
      "<clipPath id=\"{0}-clip\"><rect x=\"{9:g}\" y=\"{10:g}\" width=\"{11:g}\" "
      "height=\"{12:g}\"/></clipPath>"
      "{13}<g clip-path=\"url(#{0}-clip)\">{14}</g>"
      "<rect x=\"{9:g}\" y=\"{10:g}\" width=\"{11:g}\" height=\"{12:g}\" fill=\"none\" "
      "stroke=\"{7}\"/>{15}</svg>\n",
      id_, width_, height_, px_x(0.0), kx, px_y(0.0), ky, ink::words, ink::paper, left_, top_,
      width_ - left_ - right_, height_ - top_ - bottom_, frame_, body_, keys_);
}

std::string standalone(const std::string& svg) {
  static const std::regex variable("var\\(--[a-z]+,(#[0-9a-f]+)\\)");
  return std::regex_replace(svg, variable, "$1");
}

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) switch (c) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '"':
        safe += "&quot;";
        break;
      case '\'':
        safe += "&#39;";
        break;
      default:
        safe += c;
    }
  return safe;
}

}  // namespace trochoid::tools
