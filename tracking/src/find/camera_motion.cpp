#include "find/camera_motion.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "geometry/bilinear.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

constexpr int kReduced = 4;  // the surroundings of a point are some of these, averaged

/// Mean levels around each place, at a quarter of the size.
cv::Mat surroundings_of(const cv::Mat& luma) {
  constexpr int kAround = 5;
  cv::Mat reduced;
  cv::resize(luma, reduced, {}, 1.0 / kReduced, 1.0 / kReduced, cv::INTER_AREA);
  cv::blur(reduced, reduced, {kAround, kAround});
  return reduced;
}

/// A picture's level at a place against its surroundings.
double level_at(const cv::Mat& luma, const cv::Mat& surroundings, const Eigen::Vector2d& at_px) {
  const Eigen::Vector2d reduced = ((at_px.array() + 0.5) / kReduced - 0.5).matrix();
  return bilinear_inside<double>(luma, at_px.x(), at_px.y()) -
         bilinear_inside<double>(surroundings, reduced.x(), reduced.y());
}

/// Least squares of some points: of a shift and of contrast.
struct ShiftSums {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  void add(const Eigen::Vector3d& by, double residual, double weight) {
    normal += weight * by * by.transpose();
    right += weight * residual * by;
  }
  [[nodiscard]] Eigen::Vector2d shift() const { return (normal.inverse() * right).head<2>(); }
  /// What is known of the shift alone.
  [[nodiscard]] Eigen::Matrix2d information() const {
    return normal.inverse().topLeftCorner<2, 2>().inverse();
  }
};

/// Levels from pixel to pixel; Sobel's weights, for which noise of single pixels is no slope.
struct Slopes {
  cv::Mat x, y;
  explicit Slopes(const cv::Mat& plate) {
    constexpr double kOfWeights = 1.0 / 8.0;
    cv::Sobel(plate, x, CV_32F, 1, 0, 3, kOfWeights);
    cv::Sobel(plate, y, CV_32F, 0, 1, 3, kOfWeights);
  }
  [[nodiscard]] Eigen::Vector2d at(const cv::Point& p) const {
    return {x.at<float>(p), y.at<float>(p)};
  }
  /// The steepest places of a cell.
  [[nodiscard]] std::vector<cv::Point> steepest(const cv::Rect& cell, std::size_t most,
                                                double least) const {
    std::vector<std::pair<double, cv::Point>> found;
    for (int v = cell.y; v < cell.br().y; ++v)
      for (int u = cell.x; u < cell.br().x; ++u)
        if (const double slope = at({u, v}).norm(); slope > least)
          found.emplace_back(slope, cv::Point(u, v));
    const auto end = found.begin() + static_cast<std::ptrdiff_t>(std::min(most, found.size()));
    std::partial_sort(found.begin(), end, found.end(),
                      [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<cv::Point> places;
    for (auto at = found.begin(); at != end; ++at) places.push_back(at->second);
    return places;
  }
};

}  // namespace

std::optional<CameraMotion::Found> CameraMotion::shift_of(const std::vector<Point>& quarter,
                                                          const cv::Mat& luma,
                                                          const cv::Mat& surroundings,
                                                          const Follower::Others& bodies,
                                                          Eigen::Vector2d from_px) {
  constexpr std::size_t kFewest = 50;
  constexpr int kRounds = 3;
  constexpr double kRadii = 2.5;        // a body's shadow is beside it
  constexpr double kFarthest_px = 8.0;  // what goes farther has lost its points
  std::vector<const Point*> points;
  for (const Point& point : quarter)
    if (std::none_of(bodies.begin(), bodies.end(), [&](const auto& body) {
          return (point.at_px - body.first).norm() < kRadii * body.second;
        }))
      points.push_back(&point);
  if (points.size() < kFewest) return std::nullopt;
  Found found{from_px, {}};
  std::vector<double> residuals(points.size()), sizes(points.size());
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      residuals[i] = level_at(luma, surroundings, points[i]->at_px + found.px) - points[i]->level;
      sizes[i] = std::abs(residuals[i]);
    }
    constexpr double kRounding_levels = 0.3, kInlier = 2.0;
    const double scale = data::kSdOverMedianDistance * data::median(sizes) + kRounding_levels;
    ShiftSums sums;
    for (std::size_t i = 0; i < points.size(); ++i)
      sums.add(points[i]->by, residuals[i],
               1.0 / (1.0 + std::pow(residuals[i] / (kInlier * scale), 2)));
    found.px -= sums.shift();
    found.information = sums.information() / (scale * scale);
    // Of stripes nothing is known along them.
    if (!(found.px.norm() < kFarthest_px) || !found.information.allFinite()) return std::nullopt;
  }
  return found;
}

CameraMotion::CameraMotion(const cv::Mat& plate, double noise_levels) {
  constexpr int kCell_px = 16, kBorder_px = 6;
  constexpr std::size_t kEach = 2;
  constexpr double kLeast_levels = 0.7, kEnough = 0.5;
  const cv::Mat surroundings = surroundings_of(plate);
  const Slopes slopes(plate);
  int cells = 0, told = 0;
  for (int y = kBorder_px; y + kCell_px < plate.rows - kBorder_px; y += kCell_px)
    for (int x = kBorder_px; x + kCell_px < plate.cols - kBorder_px; x += kCell_px) {
      const auto places =
          slopes.steepest({x, y, kCell_px, kCell_px}, kEach, std::max(noise_levels, kLeast_levels));
      ++cells;
      told += places.empty() ? 0 : 1;
      for (const cv::Point& place : places) {
        const Eigen::Vector2d at_px(place.x, place.y), slope = slopes.at(place);
        const double level = level_at(plate, surroundings, at_px);
        const std::size_t quarter =
            (2 * place.x > plate.cols ? 1 : 0) + (2 * place.y > plate.rows ? 2 : 0);
        quarters_[quarter].push_back({at_px, {slope.x(), slope.y(), level}, level});
      }
    }
  tells_ = told > kEnough * cells;
}

// Each quarter is followed by itself: where a picture is mostly noise, what it makes of one of them
// has nothing to do with what it makes of another.
void CameraMotion::look(const Frame& frame, const Follower::Others& bodies) {
  if (!tells_ || looks_.contains(frame.index)) return;
  const cv::Mat surroundings = surroundings_of(frame.luma);
  Look look;
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  std::array<std::optional<Found>, kQuarters> found;
  for (std::size_t k = 0; k < kQuarters; ++k) {
    found[k] = shift_of(quarters_[k], frame.luma, surroundings, bodies, last_px_[k]);
    if (!found[k]) continue;
    information += found[k]->information;
    sum += found[k]->information * found[k]->px;
  }
  if (std::count(found.begin(), found.end(), std::nullopt) > std::ssize(found) / 2) return;
  look.shift_px = information.inverse() * sum;
  look.sigma_px = std::sqrt(0.5 * information.inverse().trace());
  // One quarter alone, below a hand or after a knock that none can follow, says nothing of the
  // camera; and one that a body hides contradicts nobody.
  constexpr double kTogether_px = 2.0;
  for (std::size_t k = 0; k < kQuarters; ++k) {
    const Eigen::Vector2d px = found[k] ? found[k]->px : look.shift_px;
    if (!((px - look.shift_px).norm() < kTogether_px)) return;
    look.of_quarters_px.col(static_cast<Eigen::Index>(k)) = px;
  }
  for (std::size_t k = 0; k < kQuarters; ++k)
    if (found[k]) last_px_[k] = found[k]->px;
  looks_[frame.index] = look;
}

template <class ShiftOf>
Eigen::Vector2d CameraMotion::usual_px(std::size_t looks, const ShiftOf& shift_of) const {
  std::vector<double> x, y;
  for (auto at = looks_.begin(); at != looks_.end() && x.size() < looks; ++at) {
    const Eigen::Vector2d shift_px = shift_of(at->second);
    x.push_back(shift_px.x());
    y.push_back(shift_px.y());
  }
  return {data::median(std::move(x)), data::median(std::move(y))};
}

bool CameraMotion::moves(double& disagree_px) const {
  constexpr double kLeast_px = 0.1, kClearly = 2.0;
  const std::size_t all = looks_.size();
  const Eigen::Vector2d middle_px = usual_px(all, [](const Look& look) { return look.shift_px; });
  Eigen::Matrix<double, 2, kQuarters> middles_px;
  for (Eigen::Index k = 0; k < middles_px.cols(); ++k)
    middles_px.col(k) = usual_px(all, [k](const Look& look) { return look.of_quarters_px.col(k); });
  double moves2 = 0.0, disagree2 = 0.0;
  for (const auto& [index, look] : looks_) {
    moves2 += (look.shift_px - middle_px).squaredNorm();
    const Eigen::Matrix<double, 2, kQuarters> gone_px = look.of_quarters_px - middles_px;
    const Eigen::Vector2d together_px = gone_px.rowwise().mean();
    disagree2 += (gone_px.colwise() - together_px).squaredNorm() / kQuarters;
  }
  const auto count = static_cast<double>(all);
  disagree_px = std::sqrt(disagree2 / count);
  return std::sqrt(moves2 / count) > std::max(kLeast_px, kClearly * disagree_px);
}

Eigen::Vector2d CameraMotion::rest_px() const {
  constexpr std::size_t kFewest = 8, kBeginning = 10;
  const auto whole = [](const Look& look) { return look.shift_px; };
  const Eigen::Vector2d middle_px = usual_px(looks_.size(), whole);
  const Eigen::Vector2d begun_px = usual_px(std::max(kFewest, looks_.size() / kBeginning), whole);
  std::vector<double> off_px;
  for (const auto& [index, look] : looks_) off_px.push_back((look.shift_px - middle_px).norm());
  constexpr double kNear = 0.5;  // a knock half way leaves the middle between the two places
  const bool shakes = (begun_px - middle_px).norm() < kNear * data::median(std::move(off_px));
  return shakes ? middle_px : begun_px;
}

std::map<std::int64_t, PictureShift> CameraMotion::shifts() const {
  constexpr std::size_t kFewest = 8;
  double disagree_px = 0.0;
  if (looks_.size() < kFewest || !moves(disagree_px)) return {};
  const Eigen::Vector2d rest = rest_px();
  std::map<std::int64_t, PictureShift> shifts;
  for (const auto& [index, look] : looks_)
    shifts[index] = {look.shift_px - rest,
                     std::hypot(look.sigma_px, disagree_px / std::sqrt(kQuarters))};
  return shifts;
}

}  // namespace trochoid::tracking
