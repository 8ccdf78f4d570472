#include "silhouette.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace trochoid::tracking {
namespace {

/// Integer factor that brings the longer side to about 400 px, at least 1.
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
  for (const cv::Point& p : contour)
    body.outline_px.emplace_back(static_cast<float>(scale * p.x + shift + origin.x),
                                 static_cast<float>(scale * p.y + shift + origin.y));
  return body;
}

}  // namespace

std::vector<Silhouette> find_silhouettes(const cv::Mat& luma, const cv::Mat& background,
                                         double noise_levels, cv::Rect box) {
  const cv::Rect whole(0, 0, luma.cols, luma.rows);
  box = box.empty() ? whole : (box & whole);
  if (box.width < 4 || box.height < 4) return {};
  const int factor = reduction(luma.size());
  const cv::Mat now = reduced(luma(box), factor), plate = reduced(background(box), factor);
  cv::Mat difference, mask;
  cv::absdiff(now, plate, difference);
  // Averaging factor^2 pixels beats the noise down; compression and grain leave a floor.
  const double threshold = std::max(7.0, 4.5 * noise_levels / factor);
  cv::threshold(difference, mask, threshold, 255, cv::THRESH_BINARY);
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {3, 3});
  cv::morphologyEx(mask, mask, cv::MORPH_OPEN, cv::Mat::ones(2, 2, CV_8U));
  cv::morphologyEx(mask, mask, cv::MORPH_CLOSE, disc, {-1, -1}, 2);
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  std::vector<Silhouette> bodies;
  constexpr double kSmallest = 12.0;  // reduced pixels; below, compression noise
  for (const auto& contour : contours) {
    if (contour.size() < 8 || cv::contourArea(contour) < kSmallest) continue;
    Silhouette body = describe(contour, factor, box.tl(), luma.size());
    if (body.detection.area_px2 > 0.0) bodies.push_back(std::move(body));
  }
  std::sort(bodies.begin(), bodies.end(), [](const Silhouette& a, const Silhouette& b) {
    return a.detection.area_px2 > b.detection.area_px2;
  });
  return bodies;
}

}  // namespace trochoid::tracking
