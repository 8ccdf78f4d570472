#include "trochoid/tracking/body_camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

#include "calibrate/overhead_fit.hpp"
#include "pose/pose_start.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/parallel.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/tracking/frame_source.hpp"
#include "trochoid/tracking/tracker.hpp"

namespace trochoid::tracking {
namespace {

using EdgesByFrame = std::map<std::int64_t, std::vector<EdgePoint>>;

EdgesByFrame edges_by_frame(const data::Table& table) {
  const Eigen::VectorXd frame = table.column("frame"), object = table.column("object"),
                        x = table.column("x_px"), y = table.column("y_px"),
                        nx = table.column("normal_x"), ny = table.column("normal_y"),
                        sigma = table.column("sigma_px"), residual = table.column("residual_px");
  EdgesByFrame edges;
  for (Eigen::Index i = 0; i < frame.size(); ++i)
    if (object[i] == 0.0)
      edges[static_cast<std::int64_t>(frame[i])].push_back(
          {{x[i], y[i]}, {nx[i], ny[i]}, sigma[i], residual[i]});
  return edges;
}

/// The search for one recording's camera, in three stages, each with the tracker's help.
class Search {
 public:
  Search(const std::filesystem::path& video, const data::Scene& scene,
         const BodyCameraOptions& options)
      : video_(video), scene_(scene), options_(options) {
    scene_.camera.scale_px_per_m.reset();
    scene_.camera.height_m.reset();
    scene_.camera.file.clear();
    check_tells_a_camera(scene);
    SourceOptions source;
    source.frame_rate_hz = scene_.camera.frame_rate_hz;
    source.missing_frames = scene_.camera.missing_frames;
    const VideoInfo info = open_video(video, source)->info();
    size_px_ = {info.width_px, info.height_px};
    prior_.log_focal = std::log(kUsualFocal * std::max(size_px_.width, size_px_.height));
    prior_.focal_sigma = kFocalSigma;
    prior_.turn_sigma_rad = kTurnSigma_rad;
    prior_.bend_sigma = kBendSigma;
    if (options.height_m) prior_.log_height = std::log(*options.height_m);
  }

  BodyCamera run() {
    const OverheadNumbers rough = look_by_rims();
    if (centres_px_.size() < kFewest)
      throw InputError(
          fmt::format("{}: the body is seen in {} pictures, too few to tell a camera "
                      "({} at least)",
                      video_.string(), centres_px_.size(), kFewest));
    report(0.1);
    return refine(survey(rough));
  }

 private:
  // Focal lengths of telephones and camcorders in widths of the picture: 0.7 to 2.5.
  static constexpr double kUsualFocal = 1.3, kFocalSigma = 0.5;
  static constexpr double kTurnSigma_rad = 0.0175;
  static constexpr double kBendSigma = 0.03;  ///< k1 of lenses whose pictures are not seen to bend
  static constexpr std::size_t kFewest = 8;   // pictures
  /// Part of the recording, as [from, to] in frames.
  struct Part {
    std::int64_t from, to;
  };

  void report(double share) const {
    if (options_.progress) options_.progress(share);
  }

  [[nodiscard]] TrackResult track(const std::optional<OverheadNumbers>& numbers,
                                  const std::optional<Part>& part) const {
    data::Scene scene = scene_;
    TrackOptions how;
    how.effort = Effort::quick;
    how.edges = numbers.has_value();
    how.checkpoint = options_.checkpoint;
    if (part) {
      how.from = fmt::format("f{}", part->from);
      how.to = fmt::format("f{}", part->to);
      if (scene.tracking.at_px) scene.tracking.at_px = centres_px_.at(part->from);
    }
    std::optional<data::Camera> camera;
    if (numbers) camera = overhead_camera(*numbers, size_px_);
    return track_video(video_, scene, camera, how);
  }

  /// Where the body is seen, and the scale its usual size tells: a few per cent off, since rims
  /// rise above the floor and shadows widen them.
  OverheadNumbers look_by_rims() {
    const TrackResult seen = track(std::nullopt, std::nullopt);
    for (const data::TrackSample& sample : seen.file.tracks.front().samples)
      centres_px_[sample.frame] = sample.centre_px;
    OverheadNumbers numbers = OverheadNumbers::Zero();
    numbers[kLogScale] = std::log(usual_scale(seen));
    numbers[kLogHeight] = prior_.log_height.value_or(prior_.log_focal - numbers[kLogScale]);
    return numbers;
  }

  // Pixels per metre of the track, which are the same everywhere in it.
  [[nodiscard]] double usual_scale(const TrackResult& seen) const {
    const auto& samples = seen.file.tracks.front().samples;
    const data::Camera unit = data::Camera::from_scale(size_px_.width, size_px_.height, 1.0);
    const Eigen::Vector2d middle_px(unit.cx, unit.cy);
    double px = 0.0, m = 0.0;
    for (const data::TrackSample& sample : samples) {
      px += (sample.centre_px - middle_px).norm();
      m += sample.centre_m.norm();
    }
    if (!(m > 0.0))
      throw NumericalError(
          fmt::format("{}: a body that never leaves the middle of the picture tells no camera",
                      video_.string()));
    return px / m;
  }

  /// So many frames, or as many as there are, in which the body moves most: a body at rest shows
  /// the same outline again and again.
  [[nodiscard]] Part liveliest(std::int64_t count) const {
    std::map<std::int64_t, double> way_px;  // up to each frame
    double way = 0.0;
    const Eigen::Vector2d* last = nullptr;
    for (const auto& [frame, centre_px] : centres_px_) {
      if (last != nullptr) way += (centre_px - *last).norm();
      way_px[frame] = way;
      last = &centre_px;
    }
    Part best{way_px.begin()->first, way_px.begin()->first};
    double longest = -1.0;
    for (const auto& [frame, before] : way_px) {
      const auto end = std::prev(way_px.upper_bound(frame + count - 1));
      if (end->second - before > longest) {
        longest = end->second - before;
        best = {frame, end->first};
      }
    }
    return best;
  }

  /// How much of the outline is seen where a camera puts it: edges, each the less the farther off
  /// it lies.
  [[nodiscard]] double agreement(const OverheadNumbers& numbers, const Part& part) const {
    constexpr double kOff_px = 0.5;
    try {
      const TrackResult seen = track(numbers, part);
      double sum = 0.0;
      for (const double residual : seen.edges->column("residual_px"))
        sum += std::max(0.0, 1.0 - std::pow(residual / kOff_px, 2));
      return sum;
    } catch (const Error&) {  // with this camera the body is not found
      return 0.0;
    }
  }

  /// The best of a grid about the rough numbers. Where scale is off by more than a per cent or two,
  /// edges are taken for others, and no adjustment finds back.
  [[nodiscard]] OverheadNumbers survey(const OverheadNumbers& rough) const {
    constexpr std::int64_t kFrames = 16;
    constexpr int kSmaller = 6, kLarger = 3;  // shadows make bodies look large
    constexpr double kStep = 0.025;
    const Part part = liveliest(kFrames);
    std::vector<OverheadNumbers> tried;
    for (const double focal : prior_.log_height ? std::vector{0.0} : std::vector{-0.35, 0.35})
      for (int i = -kSmaller; i <= kLarger; ++i) {
        OverheadNumbers numbers = rough;
        numbers[kLogScale] += kStep * i;
        numbers[kLogHeight] += focal;
        tried.push_back(numbers);
      }
    std::vector<double> agreements(tried.size());
    data::in_parallel(tried.size(), 0,
                      [&](std::size_t i) { agreements[i] = agreement(tried[i], part); });
    report(0.5);
    const auto best = std::max_element(agreements.begin(), agreements.end());
    if (!(*best > 0.0))
      throw InputError(fmt::format(
          "{}: under no camera that looks straight down the body is seen as large as it looks; "
          "check radius_m and thickness_m{}",
          video_.string(), options_.height_m ? ", and the camera's height" : ""));
    return tried[static_cast<std::size_t>(best - agreements.begin())];
  }

  [[nodiscard]] std::vector<SeenOutline> outlines(const TrackResult& seen,
                                                  const OverheadNumbers& numbers) const {
    constexpr std::size_t kMost = 40, kFewestEdges = 20;
    const data::PoseMotion motion(*scene_.body, scene_.support, overhead_camera(numbers, size_px_));
    EdgesByFrame edges = edges_by_frame(*seen.edges);
    std::vector<SeenOutline> all;
    for (const data::TrackSample& sample : seen.file.tracks.front().samples) {
      if (sample.doubtful() || edges[sample.frame].size() < kFewestEdges) continue;
      data::Pose<> pose;
      pose.centre_m.head<2>() = sample.centre_m;
      if (sample.theta) pose.theta_rad = sample.theta->value_rad;
      if (sample.phi) pose.phi_rad = sample.phi->value_rad;
      all.push_back({motion.settled(pose), std::move(edges[sample.frame])});
    }
    if (all.size() <= kMost) return all;
    std::vector<SeenOutline> some;
    for (std::size_t i = 0; i < kMost; ++i) some.push_back(std::move(all[i * all.size() / kMost]));
    return some;
  }

  /// Tracks and adjusts in turn: with a better camera edges are found where they are.
  [[nodiscard]] BodyCamera refine(OverheadNumbers numbers) const {
    constexpr std::int64_t kFrames = 240;
    constexpr int kRounds = 6;
    constexpr double kSettled = 0.3;  // of its sigma
    const Part part = liveliest(kFrames);
    Eigen::Vector2d moved;
    OverheadFit fit{};
    std::size_t pictures = 0;
    double turned = 0.0;
    for (int round = 0; round < kRounds; ++round) {
      std::vector<SeenOutline> seen = outlines(track(numbers, part), numbers);
      pictures = seen.size();
      turned = turned_rad(seen);
      if (pictures < kFewest)
        throw NumericalError(fmt::format(
            "{}: the outline of the body is seen well in {} pictures, too few to tell a camera "
            "({} at least)",
            video_.string(), pictures, kFewest));
      fit = adjusted(numbers, std::move(seen));
      moved = (fit.numbers - numbers).head<2>();
      numbers = fit.numbers;
      report(0.5 + 0.5 * (round + 1) / kRounds);
      const Eigen::Array2d sigma = fit.covariance.diagonal().head<2>().array().sqrt();
      if ((moved.array() / sigma).abs().maxCoeff() < kSettled) break;
    }
    fit.covariance.topLeftCorner<2, 2>() += moved * moved.transpose();  // as far as it settled
    if (turned < 0.5 * data::kTurn)
      refuse_mirrored(fit, outlines(track(fit.numbers, part), fit.numbers));
    return told(fit, static_cast<int>(pictures));
  }

  /// How far the axis went round the vertical, there and back counted as nothing.
  static double turned_rad(const std::vector<SeenOutline>& seen) {
    double turned = 0.0;
    for (std::size_t i = 1; i < seen.size(); ++i)
      turned += data::wrapped(seen[i].pose.phi_rad - seen[i - 1].pose.phi_rad);
    return std::abs(turned);
  }

  /// A body leaning one way looks nearly like one that leans the other way. In a recording too
  /// short to tell, a camera may settle beside mirrored poses; the outlines then fit the others
  /// better. In longer ones, where a wrong thickness may do the same, the tracker tells the two by
  /// how the axis goes round.
  void refuse_mirrored(const OverheadFit& fit, std::vector<SeenOutline> seen) const {
    constexpr double kClearly = 0.85;  // of the rms: 0.7 to 0.8 where it was so, else 0.92 and more
    const data::Camera camera = overhead_camera(fit.numbers, size_px_);
    const data::PoseMotion motion(*scene_.body, scene_.support, camera);
    for (SeenOutline& one : seen) one.pose = mirrored(camera, motion, one.pose);
    double rms_px = 0.0;
    try {
      rms_px = adjusted(fit.numbers, std::move(seen)).rms_px;
    } catch (const NumericalError&) {  // nothing is outlined like that
      return;
    }
    if (rms_px < kClearly * fit.rms_px)
      throw NumericalError(fmt::format(
          "{}: too short to tell which way the body leans, and a camera hangs on that; give more "
          "of the recording{}, or pictures of a board",
          video_.string(), options_.height_m ? "" : ", the camera's height"));
  }

  [[nodiscard]] OverheadFit adjusted(const OverheadNumbers& numbers,
                                     std::vector<SeenOutline> seen) const {
    try {
      return fit_overhead(*scene_.body, scene_.support, size_px_, prior_, numbers, std::move(seen));
    } catch (const NumericalError& error) {
      throw NumericalError(
          fmt::format("{}: {}; give pictures of a board", video_.string(), error.what()));
    }
  }

  [[nodiscard]] BodyCamera told(const OverheadFit& fit, int pictures) const {
    BodyCamera out;
    out.camera = overhead_camera(fit, size_px_);
    out.scale_px_per_m = std::exp(fit.numbers[kLogScale]);
    out.height_m = std::exp(fit.numbers[kLogHeight]);
    out.sigma_scale = std::sqrt(fit.covariance(kLogScale, kLogScale));
    out.sigma_height = std::sqrt(fit.covariance(kLogHeight, kLogHeight));
    out.pictures = pictures;
    out.rms_px = fit.rms_px;
    if (prior_.log_height) {
      out.own_height_m = std::exp(fit.own_log_height);
      out.sigma_own_height = fit.own_height_sigma;
      out.apart_sigmas = std::abs(fit.own_log_height - *prior_.log_height) /
                         std::hypot(fit.own_height_sigma, prior_.height_sigma);
    }
    constexpr double kWorst = 0.05;
    if (!(out.sigma_scale < kWorst))
      throw NumericalError(fmt::format(
          "{}: the outlines tell the scale to {:.0f} % only; give pictures of a board{}",
          video_.string(), 100.0 * out.sigma_scale,
          options_.height_m ? "" : ", or the camera's height"));
    return out;
  }

  std::filesystem::path video_;
  data::Scene scene_;
  const BodyCameraOptions& options_;
  cv::Size size_px_;
  OverheadPrior prior_;
  std::map<std::int64_t, Eigen::Vector2d> centres_px_;  ///< by the frame in which it was seen
};

}  // namespace

void check_tells_a_camera(const data::Scene& scene) {
  if (!(scene.body && scene.body->kind != data::BodyKind::top && scene.body->radius_m > 0.0))
    throw InputError("[body] radius_m is missing: a disc or ring of known size tells the camera");
  if (!(scene.body->thickness_m > 0.0))
    throw InputError(
        "[body] thickness_m is missing: how high its upper rim lies decides how large a body "
        "looks");
  const data::SupportKind on = scene.support.kind;
  if (on != data::SupportKind::floor && on != data::SupportKind::flat)
    throw InputError(
        "[support] kind: only a body on the floor, rolling or flat, tells the camera; give "
        "pictures of a board");
}

BodyCamera camera_from_body(const std::filesystem::path& video, const data::Scene& scene,
                            const BodyCameraOptions& options) {
  return Search(video, scene, options).run();
}

}  // namespace trochoid::tracking
