#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "study/made_tracks.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::tools {

/// Processor time that the calling thread has taken [ms].
[[nodiscard]] double thread_time_ms();

/// A way to fit: how it starts and how it goes on from there (FitOptions::strategy).
struct FitStrategy {
  enum class Start { none, off, blind };  ///< off: 30-50 % wrong; blind: what anyone would write
  std::string name;
  fitting::Strategy strategy = fitting::Strategy::automatic;
  Start start = Start::none;
  bool tops_only = false;
};
[[nodiscard]] std::vector<FitStrategy> fit_strategies();

/// One fit of one made track.
struct FitTrial {
  int scene = 0;
  int strategy = 0;
  bool converged = false;  ///< what the fit says of itself
  bool doubted = false;    ///< not converged, or warned that a better minimum may exist
  bool optimum = false;    ///< chi-square within 0.1 % + 0.5 of the best known minimum
  std::string start_path;
  double error = 0.0;  ///< largest relative error of the judged parameters; infinite without answer
  double time_ms = 0.0;  ///< of the thread that fitted
  double chi2 = 0.0, chi2_best = 0.0;
  int dof = 0;
};

/// Fits `count` made tracks with every strategy. The same seed gives the same trials (but for the
/// times), whatever the number of threads (0: all cores).
[[nodiscard]] std::vector<FitTrial> fit_trials(const MadeTrackOptions& tracks,
                                               const std::vector<FitStrategy>& strategies,
                                               int count, std::uint64_t seed, int threads,
                                               const std::function<void(int)>& progress = {});

/// How often error bars hold the truth.
struct Coverage {
  int draws = 0;
  int used = 0;     ///< fits that reached the optimum
  int refused = 0;  ///< tracks that a fit does not take
  int parameters = 0;
  std::map<std::string, double> inside_95;  ///< share of 95 % intervals that hold the truth
  double mahalanobis2 = 0.0;                ///< mean squared distance of the truth
  double likelihood_ratio = 0.0;            ///< mean chi-square of the truth above the fit's
};

/// Fits `draws` made tracks without a guess and compares errors with error bars.
[[nodiscard]] Coverage fit_coverage(const MadeTrackOptions& tracks, int draws, std::uint64_t seed,
                                    int threads, const std::function<void(int)>& progress = {});

}  // namespace trochoid::tools
