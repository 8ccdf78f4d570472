#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <utility>

#include "commands.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/validators.hpp"
#include "draw/plot.hpp"
#include "study/fit_trials.hpp"
#include "study/made_tracks.hpp"
#include "study/tracking_chain.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/quantile.hpp"
#include "trochoid/fitting/fit.hpp"

// study chain: what each setting on the way from pixels to parameters buys, and what it costs.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct ChainOptions {
  std::vector<fs::path> folders;
  int count = 20;
  std::uint64_t seed = 1;
  fs::path out = "study-chain";
};

/// One setting of the fit, and what fits at it cost and gave.
struct FitSetting {
  std::string axis, name;
  MadeTrackOptions tracks;
  fitting::FitOptions how;
  bool start_off = false;  ///< starts 30-50 % wrong instead of from nothing
};

struct FitOutcome {
  int reached = 0;                 ///< fits whose judged parameters are within 5 of their sigmas
  double error = 0.0;              ///< median largest relative error of the judged parameters
  double error_sigma = 0.0;        ///< median largest error in sigmas
  double time_ms = 0.0;            ///< median
  double integration_sigma = 0.0;  ///< median integration error at the solution in sigmas
};

std::vector<FitSetting> fit_settings() {
  using fitting::Strategy;
  const MadeTrackOptions ten_seconds{
      .model = "thesis", .noise = 0.01, .duration_s = 10.0, .rate_hz = 100.0};
  std::vector<FitSetting> list;
  const auto add = [&](const char* axis, std::string name, const MadeTrackOptions& tracks,
                       const std::function<void(fitting::FitOptions&)>& change) {
    fitting::FitOptions how;
    how.threads = 1;
    change(how);
    const bool off = how.strategy != Strategy::automatic && how.strategy != Strategy::integral;
    list.push_back({axis, std::move(name), tracks, std::move(how), off});
  };
  constexpr std::pair<const char*, Strategy> kStrategies[] = {{"auto", Strategy::automatic},
                                                              {"integral", Strategy::integral},
                                                              {"multiple", Strategy::multiple},
                                                              {"growing", Strategy::growing},
                                                              {"single", Strategy::single}};
  for (const auto& one : kStrategies)
    add("strategy", one.first, ten_seconds, [&](auto& how) { how.strategy = one.second; });
  add("tolerance", "chosen", ten_seconds, [](auto&) {});
  for (const double tolerance : {1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12})
    add("tolerance", fmt::format("{:.0e}", tolerance), ten_seconds,
        [&](auto& how) { how.tolerance = tolerance; });
  for (const double length_s : {5.0, 10.0, 20.0, 40.0, 60.0}) {
    MadeTrackOptions tracks = ten_seconds;
    tracks.duration_s = length_s;
    add("length", fmt::format("{:g} s", length_s), tracks, [](auto&) {});
  }
  for (const double rate_hz : {10.0, 30.0, 100.0, 300.0}) {
    MadeTrackOptions tracks = ten_seconds;
    tracks.rate_hz = rate_hz;
    add("rate", fmt::format("{:g} Hz", rate_hz), tracks, [](auto&) {});
  }
  return list;
}

FitOutcome measure(const FitSetting& setting, const ChainOptions& options) {
  constexpr double kReached_sigma = 5.0;
  FitOutcome outcome;
  std::vector<double> errors, sigmas, times_ms, integration;
  for (int i = 0; i < options.count; ++i) {
    std::mt19937_64 generator = generator_of(options.seed, i);
    const MadeTrack made = make_track(setting.tracks, generator);
    fitting::FitOptions how = setting.how;
    if (setting.start_off) how.start = start_off(made, generator);
    const double begin_ms = thread_time_ms();
    const data::Fit fit = fitting::fit(std::span(&made.track, 1), made.scene, how);
    times_ms.push_back(thread_time_ms() - begin_ms);
    double error = 0.0, in_sigmas = 0.0;
    for (const std::string& name : made.judged) {
      const data::FitParameter* found = fit.find(name);
      const bool told = found != nullptr && fit.converged && std::isfinite(found->sigma);
      const double off = told ? std::abs(found->value - made.truth.at(name))
                              : std::numeric_limits<double>::infinity();
      error = std::max(error, off / std::abs(made.truth.at(name)));
      in_sigmas = std::max(in_sigmas, told ? off / found->sigma : off);
    }
    outcome.reached += in_sigmas < kReached_sigma;
    errors.push_back(error);
    sigmas.push_back(in_sigmas);
    integration.push_back(fit.integration_error_sigma);
  }
  outcome.error = data::median(errors);
  outcome.error_sigma = data::median(sigmas);
  outcome.time_ms = data::median(times_ms);
  outcome.integration_sigma = data::median(integration);
  return outcome;
}

Axes fit_panel(const std::vector<FitSetting>& settings, const std::vector<FitOutcome>& outcomes) {
  Axes axes{.title = "Fitting: thesis top, 1 % noise",
            .x_label = "time of a fit [ms]",
            .y_label = "median relative error",
            .log_x = true,
            .log_y = true,
            .series = {}};
  for (std::size_t i = 0; i < settings.size();) {
    std::vector<double> x, y;
    const std::string& axis = settings[i].axis;
    for (; i < settings.size() && settings[i].axis == axis; ++i) {
      x.push_back(outcomes[i].time_ms);
      y.push_back(outcomes[i].error);
    }
    const auto n = static_cast<Eigen::Index>(x.size());
    axes.series.push_back({.label = axis,
                           .x = Eigen::Map<Eigen::VectorXd>(x.data(), n),
                           .y = Eigen::Map<Eigen::VectorXd>(y.data(), n),
                           .points = true});
  }
  return axes;
}

Axes study_fitting(const ChainOptions& options) {
  const std::vector<FitSetting> settings = fit_settings();
  std::vector<FitOutcome> outcomes;
  {
    Progress progress("study chain: fits", "settings");
    for (const FitSetting& setting : settings) {
      outcomes.push_back(measure(setting, options));
      progress.update(static_cast<std::int64_t>(outcomes.size()),
                      static_cast<std::int64_t>(settings.size()));
    }
  }
  fmt::print("fitting: {} tracks of the thesis' top a setting, noise 1 % of l, seed {}\n",
             options.count, options.seed);
  fmt::print("{:<10} {:<10} {:>8} {:>14} {:>14} {:>22} {:>10}\n", "axis", "setting", "reached",
             "median error", "error [sigma]", "integration [sigma]", "median ms");
  std::string csv = "axis,setting,reached,count,error,error_sigma,integration_sigma,time_ms\n";
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const FitOutcome& o = outcomes[i];
    fmt::print("{:<10} {:<10} {:>5}/{:<2} {:>14.2e} {:>14.2f} {:>22.1e} {:>10.2f}\n",
               settings[i].axis, settings[i].name, o.reached, options.count, o.error, o.error_sigma,
               o.integration_sigma, o.time_ms);
    csv += fmt::format("{},{},{},{},{:.4g},{:.4g},{:.4g},{:.4g}\n", settings[i].axis,
                       settings[i].name, o.reached, options.count, o.error, o.error_sigma,
                       o.integration_sigma, o.time_ms);
  }
  data::write_text(csv, options.out / "chain_fitting.csv");
  return fit_panel(settings, outcomes);
}

void run(const ChainOptions& options) {
  for (const fs::path& folder : options.folders)
    for (const char* file : {"video.mp4", "truth.csv", "camera.json", "object.json"})
      if (!fs::exists(folder / file))
        throw InputError(
            fmt::format("{}: no such file; each folder needs a recording with its truth",
                        (folder / file).string()));
  fitting::silence_solver_log();
  make_folder(options.out);
  std::vector<Axes> panels{study_fitting(options)};
#ifdef TROCHOID_HAS_TRACKING
  if (!options.folders.empty())
    panels.push_back(study_tracking_chain(options.folders, options.out));
#endif
  write_plot(panels, options.out / "chain.svg");
  fmt::print("{}\n", (options.out / "chain.svg").string());
}

}  // namespace

void add_study_chain(CLI::App& study) {
  auto options = std::make_shared<ChainOptions>();
  CLI::App* command = study.add_subcommand(
      "chain", "What each setting of tracking and fitting buys, and what it costs");
#ifdef TROCHOID_HAS_TRACKING
  command->add_option("folders", options->folders,
                      "Recordings with video.mp4, truth.csv, camera.json, object.json to track");
#endif
  command->add_option("--count", options->count, "Tracks per setting of the fit")
      ->capture_default_str()
      ->check(whole_number_within(1, 10000));
  command->add_option("--seed", options->seed, "Seed of scenes, noise and starts")
      ->capture_default_str()
      ->check(seed());
  command->add_option("--out", options->out, "Folder for tables and diagram")
      ->capture_default_str();
  command->footer("Example: trochoid study chain data/samples/*/");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
