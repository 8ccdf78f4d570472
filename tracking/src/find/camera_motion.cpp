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

/// What a look says of the whole picture: its shift along x and y, and its growth.
constexpr auto shift_and_growth = [](const auto& look) {
  return Eigen::Vector3d(look.shift_px.x(), look.shift_px.y(), look.growth);
};

/// Median of what the first so many looks say.
template <class Looks, class Said>
Eigen::Vector3d usual(const Looks& looks, std::size_t first, const Said& said) {
  std::array<std::vector<double>, 3> values;
  for (auto at = looks.begin(); at != looks.end() && values[0].size() < first; ++at) {
    const Eigen::Vector3d value = said(at->second);
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i].push_back(value(static_cast<Eigen::Index>(i)));
  }
  return {data::median(std::move(values[0])), data::median(std::move(values[1])),
          data::median(std::move(values[2]))};
}

/// What the first tenth of the looks say, or where the picture shakes about one place, that.
template <class Looks>
Eigen::Vector3d at_rest(const Looks& looks, double reach_px) {
  constexpr std::size_t kFewest = 8, kBeginning = 10;
  const Eigen::Vector3d middle = usual(looks, looks.size(), shift_and_growth);
  const Eigen::Vector3d begun =
      usual(looks, std::max(kFewest, looks.size() / kBeginning), shift_and_growth);
  const auto apart_px = [&](const Eigen::Vector3d& of) {
    return (of - middle).cwiseProduct(Eigen::Vector3d(1.0, 1.0, reach_px)).norm();
  };
  std::vector<double> off_px;
  for (const auto& [index, look] : looks) off_px.push_back(apart_px(shift_and_growth(look)));
  constexpr double kNear = 0.5;  // a knock half way leaves the middle between the two places
  return apart_px(begun) < kNear * data::median(std::move(off_px)) ? middle : begun;
}

}  // namespace

std::optional<CameraMotion::Found> CameraMotion::shift_of(const std::vector<Point>& quarter,
                                                          const Picture& picture,
                                                          const Follower::Others& bodies,
                                                          Eigen::Vector2d from_px, double growth) {
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
  Found found{from_px, {}, Eigen::Vector2d::Zero()};
  for (const Point* point : points)
    found.about_px += point->at_px / static_cast<double>(points.size());
  std::vector<double> residuals(points.size()), sizes(points.size());
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d &at_px = points[i]->at_px,
                            gone_px = found.px + growth * (at_px - found.about_px);
      residuals[i] =
          level_at(picture.luma, picture.surroundings, at_px + gone_px) - points[i]->level;
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

CameraMotion::CameraMotion(const cv::Mat& plate, double noise_levels)
    : middle_px_(0.5 * (plate.cols - 1), 0.5 * (plate.rows - 1)) {
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

/// How far the quarters are from the middle, about.
double CameraMotion::reach_px() const {
  return 0.5 * middle_px_.norm();
}

/// By least squares: one shift, and growth that parts the quarters.
CameraMotion::Look CameraMotion::together(const Quarters& quarters, bool grows) const {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const auto& found : quarters) {
    if (!found) continue;
    Eigen::Matrix<double, 2, 3> by;
    by << Eigen::Matrix2d::Identity(), grows ? found->about_px - middle_px_ : Eigen::Vector2d(0, 0);
    normal += by.transpose() * found->information * by;
    right += by.transpose() * (found->information * found->px);
  }
  if (!grows) normal(2, 2) = 1.0;
  const Eigen::Matrix3d covariance = normal.inverse();
  const Eigen::Vector3d solution = covariance * right;
  Look look{.shift_px = solution.head<2>(), .of_quarters_px = {}};
  look.sigma_px = std::sqrt(0.5 * covariance.topLeftCorner<2, 2>().trace());
  if (grows) look.growth = solution.z(), look.sigma_growth = std::sqrt(covariance(2, 2));
  return look;
}

// Each quarter is followed by itself: where a picture is mostly noise, what it makes of one of them
// has nothing to do with what it makes of another.
std::optional<CameraMotion::Look> CameraMotion::look_at(const Picture& picture,
                                                        const Follower::Others& bodies,
                                                        Series& series) const {
  constexpr int kRounds = 3;
  constexpr double kSettled_px = 0.05;
  double growth = series.last_growth;
  Quarters found;
  Look look;
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t k = 0; k < kQuarters; ++k)
      found[k] = shift_of(quarters_[k], picture, bodies, series.last_px[k], growth);
    if (std::count(found.begin(), found.end(), std::nullopt) > std::ssize(found) / 2)
      return std::nullopt;
    look = together(found, series.grows);
    const double change = std::abs(look.growth - growth);
    if (!(change * reach_px() > kSettled_px)) break;
    growth = look.growth;
  }
  // One quarter alone, below a hand or after a knock that none can follow, says nothing of the
  // camera; and one that a body hides contradicts nobody.
  constexpr double kTogether_px = 2.0;
  for (std::size_t k = 0; k < kQuarters; ++k) {
    Eigen::Vector2d px = look.shift_px;
    if (found[k]) px = found[k]->px - look.growth * (found[k]->about_px - middle_px_);
    if (!((px - look.shift_px).norm() < kTogether_px)) return std::nullopt;
    look.of_quarters_px.col(static_cast<Eigen::Index>(k)) = px;
  }
  for (std::size_t k = 0; k < kQuarters; ++k)
    if (found[k]) series.last_px[k] = found[k]->px;
  series.last_growth = look.growth;
  return look;
}

void CameraMotion::look(const Frame& frame, const Follower::Others& bodies) {
  if (!tells_) return;
  const cv::Mat surroundings = surroundings_of(frame.luma);
  for (Series* series : {&shifted_, &grown_})
    if (!series->looks.contains(frame.index))
      if (const auto look = look_at({frame.luma, surroundings}, bodies, *series))
        series->looks[frame.index] = *look;
}

bool CameraMotion::moves(const Series& series, double& disagree_px) const {
  constexpr double kLeast_px = 0.1, kClearly = 2.0;
  const std::size_t all = series.looks.size();
  const Eigen::Vector3d middle = usual(series.looks, all, shift_and_growth);
  Eigen::Matrix<double, 2, kQuarters> middles_px;
  for (Eigen::Index k = 0; k < middles_px.cols(); ++k)
    middles_px.col(k) = usual(series.looks, all, [k](const auto& look) {
                          return Eigen::Vector3d(look.of_quarters_px.col(k).homogeneous());
                        }).head<2>();
  double shifts2 = 0.0, grows2 = 0.0, disagree2 = 0.0;
  for (const auto& [index, look] : series.looks) {
    const Eigen::Vector3d gone = shift_and_growth(look) - middle;
    shifts2 += gone.head<2>().squaredNorm();
    grows2 += std::pow(gone.z() * reach_px(), 2);
    const Eigen::Matrix<double, 2, kQuarters> gone_px = look.of_quarters_px - middles_px;
    const Eigen::Vector2d together_px = gone_px.rowwise().mean();
    disagree2 += (gone_px.colwise() - together_px).squaredNorm() / kQuarters;
  }
  const auto count = static_cast<double>(all);
  disagree_px = std::sqrt(disagree2 / count);
  return std::sqrt((series.grows ? grows2 : shifts2) / count) >
         std::max(kLeast_px, kClearly * disagree_px);
}

std::map<std::int64_t, PictureShift> CameraMotion::shifts() const {
  constexpr std::size_t kFewest = 8;
  // Growth where it is plain; else a shift.
  for (const Series* series : {&grown_, &shifted_}) {
    double disagree_px = 0.0;
    if (series->looks.size() < kFewest || !moves(*series, disagree_px)) continue;
    const Eigen::Vector3d rest = at_rest(series->looks, reach_px());
    const double of_quarters_px = disagree_px / std::sqrt(kQuarters);
    std::map<std::int64_t, PictureShift> shifts;
    for (const auto& [index, look] : series->looks) {
      PictureShift& shift = shifts[index];
      shift.growth = (1.0 + look.growth) / (1.0 + rest.z()) - 1.0;
      shift.px = look.shift_px - (1.0 + shift.growth) * rest.head<2>();
      shift.sigma_px = std::hypot(look.sigma_px, of_quarters_px);
      if (!series->grows) continue;
      shift.sigma_growth = std::hypot(look.sigma_growth, of_quarters_px / reach_px());
      shift.about_px = middle_px_;
    }
    return shifts;
  }
  return {};
}

PictureShift PictureShift::at(const Eigen::Vector2d& place_px) const {
  PictureShift there = *this;
  const Eigen::Vector2d from_px = place_px - about_px;
  // A place that is seen where it has gone to.
  there.px += growth / (1.0 + growth) * (from_px - px);
  there.sigma_px = std::hypot(sigma_px, sigma_growth * from_px.norm());
  there.about_px = place_px;
  return there;
}

}  // namespace trochoid::tracking
