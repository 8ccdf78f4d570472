#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/constants.hpp"
#include "common/fitted_scene.hpp"
#include "common/prediction.hpp"
#include "report/parts.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/model/simulate.hpp"

// What the fitted motion does that no camera sees: energy and forces.
namespace trochoid::tools {
namespace {

/// One arc of the fit, simulated; nothing if the model cannot run it alone.
std::optional<data::Table> run_arc(const data::Fit& fit, std::size_t arc, data::Scene& scene) {
  constexpr double kSamplesPerSample = 4.0, kMostRows = 40000.0;
  try {
    scene = fitted_scene(fit, arc);
    if (!(scene.run.until_s > 0.0)) return std::nullopt;
    const double rows = std::min(kMostRows, kSamplesPerSample * fit.arcs[arc].samples);
    scene.run.rate_hz = rows / scene.run.until_s;
    model::Trajectory run = model::simulate(scene);
    if (run.values.rows() < 2) return std::nullopt;
    return data::Table{
        .header = {}, .columns = std::move(run.columns), .values = std::move(run.values)};
  } catch (const Error&) {  // a report is made of what there is
    return std::nullopt;
  }
}

bool has_column(const data::Table& table, const std::string& name) {
  return std::find(table.columns.begin(), table.columns.end(), name) != table.columns.end();
}

/// Straight lines between the rows; NaN outside.
double interpolated(const Eigen::VectorXd& t_s, const Eigen::VectorXd& values, double at_s) {
  const auto after = std::lower_bound(t_s.begin(), t_s.end(), at_s);
  if (after == t_s.end()) return kNaN;
  const Eigen::Index high = after - t_s.begin();
  if (high == 0) return at_s == t_s[0] ? values[0] : kNaN;
  const double w = (at_s - t_s[high - 1]) / (t_s[high] - t_s[high - 1]);
  return values[high - 1] + w * (values[high] - values[high - 1]);
}

/// A quantity over all arcs of an object, to be asked for at the rows of the report.
class Curve {
 public:
  Curve(std::string label, std::size_t rows) : chart_{std::move(label), {}} {
    chart_.values.assign(rows, kNaN);
  }
  void add(std::span<const double> at_s, const Eigen::VectorXd& t_s,
           const Eigen::VectorXd& values) {
    for (std::size_t i = 0; i < at_s.size(); ++i)
      if (const double value = interpolated(t_s, values, at_s[i]); std::isfinite(value))
        chart_.values[i] = value;
  }
  void into(std::vector<DynamicsChart>& charts) {
    if (std::any_of(chart_.values.begin(), chart_.values.end(),
                    [](double v) { return std::isfinite(v); }))
      charts.push_back(std::move(chart_));
  }

 private:
  DynamicsChart chart_;
};

}  // namespace

std::vector<DynamicsChart> dynamics_of(const ReportInput& input, const data::Track& track,
                                       std::span<const double> at_s) {
  constexpr double kMillijoule = 1e3;
  Curve energy("energy [mJ]", at_s.size()), per_moment("energy / I [1/s²]", at_s.size()),
      normal("contact force N / m g", at_s.size()), needed("friction needed |F| / N", at_s.size());
  const data::Fit& fit = *input.fit;
  const data::Scene given = scene_of(fit);
  const bool mass_known = given.body && given.body->mass_kg;
  for (std::size_t arc = 0; arc < fit.arcs.size(); ++arc) {
    if (track_of_arc(fit, arc, input.tracks, input.fit_track) != &track) continue;
    data::Scene scene;
    const auto table = run_arc(fit, arc, scene);
    if (!table) continue;
    // By the recording's clock.
    const Eigen::VectorXd t_s =
        (table->column("t_s") / time_factor(fit)).array() + arc_start_s(fit, arc);
    if (has_column(*table, "energy_J")) {
      const Eigen::VectorXd joule = table->column("energy_J");
      if (mass_known)
        energy.add(at_s, t_s, kMillijoule * joule);
      else
        per_moment.add(at_s, t_s, joule);
    }
    if (!has_column(*table, "normal_force_N")) continue;
    const Eigen::VectorXd up_N = table->column("normal_force_N");
    const double weight_N = *scene.body->mass_kg * scene.model.gravity_m_s2;
    normal.add(at_s, t_s, up_N / weight_N);
    const Eigen::VectorXd along_N =
        (table->column("force_x_N").array().square() + table->column("force_y_N").array().square())
            .sqrt();
    needed.add(at_s, t_s, along_N.cwiseQuotient(up_N));
  }
  std::vector<DynamicsChart> charts;
  for (Curve* curve : {&energy, &per_moment, &normal, &needed}) curve->into(charts);
  return charts;
}

}  // namespace trochoid::tools
