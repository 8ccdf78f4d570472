#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#include "commands.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/scene_library.hpp"
#include "common/validators.hpp"
#include "draw/plot.hpp"
#include "study/runs.hpp"
#include "study/solver_bars.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

// study solvers: work-precision diagrams of every integrator on representative scenes.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct SolversOptions {
  fs::path out = "study-solvers";
  int repeats = 5;
};

constexpr std::array<const char*, 7> kScenes{"thesis-base", "thesis-spin-1", "top_drag",
                                             "thesis-free", "disc_rolling",  "disc_smooth",
                                             "disc_sliding"};
constexpr std::array<const char*, 5> kIntegrators{"dop853", "taylor", "cvode-adams", "cvode-bdf",
                                                  "arkode"};
constexpr std::array<double, 6> kTolerances{1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13};

struct SolverRow {
  std::string scene, integrator;
  double tolerance;
  StudyRun run;
};

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

void print_machine() {
#ifdef __clang__
  constexpr const char* kCompiler = "";  // its version says who it is
#else
  constexpr const char* kCompiler = "g++ ";
#endif
  fmt::print("# trochoid {}, {}, {} threads, {}{}\n", TROCHOID_VERSION, processor(),
             std::thread::hardware_concurrency(), kCompiler, __VERSION__);
  fmt::print(
      "# error: largest |k - k_reference| over the run, against an 80-bit extrapolation "
      "method in vector form\n# time: whole simulate() call: every column, the run that estimates "
      "the error; fastest "
      "repeat\n");
}

void print_rows(const std::vector<SolverRow>& rows) {
  fmt::print("{:<14} {:<12} {:>9} {:>10} {:>12} {:>12} {:>8}  {}\n", "scene", "integrator",
             "tolerance", "error", "time_us", "evaluations", "steps", "outcome");
  for (const SolverRow& row : rows) {
    if (!row.run.refusal.empty()) continue;
    fmt::print("{:<14} {:<12} {:>9.0e} {:>10.1e} {:>12.1f} {:>12} {:>8}  {}\n", row.scene,
               row.integrator, row.tolerance, row.run.axis_error, row.run.time_us,
               row.run.statistics.evaluations, row.run.statistics.steps,
               model::name(row.run.outcome));
  }
}

void write_csv(const std::vector<SolverRow>& rows, const fs::path& path) {
  std::string text =
      "scene,integrator,tolerance,axis_error,path_error_m,time_us,evaluations,steps,outcome\n";
  for (const SolverRow& row : rows)
    if (row.run.refusal.empty())
      text += fmt::format("{},{},{},{},{},{},{},{},{}\n", row.scene, row.integrator, row.tolerance,
                          row.run.axis_error, row.run.path_error_m, row.run.time_us,
                          row.run.statistics.evaluations, row.run.statistics.steps,
                          model::name(row.run.outcome));
  data::write_text(text, path);
}

/// One panel per scene: error against `cost`.
template <class Cost>
void write_diagram(const std::vector<SolverRow>& rows, const char* x_label, Cost cost,
                   const fs::path& path) {
  std::vector<Axes> panels;
  for (const char* scene : kScenes) {
    Axes axes{.title = scene,
              .x_label = x_label,
              .y_label = "error of the axis",
              .log_x = true,
              .log_y = true,
              .series = {}};
    for (std::size_t i = 0; i < kIntegrators.size(); ++i) {
      const char* integrator = kIntegrators[i];
      std::vector<double> x, y;
      for (const SolverRow& row : rows)
        if (row.scene == scene && row.integrator == integrator && row.run.refusal.empty() &&
            row.run.outcome == model::Outcome::reached_end && row.run.axis_error > 0.0) {
          x.push_back(cost(row.run));
          y.push_back(row.run.axis_error);
        }
      if (!x.empty())
        axes.series.push_back(
            {.label = integrator,
             .x = Eigen::Map<Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size())),
             .y = Eigen::Map<Eigen::VectorXd>(y.data(), static_cast<Eigen::Index>(y.size())),
             .colour = static_cast<int>(i)});
    }
    if (!axes.series.empty()) panels.push_back(std::move(axes));
  }
  write_plot(panels, path);
}

std::vector<SolverRow> measure(const SolversOptions& options) {
  std::vector<SolverRow> rows;
  Progress progress("study solvers", "runs");
  const auto total =
      static_cast<std::int64_t>(kScenes.size() * kIntegrators.size() * kTolerances.size());
  std::int64_t done = 0;
  for (const char* name : kScenes) {
    data::Scene scene = load_scene(name);
    const auto reference = high_precision_run(scene);
    if (!reference) throw NumericalError(fmt::format("{}: no reference solution", name));
    for (const char* integrator : kIntegrators)
      for (const double tolerance : kTolerances) {
        scene.run.integrator = integrator;
        scene.run.tolerance = tolerance;
        rows.push_back(
            {name, integrator, tolerance, study_run(scene, *reference, options.repeats)});
        progress.update(++done, total);
      }
  }
  return rows;
}

void run(const SolversOptions& options) {
  make_folder(options.out);
  const std::vector<SolverRow> rows = measure(options);
  print_machine();
  print_rows(rows);
  write_csv(rows, options.out / "solvers.csv");
  write_diagram(
      rows, "time [us]", [](const StudyRun& run) { return run.time_us; },
      options.out / "solvers_time.svg");
  write_diagram(
      rows, "evaluations of the right-hand side",
      [](const StudyRun& run) { return static_cast<double>(run.statistics.evaluations); },
      options.out / "solvers_evaluations.svg");
  study_solver_bars(options.repeats, options.out / "solver_bars.csv");
  fmt::print("\n{}\n", (options.out / "solvers_time.svg").string());
}

}  // namespace

void add_study_solvers(CLI::App& study) {
  auto options = std::make_shared<SolversOptions>();
  CLI::App* command =
      study.add_subcommand("solvers", "Error against run time for every integrator and model");
  command->add_option("--out", options->out, "Folder for the table and the diagrams")
      ->capture_default_str();
  command->add_option("--repeats", options->repeats, "Runs per point; the fastest counts")
      ->capture_default_str()
      ->check(whole_number_within(1, 1000));
  command->footer("Example: trochoid study solvers --out solvers/");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
