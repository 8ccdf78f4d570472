#include "trochoid/fitting/compare.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "adequacy.hpp"
#include "arcs.hpp"
#include "ladder.hpp"
#include "observed.hpp"
#include "retrograde.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/fitting/parallel.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Evidence by differences of BIC (Kass and Raftery, J. Am. Stat. Assoc. 90, 773, 1995): up to 2
// "not worth more than a bare mention", above 6 "strong", above 10 "very strong". Trackers err a
// little with the motion itself: a further term needs strong evidence.
constexpr double kStrong = 6.0, kVeryStrong = 10.0;
constexpr double kHeldBack = 1.0 / 3.0;

struct Rung {
  std::set<int> terms;  // indices into Ladder::terms
  std::string name;
  data::Scene scene;
  data::Fit fit;
  bool fitted = false;
  double held_back_rms_sigma = std::numeric_limits<double>::quiet_NaN();
  int parameters = 0;
  double aicc = kInfinity, bic = kInfinity;
};

// --- one rung -----------------------------------------------------------------------------------

bool usable(const data::Fit& fit) {
  return !fit.parameters.empty() && std::isfinite(fit.chi2);
}

// Free and fixed values by name; the state of the first arc only where there are several.
std::map<std::string, double> values_of(const data::Fit& fit) {
  const bool single = fit.arcs.size() < 2;
  const auto predictor_like = [&](const data::FitParameter& parameter) {
    return parameter.status != data::ParameterStatus::derived &&
           parameter.name.find('@') == std::string::npos && std::isfinite(parameter.value);
  };
  std::map<std::string, double> values;
  for (const data::FitParameter& parameter : fit.parameters)
    if (single && predictor_like(parameter)) values[parameter.name] = parameter.value;
  return values;
}

// Wrong by at most what a camera would see: squares of (prediction - measurement)/sigma.
struct Squares {
  double sum = 0.0;
  int rows = 0;
  void add(double deviation) {
    sum += deviation * deviation;
    ++rows;
  }
};

void add_squares(const data::TrackSample& sample, const Eigen::Vector3d& predicted, bool angle_only,
                 Squares& squares) {
  if (angle_only && sample.psi) {
    const double off = std::remainder(predicted[2] - sample.psi->value_rad, 2.0 * std::numbers::pi);
    squares.add(off / sample.psi->sigma_rad);
  }
  if (angle_only || !sample.has_metres()) return;
  const Eigen::Vector2d off = predicted.head<2>() - sample.centre_m;
  // Without covariances in metres; the caller divides by the fitted part's rms.
  const Eigen::Matrix2d covariance =
      sample.has_covariance() ? sample.covariance_m2 : Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d L = covariance.llt().matrixL();
  const Eigen::Vector2d whitened = L.triangularView<Eigen::Lower>().solve(off);
  squares.add(whitened.x());
  squares.add(whitened.y());
}

// Squares of the samples [first, last) of a track, predicted from the fit's last arc of that track.
Squares squares_of(const data::Track& track, int first, int last, int track_index,
                   const data::Scene& scene, const data::Fit& fit) {
  Squares squares;
  int arc = -1;
  for (std::size_t i = 0; i < fit.arcs.size(); ++i)
    if (fit.arcs[i].track == track_index) arc = static_cast<int>(i);
  if (arc < 0) return squares;
  const auto plain = model::make_predictor(scene);
  data::Scene measured = scene;
  const auto wrapped = observed(*plain, measured, 0.0);  // scale and frame rate as fitted
  const model::Predictor* predictor = wrapped ? wrapped.get() : plain.get();
  const auto& parameters = predictor->parameters();
  Eigen::VectorXd values(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const std::string own = arc > 0 ? fmt::format("{}@{}", parameters[i].name, arc) : "";
    const data::FitParameter* fitted = own.empty() ? nullptr : fit.find(own);
    if (fitted == nullptr) fitted = fit.find(parameters[i].name);
    values[static_cast<Eigen::Index>(i)] = fitted != nullptr ? fitted->value : parameters[i].value;
  }
  std::vector<double> t_s;
  std::vector<const data::TrackSample*> samples;
  for (int i = first; i < last; ++i) {
    const data::TrackSample& sample = track.samples[static_cast<std::size_t>(i)];
    if (sample.t_s < fit.arcs[static_cast<std::size_t>(arc)].from_s) continue;
    t_s.push_back(sample.t_s);
    samples.push_back(&sample);
  }
  model::PredictRequest request;
  request.t_s = t_s;
  request.start_s = fit.arcs[static_cast<std::size_t>(arc)].from_s;
  request.observables.push_back(model::Observable::psi_rad);
  const bool angle_only = fit.model == "pivot";
  const model::Prediction run = predictor->predict(values, request);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Eigen::Vector3d at = run.values.segment<3>(3 * static_cast<Eigen::Index>(i));
    if (at.allFinite())
      add_squares(*samples[i], at, angle_only, squares);
    else
      squares.add(kInfinity);  // the model ends before the body does
  }
  return squares;
}

// Fits the first two thirds, predicts the rest.
double held_back(std::span<const data::Track> tracks, const Rung& rung, FitOptions options) {
  options.start = values_of(rung.fit);
  if (!options.start.empty()) options.strategy = "single";
  options.hold_back = kHeldBack;
  const data::Fit early = fit(tracks, rung.scene, options);
  if (!usable(early)) return kInfinity;
  Squares seen, unseen;
  bool sigma_known = true;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const auto [first, last] = chosen_range(tracks[i], options.from, options.to);
    const int split = kept_samples(first, last, kHeldBack);
    const int index = static_cast<int>(i);
    const Squares before = squares_of(tracks[i], first, split, index, rung.scene, early);
    const Squares after = squares_of(tracks[i], split, last, index, rung.scene, early);
    seen.sum += before.sum, seen.rows += before.rows;
    unseen.sum += after.sum, unseen.rows += after.rows;
    for (const data::TrackSample& sample : tracks[i].samples)
      sigma_known = sigma_known && (early.model == "pivot" || sample.has_covariance());
  }
  if (unseen.rows == 0 || seen.rows == 0) return std::numeric_limits<double>::quiet_NaN();
  const double rms = std::sqrt(unseen.sum / unseen.rows);
  return sigma_known ? rms : rms / std::sqrt(std::max(seen.sum / seen.rows, 1e-300));
}

// A model that has no answer to part of the track does not predict the rest.
double held_back_or_infinite(std::span<const data::Track> tracks, const Rung& rung,
                             const FitOptions& options) {
  try {
    return held_back(tracks, rung, options);
  } catch (const Error&) {
    return kInfinity;
  }
}

constexpr double kWhite = 0.01;  // p-value above which residuals count as white

// Parameters that `below` does not have start at a fiftieth of their typical size: near the known
// solution.
std::map<std::string, double> extended_start(const Rung& below, const Rung& rung) {
  constexpr double kLittle = 0.02;
  std::map<std::string, double> start = values_of(below.fit);
  const auto predictor = model::make_predictor(rung.scene);
  for (const model::ParameterInfo& info : predictor->parameters())
    if (info.role == model::ParameterInfo::Role::dynamics && below.fit.find(info.name) == nullptr)
      start[info.name] = kLittle * info.value;
  return start;
}

void keep_better(data::Fit fit, Rung& rung) {
  if (!usable(rung.fit) || (usable(fit) && fit.chi2 < rung.fit.chi2)) rung.fit = std::move(fit);
}

// @param below  the fitted rung this one extends by one term; null for the plainest.
void fit_rung(std::span<const data::Track> tracks, const Rung* below, const Term* term,
              const FitOptions& options, Rung& rung) {
  FitOptions own = options;
  try {
    const bool extends = below != nullptr && below->fitted && below->fit.arcs.size() == 1;
    if (extends) {
      own.start = extended_start(*below, rung);
      own.strategy = "single";
      rung.fit = fit(tracks, rung.scene, own);
    }
    // Near a solution that explains nothing there is nothing to be found.
    const bool near = extends && below->fit.whiteness_p > kWhite && usable(rung.fit) &&
                      rung.fit.chi2 <= below->fit.chi2 * (1.0 + 1e-6);
    if (!near && (!usable(rung.fit) || rung.fit.whiteness_p < kWhite)) {
      own.start = options.start;
      if (term != nullptr)
        for (const auto& [name, value] : term->start) own.start[name] = value;
      own.strategy = "auto";
      keep_better(fit(tracks, rung.scene, own), rung);
    }
    rung.fitted = usable(rung.fit);
    if (rung.fitted && rung.fit.converged)
      rung.held_back_rms_sigma = held_back_or_infinite(tracks, rung, options);
  } catch (const NumericalError&) {
    rung.fitted = usable(rung.fit);  // this attempt has no answer; another may have
  }
  rung.parameters = static_cast<int>(rung.fit.covariance_names.size());
  if (!rung.fitted) return;
  rung.aicc = rung.fit.aicc;
  rung.bic = rung.fit.bic;
}

// --- all rungs ----------------------------------------------------------------------------------

const Rung* least_bic(const std::vector<Rung>& rungs) {
  const Rung* best = nullptr;
  for (const Rung& rung : rungs)
    if (rung.fitted && (best == nullptr || rung.bic < best->bic)) best = &rung;
  return best;
}

// Fewest parameters among those as good as the best; among these the least BIC.
const Rung* simplest_sufficient(const std::vector<Rung>& rungs) {
  const Rung* best = least_bic(rungs);
  const double allowed = best != nullptr ? best->bic + kStrong : 0.0;
  for (const Rung& rung : rungs) {
    if (!rung.fitted || rung.bic > allowed) continue;
    if (rung.parameters < best->parameters ||
        (rung.parameters == best->parameters && rung.bic < best->bic))
      best = &rung;
  }
  return best;
}

std::string name_of(const Ladder& ladder, const std::set<int>& terms) {
  std::string name = ladder.law;
  for (const int term : terms) name += " + " + ladder.terms[static_cast<std::size_t>(term)].name;
  return name;
}

Rung rung_with(const Ladder& ladder, const std::set<int>& terms) {
  Rung rung;
  rung.terms = terms;
  rung.name = name_of(ladder, terms);
  rung.scene = ladder.plain;
  for (const int term : terms) ladder.terms[static_cast<std::size_t>(term)].switch_on(rung.scene);
  return rung;
}

// All extensions of rungs[current] by one term, tried at the same time. @returns the index of the
// best rung now known.
std::size_t step_up(const Ladder& ladder, std::span<const data::Track> tracks,
                    const FitOptions& options, bool last_resort, std::size_t current,
                    std::vector<Rung>& rungs) {
  const std::size_t first = rungs.size();
  std::vector<const Term*> added;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    std::set<int> terms = rungs[current].terms;
    if (term.last_resort != last_resort || !terms.insert(index).second) continue;
    rungs.push_back(rung_with(ladder, terms));
    added.push_back(&term);
  }
  FitOptions one = options;
  one.threads = 1;
  in_parallel(static_cast<int>(added.size()), options.threads, [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    fit_rung(tracks, &rungs[current], added[n], one, rungs[first + n]);
  });
  std::size_t best = current;
  for (std::size_t i = first; i < rungs.size(); ++i)
    if (rungs[i].fitted && (!rungs[best].fitted || rungs[i].bic < rungs[best].bic)) best = i;
  return best;
}

// The last resort together with the usual losses: a body that slides without any may not even stay
// on the floor as long as the track. Empty where there is no last resort.
std::set<int> all_that_usually_acts(const Ladder& ladder, std::set<int> terms) {
  bool resort = false;
  for (int index = 0; index < static_cast<int>(ladder.terms.size()); ++index) {
    const Term& term = ladder.terms[static_cast<std::size_t>(index)];
    resort = resort || term.last_resort;
    if (term.last_resort || term.usual) terms.insert(index);
  }
  return resort ? terms : std::set<int>{};
}

// The plainest model and, one more term at a time, all extensions of the best so far.
std::vector<Rung> climb(const Ladder& ladder, std::span<const data::Track> tracks,
                        const FitOptions& given) {
  constexpr std::size_t kMostTerms = 3;
  FitOptions options = given;
  options.profile = false;
  options.bootstrap = 0;
  options.model.clear();
  std::vector<Rung> rungs;
  // References to rungs stay valid while more are added.
  rungs.reserve(2 + (kMostTerms + 1) * ladder.terms.size());
  rungs.push_back(rung_with(ladder, {}));
  fit_rung(tracks, nullptr, nullptr, options, rungs[0]);
  std::size_t current = 0;
  for (std::size_t size = 1; size <= std::min(kMostTerms, ladder.terms.size()); ++size) {
    if (options.progress)
      options.progress(rungs[current].name, static_cast<double>(size - 1) / kMostTerms);
    const std::size_t best = step_up(ladder, tracks, options, false, current, rungs);
    const bool worth = best != current && rungs[best].bic < rungs[current].bic - kStrong;
    if (!worth) break;
    current = best;
  }
  // Residuals that hang together but stay within the track's own noise are the tracker's.
  const auto explains = [&](std::size_t i) {
    return rungs[i].fitted &&
           (rungs[i].fit.whiteness_p >= kWhite || rungs[i].fit.noise_scale <= 1.0);
  };
  if (explains(current)) return rungs;
  const std::size_t last = step_up(ladder, tracks, options, true, current, rungs);
  if (last != current && explains(last)) return rungs;
  if (const auto all = all_that_usually_acts(ladder, rungs[current].terms); !all.empty()) {
    rungs.push_back(rung_with(ladder, all));
    fit_rung(tracks, nullptr, nullptr, options, rungs.back());
  }
  return rungs;
}

// --- words --------------------------------------------------------------------------------------

bool contains(const std::set<int>& whole, const std::set<int>& part) {
  return std::includes(whole.begin(), whole.end(), part.begin(), part.end());
}

std::string listed(const std::vector<const Rung*>& rungs, double bic) {
  std::string words;
  for (const Rung* rung : rungs)
    words +=
        fmt::format("{}{} (BIC {:+.1f})", words.empty() ? "" : ", ", rung->name, rung->bic - bic);
  return words;
}

// Which losses turn the mean path round, and whether others alone would do it as well.
std::string retrograde_sentence(const std::vector<Rung>& rungs, const Rung& chosen,
                                const Ladder& ladder) {
  const std::optional<double> from_s = retrograde_from_s(chosen.fit, chosen.scene);
  if (!from_s) return "";
  const auto term = [&](int index) { return ladder.terms[static_cast<std::size_t>(index)].name; };
  std::string acting, alike, out, nowhere;
  for (const int index : chosen.terms) acting += (acting.empty() ? "" : " and ") + term(index);
  for (const Rung& rung : rungs) {
    if (rung.terms.size() != 1 || &rung == &chosen) continue;
    if (!rung.fitted) {
      nowhere += (nowhere.empty() ? "" : ", ") + term(*rung.terms.begin());
      continue;
    }
    std::string& list = rung.bic - chosen.bic < kVeryStrong ? alike : out;
    list += fmt::format("{}{} (BIC {:+.0f})", list.empty() ? "" : ", ", term(*rung.terms.begin()),
                        rung.bic - chosen.bic);
  }
  std::string words = fmt::format(" The mean path turns retrograde at t = {:.3g} s; {} explains it",
                                  *from_s, acting.empty() ? "rolling without losses" : acting);
  if (!alike.empty()) words += ", but this track cannot tell that from " + alike;
  if (!out.empty()) words += "; ruled out as the only loss: " + out;
  if (!nowhere.empty()) words += "; no fit at all with nothing but " + nowhere;
  return words + ".";
}

std::string sentence(const std::vector<Rung>& rungs, const Rung& chosen, const Ladder& ladder) {
  if (!chosen.fit.converged)
    return fmt::format(
        "none of the {} models tried explains the track; {} comes nearest.",
        std::count_if(rungs.begin(), rungs.end(), [](const Rung& rung) { return rung.fitted; }),
        chosen.name);
  std::string words = fmt::format(
      "{} suffices ({} parameters, residuals {}, held-back third predicted to {:.2g} sigma)",
      chosen.name, chosen.parameters, chosen.fit.whiteness_p > 0.01 ? "white" : "not white",
      chosen.held_back_rms_sigma);
  std::vector<const Rung*> alike, worse, more;  // more: with terms beyond the chosen ones
  for (const Rung& rung : rungs) {
    if (!rung.fitted || &rung == &chosen) continue;
    const bool near = rung.bic - chosen.bic < kVeryStrong;
    if (!contains(rung.terms, chosen.terms))
      (near ? alike : worse).push_back(&rung);
    else if (near)
      more.push_back(&rung);
  }
  const auto by_bic = [](const Rung* a, const Rung* b) { return a->bic < b->bic; };
  std::sort(alike.begin(), alike.end(), by_bic);
  std::sort(worse.begin(), worse.end(), by_bic);
  std::sort(more.begin(), more.end(), by_bic);
  if (!more.empty())
    words += fmt::format("; neither needed nor ruled out: {}", listed(more, chosen.bic));
  if (!alike.empty())
    words += fmt::format("; the data do not rule out {}", listed(alike, chosen.bic));
  else if (!worse.empty())
    words += fmt::format("; the next best, {}, is ruled out", listed({worse.front()}, chosen.bic));
  for (const std::string& term : ladder.left_out) words += fmt::format("; not tried: {}", term);
  return words + "." + retrograde_sentence(rungs, chosen, ladder);
}

data::ModelScore table_row(const Rung& rung, bool recommended) {
  return {rung.name,       rung.fit.chi2,        rung.aicc,
          rung.bic,        rung.fit.whiteness_p, rung.held_back_rms_sigma,
          rung.parameters, recommended};
}

}  // namespace

Comparison compare(std::span<const data::Track> tracks, const data::Scene& scene,
                   const FitOptions& options) {
  data::Scene named = scene;
  if (!options.model.empty()) named.model.name = options.model;
  // A body held at a pivot that leans there is a top, one that lies on it only turns.
  const bool open = named.model.name == "auto" && named.support.kind == data::SupportKind::pivot;
  if (open && leaves_pivot(tracks, named)) named.model.name = "top";
  const Ladder ladder = ladder_of(named);
  const std::vector<Rung> rungs = climb(ladder, tracks, options);
  const Rung* chosen = simplest_sufficient(rungs);
  if (chosen == nullptr) return {rungs[0].fit, rungs[0].scene};
  Comparison result{chosen->fit, chosen->scene};
  if (options.profile || options.bootstrap > 0) {
    FitOptions again = options;
    again.model.clear();
    again.start = values_of(chosen->fit);
    if (!again.start.empty()) again.strategy = "single";
    try {
      result.fit = fit(tracks, chosen->scene, again);
    } catch (const NumericalError& error) {
      result.fit.warnings.push_back(fmt::format("no profile and no bootstrap: {}", error.what()));
    }
  }
  for (const Rung& rung : rungs)
    if (rung.fitted) result.fit.comparison.push_back(table_row(rung, &rung == chosen));
  result.fit.recommendation = sentence(rungs, *chosen, ladder);
  return result;
}

}  // namespace trochoid::fitting
