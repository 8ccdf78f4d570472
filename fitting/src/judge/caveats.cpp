#include "judge/caveats.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "judge/adequacy.hpp"
#include "judge/body_doubt.hpp"
#include "judge/influence.hpp"
#include "judge/one_parameter.hpp"
#include "judge/profile.hpp"
#include "problem/linearise.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"
#include "trochoid/model/idle_keys.hpp"

namespace trochoid::fitting {

namespace {

// As far as chi-square goes on its flatter side; what goes with the parameter goes farther with it.
void reach(const Problem& problem, const Solution& solution, const FarSide& far, Uncertainty& error,
           data::Fit& fit) {
  constexpr double kWorthWords = 1.3;
  const double variance = error.covariance(far.index, far.index);
  const double times = far.sigma / std::sqrt(variance);
  if (!(times > 1.0)) return;
  const Eigen::VectorXd along = error.covariance.col(far.index) / variance;
  error.covariance += (far.sigma * far.sigma - variance) * along * along.transpose();
  error.identifiable[far.index] = far.sigma < natural_size(problem, far.index, solution.u);
  if (times > kWorthWords)
    fit.warnings.push_back(fmt::format(
        "chi-square is lopsided in {}: its error bar is that of the flatter side, {:.2g} "
        "times what the curvature says (the profile shows both sides)",
        problem.name(far.index), times));
}

// What l sin(theta) and its rate leave open, per relative change of l.
Eigen::VectorXd along_upright_tops(const Problem& problem, const Eigen::VectorXd& u) {
  Eigen::VectorXd along = Eigen::VectorXd::Zero(u.size());
  for (int i = 0; i < static_cast<int>(u.size()); ++i) {
    const std::string& name = problem.predictor->parameters()[problem.free[i].index].name;
    const Eigen::VectorXd values = problem.values(std::max(0, problem.free[i].arc), u);
    const double theta = values[problem.predictor->index_of("theta_rad")];
    if (name == "l_m") along[i] = problem.value(i, u);
    if (name == "theta_rad") along[i] = -std::tan(theta);
    if (name == "dtheta_rad_s") along[i] = -problem.value(i, u) / std::pow(std::cos(theta), 2);
  }
  return along;
}

}  // namespace

void heed_far_side(const Problem& problem, const Solution& solution, int threads,
                   Uncertainty& error, data::Fit& fit) {
  if (problem.predictor->index_of("friction") < 0) return;
  if (!explains(problem, solution)) return;  // a bar about another path means nothing
  if (const auto far = far_side_of_friction(problem, solution, error, threads))
    reach(problem, solution, *far, error, fit);
}

void heed_upright_top(const Problem& problem, const Solution& solution, const UprightTop& top,
                      Uncertainty& error, data::Fit& fit) {
  constexpr double kUnseen = 1e3;  // relative, as of a direction the data do not see at all
  if (!explains(problem, solution)) return;
  const double l_m = problem.value(top.length, solution.u);
  if (top.most_m)
    return reach(problem, solution, {top.length, (*top.most_m - l_m) / std::sqrt(kQuantile95)},
                 error, fit);
  const Eigen::VectorXd along = along_upright_tops(problem, solution.u);
  // What stays determined is so to as far as it goes with l.
  Eigen::VectorXd shift = Eigen::VectorXd::Zero(along.size());
  for (int i = 0; i < static_cast<int>(along.size()); ++i)
    if (along[i] == 0.0) shift[i] = problem.value(i, top.far) - problem.value(i, solution.u);
  error.covariance += kUnseen * kUnseen * along * along.transpose() + shift * shift.transpose();
  for (int i = 0; i < static_cast<int>(along.size()); ++i)
    error.identifiable[i] =
        error.identifiable[i] && along[i] == 0.0 &&
        std::sqrt(error.covariance(i, i)) < natural_size(problem, i, solution.u);
}

void tell_open_length(const Problem& problem, const Solution& solution, const UprightTop& top,
                      data::Fit& fit) {
  if (top.most_m || !explains(problem, solution)) return;
  const Eigen::VectorXd along = along_upright_tops(problem, solution.u);
  for (int i = 0; i < static_cast<int>(along.size()); ++i)
    for (data::FitParameter& parameter : fit.parameters)
      if (along[i] != 0.0 && parameter.name == problem.name(i))
        parameter.sigma = std::numeric_limits<double>::infinity();
  const double theta = problem.values(0, solution.u)[problem.predictor->index_of("theta_rad")];
  fit.warnings.push_back(fmt::format(
      "the path determines only l sin(theta) = {:.4g} m at the start: l is at least {:.2g} m (95 "
      "%), and no larger one, the axis more upright, is ruled out",
      problem.value(top.length, solution.u) * std::sin(theta), top.least_m));
}

void heed_single_samples(const Problem& problem, const Solution& solution, Uncertainty& error,
                         data::Fit& fit) {
  constexpr double kWorthWords = 1.3;
  if (!explains(problem, solution)) return;
  const Eigen::VectorXd before = error.covariance.diagonal().cwiseSqrt();
  for (const InfluentialSample& sample : influential_samples(problem, solution, before)) {
    error.covariance += sample.shift * sample.shift.transpose();
    std::vector<std::string> names;
    for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
      const double sigma = std::sqrt(error.covariance(i, i));
      if (sigma > kWorthWords * before[i]) names.push_back(problem.name(i));
      error.identifiable[i] = error.identifiable[i] && sigma < natural_size(problem, i, solution.u);
    }
    if (!names.empty())
      fit.warnings.push_back(
          fmt::format("{} hang on the sample at t = {:.4g} s alone: their error bars hold "
                      "what comes out without it",
                      fmt::join(names, ", "), sample.t_s));
  }
}

namespace {

// A puck's path is the same for either sense of its spin: unless a prior tells, the spin that fits
// is as likely the other way round.
void heed_either_sense(const Problem& problem, Uncertainty& error, data::Fit& fit) {
  if (fit.model != "puck") return;
  const int spin = problem.predictor->index_of("w3_rad_s");
  constexpr double kTells = 2.0;  // standard deviations
  bool either = false;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    const FreeParameter& free = problem.free[i];
    const int arc = std::max(0, free.arc);
    if (free.index != spin || problem.arcs[arc].observable_index(model::Observable::psi_rad) >= 0 ||
        (free.prior && std::abs(free.prior->value) > kTells * free.prior->sigma))
      continue;
    // What only its prior says of it is no observation of either.
    constexpr double kOfPrior = 0.5;
    if (free.prior && std::sqrt(error.covariance(i, i)) > kOfPrior * free.prior->sigma) continue;
    const double value = problem.base[arc][spin];
    error.covariance(i, i) += 2.0 * value * value;  // the mean square of 0 and 2 w3
    either = true;
  }
  if (either)
    fit.warnings.push_back(
        "the path shows how fast the puck turns, not which way round: the error bar of w3_rad_s "
        "holds either");
}

}  // namespace

void heed_doubts(const Problem& problem, const Solution& solution, const data::Scene& scene,
                 double frame_s, Uncertainty& error, data::Fit& fit) {
  for (const Doubt& doubt : body_doubts(problem, solution.u, scene, frame_s)) {
    error.covariance += doubt.shift * doubt.shift.transpose();
    const data::Prior& prior = scene.fit.prior.at(doubt.name);
    fit.warnings.push_back(fmt::format("error bars allow for {} = {:.6g} ± {:.2g}", doubt.name,
                                       prior.value, prior.sigma));
  }
  heed_either_sense(problem, error, fit);
  const std::vector<Doubt> spins = unseen_spins(problem, solution.u, scene);
  for (const Doubt& spin : spins) error.covariance += spin.shift * spin.shift.transpose();
  if (!spins.empty())
    fit.warnings.push_back(
        "nothing shows the puck's spin: the friction is that of one that does not turn, and its "
        "error bar allows for a rim as fast as the puck slides, as far as the path does not rule "
        "that out; a mark on the face would tell");
}

void tell_idle_priors(const Problem& problem, const data::Scene& scene, data::Fit& fit) {
  for (const std::string& name : idle_priors(problem, scene))
    fit.warnings.push_back(fmt::format(
        "[fit] prior: model '{}' has no '{}', the prior counts for nothing", fit.model, name));
}

void tell_unused_tracks(const Problem& problem, std::span<const data::Track> tracks,
                        data::Fit& fit) {
  for (int track = 0; track < std::ssize(tracks); ++track)
    if (std::none_of(problem.arcs.begin(), problem.arcs.end(),
                     [&](const ArcData& arc) { return arc.track == track; }))
      fit.warnings.push_back(
          fmt::format("track {} counts for nothing: it has no stretch in which the puck slides "
                      "freely, slowing down",
                      track + 1));
}

namespace {

// Pictures a second by a track's times and frame numbers; 0 where it has none.
double picture_rate_hz(std::span<const data::Track> tracks) {
  std::vector<double> steps_s;
  for (const data::Track& track : tracks)
    for (std::size_t i = 1; i < track.samples.size(); ++i)
      if (const data::TrackSample& a = track.samples[i - 1], &b = track.samples[i];
          a.frame >= 0 && b.frame > a.frame)
        steps_s.push_back((b.t_s - a.t_s) / static_cast<double>(b.frame - a.frame));
  const double step_s = steps_s.empty() ? 0.0 : data::median(std::move(steps_s));
  return step_s > 0.0 ? 1.0 / step_s : 0.0;
}

}  // namespace

void tell_other_rate(const data::Scene& scene, std::span<const data::Track> tracks,
                     data::Fit& fit) {
  const auto prior = scene.fit.prior.find("frame_rate_hz");
  if (prior == scene.fit.prior.end() || scene.camera.frame_rate_hz) return;
  constexpr double kClearly = 0.1;
  const double rate_hz = picture_rate_hz(tracks);
  if (rate_hz == 0.0 || std::abs(std::log(prior->second.value / rate_hz)) < kClearly) return;
  fit.warnings.push_back(
      fmt::format("[fit] prior: frame_rate_hz = {:g}, but the track has {:.3g} pictures a second, "
                  "and its times are kept; if they are wrong, track again with [camera] "
                  "frame_rate_hz = {:g}",
                  prior->second.value, rate_hz, prior->second.value));
}

void tell_camera(const Problem& problem, const Uncertainty& error, const data::Scene& scene,
                 data::Fit& fit) {
  std::error_code ignored;
  const std::string& file = scene.camera.file;
  if (!file.empty() && !std::filesystem::is_regular_file(file, ignored))
    fit.warnings.push_back(
        fmt::format("{}: the camera is not there, and what its calibration leaves uncertain is in "
                    "no error bar; "
                    "name its place under [camera] file",
                    file));
  constexpr double kMost = 0.5;
  std::vector<std::string> names;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (error.of_camera(i, i) > kMost * error.covariance(i, i)) names.push_back(problem.name(i));
  if (!names.empty())
    fit.warnings.push_back(fmt::format(
        "what the camera's calibration leaves uncertain is most of the error bar{} of {}",
        names.size() == 1 ? "" : "s", fmt::join(names, ", ")));
}

void tell_rise(const Problem& problem, const Solution& solution, const Uncertainty& error,
               const data::Scene& scene, double frame_s, data::Fit& fit) {
  constexpr double kRise_deg = 0.1;  // as good as a table without care may be
  if (!explains(problem, solution)) return;
  const double rise = std::tan(data::radians(kRise_deg));
  const double of_rise = friction_of_rise(problem, solution.u, scene, rise, frame_s);
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (problem.name(i) == "friction" && of_rise > std::sqrt(error.covariance(i, i)))
      fit.warnings.push_back(fmt::format(
          "the floor is taken for level: a rise of {:g} degrees along the path acts as {:.2g} of "
          "friction, which its error bar does not hold; [fit] prior = {{ slope_x = [0, {:.2g}], "
          "slope_y = [0, {:.2g}] }} allows for it, slides to and fro tell them apart",
          kRise_deg, of_rise, rise, rise));
}

void tell_unlikely_body(const data::Scene& scene, data::Fit& fit) {
  constexpr double kWeakest_m_s2 = 1.0, kStrongest_m_s2 = 30.0;
  if (const double g = scene.model.gravity_m_s2;
      g != 0.0 && (g < kWeakest_m_s2 || g > kStrongest_m_s2))
    fit.warnings.push_back(
        fmt::format("[model] gravity_m_s2 = {:g}: on earth it is 9.81; is it in m/s^2?", g));
  if (!scene.body || scene.body->kind == data::BodyKind::top || !(scene.body->radius_m > 0.0))
    return;
  constexpr double kLightest_kg_m3 = 5.0, kHeaviest_kg_m3 = 25e3, kThickest_radii = 20.0;
  const data::Body& body = *scene.body;
  const double volume_m3 =
      data::kPi * body.thickness_m *
      (body.radius_m * body.radius_m - body.inner_radius_m * body.inner_radius_m);
  if (body.mass_kg && volume_m3 > 0.0)
    if (const double density = *body.mass_kg / volume_m3;
        density < kLightest_kg_m3 || density > kHeaviest_kg_m3)
      fit.warnings.push_back(
          fmt::format("[body] mass_kg = {:g} makes a density of {:.2g} kg/m^3; is it in kg, "
                      "and are the lengths in m?",
                      *body.mass_kg, density));
  if (body.thickness_m > kThickest_radii * body.radius_m)
    fit.warnings.push_back(
        fmt::format("[body] thickness_m = {:g} is {:.3g} times radius_m; are both in m?",
                    body.thickness_m, body.thickness_m / body.radius_m));
}

void tell_unlikely_friction(data::Fit& fit) {
  constexpr double kMost = 2.0;
  const data::FitParameter* friction = fit.find("friction");
  if (friction == nullptr || friction->status == data::ParameterStatus::fixed ||
      !(friction->value - friction->sigma > kMost))
    return;
  fit.warnings.push_back(
      fmt::format("friction = {:.3g}: hardly any two surfaces have one above {:g}; are x_m, y_m in "
                  "metres, and t_s in seconds?",
                  friction->value, kMost));
}

void tell_slope(data::Fit& fit) {
  const data::FitParameter *x = fit.find(kSlopeX), *y = fit.find(kSlopeY);
  const auto fitted = [](const data::FitParameter* slope) {
    return slope != nullptr && slope->status != data::ParameterStatus::fixed;
  };
  if (!fitted(x) && !fitted(y)) return;
  const double rise = std::hypot(x->value, y->value);
  // Along the rise, of which both components have a share; told where it is more than nothing.
  constexpr double kTold = 2.0;
  double variance = 0.0;
  for (std::size_t i = 0; i < fit.covariance_names.size(); ++i)
    for (std::size_t k = 0; k < fit.covariance_names.size(); ++k) {
      const auto along = [&](const std::string& name) {
        return name == kSlopeX ? x->value / rise : name == kSlopeY ? y->value / rise : 0.0;
      };
      variance += along(fit.covariance_names[i]) * along(fit.covariance_names[k]) *
                  fit.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k));
    }
  const double sigma = std::sqrt(variance);
  if (!x->identifiable || !y->identifiable || !(rise > kTold * sigma)) return;
  fit.warnings.push_back(fmt::format(
      "the floor rises by {:.3g} ± {:.1g} degrees, towards {:.0f} degrees as counted from x to y",
      data::degrees(std::atan(rise)), data::degrees(sigma),
      data::degrees(std::atan2(y->value, x->value))));
}

void tell_given_up(const Problem& problem, data::Fit& fit) {
  constexpr double kLittle = 0.1;
  int given_up = 0, all = 0, first_track = 0;
  double first_s = std::numeric_limits<double>::infinity();
  for (std::size_t arc = 0; arc < problem.arcs.size(); ++arc)
    for (const Reading& reading : problem.arcs[arc].readings) {
      ++all;
      if (robust_weight(problem, static_cast<int>(arc), reading) > kLittle) continue;
      ++given_up;
      const double t_s = problem.arcs[arc].t_s[reading.sample];
      if (t_s < first_s) first_s = t_s, first_track = problem.arcs[arc].track;
    }
  if (given_up > 0)
    fit.warnings.push_back(fmt::format(
        "{} of {} positions and angles lie far off and hardly count, the first{} at t = {:.4g} s",
        given_up, all,
        problem.arcs.back().track > 0 ? fmt::format(", of track {},", first_track + 1) : "",
        first_s));
}

namespace {

std::string range_words(const std::pair<double, double>& bounds) {
  const auto [lower, upper] = bounds;
  return !std::isfinite(lower)   ? fmt::format("at most {:g}", upper)
         : !std::isfinite(upper) ? fmt::format("at least {:g}", lower)
                                 : fmt::format("in {:g} .. {:g}", lower, upper);
}

// Bounds are approached and never reached: near is what is little of `size` and within the error,
// which shrinks with the distance. What nothing sees stands nowhere.
bool stands_at(double value, double bound, double size, double sigma) {
  constexpr double kLittle = 0.01, kNear_sigmas = 2.0;
  const double distance = std::abs(value - bound);
  return std::isfinite(bound) && std::isfinite(sigma) && distance <= kLittle * size &&
         distance <= kNear_sigmas * sigma;
}

}  // namespace

std::optional<BoundStoodAt> bound_stood_at(const Problem& problem, const Eigen::VectorXd& u,
                                           const Uncertainty& error,
                                           const data::FitSettings& settings, int index) {
  const FreeParameter& free = problem.free[index];
  const model::ParameterInfo& info = problem.predictor->parameters()[free.index];
  const auto* bounds = said_of(info.name, settings.bounds);
  if (bounds == nullptr) return std::nullopt;
  const double value = free.transform.value(u[index]);
  const double sigma = std::sqrt(error.covariance(index, index));
  const auto [lower, upper] = *bounds;
  const double width = upper - lower;
  const auto size = [&](double bound) {
    return std::isfinite(width) ? width : std::max(std::abs(bound), std::abs(free.given));
  };
  // From what it cannot be anyhow no bound keeps it.
  if (lower > info.lower && stands_at(value, lower, size(lower), sigma))
    return BoundStoodAt{lower, true};
  if (upper < info.upper && stands_at(value, upper, size(upper), sigma))
    return BoundStoodAt{upper, false};
  return std::nullopt;
}

void tell_bounds(const Problem& problem, const Solution& solution, const Uncertainty& error,
                 const data::Scene& scene, data::Fit& fit) {
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (const auto at = bound_stood_at(problem, solution.u, error, scene.fit, i))
      fit.warnings.push_back(fmt::format(
          "{} stands at the {} bound, {:g}, that [fit] bounds give it: the track may say that it "
          "is {}, and its error bar knows nothing of that",
          problem.name(i), at->lower ? "lower" : "upper", at->value, at->lower ? "less" : "more"));
}

void tell_held(const data::Scene& scene, data::Fit& fit) {
  std::vector<std::string> held;
  for (const auto& [name, bounds] : scene.fit.bounds)
    held.push_back(fmt::format("{} {}", name, range_words(bounds)));
  for (const auto& [name, value] : scene.fit.fixed)
    held.push_back(fmt::format("{} = {:g}", name, value));
  if (!held.empty())
    fit.warnings.push_back(fmt::format(
        "[fit] holds {}; is the track's motion among those that are left?", fmt::join(held, ", ")));
}

void tell_idle_pivot(const Problem& problem, const data::Scene& scene, data::Fit& fit) {
  const auto& infos = problem.predictor->parameters();
  const bool has_pivot = std::any_of(infos.begin(), infos.end(),
                                     [](const auto& info) { return info.name == "pivot_x_m"; });
  if (scene.fit.free_pivot && !has_pivot)
    fit.warnings.push_back(fmt::format(
        "free_pivot: model '{}' has no pivot to fit, it counts for nothing", fit.model));
}

void tell_idle_terms(const data::Scene& scene, data::Fit& fit) {
  constexpr std::string_view kTerm = "model.";
  for (const std::string& key : model::idle_keys(scene))
    if (key.starts_with(kTerm))
      fit.warnings.push_back(
          fmt::format("[model] {}: model '{}' has no such term, it counts for "
                      "nothing",
                      key.substr(kTerm.size()), fit.model));
}

}  // namespace trochoid::fitting
