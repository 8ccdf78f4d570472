#include "outline_samples.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace trochoid::tracking {
namespace {

using Edge = data::OutlinePoint::Edge;

struct Shape {
  double radius, bore, thickness;
  Eigen::Vector3d centre, axis;  // axis towards the camera
};

// Distances along the normal to the body's next edges on either side, to first order in the image.
struct Reach {
  const data::OutlinePoint& point;
  const Eigen::Matrix<double, 2, 3>& jacobian;
  double inside = 1e3, outside = 1e3;

  void edge_at(const Eigen::Vector3d& from_point) {
    const double along = point.normal_px.dot(jacobian * from_point);
    if (along < -1e-9) inside = std::min(inside, -along);
    if (along > 1e-9) outside = std::min(outside, along);
  }
};

void limit_reach(const Shape& shape, Reach& reach) {
  const Eigen::Vector3d from_centre = reach.point.table_m - shape.centre;
  const Eigen::Vector3d radial =
      (from_centre - from_centre.dot(shape.axis) * shape.axis).normalized();
  const Eigen::Vector3d down = -shape.thickness * shape.axis;
  const double band = shape.radius - shape.bore;
  switch (reach.point.edge) {
    case Edge::upper_rim:
      reach.edge_at(-(shape.bore > 0.0 ? band : 2.0 * shape.radius) * radial);
      if (!reach.point.silhouette) reach.edge_at(down);
      break;
    case Edge::lower_rim:
      reach.edge_at(-down);
      break;
    case Edge::side_wall:
      reach.edge_at(-2.0 * shape.radius * radial);
      break;
    case Edge::upper_bore:
      reach.edge_at(band * radial);
      reach.edge_at(-2.0 * shape.bore * radial);
      reach.edge_at(-2.0 * shape.bore * radial + down);
      if (!reach.point.silhouette) reach.edge_at(down);
      break;
    case Edge::lower_bore:
      reach.edge_at(-down);
      reach.edge_at(-2.0 * shape.bore * radial - down);
      break;
  }
}

}  // namespace

Eigen::Vector3d direction_to(const data::Camera& camera, const Eigen::Vector3d& at_m) {
  if (camera.projection == data::Camera::Projection::orthographic)
    return -camera.camera_from_table.row(2).transpose();
  return (camera.position_m() - at_m).normalized();
}

Eigen::Vector3d axis_towards(const data::Camera& camera, const data::Pose<>& pose) {
  const Eigen::Vector3d k = data::symmetry_axis(pose.theta_rad, pose.phi_rad);
  return k.dot(direction_to(camera, pose.centre_m)) < 0.0 ? Eigen::Vector3d(-k) : k;
}

std::vector<OutlineSample> outline_samples(const data::Body& body, const data::Pose<>& pose,
                                           const data::Camera& camera, const PoseMotion& motion,
                                           double step_px) {
  const auto outline = data::visible_outline(body, pose, camera, step_px);
  const PoseMotion::Velocities v = motion.velocities(pose);
  const Shape shape{body.radius_m, body.inner_radius_m, body.thickness_m, pose.centre_m,
                    axis_towards(camera, pose)};
  std::vector<OutlineSample> samples;
  samples.reserve(outline.size());
  for (const auto& point : outline) {
    const Eigen::Matrix<double, 2, 3> J = camera.jacobian_px_per_m(point.table_m);
    Reach reach{point, J};
    limit_reach(shape, reach);
    OutlineSample sample{point.edge,   point.silhouette, point.image_px, point.normal_px,
                         point.arc_px, reach.inside,     reach.outside,  {}};
    const Eigen::RowVector3d normal = point.normal_px.transpose() * J;
    const Eigen::Vector3d arm = point.table_m - pose.centre_m;
    sample.motion.resize(motion.count());
    for (int i = 0; i < motion.count(); ++i)
      sample.motion[i] = normal.dot(v.col(i).head<3>() + v.col(i).tail<3>().cross(arm));
    samples.push_back(sample);
  }
  return samples;
}

}  // namespace trochoid::tracking
