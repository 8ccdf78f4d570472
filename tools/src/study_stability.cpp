#include <fmt/format.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "commands.hpp"
#include "progress.hpp"
#include "scene_library.hpp"
#include "study_runs.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

// study stability: stiff and extreme scenes, every integrator, each cell judged.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct Options {
  fs::path out = "study-stability";
};

constexpr std::array<const char*, 5> kIntegrators{"auto", "dop853", "taylor", "cvode-adams",
                                                  "cvode-bdf"};
constexpr std::array<double, 2> kTolerances{1e-6, 1e-10};

struct Extreme {
  std::string name;
  data::Scene scene;
};

Extreme variant(std::string name, const char* bundled,
                const std::function<void(data::Scene&)>& change) {
  Extreme extreme{std::move(name), load_scene(bundled)};
  change(extreme.scene);
  return extreme;
}

void add_tops(std::vector<Extreme>& list) {
  const auto top = [&](std::string name, const std::function<void(data::Scene&)>& change) {
    list.push_back(variant(std::move(name), "thesis-base", change));
  };
  top("top: thesis base case", [](data::Scene&) {});
  top("top: path through the pole", [](data::Scene& s) {
    s.start.dphi_rad_s = 0.75 / (1.0 + std::cos(*s.start.theta_rad));  // ell_z = ell . k
  });
  top("top: sleeping, theta0 = 1e-9, stable", [](data::Scene& s) { s.start.theta_rad = 1e-9; });
  top("top: sleeping, theta0 = 1e-9, unstable", [](data::Scene& s) {
    s.start.theta_rad = 1e-9;
    s.start.omega_s_rad_s = 0.2;
  });
  for (const double spin : {50.0, 500.0, 1e4})
    top(fmt::format("top: spin {:g} rad/s", spin), [spin](data::Scene& s) {
      s.start.omega_s_rad_s = spin;
      s.run.until_s = spin > 1000.0 ? 2.0 : 10.0;
      s.run.rate_hz = 100.0;
    });
  for (const double ratio : {1e-3, 1e3})
    top(fmt::format("top: I/Is = {:g}", ratio),
        [ratio](data::Scene& s) { s.body->Is_kg_m2 = *s.body->I_kg_m2 / ratio; });
  for (const double g : {0.0, 980.0, 1e3})
    top(fmt::format("top: g = {:g} m/s^2", g), [g](data::Scene& s) {
      s.model.gravity_m_s2 = g;
      s.run.until_s = 20.0;
    });
  top("top: ten minutes", [](data::Scene& s) {
    s.run.until_s = 600.0;
    s.run.rate_hz = 1.0;
  });
}

void add_free_bodies(std::vector<Extreme>& list) {
  list.push_back(variant("free: near the separatrix", "thesis-free", [](data::Scene& s) {
    s.start.moments_kg_m2 = Eigen::Vector3d(1.0, 2.0, 3.0);
    s.start.w_body_rad_s = Eigen::Vector3d(1e-7, 2.0, 0.0);
    s.run.until_s = 60.0;
  }));
  list.push_back(variant("free: moments 1 : 1e3 : 1e3", "thesis-free", [](data::Scene& s) {
    s.start.moments_kg_m2 = Eigen::Vector3d(1e-3, 1.0, 1.0005);
  }));
}

void add_rim_bodies(std::vector<Extreme>& list) {
  const auto rolling = [&](std::string name, const std::function<void(data::Scene&)>& change) {
    list.push_back(variant(std::move(name), "disc_rolling", change));
  };
  rolling("rolling: thin", [](data::Scene& s) { s.body->thickness_m = 0.0; });
  rolling("rolling: as thick as the radius", [](data::Scene& s) {
    s.body->thickness_m = 0.0375;
    s.start.theta_rad = 0.6;
    s.run.until_s = 0.5;
  });
  rolling("rolling: g = 1e3 m/s^2", [](data::Scene& s) {
    s.model.gravity_m_s2 = 1e3;
    s.start.w2_rad_s = 220.0;
    s.run.until_s = 1.0;
    s.run.rate_hz = 1000.0;
  });
  rolling("rolling: Euler disc at 1 degree", [](data::Scene& s) {
    s.body->thickness_m = 0.0;
    s.start.theta_rad = 0.0175;
    s.start.w1_rad_s = 0.0;
    s.start.w2_rad_s = std::sqrt(4.0 * 9.81 / (0.0375 * std::sin(0.0175))) * std::sin(0.0175);
    s.start.w3_rad_s = 0.0;
    s.run.until_s = 0.5;
    s.run.rate_hz = 1000.0;
  });
  list.push_back(variant("smooth floor", "disc_smooth", [](data::Scene&) {}));
  for (const double eps : {1e-2, 1e-3, 1e-4, 1e-5})
    list.push_back(variant(fmt::format("sliding: regularised at {:g} m/s", eps), "disc_sliding",
                           [eps](data::Scene& s) {
                             s.model.slip_regularisation_m_s = eps;
                             s.run.until_s = eps < 1e-3 ? 0.05 : 0.5;
                             s.run.rate_hz = 1000.0;
                           }));
}

std::vector<Extreme> extremes() {
  std::vector<Extreme> list;
  add_tops(list);
  add_free_bodies(list);
  add_rim_bodies(list);
  return list;
}

/// A cell is wrong if the run claims its end but is off by ten times what it says of its own error
/// and by more than a hundred tolerances, a start's rounding amplified included. Errors beyond
/// those tolerances that the run does state are marked.
struct Verdict {
  std::string words;
  bool wrong = false;
};

Verdict judge(const StudyRun& run, double tolerance, double growth, bool asked_by_name) {
  if (!run.refusal.empty())
    return {asked_by_name ? "not offered" : fmt::format("refused: {}", run.refusal),
            !asked_by_name};
  if (run.outcome != model::Outcome::reached_end)
    return {fmt::format("refused: {}", model::name(run.outcome)), false};
  const double asked = 100.0 * std::max(tolerance, 1e-15) * growth;
  const double stated = 10.0 * run.estimate_rad;
  if (!(run.axis_error <= std::max(asked, stated)))
    return {fmt::format("WRONG by {:.1e}", run.axis_error), true};
  if (run.axis_error > asked) return {fmt::format("{:.1e} stated", run.axis_error), false};
  return {fmt::format("{:.1e}", run.axis_error), false};
}

void run(const Options& options) {
  const std::vector<Extreme> list = extremes();
  std::string csv =
      "scene,integrator,tolerance,growth,verdict,axis_error,path_error_m,stated_error_rad,"
      "outcome\n";
  std::string table = fmt::format("{:<40} {:>9} {:>8}", "scene", "tolerance", "growth");
  for (const char* integrator : kIntegrators) table += fmt::format("  {:<26}", integrator);
  table += '\n';
  Progress progress("study stability", "scenes");
  int wrong = 0, cells = 0;
  std::int64_t done = 0;
  for (const Extreme& extreme : list) {
    data::Scene scene = extreme.scene;
    const auto reference = high_precision_run(scene);
    if (!reference) throw NumericalError(extreme.name + ": no reference solution");
    for (const double tolerance : kTolerances) {
      table += fmt::format("{:<40} {:>9.0e} {:>8.1e}", extreme.name, tolerance, reference->growth);
      for (const char* integrator : kIntegrators) {
        scene.run.integrator = integrator;
        scene.run.tolerance = tolerance;
        const StudyRun cell = study_run(scene, *reference, 1);
        const bool by_name = std::string_view(integrator) != "auto";
        const Verdict verdict = judge(cell, tolerance, reference->growth, by_name);
        wrong += verdict.wrong ? 1 : 0;
        ++cells;
        table += fmt::format("  {:<26}", verdict.words.substr(0, 26));
        csv += fmt::format("\"{}\",{},{},{},\"{}\",{},{},{},{}\n", extreme.name, integrator,
                           tolerance, reference->growth, verdict.words, cell.axis_error,
                           cell.path_error_m, cell.estimate_rad, model::name(cell.outcome));
      }
      table += '\n';
    }
    progress.update(++done, static_cast<std::int64_t>(list.size()));
  }
  fs::create_directories(options.out);
  data::write_text(csv, options.out / "stability.csv");
  fmt::print("{}", table);
  fmt::print(
      "{} cells, {} wrong; growth: how much an error made at the start grows by the end\n"
      "stated: beyond a hundred tolerances, and the run's own error estimate says so\n",
      cells, wrong);
  if (wrong > 0) throw NotGood(fmt::format("{} cells are wrong", wrong));
}

}  // namespace

void add_study_stability(CLI::App& study) {
  auto options = std::make_shared<Options>();
  CLI::App* command =
      study.add_subcommand("stability", "Stiff and extreme scenes: correct, refused or wrong");
  command->add_option("--out", options->out, "Folder for the table")->capture_default_str();
  command->footer("Example: trochoid study stability");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
