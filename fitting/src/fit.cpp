#include "trochoid/fitting/fit.hpp"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "arcs.hpp"
#include "bootstrap.hpp"
#include "derived.hpp"
#include "find.hpp"
#include "observed.hpp"
#include "problem.hpp"
#include "profile.hpp"
#include "segments.hpp"
#include "smoothing.hpp"
#include "statistics.hpp"
#include "strategy.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/inertia.hpp"

namespace trochoid::fitting {
namespace {

ChannelChoice channels_of(const std::string& model) {
  if (model == "pivot") return {.position = false, .psi = true};
  if (model == "puck") return {.position = true, .psi = true};
  return {.position = true, .theta = true, .phi = true, .psi = true};
}

// A puck's track falls apart at impacts and rest; other bodies are followed throughout.
std::vector<SampleRange> ranges_of(const data::Track& track, const std::string& model,
                                   const FitOptions& options) {
  const SampleRange chosen = chosen_range(track, options.from, options.to);
  const SampleRange kept{chosen.first,
                         kept_samples(chosen.first, chosen.second, options.hold_back)};
  if (model == "puck") return sliding_ranges(track, kept);
  return {kept};
}

std::vector<ArcData> arcs_of(std::span<const data::Track> tracks, const std::string& model,
                             const data::Scene& scene, const FitOptions& options) {
  const bool folded = scene.body && scene.body->kind != data::BodyKind::top &&
                      scene.body->faces_look_alike() && model != "top";
  std::vector<ArcData> arcs;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    data::check(tracks[i], fmt::format("track {}", i + 1));
    for (const auto& [first, last] : ranges_of(tracks[i], model, options)) {
      ArcData arc = make_arc(tracks[i], first, last, channels_of(model), folded);
      arc.track = static_cast<int>(i);
      if (arc.readings.empty())
        throw InputError(fmt::format(
            "track {}: no sample has positions in metres; track with a scale or a camera file",
            i + 1));
      arcs.push_back(std::move(arc));
    }
  }
  if (arcs.empty())
    throw InputError(
        "no track has a stretch in which the puck slides freely, slowing down; are the positions "
        "in metres, and does it move?");
  return arcs;
}

// 0.02 sigma of a typical sample over the size of the path, within what the integrators do well.
double tolerance_for(const std::vector<ArcData>& arcs, double share) {
  double least = 1e-5;
  for (const ArcData& arc : arcs) {
    if (arc.observable_index(model::Observable::x_m) < 0) continue;
    const Eigen::MatrixX2d xy = arc.positions_m();
    const double extent = (xy.colwise().maxCoeff() - xy.colwise().minCoeff()).maxCoeff();
    std::vector<double> weights;
    for (const Reading& reading : arc.readings)
      if (reading.channel == Channel::position) weights.push_back(reading.whitener.norm());
    const double sigma = 1.0 / std::max(median(std::move(weights)), 1e-300);
    if (extent > 0.0) least = std::min(least, share * sigma / extent);
  }
  return std::clamp(least, 1e-11, 1e-5);
}

Starter top_starter(const model::Predictor& predictor, bool free_pivot) {
  const int px = predictor.index_of("pivot_x_m"), py = predictor.index_of("pivot_y_m");
  const Eigen::Vector2d known(px >= 0 ? predictor.parameters()[px].value : 0.0,
                              py >= 0 ? predictor.parameters()[py].value : 0.0);
  return [=](const ArcData& window) {
    if (!free_pivot) return top_starts(window, known);
    std::vector<Start> all;
    for (const Eigen::Vector2d& pivot : pivot_guesses(window))
      for (Start& start : top_starts(window, pivot)) all.push_back(std::move(start));
    return all;
  };
}

Starter rim_starter(const data::Scene& scene) {
  data::Body body = *scene.body;
  const model::CentralInertia inertia = model::central_inertia(body);
  const RimShape shape{body.radius_m,
                       body.half_thickness_m(),
                       inertia.transverse_kg_m2 / inertia.mass_kg,
                       inertia.axial_kg_m2 / inertia.mass_kg,
                       scene.model.gravity_m_s2,
                       scene.model.name == "sliding"};
  return [shape](const ArcData& window) { return rim_starts(window, shape); };
}

Starter starter_for(const model::Predictor& predictor, const data::Scene& scene) {
  const std::string& model = predictor.model_name();
  if (model.starts_with("top")) return top_starter(predictor, scene.fit.free_pivot);
  if ((model == "rolling" || model == "sliding" || model == "smooth") && scene.body)
    return rim_starter(scene);
  if (model == "puck") {
    const double gravity_m_s2 = scene.model.gravity_m_s2;
    return [=](const ArcData& window) { return puck_starts(window, gravity_m_s2); };
  }
  if (model == "pivot") return pivot_starts;
  return [](const ArcData&) { return std::vector<Start>{}; };
}

// Turns parameters on that only some measurements show, and off those nothing shows: the spin angle
// without a mark, and a puck's spin, which the path alone hardly carries.
void suit_to_data(Problem& problem, const data::Scene& scene) {
  const bool puck = problem.predictor->model_name() == "puck";
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    const bool seen = problem.arcs[arc].observable_index(model::Observable::psi_rad) >= 0;
    for (const char* name : {"psi_rad", "omega_s_rad_s", "w3_rad_s"}) {
      if (name == std::string("w3_rad_s") && !puck) continue;
      const int index = problem.predictor->index_of(name);
      if (index < 0 || scene.fit.fixed.contains(name)) continue;
      const auto same = [&](const FreeParameter& p) { return p.index == index && p.arc == arc; };
      const bool is_free = std::any_of(problem.free.begin(), problem.free.end(), same);
      if (seen && !is_free) problem.free.push_back({index, arc, {}, {}, {}});
      if (!seen && is_free) std::erase_if(problem.free, same);
    }
  }
  // A face that is crowned rests further in than its rim; path and spin together tell.
  const int contact = problem.predictor->index_of("contact_radius_m");
  const bool spin_seen = std::any_of(problem.arcs.begin(), problem.arcs.end(), [](const auto& arc) {
    return arc.observable_index(model::Observable::psi_rad) >= 0;
  });
  const bool listed = std::any_of(problem.free.begin(), problem.free.end(),
                                  [&](const auto& p) { return p.index == contact; });
  if (puck && contact >= 0 && spin_seen && !listed && scene.fit.free.empty() &&
      !scene.fit.fixed.contains("contact_radius_m")) {
    const double radius_m = problem.predictor->parameters()[contact].value;
    problem.free.push_back(
        {contact, -1, {Transform::Kind::limited, 0.0, 1.5 * radius_m}, {}, {}, radius_m});
  }
  std::stable_sort(problem.free.begin(), problem.free.end(),
                   [](const FreeParameter& a, const FreeParameter& b) { return a.arc < b.arc; });
}

// Robust weights and noise until they settle; the tolerance tightened until integration is silent.
Solution polish(Problem& problem, Solution solution, double fixed_tolerance) {
  // Weights within half a per cent and chi-square within a millionth: a hundredth of a sigma.
  constexpr double kSettled = 5e-3;
  for (int round = 0; round < 6; ++round) {
    const double change = reweight(problem, solution.u, true);
    if (change < kSettled && (round > 0 || fixed_tolerance <= 0.0)) break;
    const Solution next = solve(problem, solution.u, {.function_tolerance = 1e-7});
    if (!next.usable) break;
    solution = next;
  }
  return solution;
}

std::string outcome_word(const data::Fit& fit) {
  return fit.converged ? "converged" : "no_convergence";
}

// Standard deviations if scale and frame rate were exact: what two clips of one camera share falls
// out of their comparison. Empty if neither is in doubt.
Eigen::VectorXd sigma_of_one_camera(const Problem& problem, const Eigen::MatrixXd& covariance) {
  std::vector<int> shared;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (const std::string name = problem.name(i); name == kScale || name == kTimeFactor)
      shared.push_back(i);
  if (shared.empty()) return {};
  const Eigen::MatrixXd across = covariance(Eigen::all, shared);
  const Eigen::MatrixXd reduced =
      covariance - across * covariance(shared, shared).ldlt().solve(across.transpose());
  return reduced.diagonal().cwiseMax(0.0).cwiseSqrt();
}

void report_parameters(const Problem& problem, const Uncertainty& error, data::Fit& fit) {
  const auto& infos = problem.predictor->parameters();
  fit.covariance = error.covariance;
  const Eigen::VectorXd one_camera = sigma_of_one_camera(problem, error.covariance);
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
          fmt::format("; +- {:.2g} between clips of this scale and frame rate", one_camera[i]);
    if (free.held && free.transform.is_over_decades())
      parameter.note +=
          fmt::format("; not seen: between 0 and {:.2g} at 95 %", 1.96 * parameter.sigma);
    if (free.prior && parameter.sigma > 0.9 * free.prior->sigma)
      parameter.status = data::ParameterStatus::prior;
    if (!std::isfinite(parameter.sigma)) parameter.identifiable = false;
    fit.parameters.push_back(parameter);
  }
  for (int index = 0; index < static_cast<int>(infos.size()); ++index) {
    const bool is_free = std::any_of(problem.free.begin(), problem.free.end(),
                                     [&](const FreeParameter& p) { return p.index == index; });
    // An unseen spin angle is not a fixed value, it is simply absent.
    if (is_free || (infos[index].role == model::ParameterInfo::Role::initial)) continue;
    fit.parameters.push_back({infos[index].name, problem.base[0][index], 0.0, infos[index].unit,
                              data::ParameterStatus::fixed, true, infos[index].meaning});
  }
}

void report_arcs(const Problem& problem, data::Fit& fit) {
  for (const ArcData& arc : problem.arcs)
    fit.arcs.push_back(
        {arc.track, arc.object, arc.t_s.front(), arc.t_s.back(), static_cast<int>(arc.t_s.size())});
  fit.time_origin_s = problem.arcs.front().start_s;
}

void warn(const Problem& problem, const Uncertainty& error, data::Fit& fit) {
  for (const data::NullVector& vector : fit.null_vectors) fit.warnings.push_back(vector.words);
  for (const ArcData& arc : problem.arcs)
    if (arc.sigma_unknown) {
      fit.warnings.push_back("the track has no covariances: sigma is estimated from the residuals");
      break;
    }
  if (error.whiteness.inflation > 1.0)
    fit.warnings.push_back(
        fmt::format("residuals hang together over {:.3g} s: error bars widened by {:.2f}",
                    error.whiteness.correlation_time_s, std::sqrt(error.whiteness.inflation)));
}

// Nutation of the axis: its frequency is near |b - 2 dphi cos(theta)| for small amplitudes.
void warn_short_top(const Problem& problem, data::Fit& fit) {
  const auto* b = fit.find("b_1_s");
  const auto* rate = fit.find("dphi_rad_s");
  const auto* theta = fit.find("theta_rad");
  if (b == nullptr || rate == nullptr || theta == nullptr) return;
  const double frequency = std::abs(b->value - 2.0 * rate->value * std::cos(theta->value));
  const double periods = problem.arcs[0].duration_s() * frequency / (2.0 * 3.14159265358979323846);
  if (periods >= 1.0) return;
  fit.warnings.push_back(fmt::format(
      "the track is about {:.2g} nutation periods long; below one, a, b and l are hardly separable",
      periods));
}

// Squares of the positions, in units of the track's sigmas: about the prediction, about their mean,
// and about a smooth curve.
struct Squares {
  bool ok = true;
  double residual = 0.0, motion = 0.0, scatter = 0.0;
};

Squares squares(const Problem& problem, const Solution& solution) {
  Squares sum;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    const ArcData& data = problem.arcs[arc];
    if (data.observable_index(model::Observable::x_m) < 0) continue;
    Problem plain = problem;
    plain.noise_scale.fill(1.0);
    Eigen::VectorXd r;
    if (!evaluate(plain, arc, solution.u, r, nullptr)) return {.ok = false};
    const Eigen::MatrixX2d xy = data.positions_m();
    const Eigen::RowVector2d mean = xy.colwise().mean();
    const double noise_m = noise_about_smooth_curve(data.t_s, xy);
    for (const Reading& reading : data.readings) {
      if (reading.channel != Channel::position) continue;
      const Eigen::Matrix2d wt = reading.whitener.transpose();
      sum.residual += r.segment<2>(reading.row).squaredNorm();
      sum.motion += (wt * (reading.value - mean.transpose())).squaredNorm();
      sum.scatter += wt.squaredNorm() * noise_m * noise_m;
    }
  }
  return sum;
}

// A quiet minimiser in the wrong valley: the residuals carry a good part of the motion although the
// samples scatter far less about a smooth curve.
bool explains_path(const Squares& sum) {
  return sum.ok && (sum.residual <= 0.03 * sum.motion || sum.residual <= 4.0 * sum.scatter);
}

void warn_unexplained(const Squares& sum, data::Fit& fit) {
  // Twice the scatter: more than a smoothing curve misjudges the noise.
  if (!sum.ok || sum.residual <= 4.0 * sum.scatter) return;
  fit.warnings.push_back(
      fmt::format("the residuals are {:.1f} times the scatter of the samples about a smooth curve: "
                  "the model lacks something, or a better minimum exists",
                  std::sqrt(sum.residual / sum.scatter)));
}

}  // namespace

namespace {

data::Fit fit_with(std::span<const data::Track> tracks, const model::Predictor& plain,
                   const std::vector<const model::Predictor*>& relatives,
                   const data::Scene& given_scene, const FitOptions& options) {
  if (tracks.empty()) throw InputError("no track to fit");
  data::Scene scene = given_scene;
  scene.fit.free_pivot = scene.fit.free_pivot || options.free_pivot;
  const auto wrapped = observed(plain, scene);
  const model::Predictor& predictor = wrapped ? *wrapped : plain;
  const std::string model = predictor.model_name();
  Problem problem = make_problem(predictor, arcs_of(tracks, model, scene, options), scene);
  problem.log = options.log;
  for (int c = 0; c < kChannels; ++c)
    for (const ArcData& arc : problem.arcs)
      problem.noise_scale[c] =
          std::max(problem.noise_scale[c], excess_scatter(arc, static_cast<Channel>(c)));
  suit_to_data(problem, scene);
  const int needed = static_cast<int>(problem.free.size());
  if (problem.rows() <= needed)
    throw InputError(fmt::format("{} measurements cannot determine {} parameters of model '{}'",
                                 problem.rows(), needed, model));
  for (const auto& [name, value] : options.start)
    if (const int index = predictor.index_of(name); index >= 0)
      for (Eigen::VectorXd& base : problem.base) base[index] = value;
  problem.tolerance =
      options.tolerance > 0.0 ? options.tolerance : tolerance_for(problem.arcs, 3e-3);

  data::Fit result;
  result.model = model;
  result.seed = options.seed;
  const bool start_given = !options.start.empty() || scene.start.theta_rad.has_value();
  // The search leaves aside what stands out; the polish weighs every sample by its residual.
  Problem search = problem;
  for (ArcData& arc : search.arcs) arc = arc.keep(consistent_samples(arc));
  const Found found =
      find(search, {starter_for(predictor, scene), &options, start_given, relatives});
  problem.base = search.base;
  Solution solution = found.solution;
  result.start_path = found.path;
  if (!solution.usable) {
    result.outcome = "no_convergence";
    result.reason = "no start led to a prediction of the whole track";
    report_arcs(problem, result);
    return result;
  }
  if (hold_vanished(problem, solution.u)) solution = solve(problem, problem.start());
  solution = polish(problem, solution, options.tolerance);
  result.integration_error_sigma = integration_error_sigma(problem, solution.u);
  while (options.tolerance <= 0.0 && result.integration_error_sigma > 0.01 &&
         problem.tolerance > 1e-12) {
    problem.tolerance *= 1e-2;
    const Solution finer = solve(problem, solution.u);
    if (!finer.usable) break;
    solution = finer;
    result.integration_error_sigma = integration_error_sigma(problem, solution.u);
  }
  problem.set_base(solution.u);
  solution.u = problem.start();

  Uncertainty error;
  try {
    error = uncertainty(problem, solution.u);
  } catch (const NumericalError& failure) {
    // A finer tolerance can run into the step limit where a coarse one did not.
    result.outcome = "no_convergence";
    result.reason = failure.what();
    report_arcs(problem, result);
    return result;
  }
  const Criteria score = criteria(problem, solution.u, error.whiteness.inflation);
  result.chi2 = score.chi2;
  result.dof = score.rows - needed;
  result.aicc = score.aicc;
  result.bic = score.bic;
  result.noise_scale =
      problem.noise_scale[problem.arcs[0].observables[0] == model::Observable::x_m ? 0 : 3];
  result.whiteness_p = error.whiteness.p_value;
  result.correlation_time_s = error.whiteness.correlation_time_s;
  result.rank = error.rank;
  result.condition = error.condition;
  result.null_vectors = error.null_vectors;
  report_parameters(problem, error, result);
  report_arcs(problem, result);
  const double inflation = error.whiteness.inflation;
  if (options.profile)
    result.profiles = profiles(problem, solution, error.covariance.diagonal().cwiseSqrt(),
                               inflation, options.threads);
  if (options.bootstrap > 0)
    result.bootstrap = bootstrap(problem, solution, error.whiteness.correlation_time_s,
                                 options.bootstrap, options.seed, options.threads);
  warn(problem, error, result);
  if (model.starts_with("top")) {
    add_derived_top(problem, solution.u, error.covariance, scene, result);
    warn_short_top(problem, result);
  }
  const Squares sum = squares(problem, solution);
  warn_unexplained(sum, result);
  result.converged = solution.converged && explains_path(sum);
  result.outcome = outcome_word(result);
  result.reason = result.converged
                      ? fmt::format("{} iterations from {}", solution.iterations, result.start_path)
                  : solution.converged ? "the best path found leaves most of the motion unexplained"
                                       : solution.message;
  return result;
}

// Easier relatives of a sliding body, see Quest: the exact Coulomb law, and a sharply regularised
// one, make a rough cost and stiff equations.
std::vector<std::unique_ptr<model::Predictor>> relatives_of(data::Scene scene) {
  constexpr double kGentle_m_s = 1e-3;
  std::vector<std::unique_ptr<model::Predictor>> relatives;
  if (scene.model.name != "sliding") return relatives;
  scene.model.name = "rolling";
  relatives.push_back(model::make_predictor(scene));
  if (scene.model.slip_regularisation_m_s.value_or(0.0) < 0.7 * kGentle_m_s) {
    scene.model.name = "sliding";
    scene.model.slip_regularisation_m_s = kGentle_m_s;
    relatives.push_back(model::make_predictor(scene));
  }
  return relatives;
}

}  // namespace

data::Fit fit(std::span<const data::Track> tracks, const model::Predictor& predictor,
              const data::Scene& scene, const FitOptions& options) {
  return fit_with(tracks, predictor, {}, scene, options);
}

data::Fit fit(std::span<const data::Track> tracks, const data::Scene& given_scene,
              const FitOptions& options) {
  data::Scene scene = given_scene;
  if (!options.model.empty()) scene.model.name = options.model;
  const auto predictor = model::make_predictor(scene);
  const auto relatives = relatives_of(scene);
  std::vector<const model::Predictor*> plain;
  for (const auto& relative : relatives) plain.push_back(relative.get());
  return fit_with(tracks, *predictor, plain, scene, options);
}

}  // namespace trochoid::fitting
