#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "common/provenance.hpp"
#include "report/parts.hpp"

namespace trochoid::tools {
namespace {

constexpr double kTooWide = 1.5;  // residuals this many times the track's sigma need a reason

std::string scatter_words(double length_m) {
  if (length_m >= 1e-3) return fmt::format("{:.3g} mm", length_m * 1e3);
  return fmt::format("{:.3g} µm", length_m * 1e6);
}

std::string tracked_words(const ReportFacts& facts) {
  const std::size_t bodies = facts.input.tracks.tracks.size();
  return fmt::format("{} of {} {} over {:.3g} s",
                     bodies == 1 ? "The path" : fmt::format("{} paths", bodies), facts.samples,
                     facts.prediction.angles_alone() ? "samples" : "positions",
                     facts.last_s - facts.first_s);
}

// The same of what a fit was made from, which may be some bodies, arcs or a stretch of the track.
std::string fitted_words(const ReportFacts& facts, const data::Fit& fit) {
  const int first = facts.input.fit_track;
  const int end = first + tracks_fitted(fit, facts.input.tracks);
  std::set<int> bodies;
  int samples = 0;
  double from_s = facts.last_s, to_s = facts.first_s;
  for (const data::FitArc& arc : fit.arcs) {
    if (arc.track < first || arc.track >= end) continue;
    bodies.insert(arc.track);
    samples += arc.samples;
    from_s = std::min(from_s, arc.from_s);
    to_s = std::max(to_s, arc.to_s);
  }
  if (samples == 0 || samples >= facts.samples) return tracked_words(facts);
  return fmt::format("{} of {} of the {} {}, over {:.3g} s",
                     bodies.size() == 1 ? "The path" : fmt::format("{} paths", bodies.size()),
                     samples, facts.samples,
                     facts.prediction.angles_alone() ? "samples" : "positions", to_s - from_s);
}

// Does the model describe the points, and is the scatter what the tracker expects?
Verdict judge_fit(const ReportFacts& facts, const data::Fit& fit) {
  Verdict verdict;
  const std::string scatter =
      facts.prediction.angles_alone()
          ? fmt::format("{:.3g} mrad rms of the spin angle", 1e3 * facts.rms_spin_rad)
          : fmt::format(
                "{} rms per axis{}", scatter_words(facts.rms_axis_m),
                std::isfinite(facts.rms_axis_sigma)
                    ? fmt::format(" ({:.2f} times the tracker's own error)", facts.rms_axis_sigma)
                    : "");
  const bool weak = fit.verdict == data::FitVerdict::weak;
  const bool wide = facts.rms_axis_sigma > kTooWide;
  if (!fit.converged) {
    const std::string& why = fit.verdict_words.empty() ? fit.reason : fit.verdict_words;
    return {"bad",
            fit.verdict == data::FitVerdict::no_feature ? "nothing to fit" : "not trustworthy",
            fmt::format("The model “{}” was tried: {}{} Do not use its numbers.", fit.model, why,
                        why.ends_with('?') ? "" : "."),
            {}};
  }
  constexpr double kMostly = 0.5;
  if (facts.far_off > kMostly * facts.compared)
    return {"bad",
            "not of this track",
            fmt::format("{} of {} positions lie far off the path that the model “{}” was fitted "
                        "to: the fit is of another body or recording (--fit-track, --object).",
                        facts.far_off, facts.compared, fit.model),
            {}};
  const bool followed = fit.verdict == data::FitVerdict::doubtful;
  const bool correlated = fit.verdict == data::FitVerdict::good_correlated;
  const char* word = followed     ? "followed, not explained"
                     : weak       ? "explained, not all determined"
                     : correlated ? "explained, residuals correlated"
                                  : "explained";
  verdict = {
      weak || followed || wide ? "fair" : "good",
      word,
      fmt::format("{}: the model “{}” follows them{} with {}: {}.", fitted_words(facts, fit),
                  fit.model,
                  facts.far_off > 0 ? fmt::format(", but for {} far off,", facts.far_off) : "",
                  scatter, fit.verdict_words),
      {}};
  return verdict;
}

}  // namespace

Verdict judge(const ReportFacts& facts) {
  Verdict verdict;
  if (facts.input.fit) {
    verdict = judge_fit(facts, *facts.input.fit);
    verdict.remarks = facts.input.fit->warnings;
    for (const PredictedArc& arc : facts.prediction.arcs)
      if (!arc.ended.empty())
        verdict.remarks.push_back("the predicted motion ends before the track does: " + arc.ended);
  } else {
    verdict = {
        "none",
        "tracked only",
        fmt::format("{}; no model was fitted{}.", tracked_words(facts),
                    facts.input.no_fit_reason.empty() ? "" : ": " + facts.input.no_fit_reason),
        {}};
  }
  // What the tracker has to say of its recording is what everything else stands on.
  const std::vector<std::string>& notes = facts.input.tracks.notes;
  verdict.remarks.insert(verdict.remarks.begin(), notes.begin(), notes.end());
  if (!facts.metres)
    verdict.remarks.push_back(
        "positions are in pixels: a camera file, a scale or the body's radius would give metres");
  if (facts.missing > 0)
    verdict.remarks.push_back(fmt::format("{} frames in {} gap{} are without a detection",
                                          facts.missing, facts.gaps, facts.gaps == 1 ? "" : "s"));
  return verdict;
}

}  // namespace trochoid::tools
