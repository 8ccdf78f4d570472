#include "trochoid/data/outline.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include "trochoid/data/error.hpp"

namespace trochoid::data {
namespace {

using Edge = OutlinePoint::Edge;
constexpr double kPi = std::numbers::pi;

enum class Surface { none, upper_face, lower_face, wall, bore };

// First surface of the cylinder a ray meets, by brute force over its five surfaces.
Surface first_hit(const Body& body, const Pose<>& pose, const Ray& ray) {
  const Eigen::Vector3d k = symmetry_axis(pose.theta_rad, pose.phi_rad);
  // An orthographic ray starts on the image plane, which may cut the body: step back first.
  const Eigen::Vector3d d = ray.direction, o = ray.origin_m - d - pose.centre_m;
  const double h = body.half_thickness_m(), ok = o.dot(k), dk = d.dot(k);
  const Eigen::Vector3d o_across = o - ok * k, d_across = d - dk * k;
  double best = std::numeric_limits<double>::infinity();
  Surface hit = Surface::none;
  const auto offer = [&](double s, Surface surface) {
    if (s > 1e-9 && s < best) best = s, hit = surface;
  };
  for (const double side : {1.0, -1.0}) {
    const double s = (side * h - ok) / dk;
    const double r = (o_across + s * d_across).norm();
    if (r <= body.radius_m && r >= body.inner_radius_m)
      offer(s, side > 0 ? Surface::upper_face : Surface::lower_face);
  }
  for (const double radius : {body.radius_m, body.inner_radius_m}) {
    if (radius <= 0.0) continue;
    const double a = d_across.squaredNorm(), b = o_across.dot(d_across),
                 c = o_across.squaredNorm() - radius * radius, root = b * b - a * c;
    if (root < 0.0) continue;
    for (const double sign : {-1.0, 1.0}) {
      const double s = (-b + sign * std::sqrt(root)) / a;
      if (std::abs(ok + s * dk) <= h)
        offer(s, radius == body.radius_m ? Surface::wall : Surface::bore);
    }
  }
  return hit;
}

Camera oblique_camera() {
  Camera camera = Camera::overhead(400, 300, 1200.0, 0.5);
  camera.distortion = {-0.2, 0.06, 0.001, -0.0007, 0.0};
  const Eigen::Matrix3d tilt =
      Eigen::AngleAxisd(0.25, Eigen::Vector3d(0.8, 0.6, 0.0)).toRotationMatrix();
  camera.camera_from_table = tilt * camera.camera_from_table;
  return camera;
}

Body ring() {
  Body body;
  body.kind = BodyKind::ring;
  body.radius_m = 0.045;
  body.inner_radius_m = 0.036;
  body.thickness_m = 0.014;
  return body;
}

Body thick_disc() {
  Body body;
  body.radius_m = 0.04;
  body.thickness_m = 0.009;
  return body;
}

Pose<> pose_at(double theta, double phi, const Body& body) {
  Pose<> pose;
  pose.theta_rad = theta;
  pose.phi_rad = phi;
  pose.centre_m = {0.02, -0.013, height_on_floor_m(theta, body.radius_m, body.half_thickness_m())};
  return pose;
}

std::vector<Pose<>> many_poses(const Body& body, int count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> theta(0.01, kPi - 0.01), phi(-kPi, kPi);
  std::vector<Pose<>> poses;
  for (int i = 0; i < count; ++i) {
    const double tilt = theta(random), turn = phi(random);
    poses.push_back(pose_at(tilt, turn, body));
  }
  return poses;
}

bool has_body(Surface surface) {
  return surface != Surface::none;
}

// A step across the outline must change the surface that is seen: body to floor on a silhouette,
// one surface of the body to another elsewhere. Points closer than this to a corner may see a
// third.
constexpr double kStepAcrossPx = 0.02;
constexpr double kAllowedAtCorners = 0.02;

void expect_edges_separate_surfaces(const Body& body, const Camera& camera) {
  int wrong = 0, all = 0;
  for (const Pose<>& pose : many_poses(body, 60, 7)) {
    for (const OutlinePoint& p : visible_outline(body, pose, camera, 3.0)) {
      const auto seen = [&](double along_px) {
        return first_hit(body, pose, camera.ray_from_image(p.image_px + along_px * p.normal_px));
      };
      const Surface inside = seen(-kStepAcrossPx), outside = seen(kStepAcrossPx);
      const bool right = p.silhouette ? has_body(inside) && !has_body(outside)
                                      : has_body(inside) && has_body(outside) && inside != outside;
      wrong += !right;
      ++all;
    }
  }
  EXPECT_GT(all, 2000);
  EXPECT_LE(wrong, kAllowedAtCorners * all);
}

TEST(Outline, SeparatesBodyFromFloorForADiscUnderAnObliqueDistortedCamera) {
  expect_edges_separate_surfaces(thick_disc(), oblique_camera());
}
TEST(Outline, SeparatesBodyFromFloorForARingUnderAnObliqueDistortedCamera) {
  expect_edges_separate_surfaces(ring(), oblique_camera());
}
TEST(Outline, SeparatesBodyFromFloorForARingUnderAnOrthographicCamera) {
  expect_edges_separate_surfaces(ring(), Camera::from_scale(400, 300, 1200.0));
}

// Completeness: wherever neighbouring pixels see body and floor, an outline point is near.
void expect_silhouette_is_complete(const Body& body, const Camera& camera) {
  constexpr double kStepPx = 1.0;
  constexpr double kNearPx =
      2.0;  // half a pixel of the raster + half a step, at corners a full one
  for (const Pose<>& pose : many_poses(body, 4, 11)) {
    const auto outline = visible_outline(body, pose, camera, kStepPx);
    std::vector<Eigen::Vector2d> border;
    for (int y = 0; y < camera.height_px; ++y) {
      bool before = false;
      for (int x = 0; x < camera.width_px; ++x) {
        const bool body_here = has_body(first_hit(body, pose, camera.ray_from_image({x, y})));
        if (x > 0 && body_here != before) border.emplace_back(x - 0.5, y);
        before = body_here;
      }
    }
    ASSERT_GT(border.size(), 50u);
    for (const Eigen::Vector2d& b : border) {
      double nearest = 1e9;
      for (const OutlinePoint& p : outline)
        if (p.silhouette) nearest = std::min(nearest, (p.image_px - b).norm());
      EXPECT_LT(nearest, kNearPx) << "theta " << pose.theta_rad << " phi " << pose.phi_rad << " at "
                                  << b.transpose();
    }
  }
}

TEST(Outline, MissesNoPartOfTheSilhouetteOfADisc) {
  expect_silhouette_is_complete(thick_disc(), oblique_camera());
}
TEST(Outline, MissesNoPartOfTheSilhouetteOfARing) {
  expect_silhouette_is_complete(ring(), oblique_camera());
}

double length_px(const std::vector<OutlinePoint>& outline, Edge edge) {
  double sum = 0.0;
  for (const OutlinePoint& p : outline)
    if (p.edge == edge) sum += p.arc_px;
  return sum;
}

// The polygon through 48 chords is shorter than its circle by (pi/48)^2/6 = 7e-4.
constexpr double kChordShare = 1e-3;

TEST(Outline, OfAFlatDiscSeenFromAboveIsOneCircle) {
  const Camera camera = Camera::from_scale(400, 300, 1000.0);
  const auto outline = visible_outline(thick_disc(), pose_at(0.0, 0.3, thick_disc()), camera);
  EXPECT_NEAR(length_px(outline, Edge::upper_rim), 2.0 * kPi * 40.0,
              2.0 * kPi * 40.0 * kChordShare);
  EXPECT_EQ(length_px(outline, Edge::lower_rim), 0.0);
  EXPECT_EQ(length_px(outline, Edge::side_wall), 0.0);
  for (const auto& p : outline) EXPECT_TRUE(p.silhouette);
}

TEST(Outline, HasTheBorderOfTheNearFaceInsideOfIt) {
  Body body = thick_disc();
  body.border_radius_m = 0.8 * body.radius_m;
  const Camera camera = Camera::from_scale(400, 300, 1000.0);
  const Pose<> pose = pose_at(0.5, 0.3, body);
  const Eigen::Vector3d face =
      pose.centre_m + body.half_thickness_m() * symmetry_axis(pose.theta_rad, pose.phi_rad);
  for (const auto& p : visible_outline(body, pose, camera)) {
    if (p.edge != Edge::border) continue;
    EXPECT_FALSE(p.silhouette);
    EXPECT_NEAR((p.table_m - face).norm(), body.border_radius_m, 1e-12);
    EXPECT_GT(p.normal_px.dot(p.image_px - camera.image_from_table<double>(face)), 0.0);
  }
  // Ramanujan's perimeter of an ellipse, for axes of 32 and 32 cos 0.5.
  const double a = 32.0, b = 32.0 * std::cos(0.5);
  const double perimeter_px = kPi * (3.0 * (a + b) - std::sqrt((3.0 * a + b) * (a + 3.0 * b)));
  EXPECT_NEAR(length_px(visible_outline(body, pose, camera), Edge::border), perimeter_px,
              perimeter_px * kChordShare);
  EXPECT_EQ(length_px(visible_outline(body, pose_at(kPi / 2, 0.3, body), camera), Edge::border),
            0.0);
}

TEST(Outline, OfADiscOnEdgeSeenFromAboveIsARectangle) {
  const Camera camera = Camera::from_scale(400, 300, 1000.0);
  const auto outline = visible_outline(thick_disc(), pose_at(kPi / 2, 0.3, thick_disc()), camera);
  EXPECT_NEAR(length_px(outline, Edge::upper_rim), 80.0, 0.1);
  EXPECT_NEAR(length_px(outline, Edge::lower_rim), 80.0, 0.1);
  EXPECT_NEAR(length_px(outline, Edge::side_wall), 18.0, 1e-9);
}

TEST(Outline, OfATiltedDiscUnderAnOrthographicCameraIsPointSymmetric) {
  const Camera camera = Camera::from_scale(400, 300, 1000.0);
  const Pose<> pose = pose_at(1.0, 0.7, thick_disc());
  const Eigen::Vector2d centre = camera.image_from_table<double>(pose.centre_m);
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0.0;
  for (const auto& p : visible_outline(thick_disc(), pose, camera, 0.5)) {
    if (!p.silhouette) continue;
    sum += p.arc_px * p.image_px;
    weight += p.arc_px;
  }
  constexpr double kSamplingPx = 0.02;  // steps of 0.5 px do not fall symmetrically at arc ends
  EXPECT_LT((sum / weight - centre).norm(), kSamplingPx);
}

TEST(Outline, DoesNotDependOnWhichFaceTheAxisPointsOutOf) {
  const Camera camera = oblique_camera();
  Pose<> pose = pose_at(0.9, 0.4, ring());
  const auto one = visible_outline(ring(), pose, camera);
  pose.theta_rad = kPi - 0.9;
  pose.phi_rad = 0.4 + kPi;
  const auto other = visible_outline(ring(), pose, camera);
  ASSERT_EQ(one.size(), other.size());
  for (size_t i = 0; i < one.size(); ++i)
    EXPECT_LT((one[i].image_px - other[i].image_px).norm(), 1e-9);
}

TEST(Outline, OfABodyBehindTheCameraIsEmpty) {
  Pose<> pose = pose_at(0.4, 0.0, thick_disc());
  pose.centre_m.z() = 2.0;
  EXPECT_TRUE(visible_outline(thick_disc(), pose, oblique_camera()).empty());
  EXPECT_TRUE(wireframe(thick_disc(), pose, oblique_camera()).empty());
}

TEST(Outline, OfAShapelessTopIsRefusedByName) {
  Body top;
  top.kind = BodyKind::top;
  try {
    (void)visible_outline(top, {}, oblique_camera());
    FAIL() << "a top without a radius has no outline";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("radius_m"));
  }
}

TEST(Wireframe, HidesExactlyTheFarRimOfADiscSeenFromStraightAbove) {
  const auto curves = wireframe(thick_disc(), pose_at(0.0, 0.0, thick_disc()),
                                Camera::from_scale(400, 300, 1000.0));
  ASSERT_EQ(curves.size(), 2u);
  EXPECT_THAT(curves[0].hidden, testing::Each(false));
  EXPECT_THAT(curves[1].hidden, testing::Each(true));
}

}  // namespace
}  // namespace trochoid::data
