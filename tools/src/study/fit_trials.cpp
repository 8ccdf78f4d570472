#include "study/fit_trials.hpp"

#include <time.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <span>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/parallel.hpp"
#include "trochoid/fitting/fit.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::tools {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What a person writes who sees only the picture: l a little above the reach of the path, the axis
// towards the first sample, at rest, one per second for the rest.
std::map<std::string, double> blind_start(const MadeTrack& made) {
  std::map<std::string, double> start;
  double reach = 0.0;
  for (const data::TrackSample& sample : made.track.samples)
    reach = std::max(reach, sample.centre_m.norm());
  const Eigen::Vector2d first = made.track.samples.front().centre_m;
  for (const auto& [name, truth] : made.truth) start[name] = 0.0;
  if (!start.contains("l_m")) return {};
  const double l = 1.2 * reach;
  start["l_m"] = l;
  start["a_1_s2"] = start["b_1_s"] = 1.0;
  start["theta_rad"] = std::asin(std::min(1.0, first.norm() / l));
  start["phi_rad"] = std::atan2(first.x(), -first.y());
  return start;
}

double largest_error(const MadeTrack& made, const data::Fit& fit) {
  double worst = 0.0;
  for (const std::string& name : made.judged) {
    const data::FitParameter* parameter = fit.find(name);
    if (parameter == nullptr) return kInfinity;
    worst = std::max(worst, std::abs(parameter->value / made.truth.at(name) - 1.0));
  }
  return worst;
}

struct Attempt {
  data::Fit fit;
  bool refused = false;  // a track the fit does not take, as a puck that hardly slides
  double time_ms = 0.0;
};

Attempt attempt(const MadeTrack& made, fitting::Strategy strategy,
                std::map<std::string, double> start) {
  fitting::FitOptions options;
  options.strategy = strategy;
  options.start = std::move(start);
  options.threads = 1;
  Attempt result;
  const double begin = thread_time_ms();
  try {
    result.fit = fitting::fit(std::span(&made.track, 1), made.scene, options);
  } catch (const Error&) {
    result.refused = true;
  }
  result.time_ms = thread_time_ms() - begin;
  return result;
}

bool answered(const data::Fit& fit) {
  return !fit.parameters.empty() && std::isfinite(fit.chi2);
}

// A fit that says of itself that a better minimum may exist.
bool doubted(const data::Fit& fit) {
  return !fit.converged ||
         std::any_of(fit.warnings.begin(), fit.warnings.end(), [](const std::string& warning) {
           return warning.find("better minimum") != std::string::npos;
         });
}

bool near_best(double chi2, double best) {
  return chi2 <= 1.001 * best + 0.5;
}

std::vector<FitTrial> trials_of_scene(const MadeTrackOptions& tracks,
                                      const std::vector<FitStrategy>& strategies,
                                      std::uint64_t seed, int scene) {
  std::mt19937_64 generator = generator_of(seed, scene);
  const MadeTrack made = make_track(tracks, generator);
  const std::map<std::string, double> off = start_off(made, generator);
  // From the truth the minimiser falls into the nearest minimum, which is nearly always the best.
  const Attempt from_truth = attempt(made, fitting::Strategy::single, made.truth);
  double best = answered(from_truth.fit) ? from_truth.fit.chi2 : kInfinity;
  std::vector<FitTrial> trials;
  for (int s = 0; s < static_cast<int>(strategies.size()); ++s) {
    const FitStrategy& strategy = strategies[static_cast<std::size_t>(s)];
    std::map<std::string, double> start;
    if (strategy.start == FitStrategy::Start::off) start = off;
    if (strategy.start == FitStrategy::Start::blind) start = blind_start(made);
    const bool top = made.scene.model.name == "top";
    if ((strategy.tops_only || strategy.start == FitStrategy::Start::blind) && !top) continue;
    const Attempt tried = attempt(made, strategy.strategy, start);
    FitTrial trial{.scene = scene, .strategy = s, .start_path = tried.fit.start_path};
    trial.time_ms = tried.time_ms;
    trial.converged = tried.fit.converged;
    trial.doubted = doubted(tried.fit);
    trial.chi2 = answered(tried.fit) ? tried.fit.chi2 : kInfinity;
    trial.error = answered(tried.fit) ? largest_error(made, tried.fit) : kInfinity;
    trial.dof = tried.fit.dof;
    best = std::min(best, trial.chi2);
    trials.push_back(std::move(trial));
  }
  for (FitTrial& trial : trials) {
    trial.chi2_best = best;
    trial.optimum = near_best(trial.chi2, best);
  }
  return trials;
}

// Errors of the free parameters, angles by the shortest way.
Eigen::VectorXd errors_of(const MadeTrack& made, const data::Fit& fit) {
  Eigen::VectorXd errors(static_cast<Eigen::Index>(fit.covariance_names.size()));
  for (Eigen::Index i = 0; i < errors.size(); ++i) {
    const std::string& name = fit.covariance_names[static_cast<std::size_t>(i)];
    const data::FitParameter* parameter = fit.find(name);
    errors[i] = parameter->value - made.truth.at(name);
    if (parameter->unit == "rad") errors[i] = data::wrapped(errors[i]);
  }
  return errors;
}

// Of all samples at the fitted values with the noise that was put in: no robust weights.
double chi2_of(const MadeTrack& made, const data::Fit& fit) {
  const auto predictor = model::make_predictor(made.scene);
  const auto& parameters = predictor->parameters();
  Eigen::VectorXd values(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const data::FitParameter* fitted = fit.find(parameters[i].name);
    values[static_cast<Eigen::Index>(i)] = fitted != nullptr ? fitted->value : parameters[i].value;
  }
  std::vector<double> t_s;
  for (const data::TrackSample& sample : made.track.samples) t_s.push_back(sample.t_s);
  model::PredictRequest request;
  request.t_s = t_s;
  request.observables.push_back(model::Observable::psi_rad);
  const model::Prediction run = predictor->predict(values, request);
  double chi2 = 0.0;
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    const data::TrackSample& sample = made.track.samples[i];
    const Eigen::Vector3d at = run.values.segment<3>(3 * static_cast<Eigen::Index>(i));
    chi2 += (sample.centre_m - at.head<2>()).squaredNorm() / sample.covariance_m2(0, 0);
    if (sample.psi) chi2 += std::pow((sample.psi->value_rad - at[2]) / sample.psi->sigma_rad, 2);
  }
  return chi2;
}

struct Draw {
  bool used = false, refused = false;
  std::map<std::string, bool> inside;
  double mahalanobis2 = 0.0;
  double likelihood_ratio = 0.0;  // chi-square at the truth less chi-square at the fit
};

Draw draw(const MadeTrackOptions& tracks, std::uint64_t seed, int index) {
  std::mt19937_64 generator = generator_of(seed, index);
  const MadeTrack made = make_track(tracks, generator);
  const Attempt from_truth = attempt(made, fitting::Strategy::single, made.truth);
  const Attempt tried = attempt(made, fitting::Strategy::automatic, {});
  Draw result;
  result.refused = tried.refused;
  // A track taken for two throws has states the truth does not know.
  result.used = answered(tried.fit) && tried.fit.arcs.size() == 1 &&
                near_best(tried.fit.chi2, from_truth.fit.chi2);
  if (!result.used) return result;
  const Eigen::VectorXd errors = errors_of(made, tried.fit);
  constexpr double kTwoSided95 = 1.959963984540054;
  for (Eigen::Index i = 0; i < errors.size(); ++i)
    result.inside[tried.fit.covariance_names[static_cast<std::size_t>(i)]] =
        std::abs(errors[i]) < kTwoSided95 * std::sqrt(tried.fit.covariance(i, i));
  const Eigen::VectorXd scale = tried.fit.covariance.diagonal().cwiseSqrt();
  const Eigen::MatrixXd correlation =
      scale.cwiseInverse().asDiagonal() * tried.fit.covariance * scale.cwiseInverse().asDiagonal();
  const Eigen::VectorXd scaled = errors.cwiseQuotient(scale);
  result.mahalanobis2 = scaled.dot(correlation.ldlt().solve(scaled));
  result.likelihood_ratio = made.chi2_of_truth - chi2_of(made, tried.fit);
  return result;
}

}  // namespace

double thread_time_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

std::vector<FitStrategy> fit_strategies() {
  using fitting::Strategy;
  using Start = FitStrategy::Start;
  return {{"no guess", Strategy::automatic, Start::none},
          {"integral matching only", Strategy::integral, Start::none},
          {"multiple shooting", Strategy::multiple, Start::off, true},
          {"growing window", Strategy::growing, Start::off},
          {"single shooting", Strategy::single, Start::off},
          {"single, blind start", Strategy::single, Start::blind}};
}

std::vector<FitTrial> fit_trials(const MadeTrackOptions& tracks,
                                 const std::vector<FitStrategy>& strategies, int count,
                                 std::uint64_t seed, int threads,
                                 const std::function<void(int)>& progress) {
  std::vector<std::vector<FitTrial>> scenes(static_cast<std::size_t>(count));
  std::atomic<int> done{0};
  data::in_parallel(scenes.size(), threads, [&](std::size_t i) {
    scenes[i] = trials_of_scene(tracks, strategies, seed, static_cast<int>(i));
    if (progress) progress(++done);
  });
  std::vector<FitTrial> trials;
  for (std::vector<FitTrial>& scene : scenes)
    for (FitTrial& trial : scene) trials.push_back(std::move(trial));
  return trials;
}

Coverage fit_coverage(const MadeTrackOptions& tracks, int draws, std::uint64_t seed, int threads,
                      const std::function<void(int)>& progress) {
  std::vector<Draw> all(static_cast<std::size_t>(draws));
  std::atomic<int> done{0};
  data::in_parallel(all.size(), threads, [&](std::size_t i) {
    all[i] = draw(tracks, seed, static_cast<int>(i));
    if (progress) progress(++done);
  });
  Coverage coverage;
  coverage.draws = draws;
  for (const Draw& one : all) {
    coverage.refused += one.refused;
    if (!one.used) continue;
    ++coverage.used;
    coverage.parameters = static_cast<int>(one.inside.size());
    coverage.mahalanobis2 += one.mahalanobis2;
    coverage.likelihood_ratio += one.likelihood_ratio;
    for (const auto& [name, inside] : one.inside) coverage.inside_95[name] += inside;
  }
  const double used = std::max(1, coverage.used);
  coverage.mahalanobis2 /= used;
  coverage.likelihood_ratio /= used;
  for (auto& [name, share] : coverage.inside_95) share /= used;
  return coverage;
}

}  // namespace trochoid::tools
