#include "background.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "silhouette.hpp"

namespace trochoid::tracking {
namespace {

constexpr int kGrid_px = 12;  // of the brightness comparison
constexpr int kSamples = Background::kSamples;
using Row = std::vector<std::uint8_t>;

double median_ratio(const cv::Mat& image, const cv::Mat& reference) {
  std::vector<float> ratios;
  ratios.reserve(static_cast<std::size_t>(image.rows / kGrid_px + 1) * (image.cols / kGrid_px + 1));
  for (int y = kGrid_px / 2; y < image.rows; y += kGrid_px)
    for (int x = kGrid_px / 2; x < image.cols; x += kGrid_px) {
      const int was = reference.at<std::uint8_t>(y, x), is = image.at<std::uint8_t>(y, x);
      if (was >= 24 && was <= 250 && is <= 250)
        ratios.push_back(static_cast<float>(is) / static_cast<float>(was));
    }
  if (ratios.size() < 20) return 1.0;  // too dark or too small to tell
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  return std::clamp<double>(*middle, 0.3, 3.0);
}

/// Comparators of Batcher's odd-even merge sort for 16 inputs: 63 min/max pairs on whole rows beat
/// sorting pixel by pixel by an order of magnitude.
std::vector<std::pair<int, int>> sorting_network() {
  std::vector<std::pair<int, int>> pairs;
  for (int p = 1; p < kSamples; p *= 2)
    for (int k = p; k >= 1; k /= 2)
      for (int j = k % p; j <= kSamples - 1 - k; j += 2 * k)
        for (int i = 0; i < std::min(k, kSamples - j - k); ++i)
          if ((i + j) / (2 * p) == (i + j + k) / (2 * p)) pairs.emplace_back(i + j, i + j + k);
  return pairs;
}

void exchange(std::uint8_t* a, std::uint8_t* b, int width) {
  for (int x = 0; x < width; ++x) {
    const std::uint8_t low = std::min(a[x], b[x]), high = std::max(a[x], b[x]);
    a[x] = low;
    b[x] = high;
  }
}

struct Quantiles {
  cv::Mat median;
  cv::Mat spread;  ///< between the quartiles
  cv::Mat half;    ///< of the half of the samples that agree best
  cv::Mat range;   ///< of all samples
};

std::uint8_t tightest_half(const std::array<Row, kSamples>& sorted, std::size_t x) {
  int tightest = 255;
  for (std::size_t k = 0; k <= kSamples / 2; ++k)
    tightest = std::min(tightest, sorted[k + kSamples / 2 - 1][x] - sorted[k][x]);
  return static_cast<std::uint8_t>(tightest);
}

Quantiles quantiles_of(const std::vector<cv::Mat>& samples) {
  const auto network = sorting_network();
  const int width = samples[0].cols, height = samples[0].rows;
  Quantiles q;
  for (cv::Mat* image : {&q.median, &q.spread, &q.half, &q.range})
    image->create(height, width, CV_8U);
  std::array<Row, kSamples> rows;
  rows.fill(Row(static_cast<std::size_t>(width)));
  for (int y = 0; y < height; ++y) {
    for (std::size_t k = 0; k < kSamples; ++k) {
      const std::uint8_t* in = samples[k * samples.size() / kSamples].ptr(y);
      std::copy(in, in + width, rows[k].begin());
    }
    for (const auto& [a, b] : network)
      exchange(rows[static_cast<std::size_t>(a)].data(), rows[static_cast<std::size_t>(b)].data(),
               width);
    std::uint8_t* median = q.median.ptr(y);
    std::uint8_t* spread = q.spread.ptr(y);
    std::uint8_t* half = q.half.ptr(y);
    std::uint8_t* range = q.range.ptr(y);
    for (std::size_t x = 0; x < static_cast<std::size_t>(width); ++x) {
      median[x] = static_cast<std::uint8_t>((rows[7][x] + rows[8][x] + 1) / 2);
      spread[x] = static_cast<std::uint8_t>(rows[12][x] - rows[3][x]);
      // Where even the quartiles agree the tighter half does too: most of the picture.
      half[x] = spread[x] < 8 ? spread[x] : tightest_half(rows, x);
      range[x] = static_cast<std::uint8_t>(rows[15][x] - rows[0][x]);
    }
  }
  return q;
}

double median_of(const cv::Mat& image) {
  std::array<int, 256> count{};
  int total = 0;
  for (int y = 0; y < image.rows; y += 2)
    for (int x = 0; x < image.cols; x += 2) ++count[image.at<std::uint8_t>(y, x)], ++total;
  int seen = 0, level = 0;
  while (level < 255 && (seen += count[static_cast<std::size_t>(level)]) * 2 < total) ++level;
  return level;
}

/// Mean step across the outline of a silhouette in an image [levels].
double outline_step(const cv::Mat& image, const Silhouette& body) {
  const auto& outline = body.outline_px;
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const cv::Point2f p = outline[i];
    const cv::Point2f along =
        outline[(i + 2) % outline.size()] - outline[(i + outline.size() - 2) % outline.size()];
    const float length = std::hypot(along.x, along.y);
    if (length < 0.5F) continue;
    const cv::Point2f n(along.y / length * 3.0F, -along.x / length * 3.0F);
    const cv::Point a(cvRound(p.x + n.x), cvRound(p.y + n.y)),
        b(cvRound(p.x - n.x), cvRound(p.y - n.y));
    const cv::Rect frame(0, 0, image.cols, image.rows);
    if (!frame.contains(a) || !frame.contains(b)) continue;
    sum += std::abs(image.at<std::uint8_t>(a) - image.at<std::uint8_t>(b));
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

}  // namespace

Background Background::from_samples(const std::vector<cv::Mat>& samples) {
  std::vector<cv::Mat> level = samples;
  const cv::Mat& reference = samples[samples.size() / 2];
  for (cv::Mat& image : level) {
    const double gain = median_ratio(image, reference);
    // Below one percent the correction would only add rounding.
    if (std::abs(gain - 1.0) > 0.01) {
      cv::Mat scaled;
      image.convertTo(scaled, CV_8U, 1.0 / gain);
      image = scaled;
    }
  }
  Background background;
  const Quantiles q = quantiles_of(level);
  background.plate_ = q.median;
  // The quartile distance of a normal deviate is 1.35 sigma (here of 16: ranks 4 and 13, 1.4).
  background.noise_ = std::max(0.7, median_of(q.spread) / 1.4);
  cv::threshold(q.range, background.active_, std::max(14.0, 7.0 * background.noise_), 255,
                cv::THRESH_BINARY);
  cv::Mat restless;
  cv::threshold(q.half, restless, 8.0 + 4.0 * background.noise_, 255, cv::THRESH_BINARY);
  background.restless_ =
      static_cast<double>(cv::countNonZero(restless)) / static_cast<double>(restless.total());
  background.remove_rested_bodies(level);
  background.fill_untrusted(restless);
  return background;
}

void Background::remove_rested_bodies(const std::vector<cv::Mat>& samples) {
  for (const cv::Mat& image : samples)
    for (const Silhouette& body : find_silhouettes(image, plate_, noise_)) {
      if (body.outline_px.size() < 12) continue;
      if (outline_step(plate_, body) < 1.5 * outline_step(image, body) + 4.0) continue;
      // The plate, not the sample, has the edge: the sample shows the floor that was hidden.
      cv::Mat mask = cv::Mat::zeros(image.size(), CV_8U);
      std::vector<cv::Point> polygon;
      for (const cv::Point2f& p : body.outline_px) polygon.emplace_back(cvRound(p.x), cvRound(p.y));
      cv::fillPoly(mask, std::vector<std::vector<cv::Point>>{polygon}, 255);
      cv::dilate(mask, mask, cv::getStructuringElement(cv::MORPH_ELLIPSE, {9, 9}));
      image.copyTo(plate_, mask);
    }
}

void Background::fill_untrusted(const cv::Mat& restless) {
  if (restless_ < 1e-5 || restless_ > 0.3) return;
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5});
  cv::Mat mask;
  cv::morphologyEx(restless, mask, cv::MORPH_OPEN, cv::Mat::ones(2, 2, CV_8U));
  cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, disc, {-1, -1}, 3);
  if (cv::countNonZero(mask) == 0) return;
  cv::dilate(mask, mask, disc, {-1, -1}, 2);
  // Normalised smoothing at growing width: every hidden pixel takes the mean of what is seen about
  // it.
  cv::Mat seen, value, weight;
  cv::threshold(mask, seen, 0, 1, cv::THRESH_BINARY_INV);
  seen.convertTo(weight, CV_32F);
  plate_.convertTo(value, CV_32F);
  value = value.mul(weight);
  cv::Mat open = mask.clone();
  for (int width = 9; width < std::max(plate_.rows, plate_.cols) && cv::countNonZero(open) > 0;
       width = 2 * width + 1) {
    cv::Mat smooth_value, smooth_weight;
    cv::blur(value, smooth_value, {width, width});
    cv::blur(weight, smooth_weight, {width, width});
    for (int y = 0; y < open.rows; ++y)
      for (int x = 0; x < open.cols; ++x) {
        if (open.at<std::uint8_t>(y, x) == 0 || smooth_weight.at<float>(y, x) < 0.15F) continue;
        plate_.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(
            smooth_value.at<float>(y, x) / smooth_weight.at<float>(y, x));
        open.at<std::uint8_t>(y, x) = 0;
      }
  }
}

double Background::gain(const cv::Mat& luma) const {
  return median_ratio(luma, plate_);
}

void Background::scaled_into(cv::Mat& image, double gain, const cv::Rect& box) const {
  if (image.size() != plate_.size()) image = plate_.clone();
  cv::Mat part = image(box);
  if (std::abs(gain - 1.0) < 0.004)
    plate_(box).copyTo(part);
  else
    plate_(box).convertTo(part, CV_8U, gain);
}

}  // namespace trochoid::tracking
