#include "find/background.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>

#include "find/quantiles.hpp"
#include "find/uncover.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

constexpr int kGrid_px = 12;       // of the brightness comparison
constexpr double kMostGain = 3.0;  // to either side: what differs more shows another scene, or none

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
  if (mostly_static(background.active_)) return background;
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
  const Quantiles q = Quantiles::of(level);
  Plate& plate = background.plate_;
  plate.luma = q.median;
  plate.noise_levels = q.noise_levels();
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
  const std::array<Quantiles, 2> q{Quantiles::of(planes[0]), Quantiles::of(planes[1])};
  const double noise = std::max(q[0].noise_levels(), q[1].noise_levels());
  Changes changes;
  cv::resize(active_, changes.ever, samples[0].size(), 0, 0, cv::INTER_NEAREST);
  changes.often = changes.always = cv::Mat::zeros(samples[0].size(), CV_8U);
  for (const Quantiles& plane : q)
    changes = changes | Changes::of(plane, noise, std::max(10.0, 7.0 * noise));
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
    // Pixel centres are whole numbers in planes of either size.
    const Eigen::Vector2f centre =
        (scale * rim.centre_px - Eigen::Vector2d::Constant(0.5 * (1.0 - scale))).cast<float>();
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
