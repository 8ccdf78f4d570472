#include "trochoid/tracking/outline_fit.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "edges/colour_window.hpp"
#include "geometry/pose_change.hpp"
#include "pose/outline_refine.hpp"
#include "pose/pose_start.hpp"
#include "pose/spin_mark.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/parallel.hpp"

namespace trochoid::tracking {
namespace {

// Coarse to fine, the first two on blurred pictures: a wide edge is seen from far and through
// noise, a sharp one is precise.
constexpr double kFarBlurPx = 2.5, kNearBlurPx = 1.0;
constexpr Search kFar{2.7, 8.0, 7.0, 3.0, 3.0, 4, 0.1, false};
constexpr Search kNear{1.3, 4.5, 3.5, 2.5, 2.5, 4, 0.05, false};
// From a prediction that is off by more than the blur: where the last sharp look then starts.
constexpr Search kDraw{1.3, 4.5, 3.5, 5.0, 5.0, 2, 0.5, false};
// Longer outlines are sampled more sparsely: neighbours share their errors anyhow. Rounds that only
// lead to where the last one looks, and frames that will be looked at again, do with every second
// point.
Search exact(const Scenery& scenery, double blur_px, double outline_px) {
  constexpr double kLeastStep_px = 1.0;  // neighbours nearer than this show the same pixels
  const double step_px = std::max(kLeastStep_px, outline_px / scenery.most_looks);
  return {.blur_px = blur_px,
          .extent_px = 2.0 + 2.5 * blur_px,
          .reach_px = 0.5 + 2.0 * blur_px,
          .first_step_px = scenery.visit == Visit::again ? step_px : 2.0 * step_px,
          .step_px = scenery.visit == Visit::first ? 2.0 * step_px : step_px,
          .iterations = 5,
          .settled_px = 0.06,
          .exact = true};
}

cv::Rect window_of(const data::Body& body, const data::Camera& camera, const data::Pose<>& pose,
                   double margin_px) {
  const double reach_m = std::hypot(body.radius_m, body.half_thickness_m());
  const Eigen::Vector2d centre = camera.image_from_table<double>(pose.centre_m);
  const double reach_px = reach_m * camera.jacobian_px_per_m(pose.centre_m).norm() + margin_px;
  const auto floor = [](double v) {
    return static_cast<int>(std::floor(std::clamp(v, -1e6, 1e6)));
  };
  return {floor(centre.x() - reach_px), floor(centre.y() - reach_px), floor(2.0 * reach_px) + 2,
          floor(2.0 * reach_px) + 2};
}

struct Fitted {
  Refined refined;
  double blur_px = kUsualBlurPx;
  double accepted = 0.0;    ///< accepted_of the fit
  double support_px = 0.0;  ///< support_px_of the fit
  double evenness = 1.0;    ///< evenness_of the fit
  /// Covariance of a step by which other attitudes explain the picture about as well; or empty.
  Eigen::MatrixXd attitudes{};

  [[nodiscard]] double score_px() const { return support_px * evenness; }
};

// The last stage, from a pose that is right to about the blur of the picture. Too sharp or too wide
// an edge model is looked at again with the right one.
std::optional<Fitted> fit_exactly(const Scenery& scenery, const data::Pose<>& start,
                                  double outline_px, std::optional<double> known_blur_px) {
  constexpr double kSharpestPx = 0.45, kWidestPx = 2.2, kClosePx = 0.06;
  Fitted out;
  double blur_px = known_blur_px.value_or(kUsualBlurPx);
  data::Pose<> pose = start;
  for (int round = 0; round < 6; ++round) {
    auto refined = refine(scenery, pose, exact(scenery, blur_px, outline_px));
    if (!refined) return std::nullopt;
    out.refined = std::move(*refined);
    out.blur_px = std::clamp(blur_px + out.refined.wider_px, kSharpestPx, kWidestPx);
    if (known_blur_px || std::abs(out.blur_px - blur_px) < kClosePx) break;
    blur_px = out.blur_px;
    pose = out.refined.pose;
  }
  out.accepted = accepted_of(out.refined);
  out.support_px = support_px_of(out.refined);
  out.evenness = evenness_of(out.refined);
  return out;
}

std::optional<Fitted> better(std::optional<Fitted> a, std::optional<Fitted> b) {
  if (!a || !b) return a ? a : b;
  return a->score_px() >= b->score_px() ? a : b;
}

// @param near the scenery blurred by kNearBlurPx.
std::optional<Fitted> fit_from(const Scenery& scenery, const Scenery& near,
                               const data::Pose<>& start) {
  const auto refined = refine(near, start, kNear);
  return refined ? fit_exactly(scenery, refined->pose, refined->outline_px, std::nullopt)
                 : std::nullopt;
}

// How steeply a body must be seen for its face and wall together to look about as long as it is
// wide, as from straight above: R cos t + h sin t = R for t = 2 atan(h / R). Below, one silhouette
// belongs to several attitudes.
double steepest_alike(const data::Body& body) {
  constexpr double kBeyond_rad = 0.1, kNearly_rad = 0.25;
  return std::max(kNearly_rad,
                  kBeyond_rad + 2.0 * std::atan2(body.half_thickness_m(), body.radius_m));
}

// Where several attitudes explain a picture about as well, the one chosen is no better known than
// they are apart.
void spread_over(const data::PoseMotion& motion, const std::vector<Fitted>& others,
                 Fitted& chosen) {
  // From start to start the support of one attitude differs by up to a tenth.
  // Evenness differs by more, and would leave out attitudes that the edges alone do not tell apart.
  constexpr double kAsGood = 0.9;
  Eigen::MatrixXd square = Eigen::MatrixXd::Zero(motion.count(), motion.count());
  double count = 1.0;
  for (const Fitted& other : others) {
    if (other.support_px < kAsGood * chosen.support_px) continue;
    const data::PoseMotion::Step off = motion.step_between(chosen.refined.pose, other.refined.pose);
    square += off * off.transpose();
    count += 1.0;
  }
  chosen.attitudes = square / count;
}

// How well the pose that was chosen is known.
void find_uncertainty(const Scenery& scenery, Fitted& fitted) {
  find_uncertainty(scenery, fitted.refined);
  if (fitted.attitudes.size() == 0) return;
  fitted.refined.solution.common += fitted.attitudes;
  fitted.refined.solution.covariance += fitted.attitudes;
}

// Cosine of the angle at which the near face is seen: 1 from straight above it.
double facing(const data::Camera& camera, const data::Pose<>& pose) {
  return axis_towards(camera, pose).dot(direction_to(camera, pose.centre_m));
}

// Seen nearly face on, the attitude mirrored at the line of sight is so near that a prediction may
// lead to either, and so is the one seen from straight above.
std::optional<Fitted> of_near_tilts(const Scenery& scenery, std::optional<Fitted> fitted) {
  constexpr double kNoticeably = 1.04, kNearly_rad = 0.25;
  if (!fitted || scenery.motion.rotation() < 0 || scenery.motion.pivoted()) return fitted;
  const data::Pose<> pose = fitted->refined.pose;
  const double cosine = facing(scenery.camera, pose);
  if (cosine < std::cos(steepest_alike(scenery.body))) return fitted;
  const double outline_px = fitted->refined.outline_px;
  std::vector<Fitted> others;
  const auto mirror = mirrored(scenery.camera, scenery.motion, pose);
  if (auto other = fit_exactly(scenery, mirror, outline_px, fitted->blur_px)) {
    if (cosine > std::cos(kNearly_rad) && other->score_px() > kNoticeably * fitted->score_px())
      std::swap(*fitted, *other);
    others.push_back(std::move(*other));
  }
  data::Pose<> level = pose;
  level.theta_rad = pose.theta_rad > 0.5 * data::kPi ? data::kPi : 0.0;
  if (auto other = fit_exactly(scenery, scenery.motion.settled(level), outline_px, fitted->blur_px))
    others.push_back(std::move(*other));
  spread_over(scenery.motion, others, *fitted);
  return fitted;
}

double outline_length_px(const Scenery& scenery, const data::Pose<>& pose) {
  constexpr double kStepPx = 8.0;
  double length_px = 0.0;
  for (const OutlineSample& sample :
       outline_samples(scenery.body, pose, scenery.camera, scenery.motion, kStepPx))
    if (sample.silhouette) length_px += sample.arc_px;
  return length_px;
}

// How far the edges of a fit lie from where a pose would put them, rms [px].
double moved_px(const Scenery& scenery, const Refined& refined, const data::Pose<>& from) {
  const data::PoseMotion::Step step = scenery.motion.step_between(from, refined.pose);
  double sum = 0.0;
  for (const OutlineSample& sample : refined.samples) sum += std::pow(sample.motion.dot(step), 2);
  return std::sqrt(sum / std::max<double>(1.0, static_cast<double>(refined.samples.size())));
}

// What was outlined may be the face alone, in the light beside a wall in the shade: the body seems
// too small then, or the edges of its wall are missing. A pose that scores clearly higher, or
// about as high while the body has its size, is the better one, though the outer edges of the wall
// are less clear than those of the face. Seen from aside, wall and face are too different for that.
std::optional<Fitted> with_its_wall(const Scenery& scenery, std::optional<Fitted> fitted) {
  constexpr double kTooSmallPx = 0.35, kClearlyPx = 0.2, kAsGood = 0.85, kBetter = 1.15;
  constexpr double kFewEdges = 1.05, kLeastFacing = 0.75;
  if (!fitted || scenery.motion.rotation() < 0 ||
      facing(scenery.camera, fitted->refined.pose) < kLeastFacing)
    return fitted;
  const double seen_px = larger_px(fitted->refined), outline_px = fitted->refined.outline_px;
  const bool too_small = seen_px < -kTooSmallPx;
  if (!too_small && fitted->support_px > kFewEdges * outline_px) return fitted;
  std::optional<Fitted> best;
  for (const Side side : {Side::same, Side::mirrored}) {
    if (side == Side::mirrored && scenery.motion.pivoted()) break;
    const auto start = face_outlined_like(scenery.body, scenery.camera, scenery.motion,
                                          fitted->refined.pose, side);
    if (!start) continue;
    auto other = fit_exactly(scenery, *start, outline_px, fitted->blur_px);
    if (!other) continue;
    const bool right_size =
        too_small && std::abs(larger_px(other->refined)) < -seen_px - kClearlyPx;
    if (other->score_px() > (right_size ? kAsGood : kBetter) * fitted->score_px() &&
        (!best || other->score_px() > best->score_px()))
      best = std::move(other);
  }
  return best ? std::move(best) : std::move(fitted);
}

// A prediction is mostly right to the blur: looking from farther would only let shadows and the
// body's other edges mislead it. Where it was not, or few edges then bear it out, the wider looks
// have their say.
std::optional<Fitted> fit_from_prediction(const Scenery& scenery, const data::Pose<>& predicted,
                                          std::optional<double> blur_px, bool there) {
  constexpr double kClear = 0.8, kSure = 0.6, kFarPx = 0.8;
  std::optional<Fitted> fitted =
      fit_exactly(scenery, predicted, outline_length_px(scenery, predicted), blur_px);
  if (there) return of_near_tilts(scenery, std::move(fitted));
  if (!fitted || fitted->accepted < kClear ||
      moved_px(scenery, fitted->refined, predicted) > kFarPx) {
    if (const auto drawn = refine(scenery, predicted, kDraw))
      fitted =
          better(std::move(fitted), fit_exactly(scenery, drawn->pose, drawn->outline_px, blur_px));
  }
  if (!fitted || fitted->accepted < kSure)
    fitted = better(std::move(fitted), fit_from(scenery, scenery.blurred(kNearBlurPx), predicted));
  return of_near_tilts(scenery, with_its_wall(scenery, std::move(fitted)));
}

// From afar: each start is drawn towards edges, those that then lie on edges are fitted.
std::optional<Fitted> fit_best(const Scenery& scenery, const std::vector<data::Pose<>>& starts,
                               bool mirrors) {
  constexpr size_t kFitted = 3;
  const Scenery far = scenery.blurred(kFarBlurPx), near = scenery.blurred(kNearBlurPx);
  std::vector<std::optional<Refined>> drawn(starts.size());
  data::in_parallel(starts.size(), 2, [&](size_t i) {
    drawn[i] = refine(far, starts[i], kFar);
    if (drawn[i]) drawn[i] = refine(near, drawn[i]->pose, kNear);
  });
  std::vector<std::pair<double, data::Pose<>>> likely;
  for (const auto& refined : drawn)
    if (refined) likely.emplace_back(accepted_of(*refined), refined->pose);
  std::sort(likely.begin(), likely.end(),
            [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<data::Pose<>> chosen;
  for (size_t i = 0; i < std::min(kFitted, likely.size()); ++i) {
    chosen.push_back(likely[i].second);
    if (mirrors) chosen.push_back(mirrored(scenery.camera, scenery.motion, likely[i].second));
  }
  std::vector<std::optional<Fitted>> fits(chosen.size());
  data::in_parallel(chosen.size(), 2,
                    [&](size_t i) { fits[i] = fit_from(scenery, near, chosen[i]); });
  std::optional<Fitted> best;
  for (auto& fit : fits) best = better(std::move(best), std::move(fit));
  return best;
}

bool believable(const Fitted& fitted) {
  constexpr double kLeastAccepted = 0.25, kLeastCovered = 0.35;  // below, the body is not there
  return fitted.accepted >= kLeastAccepted && fitted.refined.covered >= kLeastCovered &&
         fitted.refined.solution.covariance.allFinite();
}

PoseSpread spread_of(const Scenery& scenery, const data::Pose<>& pose,
                     const Eigen::MatrixXd& step_covariance) {
  PoseSpread spread;
  const Eigen::MatrixXd centre = scenery.motion.velocities(pose).topRows<3>();
  const Eigen::Matrix3d covariance = centre * step_covariance * centre.transpose();
  const Eigen::Matrix<double, 2, 3> J = scenery.camera.jacobian_px_per_m(pose.centre_m);
  spread.m2 = covariance.topLeftCorner<2, 2>();
  spread.px2 = J * covariance * J.transpose();
  spread.theta_rad2 = spread.across_rad2 = std::numeric_limits<double>::infinity();
  if (const int rotation = scenery.motion.rotation(); rotation >= 0) {
    spread.theta_rad2 = step_covariance(rotation, rotation);
    spread.across_rad2 = step_covariance(rotation + 1, rotation + 1);
  }
  return spread;
}

void set_sigmas(const PoseSpread& spread, PoseMeasurement& m) {
  m.covariance_m2 = spread.m2;
  m.covariance_px2 = spread.px2;
  m.sigma_theta_rad = std::sqrt(spread.theta_rad2);
  m.sigma_phi_rad = std::numeric_limits<double>::infinity();
  const double sine = std::sin(m.pose.theta_rad), across = std::sqrt(spread.across_rad2);
  constexpr double kLeastSine = 1e-6;
  // Beyond a radian the direction of the tilt is simply not seen.
  if (across < sine && sine > kLeastSine) m.sigma_phi_rad = across / sine;
}

// Edges that move across are more blurred than those that move along themselves: by regression on
// how far each goes from picture to picture, about their means.
// @param step the body's motion from picture to picture.
ExposureEvidence exposure_evidence(const Refined& refined, const data::PoseMotion::Step& step) {
  constexpr double kScatter_px2 = 0.15;    // of the blur's variance, whatever noise says
  constexpr double kFarthest_px2 = 0.75;   // what is more is not linear
  constexpr double kUniform = 1.0 / 12.0;  // the variance of a smear of length 1
  double weights = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < refined.equations.size(); ++i) {
    const EdgeEquation& e = refined.equations[i];
    const ProfileEdge& edge = refined.edges[i];
    if (e.colour || !refined.samples[i].silhouette || !(edge.beyond_blur2_information > 0.0))
      continue;
    const double smear2_px2 = kUniform * std::pow(refined.samples[i].motion.dot(step), 2);
    const double beyond_px2 = std::clamp(edge.beyond_blur2_px2, -kFarthest_px2, kFarthest_px2);
    const double w = e.weight / (1.0 / edge.beyond_blur2_information + kScatter_px2 * kScatter_px2);
    weights += w, x += w * smear2_px2, y += w * beyond_px2;
    xx += w * smear2_px2 * smear2_px2, xy += w * smear2_px2 * beyond_px2;
  }
  const double information = weights > 0.0 ? xx - x * x / weights : 0.0;
  if (!(information > 0.0)) return {};
  return {(xy - x * y / weights) / information, information};
}

PoseMeasurement measurement_of(const Scenery& scenery, const Fitted& fitted) {
  const Refined& r = fitted.refined;
  PoseMeasurement m;
  m.pose = r.pose;
  m.centre_px = scenery.camera.image_from_table<double>(r.pose.centre_m);
  set_sigmas(spread_of(scenery, r.pose, r.solution.covariance), m);
  m.common = spread_of(scenery, r.pose, r.solution.common);
  m.inflation = r.solution.inflation;
  m.sheared = r.solution.sheared;
  m.polarity_px = r.solution.polarity_px;
  m.rms_px = r.solution.rms_px;
  m.blur_px = fitted.blur_px;
  m.colour_off_px = r.solution.colour_off_px;
  m.colour_information = r.solution.colour_information;
  m.accepted = fitted.accepted;
  m.support_px = fitted.support_px;
  m.evenness = fitted.evenness;
  m.larger_px = larger_px(r);
  ShadingMemory shading;
  for (size_t i = 0; i < r.equations.size(); ++i) {
    const EdgeEquation& e = r.equations[i];
    if (e.weight < 0.5) continue;
    shading.add(r.shading[i]);
    m.edges.push_back({r.samples[i].image_px + e.offset_px * r.samples[i].normal_px,
                       r.samples[i].normal_px, std::sqrt(e.variance_px2), e.residual_px});
  }
  m.shading = std::make_shared<ShadingMemory>(std::move(shading));
  return m;
}

// The other attitude with the same outline: the faces have changed places. Spin is left as it is,
// for marks to tell.
data::Pose<> faces_exchanged(const data::Pose<>& pose) {
  data::Pose<> over = data::turned_over(pose, 0.0);
  over.phi_rad = data::wrapped(over.phi_rad);
  over.psi_rad = pose.psi_rad;
  return over;
}

// What is told by small motions, of the body turned over meanwhile: some of these lead the other
// way then, as the node line does.
// @param from the pose it was found at.
void turn_sheared_over(const data::PoseMotion& motion, const data::Pose<>& from,
                       PoseMeasurement& m) {
  if (m.sheared[0].size() == 0) return;
  const data::PoseMotion::Step ways = motion.velocities(from)
                                          .cwiseProduct(motion.velocities(m.pose))
                                          .colwise()
                                          .sum()
                                          .cwiseSign()
                                          .transpose();
  for (auto& sheared : m.sheared) sheared = sheared.cwiseProduct(ways * ways.transpose()).eval();
}

// Equal faces: of the two attitudes that look the same, the one with theta <= pi/2.
void fold(data::Pose<>& pose) {
  if (pose.theta_rad > 0.5 * data::kPi) pose = faces_exchanged(pose);
}

// Reads the marks; those of the other face show that a prediction had the body the wrong way up.
std::optional<MarkReading> read_marks_of_either_face(const cv::Mat& luma, const data::Body& body,
                                                     const data::Camera& camera,
                                                     data::Pose<>& pose) {
  if (auto marks = read_marks(luma, body, camera, pose)) return marks;
  const data::Pose<> over = faces_exchanged(pose);
  auto marks = read_marks(luma, body, camera, over);
  if (marks) pose = over;
  return marks;
}

// At the moment itself: the chord from one frame to the next has the direction of half a frame off.
// From row to row the centre is not seen a whole frame later, but by the row's more or less.
MotionInReadout motion_in_readout(const data::PoseMotion& motion, const data::Camera& camera,
                                  const OutlineView& view, const data::Pose<>& now) {
  constexpr double kShort = 0.05;  // of the way between both
  const Eigen::Vector2d way_px = camera.image_from_table<double>(now.centre_m) -
                                 camera.image_from_table<double>(view.previous->centre_m);
  const double frames =
      view.side_of_previous *
      std::max(0.5, 1.0 + view.side_of_previous * view.readout_per_px.dot(way_px));
  const PoseChange change(*view.previous, now, PoseChange::kWithin);
  const data::PoseMotion::Step on = -motion.step_between(change.on(now, kShort), now),
                               back = -motion.step_between(change.on(now, -kShort), now);
  return {view.readout_per_px, (on - back) / (2.0 * kShort * frames),
          (on + back) / std::pow(kShort * frames, 2)};
}

// Spin is counted from the node line: what phi is wrong by, psi takes back. An axis that is off
// turns a mark at this distance from it.
double spin_sigma_rad(const PoseMeasurement& m, const MarkReading& marks) {
  const double of_phi =
      std::isfinite(m.sigma_phi_rad) ? std::cos(m.pose.theta_rad) * m.sigma_phi_rad : 0.0;
  const double of_centre =
      std::sqrt(0.5 * m.covariance_px2.trace()) / std::max(marks.radius_px, 1.0);
  constexpr double kShadingPx = 0.15;  // uneven light shifts a mark on its face
  const double of_light = kShadingPx / std::max(marks.radius_px, 1.0);
  return std::sqrt(marks.sigma_rad * marks.sigma_rad + of_phi * of_phi + of_centre * of_centre +
                   of_light * of_light);
}

}  // namespace

void PoseMeasurement::inflate(double better) {
  const double by = better / inflation;
  const auto grown = [by](const auto& whole, const auto& fixed) {
    return by * (whole - fixed) + fixed;
  };
  covariance_m2 = grown(covariance_m2, common.m2);
  covariance_px2 = grown(covariance_px2, common.px2);
  const double theta = sigma_theta_rad;
  if (std::isfinite(theta)) sigma_theta_rad = std::sqrt(grown(theta * theta, common.theta_rad2));
  if (std::isfinite(sigma_phi_rad)) {
    const double sine = std::sin(pose.theta_rad), across = sigma_phi_rad * sine;
    sigma_phi_rad = std::sqrt(grown(across * across, common.across_rad2)) / sine;
  }
  inflation = better;
}

OutlineFitter::OutlineFitter(data::Body body, data::Support support, data::Camera camera,
                             Effort effort)
    : body_(std::move(body)),
      support_(std::move(support)),
      camera_(std::move(camera)),
      most_looks_(most_looks(effort)) {
  if (!(body_.radius_m > 0.0))
    throw InputError(fmt::format(
        "body: radius_m = {} gives no outline to look for; give the radius of the rim in metres",
        body_.radius_m));
  if (support_.kind == data::SupportKind::pivot && !support_.pivot_m)
    throw InputError("support: kind = \"pivot\" needs pivot_m = [x, y, z] in metres");
}

std::optional<PoseMeasurement> OutlineFitter::measure(const OutlineView& view) const {
  const data::PoseMotion motion(body_, support_, camera_);
  const bool alike = body_.faces_look_alike() && support_.kind != data::SupportKind::pivot;
  const std::vector<data::Pose<>> starts =
      view.predicted   ? std::vector{motion.settled(*view.predicted)}
      : view.detection ? starts_from_edges(body_, support_, camera_, motion, view)
                       : std::vector<data::Pose<>>{};
  if (starts.empty()) return std::nullopt;
  const double margin_px = view.predicted ? 12.0 : 24.0;
  cv::Rect window = window_of(body_, camera_, starts.front(), margin_px);
  for (const auto& start : starts) window |= window_of(body_, camera_, start, margin_px);
  ColourWindow colour =
      colour_window(view.luma, view.chroma, window, body_, camera_, starts.front());
  colour.site_px = view.chroma_site_px;
  const bool moving = view.predicted && view.previous;
  const bool in_turn = moving && !view.readout_per_px.isZero();
  const Scenery scenery{
      .body = body_,
      .camera = camera_,
      .motion = motion,
      .picture = LightWindow(view.luma, window, camera_.transfer),
      .plate = view.background.empty() ? LightWindow()
                                       : LightWindow(view.background, window, camera_.transfer),
      .colour = std::move(colour),
      .most_looks = most_looks_,
      .visit = view.visit,
      .smear = moving ? data::PoseMotion::Step(view.exposure_fraction *
                                               motion.step_between(*view.previous, starts.front()))
                      : data::PoseMotion::Step(),
      // Levels that are light mix linearly, whatever their colours.
      .tints = camera_.transfer == data::Transfer::linear
                   ? std::nullopt
                   : tints_of(view.luma, view.chroma, body_, camera_, starts.front()),
      .exposure = moving && view.exposure_fraction > 0.0
                      ? std::optional(
                            ExposureMotion(*view.previous, starts.front(), view.exposure_fraction))
                      : std::nullopt,
      .shading = view.shading,
      .in_readout = in_turn ? motion_in_readout(motion, camera_, view, starts.front())
                            : MotionInReadout{view.readout_per_px, {}, {}}};
  if (scenery.picture.empty()) return std::nullopt;
  // About a pivot the mirrored axis has another centre.
  const bool mirrors = support_.kind != data::SupportKind::pivot && motion.rotation() >= 0;
  auto best = view.predicted
                  ? fit_from_prediction(scenery, starts.front(), view.blur_px, view.there)
                  : fit_best(scenery, starts, mirrors);
  if (!best) return std::nullopt;
  find_uncertainty(scenery, *best);
  if (!believable(*best)) return std::nullopt;
  PoseMeasurement m = measurement_of(scenery, *best);
  m.rows_in_turn = in_turn;
  if (moving)
    m.exposure =
        exposure_evidence(best->refined, motion.step_between(*view.previous, starts.front()));
  // A body on a pin has no end up: its axis is named upwards.
  if (alike || is_on_a_pin(body_, support_, m.pose)) fold(m.pose);
  const bool either = mirrors && !alike && body_.axle_above_m <= 0.0;
  if (const auto marks = either ? read_marks_of_either_face(view.luma, body_, camera_, m.pose)
                                : read_marks(view.luma, body_, camera_, m.pose)) {
    m.pose.psi_rad = marks->psi_rad;
    m.sigma_psi_rad = spin_sigma_rad(m, *marks);
    m.bright_marks = marks->bright;
  }
  turn_sheared_over(motion, best->refined.pose, m);
  return m;
}

}  // namespace trochoid::tracking
