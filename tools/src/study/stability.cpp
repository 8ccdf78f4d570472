#include <fmt/format.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "commands.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/scene_library.hpp"
#include "study/runs.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

// study stability: stiff and extreme scenes, every integrator, each cell judged.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct StabilityOptions {
  fs::path out = "study-stability";
};

constexpr std::array<const char*, 7> kContenders{"auto",        "dop853",    "taylor", "radau",
                                                 "cvode-adams", "cvode-bdf", "arkode"};
constexpr std::array<double, 2> kTolerancesTried{1e-6, 1e-10};

struct Extreme {
  std::string name;
  data::Scene scene;
  /// The reference is the regularised law at this speed instead [m/s]: the exact law, and speeds at
  /// which 80 bits would need hours, are its limit.
  std::optional<double> reference_slip_m_s = {};
  bool same_truth = false;  ///< the scene before has the same reference
};

/// What a scene is judged by: a reference, and how far that may itself be from the scene's law.
struct Truth {
  ReferenceRun run;
  double floor_rad = 0.0;
};

Extreme variant(std::string name, const char* bundled,
                const std::function<void(data::Scene&)>& change) {
  Extreme extreme{std::move(name), load_scene(bundled), {}};
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
  for (const double ratio : {1e-3, 1e-2, 1e2, 1e3})
    top(fmt::format("top: I/Is = {:g}", ratio),
        [ratio](data::Scene& s) { s.body->Is_kg_m2 = *s.body->I_kg_m2 / ratio; });
  for (const double g : {0.0, 1.0, 980.0, 1e3})
    top(fmt::format("top: g = {:g} m/s^2", g), [g](data::Scene& s) {
      s.model.gravity_m_s2 = g;
      s.run.until_s = 20.0;
    });
  top("top: an hour", [](data::Scene& s) {
    s.run.until_s = 3600.0;
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
  for (const double of_radius : {0.5, 1.0})
    rolling(fmt::format("rolling: thickness {:g} R", of_radius), [of_radius](data::Scene& s) {
      s.body->thickness_m = of_radius * s.body->radius_m;
      s.start.theta_rad = 0.6;
      s.run.until_s = 0.5;
    });
  rolling("rolling: g = 1e3 m/s^2", [](data::Scene& s) {
    s.model.gravity_m_s2 = 1e3;
    s.start.w2_rad_s = 220.0;
    s.run.until_s = 1.0;
    s.run.rate_hz = 1000.0;
  });
  for (const double tilt_deg : {1.0, 0.1})
    rolling(fmt::format("rolling: Euler disc at {:g} deg", tilt_deg), [tilt_deg](data::Scene& s) {
      const double tilt_rad = data::radians(tilt_deg);
      s.body->thickness_m = 0.0;
      s.start.theta_rad = tilt_rad;
      s.start.w1_rad_s = 0.0;
      s.start.w2_rad_s =
          std::sqrt(4.0 * 9.81 / (s.body->radius_m * std::sin(tilt_rad))) * std::sin(tilt_rad);
      s.start.w3_rad_s = 0.0;
      s.run.until_s = 0.5;
      s.run.rate_hz = 1000.0;
    });
  list.push_back(variant("smooth floor", "disc_smooth", [](data::Scene&) {}));
}

/// The body is caught by friction 0.047 s after its start: from there on the law is stiff.
void add_sliding_bodies(std::vector<Extreme>& list) {
  const auto sliding = [&](std::string name, double until_s, std::optional<double> slip_m_s) {
    list.push_back(variant(std::move(name), "disc_sliding", [&](data::Scene& s) {
      s.model.slip_regularisation_m_s = slip_m_s;
      s.run.until_s = until_s;
      s.run.rate_hz = 1000.0;
    }));
  };
  for (const double eps : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6})
    sliding(fmt::format("sliding: regularised at {:g} m/s", eps), eps < 1e-5 ? 0.06 : 0.5, eps);
  constexpr double kFinest_m_s = 1e-6;  // what 80 bits reach within seconds
  for (const double eps : {1e-7, 1e-8, 1e-9})
    sliding(fmt::format("sliding: regularised at {:g} m/s", eps), 0.06, eps);
  sliding("sliding: exact law, caught", 0.06, std::nullopt);
  for (std::size_t i = list.size() - 4; i < list.size(); ++i) {
    list[i].reference_slip_m_s = kFinest_m_s;
    list[i].same_truth = i > list.size() - 4;
  }
  sliding("sliding: exact law, grip lost and found", 1.1, std::nullopt);
  list.back().reference_slip_m_s = 10.0 * kFinest_m_s;
  list.back().scene.model.friction = 0.26;  // about what rolling asks for: it hovers at the limit
}

std::vector<Extreme> extremes() {
  std::vector<Extreme> list;
  add_tops(list);
  add_free_bodies(list);
  add_rim_bodies(list);
  add_sliding_bodies(list);
  return list;
}

/// A cell is wrong if the run claims its end but is off by ten times what it says of its own error
/// and by more than a hundred tolerances, a start's rounding amplified included. Errors beyond
/// those tolerances that the run does state are marked.
struct StabilityVerdict {
  std::string words;
  bool wrong = false;
};

StabilityVerdict judge(const StudyRun& run, double tolerance, double growth, double floor_rad) {
  if (!run.offered) return {"not offered", false};
  if (!run.refusal.empty()) return {fmt::format("refused: {}", run.refusal), true};
  if (run.outcome != model::Outcome::reached_end)
    return {fmt::format("refused: {}", model::name(run.outcome)), false};
  const double asked = 100.0 * std::max(tolerance, 1e-15) * growth + floor_rad;
  const double stated = 10.0 * run.estimate_rad;
  if (!(run.axis_error <= std::max(asked, stated)))
    return {fmt::format("WRONG by {:.1e}", run.axis_error), true};
  if (run.axis_error > asked) return {fmt::format("{:.1e} stated", run.axis_error), false};
  return {fmt::format("{:.1e}", run.axis_error), false};
}

ReferenceRun reference_at(data::Scene scene, const std::string& name,
                          std::optional<double> slip_m_s) {
  if (slip_m_s) scene.model.slip_regularisation_m_s = slip_m_s;
  auto reference = high_precision_run(scene);
  if (!reference) throw NumericalError(name + ": no reference solution");
  return std::move(*reference);
}

/// The regularised law differs from its limit in proportion to its speed: a run at three times the
/// speed is off three times as far, and half of what they differ by is the distance of the slower
/// one. Twice that is allowed.
Truth truth_of(const Extreme& extreme) {
  const auto slip_m_s = extreme.reference_slip_m_s;
  Truth truth{reference_at(extreme.scene, extreme.name, slip_m_s)};
  if (!slip_m_s) return truth;
  const ReferenceRun wider = reference_at(extreme.scene, extreme.name, 3.0 * *slip_m_s);
  truth.floor_rad = (wider.axis - truth.run.axis).rowwise().norm().maxCoeff();
  return truth;
}

std::string drift_words(const StudyRun& run) {
  return run.refusal.empty() && run.energy_drift ? fmt::format("{:.1e}", *run.energy_drift) : "-";
}

void run(const StabilityOptions& options) {
  make_folder(options.out);
  const std::vector<Extreme> list = extremes();
  std::string csv =
      "scene,integrator,tolerance,growth,known_to_rad,verdict,axis_error,path_error_m,stated_error_"
      "rad,"
      "energy_drift,outcome\n";
  std::string table = fmt::format("{:<40} {:>9} {:>8} {:>8} {:>8}", "scene", "tolerance", "growth",
                                  "known_to", "drift");
  for (const char* integrator : kContenders) table += fmt::format("  {:<26}", integrator);
  table += '\n';
  Progress progress("study stability", "scenes");
  Truth truth;
  int wrong = 0, cells = 0;
  std::int64_t done = 0;
  for (const Extreme& extreme : list) {
    data::Scene scene = extreme.scene;
    if (!extreme.same_truth) truth = truth_of(extreme);
    for (const double tolerance : kTolerancesTried) {
      table +=
          fmt::format("{:<40} {:>9.0e} {:>8.1e} {:>8}", extreme.name, tolerance, truth.run.growth,
                      truth.floor_rad > 0.0 ? fmt::format("{:.0e}", truth.floor_rad) : "-");
      for (const char* integrator : kContenders) {
        scene.run.integrator = integrator;
        scene.run.tolerance = tolerance;
        const StudyRun cell = study_run(scene, truth.run, 1);
        const StabilityVerdict verdict = judge(cell, tolerance, truth.run.growth, truth.floor_rad);
        if (std::string_view(integrator) == "auto")
          table += fmt::format(" {:>8}", drift_words(cell));
        wrong += verdict.wrong ? 1 : 0;
        cells += cell.offered ? 1 : 0;
        table += fmt::format("  {:<26}", verdict.words.substr(0, 26));
        csv += fmt::format("\"{}\",{},{},{},{},\"{}\",{},{},{},{},{}\n", extreme.name, integrator,
                           tolerance, truth.run.growth, truth.floor_rad, verdict.words,
                           cell.axis_error, cell.path_error_m, cell.estimate_rad, drift_words(cell),
                           model::name(cell.outcome));
      }
      table += '\n';
    }
    progress.update(++done, static_cast<std::int64_t>(list.size()));
  }
  data::write_text(csv, options.out / "stability.csv");
  fmt::print("{}", table);
  fmt::print(
      "{} cells run, {} wrong; growth: how much an error made at the start grows by the end\n"
      "known_to: the reference is the law's near neighbour, this far away; - : to rounding\n"
      "drift: largest change of the energy in the automatic run, over its size, where nothing is "
      "lost; rolling without slip and the floor are kept by the coordinates themselves\n"
      "stated: beyond a hundred tolerances, and the run's own error estimate says so\n",
      cells, wrong);
  if (wrong > 0) throw NotGood(fmt::format("{} cells are wrong", wrong));
}

}  // namespace

void add_study_stability(CLI::App& study) {
  auto options = std::make_shared<StabilityOptions>();
  CLI::App* command =
      study.add_subcommand("stability", "Stiff and extreme scenes: correct, refused or wrong");
  command->add_option("--out", options->out, "Folder for the table")->capture_default_str();
  command->footer("Example: trochoid study stability");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
