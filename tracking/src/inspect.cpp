#include "trochoid/tracking/inspect.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "find/body_search.hpp"
#include "find/recording.hpp"
#include "link/path_motion.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"
#include "trochoid/tracking/tracker.hpp"

namespace trochoid::tracking {
namespace {

/// Places in the band between two multiples of the rim, those within the picture.
std::vector<cv::Point> places_between(const Ellipse& rim, double from, double to,
                                      const cv::Size& picture) {
  constexpr int kRays = 24, kRings = 4;
  std::vector<cv::Point> places;
  for (int ring = 0; ring < kRings; ++ring)
    for (int ray = 0; ray < kRays; ++ray) {
      const double angle = data::kTurn * ray / kRays, r = from + (to - from) * ring / (kRings - 1);
      const Eigen::Vector2d p =
          rim.centre_px + rim.shape_px * Eigen::Vector2d(r * std::cos(angle), r * std::sin(angle));
      const cv::Point at(static_cast<int>(std::lround(p.x())),
                         static_cast<int>(std::lround(p.y())));
      if (cv::Rect({}, picture).contains(at)) places.push_back(at);
    }
  return places;
}

/// Levels between which the floor around a body mostly lies.
struct LevelRange {
  double least = 0.0, most = 255.0;
  [[nodiscard]] bool hold(double level, double tolerance) const {
    return level > least - tolerance && level < most + tolerance;
  }
};

LevelRange floor_around(const cv::Mat& plate, const Ellipse& rim) {
  constexpr double kFrom = 1.2, kTo = 1.8, kRobust = 0.05;
  std::vector<double> levels;
  for (const cv::Point& at : places_between(rim, kFrom, kTo, plate.size()))
    levels.push_back(plate.at<std::uint8_t>(at));
  if (levels.empty()) return {};
  return {data::quantile(levels, kRobust), data::quantile(levels, 1.0 - kRobust)};
}

double median_level(const cv::Mat& luma, const std::vector<cv::Point>& places) {
  std::vector<double> levels;
  for (const cv::Point& at : places) levels.push_back(luma.at<std::uint8_t>(at));
  return data::quantile(levels, 0.5);
}

/// Share of the body's middle that looks like the floor, of those places that tell: where the floor
/// has the level of the body beside its rim, either may be seen. Nothing if hardly any place tells.
/// A body that turns in place is in the plate itself: there the plate is not like the floor around.
std::optional<double> floor_share(const cv::Mat& luma, const Plate& plate, const Ellipse& rim) {
  constexpr double kFewest = 0.25;  // of all
  const double tolerance = 6.0 + 3.0 * plate.noise_levels;
  const LevelRange around = floor_around(plate.luma, rim);
  const std::vector<cv::Point> body = places_between(rim, 0.88, 0.96, luma.size());
  const std::vector<cv::Point> middle = places_between(rim, 0.1, 0.4, luma.size());
  if (body.empty()) return std::nullopt;
  const double body_level = median_level(luma, body);
  int floor = 0, telling = 0;
  for (const cv::Point& at : middle) {
    const double expected = plate.luma.at<std::uint8_t>(at);
    if (std::abs(expected - body_level) < 2.0 * tolerance) continue;
    ++telling;
    floor += std::abs(luma.at<std::uint8_t>(at) - expected) < tolerance &&
             around.hold(expected, tolerance);
  }
  if (telling == 0 || telling < kFewest * static_cast<double>(middle.size())) return std::nullopt;
  return static_cast<double>(floor) / telling;
}

/// The rims seen in a window of frames, from the seed both ways.
struct Watch {
  std::vector<double> radii, ratios, bore;
  cv::Rect2d box;
  Plate plate;
  BodyPath path;

  void add(const Frame& frame, const Background& background, const Sighting& seen) {
    path.frames[frame.index] = {frame.t_s, seen};
    const Ellipse& rim = seen.rim;
    radii.push_back(rim.semi_major_px());
    ratios.push_back(rim.semi_minor_px() / rim.semi_major_px());
    const cv::Rect2d point(rim.centre_px.x(), rim.centre_px.y(), 1e-9, 1e-9);
    box = radii.size() == 1 ? point : (box | point);
    background.scaled_into(plate, background.gain(frame.luma), cv::Rect({}, frame.luma.size()));
    if (const auto share = floor_share(frame.luma, plate, rim)) bore.push_back(*share);
  }
};

Watch watch(const std::vector<Frame>& held, const Background& background, const BodyFinder& finder,
            const Seed& seed) {
  Watch seen;
  seen.add(held[seed.held_index], background, seed.seen);
  for (const int step : {1, -1}) {
    Follower follower(finder, background, nullptr);
    follower.start(held[seed.held_index], seed.seen);
    for (auto i = static_cast<std::ptrdiff_t>(seed.held_index) + step;
         i >= 0 && i < static_cast<std::ptrdiff_t>(held.size()); i += step) {
      const Frame& frame = held[static_cast<std::size_t>(i)];
      if (const auto next = follower.follow(frame)) seen.add(frame, background, *next);
    }
  }
  return seen;
}

Inspection::Body body_of(const Watch& seen) {
  // The floor seen through a tilted ring is hidden by its wall: the flattest third decides.
  constexpr double kRobust = 0.05, kBore = 0.5;
  return {.radius_px = data::quantile(seen.radii, 1.0 - kRobust),
          .least_axis_ratio = data::quantile(seen.ratios, kRobust),
          .usual_axis_ratio = data::quantile(seen.ratios, 0.5),
          .travel_px = std::hypot(seen.box.width, seen.box.height),
          .bore_shows = !seen.bore.empty() && data::quantile(seen.bore, 2.0 / 3.0) > kBore,
          .frames = static_cast<int>(seen.radii.size())};
}

/// What looks most like a body, unless it hardly moves and one that turns in place explains more.
std::optional<Inspection::Body> most_plainly_moving(const std::vector<Frame>& held,
                                                    const Background& background,
                                                    const BodyFinder& finder) {
  constexpr double kHardly_radii = 0.5;
  const std::vector<Follower::Others> nothing(held.size());
  const auto seed = find_seed(held, background, finder, nothing);
  if (!seed) return std::nullopt;
  Watch seen = watch(held, background, finder, *seed);
  if (travel_in_radii(seen.path) < kHardly_radii)
    if (const auto turning = find_seed_turning(held, background, finder)) {
      Watch other = watch(held, background, finder, *turning);
      if (changes_explained(other.path, background.active()) >
          changes_explained(seen.path, background.active()))
        seen = std::move(other);
    }
  return body_of(seen);
}

}  // namespace

Inspection inspect_video(const std::filesystem::path& path, std::optional<double> frame_rate_hz) {
  SourceOptions how;
  how.frame_rate_hz = frame_rate_hz;
  how.chroma = true;
  Recording recording(path, how, TrackOptions{}.held_bytes);
  const auto finder = make_rim_finder();
  Inspection result;
  // A body may come into view late.
  while (!result.body && recording.advance(0)) {
    const auto& window = recording.window();
    const Background background = Background::from_samples(recording.samples());
    result.restless = background.restless();
    result.body = most_plainly_moving(window, background, *finder);
  }
  result.video = recording.info();
  return result;
}

}  // namespace trochoid::tracking
