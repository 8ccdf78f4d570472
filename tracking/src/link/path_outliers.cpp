#include "link/path_outliers.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "find/usual_frames.hpp"
#include "trochoid/data/interpolate.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

/// Ways to tell where the centre was from other frames.
enum Way : std::size_t { kFromBefore, kFromAfter, kFromBoth, kWays };

struct Place {
  Eigen::Vector2d px = Eigen::Vector2d::Zero(), m = Eigen::Vector2d::Zero();
};

class Path {
 public:
  explicit Path(const std::vector<Glimpse>& glimpses) : glimpses_(glimpses) {
    for (std::size_t i = 0; i < glimpses.size(); ++i)
      if (glimpses[i].posed()) posed_.push_back(i);
    std::array<std::vector<double>, kWays> bends;
    for (std::size_t k = 0; k < posed_.size(); ++k)
      for (std::size_t way = 0; way < kWays; ++way)
        if (const auto place = expected(k, static_cast<Way>(way)))
          bends[way].push_back((place->px - seen(k).centre_px).norm());
    constexpr double kLeastPx = 0.02;
    for (std::size_t way = 0; way < kWays; ++way)
      usual_px_[way] = bends[way].empty() ? 0.0 : std::max(kLeastPx, data::median(bends[way]));
  }

  /// Frames off the path, the farthest first, and where the path was. Those taken out no longer
  /// count for others.
  [[nodiscard]] std::vector<std::pair<std::size_t, Place>> take_out() {
    constexpr double kFar = 6.0, kMostShare = 0.25;
    std::vector<std::pair<std::size_t, Place>> out;
    const auto most = static_cast<std::size_t>(kMostShare * static_cast<double>(posed_.size()));
    while (out.size() < most) {
      double farthest = kFar;
      std::optional<std::pair<std::size_t, Place>> worst;
      for (std::size_t k = 0; k < posed_.size(); ++k)
        if (auto [off, place] = off_path(k); off > farthest) farthest = off, worst = {k, place};
      if (!worst) break;
      out.emplace_back(posed_[worst->first], worst->second);
      posed_.erase(posed_.begin() + static_cast<std::ptrdiff_t>(worst->first));
    }
    return out;
  }

 private:
  [[nodiscard]] const Sighting& seen(std::size_t k) const { return *glimpses_[posed_[k]].seen; }

  /// How far off, over what is usual and known, and where the path was: the way that is
  /// contradicted least counts; those that lead beyond where they come from are contradicted sooner
  /// than that between both sides. Zero where too few frames are near.
  [[nodiscard]] std::pair<double, Place> off_path(std::size_t k) const {
    constexpr std::array<double, kWays> kSooner{2.5, 2.5, 1.0};
    const double known_px = std::sqrt(0.5 * seen(k).covariance_px2.trace());
    std::pair<double, Place> least{0.0, {}};
    bool any = false;
    for (std::size_t way = 0; way < kWays; ++way) {
      const auto place = expected(k, static_cast<Way>(way));
      if (!place) continue;
      const double off =
          kSooner[way] * (place->px - seen(k).centre_px).norm() / (usual_px_[way] + known_px);
      if (!std::isfinite(off)) continue;
      if (!any || off < least.first) least = {off, *place};
      any = true;
    }
    return least;
  }

  /// Where three frames before or after, or two on either side, lead; nothing if there are none so
  /// near.
  [[nodiscard]] std::optional<Place> expected(std::size_t k, Way way) const {
    constexpr std::ptrdiff_t kMostFrames = 4;  // farther on their noise leads anywhere
    static constexpr std::array<std::array<std::ptrdiff_t, 4>, kWays> kSteps{
        {{-3, -2, -1, 0}, {1, 2, 3, 0}, {-2, -1, 1, 2}}};
    std::vector<double> times;
    std::vector<Eigen::Vector2d> px, m;
    for (const std::ptrdiff_t step : kSteps[way]) {
      if (step == 0) continue;
      const auto l = static_cast<std::ptrdiff_t>(k) + step;
      if (l < 0 || l >= static_cast<std::ptrdiff_t>(posed_.size())) return std::nullopt;
      const auto at = posed_[static_cast<std::size_t>(l)];
      if (std::abs(static_cast<std::ptrdiff_t>(at) - static_cast<std::ptrdiff_t>(posed_[k])) >
          kMostFrames)
        return std::nullopt;
      times.push_back(glimpses_[at].frame->t_s);
      px.push_back(glimpses_[at].seen->centre_px);
      m.emplace_back(glimpses_[at].pose().centre_m.head<2>());
    }
    const double t_s = glimpses_[posed_[k]].frame->t_s;
    return Place{data::polynomial_at<Eigen::Vector2d>(times, px, t_s),
                 data::polynomial_at<Eigen::Vector2d>(times, m, t_s)};
  }

  const std::vector<Glimpse>& glimpses_;
  std::vector<std::size_t> posed_;  ///< frames that count
  std::array<double, kWays> usual_px_{};
};

// Posed frames without a gap or a jump between them.
struct Run {
  std::vector<std::size_t> frames;
  double accepted = 0.0;  // median
  bool torn = false;      // the path jumps at one of its ends
};

// How long a run lasts [usual_frames]: in a fast recording what hides a body is taken for it in
// more frames, and none of them confirms another.
double length_of(const Run& run, const std::vector<Glimpse>& glimpses) {
  const auto frames = static_cast<double>(run.frames.size());
  const double span_s =
      glimpses[run.frames.back()].frame->t_s - glimpses[run.frames.front()].frame->t_s;
  return frames > 1.0 ? frames * usual_frames(span_s / (frames - 1.0)) : 1.0;
}

// Whether the centre goes farther from one posed frame to the next than the path on either side
// leads, by so much of the body's size that no impact does it.
bool jumps(const std::vector<Glimpse>& glimpses, std::size_t from, std::size_t to) {
  constexpr double kOfRadius = 0.3;
  const auto centre = [&](std::size_t i) { return glimpses[i].seen->centre_px; };
  const auto steps = static_cast<double>(to - from);
  // At the speed of the frame beyond, if that was seen.
  const auto beside = [&](std::size_t i, std::ptrdiff_t step) -> Eigen::Vector2d {
    const auto k = static_cast<std::ptrdiff_t>(i) + step;
    if (k < 0 || k >= std::ssize(glimpses) || !glimpses[static_cast<std::size_t>(k)].posed())
      return Eigen::Vector2d::Zero();
    return centre(i) - centre(static_cast<std::size_t>(k));
  };
  const double reach_px = kOfRadius * steps * glimpses[from].seen->rim.semi_major_px();
  const Eigen::Vector2d ahead = centre(from) + steps * beside(from, -1);
  const Eigen::Vector2d back = centre(to) + steps * beside(to, 1);
  return (centre(to) - ahead).norm() > reach_px && (centre(from) - back).norm() > reach_px;
}

std::vector<Run> runs_of(const std::vector<Glimpse>& glimpses) {
  std::vector<Run> runs;
  std::vector<double> accepted;
  std::optional<std::size_t> last;
  const auto close = [&] {
    if (!accepted.empty()) runs.back().accepted = data::median(std::exchange(accepted, {}));
  };
  for (std::size_t i = 0; i < glimpses.size(); ++i) {
    if (!glimpses[i].posed()) continue;
    const bool jump = last && jumps(glimpses, *last, i);
    if (jump) runs.back().torn = true;
    if (!last || jump || i > *last + 1) {
      close();
      runs.emplace_back();
      runs.back().torn = jump;
    }
    runs.back().frames.push_back(i);
    accepted.push_back(glimpses[i].seen->accepted);
    last = i;
  }
  close();
  return runs;
}

// A sighting may as well be at another place: its covariance then holds both.
void doubt_place(const Place& place, Sighting& seen) {
  const Eigen::Vector2d px = place.px - seen.centre_px;
  // A fit that went astray did so in all it says.
  doubt_attitude(px, place.m - seen.pose->pose.centre_m.head<2>(),
                 px.norm() / seen.rim.semi_major_px(), seen);
}

// Where a straight line between two other frames puts the body in frame i.
Place between(const std::vector<Glimpse>& glimpses, std::size_t from, std::size_t i,
              std::size_t to) {
  const double start_s = glimpses[from].frame->t_s;
  const double share = (glimpses[i].frame->t_s - start_s) / (glimpses[to].frame->t_s - start_s);
  const auto at = [&](const auto& a, const auto& b) { return a + share * (b - a); };
  const Eigen::Vector2d from_m = glimpses[from].pose().centre_m.head<2>();
  const Eigen::Vector2d to_m = glimpses[to].pose().centre_m.head<2>();
  return {at(glimpses[from].seen->centre_px, glimpses[to].seen->centre_px), at(from_m, to_m)};
}

}  // namespace

void doubt_what_leaves_the_path(std::vector<Glimpse>& glimpses) {
  for (const auto& [i, place] : Path(glimpses).take_out()) doubt_place(place, *glimpses[i].seen);
}

void doubt_what_stands_alone(std::vector<Glimpse>& glimpses) {
  constexpr double kMost = 3.5;  // usual frames: three of them
  constexpr double kOfRadius = 0.3;
  const std::vector<Run> runs = runs_of(glimpses);
  const auto followed = [&](const Run& run) { return length_of(run, glimpses) > kMost; };
  for (auto run = runs.begin(); run != runs.end(); ++run) {
    if (followed(*run)) continue;
    const auto before = std::find_if(std::reverse_iterator(run), runs.rend(), followed);
    const auto after = std::find_if(run, runs.end(), followed);
    if (before == runs.rend() || after == runs.end()) continue;
    for (const std::size_t i : run->frames) {
      Sighting& seen = *glimpses[i].seen;
      const Place place = between(glimpses, before->frames.back(), i, after->frames.front());
      const Eigen::Vector2d px = place.px - seen.centre_px;
      const Eigen::Vector2d m = place.m - seen.pose->pose.centre_m.head<2>();
      if (px.norm() < kOfRadius * seen.rim.semi_major_px()) continue;
      doubt_place(place, seen);
      // The path need not have been straight in between.
      allow_for({-px.y(), px.x()}, {-m.y(), m.x()}, seen);
    }
  }
}

void forget_weak_support_beside_gaps(std::vector<Glimpse>& glimpses) {
  // An arm in the body's place has a third to a half of the usual support, a body half
  // hidden by it half to two thirds: some of the latter go with the former.
  constexpr std::size_t kGap = 2;  // one frame may be lost for its noise alone
  constexpr double kWeak = 0.55;
  std::vector<double> usual;
  for (const Glimpse& g : glimpses)
    if (g.posed()) usual.push_back(g.seen->visible_support_px());
  if (usual.empty()) return;
  const double least = kWeak * data::median(std::move(usual));
  // From the gap on, in either direction of time; the ends of the recording are no gaps.
  const auto forget = [&](auto from, auto to) {
    std::size_t lost = 0;
    bool seen = false;
    for (; from != to; ++from) {
      if (!from->posed()) {
        ++lost;
      } else if (seen && lost >= kGap && from->seen->visible_support_px() < least) {
        from->seen.reset();
      } else {
        lost = 0;
        seen = true;
      }
    }
  };
  forget(glimpses.begin(), glimpses.end());
  forget(glimpses.rbegin(), glimpses.rend());
}

void forget_what_tells_nothing(std::vector<Glimpse>& glimpses) {
  constexpr double kOfRadius = 0.3;  // as far as a jump that no impact makes
  for (Glimpse& g : glimpses) {
    if (!g.posed()) continue;
    const double most_px = kOfRadius * g.seen->rim.semi_major_px();
    if (!(0.5 * g.seen->covariance_px2.trace() < most_px * most_px)) g.seen.reset();
  }
}

void forget_what_the_path_jumps_to(std::vector<Glimpse>& glimpses) {
  constexpr double kLongest = 12.5;  // usual frames: twelve of them
  constexpr double kLittle = 0.6;
  std::vector<double> accepted;
  for (const Glimpse& g : glimpses)
    if (g.posed()) accepted.push_back(g.seen->accepted);
  if (accepted.empty()) return;
  const double usual = data::median(std::move(accepted));
  for (const Run& run : runs_of(glimpses))
    if (run.torn && length_of(run, glimpses) <= kLongest && run.accepted < kLittle * usual)
      for (const std::size_t i : run.frames) glimpses[i].seen.reset();
}

}  // namespace trochoid::tracking
