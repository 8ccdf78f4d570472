#include "find/uncover.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

namespace trochoid::tracking {
namespace {

cv::Mat disc_of(int width_px) {
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {width_px, width_px});
}

/// A mask without specks, its gaps closed and a margin added.
cv::Mat smoothed_mask(const cv::Mat& mask) {
  const cv::Mat disc = disc_of(5);
  cv::Mat smooth;
  cv::morphologyEx(mask, smooth, cv::MORPH_OPEN, cv::Mat::ones(2, 2, CV_8U));
  cv::morphologyEx(smooth, smooth, cv::MORPH_CLOSE, disc, {-1, -1}, 3);
  cv::dilate(smooth, smooth, disc, {-1, -1}, 2);
  return smooth;
}

/// Smooth estimate of the static scene from pixels that never changed, and how much those scatter
/// about it (texture), at reduced size.
struct StaticSurroundings {
  static constexpr int kFactor = 2;
  cv::Mat level, scatter;  ///< CV_32F; level < 0 where nothing static is near

  /// What the surroundings let expect of a pixel of full size, and what it may differ by.
  struct Expected {
    double level, tolerance;
    [[nodiscard]] bool explains(double value) const { return std::abs(value - level) <= tolerance; }
  };
  [[nodiscard]] std::optional<Expected> at(int x, int y, double noise) const {
    const int sy = std::min(y / kFactor, level.rows - 1);
    const int sx = std::min(x / kFactor, level.cols - 1);
    const double here = level.at<float>(sy, sx);
    if (here < 0.0) return std::nullopt;
    return Expected{here, 5.0 + 2.5 * (noise + scatter.at<float>(sy, sx))};
  }

  static StaticSurroundings of(const cv::Mat& plate, const cv::Mat& active) {
    const cv::Size size((plate.cols + 1) / kFactor, (plate.rows + 1) / kFactor);
    cv::Mat value, hidden, weight;
    cv::resize(plate, value, size, 0, 0, cv::INTER_AREA);
    // A reduced pixel counts only if all of it was static, a margin for blur and shadow included.
    cv::Mat wide;
    cv::dilate(active, wide, disc_of(5));
    cv::resize(wide, hidden, size, 0, 0, cv::INTER_AREA);
    cv::threshold(hidden, hidden, 0, 1, cv::THRESH_BINARY_INV);
    hidden.convertTo(weight, CV_32F);
    value.convertTo(value, CV_32F);
    const cv::Mat first = value.mul(weight), second = first.mul(value);
    StaticSurroundings s;
    s.level = cv::Mat(size, CV_32F, cv::Scalar(-1.0));
    s.scatter = cv::Mat::zeros(size, CV_32F);
    // Normalised smoothing at growing width, narrowest first that sees enough.
    for (int width = 9; width < 2 * std::max(size.width, size.height); width = 2 * width + 1) {
      cv::Mat sum, square, count;
      cv::blur(first, sum, {width, width});
      cv::blur(second, square, {width, width});
      cv::blur(weight, count, {width, width});
      bool all = true;
      for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
          float& level = s.level.at<float>(y, x);
          if (level >= 0.0F) continue;
          const float n = count.at<float>(y, x);
          if (n < 0.15F) {
            all = false;
            continue;
          }
          level = sum.at<float>(y, x) / n;
          s.scatter.at<float>(y, x) =
              std::sqrt(std::max(0.0F, square.at<float>(y, x) / n - level * level));
        }
      if (all) break;
    }
    return s;
  }
};

/// Mean of the samples that the surroundings would explain; nothing if there is none.
std::optional<double> floor_like(const std::array<int, Quantiles::kSamples>& levels,
                                 const StaticSurroundings::Expected& expected) {
  double sum = 0.0;
  int count = 0;
  for (const int v : levels)
    if (expected.explains(v)) sum += v, ++count;
  if (count == 0) return std::nullopt;
  return sum / count;
}

using Outlines = std::vector<std::vector<cv::Point>>;

Outlines outlines_of(const cv::Mat& mask) {
  Outlines outlines;
  cv::findContours(mask, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_SIMPLE);
  return outlines;
}

cv::Mat filled(const Outlines& outlines, const cv::Size& size) {
  cv::Mat mask = cv::Mat::zeros(size, CV_8U);
  // Of outlines drawn together, those that overlap would cancel each other.
  for (int i = 0; i < static_cast<int>(outlines.size()); ++i)
    cv::drawContours(mask, outlines, i, 255, cv::FILLED);
  return mask;
}

/// Places in the middle of what changed often, which need not go all the way round them.
cv::Mat middle_of(const Changes& changes) {
  constexpr int kSliver_px = 7;
  const cv::Mat often = smoothed_mask(changes.often);
  Outlines around = outlines_of(often);
  for (std::vector<cv::Point>& one : around) {
    std::vector<cv::Point> hull;
    cv::convexHull(one, hull);
    one = std::move(hull);
  }
  const cv::Size size = often.size();
  cv::Mat middle = filled(around, size) & filled(outlines_of(changes.ever), size) & ~often;
  cv::morphologyEx(middle, middle, cv::MORPH_OPEN, disc_of(kSliver_px));
  return middle;
}

/// Of such places, with a margin, those that a body never leaves: it covers what is right beside
/// them most of the time. What a body goes round, or a ring's hole, is bare most of the time.
cv::Mat never_left(const cv::Mat& middle, const cv::Mat& plane, const StaticSurroundings& around,
                   double noise) {
  constexpr int kMargin_px = 15;  // more than smoothed_mask() adds to what changed
  const cv::Rect picture({}, middle.size());
  cv::Mat labels, stats, centres, covered = cv::Mat::zeros(middle.size(), CV_8U);
  const int count = cv::connectedComponentsWithStats(middle, labels, stats, centres);
  for (int label = 1; label < count; ++label) {
    const int* of = stats.ptr<int>(label);
    const cv::Rect box =
        picture & cv::Rect(of[cv::CC_STAT_LEFT] - kMargin_px, of[cv::CC_STAT_TOP] - kMargin_px,
                           of[cv::CC_STAT_WIDTH] + 2 * kMargin_px,
                           of[cv::CC_STAT_HEIGHT] + 2 * kMargin_px);
    const cv::Mat own = labels(box) == label;
    cv::Mat wide;
    cv::dilate(own, wide, disc_of(kMargin_px));
    int beside = 0, unlike_floor = 0;
    for (int y = 0; y < box.height; ++y)
      for (int x = 0; x < box.width; ++x) {
        if (wide.at<std::uint8_t>(y, x) == 0 || own.at<std::uint8_t>(y, x) != 0) continue;
        const int at_x = box.x + x, at_y = box.y + y;
        const auto expected = around.at(at_x, at_y, noise);
        if (!expected) continue;
        ++beside;
        unlike_floor += !expected->explains(plane.at<std::uint8_t>(at_y, at_x));
      }
    if (2 * unlike_floor > beside) covered(box) |= wide;
  }
  return covered;
}

}  // namespace

Changes Changes::of(const Quantiles& quantiles, double noise, double least) {
  const double often = 8.0 + 4.0 * noise;
  return {above(quantiles.range, least), above(quantiles.spread, often),
          above(quantiles.half, often)};
}

Changes Changes::operator|(const Changes& other) const {
  return {ever | other.ever, often | other.often, always | other.always};
}

cv::Mat above(const cv::Mat& image, double threshold) {
  cv::Mat mask;
  cv::threshold(image, mask, threshold, 255, cv::THRESH_BINARY);
  return mask;
}

bool mostly_static(const cv::Mat& active) {
  constexpr double kMostStirred = 0.7;
  return cv::countNonZero(active) <= kMostStirred * static_cast<double>(active.total());
}

void uncover(cv::Mat& plane, const std::vector<cv::Mat>& samples, const Changes& changes,
             double noise) {
  if (cv::countNonZero(changes.ever) == 0 || !mostly_static(changes.ever)) return;
  cv::Mat middle = middle_of(changes);
  if (cv::countNonZero(middle) > 0)
    middle = never_left(middle, plane, StaticSurroundings::of(plane, changes.ever | middle), noise);
  const cv::Mat moved = changes.ever | middle;
  if (!mostly_static(moved)) return;
  const cv::Mat doubtful = smoothed_mask(changes.always) | middle;
  const StaticSurroundings around = StaticSurroundings::of(plane, moved);
  // The rim of what changed changed too, by less than counts.
  cv::Mat changed;
  cv::dilate(moved, changed, cv::Mat::ones(5, 5, CV_8U));
  std::array<int, Quantiles::kSamples> levels{};
  for (int y = 0; y < plane.rows; ++y)
    for (int x = 0; x < plane.cols; ++x) {
      if (changed.at<std::uint8_t>(y, x) == 0) continue;
      const auto expected = around.at(x, y, noise);
      std::uint8_t& plate = plane.at<std::uint8_t>(y, x);
      if (!expected || expected->explains(plate)) continue;
      for (std::size_t k = 0; k < Quantiles::kSamples; ++k)
        levels[k] = samples[Quantiles::place_of(k, samples.size())].at<std::uint8_t>(y, x);
      if (const auto floor = floor_like(levels, *expected))
        plate = cv::saturate_cast<std::uint8_t>(*floor);
      else if (doubtful.at<std::uint8_t>(y, x) != 0)
        plate = cv::saturate_cast<std::uint8_t>(expected->level);
    }
}

}  // namespace trochoid::tracking
