#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>

#include "commands.hpp"
#include "plot.hpp"
#include "scene_library.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/model/mean_path.hpp"
#include "trochoid/model/simulate.hpp"
#include "trochoid/model/steady.hpp"

// study retrograde: which bodies and which losses turn the mean path round (docs/retrograde.md).
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct Options {
  fs::path out;
};

/// A body and one loss mechanism.
struct Case {
  std::string label;
  data::Scene scene;
};

data::Scene without_losses(const char* bundled) {
  data::Scene scene = load_scene(bundled);
  scene.model.air_linear_N_m_s.reset();
  return scene;
}

Case with_air(const char* bundled, const char* body, double ratio) {
  data::Scene scene = load_scene(bundled);
  const double transverse = (*scene.model.air_linear_N_m_s)[0];
  scene.model.air_linear_N_m_s = Eigen::Vector3d(transverse, transverse, ratio * transverse);
  return {fmt::format("{}, air couple c3/c1 = {:g}", body, ratio), scene};
}

Case with_pivoting(const char* bundled, const char* body, double mu_p_m) {
  data::Scene scene = without_losses(bundled);
  scene.model.pivoting_friction_m = mu_p_m;
  return {fmt::format("{}, pivoting friction {:g} mm", body, 1e3 * mu_p_m), scene};
}

Case with_rolling_friction(const char* bundled, const char* body, double mu_r_m) {
  data::Scene scene = without_losses(bundled);
  scene.model.rolling_friction_m = mu_r_m;
  return {fmt::format("{}, rolling friction {:g} mm", body, 1e3 * mu_r_m), scene};
}

Case with_contour(const char* bundled, const char* body, double mu_c_m) {
  data::Scene scene = without_losses(bundled);
  scene.model.contour_friction_m = mu_c_m;
  return {fmt::format("{}, contour friction {:g} mm", body, 1e3 * mu_c_m), scene};
}

std::vector<Case> cases() {
  std::vector<Case> list;
  for (const auto& [scene, body] :
       {std::pair{"ring_retrograde", "ring"}, {"disc_prograde", "disc"}}) {
    for (const double ratio : {6.0, 4.0, 1.0}) list.push_back(with_air(scene, body, ratio));
    list.push_back(with_pivoting(scene, body, 2.5e-4));
    list.push_back(with_rolling_friction(scene, body, 1e-4));
    list.push_back(with_contour(scene, body, 1e-4));
  }
  return list;
}

struct Turn {
  model::MeanPath path;
  model::Outcome outcome;
  double end_s;
  double friction_demand;
};

double friction_demand(const data::Table& run) {
  const Eigen::ArrayXd normal = run.column("normal_force_N").array();
  const Eigen::ArrayXd x = run.column("force_x_N").array(), y = run.column("force_y_N").array();
  return ((x.square() + y.square()).sqrt() / normal).maxCoeff();
}

Turn follow(const data::Scene& scene) {
  const model::Trajectory run = model::simulate(scene);
  const data::Table table{.header = {}, .columns = run.columns, .values = run.values};
  return {model::mean_path(table.column("t_s"), table.column("phi_rad"), table.column("x_m"),
                           table.column("y_m")),
          run.outcome, run.end_s, friction_demand(table)};
}

void print_row(const Case& item, const Turn& turn) {
  const Eigen::VectorXd parts = turn.path.heading_in_parts(8);
  const std::optional<double> inflection = turn.path.inflection_s();
  const std::string verdict =
      parts[7] < 0.0 ? fmt::format("retrograde, inflection at {:.2f} s", inflection.value_or(NAN))
      : inflection   ? fmt::format("retrograde from {:.2f} s, then prograde again", *inflection)
                     : std::string("prograde throughout");
  fmt::print("{:<34} {:>8.3f} {:>8.3f} {:>8.2f} {:>7.2f}  {}\n", item.label, parts[0], parts[7],
             turn.friction_demand, turn.end_s, verdict);
}

void run(const Options& options) {
  if (!options.out.empty()) fs::create_directories(options.out);
  fmt::print("{:<34} {:>8} {:>8} {:>8} {:>7}  {}\n", "body and loss", "first", "last", "demand",
             "end_s", "mean path (heading rate per phi in the first and last eighth)");
  Axes axes{.title = "Heading of the mean path: positive is prograde, negative retrograde",
            .x_label = "t [s]",
            .y_label = "d(heading)/d(phi) = (W - nu)/W",
            .series = {}};
  for (const Case& item : cases()) {
    const Turn turn = follow(item.scene);
    print_row(item, turn);
    axes.series.push_back({.label = item.label,
                           .x = turn.path.t_s,
                           .y = turn.path.heading_per_phi,
                           .dashed = item.label.starts_with("disc")});
  }
  if (options.out.empty()) return;
  write_plot({axes}, options.out / "retrograde.svg");
  fmt::print("{}\n", (options.out / "retrograde.svg").string());
}

}  // namespace

void add_study_retrograde(CLI::App& study) {
  auto options = std::make_shared<Options>();
  CLI::App* command = study.add_subcommand(
      "retrograde", "Which bodies and which losses turn the mean path of a rolling body round");
  command->add_option("--out", options->out, "Draw the heading rates into this folder");
  command->footer("Example: trochoid study retrograde --out docs/figures");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
