#include "find/quantiles.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

namespace trochoid::tracking {
namespace {

constexpr int kSamples = Quantiles::kSamples;
using Row = std::vector<std::uint8_t>;

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

std::uint8_t tightest_half(const std::array<Row, kSamples>& sorted, std::size_t x) {
  int tightest = 255;
  for (std::size_t k = 0; k <= kSamples / 2; ++k)
    tightest = std::min(tightest, sorted[k + kSamples / 2 - 1][x] - sorted[k][x]);
  return static_cast<std::uint8_t>(tightest);
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

}  // namespace

Quantiles Quantiles::of(const std::vector<cv::Mat>& samples) {
  const auto network = sorting_network();
  const int width = samples[0].cols, height = samples[0].rows;
  Quantiles q;
  for (cv::Mat* image : {&q.median, &q.spread, &q.half, &q.range})
    image->create(height, width, CV_8U);
  std::array<Row, kSamples> rows;
  rows.fill(Row(static_cast<std::size_t>(width)));
  for (int y = 0; y < height; ++y) {
    for (std::size_t k = 0; k < kSamples; ++k) {
      const std::uint8_t* in = samples[place_of(k, samples.size())].ptr(y);
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

// The quartile distance of a normal deviate is 1.35 sigma (here of 16: ranks 4 and 13, 1.4).
double Quantiles::noise_levels() const {
  return std::max(0.7, median_of(spread) / 1.4);
}

}  // namespace trochoid::tracking
