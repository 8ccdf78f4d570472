#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "common/outputs.hpp"
#include "common/scene_library.hpp"
#include "draw/plot.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/quantile.hpp"
#include "trochoid/model/mean_path.hpp"
#include "trochoid/model/simulate.hpp"
#include "trochoid/model/steady.hpp"

// study retrograde: which bodies and which losses turn the mean path round (docs/retrograde.md).
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct RetrogradeOptions {
  fs::path out;
};

/// A body and one loss mechanism.
struct RetrogradeCase {
  std::string label;
  data::Scene scene;
};

data::Scene without_losses(const char* bundled) {
  data::Scene scene = load_scene(bundled);
  scene.model.air_linear_N_m_s.reset();
  return scene;
}

RetrogradeCase with_air(const char* bundled, const char* body, double ratio) {
  data::Scene scene = load_scene(bundled);
  const double transverse = (*scene.model.air_linear_N_m_s)[0];
  scene.model.air_linear_N_m_s = Eigen::Vector3d(transverse, transverse, ratio * transverse);
  return {fmt::format("{}, air couple c3/c1 = {:g}", body, ratio), scene};
}

RetrogradeCase with_pivoting(const char* bundled, const char* body, double mu_p_m) {
  data::Scene scene = without_losses(bundled);
  scene.model.pivoting_friction_m = mu_p_m;
  return {fmt::format("{}, pivoting friction {:g} mm", body, 1e3 * mu_p_m), scene};
}

RetrogradeCase with_rolling_friction(const char* bundled, const char* body, double mu_r_m) {
  data::Scene scene = without_losses(bundled);
  scene.model.rolling_friction_m = mu_r_m;
  return {fmt::format("{}, rolling friction {:g} mm", body, 1e3 * mu_r_m), scene};
}

RetrogradeCase with_contour(const char* bundled, const char* body, double mu_c_m) {
  data::Scene scene = without_losses(bundled);
  scene.model.contour_friction_m = mu_c_m;
  return {fmt::format("{}, contour friction {:g} mm", body, 1e3 * mu_c_m), scene};
}

std::vector<RetrogradeCase> cases() {
  std::vector<RetrogradeCase> list;
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
  Eigen::VectorXd x_m, y_m;
  model::MeanPath path;
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
  const Eigen::VectorXd x_m = table.column("x_m"), y_m = table.column("y_m");
  return {x_m, y_m, model::mean_path(table.column("t_s"), table.column("phi_rad"), x_m, y_m),
          run.end_s, friction_demand(table)};
}

/// Median heading rate over one eighth of the run: where the mean path has a cusp its rate has a
/// spike, which a mean would keep.
double typical_rate(const model::MeanPath& path, int eighth) {
  const Eigen::Index size = path.heading_per_phi.size() / 8;
  const Eigen::VectorXd part = path.heading_per_phi.segment(eighth * size, size);
  std::vector<double> rates(part.begin(), part.end());
  return data::median(std::move(rates));
}

void print_row(const RetrogradeCase& item, const Turn& turn) {
  const double first = typical_rate(turn.path, 0), last = typical_rate(turn.path, 7);
  const std::string verdict = last < 0.0 ? fmt::format("retrograde, inflection at {:.2f} s",
                                                       turn.path.inflection_s().value_or(NAN))
                                         : std::string("prograde at the end");
  fmt::print("{:<34} {:>8.3f} {:>8.3f} {:>8.2f} {:>7.2f}  {}\n", item.label, first, last,
             turn.friction_demand, turn.end_s, verdict);
}

/// Every n-th value: as many as the eye resolves.
Eigen::VectorXd thinned(const Eigen::VectorXd& values) {
  constexpr Eigen::Index kEvery = 10;
  return values(Eigen::seqN(0, (values.size() + kEvery - 1) / kEvery, kEvery));
}

Axes heading_panel(const char* body) {
  return {.title = fmt::format("{}: prograde above zero, retrograde below", body),
          .x_label = "t [s]",
          .y_label = "turning of the mean path / precession",
          .series = {},
          .y_range = Eigen::Vector2d(-0.6, 0.4)};
}

/// Path of the centre of mass, its mean and the inflection, from above.
Axes path_panel(const RetrogradeCase& item, const Turn& turn) {
  Axes axes{
      .title = item.label, .x_label = "x [m]", .y_label = "y [m]", .equal = true, .series = {}};
  axes.series = {
      {.label = "centre of mass", .x = turn.x_m, .y = turn.y_m, .colour = 5},
      {.label = "mean path", .x = thinned(turn.path.x_m), .y = thinned(turn.path.y_m), .colour = 1},
      {.label = "start",
       .x = turn.path.x_m.head(1),
       .y = turn.path.y_m.head(1),
       .points = true,
       .colour = 6}};
  const auto inflection = turn.path.inflection_s();
  if (!inflection) return axes;
  const auto& t_s = turn.path.t_s;
  const auto at = std::lower_bound(t_s.begin(), t_s.end() - 1, *inflection) - t_s.begin();
  axes.series.push_back({.label = "inflection",
                         .x = turn.path.x_m.segment(at, 1),
                         .y = turn.path.y_m.segment(at, 1),
                         .points = true,
                         .colour = 3});
  return axes;
}

void run(const RetrogradeOptions& options) {
  if (!options.out.empty()) make_folder(options.out);
  fmt::print("{:<34} {:>8} {:>8} {:>8} {:>7}  {}\n", "body and loss", "first", "last", "demand",
             "end_s",
             "mean path (its turning per precession, medians of the first and last eighth)");
  std::vector<Axes> headings{heading_panel("ring"), heading_panel("disc")}, paths;
  for (const RetrogradeCase& item : cases()) {
    const Turn turn = follow(item.scene);
    print_row(item, turn);
    const bool disc = item.label.starts_with("disc");
    headings[disc ? 1 : 0].series.push_back({.label = item.label.substr(6),
                                             .x = thinned(turn.path.t_s),
                                             .y = thinned(turn.path.heading_per_phi)});
    if (paths.size() == (disc ? 1u : 0u)) paths.push_back(path_panel(item, turn));
  }
  if (options.out.empty()) return;
  write_plot(headings, options.out / "retrograde_heading.svg");
  write_plot(paths, options.out / "retrograde_path.svg");
  fmt::print("{}\n{}\n", (options.out / "retrograde_heading.svg").string(),
             (options.out / "retrograde_path.svg").string());
}

}  // namespace

void add_study_retrograde(CLI::App& study) {
  auto options = std::make_shared<RetrogradeOptions>();
  CLI::App* command = study.add_subcommand(
      "retrograde", "Which bodies and which losses turn the mean path of a rolling body round");
  command->add_option("--out", options->out, "Draw heading rates and paths into this folder");
  command->footer("Example: trochoid study retrograde --out docs/figures");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
