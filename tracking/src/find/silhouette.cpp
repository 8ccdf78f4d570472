#include "find/silhouette.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "trochoid/data/angle.hpp"

namespace trochoid::tracking {
namespace {

/// Integer factor that brings the longer side to 320 px or as little more as it can, at least 1.
int reduction(const cv::Size& size) {
  return std::max(1, std::max(size.width, size.height) / 320);
}

cv::Mat reduced(const cv::Mat& image, int factor) {
  if (factor == 1) return image;
  cv::Mat small;
  cv::resize(image, small, {image.cols / factor, image.rows / factor}, 0, 0, cv::INTER_AREA);
  return small;
}

/// Ellipse with the second moments of the region inside a contour's convex hull: a ring counts as
/// its disc, a bitten silhouette as whole.
Silhouette describe(const std::vector<cv::Point>& contour, int factor, const cv::Point& origin,
                    const cv::Size& picture) {
  std::vector<cv::Point> hull;
  cv::convexHull(contour, hull);
  const cv::Moments m = cv::moments(hull);
  Silhouette body;
  if (m.m00 < 4.0) return body;
  const double xx = m.mu20 / m.m00, yy = m.mu02 / m.m00, xy = m.mu11 / m.m00;
  const double mean = 0.5 * (xx + yy), half = std::hypot(0.5 * (xx - yy), xy);
  const double scale = factor, shift = 0.5 * (factor - 1);
  Detection& d = body.detection;
  d.centre_px = {scale * m.m10 / m.m00 + shift + origin.x,
                 scale * m.m01 / m.m00 + shift + origin.y};
  // A uniform ellipse has second moments (semi-axis)^2 / 4; contour points are pixel centres, so
  // the region is half a pixel larger all round.
  d.semi_major_px = scale * (2.0 * std::sqrt(mean + half) + 0.5);
  d.semi_minor_px = scale * (2.0 * std::sqrt(std::max(0.0, mean - half)) + 0.5);
  d.angle_rad = 0.5 * std::atan2(2.0 * xy, xx - yy);
  const cv::Rect small = cv::boundingRect(contour);
  d.box = cv::Rect(small.x * factor + origin.x, small.y * factor + origin.y, small.width * factor,
                   small.height * factor);
  d.area_px2 = cv::contourArea(contour) * scale * scale;
  d.touches_border = d.box.x <= factor || d.box.y <= factor ||
                     d.box.br().x >= picture.width - factor ||
                     d.box.br().y >= picture.height - factor;
  body.solidity = cv::contourArea(contour) / m.m00;
  body.ellipticity = m.m00 / (4.0 * data::kPi * std::sqrt(std::max(1e-9, xx * yy - xy * xy)));
  return body;
}

const cv::Vec2b kGrey(128, 128);

/// What the searches work on: the reduced difference to the background.
struct Difference {
  cv::Rect box;
  int factor = 1;
  double threshold = 0.0;
  cv::Mat size, brighter;  ///< absolute, and where the picture is brighter
  cv::Mat colour;          ///< how far from the background's colour in any light; may be empty
  cv::Mat now, chroma;     ///< the reduced picture; chroma may be empty
};

/// Distance of the colour from that of the plate in whatever light falls on it, times `weight`: in
/// a shadow luma and chroma shrink together.
cv::Mat colour_off(const cv::Mat& luma, const cv::Mat& plate, const cv::Mat& chroma,
                   const cv::Mat& plate_chroma, double weight) {
  constexpr float kNeutral = 128.0F, kDarkest = 0.25F;
  cv::Mat off(luma.size(), CV_8U);
  for (int y = 0; y < off.rows; ++y) {
    const auto *is = luma.ptr<std::uint8_t>(y), *was = plate.ptr<std::uint8_t>(y);
    const auto *c = chroma.ptr<cv::Vec2b>(y), *p = plate_chroma.ptr<cv::Vec2b>(y);
    for (int x = 0; x < off.cols; ++x) {
      const float light = std::clamp(
          static_cast<float>(is[x]) / std::max(1.0F, static_cast<float>(was[x])), kDarkest, 1.0F);
      const auto from = [&](int plane) {
        return static_cast<float>(c[x][plane]) - kNeutral -
               light * (static_cast<float>(p[x][plane]) - kNeutral);
      };
      off.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(static_cast<float>(weight) *
                                                                   std::hypot(from(0), from(1)));
    }
  }
  return off;
}

bool difference_in(const Frame& frame, const Plate& background, cv::Rect box, Difference& d) {
  const cv::Rect whole(0, 0, frame.luma.cols, frame.luma.rows);
  d.box = box.empty() ? whole : (box & whole);
  // The chroma has every second pixel only.
  d.box = cv::Rect(cv::Point(d.box.x & ~1, d.box.y & ~1), d.box.br());
  if (d.box.width < 4 || d.box.height < 4) return false;
  d.factor = reduction(frame.luma.size());
  d.now = reduced(frame.luma(d.box), d.factor);
  const cv::Mat plate = reduced(background.luma(d.box), d.factor);
  cv::absdiff(d.now, plate, d.size);
  cv::subtract(d.now, plate, d.brighter);
  // Averaging factor^2 pixels beats the noise down; compression and grain leave a floor.
  d.threshold = std::max(7.0, 4.5 * background.noise_levels / d.factor);
  if (frame.chroma.empty()) return true;
  const cv::Rect half =
      cv::Rect(d.box.x / 2, d.box.y / 2, (d.box.width + 1) / 2, (d.box.height + 1) / 2) &
      cv::Rect({}, frame.chroma.size());
  const auto to_size = [&](const cv::Mat& chroma) {
    cv::Mat out;
    cv::resize(chroma(half), out, d.now.size(), 0, 0,
               d.factor > 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    return out;
  };
  d.chroma = to_size(frame.chroma);
  if (background.chroma.empty()) return true;
  const double colour_threshold = std::max(6.0, 5.0 * background.chroma_noise_levels);
  d.colour = colour_off(d.now, plate, d.chroma, to_size(background.chroma),
                        d.threshold / colour_threshold);
  d.size = cv::max(d.size, d.colour);
  return true;
}

using Polygon = std::vector<cv::Point>;

std::vector<Polygon> contours_above(const cv::Mat& difference, double threshold) {
  constexpr double kSmallest = 12.0;  // reduced pixels; below, compression noise
  cv::Mat mask;
  cv::threshold(difference, mask, threshold, 255, cv::THRESH_BINARY);
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3});
  cv::morphologyEx(mask, mask, cv::MORPH_OPEN, cv::Mat::ones(2, 2, CV_8U));
  cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, disc, {-1, -1}, 2);
  std::vector<Polygon> contours;
  cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  std::erase_if(contours,
                [](const Polygon& c) { return c.size() < 8 || cv::contourArea(c) < kSmallest; });
  return contours;
}

/// Otsu's threshold of the differences inside a contour; nothing if they do not fall into two.
std::optional<double> split_inside(const cv::Mat& difference, const Polygon& contour) {
  const cv::Rect box = cv::boundingRect(contour);
  cv::Mat inside = cv::Mat::zeros(box.size(), CV_8U);
  cv::fillPoly(inside, std::vector<Polygon>{contour}, 255, cv::LINE_8, 0, -box.tl());
  std::array<double, 256> count{};
  double total = 0.0, sum = 0.0, square = 0.0;
  for (int y = 0; y < box.height; ++y)
    for (int x = 0; x < box.width; ++x) {
      if (inside.at<std::uint8_t>(y, x) == 0) continue;
      const int level = difference.at<std::uint8_t>(box.y + y, box.x + x);
      count[static_cast<std::size_t>(level)] += 1.0;
      total += 1.0, sum += level, square += static_cast<double>(level) * level;
    }
  double below = 0.0, below_sum = 0.0, best = 0.0;
  int at = 0;
  for (int level = 0; level < 255; ++level) {
    below += count[static_cast<std::size_t>(level)];
    below_sum += level * count[static_cast<std::size_t>(level)];
    const double above = total - below;
    if (below <= 0.0 || above <= 0.0) continue;
    const double apart = below_sum / below - (sum - below_sum) / above;
    const double between = below * above * apart * apart / (total * total);
    if (between > best) best = between, at = level;
  }
  const double variance = square / total - sum * sum / (total * total);
  constexpr double kTwoClasses = 0.65;  // share of the variance a real split explains
  if (best < kTwoClasses * variance) return std::nullopt;
  return at;
}

/// The parts of a region that differ most, where its differences fall into two.
std::vector<Polygon> cores_of(const cv::Mat& difference, const Polygon& region) {
  const auto split = split_inside(difference, region);
  if (!split) return {};
  const cv::Rect part = cv::boundingRect(region);
  std::vector<Polygon> cores = contours_above(difference(part), *split);
  for (Polygon& core : cores)
    for (cv::Point& p : core) p += part.tl();
  return cores;
}

void largest_first(std::vector<Silhouette>& bodies) {
  std::sort(bodies.begin(), bodies.end(), [](const Silhouette& a, const Silhouette& b) {
    return a.detection.area_px2 > b.detection.area_px2;
  });
}

}  // namespace

std::vector<Silhouette> find_silhouettes(const Frame& frame, const Plate& background,
                                         cv::Rect box) {
  Difference d;
  std::vector<Silhouette> bodies;
  if (!difference_in(frame, background, box, d)) return bodies;
  for (const Polygon& contour : contours_above(d.size, d.threshold)) {
    Silhouette body = describe(contour, d.factor, d.box.tl(), frame.luma.size());
    if (body.detection.area_px2 > 0.0) bodies.push_back(std::move(body));
  }
  largest_first(bodies);
  return bodies;
}

std::vector<Silhouette> find_coloured_like(const Palette& body, double gain, const Frame& frame,
                                           const Plate& background, cv::Rect box) {
  Difference d;
  std::vector<Silhouette> bodies;
  if (!difference_in(frame, background, box, d)) return bodies;
  for (int y = 0; y < d.size.rows; ++y)
    for (int x = 0; x < d.size.cols; ++x) {
      const auto colour = d.chroma.empty() ? kGrey : d.chroma.at<cv::Vec2b>(y, x);
      if (!body.shows({d.now.at<std::uint8_t>(y, x), colour[0], colour[1]}, gain))
        d.size.at<std::uint8_t>(y, x) = 0;
    }
  const std::vector<Polygon> contours = contours_above(d.size, d.threshold);
  double largest = 0.0;
  for (const Polygon& contour : contours) largest = std::max(largest, cv::contourArea(contour));
  constexpr double kPart = 0.1;  // a speck elsewhere is none of the body
  Polygon together, hull;
  double area = 0.0;
  int parts = 0;
  for (const Polygon& contour : contours) {
    bodies.push_back(describe(contour, d.factor, d.box.tl(), frame.luma.size()));
    if (cv::contourArea(contour) < kPart * largest) continue;
    together.insert(together.end(), contour.begin(), contour.end());
    area += cv::contourArea(contour);
    ++parts;
  }
  if (parts > 1) {
    cv::convexHull(together, hull);
    Silhouette all = describe(hull, d.factor, d.box.tl(), frame.luma.size());
    all.solidity = area / cv::contourArea(hull);
    bodies.push_back(std::move(all));
  }
  std::erase_if(bodies, [](const Silhouette& b) { return b.detection.area_px2 <= 0.0; });
  largest_first(bodies);
  return bodies;
}

std::vector<Silhouette> find_bodies(const Frame& frame, const Plate& background, cv::Rect box) {
  Difference d;
  std::vector<Silhouette> bodies;
  if (!difference_in(frame, background, box, d)) return bodies;
  const auto add = [&](const Polygon& contour) {
    Silhouette body = describe(contour, d.factor, d.box.tl(), frame.luma.size());
    if (body.detection.area_px2 <= 0.0) return;
    const bool known = std::any_of(bodies.begin(), bodies.end(), [&](const Silhouette& other) {
      const Detection &a = other.detection, &b = body.detection;
      const double size = 0.04 * a.semi_major_px + 1.0;
      return (a.centre_px - b.centre_px).norm() < size &&
             std::abs(a.semi_major_px - b.semi_major_px) < size &&
             std::abs(a.semi_minor_px - b.semi_minor_px) < size;
    });
    if (!known) bodies.push_back(std::move(body));
  };
  for (const Polygon& contour : contours_above(d.size, d.threshold)) {
    add(contour);
    // Once takes the light parts of a shadow off, twice its dark ones.
    for (const Polygon& core : cores_of(d.size, contour)) {
      add(core);
      for (const Polygon& innermost : cores_of(d.size, core)) add(innermost);
    }
  }
  for (const Polygon& contour : contours_above(d.brighter, d.threshold)) add(contour);
  if (!d.colour.empty())
    for (const Polygon& contour : contours_above(d.colour, d.threshold)) add(contour);
  largest_first(bodies);
  return bodies;
}

}  // namespace trochoid::tracking
