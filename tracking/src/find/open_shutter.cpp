#include "find/open_shutter.hpp"

#include <algorithm>
#include <cmath>

#include "trochoid/data/parallel.hpp"

namespace trochoid::tracking {
namespace {

/// Of the squared fraction, over all looks.
struct Estimate {
  double more, sd;  // the latter by how the looks differ
};

Estimate mean_of(const std::vector<ExposureEvidence>& evidence) {
  double weights = 0.0, sum = 0.0, scatter = 0.0;
  for (const ExposureEvidence& e : evidence)
    weights += e.information, sum += e.information * e.more;
  const double mean = sum / weights;
  for (const ExposureEvidence& e : evidence)
    scatter += std::pow(e.information * (e.more - mean), 2);
  return {mean, std::sqrt(scatter) / weights};
}

std::optional<Estimate> evaluate(const BodyFinder& finder, const Background& background,
                                 const std::vector<MovingLook>& looks) {
  constexpr std::size_t kFewest = 8;
  std::vector<ExposureEvidence> all(looks.size());
  data::in_parallel(looks.size(), 2, [&](std::size_t i) {
    const Frame& frame = *looks[i].frame;
    const Plate plate = background.plate_of(frame.luma);
    Look look{.frame = frame, .background = plate};
    look.predicted = looks[i].seen, look.last = looks[i].before;
    look.motion_px = looks[i].seen->centre_px - looks[i].before->centre_px;
    if (const auto seen = finder.find(look); seen && seen->pose) all[i] = seen->pose->exposure;
  });
  std::erase_if(all, [](const ExposureEvidence& e) { return !(e.information > 0.0); });
  if (all.size() < kFewest) return std::nullopt;
  return mean_of(all);
}

}  // namespace

std::optional<double> find_exposure_fraction(
    const std::function<std::unique_ptr<BodyFinder>(double)>& finder_with,
    const Background& background, std::vector<MovingLook> looks) {
  // A tenth of the interval smears what moves by 5 px to half a pixel, which hardly matters. Looks
  // share what the light does to edges: by less than so many of their standard errors, of 25
  // recordings some were told wrong.
  constexpr double kClearly = 5.0, kLeast = 0.1, kSettled = 0.005, kWithin = 0.1;
  constexpr std::size_t kLooks = 16;
  constexpr int kRounds = 9;
  std::stable_sort(looks.begin(), looks.end(), [](const MovingLook& a, const MovingLook& b) {
    return a.seen->pose->exposure.information > b.seen->pose->exposure.information;
  });
  if (looks.size() > kLooks) looks.resize(kLooks);
  struct Tried {
    double square, more;
  };
  Tried less{0.0, 0.0};       // than the right one
  std::optional<Tried> much;  // more than it
  double square = 0.0, stride = 1.0;
  for (int round = 0; round < kRounds; ++round) {
    const auto found = evaluate(*finder_with(std::sqrt(square)), background, looks);
    if (!found) return std::nullopt;
    const bool settled = std::abs(found->more) < kSettled ||
                         (much && much->square - less.square < kSettled) ||
                         (square == 1.0 && found->more > 0.0);
    if (settled)
      return square < std::max(kClearly * found->sd, kLeast * kLeast)
                 ? std::nullopt
                 : std::optional(std::sqrt(square));
    if (square == 0.0 && found->more < 0.0) return std::nullopt;
    (found->more > 0.0 ? less : much.emplace()) = {square, found->more};
    // What is missing is not told to scale, far too little where edges are smeared by several
    // pixels: longer and longer strides lead beyond it, and from there the line between the two.
    square = much ? less.square +
                        (much->square - less.square) *
                            std::clamp(less.more / (less.more - much->more), kWithin, 1.0 - kWithin)
                  : std::min(1.0, square + stride * found->more);
    stride *= 2.0;
  }
  return std::nullopt;
}

}  // namespace trochoid::tracking
