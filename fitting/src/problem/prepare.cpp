#include "problem/prepare.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "observe/arcs.hpp"
#include "observe/camera_error.hpp"
#include "observe/segments.hpp"
#include "observe/smoothing.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

ChannelChoice channels_of(const std::string& model) {
  if (model == "pivot") return {.position = false, .psi = true};
  if (model == "puck") return {.position = true, .psi = true};
  return {.position = true, .theta = true, .phi = true, .psi = true};
}

// A puck's track falls apart at impacts and rest; a disc on a pivot has to be let go first; other
// bodies are followed throughout.
std::vector<SampleRange> ranges_of(const data::Track& track, const std::string& model,
                                   const FitOptions& options) {
  const SampleRange chosen = chosen_range(track, options.from, options.to);
  const SampleRange kept{chosen.first,
                         kept_samples(chosen.first, chosen.second, options.hold_back)};
  if (model == "puck") return sliding_ranges(track, kept);
  if (model == "pivot" && options.from.empty()) return {{released_at(track, kept), kept.second}};
  return {kept};
}

// The same measurements twice would count twice.
void check_new(std::span<const data::Track> tracks, std::size_t i) {
  const auto alike = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a == b || (!a.allFinite() && !b.allFinite());
  };
  const auto equal = [](const std::optional<data::MeasuredAngle>& a,
                        const std::optional<data::MeasuredAngle>& b) {
    return a.has_value() == b.has_value() && (!a || a->value_rad == b->value_rad);
  };
  const auto same = [&](const data::TrackSample& a, const data::TrackSample& b) {
    return a.t_s == b.t_s && alike(a.centre_m, b.centre_m) && alike(a.centre_px, b.centre_px) &&
           equal(a.theta, b.theta) && equal(a.phi, b.phi) && equal(a.psi, b.psi);
  };
  for (std::size_t k = 0; k < i; ++k)
    if (std::equal(tracks[k].samples.begin(), tracks[k].samples.end(), tracks[i].samples.begin(),
                   tracks[i].samples.end(), same))
      throw TrackError(
          fmt::format("track {} is the same as track {}; a recording counts once", i + 1, k + 1));
}

std::vector<ArcData> arcs_of(std::span<const data::Track> tracks, const std::string& model,
                             const data::Scene& scene, const FitOptions& options) {
  const bool folded = scene.body && scene.body->kind != data::BodyKind::top &&
                      scene.body->faces_look_alike() && !model.starts_with("top");
  std::vector<ArcData> arcs;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    data::check(tracks[i], fmt::format("track {}", i + 1));
    check_new(tracks, i);
    const std::size_t before = arcs.size();
    for (const auto& [first, last] : ranges_of(tracks[i], model, options)) {
      ArcData arc = make_arc(tracks[i], first, last, channels_of(model), folded);
      arc.track = static_cast<int>(i);
      arc.held =
          model == "pivot" && first > chosen_range(tracks[i], options.from, options.to).first;
      if (arc.readings.empty())
        throw TrackError(fmt::format("track {}: no sample has {}", i + 1,
                                     model == "pivot"
                                         ? "a spin angle psi_rad, which the pivot model is fitted "
                                           "to; name the mark under [body] and track again"
                                         : "positions in metres; track with a scale or a camera "
                                           "file"));
      arcs.push_back(std::move(arc));
    }
    share_guessed_noise(std::span(arcs).subspan(before));
  }
  if (arcs.empty())
    throw TrackError(
        "no track has a stretch in which the puck slides freely, slowing down; are the positions "
        "in metres, and does it move?");
  return arcs;
}

// A share of a typical sample's sigma over the size of the path, within what the integrators do
// well.
double tolerance_for(const std::vector<ArcData>& arcs, double share) {
  double least = 1e-5;
  for (const ArcData& arc : arcs) {
    if (arc.observable_index(model::Observable::x_m) < 0) continue;
    const double extent = extent_m(arc);
    std::vector<double> weights;
    for (const Reading& reading : arc.readings)
      if (reading.channel == Channel::position) weights.push_back(reading.whitener.norm());
    const double sigma = 1.0 / std::max(median_or_zero(std::move(weights)), 1e-300);
    if (extent > 0.0) least = std::min(least, share * sigma / extent);
  }
  return std::clamp(least, 1e-11, 1e-5);
}

// The path is the same for either sense of a spin: at none it does not tell which way to go.
void start_turning(const data::Prior& prior, double& spin_rad_s) {
  constexpr double kShare = 0.25;  // of the prior's standard deviation
  if (spin_rad_s != 0.0) return;
  spin_rad_s = prior.value != 0.0 ? prior.value : kShare * prior.sigma;
}

// Turns parameters on that only some measurements show, and off those nothing shows: the spin angle
// without a mark, and a puck's spin, which the path alone hardly carries, unless a prior does.
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
      const data::Prior* prior = puck ? prior_of(name, arc, scene.fit) : nullptr;
      const bool told = prior != nullptr;
      const double value = told ? prior->value : problem.base[arc][index];
      if ((told || seen) && !is_free)
        problem.free.push_back(free_parameter(*problem.predictor, scene.fit, index, arc, value));
      if (told && !seen && name == std::string("w3_rad_s"))
        start_turning(*prior, problem.base[arc][index]);
      if (seen || told) continue;
      if (is_free) std::erase_if(problem.free, same);
      // A first value says nothing of how fast it turns: as if it did not, which the error bars
      // allow for.
      if (name == std::string("w3_rad_s")) problem.base[arc][index] = 0.0;
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
    // Where they do not, it lies somewhere within the face: at its bounds it would bend the spin.
    constexpr double kAnywhere = 0.5;
    FreeParameter radius = free_parameter(*problem.predictor, scene.fit, contact, -1,
                                          problem.predictor->parameters()[contact].value);
    const double face_m = scene.body->radius_m;
    if (!radius.prior) radius.prior = data::Prior{face_m, kAnywhere * face_m};
    problem.free.push_back(radius);
  }
  std::stable_sort(problem.free.begin(), problem.free.end(),
                   [](const FreeParameter& a, const FreeParameter& b) { return a.arc < b.arc; });
}

// Is omega_s / I of a top at first, without its sign; 0 of other bodies. At least what nutates once
// in the record: a scene may say nothing of the spin.
double top_spin_1_s(const Problem& problem, double record_s) {
  const int index = problem.predictor->index_of("b_1_s");
  return index < 0 ? 0.0 : std::max(std::abs(problem.base[0][index]), data::kTurn / record_s);
}

// What a loss is to be multiplied by to be a rate of decay [1/s]: of a top's dry and quadratic
// drags that depends on how fast it spins. 0: it is none.
double decay_per_rate(const Problem& problem, const std::string& unit, double record_s) {
  if (unit == "1/s") return 1.0;
  const double spin_1_s = top_spin_1_s(problem, record_s);
  if (spin_1_s == 0.0) return 0.0;
  return unit == "1/s^2" ? 1.0 / spin_1_s : spin_1_s;
}

// Rates of decay start where they show in the record and let the body go on through it, whatever
// the scene's first value: a start decades away ends before the track does or moves nothing.
void start_decay_within_sight(Problem& problem) {
  constexpr double kLeast = 0.01, kTypical = 0.3, kMost = 3.0;  // decay over the whole record
  double longest_s = 0.0;
  for (const ArcData& arc : problem.arcs) longest_s = std::max(longest_s, arc.duration_s());
  if (!(longest_s > 0.0)) return;
  for (FreeParameter& parameter : problem.free) {
    const model::ParameterInfo& info = problem.predictor->parameters()[parameter.index];
    if (!is_loss(problem, parameter)) continue;
    const double per_rate = decay_per_rate(problem, info.unit, longest_s);
    if (per_rate == 0.0) continue;
    const double decay = parameter.given * per_rate * longest_s;
    if (decay > kLeast && decay < kMost) continue;
    parameter.given = kTypical / (per_rate * longest_s);
    for (Eigen::VectorXd& base : problem.base) base[parameter.index] = parameter.given;
  }
}

// Values by name of what is free: for all arcs or, with "@i", for arc i.
void take_start(const std::map<std::string, double>& start, Problem& problem) {
  const auto& parameters = problem.predictor->parameters();
  for (const FreeParameter& parameter : problem.free)
    for (std::size_t arc = 0; arc < problem.base.size(); ++arc) {
      const std::string& name = parameters[parameter.index].name;
      auto given = start.find(fmt::format("{}@{}", name, arc));
      if (given == start.end()) given = start.find(name);
      if (given != start.end()) problem.base[arc][parameter.index] = given->second;
    }
}

bool says_something_of(const data::FitSettings& fit, const std::string& name) {
  return fit.fixed.contains(name) || fit.prior.contains(name) || fit.bounds.contains(name) ||
         std::find(fit.free.begin(), fit.free.end(), name) != fit.free.end();
}

// The velocity of a body that is known to roll when its record begins follows from its spin, unless
// the scene says otherwise.
void tie_to_spin(const data::Scene& scene, Problem& problem) {
  const auto is_velocity = [&](int index) {
    const std::string& name = problem.predictor->parameters()[index].name;
    return name == "vx_m_s" || name == "vy_m_s";
  };
  if (problem.predictor->model_name() != "sliding" || problem.arcs.size() > 1 ||
      says_something_of(scene.fit, "vx_m_s") || says_something_of(scene.fit, "vy_m_s"))
    return;
  problem.rolls_at_first = true;
  std::erase_if(problem.free, [&](const FreeParameter& p) { return is_velocity(p.index); });
}

// Of several recordings each brings what is its own: where and how fast it starts.
void check_each_determined(const Problem& problem) {
  std::map<int, std::pair<int, int>> rows_and_own;
  for (const ArcData& arc : problem.arcs) rows_and_own[arc.track].first += arc.rows;
  for (const FreeParameter& parameter : problem.free)
    if (parameter.arc >= 0 && !parameter.prior)
      ++rows_and_own[problem.arcs[parameter.arc].track].second;
  if (rows_and_own.size() < 2) return;
  for (const auto& [track, counts] : rows_and_own)
    if (const auto [rows, own] = counts; rows <= own)
      throw TrackError(fmt::format(
          "track {}: its {} numbers cannot determine the {} parameters of its own start", track + 1,
          rows, own));
}

}  // namespace

double frame_time_s(std::span<const data::Track> tracks) {
  std::vector<double> steps_s;
  for (const data::Track& track : tracks)
    for (std::size_t i = 1; i < track.samples.size(); ++i)
      steps_s.push_back(track.samples[i].t_s - track.samples[i - 1].t_s);
  return median_or_zero(std::move(steps_s));
}

Problem prepare(std::span<const data::Track> tracks, const model::Predictor& predictor,
                const data::Scene& scene, const FitOptions& options) {
  const std::string& model = predictor.model_name();
  Problem problem = make_problem(predictor, arcs_of(tracks, model, scene, options), scene);
  problem.shortfalls = std::make_shared<Shortfalls>();
  if (const auto camera = options.camera != nullptr ? *options.camera : uncertain_camera(scene))
    note_camera_shifts(*camera, scene, problem.frees_camera(), problem.arcs);
  std::map<int, std::array<double, kChannels>> scatter;  // by track
  for (const ArcData& whole : problem.arcs) {
    const ArcData arc = whole.keep(consistent_samples(whole));
    auto& most = scatter.try_emplace(arc.track, arc.noise_scale).first->second;
    for (int c = 0; c < kChannels; ++c)
      most[c] = std::max(most[c], excess_scatter(arc, static_cast<Channel>(c)));
  }
  for (ArcData& arc : problem.arcs) arc.noise_scale = scatter.at(arc.track);
  suit_to_data(problem, scene);
  if (options.rolls_at_first) tie_to_spin(scene, problem);
  if (problem.free.empty())
    throw InputError(fmt::format(
        "[fit] leaves no parameter of model '{}' to be fitted: take one out of fixed", model));
  check_each_determined(problem);
  const int needed = static_cast<int>(problem.free.size());
  if (problem.rows() <= needed)
    throw TrackError(
        fmt::format("the track's {} measurements{} cannot determine {} parameters of model '{}'",
                    problem.rows(), problem.arcs.front().held ? " after the body is let go" : "",
                    needed, model));
  start_decay_within_sight(problem);
  take_start(options.start, problem);
  problem.tolerance =
      options.tolerance > 0.0 ? options.tolerance : tolerance_for(problem.arcs, 3e-3);
  return problem;
}

}  // namespace trochoid::fitting
