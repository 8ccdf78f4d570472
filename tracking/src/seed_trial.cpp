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

}  // namespace trochoid::tracking
