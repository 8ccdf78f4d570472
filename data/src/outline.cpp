#include "trochoid/data/outline.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::data {
namespace {

using Edge = OutlinePoint::Edge;

// Everything about visibility on an axisymmetric body depends on the position around the axis only
// through  c(a) = n(a) . q,  where n(a) is the radial direction at angle a and q is the part of
// (eye - centre), or of the direction towards an orthographic camera, across the axis. Each border
// between visible and hidden is one value of c, so arcs end exactly where they should.
struct View {
  Eigen::Vector3d centre, axis;  // axis points out of the face towards the camera ("near" face)
  Eigen::Vector3d across;        // unit direction of q; any direction across the axis if q = 0
  Eigen::Vector3d beside;        // axis x across
  double q = 0.0;                // length of q [m], or sine of the angle when orthographic
  double wall_limit = 0.0;       // the outer wall is seen where c > wall_limit
  double bore_limit = 0.0;       // the wall of the bore faces the camera where c < bore_limit
  double far_bore_limit = 0.0;   // the far bore rim is seen through the bore where c < this
  double through_limit = 0.0;    // past the near bore rim the floor is seen where c > this
  bool face_seen = false;        // false: the camera is between the planes of both faces

  [[nodiscard]] Eigen::Vector3d radial(double angle) const {
    return std::cos(angle) * across + std::sin(angle) * beside;
  }
};

View view_of(const Body& body, const Pose<>& pose, const Camera& camera) {
  const double R = body.radius_m, Ri = body.inner_radius_m, h = body.half_thickness_m();
  const bool perspective = camera.projection == Camera::Projection::perspective;
  View view;
  view.centre = pose.centre_m;
  view.axis = symmetry_axis(pose.theta_rad, pose.phi_rad);
  const Eigen::Vector3d towards =
      perspective ? Eigen::Vector3d(camera.position_m() - pose.centre_m)
                  : Eigen::Vector3d(-camera.camera_from_table.row(2).transpose());
  if (towards.dot(view.axis) < 0.0) view.axis = -view.axis;
  const double along = towards.dot(view.axis);
  const Eigen::Vector3d q = towards - along * view.axis;
  view.q = q.norm();
  view.across = view.q > 1e-12 ? Eigen::Vector3d(q / view.q) : view.axis.unitOrthogonal();
  view.beside = view.axis.cross(view.across);
  view.face_seen = perspective ? along > h : along > 1e-9;  // exactly on edge: no face
  view.wall_limit = perspective ? R : 0.0;
  view.bore_limit = perspective ? Ri : 0.0;
  if (!view.face_seen || Ri <= 0.0) return view;
  // A ray through a bore rim point meets the plane of the other face inside the bore's circle.
  if (perspective) {
    const double down = 2.0 * h / (along + h), up = 1.0 + 2.0 * h / (along - h);
    const double square = view.q * view.q;
    if (down > 0.0) {
      const double rest = 1.0 - down;
      view.far_bore_limit =
          (Ri * Ri * (1.0 - rest * rest) - down * down * square) / (2.0 * down * rest * Ri);
      view.through_limit = ((up * up - 1.0) * Ri * Ri + (up - 1.0) * (up - 1.0) * square) /
                           (2.0 * up * (up - 1.0) * Ri);
    } else {
      view.far_bore_limit = view.through_limit = Ri;
    }
  } else {
    // |Ri n +- d| < Ri with the shift d = 2 h q / along between the two faces.
    const double half_shift = h * view.q / along;
    view.far_bore_limit = -view.q * half_shift / Ri;
    view.through_limit = view.q * half_shift / Ri;
  }
  return view;
}

struct Circle {
  Edge edge;
  double radius, height;  // height along view.axis above the centre
};

struct Arc {
  bool visible, silhouette;
};

// What is seen of a circle of the body where n . q = c.
Arc classify(const View& view, Edge edge, double c) {
  const bool wall = c > view.wall_limit;
  switch (edge) {
    case Edge::upper_rim:
      return {view.face_seen || wall, view.face_seen != wall};
    case Edge::lower_rim:
      return {wall, true};  // the far face is never seen
    case Edge::upper_bore:
      return {view.face_seen, c > view.through_limit};
    case Edge::lower_bore:
      return {view.face_seen && c < view.far_bore_limit, true};
    case Edge::border:
      return {view.face_seen, false};
    case Edge::side_wall:
      break;
  }
  return {true, true};
}

// Direction in space that leads from the body to what is behind the edge.
Eigen::Vector3d outwards(const View& view, Edge edge, const Eigen::Vector3d& radial) {
  switch (edge) {
    case Edge::upper_rim:
      return view.face_seen ? radial : view.axis;
    case Edge::lower_rim:
    case Edge::lower_bore:
      return -view.axis;
    case Edge::upper_bore:
      return -radial;
    case Edge::border:
    case Edge::side_wall:
      break;
  }
  return radial;
}

OutlinePoint outline_point(const Camera& camera, Edge edge, const Eigen::Vector3d& at,
                           const Eigen::Vector3d& tangent, const Eigen::Vector3d& outwards) {
  const Eigen::Matrix<double, 2, 3> J = camera.jacobian_px_per_m(at);
  const Eigen::Vector2d t = J * tangent;
  Eigen::Vector2d normal = Eigen::Vector2d(t.y(), -t.x()).normalized();
  if (normal.dot(J * outwards) < 0.0) normal = -normal;
  return {edge, at, camera.image_from_table(at), normal, 0.0, true, J};
}

// Samples [from, to] of a circle evenly along its image.
void sample_arc(const View& view, const Camera& camera, const Circle& circle, double from,
                double to, bool silhouette, double step_px, std::vector<OutlinePoint>& out) {
  constexpr double kChord = kTurn / 48.0;  // the speed along an ellipse varies little over 7.5 deg
  constexpr int kMost = 64;
  const int chords = std::clamp(static_cast<int>(std::ceil((to - from) / kChord)), 1, kMost - 1);
  const Eigen::Vector3d middle = view.centre + circle.height * view.axis;
  std::array<double, kMost> length{};
  Eigen::Vector3d n = view.radial(from);
  Eigen::Vector2d before = camera.image_from_table<double>(middle + circle.radius * n);
  const double turn = (to - from) / chords, cosine = std::cos(turn), sine = std::sin(turn);
  for (int i = 1; i <= chords; ++i) {
    n = cosine * n + sine * view.axis.cross(n);
    const Eigen::Vector2d here = camera.image_from_table<double>(middle + circle.radius * n);
    length[i] = length[i - 1] + (here - before).norm();
    before = here;
  }
  const double total = length[chords];
  const int points = static_cast<int>(std::lround(total / step_px));
  int chord = 1;
  for (int i = 0; i < points; ++i) {
    const double target = total * (i + 0.5) / points;
    while (chord < chords && length[chord] < target) ++chord;
    const double part = (target - length[chord - 1]) / (length[chord] - length[chord - 1]);
    const double angle = from + (to - from) * (chord - 1 + part) / chords;
    n = view.radial(angle);
    out.push_back(outline_point(camera, circle.edge, middle + circle.radius * n, view.axis.cross(n),
                                outwards(view, circle.edge, n)));
    out.back().arc_px = total / points;
    out.back().silhouette = silhouette;
  }
}

// Half the angle about `across` where c > limit: 0 = nowhere, pi = everywhere.
double half_angle(const View& view, double limit) {
  if (view.q <= std::abs(limit)) return limit < 0.0 ? kPi : 0.0;
  return std::acos(limit / view.q);
}

void add_circle(const View& view, const Camera& camera, const Circle& circle, double step_px,
                std::vector<OutlinePoint>& out) {
  const double limit = circle.edge == Edge::upper_bore   ? view.through_limit
                       : circle.edge == Edge::lower_bore ? view.far_bore_limit
                                                         : view.wall_limit;
  const double half = half_angle(view, limit);
  const auto add = [&](double from, double to) {
    if (to - from < 1e-9) return;
    const Arc arc = classify(view, circle.edge, view.q * std::cos(0.5 * (from + to)));
    if (arc.visible) sample_arc(view, camera, circle, from, to, arc.silhouette, step_px, out);
  };
  add(-half, half);
  add(half, kTurn - half);
}

void add_walls(const View& view, const Body& body, const Camera& camera, double step_px,
               std::vector<OutlinePoint>& out) {
  const double half = half_angle(view, view.wall_limit);
  if (half <= 0.0 || half >= kPi) return;
  const double h = body.half_thickness_m();
  for (const double angle : {-half, half}) {
    const Eigen::Vector3d n = view.radial(angle);
    const Eigen::Vector3d middle = view.centre + body.radius_m * n;
    const double total = (camera.image_from_table<double>(middle + h * view.axis) -
                          camera.image_from_table<double>(middle - h * view.axis))
                             .norm();
    const int points = static_cast<int>(std::lround(total / step_px));
    for (int i = 0; i < points; ++i) {
      const double height = h * (2.0 * (i + 0.5) / points - 1.0);
      out.push_back(
          outline_point(camera, Edge::side_wall, middle + height * view.axis, view.axis, n));
      out.back().arc_px = total / points;
    }
  }
}

std::vector<Circle> circles_of(const Body& body) {
  const double h = body.half_thickness_m();
  std::vector<Circle> circles{{Edge::upper_rim, body.radius_m, h},
                              {Edge::lower_rim, body.radius_m, -h}};
  if (body.inner_radius_m > 0.0) {
    circles.push_back({Edge::upper_bore, body.inner_radius_m, h});
    circles.push_back({Edge::lower_bore, body.inner_radius_m, -h});
  }
  if (body.border_radius_m > 0.0) circles.push_back({Edge::border, body.border_radius_m, h});
  return circles;
}

void require_shape(const Body& body) {
  if (!(body.radius_m > 0.0))
    throw InputError(fmt::format(
        "body: radius_m = {} has no outline; give the radius of the disc or ring in metres",
        body.radius_m));
}

bool in_front(const Body& body, const Pose<>& pose, const Camera& camera) {
  if (camera.projection == Camera::Projection::orthographic) return true;
  return camera.depth_m(pose.centre_m) > std::hypot(body.radius_m, body.half_thickness_m());
}

}  // namespace

std::vector<OutlinePoint> visible_outline(const Body& body, const Pose<>& pose,
                                          const Camera& camera, double step_px) {
  require_shape(body);
  std::vector<OutlinePoint> out;
  if (!in_front(body, pose, camera)) return out;
  const View view = view_of(body, pose, camera);
  for (const Circle& circle : circles_of(body)) add_circle(view, camera, circle, step_px, out);
  add_walls(view, body, camera, step_px, out);
  return out;
}

std::vector<WireCurve> wireframe(const Body& body, const Pose<>& pose, const Camera& camera,
                                 int points) {
  require_shape(body);
  std::vector<WireCurve> curves;
  if (!in_front(body, pose, camera)) return curves;
  const View view = view_of(body, pose, camera);
  for (const Circle& circle : circles_of(body)) {
    WireCurve curve{circle.edge, {}, {}};
    for (int i = 0; i <= points; ++i) {
      const double angle = kTurn * i / points;
      const Eigen::Vector3d at =
          view.centre + circle.height * view.axis + circle.radius * view.radial(angle);
      curve.image_px.push_back(camera.image_from_table(at));
      curve.hidden.push_back(!classify(view, circle.edge, view.q * std::cos(angle)).visible);
    }
    curves.push_back(std::move(curve));
  }
  const double half = half_angle(view, view.wall_limit);
  if (half <= 0.0 || half >= kPi) return curves;
  for (const double angle : {-half, half}) {
    const Eigen::Vector3d middle = view.centre + body.radius_m * view.radial(angle);
    const Eigen::Vector3d along = body.half_thickness_m() * view.axis;
    curves.push_back({Edge::side_wall,
                      {camera.image_from_table<double>(middle + along),
                       camera.image_from_table<double>(middle - along)},
                      {false, false}});
  }
  return curves;
}

}  // namespace trochoid::data
