#include "calibrate/overhead_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "trochoid/data/error.hpp"
#include "trochoid/data/outline.hpp"
#include "trochoid/data/parallel.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using Edge = data::OutlinePoint::Edge;
constexpr int kNumbers = 5, kUnasked = 3;                          // turns and k1
constexpr int kParts = 5;                                          // of an outline
constexpr int kFx = 0, kFy = 1, kK1 = 4, kTurn = 9, kShiftZ = 14;  // of Camera::Deviation

/// Edges of one picture with the part of the outline that each belongs to.
class MatchedEdges {
 public:
  MatchedEdges(const data::Body& body, const SeenOutline& seen, const data::Camera& camera)
      : body_(body), edges_(seen.edges) {
    constexpr double kFarthest_px = 6.0;  // as far as a tracker takes edges
    const auto outline = outline_of(seen.pose, camera);
    for (const EdgePoint& edge : edges_) {
      const data::OutlinePoint* near = nearest(outline, edge, std::nullopt);
      const bool found = near != nullptr && (near->image_px - edge.image_px).norm() < kFarthest_px;
      parts_.push_back(found ? std::optional(near->edge) : std::nullopt);
    }
  }

  /// The part of the outline that each belongs to, if any.
  [[nodiscard]] const std::vector<std::optional<Edge>>& parts() const { return parts_; }

  /// How far edges lie outside the outline of a body posed like that, along their normals [px]; NaN
  /// where it has none beside them.
  [[nodiscard]] Eigen::VectorXd off_px(const data::Pose<>& pose, const data::Camera& camera) const {
    const auto outline = outline_of(pose, camera);
    Eigen::VectorXd off =
        Eigen::VectorXd::Constant(static_cast<Eigen::Index>(edges_.size()), std::nan(""));
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const data::OutlinePoint* at = parts_[i] ? nearest(outline, edges_[i], parts_[i]) : nullptr;
      if (at == nullptr) continue;
      off[static_cast<Eigen::Index>(i)] = (edges_[i].image_px - at->image_px).dot(at->normal_px) /
                                          edges_[i].normal_px.dot(at->normal_px);
    }
    return off;
  }

 private:
  [[nodiscard]] std::vector<data::OutlinePoint> outline_of(const data::Pose<>& pose,
                                                           const data::Camera& camera) const {
    constexpr double kStep_px = 0.7;  // between points the outline is straight to 0.003 px
    return data::visible_outline(body_, pose, camera, kStep_px);
  }

  static const data::OutlinePoint* nearest(const std::vector<data::OutlinePoint>& outline,
                                           const EdgePoint& edge, std::optional<Edge> part) {
    constexpr double kAlongside = 0.8;  // cosine
    const data::OutlinePoint* best = nullptr;
    double best_px2 = std::numeric_limits<double>::infinity();
    for (const data::OutlinePoint& point : outline) {
      if (part && point.edge != *part) continue;
      const double px2 = (point.image_px - edge.image_px).squaredNorm();
      if (px2 < best_px2 && point.normal_px.dot(edge.normal_px) > kAlongside)
        best_px2 = px2, best = &point;
    }
    return best;
  }

  const data::Body& body_;
  const std::vector<EdgePoint>& edges_;
  std::vector<std::optional<Edge>> parts_;
};

/// What the edges of one picture are off by, and how that changes with pose and camera.
struct Linearised {
  Eigen::VectorXd off_px;
  Eigen::MatrixXd by_pose, by_numbers;
  std::vector<std::optional<Edge>> parts;

  [[nodiscard]] bool holds(Eigen::Index edge) const {
    return std::isfinite(off_px[edge]) && by_pose.row(edge).allFinite() &&
           by_numbers.row(edge).allFinite();
  }
};

/// What one picture says of the camera, its pose eliminated, and how the pose follows.
struct Say {
  Eigen::Matrix<double, kNumbers, kNumbers> information =
      Eigen::Matrix<double, kNumbers, kNumbers>::Zero();
  OverheadNumbers pull = OverheadNumbers::Zero();  ///< of what its edges are off by
  /// Of the edges of each part of the outline, were they a pixel farther out.
  Eigen::Matrix<double, kNumbers, kParts> pull_of_1px =
      Eigen::Matrix<double, kNumbers, kParts>::Zero();
  Eigen::MatrixXd pose_by_numbers;
  Eigen::VectorXd pose_step;
  double squares_px2 = 0.0, weight = 0.0;
};

class OverheadAdjustment {
 public:
  OverheadAdjustment(const data::Body& body, const data::Support& support, const cv::Size& size_px,
                     const OverheadPrior& prior, std::vector<SeenOutline> seen)
      : body_(body), support_(support), size_px_(size_px), prior_(prior), seen_(std::move(seen)) {}

  OverheadFit run(const OverheadNumbers& start) {
    constexpr int kMost = 12;
    constexpr double kSettled = 1e-5;
    fit_.numbers = start;
    for (int i = 0; i < kMost; ++i)
      if (step().cwiseAbs().maxCoeff() < kSettled) break;
    if (!(fit_.numbers.allFinite() && fit_.covariance.allFinite()))
      throw NumericalError("the outlines determine no camera");
    return fit_;
  }

 private:
  [[nodiscard]] data::Camera camera(const OverheadNumbers& numbers) const {
    return overhead_camera(numbers, size_px_);
  }

  [[nodiscard]] Linearised linearised(const SeenOutline& seen) const {
    const data::Camera here = camera(fit_.numbers);
    const data::PoseMotion motion(body_, support_, here);
    const MatchedEdges edges(body_, seen, here);
    Linearised out{edges.off_px(seen.pose, here), {}, {}, edges.parts()};
    // Differences over a third of a pixel: well above how the outline is sampled.
    constexpr double kShift_px = 0.3;
    const double scale = std::exp(fit_.numbers[kLogScale]);
    out.by_pose.resize(out.off_px.size(), motion.count());
    for (int k = 0; k < motion.count(); ++k) {
      const bool turns = motion.rotation() >= 0 && k >= motion.rotation();
      const double by = kShift_px / (turns ? scale * body_.radius_m : scale);
      const data::PoseMotion::Step step = by * data::PoseMotion::Step::Unit(motion.count(), k);
      out.by_pose.col(k) = (out.off_px - edges.off_px(motion.moved(seen.pose, step), here)) / by;
    }
    // Height, turns and k1: a few pixels beside the middle, nearly straight so far.
    const OverheadNumbers by{kShift_px / (scale * body_.radius_m), 0.05, 0.01, 0.01, 0.02};
    out.by_numbers.resize(out.off_px.size(), kNumbers);
    for (int k = 0; k < kNumbers; ++k) {
      const data::Camera there = camera(fit_.numbers + by[k] * OverheadNumbers::Unit(k));
      out.by_numbers.col(k) = (out.off_px - edges.off_px(seen.pose, there)) / by[k];
    }
    return out;
  }

  [[nodiscard]] Say say_of(const Linearised& edges, double scatter_px) const {
    constexpr double kTukey = 4.0;
    const data::PoseMotion motion(body_, support_, camera(fit_.numbers));
    const int count = motion.count();
    Eigen::MatrixXd poses = Eigen::MatrixXd::Zero(count, count),
                    mixed = Eigen::MatrixXd::Zero(count, kNumbers);
    for (int k = 0; k < count; ++k) poses(k, k) = std::pow(motion.scale(k), -2);
    Eigen::VectorXd pull = Eigen::VectorXd::Zero(count);
    Eigen::MatrixXd pull_of_1px = Eigen::MatrixXd::Zero(count, kParts);
    Say say;
    for (Eigen::Index i = 0; i < edges.off_px.size(); ++i) {
      const double off_px = edges.off_px[i], z = off_px / (kTukey * scatter_px);
      if (!edges.holds(i) || std::abs(z) >= 1.0) continue;
      const double tukey = (1.0 - z * z) * (1.0 - z * z), w = tukey / (scatter_px * scatter_px);
      const Eigen::VectorXd p = edges.by_pose.row(i);
      const OverheadNumbers c = edges.by_numbers.row(i);
      poses += w * p * p.transpose();
      mixed += w * p * c.transpose();
      say.information += w * c * c.transpose();
      const auto part = static_cast<Eigen::Index>(*edges.parts[static_cast<std::size_t>(i)]);
      pull += w * off_px * p, pull_of_1px.col(part) += w * p;
      say.pull += w * off_px * c, say.pull_of_1px.col(part) += w * c;
      say.squares_px2 += tukey * off_px * off_px, say.weight += tukey;
    }
    const Eigen::LDLT<Eigen::MatrixXd> solver(poses);
    say.pose_by_numbers = -solver.solve(mixed);
    say.pose_step = solver.solve(pull);
    say.information += mixed.transpose() * say.pose_by_numbers;
    say.pull += say.pose_by_numbers.transpose() * pull;
    say.pull_of_1px += say.pose_by_numbers.transpose() * pull_of_1px;
    return say;
  }

  static double scatter_of(const std::vector<Linearised>& pictures) {
    constexpr double kLeast_px = 0.08;
    std::vector<double> sizes;
    for (const Linearised& edges : pictures)
      for (const double off : edges.off_px)
        if (std::isfinite(off)) sizes.push_back(std::abs(off));
    if (sizes.empty()) throw NumericalError("the outlines determine no camera");
    return std::max(kLeast_px, data::kSdOverMedianDistance * data::median(std::move(sizes)));
  }

  /// What all pictures say together: where to, and how well known that is.
  struct Verdict {
    Eigen::Vector2d step;
    Eigen::Matrix2d covariance;
    Eigen::Matrix<double, 2, kUnasked> by_unasked;  ///< how it follows the camera's turns and k1
  };

  /// The covariance is not that of independent edges, which would outweigh any tape: pictures count
  /// as independent, edges of one do not, and a part of the outline errs alike in all of them.
  [[nodiscard]] Verdict heard(const std::vector<Say>& says) const {
    // What models of edges are wrong by: shadows lie beside all but the upper rim. Where blur or
    // gloss leaves edges off the outline, all of a part may be as far off.
    constexpr double kRim_px = 0.1, kOther_px = 0.5;
    Eigen::Vector<double, kParts> edges_px =
        Eigen::Vector<double, kParts>::Constant(std::max(kOther_px, fit_.rms_px));
    edges_px[static_cast<Eigen::Index>(Edge::upper_rim)] = std::max(kRim_px, fit_.rms_px);
    constexpr double kWidest = 3.0;  // of either logarithm, where outlines say nothing
    const Eigen::Matrix2d least = std::pow(kWidest, -2) * Eigen::Matrix2d::Identity();
    Eigen::Matrix2d information = least, scatter = least;
    Eigen::Matrix<double, 2, kUnasked> mixed = Eigen::Matrix<double, 2, kUnasked>::Zero();
    Eigen::Vector2d pull = Eigen::Vector2d::Zero();
    Eigen::Matrix<double, 2, kParts> outwards = Eigen::Matrix<double, 2, kParts>::Zero();
    for (const Say& say : says) {
      const Eigen::Vector2d own = say.pull.head<2>();
      information += say.information.topLeftCorner<2, 2>();
      mixed += say.information.topRightCorner<2, kUnasked>();
      pull += own, scatter += own * own.transpose();
      outwards += say.pull_of_1px.topRows<2>() * edges_px.asDiagonal();
    }
    const Eigen::Matrix2d inverse = information.inverse();
    const Eigen::Matrix<double, 2, kParts> shift = inverse * outwards;
    return {inverse * pull, inverse * scatter * inverse + shift * shift.transpose(),
            -inverse * mixed};
  }

  /// That, and what was known before, the height or not.
  [[nodiscard]] Verdict with_prior(const Verdict& outlines,
                                   const std::optional<double>& log_height) const {
    const double focal = std::pow(prior_.focal_sigma, -2);
    const Eigen::Vector2d both = Eigen::Vector2d::Ones(), seen = fit_.numbers.head<2>();
    const Eigen::Matrix2d weight =
        (outlines.covariance + outlines.by_unasked * unasked() * outlines.by_unasked.transpose())
            .inverse();
    Eigen::Matrix2d information = weight + focal * both * both.transpose();
    Eigen::Vector2d pull = weight * outlines.step + focal * (prior_.log_focal - seen.sum()) * both;
    if (log_height) {
      const double height = std::pow(prior_.height_sigma, -2);
      information(kLogHeight, kLogHeight) += height;
      pull[kLogHeight] += height * (*log_height - seen[kLogHeight]);
    }
    const Eigen::Matrix2d covariance = information.inverse();
    return {covariance * pull, covariance, covariance * weight * outlines.by_unasked};
  }

  /// One step of Gauss and Newton, no longer than its linearisation holds.
  OverheadNumbers step() {
    std::vector<Linearised> pictures(seen_.size());
    data::in_parallel(seen_.size(), 0, [&](std::size_t i) { pictures[i] = linearised(seen_[i]); });
    const double scatter_px = scatter_of(pictures);
    std::vector<Say> says;
    for (const Linearised& edges : pictures) says.push_back(say_of(edges, scatter_px));
    fit_.rms_px = rms_of(says);
    const Verdict outlines = heard(says), verdict = with_prior(outlines, prior_.log_height);
    keep(verdict);
    keep_own_height(with_prior(outlines, std::nullopt));
    constexpr double kMostScale = 0.1, kMostHeight = 0.3;
    const double share = 1.0 / std::max({std::abs(verdict.step[kLogScale]) / kMostScale,
                                         std::abs(verdict.step[kLogHeight]) / kMostHeight, 1.0});
    OverheadNumbers by = OverheadNumbers::Zero();
    by.head<2>() = share * verdict.step;
    move(says, by, share);
    return by;
  }

  static double rms_of(const std::vector<Say>& says) {
    double squares_px2 = 0.0, weight = 0.0;
    for (const Say& say : says) squares_px2 += say.squares_px2, weight += say.weight;
    if (!(weight > 0.0)) throw NumericalError("the outlines determine no camera");
    return std::sqrt(squares_px2 / weight);
  }

  // Variances of what the outlines are not asked for.
  [[nodiscard]] Eigen::Matrix3d unasked() const {
    const double turn = prior_.turn_sigma_rad, bend = prior_.bend_sigma;
    return Eigen::Vector3d(turn * turn, turn * turn, bend * bend).asDiagonal();
  }

  void keep(const Verdict& verdict) {
    const Eigen::Matrix3d variances = unasked();
    const Eigen::Matrix<double, 2, kUnasked> mixed = verdict.by_unasked * variances;
    fit_.covariance << verdict.covariance, mixed, mixed.transpose(), variances;
  }

  void keep_own_height(const Verdict& alone) {
    fit_.own_log_height = fit_.numbers[kLogHeight] + alone.step[kLogHeight];
    fit_.own_height_sigma = std::sqrt(alone.covariance(kLogHeight, kLogHeight));
  }

  void move(const std::vector<Say>& says, const OverheadNumbers& by, double share) {
    fit_.numbers += by;
    const data::PoseMotion motion(body_, support_, camera(fit_.numbers));
    for (std::size_t i = 0; i < seen_.size(); ++i)
      seen_[i].pose =
          motion.moved(seen_[i].pose, share * says[i].pose_step + says[i].pose_by_numbers * by);
  }

  const data::Body& body_;
  const data::Support& support_;
  cv::Size size_px_;
  const OverheadPrior& prior_;
  std::vector<SeenOutline> seen_;
  OverheadFit fit_{};
};

}  // namespace

data::Camera overhead_camera(const OverheadNumbers& numbers, const cv::Size& size_px) {
  data::Camera::Deviation by = data::Camera::Deviation::Zero();
  by.segment<2>(kTurn) = numbers.segment<2>(kTurnX);
  by[kK1] = numbers[kBend];
  return data::Camera::overhead(size_px.width, size_px.height, std::exp(numbers[kLogScale]),
                                std::exp(numbers[kLogHeight]))
      .moved(by);
}

data::Camera overhead_camera(const OverheadFit& fit, const cv::Size& size_px) {
  data::Camera camera = overhead_camera(fit.numbers, size_px);
  // f = scale * height, both focal lengths alike, and the shift along the line of sight.
  Eigen::Matrix<double, data::Camera::kNumbers, kNumbers> by;
  by.setZero();
  for (const int focal : {kFx, kFy}) by.row(focal).head<2>().setConstant(camera.fx);
  by(kShiftZ, kLogHeight) = std::exp(fit.numbers[kLogHeight]);
  by.block<2, 2>(kTurn, kTurnX).setIdentity();
  by(kK1, kBend) = 1.0;
  camera.covariance = by * fit.covariance * by.transpose();
  camera.metres_by_radius = true;
  return camera;
}

OverheadFit fit_overhead(const data::Body& body, const data::Support& support,
                         const cv::Size& size_px, const OverheadPrior& prior,
                         const OverheadNumbers& start, std::vector<SeenOutline> seen) {
  return OverheadAdjustment(body, support, size_px, prior, std::move(seen)).run(start);
}

}  // namespace trochoid::tracking
