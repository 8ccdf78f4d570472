#include "judge/describe.hpp"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "judge/degeneracies.hpp"
#include "judge/derived.hpp"
#include "judge/steady_top.hpp"
#include "observe/observed.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {
namespace {

// Standard deviations if scale and frame rate were exact: what two clips of one camera share falls
// out of their comparison. Empty if neither is in doubt.
Eigen::VectorXd sigma_of_one_camera(const Problem& problem, const Eigen::MatrixXd& covariance) {
  std::vector<int> shared;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (const std::string name = problem.name(i); name == kScale || name == kTimeFactor)
      shared.push_back(i);
  if (shared.empty()) return {};
  return variances_given(covariance, shared).cwiseMax(0.0).cwiseSqrt();
}

void report_parameters(const Problem& problem, const Uncertainty& error,
                       const data::FitSettings& asked, data::Fit& fit) {
  const auto& infos = problem.predictor->parameters();
  fit.covariance = error.covariance;
  const Eigen::VectorXd one_camera =
      sigma_of_one_camera(problem, error.covariance - error.of_camera);
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    fit.covariance_names.push_back(problem.name(i));
    const FreeParameter& free = problem.free[i];
    const int arc = std::max(0, free.arc);
    data::FitParameter parameter;
    parameter.name = problem.name(i);
    parameter.value = problem.base[arc][free.index];
    parameter.sigma = std::sqrt(error.covariance(i, i));
    parameter.unit = infos[free.index].unit;
    parameter.identifiable = error.identifiable[i];
    parameter.note = infos[free.index].meaning;
    if (one_camera.size() > 0 && infos[free.index].role == model::ParameterInfo::Role::dynamics)
      parameter.note +=
          fmt::format("; ± {:.2g} between clips of this scale and frame rate", one_camera[i]);
    if (free.held && free.transform.is_over_decades())
      parameter.note +=
          at_its_limit(free, parameter.value)
              ? "; not seen but for being large enough"
              : fmt::format("; not seen: between 0 and {:.2g} at 95 %", 1.96 * parameter.sigma);
    if (free.prior && parameter.sigma > 0.9 * free.prior->sigma)
      parameter.status = data::ParameterStatus::prior;
    if (!std::isfinite(parameter.sigma)) parameter.identifiable = false;
    fit.parameters.push_back(parameter);
  }
  for (int index = 0; index < static_cast<int>(infos.size()); ++index) {
    const bool is_free = std::any_of(problem.free.begin(), problem.free.end(),
                                     [&](const FreeParameter& p) { return p.index == index; });
    // An unseen spin angle is not a fixed value, it is simply absent.
    const bool unseen = infos[index].role == model::ParameterInfo::Role::initial &&
                        !asked.fixed.contains(infos[index].name);
    if (is_free || unseen) continue;
    fit.parameters.push_back({infos[index].name, problem.base[0][index], 0.0, infos[index].unit,
                              data::ParameterStatus::fixed, true, infos[index].meaning});
  }
}

// Each recording once; its whiteners are all alike, of one guess.
void tell_unknown_noise(const Problem& problem, data::Fit& fit) {
  int told = -1;
  for (const ArcData& arc : problem.arcs) {
    if (!arc.sigma_unknown || arc.track == told) continue;
    told = arc.track;
    fit.warnings.push_back(fmt::format(
        "track {} has no covariances: the noise of its positions, {:.2g} m, is "
        "estimated from the residuals",
        arc.track + 1, noise_scale(arc, Channel::position) / arc.readings.front().whitener(0, 0)));
  }
}

void warn(const Problem& problem, const Uncertainty& error, data::Fit& fit) {
  for (const data::NullVector& vector : fit.null_vectors) fit.warnings.push_back(vector.words);
  tell_unknown_noise(problem, fit);
  for (const ArcData& arc : problem.arcs)
    if (arc.held)
      fit.warnings.push_back(fmt::format(
          "track {} begins at rest: fitted from {:.4g} s, where the body is let go; from sets "
          "another start",
          arc.track + 1, arc.t_s.front()));
  if (error.whiteness.inflation > 1.0)
    fit.warnings.push_back(
        fmt::format("residuals hang together over {:.3g} s: error bars widened by {:.2f}",
                    error.whiteness.correlation_time_s, error.widened));
}

// From the first frame to the last as predicted, whatever gaps the record has.
Eigen::VectorXd seen_in_arc(const Problem& problem, int index, const Eigen::VectorXd& u,
                            model::Observable what) {
  constexpr int kTimes = 1000;
  const ArcData& arc = problem.arcs[index];
  std::vector<double> t_s;
  for (int i = 0; i <= kTimes; ++i) t_s.push_back(arc.t_s.front() + arc.duration_s() * i / kTimes);
  model::PredictRequest request;
  request.t_s = t_s;
  request.start_s = arc.start_s;
  request.observables = {what};
  request.tolerance = problem.tolerance;
  request.rolls_at_first = problem.rolls_at_first;
  return problem.predictor->predict(problem.values(index, u), request).values;
}

// Half the number of times that the tilt turns back, by more than a tenth of all it does.
double nutations_of(const Eigen::VectorXd& theta) {
  constexpr double kOfAll = 0.1, kLeast_rad = 1e-3;
  const double turns_back = std::max(kOfAll * (theta.maxCoeff() - theta.minCoeff()), kLeast_rad);
  double from = theta[0], way = 0.0;  // the farthest so far, and in which sense it is sought
  int reversals = 0;
  for (const double tilt : theta) {
    if (way == 0.0 && std::abs(tilt - from) > turns_back) way = tilt > from ? 1.0 : -1.0;
    if (way != 0.0 && way * (tilt - from) > 0.0) from = tilt;
    if (way == 0.0 || way * (from - tilt) < turns_back) continue;
    ++reversals;
    from = tilt, way = -way;
  }
  return 0.5 * reversals;
}

// Nutation of the axis: its frequency is near |b - 2 dphi cos(theta)| for small amplitudes; large
// ones, as of a top that nearly sleeps or hangs, are counted.
double nutations_in(const Problem& problem, int arc, const Eigen::VectorXd& u,
                    const data::Fit& fit) {
  const auto at = static_cast<std::size_t>(arc);
  const auto* b = fit.find("b_1_s", at);
  const auto* rate = fit.find_state("dphi_rad_s", at);
  const auto* theta = fit.find_state("theta_rad", at);
  if (b == nullptr || rate == nullptr || theta == nullptr)
    return std::numeric_limits<double>::infinity();
  const double frequency = std::abs(b->value - 2.0 * rate->value * std::cos(theta->value));
  const Eigen::VectorXd tilt = seen_in_arc(problem, arc, u, model::Observable::theta_rad);
  return std::max(problem.arcs[arc].duration_s() * frequency / data::kTurn,
                  tilt.allFinite() ? nutations_of(tilt) : 0.0);
}

// The rate at the first frame says little of a body that nutates widely or speeds up as it falls.
double turns_of_node_line(const Problem& problem, int arc, const Eigen::VectorXd& u) {
  const Eigen::VectorXd phi = seen_in_arc(problem, arc, u, model::Observable::phi_rad);
  double turned = 0.0;
  for (Eigen::Index i = 1; i < phi.size() && std::isfinite(phi[i]); ++i)
    turned += std::abs(data::wrapped(phi[i] - phi[i - 1]));
  return turned / data::kTurn;
}

// What the arcs share is told by the longest of them, which leaves a short one its own state.
template <typename Length>
double longest_of(const Problem& problem, const Length& length) {
  double most = 0.0;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()) && most < 1.0; ++arc)
    most = std::max(most, length(arc));
  return most;
}

const char* track_or_longest(const Problem& problem) {
  return problem.arcs.size() > 1 ? "the longest of the tracks" : "the track";
}

void warn_short_top(const Problem& problem, const Eigen::VectorXd& u, data::Fit& fit) {
  const double periods =
      longest_of(problem, [&](int arc) { return nutations_in(problem, arc, u, fit); });
  if (periods >= 1.0) return;
  fit.warnings.push_back(fmt::format(
      "{} is about {:.2g} nutation periods long; below one, a, b and l are hardly separable",
      track_or_longest(problem), periods));
}

// A rolling body's nutation is about as fast as its node line turns.
void warn_short_rim(const Problem& problem, const Eigen::VectorXd& u, data::Fit& fit) {
  if (problem.predictor->index_of("w2_rad_s") < 0) return;
  const double turns =
      longest_of(problem, [&](int arc) { return turns_of_node_line(problem, arc, u); });
  if (turns >= 1.0) return;
  fit.warnings.push_back(fmt::format(
      "{} is about {:.2g} turns of the node line long, less than a nutation: tilt, spin and losses "
      "are hardly separable, and error bars may be too small",
      track_or_longest(problem), turns));
}

void warn_thick_air(const data::Scene& scene, data::Fit& fit) {
  const data::FitParameter* gap = fit.find("gap_viscosity_Pa_s");
  if (gap == nullptr || gap->status != data::ParameterStatus::free ||
      gap->value < kThickestAir_Pa_s || tells_of_a_film(scene))
    return;
  fit.warnings.push_back(fmt::format(
      "gap_viscosity_Pa_s is {:.0f} times that of air: on a dry floor some other loss, which the "
      "model lacks, looks like a gap layer",
      gap->value / kAirViscosity_Pa_s));
}

void describe_quality(const Problem& problem, const Eigen::VectorXd& u, const Uncertainty& error,
                      data::Fit& fit) {
  const Criteria score = criteria(problem, u, error.minus2_log_likelihood);
  fit.chi2 = score.chi2;
  fit.dof = score.rows - static_cast<int>(problem.free.size());
  fit.aicc = score.aicc;
  fit.bic = score.bic;
  // Over a first guess it says nothing, where any track states its noise.
  const bool stated = std::any_of(problem.arcs.begin(), problem.arcs.end(),
                                  [](const ArcData& arc) { return !arc.sigma_unknown; });
  fit.noise_scale = 0.0;
  for (const ArcData& arc : problem.arcs)
    if (!(stated && arc.sigma_unknown))
      fit.noise_scale = std::max(fit.noise_scale, main_noise_scale(arc));
  fit.whiteness_p = error.whiteness.p_value;
  fit.correlation_time_s = error.whiteness.correlation_time_s;
  fit.rank = error.rank;
  fit.condition = error.condition;
  fit.null_vectors = error.null_vectors;
}

}  // namespace

void describe_arcs(const Problem& problem, data::Fit& fit) {
  for (const ArcData& arc : problem.arcs)
    fit.arcs.push_back({arc.track, arc.object, arc.t_s.front(), arc.t_s.back(),
                        static_cast<int>(arc.t_s.size()), main_noise_scale(arc)});
  fit.time_origin_s = problem.arcs.front().start_s;
}

void describe(const Problem& problem, const Solution& solution, const Uncertainty& error,
              const data::Scene& scene, data::Fit& fit) {
  describe_quality(problem, solution.u, error, fit);
  report_parameters(problem, error, scene.fit, fit);
  describe_arcs(problem, fit);
  warn(problem, error, fit);
  warn_short_rim(problem, solution.u, fit);
  warn_thick_air(scene, fit);
  add_derived_velocity(problem, solution.u, error.covariance, fit);
  if (fit.model.starts_with("top")) {
    add_derived_top(problem, solution.u, error.covariance, scene, fit);
    warn_short_top(problem, solution.u, fit);
    admit_steady_precession(problem, solution.u, fit);
  }
  const auto broken = broken_degeneracies(problem, solution.u, fit, spin_follows(scene));
  fit.broken_degeneracies.insert(fit.broken_degeneracies.end(), broken.begin(), broken.end());
}

}  // namespace trochoid::fitting
