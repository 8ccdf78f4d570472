#include "choose/rung.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "choose/softness.hpp"
#include "judge/first_guess.hpp"
#include "observe/timing.hpp"
#include "problem/prepare.hpp"
#include "problem/problem.hpp"
#include "start/strategy.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

bool has_all_terms_of(const Rung& rung, const Rung& other) {
  return std::includes(rung.terms.begin(), rung.terms.end(), other.terms.begin(),
                       other.terms.end());
}

bool ended_above(const Rung& larger, const Rung& known) {
  const double rows = known.fit.dof + known.parameters;
  const double paid = std::max(0, larger.parameters - known.parameters) * std::log(rows);
  return larger.fit.bic > known.fit.bic + paid + kBareMention;
}

bool usable(const data::Fit& fit) {
  return !fit.parameters.empty() && std::isfinite(fit.chi2);
}

bool leaves_much(const Rung& rung) {
  return rung.fit.verdict == data::FitVerdict::doubtful ||
         rung.fit.verdict == data::FitVerdict::unexplained;
}

bool leaves_independent(const Rung& rung, double inflation) {
  return rung.fit.whiteness_p >= kWhite || inflation < kNearlyIndependent;
}

bool explains(const Rung& rung) {
  constexpr double kTrackersOwn = 1.3;
  return rung.fitted && !leaves_much(rung) &&
         (rung.fit.whiteness_p >= kWhite || rung.fit.noise_scale <= kTrackersOwn);
}

data::Fit with_full_bars(const Rung& rung) {
  return rung.full ? rung.full() : rung.fit;
}

void take(Draft draft, Rung& rung) {
  rung.fit = std::move(draft.fit);
  rung.full = std::move(draft.full);
  rung.settled = draft.settled;
}

namespace {

// Those of one of several arcs alone under their names there ("x_m@1").
std::map<std::string, double> values_of_all_arcs(const data::Fit& fit) {
  std::map<std::string, double> values;
  for (const data::FitParameter& parameter : fit.parameters)
    if (parameter.status != data::ParameterStatus::derived && std::isfinite(parameter.value))
      values[parameter.name] = parameter.value;
  return values;
}

}  // namespace

std::map<std::string, double> values_of(const data::Fit& fit) {
  return fit.arcs.size() < 2 ? values_of_all_arcs(fit) : std::map<std::string, double>{};
}

namespace {

// Of the typical size of a parameter: near the solution without it; and what no residual sees.
constexpr double kLittle = 0.02, kNext = 1e-6;

using Values = std::map<std::string, double>;

// The power of the spin b by which each of a top's drags on it goes, over b itself: how fast it
// slows the spin.
constexpr std::pair<const char*, double> kSpinDrags[] = {
    {"gamma3_dry_1_s2", -1.0}, {"gamma3_1_s", 0.0}, {"gamma3_quadratic", 1.0}};

// Typical size of a parameter beside known values: drags slow the spin at like rates, and one
// beside another has little left to do.
double typical_size(const model::ParameterInfo& info, const Values& known) {
  constexpr double kTypical_1_s = 5e-4;  // a little of it turns no mark astray
  const auto spin = known.find("b_1_s");
  if (spin == known.end() || spin->second == 0.0) return info.value;
  const bool beside_another =
      std::any_of(std::begin(kSpinDrags), std::end(kSpinDrags),
                  [&](const auto& drag) { return known.contains(drag.first); });
  for (const auto& [name, power] : kSpinDrags)
    if (info.name == name && (power != 0.0 || beside_another))
      return kTypical_1_s * std::pow(std::abs(spin->second), -power);
  return info.value;
}

// What took the place of another drag on the spin begins by slowing it at the same rate, halfway
// through the record: from nothing the way is long.
void hand_over_spin_drag(const data::Fit& known, const Values& before, Values& start,
                         const std::set<std::string>& own) {
  const auto spin = before.find("b_1_s");
  if (spin == before.end() || spin->second == 0.0) return;
  double b_1_s = std::abs(spin->second), rate_1_s = 0.0;
  for (const auto& [name, power] : kSpinDrags)
    if (const auto drag = before.find(name); drag != before.end() && !own.contains(name))
      rate_1_s += drag->second * std::pow(b_1_s, power);
  // Nor where next to nothing is left: a drag that goes by its inverse would have to be infinite.
  constexpr double kMost = 3.0;
  b_1_s *= std::exp(-std::min(kMost, 0.5 * rate_1_s * (known.arcs[0].to_s - known.arcs[0].from_s)));
  for (const auto& [name, power] : kSpinDrags)
    if (rate_1_s > 0.0 && own.contains(name) && !before.contains(name))
      start[name] = rate_1_s * std::pow(b_1_s, -power);
}

// Parameters of a rung that are not among the known values, at a share of their typical size.
Values further_parameters(const Values& known, const Rung& rung, double share) {
  Values further;
  const auto predictor = model::make_predictor(rung.scene);
  for (const model::ParameterInfo& info : predictor->parameters())
    if (info.role == model::ParameterInfo::Role::dynamics && !known.contains(info.name))
      further[info.name] = share * typical_size(info, known);
  return further;
}

// From a known rung's values on.
Values extended_start(const Rung& known, const Rung& rung) {
  Values start = values_of(known.fit);
  start.merge(further_parameters(values_of_all_arcs(known.fit), rung, kLittle));
  if (known.fit.arcs.size() == 1)
    hand_over_spin_drag(known.fit, values_of(known.fit), start, parameters_of(rung.scene));
  return start;
}

void keep_better(Draft draft, Rung& rung) {
  if (!usable(rung.fit) || (usable(draft.fit) && draft.fit.chi2 < rung.fit.chi2))
    take(std::move(draft), rung);
}

// By BIC: one of the two may have the softness of its friction as a parameter more.
void keep_better(Rung searched, Rung& rung) {
  if (!usable(rung.fit) || (usable(searched.fit) && searched.fit.bic < rung.fit.bic))
    rung = std::move(searched);
}

// Whether a rung's gap layer is as viscous as a film of water or oil, of which the scene says
// nothing.
bool has_a_wet_floor(const Rung& rung) {
  const data::FitParameter* gap = rung.fit.find("gap_viscosity_Pa_s");
  return gap != nullptr && gap->status == data::ParameterStatus::free &&
         gap->value > kThickestAir_Pa_s && !tells_of_a_film(rung.scene);
}

// Scores and reason, once the fit is made.
void conclude(Rung& rung) {
  if (rung.fitted) rung.reason = rung.fit.converged ? "" : rung.fit.reason;
  if (!rung.fitted && rung.reason.empty()) rung.reason = rung.fit.reason;
  rung.parameters = static_cast<int>(rung.fit.covariance_names.size());
  if (!rung.fitted) return;
  rung.aicc = rung.fit.aicc;
  rung.bic = rung.fit.bic;
  // Other losses of filmed bodies had looked like a gap layer 28 to 2600 times as viscous as air.
  constexpr double kOneInAThousand = 13.8;  // 2 log(1000)
  if (!has_a_wet_floor(rung)) return;
  rung.aicc += kOneInAThousand;
  rung.bic += kOneInAThousand;
  if (rung.reason.empty())
    rung.reason = fmt::format(
        "AICc and BIC hold {} for a wet floor, of which the scene says nothing", kOneInAThousand);
}

// Runs an attempt at a rung and scores it. What has no answer, or more parameters than the track
// has measurements, is no reason to give up the other rungs; without the plainest there are none.
void try_rung(Rung& rung, const std::function<void()>& fit) {
  const auto give_up = [&](const Error& error) {
    rung.fitted = usable(rung.fit);
    rung.reason = error.what();
  };
  try {
    fit();
  } catch (const NumericalError& error) {
    give_up(error);
  } catch (const TrackError& error) {
    if (rung.terms.empty()) throw;
    give_up(error);
  }
  conclude(rung);
}

// Whether a slip at the start ends within so few samples that the body may as well have rolled.
bool slips_unseen_at_first(std::span<const data::Track> tracks, const Rung& rung) {
  constexpr double kFewSamples = 8.0;
  if (!rung.fitted || !rung.fit.converged || rung.fit.arcs.size() != 1 ||
      rung.scene.model.name != "sliding" || rung.rolls_at_first)
    return false;
  const auto predictor = model::make_predictor(rung.scene);
  const Eigen::VectorXd values = fitted_values(*predictor, rung.fit);
  const auto value = [&](const char* name) { return values[predictor->index_of(name)]; };
  const Eigen::Vector2d v_m_s(value("vx_m_s"), value("vy_m_s"));
  const double slip_m_s = (v_m_s - rolling_velocity(*predictor, values).m_s).norm();
  const double brake_m_s2 = value("friction") * rung.scene.model.gravity_m_s2;
  return slip_m_s < kFewSamples * frame_time_s(tracks) * brake_m_s2;
}

void start_from_other_model(const Values& values, FitOptions& options) {
  options.start = values;
  options.start_path = "other_model";
}

void fit_from(std::span<const data::Track> tracks, const Values& values, Strategy strategy,
              const FitOptions& options, Rung& rung) {
  FitOptions own = options;
  start_from_other_model(values, own);
  own.strategy = strategy;
  own.rolls_at_first = rung.rolls_at_first;
  try_rung(rung, [&] {
    take(draft_one_of_several(tracks, rung.scene, own), rung);
    rung.fitted = usable(rung.fit);
  });
}

// Fits a rung beside a known one, from these values: where that one's friction sets in gently, this
// one's may as well.
void go_on_beside(std::span<const data::Track> tracks, const Rung& known, const FitOptions& options,
                  Rung& rung) {
  if (softness_is_open(rung) && !softness_is_open(known))
    fit_softly(tracks, options, rung);
  else
    take(draft_one_of_several(tracks, rung.scene, options, nullptr, known.settled), rung);
}

// The same rung, not yet fitted.
Rung rolling_at_first(Rung rung) {
  rung.rolls_at_first = true;
  rung.fitted = false;
  rung.fit = {}, rung.full = {};
  return rung;
}

}  // namespace

// Where its end is all that is known of the first samples, they have to be followed anew.
void let_roll_at_first(std::span<const data::Track> tracks, const FitOptions& options, Rung& rung) {
  if (!slips_unseen_at_first(tracks, rung)) return;
  for (const Strategy strategy : {Strategy::single, Strategy::growing}) {
    Rung rolls = rolling_at_first(rung);
    fit_from(tracks, values_of(rung.fit), strategy, options, rolls);
    if (!rolls.fitted || !rolls.fit.converged) continue;
    if (rolls.bic < rung.bic + kStrong) rung = std::move(rolls);
    return;
  }
}

void fit_rung(std::span<const data::Track> tracks, const Rung* below, const Term* term,
              const FitOptions& options, Rung& rung, Reach reach) {
  FitOptions own = options;
  if (below != nullptr) own.rolls_at_first = rung.rolls_at_first = below->rolls_at_first;
  const data::Scene asked = rung.scene;
  try_rung(rung, [&] {
    const bool extends = below != nullptr && below->fitted && below->fit.arcs.size() == 1;
    if (extends) {
      start_from_other_model(extended_start(*below, rung), own);
      own.strategy = Strategy::single;
      go_on_beside(tracks, *below, own, rung);
    }
    // Near a solution that explains nothing there is nothing to be found.
    const bool near = extends && below->fit.whiteness_p > kWhite && usable(rung.fit) &&
                      rung.fit.chi2 <= below->fit.chi2 * (1.0 + 1e-6);
    if (reach == Reach::search && !near && (!usable(rung.fit) || rung.fit.whiteness_p < kWhite)) {
      own.start = options.start;
      own.start_path = options.start_path;
      if (term != nullptr)
        for (const auto& [name, value] : term->start) own.start[name] = value;
      if (extends)
        hand_over_spin_drag(below->fit, values_of(below->fit), own.start,
                            parameters_of(rung.scene));
      own.strategy = options.strategy;
      // A search may find another law of friction than what it goes on from.
      Rung searched = rung;
      searched.scene = asked;
      if (softness_is_open(searched)) {
        fit_softly(tracks, own, searched);
        keep_better(std::move(searched), rung);
      } else {
        keep_better(draft_one_of_several(tracks, asked, own, &rung.first_part), rung);
      }
    }
    rung.fitted = usable(rung.fit);
  });
  if (softness_is_open(rung)) let_roll_at_first(tracks, options, rung);
}

void begin_as(std::span<const data::Track> tracks, const Rung& known, const FitOptions& options,
              Rung& rung) {
  if (rung.scene.model.name != "sliding" || rung.rolls_at_first || rung.by_score_test ||
      !usable(rung.fit))
    return;
  Values start = values_of(rung.fit);
  const auto predictor = model::make_predictor(rung.scene);
  for (const model::ParameterInfo& info : predictor->parameters())
    if (const data::FitParameter* begins = known.fit.find(info.name);
        info.role == model::ParameterInfo::Role::initial && begins != nullptr)
      start[info.name] = begins->value;
  Rung rolls = rolling_at_first(rung);
  fit_from(tracks, start, Strategy::single, options, rolls);
  if (rolls.fitted && rolls.fit.converged) rung = std::move(rolls);
}

std::optional<ScoreTest> score_test(std::span<const data::Track> tracks, const Rung& known,
                                    const FitOptions& options, const Rung& larger,
                                    const std::map<int, std::set<std::string>>& others) {
  FitOptions at = options;
  at.rolls_at_first = known.rolls_at_first;
  at.start = values_of_all_arcs(known.fit);
  std::set<std::string> further;
  for (const auto& [name, value] : further_parameters(at.start, larger, kNext)) {
    at.start[name] = value;
    further.insert(name);
  }
  data::Scene scene = larger.scene;
  scene.model.slip_regularisation_m_s = known.scene.model.slip_regularisation_m_s;
  try {
    return score_test(tracks, scene, at, further, others);
  } catch (const TrackError&) {
  } catch (const NumericalError&) {
  }
  return std::nullopt;
}

void doubt_as_a_whole(std::span<const data::Track> tracks, const Rung& rung,
                      const FitOptions& options, data::Fit& fit) {
  FitOptions at = options;
  at.rolls_at_first = rung.rolls_at_first;
  at.start = values_of_all_arcs(rung.fit);
  try {
    doubt_as_a_whole(tracks, rung.scene, at, fit);
  } catch (const NumericalError&) {  // integrated as coarsely as a search does
  }
}

double variance_inflation(std::span<const data::Track> tracks, const Rung& known,
                          const FitOptions& options) {
  FitOptions at = options;
  at.rolls_at_first = known.rolls_at_first;
  at.start = values_of_all_arcs(known.fit);
  try {
    return variance_inflation(tracks, known.scene, at);
  } catch (const NumericalError&) {  // integrated as coarsely as a search does
    return 1.0;
  }
}

void fit_from_first_part(std::span<const data::Track> tracks, const FirstPart& first_part,
                         const FitOptions& options, Rung& rung) {
  FitOptions own = options;
  own.start = first_part.values;
  own.start_path = "windows";
  const bool slides = rung.scene.model.name == "sliding";
  own.strategy = slides ? Strategy::rolls_first : Strategy::growing;
  own.rolls_at_first = rung.rolls_at_first = slides;
  try_rung(rung, [&] {
    take(draft_one_of_several(tracks, rung.scene, own, &rung.first_part), rung);
    rung.fitted = usable(rung.fit);
  });
}

void fit_creeping(std::span<const data::Track> tracks, const Rung& rolling,
                  const FitOptions& options, Rung& rung) {
  FitOptions own = options;
  start_from_other_model(extended_start(rolling, rung), own);
  own.start["friction"] = *rung.scene.model.friction;  // a little of it holds nothing
  own.strategy = Strategy::single;
  own.rolls_at_first = rung.rolls_at_first = true;
  try_rung(rung, [&] {
    if (softness_is_open(rung))
      fit_softly(tracks, own, rung);
    else
      take(draft_one_of_several(tracks, rung.scene, own), rung);
    rung.fitted = usable(rung.fit);
  });
}

namespace {

// Values by name when a sliding body has come to roll, carried back to where its record begins at
// the rates it has then; nothing where it still slips after so many samples.
std::optional<Values> as_if_rolling_all_along(const Rung& sliding, double frame_s) {
  constexpr double kStill = 1e-3;  // of the speed of its size
  constexpr int kMost = 32;
  const auto predictor = model::make_predictor(sliding.scene);
  Eigen::VectorXd values = fitted_values(*predictor, sliding.fit);
  std::vector<int> state;
  for (int i = 0; i < values.size(); ++i)
    if (predictor->parameters()[i].role == model::ParameterInfo::Role::initial) state.push_back(i);
  const double speed_m_s =
      std::sqrt(sliding.scene.model.gravity_m_s2 * sliding.scene.body->radius_m);
  const auto value = [&](const char* name) -> double& { return values[predictor->index_of(name)]; };
  model::PredictRequest request;
  request.want_end_state = true;
  request.rolls_at_first = sliding.rolls_at_first;
  const Eigen::VectorXd start = values;
  for (int sample = 0; sample <= kMost; ++sample) {
    const std::array<double, 1> at_s{sample * frame_s};
    request.t_s = at_s;
    const Eigen::VectorXd there = predictor->predict(start, request).end_state;
    if (there.size() != std::ssize(state)) return std::nullopt;  // it has ended
    values(state) = there;
    const Eigen::Vector2d v_m_s(value("vx_m_s"), value("vy_m_s"));
    if (!((v_m_s - rolling_velocity(*predictor, values).m_s).norm() < kStill * speed_m_s)) continue;
    value("x_m") -= at_s[0] * v_m_s.x();
    value("y_m") -= at_s[0] * v_m_s.y();
    value("phi_rad") -= at_s[0] * value("w2_rad_s") / std::sin(value("theta_rad"));
    value("theta_rad") -= at_s[0] * value("w1_rad_s");
    Values named;
    for (int i = 0; i < values.size(); ++i) named[predictor->parameters()[i].name] = values[i];
    return named;
  }
  return std::nullopt;
}

}  // namespace

void fit_rolling(std::span<const data::Track> tracks, const Rung& sliding,
                 const FitOptions& options, Rung& rung) {
  try_rung(rung, [&] {
    const auto values = as_if_rolling_all_along(sliding, frame_time_s(tracks));
    if (!values) return;
    FitOptions own = options;
    start_from_other_model(*values, own);
    for (const Strategy strategy : {Strategy::single, Strategy::growing}) {
      own.strategy = strategy;
      keep_better(draft_one_of_several(tracks, rung.scene, own), rung);
      if (usable(rung.fit) && !leaves_much(rung)) break;
    }
    rung.fitted = usable(rung.fit);
  });
}

void fit_softly_beside(std::span<const data::Track> tracks, const Rung& known,
                       const FitOptions& options, Rung& rung) {
  FitOptions own = options;
  start_from_other_model(values_of(known.fit), own);
  own.strategy = Strategy::single;
  own.rolls_at_first = rung.rolls_at_first = known.rolls_at_first;
  try_rung(rung, [&] {
    fit_softly(tracks, own, rung);
    rung.fitted = usable(rung.fit);
  });
}

void fit_from_values(std::span<const data::Track> tracks,
                     const std::map<std::string, double>& values, const FitOptions& options,
                     Rung& rung) {
  fit_from(tracks, values, Strategy::single, options, rung);
}

void take_from_score_test(const Rung& known, const ScoreTest& test, const ScoreTest::Change& change,
                          double inflation, Rung& rung) {
  const double gained = (test.before - change.chi2) / inflation;
  rung.fit = known.fit;
  rung.fit.chi2 -= gained;
  for (data::FitParameter& parameter : rung.fit.parameters) {
    const auto value = change.values.find(parameter.name);
    const auto further = change.further.find(parameter.name);
    if (value != change.values.end()) parameter.value = value->second;
    if (further != change.further.end())
      parameter.sigma = std::sqrt(parameter.sigma * parameter.sigma + inflation * further->second);
  }
  const auto predictor = model::make_predictor(rung.scene);
  for (const model::ParameterInfo& info : predictor->parameters())
    if (const auto sigma = change.sigmas.find(info.name); sigma != change.sigmas.end())
      rung.fit.parameters.push_back({info.name, change.values.at(info.name),
                                     sigma->second * std::sqrt(inflation), info.unit,
                                     data::ParameterStatus::free, true, ""});
  rung.rolls_at_first = known.rolls_at_first;
  rung.fitted = rung.by_score_test = true;
  rung.reason =
      "it would gain too little by the derivatives beside the model without it, and was not fitted";
  rung.parameters = known.parameters + change.parameters;
  rung.aicc = known.aicc + 2.0 * change.parameters - gained;
  rung.bic = known.bic + change.parameters * std::log(test.rows) - gained;
}

namespace {

// Fits a rung beside a known one, from these values.
void fit_beside(std::span<const data::Track> tracks, const Rung& known, const FitOptions& options,
                Rung& rung) {
  try_rung(rung, [&] {
    go_on_beside(tracks, known, options, rung);
    rung.fitted = usable(rung.fit);
  });
}

// Whether a rung does about as well beside a known one as was expected.
bool as_expected(const Rung& rung, const Rung& known, const Nearby& near) {
  constexpr double kTwice = 2.0;  // the tangent plane is not the valley
  return rung.fitted && rung.fit.converged &&
         rung.bic < known.bic + kVeryStrong + kTwice * std::max(0.0, near.cost);
}

}  // namespace

bool ended_astray(const Rung& smaller, const Rung& known, const Nearby& near) {
  return !near.values.empty() && !smaller.fitted_anew && explains(known) &&
         known.fit.arcs.size() == 1 && has_all_terms_of(known, smaller) &&
         !as_expected(smaller, known, near);
}

void fit_neighbour(std::span<const data::Track> tracks, const Rung& known,
                   const FitOptions& options, Rung& rung, const Nearby& near) {
  FitOptions own = options;
  own.rolls_at_first = rung.rolls_at_first = known.rolls_at_first;
  if (known.fit.arcs.size() != 1) return fit_beside(tracks, known, own, rung);
  own.strategy = Strategy::single;
  const Rung blank = rung;
  const Values from_known = extended_start(known, rung);
  if (!near.values.empty()) {
    Values near_by = near.values;
    near_by.insert(from_known.begin(), from_known.end());
    start_from_other_model(near_by, own);
    fit_beside(tracks, known, own, rung);
    if (as_expected(rung, known, near)) return;
  }
  Rung again = blank;
  start_from_other_model(from_known, own);
  fit_beside(tracks, known, own, again);
  const bool better = again.fitted && (!rung.fitted || again.bic < rung.bic);
  if (better || !usable(rung.fit)) rung = std::move(again);
}

}  // namespace trochoid::fitting
