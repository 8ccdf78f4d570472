#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>

#include "commands.hpp"
#include "common/outputs.hpp"
#include "common/validators.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"
#include "trochoid/model/simulate.hpp"

// study reference: simulate every case of a folder of reference trajectories and compare.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct ReferenceOptions {
  fs::path folder;
  fs::path out;
  double tolerance = 1e-13;
};

/// Columns of a reference CSV and of our trajectories, side by side.
struct ColumnName {
  const char* reference;
  const char* ours;
};
constexpr std::array<ColumnName, 30> kColumns{
    {{"t", "t_s"},           {"phi", "phi_rad"},     {"theta", "theta_rad"},
     {"psi", "psi_rad"},     {"dphi", "dphi_rad_s"}, {"dtheta", "dtheta_rad_s"},
     {"dpsi", "dpsi_rad_s"}, {"x", "x_m"},           {"y", "y_m"},
     {"z", "z_m"},           {"energy", "energy_J"}, {"wx", "wx_rad_s"},
     {"wy", "wy_rad_s"},     {"wz", "wz_rad_s"},     {"qw", "qw"},
     {"qx", "qx"},           {"qy", "qy"},           {"qz", "qz"},
     {"w1", "w1_rad_s"},     {"w2", "w2_rad_s"},     {"w3", "w3_rad_s"},
     {"vx", "vx_m_s"},       {"vy", "vy_m_s"},       {"N", "normal_force_N"},
     {"Fx", "force_x_N"},    {"Fy", "force_y_N"},    {"xc", "contact_x_m"},
     {"yc", "contact_y_m"},  {"slip", "slip_m_s"},   {"mode", "mode"}}};

/// A column that nothing is compared with may be a misspelt one.
void check_columns(const data::Table& reference, const fs::path& csv) {
  for (const std::string& column : reference.columns)
    if (std::none_of(kColumns.begin(), kColumns.end(),
                     [&](const ColumnName& name) { return column == name.reference; })) {
      std::vector<std::string_view> known;
      for (const ColumnName& name : kColumns) known.emplace_back(name.reference);
      throw InputError(fmt::format("{}: column '{}' is none of {}", csv.string(), column,
                                   fmt::join(known, ", ")));
    }
}

int index_of(const std::vector<std::string>& columns, std::string_view name) {
  const auto found = std::find(columns.begin(), columns.end(), name);
  return found == columns.end() ? -1 : static_cast<int>(found - columns.begin());
}

/// The trajectory under the reference files' column names.
data::Table as_reference_table(const model::Trajectory& run) {
  data::Table table;
  std::vector<int> kept;
  for (const ColumnName& name : kColumns) {
    const int found = index_of(run.columns, name.ours);
    if (found < 0) continue;
    table.columns.emplace_back(name.reference);
    kept.push_back(found);
  }
  table.values = run.values(Eigen::all, kept);
  return table;
}

/// Our rows at the reference's times and in its columns (empty where we have none): the reference
/// may hold only every n-th row of the grid. Rows after the end of our run are missing.
data::Table on_grid_of(const data::Table& reference, const data::Table& ours, double rate_hz) {
  constexpr double kSameTime = 1e-6;  // of a grid step; files round their times to 15 digits
  data::Table table{.header = {}, .columns = reference.columns, .values = {}};
  std::vector<Eigen::Index> rows;
  for (const double t : reference.column("t")) {
    const double row = t * rate_hz;
    if (std::abs(row - std::round(row)) > kSameTime)
      throw InputError(
          fmt::format("t = {} is not on the grid of {} Hz the case states", t, rate_hz));
    if (row < static_cast<double>(ours.values.rows()) - 0.5) rows.push_back(std::lround(row));
  }
  table.values.setConstant(static_cast<Eigen::Index>(rows.size()), reference.values.cols(), NAN);
  for (std::size_t i = 0; i < reference.columns.size(); ++i)
    if (ours.has(reference.columns[i]))
      table.values.col(static_cast<Eigen::Index>(i)) = ours.column(reference.columns[i])(rows);
  return table;
}

/// Largest differences to the reference; NaN where a column is missing.
struct Errors {
  double theta_rad = NAN, phi_rad = NAN, xy_m = NAN, energy = NAN, w_rad_s = NAN;
  Eigen::Index missing_rows = 0;
};

double largest(const Eigen::VectorXd& difference) {
  return difference.size() == 0 ? NAN : difference.cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
}

Errors compare(const data::Table& ours, const data::Table& reference) {
  Errors errors;
  errors.missing_rows = reference.values.rows() - ours.values.rows();
  const auto difference = [&](const char* name) -> Eigen::VectorXd {
    if (!reference.has(name)) return {};
    return ours.column(name) - reference.column(name).head(ours.values.rows());
  };
  errors.theta_rad = largest(difference("theta"));
  errors.phi_rad = largest(difference("phi"));
  const Eigen::VectorXd dx = difference("x"), dy = difference("y");
  if (dx.size() > 0 && dy.size() > 0)
    errors.xy_m = (dx.array().square() + dy.array().square()).sqrt().maxCoeff();
  if (const Eigen::VectorXd de = difference("energy"); de.size() > 0)
    errors.energy = largest(de) / reference.column("energy").cwiseAbs().maxCoeff();
  for (const char* name : {"wx", "wy", "wz"})
    if (const Eigen::VectorXd dw = difference(name); dw.size() > 0)
      errors.w_rad_s = std::fmax(errors.w_rad_s, largest(dw));
  return errors;
}

/// Fastest of a few runs: other programs only ever make a run slower.
std::pair<model::Trajectory, double> timed_run(const data::Scene& scene) {
  using Clock = std::chrono::steady_clock;
  constexpr int kRepeats = 3;
  model::Trajectory run;
  double best_ms = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kRepeats; ++i) {
    const auto start = Clock::now();
    run = model::simulate(scene);
    const std::chrono::duration<double, std::milli> elapsed = Clock::now() - start;
    best_ms = std::min(best_ms, elapsed.count());
  }
  return {std::move(run), best_ms};
}

std::string cell(double value) {
  return std::isnan(value) ? "-" : fmt::format("{:.1e}", value);
}

void print_heading() {
  fmt::print("{:<26} {:<8} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>7}  {:<12} {}\n", "case", "model",
             "theta/rad", "phi/rad", "xy/m", "energy/1", "w/(rad/s)", "time/ms", "steps",
             "integrator", "outcome");
}

void print_row(const data::ReferenceCase& item, const model::Trajectory& run,
               const std::optional<Errors>& errors, double time_ms) {
  const Errors e = errors.value_or(Errors{});
  std::string outcome{model::name(run.outcome)};
  if (run.outcome != model::Outcome::reached_end) outcome += fmt::format(" at {:.4f} s", run.end_s);
  if (e.missing_rows > 0) outcome += fmt::format(", {} rows short", e.missing_rows);
  fmt::print("{:<26} {:<8} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9.3f} {:>7}  {:<12} {}\n", item.name,
             run.model, cell(e.theta_rad), cell(e.phi_rad), cell(e.xy_m), cell(e.energy),
             cell(e.w_rad_s), time_ms, run.statistics.steps, run.integrator, outcome);
}

/// @returns false if the run did not cover the reference.
bool study_case(const fs::path& json, const ReferenceOptions& options) {
  data::ReferenceCase item = data::read_reference_case(json);
  item.scene.run.tolerance = options.tolerance;
  const auto [run, time_ms] = timed_run(item.scene);
  data::Table ours = as_reference_table(run);
  std::optional<Errors> errors;
  if (const fs::path csv = fs::path(json).replace_extension(".csv"); fs::exists(csv)) {
    const data::Table reference = data::read_table(csv);
    check_columns(reference, csv);
    ours = on_grid_of(reference, ours, item.scene.run.rate_hz);
    errors = compare(ours, reference);
  }
  if (!options.out.empty()) data::write_table(ours, options.out / (item.name + ".csv"));
  print_row(item, run, errors, time_ms);
  return !errors || errors->missing_rows == 0;
}

std::vector<fs::path> cases_in(const fs::path& folder) {
  std::vector<fs::path> cases;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".json") cases.push_back(entry.path());
  if (cases.empty())
    throw InputError(
        fmt::format("{}: no case here; a case is NAME.json beside NAME.csv", folder.string()));
  std::sort(cases.begin(), cases.end());
  return cases;
}

void run(const ReferenceOptions& options) {
  const std::vector<fs::path> cases = cases_in(options.folder);
  if (!options.out.empty()) make_folder(options.out);
  print_heading();
  std::vector<std::string> failures;
  for (const fs::path& json : cases) {
    try {
      if (!study_case(json, options)) failures.push_back(json.stem().string() + " ended early");
    } catch (const Error& error) {
      fmt::print("{:<26} {}\n", json.stem().string(), error.what());
      failures.push_back(json.stem().string() + " failed");
    }
  }
  if (!failures.empty())
    throw NotGood(fmt::format("{} of {} cases not covered: {}", failures.size(), cases.size(),
                              fmt::join(failures, ", ")));
}

}  // namespace

void add_study_reference(CLI::App& study) {
  auto options = std::make_shared<ReferenceOptions>();
  CLI::App* command = study.add_subcommand(
      "reference", "Simulate every case of a folder of reference trajectories and compare");
  command->add_option("folder", options->folder, "Folder with NAME.json beside NAME.csv")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("--out", options->out, "Write our trajectories here, one CSV per case");
  command->add_option("--tolerance", options->tolerance, "Relative tolerance of the integration")
      ->capture_default_str()
      ->check(positive_number());
  command->footer("Example: trochoid study reference cases/ --out runs/");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
