#include "study/tracking_baselines.hpp"

#include <fmt/core.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/background_segm.hpp>
#include <string>
#ifdef TROCHOID_HAS_OPENCV_TRACKING
#include <opencv2/tracking.hpp>
#endif

#include "trochoid/data/io.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tools {
namespace {

using Points = std::vector<cv::Point2d>;
/// Centres a method reports in one frame, in no order.
using Method = std::function<Points(const tracking::Frame& frame)>;

/// Centroids of the largest blobs of a mask.
Points blob_centroids(const cv::Mat& mask, std::size_t wanted) {
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  std::sort(contours.begin(), contours.end(),
            [](const auto& a, const auto& b) { return cv::contourArea(a) > cv::contourArea(b); });
  Points centres;
  for (std::size_t i = 0; i < std::min(wanted, contours.size()); ++i) {
    const cv::Moments m = cv::moments(contours[i]);
    if (m.m00 > 0.0) centres.emplace_back(m.m10 / m.m00, m.m01 / m.m00);
  }
  return centres;
}

Method background_subtraction(std::size_t wanted) {
  auto model = cv::createBackgroundSubtractorMOG2(500, 16.0, true);
  return [model, wanted](const tracking::Frame& frame) {
    cv::Mat mask;
    model->apply(frame.luma, mask);
    cv::threshold(mask, mask, 200, 255, cv::THRESH_BINARY);  // 127 marks shadows
    cv::morphologyEx(mask, mask, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
    return blob_centroids(mask, wanted);
  };
}

Method hough_circles(std::size_t wanted) {
  return [wanted](const tracking::Frame& frame) {
    std::vector<cv::Vec3f> circles;
    cv::HoughCircles(frame.luma, circles, cv::HOUGH_GRADIENT, 1.5, 20.0, 100.0, 30.0);
    Points centres;
    for (std::size_t i = 0; i < std::min(wanted, circles.size()); ++i)
      centres.emplace_back(circles[i][0], circles[i][1]);
    return centres;
  };
}

Method otsu_threshold(std::size_t wanted) {
  return [wanted](const tracking::Frame& frame) {
    cv::Mat mask;
    cv::threshold(frame.luma, mask, 0, 255, cv::THRESH_BINARY | cv::THRESH_OTSU);
    // The body is the minority.
    if (2 * cv::countNonZero(mask) > static_cast<int>(mask.total())) mask = ~mask;
    return blob_centroids(mask, wanted);
  };
}

/// Where a body truly is, by frame.
using Places = std::map<std::int64_t, cv::Point2d>;

Places places_of(const std::filesystem::path& file) {
  const data::Table table = data::read_table(file);
  const Eigen::VectorXd frame = table.column("frame"), x = table.column("x_px"),
                        y = table.column("y_px");
  Places places;
  for (Eigen::Index i = 0; i < frame.size(); ++i) places[std::llround(frame[i])] = {x[i], y[i]};
  return places;
}

#ifdef TROCHOID_HAS_OPENCV_TRACKING
/// A correlation filter for each body, started on a box about its true place: a gift too.
Method correlation_filters(const std::vector<Places>& bodies, double size_px) {
  struct Follower {
    std::int64_t first_frame;
    cv::Rect box;
    cv::Ptr<cv::Tracker> filter;
  };
  std::vector<Follower> followers;
  for (const Places& body : bodies) {
    if (body.empty()) continue;
    const auto& [frame, centre] = *body.begin();
    const cv::Point2d half(size_px, size_px);
    followers.push_back({frame, {cv::Point(centre - half), cv::Point(centre + half)}, {}});
  }
  return [followers](const tracking::Frame& frame) mutable {
    cv::Mat picture;
    cv::cvtColor(frame.luma, picture, cv::COLOR_GRAY2BGR);
    Points centres;
    for (Follower& f : followers) {
      if (frame.index < f.first_frame) continue;
      if (!f.filter) {
        f.filter = cv::TrackerKCF::create();
        f.filter->init(picture, f.box);
      } else if (!f.filter->update(picture, f.box)) {
        continue;
      }
      centres.emplace_back(f.box.x + 0.5 * (f.box.width - 1), f.box.y + 0.5 * (f.box.height - 1));
    }
    return centres;
  };
}
#endif

/// The reported centre nearest to the truth is taken for the answer: a gift no tracker gets.
void score(const char* name, const std::filesystem::path& video, const Method& method,
           const std::vector<Places>& bodies) {
  constexpr double kLost_px = 5.0;
  const auto source = tracking::decode_ahead(tracking::open_video(video));
  double squares = 0.0;
  int found = 0, lost = 0, frames = 0;
  const auto start = std::chrono::steady_clock::now();
  while (const auto frame = source->next()) {
    const Points centres = method(*frame);
    ++frames;
    for (const Places& body : bodies) {
      const auto truth = body.find(frame->index);
      if (truth == body.end()) continue;
      double nearest = 1e9;
      for (const cv::Point2d& c : centres) nearest = std::min(nearest, cv::norm(c - truth->second));
      nearest < kLost_px ? ++found : ++lost;
      if (nearest < kLost_px) squares += nearest * nearest;
    }
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  const std::string rms = found > 0 ? fmt::format("{:.3f}", std::sqrt(squares / found)) : "-";
  fmt::print("  {:<24} rms {} px over {}, lost (> 5 px) {}; {:.0f} frames/s\n", name, rms, found,
             lost, frames / elapsed.count());
}

}  // namespace

void print_baselines(const std::filesystem::path& video, const std::filesystem::path& truth,
                     const std::vector<std::filesystem::path>& labels,
                     [[maybe_unused]] double radius_px) {
  std::vector<Places> bodies;
  if (!truth.empty()) bodies.push_back(places_of(truth));
  for (const auto& file : labels) bodies.push_back(places_of(file));
  if (bodies.empty()) return;
  score("MOG2 + moments", video, background_subtraction(bodies.size()), bodies);
  score("HoughCircles", video, hough_circles(bodies.size()), bodies);
  score("Otsu + moments", video, otsu_threshold(bodies.size()), bodies);
#ifdef TROCHOID_HAS_OPENCV_TRACKING
  score("KCF correlation filter", video, correlation_filters(bodies, radius_px), bodies);
#endif
}

}  // namespace trochoid::tools
