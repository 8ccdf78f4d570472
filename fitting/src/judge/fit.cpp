#include "trochoid/fitting/fit.hpp"

#include <ceres/version.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

#include "judge/adequacy.hpp"
#include "judge/bootstrap.hpp"
#include "judge/caveats.hpp"
#include "judge/describe.hpp"
#include "judge/draft.hpp"
#include "judge/first_guess.hpp"
#include "judge/path_steps.hpp"
#include "judge/profile.hpp"
#include "judge/second_thoughts.hpp"
#include "judge/statistics.hpp"
#include "judge/straying.hpp"
#include "judge/tracks_apart.hpp"
#include "observe/observed.hpp"
#include "problem/linearise.hpp"
#include "problem/prepare.hpp"
#include "start/find.hpp"
#include "start/starter.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

// Until weights are known, what stands out is left aside: a single glitch far away would lead every
// step astray.
Problem without_outliers(Problem problem) {
  for (ArcData& arc : problem.arcs) arc = arc.keep(consistent_samples(arc));
  for (Eigen::VectorXd& of_all : problem.row_weights) of_all.resize(0);
  return problem;
}

// The polish weighs every sample by its residual, the search does not. Writes the values found into
// problem.base. Half a turn off, a direction lies across the pole, where no step leads back: where
// the path has to be looked for, angles are compared each by itself.
Found search_without_outliers(Problem& problem, const SearchRequest& asked) {
  Problem search = without_outliers(problem);
  for (ArcData& arc : search.arcs) arc.angles_apart = asked.options->strategy != Strategy::single;
  Found found = find(search, asked);
  problem.base = search.base;
  return found;
}

// Tells the caller what is being done: when that changes, and with every minimisation.
class Stages {
 public:
  explicit Stages(const FitOptions& options) : options_(options) {}
  void enter(const char* stage) {
    stage_ = stage;
    line(stage);
  }
  void line(const std::string& words) const {
    if (options_.progress) options_.progress(stage_);
    if (options_.log) options_.log(words);
  }
  [[nodiscard]] bool wanted() const { return options_.progress || options_.log; }

 private:
  const FitOptions& options_;
  const char* stage_ = "";
};

// From a minimum of a slightly other cost; where steps are dear, only a few. @param runs  of all
// arcs without derivatives that problem.work counts; a step takes about a dozen.
int affordable_steps(const Problem& problem, double runs, double most) {
  constexpr double kRunsPerStep = 12.0, kFewest = 3.0, kMostWork = 3e6;
  const double step = kRunsPerStep * *problem.work / runs;
  return static_cast<int>(std::clamp(kMostWork / step, kFewest, most));
}

// Robust weights and noise until they settle.
Solution settle_weights(Problem& problem, Solution solution, double fixed_tolerance) {
  // Weights within half a per cent and chi-square within a millionth: a hundredth of a sigma.
  constexpr double kSettled = 5e-3;
  // While they still change much, chi-square need not be least to more digits than they are known.
  constexpr double kMuch = 0.1, kNear = 1e-5, kLeast = 1e-7, kMostSteps = 20.0;
  const auto go_on = [&](double tolerance) {
    const int steps = affordable_steps(problem, 1.0, kMostSteps);
    Solution next =
        minimise(problem, solution.u, {.iterations = steps, .function_tolerance = tolerance});
    if (!next.usable) return false;
    next.converged = next.converged || solution.converged;
    solution = std::move(next);
    return true;
  };
  bool near = false;
  for (int round = 0; round < 4; ++round) {
    problem.work = std::make_shared<double>(0.0);
    const double change = reweight(problem, solution.u, true);
    if (change < kSettled && (round > 0 || fixed_tolerance <= 0.0)) break;
    near = change > kMuch;
    if (!go_on(near ? kNear : kLeast)) break;
  }
  if (near) go_on(kLeast);
  problem.work.reset();
  return solution;
}

// Downhill by so many steps, and so many again as long as they gain: a bent valley's floor is found
// only once the integration's noise no longer covers it.
Solution minimise_while_it_gains(const Problem& problem, const Eigen::VectorXd& u, int steps) {
  constexpr double kWorth = 0.1;  // of chi-square, a third of an error bar
  constexpr int kMostRounds = 5;
  const SolveOptions options{.iterations = steps, .function_tolerance = 1e-7};
  Solution found = minimise(problem, u, options);
  for (int round = 1; round < kMostRounds && found.usable && found.iterations == steps; ++round) {
    Solution farther = minimise(problem, found.u, options);
    if (!farther.usable || farther.chi2 > found.chi2 - kWorth) break;
    farther.converged = farther.converged || found.converged;
    found = std::move(farther);
  }
  return found;
}

// Integrates ever finer until that no longer shows. @returns the integration error left, in sigma.
double silence_integration(Problem& problem, Solution& solution, double fixed_tolerance) {
  constexpr double kSilent = 0.01, kFinest = 1e-12;
  constexpr double kMostSteps = 12.0;  // more only follow the integration's noise
  problem.work = std::make_shared<double>(0.0);
  double error = integration_error_sigma(problem, solution.u);
  while (fixed_tolerance <= 0.0 && error > kSilent && problem.tolerance > kFinest) {
    const double coarse = problem.tolerance;
    problem.tolerance *= 1e-2;
    const int steps = affordable_steps(problem, 2.0, kMostSteps);
    Solution finer = minimise_while_it_gains(problem, solution.u, steps);
    if (!finer.usable) {  // so fine a run exceeds the step limit
      problem.tolerance = coarse;
      break;
    }
    finer.converged = finer.converged || solution.converged;
    solution = std::move(finer);
    // What only just does not come to lie in a dip may do so once it is integrated more finely.
    if (problem.arcs.size() == 1)
      solution = restart_around_fall(problem, judged(problem, std::move(solution), "")).solution;
    *problem.work = 0.0;
    error = integration_error_sigma(problem, solution.u);
  }
  problem.work.reset();  // copies of the problem run side by side from here on
  return error;
}

// Under the final weights a loss may have crept to zero, where the slope of its logarithm vanishes
// too: asks once more whether it is missed.
Solution recall_vanished(Problem& problem, Solution solution) {
  if (problem.arcs.size() > 1 || !has_vanished(problem, solution.u)) return solution;
  constexpr double kWorth = 1.0;  // of chi-square
  Problem again = problem;
  again.set_base(solution.u);
  Solution recalled = solve_to_the_end(again);
  if (!recalled.usable || recalled.chi2 > solution.chi2 - kWorth) return solution;
  recalled.converged = recalled.converged || solution.converged;
  problem = std::move(again);
  return recalled;
}

// From where the search ended to the minimum; the values are then in problem.base as well.
Solution polish(Problem& problem, Solution solution, const FitOptions& options, data::Fit& fit) {
  if (hold_vanished(problem, solution.u))
    solution = minimise(without_outliers(problem), problem.start());
  solution = settle_weights(problem, std::move(solution), options.tolerance);
  solution = recall_vanished(problem, std::move(solution));
  fit.integration_error_sigma = silence_integration(problem, solution, options.tolerance);
  constexpr double kHeard = 0.1;
  if (fit.integration_error_sigma > kHeard)
    fit.warnings.push_back(fmt::format(
        "integrated more finely, the path differs by up to {:.2g} of the track's sigmas: "
        "there the motion hangs on what is far below them (an impact, the fall onto a "
        "face), and the error bars do not know of it",
        fit.integration_error_sigma));
  hold_vanished(problem, solution.u);
  name_attitudes(problem);
  solution.u = problem.here();
  // Under the weights that hold now; those it was reached under may have been others.
  if (const Solution here = minimise(problem, solution.u, {.iterations = 0}); here.usable)
    solution.chi2 = here.chi2;
  return solution;
}

Solution roughly_weighed(Problem& problem, Solution solution) {
  problem.set_base(solution.u);
  reweight(problem, solution.u, true);
  name_attitudes(problem);
  solution.u = problem.here();
  return solution;
}

// To the floor of a valley that leaves most of the motion unexplained, whatever counts for how
// much, it is far; and all that is said of it in the end is that.
bool leads_nowhere(const Problem& problem, const Found& found) {
  constexpr double kTellsNothing = 0.3;  // of the variance
  if (problem.arcs.size() > 1 || found.passed || found.unexplained < kTellsNothing) return false;
  Problem weighed = problem;
  const Solution solution = roughly_weighed(weighed, found.solution);
  return !explains(weighed, solution);
}

void refuse(const Problem& problem, const std::string& reason, data::Fit& fit) {
  fit.outcome = data::FitOutcome::no_convergence;
  fit.verdict = data::FitVerdict::unexplained;
  fit.reason = fit.verdict_words = reason;
  describe_arcs(problem, fit);
}

void add_what_was_asked_for(const Problem& problem, const Solution& solution,
                            const Uncertainty& error, const FitOptions& options, data::Fit& fit) {
  if (!fit.converged) {  // the spread about a path that is not the body's means nothing
    if (options.profile || options.bootstrap > 0)
      fit.warnings.push_back("no profile and no bootstrap of a fit that is not accepted");
    return;
  }
  if (options.profile) fit.profiles = profiles(problem, solution, error, options.threads);
  if (options.bootstrap > 0)
    fit.bootstrap = bootstrap(problem, solution, error.whiteness.correlation_time_s,
                              options.bootstrap, options.seed, options.threads);
  constexpr int kFewFits = 20;
  if (const int fits = options.bootstrap - fit.bootstrap.failed;
      options.bootstrap > 0 && fits < kFewFits)
    fit.warnings.push_back(
        fmt::format("bootstrap: {} of {} fits came out, too few for a spread; ask for {} and more",
                    fits, options.bootstrap, 10 * kFewFits));
  if ((options.profile || options.bootstrap > 0) && !kept_parameters(problem).empty())
    fit.warnings.push_back(
        "profiles and bootstrap keep the scale and the frame rate as they are, for comparing clips "
        "of one camera; the error bars hold what is not known of these");
  constexpr double kNarrower = 0.5;
  const auto narrow = [&](const data::BootstrapSpread& spread) {
    const data::FitParameter* parameter = fit.find(spread.parameter);
    return parameter != nullptr && spread.sigma < kNarrower * parameter->sigma;
  };
  const auto& spreads = fit.bootstrap.parameters;
  if (std::any_of(spreads.begin(), spreads.end(), narrow))
    fit.warnings.push_back(
        "the bootstrap is narrower than the error bars: it shuffles what varies within the record "
        "and does not see what is common to all of it; the error bars count");
}

bool is_to_be_fitted(const char* name, const data::FitSettings& settings) {
  const auto& free = settings.free;
  return std::find(free.begin(), free.end(), name) != free.end() || settings.prior.contains(name);
}

/// Whether a fit is what is asked for, or one of several from which the comparison chooses and then
/// has its own doubts.
enum class Purpose { answer, candidate };

// A fit of one model: its path is found at once; what is said of it, in particular its error bars,
// may wait until it is known which of several models is meant.
class OneFit {
 public:
  OneFit(std::span<const data::Track> tracks, const model::Predictor& plain,
         const data::Scene& given_scene, const FitOptions& options, Purpose purpose)
      : tracks_(tracks),
        scene_(given_scene),
        options_(options),
        stages_(options_),
        purpose_(purpose) {
    if (tracks.empty()) throw TrackError("no track to fit");
    scene_.fit.free_pivot =
        scene_.fit.free_pivot || options.free_pivot ||
        (is_to_be_fitted("pivot_x_m", scene_.fit) && is_to_be_fitted("pivot_y_m", scene_.fit));
    wrapped_ = observed(plain, scene_, frame_time_s(tracks));
    problem_ = prepare(tracks, wrapped_ ? *wrapped_ : plain, scene_, options);
    if (stages_.wanted()) problem_.log = [this](const std::string& words) { stages_.line(words); };
    fit_.model = problem_.predictor->model_name();
    fit_.seed = options.seed;
    fit_.versions = {{"ceres", CERES_VERSION_STRING},
                     {"eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION,
                                           EIGEN_MINOR_VERSION)}};
  }
  OneFit(const OneFit&) = delete;
  OneFit& operator=(const OneFit&) = delete;

  void find(const std::vector<Relative>& relatives, FirstPart* first_part);
  /// To be called before find().
  void start_as(const Settled& near);
  /// @pre find()
  [[nodiscard]] Settled settled() const {
    return {problem_.tolerance, problem_.arcs[0].noise_scale};
  }
  /// @pre find()
  [[nodiscard]] data::Fit described(Bars bars);
  /// Whether what was found leaves more than noise, whatever else there is to doubt.
  /// @pre described()
  [[nodiscard]] bool misses() const { return misses_; }

 private:
  void look_at_longer_tops();

  std::span<const data::Track> tracks_;
  data::Scene scene_;
  FitOptions options_;
  Stages stages_;
  Purpose purpose_;
  std::unique_ptr<model::Predictor> wrapped_;
  Problem problem_;
  Solution solution_;
  Uncertainty by_curvature_;
  std::optional<UprightTop> upright_;
  data::Fit fit_;
  bool refused_ = false, cut_short_ = false, misses_ = true;
};

void OneFit::start_as(const Settled& near) {
  if (near.tolerance <= 0.0 || options_.tolerance > 0.0 || problem_.arcs.size() > 1) return;
  problem_.tolerance = std::min(problem_.tolerance, near.tolerance);
  // What explains nothing knows nothing of the noise.
  constexpr double kMost = 1.5;
  if (std::all_of(near.noise_scale.begin(), near.noise_scale.end(),
                  [](double scale) { return scale < kMost; }))
    problem_.arcs[0].noise_scale = near.noise_scale;
}

void OneFit::find(const std::vector<Relative>& relatives, FirstPart* first_part) {
  const auto refuse_with = [&](const std::string& reason) {
    refused_ = true;
    refuse(problem_, reason, fit_);
    tell_idle_priors(problem_, scene_, fit_);
    tell_unlikely_body(scene_, fit_);
    tell_held(scene_, fit_);
    tell_steps_of_path(problem_, fit_);
  };
  stages_.enter("looking for the path");
  if (first_part != nullptr && problem_.arcs.size() == 1)
    problem_.partial = std::make_shared<Partial>();
  const bool start_given = !options_.start.empty() || scene_.start.theta_rad.has_value();
  const Found found = search_without_outliers(
      problem_, {starter_for(*problem_.predictor, scene_), &options_, start_given, relatives,
                 lookalikes_for(*problem_.predictor, scene_)});
  fit_.start_path = found.path;
  cut_short_ = found.cut_short;
  // Any start explains a few samples.
  constexpr double kWorthwhile = 0.2;
  const auto& parameters = problem_.predictor->parameters();
  if (problem_.partial &&
      problem_.partial->samples > kWorthwhile * static_cast<double>(problem_.arcs[0].t_s.size())) {
    *first_part = {};
    first_part->from_s = problem_.arcs[0].t_s[0];
    first_part->until_s = problem_.partial->until_s;
    for (std::size_t i = 0; i < parameters.size(); ++i)
      first_part->values[parameters[i].name] =
          problem_.partial->values[static_cast<Eigen::Index>(i)];
  }
  if (!found.solution.usable) return refuse_with(problem_.shortfalls->words());

  stages_.enter("weighing the samples");
  if (!leads_nowhere(problem_, found))
    solution_ = polish(problem_, found.solution, options_, fit_);
  else
    solution_ = roughly_weighed(problem_, found.solution);
  stages_.enter("error bars");
  try {
    by_curvature_ = uncertainty(problem_, solution_.u);
    look_at_longer_tops();
  } catch (const NumericalError& failure) {
    // A finer tolerance can run into the step limit where a coarse one did not.
    refuse_with(failure.what());
  }
}

// A search may end at a small l that is no better than any larger one, or not as good.
void OneFit::look_at_longer_tops() {
  constexpr int kMostRounds = 3;
  if (!solution_.converged) return;
  for (int round = 0; round < kMostRounds; ++round) {
    upright_ = upright_top(problem_, solution_, by_curvature_);
    if (!upright_ || !upright_->better) return;
    solution_ = polish(problem_, *upright_->better, options_, fit_);
    by_curvature_ = uncertainty(problem_, solution_.u);
  }
  upright_.reset();
}

data::Fit OneFit::described(Bars bars) {
  data::Fit fit = fit_;
  if (refused_) return fit;
  Uncertainty error = by_curvature_;
  if (bars == Bars::full) heed_far_side(problem_, solution_, options_.threads, error, fit);
  if (bars == Bars::full && upright_) heed_upright_top(problem_, solution_, *upright_, error, fit);
  if (bars == Bars::full) heed_single_samples(problem_, solution_, error, fit);
  heed_doubts(problem_, solution_, scene_, frame_time_s(tracks_), error, fit);
  if (bars == Bars::full) tell_rise(problem_, solution_, error, scene_, frame_time_s(tracks_), fit);
  tell_idle_priors(problem_, scene_, fit);
  tell_camera(problem_, error, scene_, fit);
  tell_idle_pivot(problem_, scene_, fit);
  tell_unlikely_body(scene_, fit);
  tell_other_rate(scene_, tracks_, fit);
  tell_unused_tracks(problem_, tracks_, fit);
  tell_given_up(problem_, fit);
  tell_bounds(problem_, solution_, error, scene_, fit);
  describe(problem_, solution_, error, scene_, fit);
  if (bars == Bars::full && upright_) tell_open_length(problem_, solution_, *upright_, fit);
  tell_unlikely_friction(fit);
  tell_slope(fit);
  judge(problem_, solution_, error, cut_short_, fit);
  misses_ = !says_explained(fit);
  if (fit.verdict == data::FitVerdict::unexplained || fit.verdict == data::FitVerdict::doubtful)
    tell_held(scene_, fit);
  if (fit.verdict == data::FitVerdict::unexplained) tell_steps_of_path(problem_, fit);
  if (purpose_ == Purpose::answer) doubt_as_a_whole(problem_, solution_.u, error, scene_.fit, fit);
  if (fit.model == "pivot" && leaves_pivot(tracks_, scene_, options_)) {
    fit.converged = false;
    fit.outcome = data::FitOutcome::unexplained;
    fit.verdict = data::FitVerdict::unexplained;
    fit.reason = fit.verdict_words = fmt::format(
        "the body's centre strays by {:.2g} m: a disc that only turns on its pivot stays where "
        "it is; is it a top?",
        straying_m(tracks_, options_));
  }
  add_what_was_asked_for(problem_, solution_, error, options_, fit);
  return fit;
}

void check_given_start(const FitOptions& options, const model::Predictor& predictor,
                       const data::Scene& scene) {
  if (options.start.empty()) return;
  check_first_guess(options.start, fmt::format("model '{}' has", predictor.model_name()),
                    names_in(predictor, scene));
}

// With its model and its relatives.
class CompletedFit {
 public:
  CompletedFit(std::span<const data::Track> tracks, const data::Scene& scene,
               const FitOptions& options, Purpose purpose)
      : scene_(scene),
        predictor_(model::make_predictor(scene_)),
        one_(tracks, *predictor_, scene_, options, purpose) {}

  void find(FirstPart* first_part = nullptr) {
    const auto relatives = relatives_of(scene_);
    std::vector<Relative> plain;
    for (const OwnedRelative& owned : relatives) {
      plain.push_back({owned.model.get(), {}});
      for (const auto& bridge : owned.bridges) plain.back().bridges.push_back(bridge.get());
    }
    one_.find(plain, first_part);
  }
  void start_as(const Settled& near) { one_.start_as(near); }
  [[nodiscard]] Settled settled() const { return one_.settled(); }
  [[nodiscard]] bool misses() const { return one_.misses(); }
  [[nodiscard]] data::Fit described(Bars bars) {
    data::Fit fit = one_.described(bars);
    tell_idle_terms(scene_, fit);
    return fit;
  }

 private:
  data::Scene scene_;
  std::unique_ptr<model::Predictor> predictor_;
  OneFit one_;
};

}  // namespace

data::Fit fit(std::span<const data::Track> tracks, const model::Predictor& predictor,
              const data::Scene& scene, const FitOptions& options) {
  check_given_start(options, predictor, scene);
  OneFit one(tracks, predictor, scene, options, Purpose::answer);
  one.find({}, nullptr);
  return one.described(Bars::full);
}

data::Fit fit(std::span<const data::Track> tracks, const data::Scene& given,
              const FitOptions& options) {
  const data::Scene scene = completed(given, options);
  check_given_start(options, *model::make_predictor(scene), scene);
  CompletedFit one(tracks, scene, options, Purpose::answer);
  one.find();
  data::Fit found = one.described(Bars::full);
  if (!one.misses()) return found;
  if (const auto apart = tracks_apart(tracks, given, options, found))
    tell_tracks_apart(*apart, found);
  return found;
}

void check_scene(const data::Scene& given, const FitOptions& options) {
  constexpr double kAnyFrame_s = 1.0;  // how long one is tells the track
  data::Scene scene = completed(given, options);
  const auto plain = model::make_predictor(scene);
  const auto wrapped = observed(*plain, scene, kAnyFrame_s);
  static_cast<void>(make_problem(wrapped ? *wrapped : *plain, {}, scene));
}

data::Fit fit_one_of_several(std::span<const data::Track> tracks, const data::Scene& given,
                             const FitOptions& options, Bars bars, const Settled& near) {
  CompletedFit one(tracks, completed(given, options), options, Purpose::candidate);
  one.start_as(near);
  one.find();
  return one.described(bars);
}

Draft draft_one_of_several(std::span<const data::Track> tracks, const data::Scene& given,
                           const FitOptions& options, FirstPart* first_part, const Settled& near) {
  const auto one = std::make_shared<CompletedFit>(tracks, completed(given, options), options,
                                                  Purpose::candidate);
  one->start_as(near);
  one->find(first_part);
  const auto full = std::make_shared<std::optional<data::Fit>>();
  return {one->described(Bars::by_curvature),
          [one, full] {
            if (!*full) *full = one->described(Bars::full);
            return **full;
          },
          one->settled()};
}

}  // namespace trochoid::fitting
