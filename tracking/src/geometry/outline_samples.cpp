#include "geometry/outline_samples.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>

namespace trochoid::tracking {
namespace {

using Edge = data::OutlinePoint::Edge;

struct Shape {
  double radius, bore, border, thickness;
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
  // From the rim or the bore to where the look of the face next changes.
  const double to_border = shape.border > 0.0 ? shape.radius - shape.border : band;
  switch (reach.point.edge) {
    case Edge::upper_rim:
      reach.edge_at(-(shape.bore + shape.border > 0.0 ? to_border : 2.0 * shape.radius) * radial);
      if (!reach.point.silhouette) reach.edge_at(down);
      break;
    case Edge::lower_rim:
      reach.edge_at(-down);
      break;
    case Edge::side_wall:
      reach.edge_at(-2.0 * shape.radius * radial);
      break;
    case Edge::upper_bore:
      reach.edge_at((shape.border > 0.0 ? shape.border - shape.bore : band) * radial);
      reach.edge_at(-2.0 * shape.bore * radial);
      reach.edge_at(-2.0 * shape.bore * radial + down);
      if (!reach.point.silhouette) reach.edge_at(down);
      break;
    case Edge::lower_bore:
      reach.edge_at(-down);
      reach.edge_at(-2.0 * shape.bore * radial - down);
      break;
    case Edge::border:
      reach.edge_at((shape.radius - shape.border) * radial);
      reach.edge_at(-(shape.bore > 0.0 ? shape.border - shape.bore : 2.0 * shape.border) * radial);
      break;
  }
}

// The smooth curve between two neighbouring samples of one edge [Hermite].
class Piece {
 public:
  Piece(const OutlineSample& from, const OutlineSample& to) : from_(from), to_(to) {
    const Eigen::Vector2d chord = to.image_px - from.image_px;
    length_ = chord.norm();
    start_ = tangent(from.normal_px, chord);
    end_ = tangent(to.normal_px, chord);
    curvature_ = (to.normal_px - from.normal_px).dot(chord) / (length_ * length_);
  }
  [[nodiscard]] bool continuous() const {
    constexpr double kGap = 1.8;
    return from_.edge == to_.edge && from_.silhouette == to_.silhouette && length_ > 0.0 &&
           length_ < kGap * std::max(from_.arc_px, to_.arc_px);
  }
  /// How far along it coordinate `axis` is `value`, which its ends enclose.
  [[nodiscard]] double where(int axis, double value) const {
    const double a = from_.image_px[axis], b = to_.image_px[axis];
    double u = (value - a) / (b - a);
    for (int i = 0; i < 2; ++i) u += (value - at(u)[axis]) / (b - a);
    return u;
  }
  [[nodiscard]] OutlineSample sample(double u) const {
    OutlineSample s = from_;
    const auto between = [u](const auto& a, const auto& b) { return a + u * (b - a); };
    s.image_px = at(u);
    s.normal_px = (from_.normal_px + u * (to_.normal_px - from_.normal_px)).normalized();
    s.height_px = between(from_.height_px, to_.height_px);
    s.inside_px = between(from_.inside_px, to_.inside_px);
    s.outside_px = between(from_.outside_px, to_.outside_px);
    s.motion += u * (to_.motion - from_.motion);
    if (s.near_motion.size() > 0) s.near_motion += u * (to_.near_motion - from_.near_motion);
    return s;
  }
  [[nodiscard]] double curvature_per_px() const { return curvature_; }

 private:
  static Eigen::Vector2d tangent(const Eigen::Vector2d& normal, const Eigen::Vector2d& chord) {
    const Eigen::Vector2d t(-normal.y(), normal.x());
    return t.dot(chord) < 0.0 ? Eigen::Vector2d(-t) : t;
  }
  [[nodiscard]] Eigen::Vector2d at(double u) const {
    const double v = 1.0 - u;
    return v * v * (1.0 + 2.0 * u) * from_.image_px + u * u * (3.0 - 2.0 * u) * to_.image_px +
           length_ * u * v * (v * start_ - u * end_);
  }
  const OutlineSample &from_, &to_;
  Eigen::Vector2d start_, end_;
  double length_ = 0.0, curvature_ = 0.0;
};

// Of two neighbours, one that stands for both.
OutlineSample middle_of(const OutlineSample& a, const OutlineSample& b) {
  OutlineSample both = a;
  both.image_px = 0.5 * (a.image_px + b.image_px);
  both.normal_px = (a.normal_px + b.normal_px).normalized();
  both.arc_px = a.arc_px + b.arc_px;
  both.inside_px = std::min(a.inside_px, b.inside_px);
  both.outside_px = std::min(a.outside_px, b.outside_px);
  both.motion = 0.5 * (a.motion + b.motion);
  if (both.near_motion.size() > 0) both.near_motion = 0.5 * (a.near_motion + b.near_motion);
  return both;
}

}  // namespace

bool is_bore(Edge edge) {
  return edge == Edge::upper_bore || edge == Edge::lower_bore;
}

std::vector<OutlineSample> cross_pixels(const std::vector<OutlineSample>& outline, int every,
                                        std::vector<Crossings>& crossings) {
  std::vector<OutlineSample> samples;
  std::vector<Crossing> met;
  crossings.clear();
  constexpr double kNeighbourPx = 1.5;
  // Neighbours that are looked at together, then none until the next.
  const int period = Crossings::kMost * every;
  const auto chosen = [&](int k) { return ((k % period) + period) % period < Crossings::kMost; };
  // Joins the last look where it is its neighbour and there is room.
  const auto add = [&](const Crossing& crossing, const OutlineSample& sample) {
    if (!samples.empty() && samples.back().edge == sample.edge &&
        samples.back().silhouette == sample.silhouette) {
      Crossings& last = crossings.back();
      const Crossing& near = last.at[static_cast<size_t>(last.count) - 1];
      if (last.count < Crossings::kMost && near.row == crossing.row &&
          (near.image_px - crossing.image_px).cwiseAbs().maxCoeff() < kNeighbourPx) {
        last.at[static_cast<size_t>(last.count++)] = crossing;
        samples.back() = middle_of(samples.back(), sample);
        return;
      }
    }
    samples.push_back(sample);
    crossings.push_back({1, {crossing}});
  };
  for (size_t i = 0; i + 1 < outline.size(); ++i) {
    const Piece piece(outline[i], outline[i + 1]);
    if (!piece.continuous()) continue;
    met.clear();
    for (const int axis : {0, 1}) {
      // Each end belongs to the piece that begins there.
      const double a = outline[i].image_px[axis], b = outline[i + 1].image_px[axis];
      const double low = std::min(a, b), high = std::max(a, b);
      for (int k = static_cast<int>(std::ceil(low)); k <= high; ++k)
        if (k != b && chosen(k)) met.push_back({i, piece.where(axis, k), axis == 1});
    }
    std::sort(met.begin(), met.end(),
              [](const Crossing& a, const Crossing& b) { return a.part < b.part; });
    for (Crossing& crossing : met) {
      OutlineSample sample = piece.sample(crossing.part);
      const double across = std::abs(sample.normal_px[crossing.row ? 0 : 1]);
      if (across < std::abs(sample.normal_px[crossing.row ? 1 : 0])) continue;
      sample.arc_px = every / across;
      crossing.image_px = sample.image_px;
      crossing.normal_px = sample.normal_px;
      crossing.curvature_per_px = piece.curvature_per_px();
      add(crossing, sample);
    }
  }
  return samples;
}

Eigen::Vector3d direction_to(const data::Camera& camera, const Eigen::Vector3d& at_m) {
  if (camera.projection == data::Camera::Projection::orthographic)
    return -camera.camera_from_table.row(2).transpose();
  return (camera.position_m() - at_m).normalized();
}

Eigen::Vector3d axis_towards(const data::Camera& camera, const data::Pose<>& pose) {
  const Eigen::Vector3d k = data::symmetry_axis(pose.theta_rad, pose.phi_rad);
  return k.dot(direction_to(camera, pose.centre_m)) < 0.0 ? Eigen::Vector3d(-k) : k;
}

void read_in_turn(const MotionInReadout& motion, const Eigen::Vector2d& centre_px,
                  std::vector<OutlineSample>& outline) {
  if (motion.per_frame.size() == 0) return;
  for (OutlineSample& sample : outline) {
    const double speed_px = sample.motion.dot(motion.per_frame),
                 gain_px = sample.motion.dot(motion.per_frame2);
    // It is read where it has gone to, not where it was.
    constexpr double kSlowest = 0.5;  // who keeps up with the rows is not seen for what it is
    const double late =
        motion.frames_per_px.dot(sample.image_px - centre_px) /
        std::max(kSlowest, 1.0 - speed_px * motion.frames_per_px.dot(sample.normal_px));
    sample.image_px += (speed_px + 0.5 * late * gain_px) * late * sample.normal_px;
  }
}

std::vector<OutlineSample> outline_samples(const data::Body& body, const data::Pose<>& pose,
                                           const data::Camera& camera,
                                           const data::PoseMotion& motion, double step_px) {
  const auto outline = data::visible_outline(body, pose, camera, step_px);
  const data::PoseMotion::Velocities v = motion.velocities(pose);
  const Shape shape{body.radius_m,    body.inner_radius_m, body.border_radius_m,
                    body.thickness_m, pose.centre_m,       axis_towards(camera, pose)};
  std::vector<OutlineSample> samples;
  samples.reserve(outline.size());
  for (const auto& point : outline) {
    const Eigen::Matrix<double, 2, 3>& J = point.px_per_m;
    Reach reach{point, J};
    limit_reach(shape, reach);
    const double px_per_m = J.leftCols<2>().norm() / std::numbers::sqrt2;
    OutlineSample sample{point.edge,
                         point.silhouette,
                         point.image_px,
                         point.normal_px,
                         point.arc_px,
                         px_per_m * point.table_m.z(),
                         reach.inside,
                         reach.outside,
                         {},
                         {}};
    const Eigen::RowVector3d normal = point.normal_px.transpose() * J;
    const auto motion_at = [&](const Eigen::Vector3d& arm) {
      OutlineSample::Motion out(motion.count());
      for (int i = 0; i < motion.count(); ++i)
        out[i] = normal.dot(v.col(i).head<3>() + v.col(i).tail<3>().cross(arm));
      return out;
    };
    const Eigen::Vector3d arm = point.table_m - pose.centre_m;
    sample.motion = motion_at(arm);
    if (point.edge == Edge::lower_rim)
      sample.near_motion = motion_at(arm + shape.thickness * shape.axis);
    samples.push_back(sample);
  }
  return samples;
}

}  // namespace trochoid::tracking
