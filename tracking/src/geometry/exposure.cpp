#include "geometry/exposure.hpp"

#include <algorithm>
#include <cmath>

namespace trochoid::tracking {
namespace {

using Pose = data::Pose<>;
using Edge = data::OutlinePoint::Edge;

// Edges that take each other's place as the body turns: the outer border, that of the bore, and
// those between two surfaces of the body each for itself.
int family_of(Edge edge, bool silhouette) {
  return silhouette ? (is_bore(edge) ? 1 : 0) : 2 + static_cast<int>(edge);
}

// An outline at one moment of the exposure.
struct Moved {
  static constexpr double kStepPx = 1.5;
  static constexpr double kApartPx = 2.0 * kStepPx;  // farther from each other than neighbours are
  const std::vector<OutlineSample>& points;
  std::vector<int> families;
  std::vector<size_t> ends;  // of the arc of one family each point is on

  explicit Moved(const std::vector<OutlineSample>& outline) : points(outline), ends(points.size()) {
    for (const OutlineSample& point : points)
      families.push_back(family_of(point.edge, point.silhouette));
    for (size_t i = points.size(); i-- > 0;) {
      const bool goes_on = i + 1 < points.size() && families[i + 1] == families[i] &&
                           (points[i + 1].image_px - points[i].image_px).norm() < kApartPx;
      ends[i] = goes_on ? ends[i + 1] : i + 1;
    }
  }
};

constexpr double kLeastCosine = 0.5;  // between the normals of an outline and of what it crosses

// The point of an outline nearest to the normal of a sample, from one nearby along its arc; nothing
// if that leads to an end of the arc or not so near as between two points.
const OutlineSample* nearest_from(size_t near, const Moved& outline, const OutlineSample& sample) {
  const Eigen::Vector2d along(-sample.normal_px.y(), sample.normal_px.x());
  const int family = family_of(sample.edge, sample.silhouette);
  if (near >= outline.points.size() || outline.families[near] != family) return nullptr;
  const auto aside = [&](size_t i) {
    return std::abs(along.dot(outline.points[i].image_px - sample.image_px));
  };
  size_t i = near;
  double least = aside(i);
  for (const bool ahead : {true, false})
    while (true) {
      if (!ahead && i == 0) return nullptr;
      const size_t next = ahead ? i + 1 : i - 1;
      if (outline.ends[std::min(i, next)] <= std::max(i, next)) return nullptr;
      const double there = aside(next);
      if (there >= least) break;
      i = next, least = there;
    }
  const OutlineSample& point = outline.points[i];
  const bool crosses = point.normal_px.dot(sample.normal_px) >= kLeastCosine;
  return crosses && least < Moved::kStepPx ? &point : nullptr;
}

// The same from anywhere.
const OutlineSample* nearest_of_all(const Moved& outline, const OutlineSample& sample) {
  constexpr double kFarthestPx = 3.0;
  const Eigen::Vector2d along(-sample.normal_px.y(), sample.normal_px.x());
  const int family = family_of(sample.edge, sample.silhouette);
  const OutlineSample* nearest = nullptr;
  double least = kFarthestPx;
  for (size_t i = 0; i < outline.points.size();) {
    if (outline.families[i] != family) {
      i = outline.ends[i];
      continue;
    }
    const OutlineSample& point = outline.points[i];
    const double aside = std::abs(along.dot(point.image_px - sample.image_px));
    if (aside >= least) {
      // Along its arc no sooner than that many points on can it be nearer.
      const auto far = static_cast<size_t>((aside - least) / Moved::kApartPx);
      i = std::min(outline.ends[i], i + 1 + far);
      continue;
    }
    ++i;
    if (point.normal_px.dot(sample.normal_px) < kLeastCosine) continue;
    least = aside;
    nearest = &point;
  }
  return nearest;
}

// Where an outline crosses the normal of a sample: from its point nearest to that line, along the
// tangent there. Nothing if it does not cross it on this side or does so at a grazing angle.
// @param near where the sample before crossed it; then where this one does.
std::optional<double> crossing_px(const Moved& outline, const OutlineSample& sample, size_t& near) {
  const OutlineSample* nearest = nearest_from(near, outline, sample);
  if (nearest == nullptr) nearest = nearest_of_all(outline, sample);
  if (nearest == nullptr) return std::nullopt;
  near = static_cast<size_t>(nearest - outline.points.data());
  return nearest->normal_px.dot(nearest->image_px - sample.image_px) /
         nearest->normal_px.dot(sample.normal_px);
}

}  // namespace

ExposureMotion::ExposureMotion(const Pose& before, const Pose& middle, double fraction)
    : change_(before, middle, PoseChange::kWithin), fraction_(fraction) {}

Pose ExposureMotion::at(const Pose& middle, double share) const {
  return change_.on(middle, share * fraction_, PoseChange::Centre::turning);
}

double Sweep::mean_px() const {
  double sum = 0.0;
  for (int k = 0; k < count; ++k) sum += shift_px[static_cast<size_t>(k)];
  return count > 0 ? sum / count : 0.0;
}

double Sweep::half_range_px() const {
  if (count == 0) return 0.0;
  const auto [least, most] = std::minmax_element(shift_px.begin(), shift_px.begin() + count);
  return 0.5 * (*most - *least + step_px());
}

double Sweep::step_px() const {
  double sum = 0.0;
  for (int k = 1; k < count; ++k)
    sum += std::abs(shift_px[static_cast<size_t>(k)] - shift_px[static_cast<size_t>(k) - 1]);
  return count > 1 ? sum / (count - 1) : 0.0;
}

Sweep between(const Sweep& from, const Sweep& to, double part) {
  Sweep sweep;
  sweep.count = std::min(from.count, to.count);
  for (size_t k = 0; k < static_cast<size_t>(sweep.count); ++k)
    sweep.shift_px[k] = from.shift_px[k] + part * (to.shift_px[k] - from.shift_px[k]);
  return sweep;
}

Moments moments_of(const data::Body& body, const data::Camera& camera,
                   const data::PoseMotion& motion, const ExposureMotion& exposure,
                   const Pose& middle, int parts, const MotionInReadout& in_readout) {
  Moments moments;
  for (int k = 0; k < parts; ++k) {
    const Pose pose = motion.settled(exposure.at(middle, (k + 0.5) / parts - 0.5));
    moments.push_back(outline_samples(body, pose, camera, motion, Moved::kStepPx));
    read_in_turn(in_readout, camera.image_from_table<double>(pose.centre_m), moments.back());
  }
  return moments;
}

std::vector<Sweep> sweeps_of(const Moments& moments, const std::vector<OutlineSample>& outline) {
  const size_t parts = std::min<size_t>(moments.size(), Sweep::kMost);
  std::vector<Sweep> sweeps(outline.size());
  std::vector<bool> lost(outline.size(), false);
  for (size_t k = 0; k < parts; ++k) {
    const Moved moved(moments[k]);
    size_t near = moved.points.size();
    for (size_t i = 0; i < outline.size(); ++i) {
      if (lost[i]) continue;
      const auto crossing = crossing_px(moved, outline[i], near);
      lost[i] = !crossing;
      if (crossing) sweeps[i].shift_px[k] = *crossing;
    }
  }
  for (size_t i = 0; i < outline.size(); ++i)
    sweeps[i].count = lost[i] ? 0 : static_cast<int>(parts);
  return sweeps;
}

}  // namespace trochoid::tracking
