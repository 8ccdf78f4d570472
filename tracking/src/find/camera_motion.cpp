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
constexpr double kRounding_levels = 0.3;

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

/// A place, or a way, turned and made larger.
Eigen::Vector2d times(std::complex<double> factor, const Eigen::Vector2d& way) {
  const std::complex<double> product = factor * std::complex<double>(way.x(), way.y());
  return {product.real(), product.imag()};
}

/// What a look says of the whole picture: its shift along x and y, its factor.
constexpr auto shift_and_factor = [](const auto& look) {
  return Eigen::Vector4d(look.shift_px.x(), look.shift_px.y(), look.factor.real(),
                         look.factor.imag());
};

/// Median of what the first so many looks say.
template <class Looks, class Said>
auto usual(const Looks& looks, std::size_t first, const Said& said) {
  auto medians = said(looks.begin()->second);
  for (Eigen::Index i = 0; i < medians.size(); ++i) {
    std::vector<double> values;
    for (auto at = looks.begin(); at != looks.end() && values.size() < first; ++at)
      values.push_back(said(at->second)(i));
    medians(i) = data::median(std::move(values));
  }
  return medians;
}

/// What the first tenth of the looks say, or where the picture shakes about one place, that.
template <class Looks>
Eigen::Vector4d at_rest(const Looks& looks, double reach_px) {
  constexpr std::size_t kFewest = 8, kBeginning = 10;
  const Eigen::Vector4d middle = usual(looks, looks.size(), shift_and_factor);
  const Eigen::Vector4d begun =
      usual(looks, std::max(kFewest, looks.size() / kBeginning), shift_and_factor);
  const auto apart_px = [&](const Eigen::Vector4d& of) {
    return (of - middle).cwiseProduct(Eigen::Vector4d(1.0, 1.0, reach_px, reach_px)).norm();
  };
  std::vector<double> off_px;
  for (const auto& [index, look] : looks) off_px.push_back(apart_px(shift_and_factor(look)));
  constexpr double kNear = 0.5;  // a knock half way leaves the middle between the two places
  return apart_px(begun) < kNear * data::median(std::move(off_px)) ? middle : begun;
}

}  // namespace

// By least squares; from_px is next to it already.
std::optional<CameraMotion::Found> CameraMotion::shift_of(const Quarter& quarter,
                                                          const Picture& picture,
                                                          const Follower::Others& bodies,
                                                          const Eigen::Vector2d& from_px,
                                                          std::complex<double> factor) {
  constexpr std::size_t kFewest = 50;
  constexpr int kRounds = 3;
  constexpr double kRadii = 2.5;        // a body's shadow is beside it
  constexpr double kFarthest_px = 8.0;  // what goes farther has lost its points
  const cv::Rect2d inside(0.0, 0.0, picture.luma.cols - 1.0, picture.luma.rows - 1.0);
  std::vector<const Point*> points;
  for (const Point& point : quarter.points) {
    const Eigen::Vector2d there_px = point.at_px + from_px;
    if (inside.contains({there_px.x(), there_px.y()}) &&
        std::none_of(bodies.begin(), bodies.end(), [&](const auto& body) {
          return (there_px - body.first).norm() < kRadii * body.second;
        }))
      points.push_back(&point);
  }
  if (points.size() < kFewest) return std::nullopt;
  Found found{from_px, {}, Eigen::Vector2d::Zero()};
  for (const Point* point : points)
    found.about_px += point->at_px / static_cast<double>(points.size());
  std::vector<double> residuals(points.size()), sizes(points.size());
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d& at_px = points[i]->at_px;
      const Eigen::Vector2d gone_px = found.px + times(factor - 1.0, at_px - found.about_px);
      residuals[i] =
          level_at(picture.luma, picture.surroundings, at_px + gone_px) - points[i]->level;
      sizes[i] = std::abs(residuals[i]);
    }
    constexpr double kInlier = 2.0;
    found.off_levels = data::kSdOverMedianDistance * data::median(sizes);
    const double scale = found.off_levels + kRounding_levels;
    ShiftSums sums;
    for (std::size_t i = 0; i < points.size(); ++i)
      sums.add(points[i]->by, residuals[i],
               1.0 / (1.0 + std::pow(residuals[i] / (kInlier * scale), 2)));
    found.px -= sums.shift();
    found.information = sums.information() / (scale * scale);
    // Of stripes nothing is known along them.
    if (!((found.px - from_px).norm() < kFarthest_px) || !found.information.allFinite())
      return std::nullopt;
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
  const cv::Size half(plate.cols / 2, plate.rows / 2);
  for (std::size_t k = 0; k < kQuarters; ++k)
    quarters_[k].part = {cv::Point(k % 2 == 1 ? half.width : 0, k / 2 == 1 ? half.height : 0),
                         half};
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
        quarters_[quarter].points.push_back({at_px, {slope.x(), slope.y(), level}, level});
      }
    }
  tells_ = told > kEnough * cells;
  shifted_.usual_off_levels = warped_.usual_off_levels = noise_levels;
  if (!tells_) return;
  for (Quarter& quarter : quarters_) quarter.pattern.emplace(plate(quarter.part));
}

/// How far the quarters are from the middle, about.
double CameraMotion::reach_px() const {
  return 0.5 * middle_px_.norm();
}

/// By least squares: one shift, and a factor that parts the quarters.
void CameraMotion::fit_together(const Quarters& quarters, bool warps, Look& look) const {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  double off_levels = 0.0, count = 0.0;
  for (const auto& found : quarters) {
    if (!found) continue;
    const Eigen::Vector2d from_px = found->about_px - middle_px_;
    Eigen::Matrix<double, 2, 4> by;
    by << Eigen::Matrix2d::Identity(), from_px, times({0.0, 1.0}, from_px);
    if (!warps) by.rightCols<2>().setZero();
    normal += by.transpose() * found->information * by;
    right += by.transpose() * (found->information * found->px);
    off_levels += found->off_levels;
    count += 1.0;
  }
  if (!warps) normal.bottomRightCorner<2, 2>().setIdentity();
  const Eigen::Matrix4d covariance = normal.inverse();
  const Eigen::Vector4d solution = covariance * right;
  look.shift_px = solution.head<2>();
  look.off_levels = off_levels / count;
  look.sigma_px = std::sqrt(0.5 * covariance.topLeftCorner<2, 2>().trace());
  if (!warps) return;
  look.factor = {1.0 + solution(2), solution(3)};
  look.sigma_factor = std::sqrt(0.5 * covariance.bottomRightCorner<2, 2>().trace());
}

// Each quarter is followed by itself: where a picture is mostly noise, what it makes of one of them
// has nothing to do with what it makes of another.
std::optional<CameraMotion::Look> CameraMotion::look_from(const Ways& from_px, bool warps,
                                                          std::complex<double> factor,
                                                          const Picture& picture,
                                                          const Follower::Others& bodies) const {
  constexpr int kRounds = 3;
  constexpr double kSettled_px = 0.05;
  const std::ptrdiff_t fewest = warps ? 3 : 2;  // two agree on some factor whatever they say
  Look look{.factor = factor, .gone_px = from_px};
  Quarters found;
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t k = 0; k < kQuarters; ++k) {
      auto gone_px = look.gone_px.col(static_cast<Eigen::Index>(k));
      found[k] = shift_of(quarters_[k], picture, bodies, gone_px, factor);
      if (found[k]) gone_px = found[k]->px;
    }
    if (std::ssize(found) - std::count(found.begin(), found.end(), std::nullopt) < fewest)
      return std::nullopt;
    fit_together(found, warps, look);
    const double change = std::abs(look.factor - factor);
    if (!(change * reach_px() > kSettled_px)) break;
    factor = look.factor;
  }
  // One quarter alone, below a hand or after a knock that none can follow, says nothing of the
  // camera; and one that a body hides contradicts nobody.
  constexpr double kTogether_px = 2.0;
  for (std::size_t k = 0; k < kQuarters; ++k) {
    Eigen::Vector2d px = look.shift_px;
    if (found[k]) px = found[k]->px - times(look.factor - 1.0, found[k]->about_px - middle_px_);
    if (!((px - look.shift_px).norm() < kTogether_px)) return std::nullopt;
    look.of_quarters_px.col(static_cast<Eigen::Index>(k)) = px;
  }
  return look;
}

bool CameraMotion::as_usual(const std::optional<Look>& look, const Series& series, double times) {
  // Codecs repeat what does not change: where next to nothing is usual, rounding is no knock.
  return look && look->off_levels < std::max(times * series.usual_off_levels, kRounding_levels);
}

// From where the quarters seem to have gone to, if the floor looks there as it usually does.
std::optional<CameraMotion::Look> CameraMotion::look_around(const Picture& picture,
                                                            const Follower::Others& bodies,
                                                            const Series& series,
                                                            std::optional<Look> best) const {
  constexpr double kNearly = 1.6, kClearly = 0.8;
  for (const auto seek : {&FarShift::by_phases, &FarShift::by_likeness}) {
    Ways far_px;
    for (std::size_t k = 0; k < kQuarters; ++k)
      far_px.col(static_cast<Eigen::Index>(k)) =
          (*quarters_[k].pattern.*seek)(picture.luma(quarters_[k].part));
    std::optional<Look> far = look_from(far_px, series.warps, series.last.factor, picture, bodies);
    if (as_usual(far, series, kNearly) && (!best || far->off_levels < kClearly * best->off_levels))
      best = std::move(far);
  }
  return best;
}

void CameraMotion::take(const Look& look, std::int64_t frame, Series& series) {
  constexpr double kOften = 10.0;  // light changes slowly
  const double before = series.looks.empty() ? look.off_levels : series.usual_off_levels;
  series.usual_off_levels = before + (look.off_levels - before) / kOften;
  series.looks[frame] = series.last = look;
}

// From where the quarters were last. If the floor does not look there as it usually does, however
// it may have moved, all around: a knock.
void CameraMotion::look(const Frame& frame, const Follower::Others& bodies) {
  constexpr double kAsUsual = 1.3;
  if (!tells_ || shifted_.looks.contains(frame.index) || warped_.looks.contains(frame.index))
    return;
  const cv::Mat surroundings = surroundings_of(frame.luma);
  const Picture picture{frame.luma, surroundings};
  const auto near = [&](const Series& series) {
    return look_from(series.last.gone_px, series.warps, series.last.factor, picture, bodies);
  };
  std::optional<Look> shifted = near(shifted_), warped = near(warped_);
  if (!as_usual(shifted, shifted_, kAsUsual) && !as_usual(warped, warped_, kAsUsual)) {
    shifted = look_around(picture, bodies, shifted_, std::move(shifted));
    warped = look_around(picture, bodies, warped_, std::move(warped));
  }
  if (shifted) take(*shifted, frame.index, shifted_);
  if (warped) take(*warped, frame.index, warped_);
}

bool CameraMotion::moves(const Series& series, double& disagree_px) const {
  constexpr double kLeast_px = 0.1, kClearly = 2.0;
  const std::size_t all = series.looks.size();
  const Eigen::Vector4d middle = usual(series.looks, all, shift_and_factor);
  Ways middles_px;
  for (Eigen::Index k = 0; k < middles_px.cols(); ++k)
    middles_px.col(k) = usual(series.looks, all, [k](const auto& look) -> Eigen::Vector2d {
      return look.of_quarters_px.col(k);
    });
  double shifts2 = 0.0, warps2 = 0.0, disagree2 = 0.0;
  for (const auto& [index, look] : series.looks) {
    const Eigen::Vector4d gone = shift_and_factor(look) - middle;
    shifts2 += gone.head<2>().squaredNorm();
    warps2 += gone.tail<2>().squaredNorm() * reach_px() * reach_px();
    const Ways gone_px = look.of_quarters_px - middles_px;
    const Eigen::Vector2d together_px = gone_px.rowwise().mean();
    disagree2 += (gone_px.colwise() - together_px).squaredNorm() / kQuarters;
  }
  const auto count = static_cast<double>(all);
  disagree_px = std::sqrt(disagree2 / count);
  return std::sqrt((series.warps ? warps2 : shifts2) / count) >
         std::max(kLeast_px, kClearly * disagree_px);
}

std::map<std::int64_t, PictureShift> CameraMotion::shifts() const {
  constexpr std::size_t kFewest = 8;
  // Growth and turning where they are plain; else a shift.
  for (const Series* series : {&warped_, &shifted_}) {
    double disagree_px = 0.0;
    if (series->looks.size() < kFewest || !moves(*series, disagree_px)) continue;
    const Eigen::Vector4d rest = at_rest(series->looks, reach_px());
    const double of_quarters_px = disagree_px / std::sqrt(kQuarters);
    constexpr double kAtOnce_px = 0.5;
    std::map<std::int64_t, PictureShift> shifts;
    Eigen::Vector2d last_px = rest.head<2>(), jumped_px = Eigen::Vector2d::Zero();
    for (const auto& [index, look] : series->looks) {
      PictureShift& shift = shifts[index];
      shift.factor = look.factor / std::complex<double>(rest(2), rest(3));
      shift.px = look.shift_px - times(shift.factor, rest.head<2>());
      shift.sigma_px = std::hypot(look.sigma_px, of_quarters_px);
      const Eigen::Vector2d step_px = look.shift_px - last_px;
      if (step_px.norm() > kAtOnce_px) jumped_px += step_px;
      shift.crept_px = (shift.px - jumped_px).norm();
      last_px = look.shift_px;
      if (!series->warps) continue;
      shift.sigma_factor = std::hypot(look.sigma_factor, of_quarters_px / reach_px());
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
  const Eigen::Vector2d further_px = times((factor - 1.0) / factor, from_px - px);
  there.px += further_px;
  there.crept_px += further_px.norm();
  there.sigma_px = std::hypot(sigma_px, sigma_factor * from_px.norm());
  there.about_px = place_px;
  return there;
}

}  // namespace trochoid::tracking
