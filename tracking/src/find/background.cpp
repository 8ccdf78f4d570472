#include "find/background.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

constexpr int kGrid_px = 12;  // of the brightness comparison
constexpr int kSamples = Background::kSamples;
constexpr double kMostGain = 3.0;  // to either side: what differs more shows another scene, or none
constexpr double kMostStirred = 0.7;  // of the picture; beyond, nothing in it is known to be static
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
  return std::clamp<double>(*middle, 1.0 / kMostGain, kMostGain);
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

double median_of(const cv::Mat& image) {
  std::array<int, 256> count{};
  int total = 0;
  for (int y = 0; y < image.rows; y += 2)
    for (int x = 0; x < image.cols; x += 2) ++count[image.at<std::uint8_t>(y, x)], ++total;
  int seen = 0, level = 0;
  while (level < 255 && (seen += count[static_cast<std::size_t>(level)]) * 2 < total) ++level;
  return level;
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
std::optional<double> floor_like(const std::array<int, kSamples>& levels,
                                 const StaticSurroundings::Expected& expected) {
  double sum = 0.0;
  int count = 0;
  for (const int v : levels)
    if (expected.explains(v)) sum += v, ++count;
  if (count == 0) return std::nullopt;
  return sum / count;
}

// The quartile distance of a normal deviate is 1.35 sigma (here of 16: ranks 4 and 13, 1.4).
double noise_of(const Quantiles& q) {
  return std::max(0.7, median_of(q.spread) / 1.4);
}

cv::Mat above(const cv::Mat& image, double threshold) {
  cv::Mat mask;
  cv::threshold(image, mask, threshold, 255, cv::THRESH_BINARY);
  return mask;
}

/// Pixels that changed.
struct Changes {
  cv::Mat ever;    ///< in some sample
  cv::Mat often;   ///< in a quarter of the samples, and back
  cv::Mat always;  ///< so that no half of the samples agrees

  static Changes of(const Quantiles& q, double noise, double least) {
    const double often = 8.0 + 4.0 * noise;
    return {above(q.range, least), above(q.spread, often), above(q.half, often)};
  }
};

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

bool mostly_static(const cv::Mat& active) {
  return cv::countNonZero(active) <= kMostStirred * static_cast<double>(active.total());
}

/// Replaces, in one plane of the plate, what does not look like the static surroundings. A plain
/// body that wobbles in one place looks as still in the middle, which it never leaves, as a floor.
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
  std::array<int, kSamples> levels{};
  for (int y = 0; y < plane.rows; ++y)
    for (int x = 0; x < plane.cols; ++x) {
      if (changed.at<std::uint8_t>(y, x) == 0) continue;
      const auto expected = around.at(x, y, noise);
      std::uint8_t& plate = plane.at<std::uint8_t>(y, x);
      if (!expected || expected->explains(plate)) continue;
      for (std::size_t k = 0; k < kSamples; ++k)
        levels[k] = samples[k * samples.size() / kSamples].at<std::uint8_t>(y, x);
      if (const auto floor = floor_like(levels, *expected))
        plate = cv::saturate_cast<std::uint8_t>(*floor);
      else if (doubtful.at<std::uint8_t>(y, x) != 0)
        plate = cv::saturate_cast<std::uint8_t>(expected->level);
    }
}

/// Colours fade with the light towards the neutral 128.
void scale(const cv::Mat& from, cv::Mat to, double gain, double neutral) {
  if (std::abs(gain - 1.0) < 0.004)
    from.copyTo(to);
  else
    from.convertTo(to, CV_8U, gain, neutral * (1.0 - gain));
}

cv::Rect halved(const cv::Rect& box, const cv::Size& half) {
  const cv::Point from(box.x / 2, box.y / 2), to((box.br().x + 1) / 2, (box.br().y + 1) / 2);
  return cv::Rect(from, to) & cv::Rect({}, half);
}

/// An image at the brightness of the reference it has this gain over.
cv::Mat levelled(const cv::Mat& image, double gain) {
  // Below one percent the correction would only add rounding.
  if (std::abs(gain - 1.0) <= 0.01) return image;
  cv::Mat scaled;
  image.convertTo(scaled, CV_8U, 1.0 / gain);
  return scaled;
}

/// How much a pixel differs between two samples if it changed [levels].
double least_change(double noise) {
  return std::max(14.0, 7.0 * noise);
}

/// A hand that reaches across the picture changes all of it at one time or another, and then
/// nothing tells the floor from a body that hovers over one place. The samples closest to the
/// plate, as many as together leave most of the picture alone; all of them if those are few,
/// because then it is the camera that moves.
BackgroundSamples without_passers_by(const BackgroundSamples& samples, const Plate& plate) {
  constexpr double kMostChanged = 0.4, kFewest = 1.0 / 3.0;
  const std::size_t count = samples.luma.size();
  std::vector<std::pair<int, std::size_t>> by_change;
  std::vector<cv::Mat> changes(count);
  for (std::size_t k = 0; k < count; ++k) {
    const cv::Mat& image = samples.luma[k];
    cv::absdiff(levelled(image, median_ratio(image, plate.luma)), plate.luma, changes[k]);
    changes[k] = above(changes[k], least_change(plate.noise_levels));
    by_change.emplace_back(cv::countNonZero(changes[k]), k);
  }
  std::sort(by_change.begin(), by_change.end());
  cv::Mat changed = cv::Mat::zeros(plate.luma.size(), CV_8U);
  std::vector<std::size_t> calm;
  for (const auto& [pixels, k] : by_change) {
    cv::bitwise_or(changed, changes[k], changed);
    if (cv::countNonZero(changed) > kMostChanged * static_cast<double>(changed.total())) break;
    calm.push_back(k);
  }
  if (static_cast<double>(calm.size()) < kFewest * static_cast<double>(count)) return samples;
  std::sort(calm.begin(), calm.end());
  BackgroundSamples chosen;
  for (const std::size_t k : calm) {
    chosen.luma.push_back(samples.luma[k]);
    if (!samples.chroma.empty()) chosen.chroma.push_back(samples.chroma[k]);
  }
  return chosen;
}

/// Without those too dark or too bright to be brought to the brightness of the others: a clip may
/// begin black, or fade in.
BackgroundSamples of_usual_brightness(const BackgroundSamples& samples) {
  constexpr double kNothing = 3.0;  // levels that a picture of nothing, black or white, varies by
  std::vector<double> levels, shown;
  for (const cv::Mat& image : samples.luma) {
    cv::Scalar mean, deviation;
    cv::meanStdDev(image, mean, deviation);
    levels.push_back(std::max(1.0, mean[0]));
    if (deviation[0] > kNothing) shown.push_back(levels.back());
  }
  const double usual = data::median(shown.empty() ? levels : shown);
  BackgroundSamples chosen;
  for (std::size_t k = 0; k < levels.size(); ++k) {
    if (std::max(levels[k] / usual, usual / levels[k]) > kMostGain) continue;
    chosen.luma.push_back(samples.luma[k]);
    if (!samples.chroma.empty()) chosen.chroma.push_back(samples.chroma[k]);
  }
  return chosen.luma.empty() ? samples : chosen;
}

}  // namespace

Background Background::from_samples(const BackgroundSamples& all) {
  const BackgroundSamples samples = of_usual_brightness(all);
  Background background = estimated(samples);
  const auto total = static_cast<double>(background.active_.total());
  if (cv::countNonZero(background.active_) <= kMostStirred * total) return background;
  const BackgroundSamples calm = without_passers_by(samples, background.plate_);
  if (calm.luma.size() == samples.luma.size()) return background;
  const cv::Mat active = background.active_;
  background = estimated(calm);
  cv::bitwise_or(background.active_, active, background.active_);
  return background;
}

Background Background::estimated(const BackgroundSamples& samples) {
  const cv::Mat& reference = samples.luma[samples.luma.size() / 2];
  std::vector<cv::Mat> level;
  std::vector<double> gains;
  for (const cv::Mat& image : samples.luma) {
    gains.push_back(median_ratio(image, reference));
    level.push_back(levelled(image, gains.back()));
  }
  Background background;
  const Quantiles q = quantiles_of(level);
  Plate& plate = background.plate_;
  plate.luma = q.median;
  plate.noise_levels = noise_of(q);
  const Changes changes = Changes::of(q, plate.noise_levels, least_change(plate.noise_levels));
  background.active_ = changes.ever;
  background.restless_ = static_cast<double>(cv::countNonZero(changes.always)) /
                         static_cast<double>(changes.always.total());
  uncover(plate.luma, level, changes, plate.noise_levels);
  if (!samples.chroma.empty()) background.estimate_chroma(samples.chroma, gains);
  return background;
}

void Background::estimate_chroma(const std::vector<cv::Mat>& samples,
                                 const std::vector<double>& gains) {
  std::array<std::vector<cv::Mat>, 2> planes;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    cv::Mat levelled(samples[k].size(), samples[k].type());
    scale(samples[k], levelled, 1.0 / gains[k], 128.0);
    std::array<cv::Mat, 2> two;
    cv::split(levelled, two.data());
    for (std::size_t c = 0; c < 2; ++c) planes[c].push_back(two[c]);
  }
  const std::array<Quantiles, 2> q{quantiles_of(planes[0]), quantiles_of(planes[1])};
  const double noise = std::max(noise_of(q[0]), noise_of(q[1]));
  Changes changes;
  cv::resize(active_, changes.ever, samples[0].size(), 0, 0, cv::INTER_NEAREST);
  changes.often = changes.always = cv::Mat::zeros(samples[0].size(), CV_8U);
  for (const Quantiles& plane : q) {
    const Changes own = Changes::of(plane, noise, std::max(10.0, 7.0 * noise));
    changes = {changes.ever | own.ever, changes.often | own.often, changes.always | own.always};
  }
  std::array<cv::Mat, 2> estimate{q[0].median, q[1].median};
  for (std::size_t c = 0; c < 2; ++c) uncover(estimate[c], planes[c], changes, noise);
  cv::merge(estimate.data(), 2, plate_.chroma);
  plate_.chroma_noise_levels = noise;
  cv::Mat full;
  cv::resize(changes.ever, full, active_.size(), 0, 0, cv::INTER_NEAREST);
  cv::bitwise_or(active_, full, active_);
}

void Background::clear_of(const Ellipse& rim) {
  constexpr double kBlur_px = 2.0;  // the rim's own
  constexpr int kReach_px = 6;
  const auto covered = [&](const cv::Size& size, double scale, double wider_px) {
    const Eigen::Vector2f centre = (scale * rim.centre_px).cast<float>();
    const auto width = static_cast<float>(2.0 * scale * (rim.semi_major_px() + wider_px));
    const auto height = static_cast<float>(2.0 * scale * (rim.semi_minor_px() + wider_px));
    const auto angle_deg = static_cast<float>(data::degrees(rim.angle_rad()));
    cv::Mat mask = cv::Mat::zeros(size, CV_8U);
    cv::ellipse(mask, cv::RotatedRect({centre.x(), centre.y()}, {width, height}, angle_deg), 255,
                cv::FILLED);
    return mask;
  };
  const auto fill = [&](cv::Mat& plane, double scale) {
    const cv::Mat body = covered(plane.size(), scale, kBlur_px);
    const cv::Mat beside = covered(plane.size(), scale, kBlur_px + kReach_px) & ~body;
    plane = plane.clone();  // copies of the background keep theirs
    plane.setTo(cv::mean(plane, beside), body);
  };
  fill(plate_.luma, 1.0);
  if (!plate_.chroma.empty()) fill(plate_.chroma, 0.5);
}

bool Background::camera_moves() const {
  constexpr double kMostRestless = 0.15, kMostNoise = 8.0, kMostActive = 0.4;
  if (restless_ > kMostRestless) return true;
  return plate_.noise_levels > kMostNoise &&
         cv::countNonZero(active_) > kMostActive * static_cast<double>(active_.total());
}

double Background::gain(const cv::Mat& luma) const {
  return median_ratio(luma, plate_.luma);
}

void Background::scaled_into(Plate& plate, double gain, const cv::Rect& box) const {
  if (plate.luma.size() != plate_.luma.size()) {
    plate = plate_;
    plate.luma = plate_.luma.clone();
    plate.chroma = plate_.chroma.clone();
  }
  plate.noise_levels = plate_.noise_levels;
  plate.chroma_noise_levels = plate_.chroma_noise_levels;
  plate.chroma_site_px = plate_.chroma_site_px;
  scale(plate_.luma(box), plate.luma(box), gain, 0.0);
  if (plate_.chroma.empty()) return;
  const cv::Rect half = halved(box, plate_.chroma.size());
  scale(plate_.chroma(half), plate.chroma(half), gain, 128.0);
}

}  // namespace trochoid::tracking
