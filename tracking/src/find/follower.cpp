#include "find/follower.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "find/body_search.hpp"
#include "find/silhouette.hpp"
#include "find/usual_frames.hpp"
#include "geometry/pose_change.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/parallel.hpp"

namespace trochoid::tracking {
namespace {

constexpr double kLongAway = 3.0;  // usual frames; then where and how it was says little
constexpr double kWeak = 0.5;      // relative support that something in its place has, too

cv::Rect box_around(const Eigen::Vector2d& centre_px, double half_px, const cv::Size& picture) {
  const cv::Rect box(static_cast<int>(centre_px.x() - half_px),
                     static_cast<int>(centre_px.y() - half_px), static_cast<int>(2 * half_px) + 1,
                     static_cast<int>(2 * half_px) + 1);
  return box & cv::Rect({}, picture);
}

bool inside(const Eigen::Vector2d& p, const cv::Size& picture, double margin_px) {
  return p.x() > -margin_px && p.y() > -margin_px && p.x() < picture.width + margin_px &&
         p.y() < picture.height + margin_px;
}

bool is_other(const Eigen::Vector2d& centre_px, const Follower::Others& others) {
  return std::any_of(others.begin(), others.end(), [&](const auto& other) {
    return (centre_px - other.first).norm() < 0.8 * other.second;
  });
}

// What the angle of a mark is wrong by because it is read about the middle of the rim: a rim is cut
// round what turns to about a hundredth of its radius, and is measured to so much. Of two opposite
// marks one goes forward where the other goes back.
double centring_rad(const Sighting& seen, const SpinProfile& marks) {
  constexpr double kEccentric = 0.01, kMarkRadius = 0.7;  // of the radius of the rim
  if (marks.two_fold()) return 0.0;
  const double radius_px = std::max(1.0, seen.rim.semi_major_px());
  return std::hypot(kEccentric, std::sqrt(0.5 * seen.covariance_px2.trace()) / radius_px) /
         kMarkRadius;
}

}  // namespace

Follower::Follower(const BodyFinder& finder, const Background& background,
                   std::shared_ptr<const SpinProfile> marks)
    : finder_(finder), background_(background), marks_(std::move(marks)), forecast_(finder) {}

void Follower::start(const Frame& frame, const Sighting& seen) {
  forecast_.start(frame.t_s, seen);
  usual_major_px_ = seen.rim.semi_major_px();
  usual_accepted_ = seen.accepted;
  usual_contrast_ = seen.contrast;
  seed_score_ = detection_score(seen);
  usual_support_px_ = seen.pose ? seen.pose->support_px : 0.0;
  mean_shape_px_ = seen.rim.shape_px;
  shape_scatter_px_ = 1.0;
  palette_ = {};
  palette_.learn(seen.contrast.colours, background_.gain(frame.luma));
  last_s_ = frame.t_s;
  lost_ = 0;
  away_ = off_colour_ = weak_ = 0.0;
}

void Follower::resume(const std::vector<std::pair<double, Sighting>>& seen,
                      const std::vector<double>& frames_s) {
  if (seen.empty()) return;
  forecast_.start(seen.front().first, seen.front().second);
  for (std::size_t i = 1; i < seen.size(); ++i) forecast_.add(seen[i].first, seen[i].second, true);
  int lost = 0;
  double away = 0.0;
  for (std::size_t i = frames_s.size(); i-- > 0 && frames_s[i] > seen.back().first;) {
    ++lost;
    away += i > 0 ? usual_frames(frames_s[i] - frames_s[i - 1]) : 0.0;
  }
  // Seen before all of these: what it knows of that stands.
  const bool beyond = lost > 0 && static_cast<std::size_t>(lost) == frames_s.size();
  lost_ = beyond ? std::max(lost_, lost) : lost;
  away_ = beyond ? std::max(away_, away) : away;
}

/// Contrast of a sighting over what is usual for this body here, of face or outline, whichever is
/// less: >= 0, about 1 when all of it is seen.
double Follower::relative_contrast(const Sighting& seen) const {
  constexpr double kLeastUsual = 0.05;
  const double cover = seen.contrast.face / std::max(usual_contrast_.face, kLeastUsual);
  const double edges = seen.contrast.outline / std::max(usual_contrast_.outline, kLeastUsual);
  // Where the background knows nothing of the body (it never left), neither says anything.
  if (usual_contrast_.face < 0.3) return edges;
  return std::min(cover, edges);
}

/// Sighting::visible_support_px over what is usual for this body here: >= 0, about 1 when all of it
/// is seen, far less for what hides it. Of accepted edges alone without a pose.
double Follower::relative_support(const Sighting& seen) const {
  constexpr double kLeastUsual = 1e-6;
  const double of_outline = seen.accepted / std::max(usual_accepted_, kLeastUsual);
  return seen.pose ? of_outline * seen.pose->support_px / std::max(usual_support_px_, kLeastUsual)
                   : of_outline;
}

/// A partly hidden body and a fit gone astray have about the same contrast; what tells them apart
/// is that the hidden body is where it was expected. What has other colours is the body only where
/// its outline has strong support, or for a few frames where it was expected: not what hides it.
/// Nor is a body that was lost found again in what has weak support.
bool Follower::plausible(const Sighting& seen, const Sighting& predicted, double reach_px) const {
  constexpr double kFull = 0.75, kLeast = 0.35;  // of the usual contrast
  if (seen.accepted < std::max(0.25, 0.4 * usual_accepted_)) return false;
  const double ratio = seen.rim.semi_major_px() / usual_major_px_;
  if (ratio < 0.7 || ratio > 1.4) return false;
  if ((seen.centre_px - predicted.centre_px).norm() > reach_px) return false;
  constexpr double kMostOffColour = 2.5;  // a glint passes, a hand stays
  constexpr double kStrong = 0.7;
  const double support = relative_support(seen);
  const bool off_colour = support < kStrong && !palette_.fits(seen.contrast.colours, gain_);
  if (off_colour && (lost_ > 0 || off_colour_ > kMostOffColour)) return false;
  const bool may_be_occluder = off_colour || (lost_ > 0 && support < kWeak);
  const double contrast =
      may_be_occluder ? std::min(kLeast, relative_contrast(seen)) : relative_contrast(seen);
  const double surprise = forecast_.surprise_px();
  const double far = reach_px + 0.15 * usual_major_px_ + 3.0 * surprise;
  if (contrast >= kFull) return away_ > kLongAway || apart_px(seen, predicted) < far;
  const double near = 1.5 + 0.02 * usual_major_px_ + 1.5 * surprise + 0.3 * away_;
  return contrast >= kLeast && apart_px(seen, predicted) < near;
}

/// A body that lies flat keeps its outline: when the shapes seen hardly scatter, their mean is
/// known far better than one frame tells, and partly hidden or touching bodies are measured with
/// it.
void Follower::set_shape_knowledge(Look& look, Sighting& guess) const {
  const double size = guess.rim.semi_major_px();
  if (shape_scatter_px_ < 0.1 + 0.005 * size) {
    guess.rim.shape_px = mean_shape_px_;
    look.shape_sigma_px = std::max(0.02, 0.3 * shape_scatter_px_);
  } else {
    look.shape_sigma_px = std::clamp(1.5 * shape_surprise_px_, 0.06 + 0.002 * size, 0.3 * size);
  }
}

/// @param plate room for the background near the body.
std::optional<Sighting> Follower::look_at(const Frame& frame, const Sighting& expected,
                                          double reach_px, Plate& plate) const {
  Sighting guess = expected;
  const double size = guess.rim.semi_major_px();
  const cv::Rect box = box_around(guess.centre_px, 1.6 * finder_.reach_px(guess) + reach_px + 12.0,
                                  frame.luma.size());
  if (box.width < 8 || box.height < 8) return std::nullopt;
  background_.scaled_into(plate, gain_, box);
  Look look{.frame = frame, .background = plate};
  look.predicted = &guess;
  look.reach_px = reach_px;
  set_shape_knowledge(look, guess);
  if (lost_ == 0) look.last = &forecast_.last();
  look.side_of_last = forecast_.side_of_last(frame.t_s);
  look.motion_px = guess.centre_px - forecast_.last().centre_px;
  auto seen = finder_.find(look);
  if (!seen || !plausible(*seen, guess, reach_px + 0.3 * size)) return std::nullopt;
  return seen;
}

/// The body turns so fast that predictions of its attitude mean little, or this one has far less
/// support than usual.
bool Follower::warrants_wider_search(const Sighting& seen) const {
  constexpr double kFast = 0.15, kLittle = 0.7;
  if (!seen.pose) return false;
  return forecast_.surprise_px() > kFast * usual_major_px_ ||
         seen.pose->support_px < kLittle * usual_support_px_;
}

/// Where it should be if it goes on as before; if little of it is seen there, also where it would
/// be had it gone on otherwise or been slowed by half (an impact), and the best of these counts.
std::optional<Sighting> Follower::look_near(const Frame& frame, const Sighting& predicted,
                                            const Others& others) {
  constexpr double kFull = 0.85;
  const double largest = std::max(4.0, 0.6 * predicted.rim.semi_minor_px());
  const double reach = std::clamp(2.0 + 3.0 * forecast_.surprise_px() + away_, 2.5, largest);
  std::optional<Sighting> best = look_at(frame, predicted, reach, plate_);
  if (best && is_other(best->centre_px, others)) best.reset();
  if (best && relative_contrast(*best) > kFull && best->accepted > 0.8 * usual_accepted_)
    return best;
  // What no guess led to in as many frames, none will: the rest is left to look_about.
  constexpr int kMostGuessed = 2;
  if (lost_ > kMostGuessed) return best;
  std::vector<Sighting> guesses = forecast_.alternatives(frame.t_s);
  Sighting slowed = predicted;
  slowed.rim.centre_px = slowed.centre_px =
      0.5 * (forecast_.last().centre_px + predicted.centre_px);
  if (!predicted.pose && apart_px(slowed, predicted) > 1.0) guesses.push_back(slowed);
  const auto score = [&](const Sighting& s) {
    return s.accepted * std::min(1.0, relative_contrast(s));
  };
  // Frames come one after the other: what there is to do at once is within one.
  std::vector<std::optional<Sighting>> found(guesses.size());
  guessed_plates_.resize(std::max(guessed_plates_.size(), guesses.size()));
  data::in_parallel(guesses.size(), 0, [&](std::size_t k) {
    found[k] = look_at(frame, guesses[k], std::max(reach, 0.3 * guesses[k].rim.semi_minor_px()),
                       guessed_plates_[k]);
  });
  for (auto& seen : found)
    if (seen && !is_other(seen->centre_px, others) && (!best || score(*seen) > score(*best) + 0.05))
      best = std::move(seen);
  return best;
}

/// A body found without a prediction was taken for still while the shutter was open. What turns
/// fast is seen for what it is, and where it is, only by one who allows for its motion.
Sighting Follower::as_it_moves(const Frame& frame, const Sighting& found) const {
  const auto earlier = forecast_.one_frame_before(found);
  if (!earlier) return found;
  Look look{.frame = frame, .background = plate_};
  look.predicted = &found;
  look.last = &*earlier;
  look.side_of_last = forecast_.side_of_last(frame.t_s);
  look.motion_px = found.centre_px - earlier->centre_px;
  auto again = finder_.find(look);
  return again && again->visible_support_px() > found.visible_support_px() ? *again : found;
}

/// How far from its prediction the body may be: the longer it has been lost, the farther, after a
/// while anywhere. What has had weak support for as long may be what hides it, left behind in its
/// place.
double Follower::farthest_px(const Sighting& predicted) const {
  constexpr double kAnywhere = 30.0;
  // Of a body seen once the speed is not known; one that rolls goes its size in a frame or two.
  constexpr double kUnknown = 2.0;
  const double size = usual_major_px_, astray = std::max(away_, weak_);
  if (astray > kAnywhere) return std::numeric_limits<double>::infinity();
  if (!forecast_.knows_speed()) return kUnknown * size * (1.0 + astray);
  const double went = (predicted.centre_px - forecast_.last().centre_px).norm();
  return 0.5 * size + 0.5 * went + 0.25 * size * astray;
}

/// The regions that look most like the body, best first: by their shape, size and colours.
std::vector<Detection> Follower::regions_about(const Frame& frame, const Sighting& predicted,
                                               double farthest_px, const cv::Rect& box,
                                               const Others& others) const {
  constexpr double kInItsColours = 2.0;
  constexpr std::size_t kMostTries = 3;
  const double size = usual_major_px_;
  std::vector<std::pair<double, Detection>> scored;
  const auto consider = [&](const Silhouette& body, double favour) {
    const Detection& d = body.detection;
    if (d.semi_major_px < 0.6 * size || d.semi_major_px > 2.0 * size) return;
    if ((d.centre_px - predicted.centre_px).norm() > farthest_px || is_other(d.centre_px, others))
      return;
    const double off = std::log(d.semi_major_px / size) / 0.2;
    scored.emplace_back(favour * region_score(body, finder_) * std::exp(-0.5 * off * off), d);
  };
  for (const Silhouette& body : find_bodies(frame, plate_, box)) consider(body, 1.0);
  for (const Silhouette& body : find_coloured_like(palette_, gain_, frame, plate_, box))
    consider(body, kInItsColours);
  std::sort(scored.begin(), scored.end(),
            [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<Detection> best;
  for (std::size_t k = 0; k < std::min(scored.size(), kMostTries); ++k)
    best.push_back(std::move(scored[k].second));
  return best;
}

/// Whether enough is seen of a body found without a prediction, compared with what is usual.
bool Follower::seen_well(const Sighting& seen) const {
  constexpr double kLeastSupport = 0.55, kLeastContrast = 0.75, kOfSeed = 0.5;
  return seen.accepted >= std::min(0.5, 0.7 * usual_accepted_) &&
         detection_score(seen) >= kOfSeed * seed_score_ &&
         (!seen.pose || seen.pose->support_px >= kLeastSupport * usual_support_px_) &&
         relative_contrast(seen) >= kLeastContrast;
}

/// The best of what looks like the body about where it should be.
std::optional<Sighting> Follower::look_about(const Frame& frame, const Sighting& predicted,
                                             const Others& others) {
  constexpr double kBeside = 2.2;  // of its size: all of a body that is just within reach
  const double farthest = farthest_px(predicted);
  const cv::Rect box = std::isinf(farthest)
                           ? cv::Rect({}, frame.luma.size())
                           : box_around(predicted.centre_px, farthest + kBeside * usual_major_px_,
                                        frame.luma.size());
  if (box.width < 8 || box.height < 8) return std::nullopt;
  background_.scaled_into(plate_, gain_, box);
  const std::vector<Detection> regions = regions_about(frame, predicted, farthest, box, others);
  std::vector<std::optional<Sighting>> found(regions.size());
  data::in_parallel(regions.size(), 0, [&](std::size_t k) {
    Look look{.frame = frame, .background = plate_};
    look.detection = regions[k];
    found[k] = finder_.find(look);
    if (found[k]) found[k] = as_it_moves(frame, *found[k]);
  });
  std::optional<Sighting> best;
  for (auto& seen : found) {
    if (!seen || !seen_well(*seen) || !plausible(*seen, predicted, farthest) ||
        is_other(seen->centre_px, others))
      continue;
    if (!best || detection_score(*seen) > detection_score(*best)) best = std::move(seen);
  }
  return best;
}

void Follower::read_marks(const Frame& frame, Sighting& seen, double predicted_rad) const {
  if (!marks_) return;
  const double window = away_ > kLongAway ? data::kPi : 0.6;
  if (const auto turned = marks_->read(frame.luma, seen.rim, predicted_rad, window)) {
    seen.turned_rad = turned->angle_rad;
    seen.turned_sigma_rad = std::hypot(turned->sigma_rad, centring_rad(seen, *marks_));
  }
}

/// Learns what the body usually looks like from a sighting of it in full view.
void Follower::learn_usual(const Sighting& seen, const Sighting& predicted) {
  constexpr double kLearn = 0.1;
  const double shape_off = (seen.rim.shape_px - predicted.rim.shape_px).norm();
  palette_.learn(seen.contrast.colours, gain_);
  if (lost_ == 0)
    shape_surprise_px_ = std::max(0.5 * shape_off, 0.9 * shape_surprise_px_ + 0.1 * shape_off);
  usual_major_px_ += kLearn * (seen.rim.semi_major_px() - usual_major_px_);
  usual_accepted_ += kLearn * (seen.accepted - usual_accepted_);
  if (seen.pose) usual_support_px_ += kLearn * (seen.pose->support_px - usual_support_px_);
  usual_contrast_.face += kLearn * (seen.contrast.face - usual_contrast_.face);
  usual_contrast_.outline += kLearn * (seen.contrast.outline - usual_contrast_.outline);
  const double off = (seen.rim.shape_px - mean_shape_px_).norm();
  shape_scatter_px_ += kLearn * (off - shape_scatter_px_);
  mean_shape_px_ += kLearn * (seen.rim.shape_px - mean_shape_px_);
}

/// Goes on from a sighting.
/// @param passed usual_frames since the frame before.
void Follower::accept(const Frame& frame, Sighting& seen, const Sighting& predicted,
                      double passed) {
  const bool in_full_view = relative_contrast(seen) > 0.8 && seen.accepted > 0.75 * usual_accepted_;
  off_colour_ = palette_.fits(seen.contrast.colours, gain_) ? 0.0 : off_colour_ + passed;
  weak_ = std::max(0.0, weak_ + (relative_support(seen) < kWeak ? passed : -2.0 * passed));
  if (in_full_view) learn_usual(seen, predicted);
  Sighting kept = seen;
  if (!kept.turned_rad) kept.turned_rad = predicted.turned_rad;
  forecast_.add(frame.t_s, kept, in_full_view);
  lost_ = 0;
  away_ = 0.0;
}

/// Where no sighting is good enough to go on from, or a better one may be elsewhere. A search costs
/// as much as many looks: what keeps finding nothing is made more rarely, in frames, so that one is
/// made at most so many frames late.
std::optional<Sighting> Follower::search(const Frame& frame, const Sighting& predicted,
                                         const Others& others, std::optional<Sighting> seen) {
  if (!seen) {
    constexpr int kAwhile = 12, kEvery = 3;
    return lost_ < kAwhile || lost_ % kEvery == 0 ? look_about(frame, predicted, others)
                                                  : std::nullopt;
  }
  if (!warrants_wider_search(*seen) || --patience_ > 0) return seen;
  constexpr double kClearlyMore = 1.05;
  constexpr int kLongest = 16;
  auto anywhere = look_about(frame, predicted, others);
  const bool helps = anywhere && anywhere->pose &&
                     anywhere->pose->support_px > kClearlyMore * seen->pose->support_px;
  futile_ = helps ? 0 : std::min(kLongest, 2 * futile_ + 1);
  patience_ = futile_;
  return helps ? std::move(anywhere) : std::move(seen);
}

std::optional<Sighting> Follower::follow(const Frame& frame, const Others& others) {
  gain_ = background_.gain(frame.luma);
  const double passed = usual_frames(std::abs(frame.t_s - std::exchange(last_s_, frame.t_s)));
  const Sighting predicted = forecast_.at(frame.t_s);
  std::optional<Sighting> seen;
  if (inside(predicted.centre_px, frame.luma.size(), 0.5 * usual_major_px_))
    seen = look_near(frame, predicted, others);
  seen = search(frame, predicted, others, std::move(seen));
  if (!seen) {
    ++lost_;
    away_ += passed;
    return std::nullopt;
  }
  if (seen->pose && predicted.pose && finder_.faces_look_alike())
    seen->pose->pose = nearer_face(seen->pose->pose, predicted.pose->pose, finder_.mark_rad());
  read_marks(frame, *seen, predicted.turned_rad.value_or(0.0));
  accept(frame, *seen, predicted, passed);
  return seen;
}

}  // namespace trochoid::tracking
