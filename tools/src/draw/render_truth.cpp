#include "draw/render_truth.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <vector>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {

bool in_picture(const data::Pose<>& pose, const data::Camera& camera) {
  const Eigen::Vector2d p = camera.image_from_table<double>(pose.centre_m);
  return p.x() > 0.0 && p.y() > 0.0 && p.x() < camera.width_px - 1.0 &&
         p.y() < camera.height_px - 1.0;
}

std::string truth_row(int frame, double t_s, const data::Pose<>& pose, const data::Camera& camera) {
  const Eigen::Quaterniond q(Eigen::AngleAxisd(pose.phi_rad, Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(pose.theta_rad, Eigen::Vector3d::UnitX()) *
                             Eigen::AngleAxisd(pose.psi_rad, Eigen::Vector3d::UnitZ()));
  const Eigen::Vector2d p = camera.image_from_table<double>(pose.centre_m);
  const double inside = in_picture(pose, camera) ? 1.0 : 0.0;
  return fmt::format(
      "{},{:.9f},{:.9f},{:.9f},{:.9f},{:.5f},{:.5f},{:.9f},{:.9f},{:.9f},{:.9f},{:.8f},{:.8f},"
      "{:.8f},{:.0f}\n",
      frame, t_s, pose.centre_m.x(), pose.centre_m.y(), pose.centre_m.z(), p.x(), p.y(), q.w(),
      q.x(), q.y(), q.z(), pose.theta_rad, pose.phi_rad, pose.psi_rad, inside);
}

nlohmann::ordered_json object_of(const data::Scene& scene, const std::string& model) {
  const data::Body& body = *scene.body;
  nlohmann::ordered_json json;
  const bool ring = body.inner_radius_m > 0.0;
  json["type"] = ring ? "ring" : "disc";
  json[ring ? "R_outer_m" : "R_m"] = body.radius_m;
  if (ring) json["R_inner_m"] = body.inner_radius_m;
  if (body.border_radius_m > 0.0) json["R_border_m"] = body.border_radius_m;
  json[ring ? "height_m" : "thickness_m"] = body.thickness_m;
  if (body.mass_kg) json["mass_kg"] = *body.mass_kg;
  if (body.l_m) json["com_to_pivot_m"] = *body.l_m;
  if (const auto& p = scene.support.pivot_m) json["pivot_m"] = {p->x(), p->y(), p->z()};
  if (body.axle_radius_m > 0.0) {
    json["axle_radius_m"] = body.axle_radius_m;
    json["axle_above_upper_face_m"] = body.axle_above_m;
  }
  json["convention"] =
      "body z = symmetry axis; quaternion w,x,y,z maps body to world; world z up, floor z=0; "
      "R = Rz(phi) Rx(theta) Rz(psi), theta = angle of axis from vertical";
  json["markers"] = nlohmann::ordered_json::array();
  for (const data::SpinMark& mark : body.marks) {
    std::vector<int> faces;
    if (mark.on_upper_face) faces.push_back(1);
    if (mark.on_lower_face) faces.push_back(-1);
    json["markers"].push_back({{"kind", "dot"},
                               {"r_m", mark.distance_m},
                               {"radius_m", mark.size_m},
                               {"angle_deg", data::degrees(mark.angle_rad)},
                               {"faces", faces}});
  }
  json["dynamics"] = {
      {"model", model}, {"g", scene.model.gravity_m_s2}, {"scene_toml", data::to_toml(scene)}};
  return json;
}

}  // namespace trochoid::tools
