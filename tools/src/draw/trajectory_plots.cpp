#include "draw/trajectory_plots.hpp"

#include <array>
#include <vector>

#include "common/outputs.hpp"
#include "draw/plot.hpp"

namespace trochoid::tools {
namespace {

struct PlotRecipe {
  const char* file;
  const char* y_label;
  std::vector<std::pair<const char*, const char*>> columns;  ///< column, label
};

const std::array<PlotRecipe, 7> kOverTime{{
    {"angles",
     "angle [rad]",
     {{"phi_wrapped_rad", "phi"}, {"theta_rad", "theta"}, {"psi_wrapped_rad", "psi"}}},
    {"rates",
     "rate [rad/s]",
     {{"dphi_rad_s", "dphi/dt"}, {"dtheta_rad_s", "dtheta/dt"}, {"dpsi_rad_s", "dpsi/dt"}}},
    {"angular_velocity",
     "body axes [rad/s]",
     {{"wx_rad_s", "wx"}, {"wy_rad_s", "wy"}, {"wz_rad_s", "wz"}}},
    {"angular_momentum",
     "body axes [kg m^2/s]",
     {{"Lx_kg_m2_s", "Lx"}, {"Ly_kg_m2_s", "Ly"}, {"Lz_kg_m2_s", "Lz"}}},
    {"integrals",
     "integral of the body rates [rad]",
     {{"integral_wx_rad", "of wx"}, {"integral_wy_rad", "of wy"}, {"integral_wz_rad", "of wz"}}},
    {"energy", "energy [J]", {{"energy_J", "total"}}},
    {"contact",
     "force [N]",
     {{"normal_force_N", "normal"}, {"force_x_N", "x"}, {"force_y_N", "y"}}},
}};

void write_one(const std::vector<Axes>& panels, const std::filesystem::path& path,
               std::vector<std::filesystem::path>& written) {
  write_plot(panels, path);
  written.push_back(path);
}

Series with_gaps_at_turns_of(const std::string& column, const Series& series) {
  return column.ends_with("_wrapped_rad") ? with_gaps_at_turns(series) : series;
}

bool is_constant(const Eigen::VectorXd& values) {
  return values.size() == 0 || values.isConstant(values[0], 1e-12);
}

void over_time(const data::Table& table, const PlotRecipe& recipe, const std::string& title,
               const std::filesystem::path& folder, std::vector<std::filesystem::path>& written) {
  Axes axes{.title = title, .x_label = "t [s]", .y_label = recipe.y_label, .series = {}};
  for (const auto& [column, label] : recipe.columns)
    if (table.has(column))
      axes.series.push_back(with_gaps_at_turns_of(
          column, {.label = label, .x = table.column("t_s"), .y = table.column(column)}));
  if (!axes.series.empty())
    write_one({axes}, folder / (std::string(recipe.file) + ".svg"), written);
}

void projection(const data::Table& table, const char* x, const char* y, const char* labels,
                const std::string& title, const std::filesystem::path& path,
                std::vector<std::filesystem::path>& written) {
  if (!table.has(x) || !table.has(y)) return;
  const Eigen::VectorXd across = table.column(x), up = table.column(y);
  if (is_constant(across) && is_constant(up)) return;  // of a free body, or on a pin
  if (labels[1] == 'z' && is_constant(up)) return;     // what lies flat has no height to show
  Axes axes{.title = title,
            .x_label = std::string(1, labels[0]) + " [m]",
            .y_label = std::string(1, labels[1]) + " [m]",
            .equal = true,
            .series = {{.label = "centre of mass", .x = across, .y = up}}};
  write_one({axes}, path, written);
}

}  // namespace

std::vector<std::filesystem::path> write_trajectory_plots(const data::Table& trajectory,
                                                          const std::string& title,
                                                          const std::filesystem::path& folder) {
  make_folder(folder);
  std::vector<std::filesystem::path> written;
  for (const PlotRecipe& recipe : kOverTime) over_time(trajectory, recipe, title, folder, written);
  projection(trajectory, "x_m", "y_m", "xy", title + ", from above", folder / "path_xy.svg",
             written);
  projection(trajectory, "x_m", "z_m", "xz", title + ", from the side", folder / "path_xz.svg",
             written);
  return written;
}

}  // namespace trochoid::tools
