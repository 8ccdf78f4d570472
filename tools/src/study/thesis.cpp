#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "commands.hpp"
#include "common/outputs.hpp"
#include "common/scene_library.hpp"
#include "draw/plot.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/model/simulate.hpp"

// study thesis: the thesis' runs against closed forms, and its figures (docs/thesis.md).
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct ThesisOptions {
  fs::path out;
};

data::Table simulated(const data::Scene& scene) {
  const model::Trajectory run = model::simulate(scene);
  return {.header = {}, .columns = run.columns, .values = run.values};
}

// --- Closed forms; equation numbers of model/theory/top.md. ---

struct TopGroups {
  double a_1_s2, b_1_s;
};
TopGroups groups(const data::Scene& scene) {  // (1)
  const data::Body& body = *scene.body;
  return {*body.mass_kg * scene.model.gravity_m_s2 * *body.l_m / *body.I_kg_m2,
          *body.Is_kg_m2 * *scene.start.omega_s_rad_s / *body.I_kg_m2};
}

struct Nutation {
  double theta_max_rad, period_s, precession_rad;
};
/// A top released at rest, (13) and (14). Its tilt at the release is one root of the cubic; the
/// others solve 2 a (1 - u^2) = b^2 (u0 - u).
Nutation nutation(const TopGroups& top, double theta0_rad) {
  const double a = top.a_1_s2, b = top.b_1_s, u2 = std::cos(theta0_rad);
  const double ratio = b * b / (4.0 * a);
  const double root = std::sqrt(ratio * ratio - 2.0 * ratio * u2 + 1.0);
  const double u1 = ratio - root, u3 = ratio + root, beta = b * u2;
  const double lambda = std::sqrt(0.5 * a * (u3 - u1));
  const double modulus = std::sqrt((u2 - u1) / (u3 - u1));
  const double below =
                   (beta + b) / (1.0 + u1) * std::comp_ellint_3(modulus, -(u2 - u1) / (1.0 + u1)),
               above =
                   (beta - b) / (1.0 - u1) * std::comp_ellint_3(modulus, (u2 - u1) / (1.0 - u1));
  return {std::acos(u1), 2.0 * std::comp_ellint_1(modulus) / lambda, (below + above) / lambda};
}

// --- The runs. ---

/// The scene over one nutation of known period, in an even number of steps.
data::Table one_nutation(data::Scene scene, double period_s) {
  constexpr double kRows = 4000.0;
  scene.run.until_s = period_s;
  scene.run.rate_hz = kRows / period_s;
  scene.run.tolerance = 1e-13;
  return simulated(scene);
}

/// Whether d(psi)/dt has an extremum inside a half nutation.
bool has_bump(const data::Table& nutation) {
  const Eigen::VectorXd rate = nutation.column("dpsi_rad_s");
  for (Eigen::Index n = 2; n < rate.size() / 2; ++n)
    if ((rate[n] - rate[n - 1]) * (rate[n - 1] - rate[n - 2]) < 0.0) return true;
  return false;
}

void print_top(const std::string& name, const data::Scene& scene) {
  const TopGroups top = groups(scene);
  const double theta0 = *scene.start.theta_rad;
  const Nutation exact = nutation(top, theta0);
  const data::Table run = one_nutation(scene, exact.period_s);
  const Eigen::VectorXd theta = run.column("theta_rad"), phi = run.column("phi_rad");
  const Eigen::Index last = theta.size() - 1;
  const double apart =
      std::max({std::abs(theta[last / 2] - exact.theta_max_rad), std::abs(theta[last] - theta0),
                std::abs(phi[last] - exact.precession_rad)});
  fmt::print("{:<18} {:>8.4g} {:>7.4g} {:>12.6f} {:>11.6f} {:>11.6f}   {:<4} {:>10.1e}\n", name,
             top.a_1_s2, top.b_1_s, data::degrees(exact.theta_max_rad), exact.period_s,
             exact.precession_rad, has_bump(run) ? "yes" : "no", apart);
}

/// Gravity at which the bump appears, from runs alone.
double bump_onset_m_s2(data::Scene scene) {
  double without = 1e-3, with = 100.0;
  for (int i = 0; i < 40; ++i) {
    scene.model.gravity_m_s2 = 0.5 * (without + with);
    const double period_s = nutation(groups(scene), *scene.start.theta_rad).period_s;
    (has_bump(one_nutation(scene, period_s)) ? with : without) = scene.model.gravity_m_s2;
  }
  return with;
}

void print_onset(const char* name) {
  const data::Scene scene = load_scene(name);
  const TopGroups top = groups(scene);
  // (17), for a release at 60 degrees.
  const double exact = top.b_1_s * top.b_1_s / 8.0 * scene.model.gravity_m_s2 / top.a_1_s2;
  fmt::print("{:<18} bump in dpsi/dt from g = {:.5f} m/s^2 (closed form {:.5f})\n", name,
             bump_onset_m_s2(scene), exact);
}

/// The torque-free body's period (torque_free.md, (8)), and how well the run comes back after it.
void print_free() {
  data::Scene scene = load_scene("thesis-free");
  Eigen::Vector3d moments = *scene.start.moments_kg_m2;
  const Eigen::Vector3d w = *scene.start.w_body_rad_s;
  const double energy2 = moments.dot(w.cwiseAbs2()),
               momentum2 = moments.cwiseProduct(w).squaredNorm();
  std::sort(moments.begin(), moments.end());  // L^2 > 2 T I2: turns about the largest moment
  const double I1 = moments[0], I2 = moments[1], I3 = moments[2];
  const double spread = (I3 - I2) * (momentum2 - energy2 * I1);
  const double parameter = (I2 - I1) * (energy2 * I3 - momentum2) / spread;
  const double period_s =
      4.0 * std::comp_ellint_1(std::sqrt(parameter)) / std::sqrt(spread / (I1 * I2 * I3));
  const data::Table run = one_nutation(scene, period_s);
  double apart = 0.0;
  for (const char* column : {"wx_rad_s", "wy_rad_s", "wz_rad_s"}) {
    const Eigen::VectorXd rate = run.column(column);
    apart = std::max(apart, std::abs(rate[rate.size() - 1] - rate[0]));
  }
  fmt::print("{:<18} period {:.12f} s, back at its start within {:.1e} rad/s\n", "thesis-free",
             period_s, apart);
}

// --- The figures. ---

/// One line of a figure: a bundled scene and what tells it from the others.
using Line = std::pair<std::string, const char*>;

struct Quantity {
  const char* column;
  const char* label;
  bool wrapped = false;
};
constexpr Quantity kSixPanels[] = {
    {"theta_rad", "theta [rad]"},   {"dtheta_rad_s", "dtheta/dt [rad/s]"},
    {"phi_rad", "phi [rad]", true}, {"dphi_rad_s", "dphi/dt [rad/s]"},
    {"psi_rad", "psi [rad]", true}, {"dpsi_rad_s", "dpsi/dt [rad/s]"}};

Axes panel(const std::vector<Line>& lines, const Quantity& quantity, const std::string& title,
           double until_s) {
  constexpr double kRows = 300.0, kRate_hz = 7.5;  // as fine as the eye resolves
  Axes axes{.title = title, .x_label = "t [s]", .y_label = quantity.label, .series = {}};
  for (const auto& [label, name] : lines) {
    data::Scene scene = load_scene(name);
    scene.run.until_s = until_s;
    scene.run.rate_hz = std::min(kRate_hz, kRows / until_s);
    const data::Table run = simulated(scene);
    Series series{.label = label,
                  .x = run.column("t_s"),
                  .y = run.column(quantity.column),
                  .dashed = axes.series.size() % 2 == 1};
    if (quantity.wrapped) {
      for (double& value : series.y) value = data::wrapped(value);
      series = with_gaps_at_turns(series);
    }
    axes.series.push_back(std::move(series));
  }
  return axes;
}

std::vector<Axes> six_panels(const std::vector<Line>& lines, double until_s) {
  std::vector<Axes> panels;
  for (const Quantity& quantity : kSixPanels) panels.push_back(panel(lines, quantity, "", until_s));
  return panels;
}

Axes body_rates(const char* name, const std::string& title) {
  data::Scene scene = load_scene(name);
  scene.run.rate_hz = 200.0 / scene.run.until_s;
  const data::Table run = simulated(scene);
  Axes axes{.title = title, .x_label = "t [s]", .y_label = "body axes [rad/s]", .series = {}};
  for (const auto& [column, label] :
       {std::pair{"wx_rad_s", "wx"}, {"wy_rad_s", "wy"}, {"wz_rad_s", "wz"}})
    axes.series.push_back({.label = label, .x = run.column("t_s"), .y = run.column(column)});
  return axes;
}

/// The path in the thesis' axes, X = -y and Y = x.
std::vector<Axes> projections() {
  data::Scene scene = load_scene("thesis-base");
  scene.run.until_s = 50.0;  // as in appendix A.4
  scene.run.rate_hz = 10.0;
  const data::Table run = simulated(scene);
  const Eigen::VectorXd X = -run.column("y_m");
  return {{.title = "figure 3.24: from above",
           .x_label = "X [m]",
           .y_label = "Y [m]",
           .equal = true,
           .series = {{.label = "", .x = X, .y = run.column("x_m")}}},
          {.title = "figure 3.25: from the side, with z = l cos(theta)",
           .x_label = "X [m]",
           .y_label = "Z [m]",
           .equal = true,
           .series = {{.label = "", .x = X, .y = run.column("z_m")}}}};
}

void write_panels(const std::vector<Axes>& panels, const fs::path& path) {
  write_plot(panels, path);
  fmt::print("{}\n", path.string());
}

void write_figures(const fs::path& folder) {
  const Quantity spin{"dpsi_rad_s", "dpsi/dt [rad/s]"}, tilt{"theta_rad", "theta [rad]"};
  write_panels({body_rates("thesis-free", "figure 3.1: three different moments"),
                body_rates("thesis-free-case3", "figure 3.5: moments close to each other")},
               folder / "thesis_free.svg");
  write_panels(projections(), folder / "thesis_path.svg");
  write_panels(six_panels({{"", "thesis-base"}}, 60.0), folder / "thesis_base.svg");
  write_panels({panel({{"g = 0.1", "thesis-g-0.1"},
                       {"g = 3", "thesis-g-3"},
                       {"g = 5", "thesis-g-5"},
                       {"g = 7", "thesis-g-7"},
                       {"g = 9", "thesis-g-9"},
                       {"g = 15", "thesis-g-15"}},
                      spin, "figure 3.11: the bump is there at 9 and 15, not at 7", 20.0),
                panel({{"g = 0.1", "thesis-g-0.1"},
                       {"g = 0.3", "thesis-g-0.3"},
                       {"g = 0.5", "thesis-g-0.5"},
                       {"g = 0.7", "thesis-g-0.7"},
                       {"g = 0.8", "thesis-g-0.8"},
                       {"g = 0.9", "thesis-g-0.9"}},
                      spin, "figure 3.12: no bump up to 0.9", 20.0)},
               folder / "thesis_gravity.svg");
  write_panels({panel({{"omega_s = 0.1", "thesis-spin-0.1"},
                       {"omega_s = 0.5", "thesis-base"},
                       {"omega_s = 1", "thesis-spin-1"}},
                      tilt, "figures 3.13 to 3.15: spin", 30.0),
                panel({{"m = 0.1", "thesis-base"},
                       {"m = 0.2", "thesis-mass-0.2"},
                       {"m = 0.3", "thesis-mass-0.3"},
                       {"m = 0.4", "thesis-mass-0.4"},
                       {"m = 0.5", "thesis-mass-0.5"}},
                      tilt, "figures 3.16 and 3.17: mass", 30.0)},
               folder / "thesis_spin_mass.svg");
  write_panels(six_panels({{"m or l = 0.9", "thesis-mass-0.9"},
                           {"I = 2", "thesis-I-2"},
                           {"I = 0.75", "thesis-I-0.75"},
                           {"g = 0.1", "thesis-g-0.1"},
                           {"g = 20", "thesis-g-20"}},
                          10.0),
               folder / "thesis_conditions.svg");
}

void run(const ThesisOptions& options) {
  if (!options.out.empty()) make_folder(options.out);
  fmt::print("{:<18} {:>8} {:>7} {:>12} {:>11} {:>11}   {:<4} {:>10}\n", "scene", "a_1_s2", "b_1_s",
             "tilt_max_deg", "nutation_s", "dphi_rad", "bump", "run apart");
  for (const BundledScene& bundled : bundled_scenes()) {
    if (!bundled.name.starts_with("thesis-")) continue;
    const std::string name(bundled.name);
    const data::Scene scene = load_scene(name);
    if (scene.model.name == "top") print_top(name, scene);
  }
  for (const char* name : {"thesis-base", "thesis-mass-0.9", "thesis-l-0.9"}) print_onset(name);
  print_free();
  if (!options.out.empty()) write_figures(options.out);
}

}  // namespace

void add_study_thesis(CLI::App& study) {
  auto options = std::make_shared<ThesisOptions>();
  CLI::App* command = study.add_subcommand(
      "thesis", "The thesis' runs against their closed forms, and its figures drawn again");
  command->add_option("--out", options->out, "Draw the figures into this folder");
  command->footer("Example: trochoid study thesis --out docs/figures");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
