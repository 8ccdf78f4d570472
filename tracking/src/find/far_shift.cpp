#include "find/far_shift.hpp"

#include <opencv2/imgproc.hpp>

namespace trochoid::tracking {
namespace {

constexpr double kCoarser = 2.0;

/// Half as large, without what changes slowly: light, shadows.
cv::Mat pattern_of(const cv::Mat& part) {
  constexpr int kAround = 11;
  cv::Mat reduced, around;
  cv::resize(part, reduced, {}, 1.0 / kCoarser, 1.0 / kCoarser, cv::INTER_AREA);
  reduced.convertTo(reduced, CV_32F);
  cv::blur(reduced, around, {kAround, kAround});
  return reduced - around;
}

}  // namespace

FarShift::FarShift(const cv::Mat& part) : pattern_(pattern_of(part)) {
  cv::createHanningWindow(window_, pattern_.size(), CV_32F);
}

Eigen::Vector2d FarShift::by_phases(const cv::Mat& part) const {
  const cv::Point2d gone = cv::phaseCorrelate(pattern_, pattern_of(part), window_);
  return kCoarser * Eigen::Vector2d(gone.x, gone.y);
}

Eigen::Vector2d FarShift::by_likeness(const cv::Mat& part) const {
  const cv::Point reach(pattern_.cols / 5, pattern_.rows / 5);
  const cv::Mat middle = pattern_(cv::Rect(reach, cv::Point(pattern_.size()) - reach));
  cv::Mat likeness;
  cv::matchTemplate(pattern_of(part), middle, likeness, cv::TM_CCOEFF_NORMED);
  cv::Point best;
  cv::minMaxLoc(likeness, nullptr, nullptr, nullptr, &best);
  return kCoarser * Eigen::Vector2d(best.x - reach.x, best.y - reach.y);
}

}  // namespace trochoid::tracking
