#include "find/body_search.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "find/silhouette.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/parallel.hpp"

namespace trochoid::tracking {
namespace {

struct Candidate {
  std::size_t held_index;
  Detection detection;
  double score = 0.0;
};

std::vector<Candidate> collect(const std::vector<Frame>& held, const Background& background,
                               const BodyFinder& finder,
                               const std::vector<Follower::Others>& explained) {
  std::vector<Candidate> candidates;
  Plate plate;
  const std::size_t looks = std::min<std::size_t>(24, held.size());
  for (std::size_t k = 0; k < looks; ++k) {
    const std::size_t index = (2 * k + 1) * held.size() / (2 * looks);
    const Frame& frame = held[index];
    background.scaled_into(plate, background.gain(frame.luma), cv::Rect({}, frame.luma.size()));
    for (const Silhouette& body : find_bodies(frame, plate)) {
      const Detection& d = body.detection;
      const auto& taken = explained[index];
      // Also when the region covers the other body and more: two in contact look like one.
      const Ellipse cover =
          Ellipse::from_axes(d.centre_px, d.semi_major_px, d.semi_minor_px, d.angle_rad);
      const Eigen::Matrix2d to_unit = cover.shape_px.inverse();
      if (std::any_of(taken.begin(), taken.end(), [&](const auto& other) {
            const Eigen::Vector2d off = other.first - d.centre_px;
            return off.norm() < 1.1 * other.second || (to_unit * off).norm() < 1.0;
          }))
        continue;
      const double score = region_score(body, finder);
      if (score > 1e-3) candidates.push_back({index, d, score});
    }
  }
  return candidates;
}

/// A body keeps its size, clutter does not: candidates far from the usual size lose. Small specks
/// are many, so the usual size is the median weighted by area.
void weigh_by_size(std::vector<Candidate>& candidates, std::size_t frames) {
  std::vector<std::pair<double, double>> sizes;  // semi-major axis, area x score
  double total = 0.0;
  for (const Candidate& c : candidates) {
    const double weight = c.detection.area_px2 * c.score;
    sizes.emplace_back(c.detection.semi_major_px, weight);
    total += weight;
  }
  std::sort(sizes.begin(), sizes.end());
  double seen = 0.0, usual = 1.0;
  for (const auto& [size, weight] : sizes) {
    usual = size;
    if ((seen += weight) > 0.5 * total) break;
  }
  for (Candidate& c : candidates) {
    const double ratio = std::log(c.detection.semi_major_px / usual);
    c.score *= std::exp(-ratio * ratio);
    // Near the middle of the held frames following can go both ways at once.
    const double middle = static_cast<double>(c.held_index) / static_cast<double>(frames) - 0.5;
    c.score *= 1.0 - 0.2 * std::abs(middle);
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
}

}  // namespace

double region_score(const Silhouette& body, const BodyFinder& finder) {
  const Detection& d = body.detection;
  const double flatness = d.semi_minor_px / d.semi_major_px;
  double score = body.solidity * std::min(1.0, 4.0 * flatness);
  // A body with its shadow, or two at once, fill the ellipse of their moments badly.
  score *= std::exp(-30.0 * std::pow(1.0 - body.ellipticity, 2));
  if (d.touches_border) score *= 0.3;
  if (d.semi_minor_px < 3.0) score *= 0.3;
  if (const double size = finder.expected_major_px(d.centre_px); size > 0.0) {
    constexpr double kPerspective = 0.15;  // the nearer rim looks larger, a bitten one smaller
    const double off = std::log(d.semi_major_px / size) / kPerspective;
    score *= std::exp(-0.5 * off * off);
  }
  return score;
}

double detection_score(const Sighting& seen) {
  const double score = seen.contrast.face * seen.contrast.outline * seen.accepted;
  return seen.pose ? score : score * 0.5 / (0.3 + seen.rms_px);
}

std::optional<Seed> find_seed(const std::vector<Frame>& held, const Background& background,
                              const BodyFinder& finder,
                              const std::vector<Follower::Others>& explained) {
  std::vector<Candidate> candidates = collect(held, background, finder, explained);
  weigh_by_size(candidates, held.size());
  // One picture may fit a mirrored tilt or a shadow nearly as well as the body: the best of a few
  // counts, unless one is beyond doubt.
  constexpr std::size_t kMostTries = 16;
  constexpr int kEnough = 4;
  if (candidates.size() > kMostTries) candidates.resize(kMostTries);
  const auto tried = [&](std::size_t k) {
    const Frame& frame = held[candidates[k].held_index];
    Plate plate;
    background.scaled_into(plate, background.gain(frame.luma), cv::Rect({}, frame.luma.size()));
    Look look{.frame = frame, .background = plate};
    look.detection = candidates[k].detection;
    return finder.find(look);
  };
  std::optional<Seed> best;
  double best_value = 0.0, best_score = 0.0;
  int good = 0;
  const auto judge = [&](const Candidate& c, const std::optional<Sighting>& seen) {
    if (!seen || seen->accepted < 0.4) return;
    const double score = detection_score(*seen), value = score * std::sqrt(c.score);
    if (value > best_value) {
      best_value = value;
      best = Seed{c.held_index, *seen};
    }
    best_score = std::max(best_score, score);
    if (score > 0.5) ++good;
  };
  // Two at a time, one on each core.
  for (std::size_t k = 0; k < candidates.size() && good < kEnough && best_score <= 0.85; k += 2) {
    std::array<std::optional<Sighting>, 2> seen;
    const std::size_t count = std::min(seen.size(), candidates.size() - k);
    data::in_parallel(count, 2, [&](std::size_t i) { seen[i] = tried(k + i); });
    for (std::size_t i = 0; i < count; ++i) judge(candidates[k + i], seen[i]);
  }
  return best;
}

namespace {

Detection rim_around(const Eigen::Vector2d& at_px, double semi_major_px, double semi_minor_px) {
  Detection rim;
  rim.centre_px = at_px;
  rim.semi_major_px = semi_major_px, rim.semi_minor_px = semi_minor_px;
  rim.box = cv::Rect(static_cast<int>(at_px.x() - semi_major_px),
                     static_cast<int>(at_px.y() - semi_minor_px),
                     static_cast<int>(2 * semi_major_px), static_cast<int>(2 * semi_minor_px));
  rim.area_px2 = data::kPi * semi_major_px * semi_minor_px;
  return rim;
}

/// For a choice between rims around a point, 0..1: how much of a rim is there, how closely it is an
/// ellipse for its size - a scrap of an edge passes for a very flat one - and how near its middle
/// the point is.
/// @param off from its middle (0) to the rim (1)
double rim_score(const Sighting& seen, double off) {
  constexpr double kExactPx = 0.1, kPerSize = 0.02, kFlattest = 0.3;
  const double minor = seen.rim.semi_minor_px();
  const double flat = std::min(1.0, minor / (kFlattest * seen.rim.semi_major_px()));
  const double there = std::max(seen.accepted, seen.contrast.outline);
  const double rough = seen.rms_px / (kExactPx + kPerSize * minor);
  return (1.0 - 0.5 * off) * flat * there * there / (1.0 + rough * rough);
}

std::optional<Seed> seed_about(const std::vector<Frame>& held, std::size_t index,
                               const Background& background, const BodyFinder& finder,
                               const Eigen::Vector2d& at_px) {
  const Frame& frame = held[index];
  Plate plate;
  background.scaled_into(plate, background.gain(frame.luma), cv::Rect({}, frame.luma.size()));
  Look look{.frame = frame, .background = plate};
  std::vector<Detection> guesses;
  for (const Silhouette& body : find_silhouettes(frame, plate))
    if (body.detection.box.contains(
            cv::Point(static_cast<int>(at_px.x()), static_cast<int>(at_px.y()))))
      guesses.push_back(body.detection);
  const double largest = 0.5 * std::min(frame.luma.rows, frame.luma.cols);
  // Round, and flat as an oblique camera sees it.
  for (const double flat : {1.0, 0.7, 0.45})
    for (double radius = 6.0; radius < largest; radius *= 1.3)
      guesses.push_back(rim_around(at_px, radius, flat * radius));
  std::vector<std::pair<double, Sighting>> seen_there;
  double best = 0.0;
  for (const Detection& guess : guesses) {
    look.detection = guess;
    auto seen = finder.find(look);
    if (!seen || seen->accepted < 0.4) continue;
    const double off = (seen->rim.shape_px.inverse() * (at_px - seen->centre_px)).norm();
    if (off > 1.1) continue;
    const double value = seen->pose ? seen->accepted / (0.5 + seen->rms_px) : rim_score(*seen, off);
    best = std::max(best, value);
    seen_there.emplace_back(value, std::move(*seen));
  }
  // Of rims about as good the nearest around the point: one who wants the outer of two points
  // between them.
  constexpr double kAboutAsGood = 0.75, kSameSize = 1.1;
  const auto good = [best](double value, const Sighting& seen) {
    return value >= (seen.pose ? best : kAboutAsGood * best);
  };
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [value, seen] : seen_there)
    if (good(value, seen)) least = std::min(least, seen.rim.semi_minor_px());
  const Sighting* chosen = nullptr;
  double most = 0.0;
  for (const auto& [value, seen] : seen_there)
    if (good(value, seen) && value > most && seen.rim.semi_minor_px() <= kSameSize * least)
      chosen = &seen, most = value;
  return chosen != nullptr ? std::optional(Seed{index, *chosen}) : std::nullopt;
}

}  // namespace

std::optional<Seed> find_seed_at(const std::vector<Frame>& held, const Background& background,
                                 const BodyFinder& finder, const Eigen::Vector2d& at_px) {
  return seed_about(held, 0, background, finder, at_px);
}

std::optional<Seed> find_seed_turning(const std::vector<Frame>& held, const Background& background,
                                      const BodyFinder& finder) {
  std::vector<std::vector<cv::Point>> regions;
  cv::Mat closed;
  cv::morphologyEx(background.active(), closed, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  cv::findContours(closed, regions, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  if (regions.empty()) return std::nullopt;
  const auto largest = std::max_element(
      regions.begin(), regions.end(),
      [](const auto& a, const auto& b) { return cv::contourArea(a) < cv::contourArea(b); });
  const cv::Moments m = cv::moments(*largest);
  if (m.m00 < 100.0) return std::nullopt;
  return seed_about(held, held.size() / 2, background, finder, {m.m10 / m.m00, m.m01 / m.m00});
}

}  // namespace trochoid::tracking
