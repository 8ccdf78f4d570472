#include "judge/profile.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "judge/one_parameter.hpp"
#include "problem/linearise.hpp"
#include "trochoid/data/parallel.hpp"

namespace trochoid::fitting {
namespace {

constexpr int kMostPoints = 40;

// One side of a profile: offsets of u from the solution, away from it, and the rise there.
struct Side {
  std::vector<double> offsets, rises;
  bool bounded = false;
  double bound = 0.0;  // offset where the rise is the quantile
};

// Between an offset below the threshold and one above: the root of the rise is nearly a straight
// line where the model is, and halves help where it is not. Each trial starts where the last one
// inside ended; from beyond, the others may lead elsewhere.
void close_in(OneParameter& parameter, OneParameter::Place inside, double threshold, Side& side) {
  constexpr int kMost = 16;
  constexpr double kClose = 0.02;
  const std::size_t n = side.offsets.size();
  const double wanted = std::sqrt(threshold);
  double inner = n > 1 ? side.offsets[n - 2] : 0.0, outer = side.offsets[n - 1];
  double inner_root = n > 1 ? std::sqrt(std::max(side.rises[n - 2], 0.0)) : 0.0;
  double outer_root = std::sqrt(side.rises[n - 1]);
  for (int i = 0; i < kMost; ++i) {
    const double straight = (wanted - inner_root) / std::max(outer_root - inner_root, 1e-300);
    const double share = i % 3 < 2 ? std::clamp(straight, 0.05, 0.95) : 0.5;
    side.bound = inner + share * (outer - inner);
    parameter.start_from(inside);
    const double rise = parameter.rise(side.bound);
    const double root = std::sqrt(std::max(rise, 0.0));
    if (std::isfinite(rise)) {
      side.offsets.push_back(side.bound);
      side.rises.push_back(rise);
      if (std::abs(root - wanted) < kClose * wanted) break;
    }
    if (root < wanted) {
      inner = side.bound, inner_root = root;
      inside = parameter.place();
    } else {
      outer = side.bound, outer_root = std::min(root, 1e3 * wanted);
    }
  }
  side.bounded = true;
}

// How one side is looked at, in u.
struct WalkPlan {
  double first = 0.0;                                     // step, with its sign
  double next = std::numeric_limits<double>::infinity();  // size of the second step at most
  double farthest = 0.0;                                  // offset
};

Side walk(const Problem& problem, const Solution& solution, int index, const WalkPlan& plan,
          double threshold) {
  OneParameter parameter(problem, solution, index);
  Side side;
  double offset = 0.0, step = plan.first;
  for (int point = 0; point < kMostPoints && std::abs(offset) < plan.farthest; ++point) {
    const OneParameter::Place inside = parameter.place();
    const double rise = parameter.rise(offset + step);
    if (!std::isfinite(rise)) {  // perhaps only too long a step
      step *= 0.25;
      if (std::abs(step) < 1e-3 * std::abs(plan.first)) break;
      continue;
    }
    offset += step;
    if (side.offsets.empty()) step = std::copysign(std::min(std::abs(step), plan.next), step);
    side.offsets.push_back(offset);
    side.rises.push_back(rise);
    if (rise > threshold) {
      close_in(parameter, inside, threshold, side);
      break;
    }
    if (rise < 0.5 * threshold) step *= 1.6;
  }
  return side;
}

// Not where and how the body happened to be: angles and positions at the start. Its spin counts.
bool tells_of_the_body(const Problem& problem, int index) {
  const model::ParameterInfo& info = problem.predictor->parameters()[problem.free[index].index];
  return info.role != model::ParameterInfo::Role::initial ||
         (info.unit != "rad" && info.unit != "m");
}

// Where the profile reaches the 95 % bound to one side [units of the value]; no farther than
// looked.
double bound_to_side(const Problem& problem, const Solution& solution, int index, double first_step,
                     double inflation) {
  constexpr double kFarther = 1.6;
  constexpr int kMostSteps = 7;
  constexpr SolveOptions kRoughly{.iterations = 8, .function_tolerance = 1e-5};
  const double wanted = std::sqrt(kQuantile95 * inflation);
  OneParameter parameter(problem, solution, index);
  double offset = 0.0, root = 0.0, next = first_step;
  for (int step = 0; step < kMostSteps; ++step, next *= kFarther) {
    const double rise = parameter.rise(next, kRoughly);
    if (!std::isfinite(rise)) break;
    const double next_root = std::sqrt(std::max(rise, 0.0));
    if (next_root >= wanted) {
      offset += (wanted - root) / (next_root - root) * (next - offset);
      break;
    }
    offset = next, root = next_root;
  }
  const Transform& transform = problem.free[index].transform;
  const double u = solution.u[index];
  return std::abs(transform.value(u + offset) - transform.value(u));
}

WalkPlan plan_walk(const Problem& problem, const Solution& solution, const Uncertainty& error,
                   int index, bool upwards) {
  constexpr double kFourDecades = 9.210340371976184, kOfError = 0.7, kErrors = 100.0;
  const FreeParameter& free = problem.free[index];
  const double u = solution.u[index], value = free.transform.value(u);
  const double slope = std::max(std::abs(free.transform.slope(u)), 1e-300);
  const bool logarithmic = free.transform.is_over_decades();
  double sd = std::sqrt(error.covariance(index, index)) / slope;
  // What was held at next to nothing acts from its error bar on, decades away.
  const bool vanished = logarithmic && free.held && !at_its_limit(free, value);
  if (vanished && upwards && std::isfinite(sd))
    return {std::log1p(kOfError * sd), kOfError, std::log1p(kErrors * sd)};
  // An unidentifiable parameter has no scale of its own: a tenth of its size.
  const double most = logarithmic ? 1.0 : std::max(0.1 * std::abs(u), 1e-3);
  if (!std::isfinite(sd) || (logarithmic && sd > most)) sd = most;
  return {.first = (upwards ? kOfError : -kOfError) * sd,
          .farthest = logarithmic ? kFourDecades : kErrors * sd};
}

data::Profile assemble(const Problem& problem, const Solution& solution, int index,
                       const Side& below, const Side& above, double inflation) {
  const Transform& transform = problem.free[index].transform;
  std::vector<std::pair<double, double>> points{{transform.value(solution.u[index]), 0.0}};
  for (const Side* side : {&below, &above})
    for (std::size_t i = 0; i < side->offsets.size(); ++i)
      points.emplace_back(transform.value(solution.u[index] + side->offsets[i]),
                          side->rises[i] / inflation);
  std::sort(points.begin(), points.end());
  data::Profile profile;
  profile.parameter = problem.name(index);
  for (const auto& [value, rise] : points) {
    profile.values.push_back(value);
    profile.delta_chi2.push_back(rise);
  }
  // By the value, which falls with u where it is bounded from above.
  const bool falls = transform.kind == Transform::Kind::below;
  const Side& lower = falls ? above : below;
  const Side& upper = falls ? below : above;
  const model::ParameterInfo& info = problem.predictor->parameters()[problem.free[index].index];
  // How far a friction is sought is no limit that anybody gave.
  const auto [least, most] = transform.kind == Transform::Kind::limited
                                 ? std::pair(info.lower, info.upper)
                                 : transform.limits();
  profile.lower_95 = lower.bounded ? transform.value(solution.u[index] + lower.bound)
                                   : std::max(least, info.lower);
  profile.upper_95 =
      upper.bounded ? transform.value(solution.u[index] + upper.bound) : std::min(most, info.upper);
  const int bounds = below.bounded + above.bounded;
  profile.verdict = bounds == 2   ? data::ProfileVerdict::bounded
                    : bounds == 1 ? data::ProfileVerdict::one_sided
                                  : data::ProfileVerdict::flat;
  return profile;
}

}  // namespace

std::vector<data::Profile> profiles(const Problem& problem, const Solution& solution,
                                    const Uncertainty& error, int threads) {
  const std::vector<int> kept = kept_parameters(problem);
  std::vector<int> chosen;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (tells_of_the_body(problem, i) && std::find(kept.begin(), kept.end(), i) == kept.end())
      chosen.push_back(i);
  std::vector<Side> sides(2 * chosen.size());
  data::in_parallel(sides.size(), threads, [&](std::size_t i) {
    const int index = chosen[i / 2];
    sides[i] =
        walk(problem, solution, index, plan_walk(problem, solution, error, index, i % 2 == 1),
             kQuantile95 * error.chi2_inflation[index]);
  });
  std::vector<data::Profile> result;
  for (std::size_t c = 0; c < chosen.size(); ++c)
    result.push_back(assemble(problem, solution, chosen[c], sides[2 * c], sides[2 * c + 1],
                              error.chi2_inflation[chosen[c]]));
  return result;
}

std::optional<FarSide> far_side_of_friction(const Problem& problem, const Solution& solution,
                                            const Uncertainty& error, int threads) {
  const int friction = problem.predictor->index_of("friction");
  const bool slides_on_rim = friction >= 0 && problem.predictor->index_of("w1_rad_s") >= 0;
  const auto& seen = error.identifiable;
  if (!slides_on_rim || std::all_of(seen.begin(), seen.end(), [](bool one) { return one; }))
    return std::nullopt;
  const auto free = std::find_if(problem.free.begin(), problem.free.end(),
                                 [&](const FreeParameter& one) { return one.index == friction; });
  const auto index = static_cast<int>(free - problem.free.begin());
  if (free == problem.free.end() || !seen[index]) return std::nullopt;
  const double quantile = std::sqrt(kQuantile95), sigma = std::sqrt(error.covariance(index, index));
  const double step = quantile * sigma / std::abs(free->transform.slope(solution.u[index]));
  std::array<double, 2> bounds{};
  data::in_parallel(2, threads, [&](std::size_t side) {
    bounds[side] = bound_to_side(problem, solution, index, side == 0 ? -step : step,
                                 error.chi2_inflation[index]);
  });
  const FarSide far{index, std::max(bounds[0], bounds[1]) / quantile};
  return far.sigma > sigma ? std::optional(far) : std::nullopt;
}

}  // namespace trochoid::fitting
