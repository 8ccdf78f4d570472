#include "common/thesis_quantities.hpp"

#include <Eigen/Core>
#include <cmath>
#include <optional>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/integral.hpp"
#include "trochoid/model/inertia.hpp"

namespace trochoid::tools {
namespace {

using Array = Eigen::ArrayXd;

void append(data::Table& table, const std::string& name, const Array& values) {
  if (table.has(name)) return;
  table.columns.push_back(name);
  table.values.conservativeResize(Eigen::NoChange, table.values.cols() + 1);
  table.values.col(table.values.cols() - 1) = values.matrix();
}

Array wrapped(const Array& angle) {
  return angle.unaryExpr([](double a) { return data::wrapped(a); });
}

/// About the pivot of a top, else about the centre of mass; nothing without a mass.
std::optional<Eigen::Vector3d> principal_moments(const data::Scene& scene) {
  if (scene.start.moments_kg_m2) return scene.start.moments_kg_m2;
  if (!scene.body) return std::nullopt;
  const data::Body& body = *scene.body;
  if (body.kind == data::BodyKind::top) {
    if (!body.I_kg_m2 || !body.Is_kg_m2) return std::nullopt;
    return Eigen::Vector3d(*body.I_kg_m2, *body.I_kg_m2, *body.Is_kg_m2);
  }
  if (!body.mass_kg) return std::nullopt;
  const model::CentralInertia central = model::central_inertia(body);
  const double arm_m =
      scene.support.kind == data::SupportKind::pivot ? body.l_m.value_or(0.0) : 0.0;
  const double across = central.transverse_kg_m2 + central.mass_kg * arm_m * arm_m;
  return Eigen::Vector3d(across, across, central.axial_kg_m2);
}

}  // namespace

void add_thesis_quantities(const data::Scene& scene, data::Table& table) {
  const auto column = [&](const char* name) -> Array { return table.column(name).array(); };
  const Array t = column("t_s"), theta = column("theta_rad"), psi = column("psi_rad");
  const Array dphi = column("dphi_rad_s"), dtheta = column("dtheta_rad_s");
  const Array dpsi = column("dpsi_rad_s");
  const std::array<Array, 3> w{dphi * theta.sin() * psi.sin() + dtheta * psi.cos(),
                               dphi * theta.sin() * psi.cos() - dtheta * psi.sin(),
                               dpsi + dphi * theta.cos()};
  const auto moments = principal_moments(scene);
  constexpr std::array<char, 3> kAxes{'x', 'y', 'z'};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string axis(1, kAxes[i]);
    append(table, "w" + axis + "_rad_s", w[i]);
    if (moments)
      append(table, "L" + axis + "_kg_m2_s", (*moments)[static_cast<Eigen::Index>(i)] * w[i]);
    append(table, "integral_w" + axis + "_rad",
           data::running_integral({t.data(), t.data() + t.size()}, w[i].matrix()).array());
  }
  for (const char* angle : {"phi", "theta", "psi"})
    append(table, std::string(angle) + "_wrapped_rad",
           wrapped(column((std::string(angle) + "_rad").c_str())));
  if (table.has("x_m") && table.has("y_m")) {
    append(table, "X_thesis_m", -column("y_m"));
    append(table, "Y_thesis_m", column("x_m"));
  }
}

}  // namespace trochoid::tools
