#include "judge/contradictions.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "judge/adequacy.hpp"
#include "judge/caveats.hpp"
#include "judge/counting.hpp"
#include "judge/whiteness.hpp"
#include "observe/decompositions.hpp"
#include "problem/linearise.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {

namespace {

// Said in the verdict where that was good, in a warning where there is worse, or it is no reason to
// doubt.
void tell(const std::string& what, const std::string& doubt, bool grave, data::Fit& fit) {
  if (!says_explained(fit) || !grave) {
    fit.warnings.push_back(what);
    return;
  }
  fit.verdict = data::FitVerdict::doubtful;
  fit.verdict_words = "the model follows the track, but does not explain it: " + what + doubt;
}

// What a prior and the tracks say of one parameter.
struct Contrast {
  double apart = 0.0;             // standard deviations of both together
  double value = 0.0, sigma = 0;  // by the tracks alone
};

// @param leverage  share of what is known of the parameter that the prior brings, 0..1.
// @param inflation  of the tracks' variance.
Contrast contrast_of(const FreeParameter& parameter, double value, double leverage,
                     double inflation) {
  const data::Prior& prior = *parameter.prior;
  const double ratio = leverage / (1.0 - leverage);  // the tracks' variance over the prior's
  const double pulled = prior.sigma * off_prior(prior, value, parameter.turns);
  return {std::abs(pulled) * (1.0 + ratio) / (prior.sigma * std::sqrt(1.0 + inflation * ratio)),
          value + pulled * ratio, prior.sigma * std::sqrt(inflation * ratio)};
}

// Rows of the residuals of one track.
std::vector<int> rows_of_track(const Problem& problem, const Linearised& all, int track) {
  std::vector<int> rows;
  for (int row = 0; row < std::ssize(all.arc); ++row)
    if (all.arc[row] >= 0 && problem.arcs[all.arc[row]].track == track) rows.push_back(row);
  return rows;
}

// What one track asks of the parameters that it shares with others, its own left free.
struct Demand {
  int track = 0;
  int seen = 0;                    // of the shared ones
  double gain = 0.0;               // of chi-square, if they were its own
  int parameter = 0;               // that would move farthest if the others stayed
  double step = 0.0, sigma = 0.0;  // of that
};

Demand demand_of(const Problem& problem, const Linearised& all, int track) {
  constexpr double kLeastSeen = 1e-6;  // of what the track sees before its own are free
  const std::vector<int> rows = rows_of_track(problem, all, track);
  std::vector<int> own, shared;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    const int arc = problem.free[i].arc;
    if (arc < 0) shared.push_back(i);
    if (arc >= 0 && problem.arcs[arc].track == track) own.push_back(i);
  }
  const LeastSquares by_own(all.jacobian(rows, own));
  const Eigen::MatrixXd before = all.jacobian(rows, shared);
  const Eigen::MatrixXd left = before - all.jacobian(rows, own) * by_own.solve_each(before);
  const Eigen::VectorXd r = all.residuals(rows);
  Demand demand{.track = track};
  Eigen::MatrixXd unit(left.rows(), 0);
  double farthest = -1.0;
  for (Eigen::Index i = 0; i < left.cols(); ++i) {
    const double length = left.col(i).norm();
    if (!(length > kLeastSeen * before.col(i).norm())) continue;
    unit.conservativeResize(Eigen::NoChange, unit.cols() + 1);
    unit.rightCols<1>() = left.col(i) / length;
    const double bars = -unit.rightCols<1>().dot(r);
    if (std::abs(bars) <= farthest) continue;
    farthest = std::abs(bars);
    demand.parameter = shared[static_cast<std::size_t>(i)];
    demand.step = bars / length, demand.sigma = 1.0 / length;
  }
  if (unit.cols() == 0) return demand;
  const LeastSquares by_shared(unit);
  demand.seen = static_cast<int>(by_shared.rank(kLeastSeen));
  demand.gain = (unit * by_shared.solve(r)).squaredNorm();
  return demand;
}

// What a track asks for, in words; a step by the slope may lead out of what a parameter can be.
std::string wish_of(const Problem& problem, const Eigen::VectorXd& u, const Demand& demand,
                    double widened) {
  const std::string name = problem.name(demand.parameter);
  const model::ParameterInfo& info =
      problem.predictor->parameters()[problem.free[demand.parameter].index];
  const double value = problem.value(demand.parameter, u) + demand.step;
  if (value < info.lower || value > info.upper)
    return fmt::format("a {} {}", demand.step > 0.0 ? "larger" : "smaller", name);
  return fmt::format("{} = {:.4g} ± {:.2g}", name, value, widened * demand.sigma);
}

// To where the tracks together lead, by the derivatives, if neither a prior nor a bound pulled.
void let_go(const Problem& problem, Linearised& all) {
  const Eigen::Index rows = problem.rows();
  const Eigen::VectorXd size = all.jacobian.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd seen = all.jacobian.topRows(rows) * size.cwiseInverse().asDiagonal();
  all.residuals.head(rows) -= seen * NearestLeastSquares(seen).solve(all.residuals.head(rows));
}

}  // namespace

void doubt_if_priors_contradict(const Problem& problem, const Eigen::VectorXd& u,
                                const Uncertainty& error, data::Fit& fit) {
  constexpr double kWorthWords = 3.0, kTooFar = 5.0;
  constexpr double kPriorAlone = 1e-9;
  if (problem.frees_camera()) return;  // likely deviations, which say so themselves
  Linearised all;
  int row = problem.rows() - 1;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    const FreeParameter& parameter = problem.free[i];
    if (!parameter.prior) continue;
    ++row;
    if (parameter.held) continue;
    if (all.arc.empty()) all = linearise(problem, u);
    const Eigen::VectorXd at_row = Eigen::VectorXd::Unit(all.jacobian.rows(), row);
    const double leverage = all.jacobian.row(row).dot(LeastSquares(all.jacobian).solve(at_row));
    if (!(leverage < 1.0 - kPriorAlone)) continue;
    const data::Prior& prior = *parameter.prior;
    const Contrast says =
        contrast_of(parameter, problem.value(i, u), leverage, error.chi2_inflation[i]);
    if (!(says.apart > kWorthWords)) continue;
    const std::string words = fmt::format(
        "the prior {} = {:.6g} ± {:.2g} and the track, which alone says about {:.6g} ± {:.2g}, are "
        "{:.2g} standard deviations apart",
        problem.name(i), prior.value, prior.sigma, says.value, says.sigma, says.apart);
    tell(words, ": one of them is wrong, or the model, and the error bars are too small",
         says.apart > kTooFar, fit);
  }
}

namespace {

// A parameter that [fit] fixes, free beside the others.
struct Freed {
  Problem problem;
  Eigen::VectorXd u;
  int at = 0;  // among the free ones
};

std::optional<Freed> freed(const Problem& problem, const Eigen::VectorXd& u, int index) {
  const bool own = problem.predictor->parameters()[static_cast<std::size_t>(index)].role ==
                   model::ParameterInfo::Role::initial;
  if (own && problem.arcs.size() > 1) return std::nullopt;
  Freed out{problem, Eigen::VectorXd(u.size() + 1), own ? static_cast<int>(u.size()) : 0};
  FreeParameter parameter;
  parameter.index = index;
  parameter.arc = own ? 0 : -1;
  out.problem.free.insert(out.problem.free.begin() + out.at, parameter);
  const double value = problem.base.front()[index];
  out.u << u.head(out.at), value, u.tail(u.size() - out.at);
  return out;
}

// A parameter that [fit] bounds, without the bound.
Freed let_go_of_bound(const Problem& problem, const Eigen::VectorXd& u, int at) {
  Freed out{problem, u, at};
  Transform& transform = out.problem.free[at].transform;
  const double value = transform.value(u[at]);
  const bool logarithmic = problem.predictor->parameters()[problem.free[at].index].logarithmic;
  transform = {logarithmic && value > 0.0 ? Transform::Kind::log : Transform::Kind::identity};
  out.u[at] = transform.inverse(value);
  return out;
}

// What the tracks say of it, where that is known to its own size or to a third of how far it is
// off: of a loss that is not there the former is nothing.
std::optional<Contrast> contrast_of(Freed one, double fixed) {
  constexpr double kOfDistance = 1.0 / 3.0;
  const Solution solution = minimise(one.problem, one.u);
  if (!solution.usable || !solution.converged) return std::nullopt;
  try {
    const Uncertainty error = uncertainty(one.problem, solution.u);
    const double value = one.problem.value(one.at, solution.u);
    const double sigma = std::sqrt(error.covariance(one.at, one.at));
    const double off = std::abs(value - fixed);
    if (!error.identifiable[static_cast<std::size_t>(one.at)] && !(sigma < kOfDistance * off))
      return std::nullopt;
    return Contrast{off / sigma, value, sigma};
  } catch (const NumericalError&) {
    return std::nullopt;
  }
}

}  // namespace

void doubt_if_fixed_contradict(const Problem& problem, const Eigen::VectorXd& u,
                               const data::FitSettings& settings, data::Fit& fit) {
  constexpr double kWorthWords = 3.0, kTooFar = 5.0;
  const auto& parameters = problem.predictor->parameters();
  for (int index = 0; index < std::ssize(parameters); ++index) {
    const std::string& name = parameters[static_cast<std::size_t>(index)].name;
    const double* fixed = said_of(name, settings.fixed);
    // Zero is a loss that is left out, or a direction that is chosen.
    if (fixed == nullptr || *fixed == 0.0) continue;
    const double value = *fixed;
    const auto one = freed(problem, u, index);
    const auto says = one ? contrast_of(*one, value) : std::nullopt;
    if (!says || !(says->apart > kWorthWords)) continue;
    tell(fmt::format("{} = {:.6g} is fixed, and the track alone says {:.6g} ± {:.2g}, {:.2g} "
                     "standard deviations from it",
                     name, value, says->value, says->sigma, says->apart),
         ": one of them is wrong, or the model, and the error bars are too small",
         says->apart > kTooFar, fit);
  }
}

void doubt_if_bounds_contradict(const Problem& problem, const Eigen::VectorXd& u,
                                const Uncertainty& error, const data::FitSettings& settings,
                                data::Fit& fit) {
  constexpr double kWorthWords = 3.0, kTooFar = 5.0;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    const auto bound = bound_stood_at(problem, u, error, settings, i);
    if (!bound) continue;
    const auto says = contrast_of(let_go_of_bound(problem, u, i), bound->value);
    const bool beyond = says && (says->value < bound->value) == bound->lower;
    if (!beyond || !(says->apart > kWorthWords)) continue;
    tell(fmt::format("{} is bounded to {} {:.6g}, and the track alone says {:.6g} ± {:.2g}, {:.2g} "
                     "standard deviations beyond",
                     problem.name(i), bound->lower ? "at least" : "at most", bound->value,
                     says->value, says->sigma, says->apart),
         ": one of them is wrong, or the model, and the error bars are too small",
         says->apart > kTooFar, fit);
  }
}

void doubt_if_tracks_differ(const Problem& problem, const Eigen::VectorXd& u,
                            const Uncertainty& error, data::Fit& fit) {
  constexpr double kByChance = 1e-6;
  std::set<int> tracks;
  for (const ArcData& arc : problem.arcs) tracks.insert(arc.track);
  if (tracks.size() < 2 || problem.shared_count() == 0 || problem.predictor->model_name() == "puck")
    return;
  // Far from where a track is explained its derivatives do not lead there (tracks_apart.hpp).
  if (!says_explained(fit)) return;
  Linearised all = linearise(problem, u);
  let_go(problem, all);
  double gain = 0.0;
  int dof = -problem.shared_count();
  Demand odd;
  for (const int track : tracks) {
    const Demand demand = demand_of(problem, all, track);
    gain += demand.gain / (error.widened * error.widened);
    dof += demand.seen;
    const auto bars = [](const Demand& d) {
      return d.sigma > 0.0 ? std::abs(d.step / d.sigma) : 0.0;
    };
    if (bars(demand) > bars(odd)) odd = demand;
  }
  if (dof < 1 || chi2_upper_tail(gain, dof) > kByChance) return;
  const std::string words = fmt::format(
      "the tracks ask for different values of what they share (chi-square would fall by {:.3g} "
      "times its noise for {} parameters more), above all track {}: for {} rather than {:.4g}, the "
      "others as they are",
      gain, dof, odd.track + 1, wish_of(problem, u, odd, error.widened),
      problem.value(odd.parameter, u));
  tell(words, "; fit each alone to see which does not belong",
       !is_tracked(problem) || gain > kOfATracker * dof, fit);
}

}  // namespace trochoid::fitting
