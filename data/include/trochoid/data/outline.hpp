#pragma once
#include <Eigen/Core>
#include <vector>

#include "trochoid/data/body.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"

namespace trochoid::data {

/// One point of the visible outline: where it is in space, in the image, and which way is out.
struct OutlinePoint {
  enum class Edge {
    upper_rim,   ///< outer rim of the face towards the camera (visible all round)
    lower_rim,   ///< outer rim of the far face, its visible part
    side_wall,   ///< silhouette line of the cylinder wall between the rims
    upper_bore,  ///< inner rim of the face towards the camera
    lower_bore,  ///< inner rim of the far face seen through the bore
    border,      ///< where a border begins on the face towards the camera
  };
  Edge edge;
  Eigen::Vector3d table_m;   ///< point in the table frame
  Eigen::Vector2d image_px;  ///< its projection
  Eigen::Vector2d
      normal_px;    ///< unit normal in the image, pointing from the body to the background
  double arc_px;    ///< length of outline this point stands for
  bool silhouette;  ///< on the border between body and background (not face against wall)
  Eigen::Matrix<double, 2, 3> px_per_m;  ///< d(image_px) / d(table_m)
};

/// Visible outline of a posed cylinder, sampled about every `step_px` pixels along the image curve:
/// the rim of the near face, the visible part of the far rim, the wall's silhouette lines, the
/// bore. Self-occlusion by the body is taken into account; other bodies are not.
/// @param body a disc or ring with radius_m > 0.  @throws InputError for a shapeless top.
[[nodiscard]] std::vector<OutlinePoint> visible_outline(const Body& body, const Pose<>& pose,
                                                        const Camera& camera, double step_px = 2.0);

/// A curve of the wireframe, for drawing: points in the image and whether they are hidden. Rims are
/// closed, the lines of the side wall are not.
struct WireCurve {
  OutlinePoint::Edge edge;
  std::vector<Eigen::Vector2d> image_px;
  std::vector<bool> hidden;
};
/// Rims, bore and wall silhouette for drawing; `points` per circle.
[[nodiscard]] std::vector<WireCurve> wireframe(const Body& body, const Pose<>& pose,
                                               const Camera& camera, int points = 96);

}  // namespace trochoid::data
