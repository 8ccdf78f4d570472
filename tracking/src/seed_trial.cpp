#include "seed_trial.hpp"

#include <algorithm>
#include <future>

namespace trochoid::tracking {

double trial(const std::vector<Frame>& held, const Background& background, const BodyFinder& finder,
             const Seed& seed) {
  constexpr std::size_t kFrames = 8;  // each way
  constexpr double kUsualRms_px = 0.2;
  double sum = 0.0;
  std::size_t count = 0;
  for (const bool forward : {true, false}) {
    Follower follower(finder, background, nullptr);
    follower.start(held[seed.held_index], seed.seen);
    const std::size_t room = forward ? held.size() - 1 - seed.held_index : seed.held_index;
    for (std::size_t i = 1; i <= std::min(kFrames, room); ++i) {
      const auto seen = follower.follow(held[forward ? seed.held_index + i : seed.held_index - i]);
      // A wrong tilt has edges as many, but they fit it worse.
      if (seen) sum += clarity(*seen) * seen->accepted / (kUsualRms_px + seen->rms_px);
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

Seed better_reading(const std::vector<Frame>& held, const Background& background,
                    const BodyFinder& finder, Seed seed) {
  const Frame& frame = held[seed.held_index];
  Plate plate;
  background.scaled_into(plate, background.gain(frame.luma), cv::Rect({}, frame.luma.size()));
  Look look{.frame = frame, .background = plate};
  auto other = finder.mirrored(look, seed.seen);
  // The same attitude again: seen face on, tilts this way and that are one.
  if (!other || apart_px(*other, seed.seen) < 0.1 * seed.seen.rim.semi_major_px()) return seed;
  const Seed turned{seed.held_index, std::move(*other)};
  auto theirs =
      std::async(std::launch::async, [&] { return trial(held, background, finder, turned); });
  const double ours = trial(held, background, finder, seed);
  return theirs.get() > ours ? turned : seed;
}

void mend_mirrored(const std::vector<Frame>& held, const Background& background,
                   const BodyFinder& finder, std::size_t seed_index, HeldPath& path,
                   std::unique_ptr<Follower>& ahead) {
  constexpr double kFaceOn = 0.95;  // ratio of the axes: within 18 deg of the line of sight
  constexpr std::size_t kShortest = 6;
  const auto tilted = [&](std::size_t i) {
    const auto at = path.find(i);
    return at != path.end() && at->second.pose &&
           at->second.rim.semi_minor_px() < kFaceOn * at->second.rim.semi_major_px();
  };
  for (std::size_t begin = 0; begin < held.size(); ++begin) {
    if (!tilted(begin)) continue;
    std::size_t end = begin;
    while (end < held.size() && tilted(end)) ++end;
    const std::size_t middle = (begin + end) / 2, from = begin;
    begin = end;
    if (end - from < kShortest || (seed_index >= from && seed_index < end)) continue;
    const Sighting now = path.at(middle);
    const Seed seed = better_reading(held, background, finder, {middle, now});
    if (apart_px(seed.seen, now) < 0.1 * now.rim.semi_major_px()) continue;
    path[middle] = seed.seen;
    for (const bool forward : {false, true}) {
      auto follower = std::make_unique<Follower>(finder, background, nullptr);
      follower->start(held[middle], seed.seen);
      const std::size_t steps = forward ? end - 1 - middle : middle - from;
      for (std::size_t k = 1; k <= steps; ++k) {
        const std::size_t i = forward ? middle + k : middle - k;
        path.erase(i);
        if (auto seen = follower->follow(held[i])) path[i] = std::move(*seen);
      }
      if (forward && end == held.size()) ahead = std::move(follower);
    }
  }
}

}  // namespace trochoid::tracking
