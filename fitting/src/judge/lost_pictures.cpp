#include "judge/lost_pictures.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <string>
#include <utility>

#include "judge/adequacy.hpp"
#include "judge/counting.hpp"
#include "judge/path_steps.hpp"
#include "observe/decompositions.hpp"
#include "problem/linearise.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::fitting {
namespace {

constexpr double kWorth = 40.0;  // of chi-square by the noise, for one of hundreds of places

// A sample's position among the rows of all arcs, and what a frame of time does to its residuals.
struct Place {
  int sample = 0;
  Eigen::Index row = 0;
  Eigen::Vector2d per_frame = Eigen::Vector2d::Zero();
};

struct ArcPlaces {
  int arc = 0;
  double frame_s = 0.0;
  std::vector<Place> places;  // in the order of time
};

// By the differences of neighbouring predictions. Positions that lie on no path with the others
// say nothing.
ArcPlaces places_of(const Problem& problem, int arc, Eigen::Index first_row,
                    const Eigen::VectorXd& residuals) {
  const ArcData& data = problem.arcs[arc];
  ArcPlaces all{.arc = arc, .frame_s = data::usual_step_s(data.t_s), .places = {}};
  const Eigen::MatrixX2d at_m = predicted_m(data, residuals);
  const std::vector<int> consistent = consistent_samples(data);
  const auto last = static_cast<int>(data.t_s.size()) - 1;
  for (const Reading& reading : data.readings) {
    if (reading.channel != Channel::position ||
        !std::binary_search(consistent.begin(), consistent.end(), reading.sample))
      continue;
    const int from = std::max(0, reading.sample - 1), to = std::min(last, reading.sample + 1);
    const Eigen::Vector2d velocity_m_s =
        (at_m.row(to) - at_m.row(from)).transpose() / (data.t_s[to] - data.t_s[from]);
    all.places.push_back({reading.sample, first_row + reading.row,
                          reading.whitener.transpose() * velocity_m_s * all.frame_s});
  }
  return all;
}

// A position that lies on no path with the others would turn parameters towards itself, and pass
// for noise beside which steps are nothing.
void leave_out_others(const ArcData& data, Eigen::Index first_row, const ArcPlaces& kept,
                      Linearised& all) {
  const auto is_kept = [&](int sample) {
    return std::binary_search(kept.places.begin(), kept.places.end(), Place{.sample = sample},
                              [](const Place& a, const Place& b) { return a.sample < b.sample; });
  };
  for (const Reading& reading : data.readings) {
    if (reading.channel != Channel::position || is_kept(reading.sample)) continue;
    all.residuals.segment<2>(first_row + reading.row).setZero();
    all.jacobian.middleRows<2>(first_row + reading.row).setZero();
  }
}

// From which of an arc's places on times are off.
struct Step {
  std::size_t arc = 0, from = 0;
};

// What is left of residuals when parameters and steps in time have followed them.
class Remainder {
 public:
  explicit Remainder(const Linearised& all)
      : parameters_(reachable(all)), reach_(parameters_), residuals_(without(parameters_, all)) {
    left_ = residuals_;
  }
  struct Best {
    Step step;
    double gain = 0.0;  // of chi-square
  };
  // The step that would lower chi-square most.
  [[nodiscard]] Best best(const std::vector<ArcPlaces>& arcs) const;
  void add(const std::vector<ArcPlaces>& arcs, const Step& step);
  // By how much the times are off from each step on: in frames, with their covariance.
  [[nodiscard]] std::pair<Eigen::VectorXd, Eigen::MatrixXd> frames() const;
  // Of a residual that is left.
  [[nodiscard]] double variance() const {
    return left_.squaredNorm() / static_cast<double>(left_.size() - reach_.cols());
  }

 private:
  static Eigen::VectorXd without(const Eigen::MatrixXd& reach, const Linearised& all) {
    return all.residuals - reach * (reach.transpose() * all.residuals);
  }

  Eigen::MatrixXd parameters_, reach_;  // orthonormal; the latter of steps as well
  Eigen::VectorXd residuals_, left_;    // without the parameters; without the steps as well
  Eigen::MatrixXd steps_;               // what each does to residuals, without the parameters
};

Remainder::Best Remainder::best(const std::vector<ArcPlaces>& arcs) const {
  constexpr double kNothing = 1e-3;       // of a step that the parameters all but follow
  constexpr std::size_t kFromTheEnd = 5;  // fewer tell glitches, not steps
  Best best;
  for (std::size_t arc = 0; arc < arcs.size(); ++arc) {
    const std::vector<Place>& places = arcs[arc].places;
    Eigen::VectorXd followed = Eigen::VectorXd::Zero(reach_.cols());
    double size = 0.0, along = 0.0;
    for (std::size_t from = places.size(); from-- > kFromTheEnd;) {
      const Place& place = places[from];
      followed += reach_.middleRows<2>(place.row).transpose() * place.per_frame;
      size += place.per_frame.squaredNorm();
      along += place.per_frame.dot(left_.segment<2>(place.row));
      const double own = size - followed.squaredNorm();
      if (own > kNothing * size && places.size() - from >= kFromTheEnd &&
          along * along / own > best.gain)
        best = {{arc, from}, along * along / own};
    }
  }
  return best;
}

void Remainder::add(const std::vector<ArcPlaces>& arcs, const Step& step) {
  const std::vector<Place>& places = arcs[step.arc].places;
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(left_.size());
  for (std::size_t i = step.from; i < places.size(); ++i)
    moved.segment<2>(places[i].row) = places[i].per_frame;
  steps_.conservativeResize(moved.size(), steps_.cols() + 1);
  steps_.rightCols<1>() = moved - parameters_ * (parameters_.transpose() * moved);
  const Eigen::VectorXd own = (moved - reach_ * (reach_.transpose() * moved)).normalized();
  reach_.conservativeResize(Eigen::NoChange, reach_.cols() + 1);
  reach_.rightCols<1>() = own;
  left_ -= own.dot(left_) * own;
}

std::pair<Eigen::VectorXd, Eigen::MatrixXd> Remainder::frames() const {
  const SymmetricEquations normal(steps_.transpose() * steps_);
  return {normal.solve(-steps_.transpose() * residuals_),
          variance() * normal.solve_each(Eigen::MatrixXd::Identity(steps_.cols(), steps_.cols()))};
}

// The steps one after the other, and each once more beside the later ones, while any moves.
std::vector<Step> steps_of(const Remainder& plain, const std::vector<ArcPlaces>& arcs) {
  constexpr std::size_t kMost = 8;
  constexpr int kMostRounds = 3;
  std::vector<Step> steps;
  const auto with_all_but = [&](std::size_t left_out) {
    Remainder remainder = plain;
    for (std::size_t i = 0; i < steps.size(); ++i)
      if (i != left_out) remainder.add(arcs, steps[i]);
    return remainder;
  };
  while (steps.size() < kMost) {
    Remainder remainder = with_all_but(steps.size());
    const Remainder::Best best = remainder.best(arcs);
    if (!(best.gain > 0.0)) break;
    remainder.add(arcs, best.step);
    if (!(best.gain > kWorth * remainder.variance())) break;
    steps.push_back(best.step);
    bool moves = steps.size() > 1;
    for (int round = 0; moves && round < kMostRounds; ++round) {
      moves = false;
      for (std::size_t i = 0; i < steps.size(); ++i) {
        const Step at = with_all_but(i).best(arcs).step;
        moves = moves || at.arc != steps[i].arc || at.from != steps[i].from;
        steps[i] = at;
      }
    }
  }
  return steps;
}

// From a sample of an arc on its times are off.
struct TimeJump {
  int arc = 0, sample = 0;
  double frames = 0.0, sigma = 0.0;  // by how many of its usual steps too early
};

std::vector<TimeJump> jumps_of(const Problem& problem, const Eigen::VectorXd& u) {
  constexpr std::size_t kLeastPlaces = 40;
  const Problem plain = in_stated_sigmas(problem, Weights::dropped);
  Linearised all = linearise(plain, u);
  std::vector<ArcPlaces> arcs;
  Eigen::Index row = 0;
  for (int arc = 0; arc < static_cast<int>(plain.arcs.size()); ++arc) {
    const ArcData& data = plain.arcs[arc];
    if (data.observable_index(model::Observable::x_m) >= 0) {
      ArcPlaces places = places_of(plain, arc, row, all.residuals.segment(row, data.rows));
      leave_out_others(data, row, places, all);
      if (places.places.size() >= kLeastPlaces) arcs.push_back(std::move(places));
    }
    row += data.rows;
  }
  Remainder remainder(all);
  const std::vector<Step> steps = steps_of(remainder, arcs);
  if (steps.empty()) return {};
  for (const Step& step : steps) remainder.add(arcs, step);
  const auto [frames, covariance] = remainder.frames();
  std::vector<TimeJump> jumps;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const ArcPlaces& arc = arcs[steps[i].arc];
    const auto k = static_cast<Eigen::Index>(i);
    jumps.push_back(
        {arc.arc, arc.places[steps[i].from].sample, frames[k], std::sqrt(covariance(k, k))});
  }
  return jumps;
}

// The way there may be bent, and the refit tells.
bool may_be_whole(const TimeJump& jump) {
  constexpr double kNear = 0.35, kTold = 0.15;
  const double whole = std::round(jump.frames);
  return whole != 0.0 && std::abs(jump.frames - whole) < kNear && jump.sigma < kTold;
}

// By arc and sample, how many frames are missing just before it.
using Missing = std::map<std::pair<int, int>, int>;

Problem with_times_put_right(Problem problem, const Missing& missing) {
  constexpr double kApart = 1e-6;  // of a frame: what is written twice is of one time
  for (const auto& [place, frames] : missing) {
    ArcData& arc = problem.arcs[place.first];
    const double frame_s = data::usual_step_s(arc.t_s);
    for (auto t_s = arc.t_s.begin() + place.second; t_s != arc.t_s.end(); ++t_s)
      *t_s = std::max(*t_s + frames * frame_s, *std::prev(t_s) + kApart * frame_s);
  }
  return problem;
}

// Squares of the noise of positions, in stated sigmas, as many as an arc has rows.
double scatter(const Problem& problem) {
  double sum = 0.0;
  for (const ArcData& arc : problem.arcs) sum += arc.rows * std::pow(main_noise_scale(arc), 2);
  return sum;
}

}  // namespace

LostPictures lost_pictures(const Problem& problem, const Eigen::VectorXd& u) {
  constexpr int kMostRounds = 4;
  Missing missing;
  Problem right = problem;
  Eigen::VectorXd there = u;
  std::vector<TimeJump> jumps = jumps_of(right, there);
  for (int round = 0; round < kMostRounds && !jumps.empty(); ++round) {
    std::erase_if(jumps, [](const TimeJump& jump) { return !may_be_whole(jump); });
    if (jumps.empty()) return {};
    for (const TimeJump& jump : jumps)
      missing[{jump.arc, jump.sample}] += static_cast<int>(std::round(jump.frames));
    right = with_times_put_right(problem, missing);
    const Solution solution = minimise(right, there);
    if (!solution.usable) return {};
    there = solution.u;
    reweight(right, there, true);
    jumps = jumps_of(right, there);
  }
  LostPictures lost;
  if (!jumps.empty() ||
      !(scatter(problem) - scatter(right) > kWorth * scatter(right) / right.rows()))
    return lost;
  for (const auto& [place, frames] : missing)
    if (frames != 0)
      lost.steps.push_back({place.first, problem.arcs[place.first].t_s[place.second], frames});
  lost.noise_scale = std::sqrt(scatter(right) / right.rows());
  return lost;
}

namespace {

std::string words(const Problem& problem, const LostPictures& lost) {
  std::vector<std::string> told;
  for (const LostPictures::TimeStep& step : lost.steps)
    told.push_back(fmt::format("{} frame{} too {}{} from {:.4g} s on", std::abs(step.frames),
                               std::abs(step.frames) == 1 ? "" : "s",
                               step.frames > 0 ? "early" : "late",
                               in_track(problem, problem.arcs[step.arc]), step.t_s));
  const bool all_missing =
      std::all_of(lost.steps.begin(), lost.steps.end(),
                  [](const LostPictures::TimeStep& step) { return step.frames > 0; });
  return fmt::format(
      "times are {}: pictures were dropped{}, and the times do not show it; put right{} they leave "
      "residuals of {:.2g} times the stated noise",
      fmt::join(told, ", "), all_missing ? "" : ", or written twice",
      all_missing ? " ([camera] missing_frames, tracked again)" : "", lost.noise_scale);
}

}  // namespace

void doubt_if_pictures_are_lost(const Problem& problem, const Eigen::VectorXd& u,
                                const Uncertainty& error, data::Fit& fit) {
  constexpr double kNotWhite = 0.01;
  if (error.whiteness.p_value > kNotWhite) return;
  const LostPictures lost = lost_pictures(problem, u);
  if (lost.steps.empty() && fit.verdict == data::FitVerdict::doubtful)
    tell_steps_of_path(problem, fit);
  if (lost.steps.empty()) return;
  if (!says_explained(fit)) {
    fit.warnings.push_back(words(problem, lost));
    return;
  }
  fit.verdict = data::FitVerdict::doubtful;
  fit.verdict_words =
      "the model follows the track, but does not explain it: " + words(problem, lost);
}

}  // namespace trochoid::fitting
