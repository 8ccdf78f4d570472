#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.hpp"
#include "common/fitted_scene.hpp"
#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/scene_library.hpp"
#include "common/thesis_quantities.hpp"
#include "common/trajectory_table.hpp"
#include "common/validators.hpp"
#include "draw/animation.hpp"
#include "draw/trajectory_plots.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/model/simulate.hpp"
#include "trochoid/model/steady.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct SimulateOptions {
  std::string scene;
  fs::path fit, output, plots, animation;
  std::optional<std::size_t> arc;
  std::optional<double> until_s, rate_hz, tolerance;
  std::string model, integrator;
  bool list = false, steady = false, thesis = false, json = false;
};

void apply_overrides(const SimulateOptions& options, data::Scene& scene) {
  if (options.until_s) scene.run.until_s = *options.until_s;
  if (options.rate_hz) scene.run.rate_hz = *options.rate_hz;
  if (options.tolerance) scene.run.tolerance = *options.tolerance;
  if (!options.model.empty()) scene.model.name = options.model;
  if (!options.integrator.empty()) scene.run.integrator = options.integrator;
}

void list_scenes(bool as_json) {
  if (as_json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::object();
    for (const BundledScene& scene : bundled_scenes()) list[scene.name] = scene.summary();
    return print_json({{"scenes", list}});
  }
  for (const BundledScene& scene : bundled_scenes())
    fmt::print("{:<28} {}\n", scene.name, scene.summary());
}

nlohmann::ordered_json steady_json(const std::vector<model::SteadyMotion>& motions) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const model::SteadyMotion& motion : motions)
    list.push_back({{"floor", model::name(motion.floor)},
                    {"motion", model::name(motion.kind)},
                    {"theta_rad", motion.theta_rad},
                    {"dphi_rad_s", motion.precession_rad_s},
                    {"w3_rad_s", motion.w3_rad_s},
                    {"circle_radius_m", motion.circle_radius_m},
                    {"normal_force_N", motion.normal_force_N},
                    {"friction_demand", motion.friction_demand},
                    {"nutation2_1_s2", motion.nutation2_1_s2}});
  return list;
}

void print_steady(const data::Scene& scene, bool as_json) {
  if (!scene.body) throw InputError("--steady needs a [body] in the scene");
  std::vector<double> tilts_rad;
  for (int degrees = 10; degrees <= 80; degrees += 10) tilts_rad.push_back(data::radians(degrees));
  const std::vector<model::SteadyMotion> motions =
      model::steady_catalogue(*scene.body, scene.model.gravity_m_s2, tilts_rad);
  if (as_json) return print_json({{"steady", steady_json(motions)}});
  fmt::print("{:<7} {:<17} {:>9} {:>14} {:>10} {:>11} {:>9} {:>8} {:>16}  {}\n", "floor", "motion",
             "tilt_deg", "dphi_rad_s", "w3_rad_s", "radius_m", "N_N", "demand", "nutation_rad_s",
             "stability");
  for (const model::SteadyMotion& motion : motions) {
    const double nu2 = motion.nutation2_1_s2;
    const std::string nutation =
        std::isnan(nu2) ? "-" : fmt::format("{:.4f}", std::sqrt(std::abs(nu2)));
    fmt::print("{:<7} {:<17} {:>9.1f} {:>14.4f} {:>10.4f} {:>11.5g} {:>9.4g} {:>8.4f} {:>16}  {}\n",
               model::name(motion.floor), model::name(motion.kind), data::degrees(motion.theta_rad),
               motion.precession_rad_s, motion.w3_rad_s, motion.circle_radius_m,
               motion.normal_force_N, motion.friction_demand, nutation,
               std::isnan(nu2)   ? "rests on a line or a face"
               : motion.stable() ? "stable"
                                 : "unstable, grows at this rate");
  }
}

/// "ring" of ring.toml and ring.fit.json, the name of a bundled scene.
std::string stem_of(const SimulateOptions& options) {
  if (!options.fit.empty()) {
    const fs::path stem = options.fit.stem();
    return (stem.extension() == ".fit" ? stem.stem() : stem).string();
  }
  const fs::path named(options.scene);
  return named.extension() == ".toml" ? named.stem().string() : options.scene;
}

void tell(const SimulateOptions& options, const model::Trajectory& run, const fs::path& output,
          const std::vector<std::string>& pictures) {
  const std::string outcome(model::sentence(run.outcome));
  if (options.json)
    return print_json({{"trajectory", output.string()},
                       {"rows", run.values.rows()},
                       {"status", model::name(run.outcome)},
                       {"outcome", outcome},
                       {"model", run.model},
                       {"integrator", run.integrator},
                       {"error_estimate_m", run.error_estimate_m},
                       {"error_estimate_rad", run.error_estimate_rad},
                       {"pictures", pictures}});
  fmt::print("{}: {} rows. {}\n", output.string(), run.values.rows(), outcome);
  note(fmt::format("model {}, integrator {} ({}), error estimate {}", run.model, run.integrator,
                   run.integrator_reason, error_words(run)));
  for (const std::string& picture : pictures) fmt::print("{}\n", picture);
}

void check_rows(const std::string& scene, const data::RunSettings& run) {
  check_length(scene, run.until_s, run.rate_hz, data::Table::kMostRows, "rows");
  constexpr double kRounding = 1e-9;
  if (run.until_s * run.rate_hz < 1.0 - kRounding)
    throw InputError(fmt::format(
        "{}: {:g} s at {:g} Hz leave no row but the start; raise run.rate_hz (--rate) to {:.3g}",
        scene, run.until_s, run.rate_hz, 1.0 / run.until_s));
}

/// What to run: a scene, which may be a fit's.
struct Wanted {
  data::Scene scene;
  std::optional<data::Fit> fit;
};

Wanted wanted(const SimulateOptions& options) {
  Wanted wanted;
  if (!options.fit.empty()) wanted.fit = data::read_fit(options.fit);
  wanted.scene = wanted.fit
                     ? in_scene(options.fit.string(),
                                [&] { return fitted_scene(*wanted.fit, options.arc.value_or(0)); })
                     : load_scene(options.scene);
  apply_overrides(options, wanted.scene);
  return wanted;
}

/// What a fit holds besides the motion that is run, and what it says of it.
void tell_fit(const SimulateOptions& options, const data::Fit& fit) {
  if (!options.arc && fit.arcs.size() > 1)
    note(fmt::format("{}: holds {} arcs, and the first is run; {} the other{}",
                     options.fit.string(), fit.arcs.size(),
                     fit.arcs.size() == 2
                         ? "--arc 1 runs"
                         : fmt::format("--arc 1 to --arc {} run", fit.arcs.size() - 1),
                     fit.arcs.size() == 2 ? "" : "s"));
  if (!fit.converged)
    note(fmt::format("{}: is no good fit of its track: {}", options.fit.string(), fit.reason));
}

/// What the run follows from: a file, by its checksum, or a bundled scene.
void add_source(const fs::path& named, data::Table& table) {
  table.header.emplace_back("made from", named.filename().string());
  std::error_code ignored;
  if (fs::is_regular_file(named, ignored))
    table.header.emplace_back("made from sha256", data::sha256_of_file(named));
}

/// A run counts time from the fit's state on, a recording from its first frame.
void tell_origin(const data::Fit& fit, std::size_t arc, data::Table& table) {
  const double origin_s = arc_start_s(fit, arc), factor = time_factor(fit);
  if (origin_s == 0.0 && factor == 1.0) return;
  std::string words = fmt::format("t_s = 0 is {} s of the recording", origin_s);
  if (factor != 1.0) words += fmt::format(", whose clock runs {:.6g} times as fast", 1.0 / factor);
  table.header.emplace_back("time", words);
  note(words);
}

void simulate_scene(const SimulateOptions& options) {
  const fs::path named = options.fit.empty() ? fs::path(options.scene) : options.fit;
  const std::string stem = stem_of(options);
  const fs::path output =
      options.output.empty() ? fs::path(stem + ".trajectory.csv") : options.output;
  check_outputs({output, options.animation}, {named});
  if (!options.plots.empty()) check_folder(options.plots);
#ifdef TROCHOID_HAS_TRACKING
  if (!options.animation.empty()) check_animation_name(options.animation);
#endif
  const auto [scene, fit] = wanted(options);
  check_rows(named.string(), scene.run);
  const model::Trajectory run =
      in_scene(named.string(), [&, &scene = scene] { return model::simulate(scene); });
  if (run.values.rows() == 0)
    throw InputError(fmt::format("{}: the start leaves nothing to simulate: {} Start elsewhere",
                                 named.string(), model::sentence(run.outcome)));
  if (!fit) tell_idle_keys(options.scene, scene);
  data::Table table = trajectory_table(run);
  add_source(named, table);
  if (fit) {
    tell_fit(options, *fit);
    tell_origin(*fit, options.arc.value_or(0), table);
  }
  if (options.thesis || !options.plots.empty()) add_thesis_quantities(scene, table);
#ifdef TROCHOID_HAS_TRACKING
  if (!options.animation.empty()) check_has_path(table, options.animation);
#endif
  data::write_table(table, output);
  std::vector<std::string> pictures;
  if (!options.plots.empty())
    for (const fs::path& plot : write_trajectory_plots(table, stem, options.plots))
      pictures.push_back(plot.string());
#ifdef TROCHOID_HAS_TRACKING
  if (!options.animation.empty()) {
    write_animation(table, options.animation);
    pictures.push_back(options.animation.string());
  }
#endif
  tell(options, run, output, pictures);
  if (broke_off(run.outcome))
    throw NotGood(fmt::format("the run broke off at t = {:g} s: {}", run.end_s,
                              model::sentence(run.outcome)));
}

void run(const SimulateOptions& options) {
  if (options.list) return list_scenes(options.json);
  if (options.scene.empty() == options.fit.empty())
    throw InputError(
        "simulate: name either a scene with --scene FILE or --scene NAME (--list shows names), or "
        "a fit with --fit FILE");
  if (options.steady) {
    const data::Scene scene = wanted(options).scene;
    return in_scene(options.fit.empty() ? options.scene : options.fit.string(),
                    [&] { print_steady(scene, options.json); });
  }
  simulate_scene(options);
}

}  // namespace

void add_simulate_command(CLI::App& app) {
  auto options = std::make_shared<SimulateOptions>();
  CLI::App* command =
      app.add_subcommand("simulate", "Run a scene's model and write its trajectory");
  command->add_option("--scene,-s", options->scene,
                      "Scene file (TOML), or the name of a bundled scene");
  command->add_option(
      "--fit", options->fit,
      "Run the motion of a fit (JSON), from its start; --until goes beyond its end");
  command->add_option("--arc", options->arc, "Which arc of the fit, counted from 0 [0]")
      ->check(whole_number())
      ->needs("--fit");
  command->add_option("-o,--output", options->output, "Trajectory CSV [SCENE.trajectory.csv]");
  command->add_option("--until", options->until_s, "End time [s, the scene's run.until_s]")
      ->check(positive_number());
  command->add_option("--rate", options->rate_hz, "Rows per second [Hz, the scene's run.rate_hz]")
      ->check(positive_number());
  command
      ->add_option("--tolerance", options->tolerance,
                   "Relative tolerance of the integration [the scene's run.tolerance]")
      ->check(number_within(1e-15, 0.1));
  command->add_option("--model", options->model, "Model, instead of the scene's")
      ->check(CLI::IsMember(
          {"auto", "free", "top", "top-euler", "rolling", "smooth", "sliding", "puck", "pivot"}));
  command->add_option("--integrator", options->integrator, "Method, instead of the scene's")
      ->check(CLI::IsMember(
          {"auto", "dop853", "taylor", "radau", "cvode-adams", "cvode-bdf", "arkode"}));
  command->add_flag("--thesis", options->thesis,
                    "Add body rates, angular momentum, wrapped angles and running integrals");
  command->add_option("--plots", options->plots,
                      "Draw angles, rates, path and energy into this folder");
#ifdef TROCHOID_HAS_TRACKING
  command->add_option("--animate", options->animation,
                      "Write a clip of the path being drawn (.mp4)");
#endif
  CLI::Option* steady =
      command->add_flag("--steady", options->steady,
                        "List the steady motions of the scene's body instead of running it");
  for (const char* option : {"--output", "--plots", "--thesis"}) steady->excludes(option);
#ifdef TROCHOID_HAS_TRACKING
  steady->excludes("--animate");
#endif
  command->add_flag("--list", options->list, "List the bundled scenes");
  add_json_flag(*command, options->json);
  command->footer("Example: trochoid simulate --scene thesis-base -o base.csv --plots plots/");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
