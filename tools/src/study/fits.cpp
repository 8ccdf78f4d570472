#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "commands.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/validators.hpp"
#include "draw/plot.hpp"
#include "study/fit_trials.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/quantile.hpp"
#include "trochoid/fitting/fit.hpp"

// study fits: how often, how exactly and how fast each strategy finds planted parameters, and
// whether the error bars hold what they promise.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct FitsOptions {
  MadeTrackOptions tracks;
  int count = 100;
  int draws = 0;
  std::uint64_t seed = 1;
  int threads = 0;
  fs::path out = "study-fits";
};

/// Nothing is the median of nothing.
std::string median_words(const std::vector<double>& values) {
  return values.empty() ? "-" : fmt::format("{:.2e}", data::median(values));
}

void print_table(const std::vector<FitStrategy>& strategies, const std::vector<FitTrial>& trials) {
  fmt::print("{:<22} {:>8} {:>6} {:>10} {:>12} {:>10} {:>10}\n", "strategy", "optimum", "of",
             "unnoticed", "median error", "median ms", "90 % ms");
  for (std::size_t s = 0; s < strategies.size(); ++s) {
    int count = 0, good = 0, unnoticed = 0;
    std::vector<double> error, time;
    for (const FitTrial& trial : trials) {
      if (trial.strategy != static_cast<int>(s)) continue;
      ++count;
      good += trial.optimum;
      unnoticed += !trial.optimum && !trial.doubted;
      time.push_back(trial.time_ms);
      if (trial.optimum) error.push_back(trial.error);
    }
    if (count == 0) continue;  // it is for other models
    fmt::print("{:<22} {:>8} {:>6} {:>10} {:>12} {:>10.2f} {:>10.2f}\n", strategies[s].name, good,
               count, unnoticed, median_words(error), data::median(time),
               data::quantile(time, 0.9));
  }
}

void print_coverage(const Coverage& coverage) {
  fmt::print("\nerror bars of {} fits without a guess ({} at the optimum, {} tracks not taken):\n",
             coverage.draws, coverage.used, coverage.refused);
  for (const auto& [name, share] : coverage.inside_95)
    fmt::print("  95 % interval of {:<22} holds the truth in {:5.2f} %\n", name, 100.0 * share);
  fmt::print("  mean squared Mahalanobis distance {:.3f} for {} parameters ({:+.2f} %)\n",
             coverage.mahalanobis2, coverage.parameters,
             100.0 * (coverage.mahalanobis2 / coverage.parameters - 1.0));
  fmt::print("  mean chi-square of the truth above the fit's {:.3f} ({:+.2f} %)\n",
             coverage.likelihood_ratio,
             100.0 * (coverage.likelihood_ratio / coverage.parameters - 1.0));
}

void write_csv(const std::vector<FitStrategy>& strategies, const std::vector<FitTrial>& trials,
               const fs::path& path) {
  std::string text =
      "scene,strategy,optimum,converged,doubted,start_path,error,time_ms,chi2,chi2_best,dof\n";
  for (const FitTrial& trial : trials)
    text += fmt::format("{},{},{:d},{:d},{:d},{},{:.6g},{:.4g},{:.8g},{:.8g},{}\n", trial.scene,
                        strategies[trial.strategy].name, trial.optimum, trial.converged,
                        trial.doubted, trial.start_path, trial.error, trial.time_ms, trial.chi2,
                        trial.chi2_best, trial.dof);
  data::write_text(text, path);
}

void write_diagram(const std::vector<FitStrategy>& strategies, const std::vector<FitTrial>& trials,
                   const std::string& title, const fs::path& path) {
  Axes axes{.title = title,
            .x_label = "time of the fit [ms]",
            .y_label = "largest relative error",
            .log_x = true,
            .log_y = true,
            .series = {}};
  for (std::size_t s = 0; s < strategies.size(); ++s) {
    std::vector<double> x, y;
    for (const FitTrial& trial : trials)
      if (trial.strategy == static_cast<int>(s) && trial.error > 0.0 &&
          std::isfinite(trial.error)) {
        x.push_back(trial.time_ms);
        y.push_back(std::min(trial.error, 1e3));
      }
    if (x.empty()) continue;
    const auto n = static_cast<Eigen::Index>(x.size());
    axes.series.push_back({.label = strategies[s].name,
                           .x = Eigen::Map<Eigen::VectorXd>(x.data(), n),
                           .y = Eigen::Map<Eigen::VectorXd>(y.data(), n),
                           .points = true});
  }
  write_plot({axes}, path);
}

void run(const FitsOptions& options) {
  fitting::silence_solver_log();
  make_folder(options.out);
  const std::vector<FitStrategy> strategies = fit_strategies();
  fmt::print("# model {}, {} scenes, noise {} of the length, seed {}, trochoid {}\n",
             options.tracks.model, options.count, options.tracks.noise, options.seed,
             TROCHOID_VERSION);
  fmt::print(
      "# optimum: chi-square within 0.1 % + 0.5 of the best known minimum; unnoticed: not the\n"
      "# optimum, yet neither refused nor warned of; error: largest relative one of the judged "
      "parameters\n"
      "# at the optimum; time: of one thread\n");
  std::vector<FitTrial> trials;
  {
    Progress progress("study fits", "scenes");
    trials = fit_trials(options.tracks, strategies, options.count, options.seed, options.threads,
                        [&](int done) { progress.update(done, options.count); });
  }
  print_table(strategies, trials);
  if (options.draws > 0) {
    Progress progress("study fits", "draws");
    const Coverage coverage =
        fit_coverage(options.tracks, options.draws, options.seed + 1, options.threads,
                     [&](int done) { progress.update(done, options.draws); });
    print_coverage(coverage);
  }
  write_csv(strategies, trials, options.out / "fits.csv");
  const fs::path plot = options.out / "fits.svg";
  write_diagram(strategies, trials,
                fmt::format("{}: error against run time, noise {}", options.tracks.model,
                            options.tracks.noise),
                plot);
  fmt::print("{}\n", plot.string());
}

}  // namespace

void add_study_fits(CLI::App& study) {
  auto options = std::make_shared<FitsOptions>();
  CLI::App* command = study.add_subcommand(
      "fits", "Success, error, honesty and run time of every fitting strategy on random scenes");
  command->add_option("--model", options->tracks.model, "top, thesis, rolling or puck")
      ->capture_default_str()
      ->check(CLI::IsMember({"top", "thesis", "rolling", "puck"}));
  command->add_option("--count", options->count, "Scenes, one fit per strategy each")
      ->capture_default_str()
      ->check(whole_number_within(1, 1000000));
  command
      ->add_option("--draws", options->draws,
                   "Further fits without a guess that test the error bars; 0: none")
      ->capture_default_str()
      ->check(whole_number());
  command
      ->add_option("--noise", options->tracks.noise,
                   "Standard deviation of a position, relative to the body's length (l or radius)")
      ->capture_default_str()
      ->check(positive_number());
  command
      ->add_option("--duration", options->tracks.duration_s,
                   "Length of the tracks [s]; default: by the scene, 2.5 nutations of a top")
      ->check(positive_number());
  command->add_option("--rate", options->tracks.rate_hz, "Samples per second [Hz]")
      ->capture_default_str()
      ->needs("--duration")
      ->check(positive_number());
  command->add_option("--seed", options->seed, "Seed of scenes, noise and starts")
      ->capture_default_str()
      ->check(seed());
  command->add_option("--threads", options->threads, "Fits at a time; 0: all cores [0]")
      ->check(whole_number());
  command->add_option("--out", options->out, "Folder for the table and the diagram")
      ->capture_default_str();
  command->footer("Example: trochoid study fits --count 100 --noise 0.05 --draws 4000");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
