#include "link/path_motion.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "trochoid/data/angle.hpp"

namespace trochoid::tracking {
namespace {

double spread(std::vector<double>& values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[values.size() * 95 / 100] - values[values.size() * 5 / 100];
}

double travel_px(const BodyPath& path) {
  std::vector<double> x, y;
  for (const auto& [index, at] : path.frames) {
    x.push_back(at.seen.centre_px.x());
    y.push_back(at.seen.centre_px.y());
  }
  return std::hypot(spread(x), spread(y));
}

}  // namespace

double travel_in_radii(const BodyPath& path) {
  return travel_px(path) / std::max(1.0, usual_radius_px(path));
}

Ellipse reach_of(const BodyPath& path) {
  assert(!path.frames.empty());
  Eigen::Vector2d middle_px = Eigen::Vector2d::Zero();
  for (const auto& [index, at] : path.frames) middle_px += at.seen.centre_px;
  middle_px /= static_cast<double>(path.frames.size());
  double radius_px = 0.0;
  for (const auto& [index, at] : path.frames)
    radius_px =
        std::max(radius_px, (at.seen.centre_px - middle_px).norm() + at.seen.rim.semi_major_px());
  return Ellipse::from_axes(middle_px, radius_px, radius_px, 0.0);
}

bool moves(const BodyPath& path) {
  constexpr double kTrembles_px = 0.7, kOfItsSize = 0.12, kTurns_rad = 0.3;
  if (path.frames.empty()) return false;
  if (path.frames.begin()->second.seen.pose) return true;
  std::vector<double> turned;
  for (const auto& [index, at] : path.frames)
    if (at.seen.turned_rad) turned.push_back(*at.seen.turned_rad);
  return (travel_px(path) > kTrembles_px && travel_in_radii(path) > kOfItsSize) ||
         spread(turned) > kTurns_rad;
}

int changes_explained(const BodyPath& path, const cv::Mat& changed) {
  cv::Mat swept = cv::Mat::zeros(changed.size(), CV_8U);
  for (const auto& [index, at] : path.frames) {
    const cv::Point centre(static_cast<int>(std::lround(at.seen.centre_px.x())),
                           static_cast<int>(std::lround(at.seen.centre_px.y())));
    cv::circle(swept, centre, static_cast<int>(std::ceil(at.seen.rim.semi_major_px())), 255,
               cv::FILLED);
  }
  return cv::countNonZero(swept & changed);
}

}  // namespace trochoid::tracking
