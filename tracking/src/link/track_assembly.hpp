#pragma once
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "find/body_finder.hpp"
#include "find/camera_motion.hpp"
#include "find/spin_profile.hpp"
#include "link/readings.hpp"
#include "trochoid/data/camera.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tracking {

/// All sightings of one body, by frame index.
struct BodyPath {
  struct At {
    double t_s = 0.0;
    Sighting seen;
  };
  using Frames = std::map<std::int64_t, At>;
  Frames frames;
  std::shared_ptr<const SpinProfile> marks;
  std::optional<Lamp> lamp{};  ///< as its shadows last showed it
  /// Plate::chroma_site_px as its edges show it, where they do.
  std::optional<Eigen::Vector2d> chroma_site_px{};
  ReadingTallies readings{};  ///< of all its frames
  /// The last ones, by frame index, as they were before those around them doubted them: the next
  /// frames may know better.
  std::map<std::int64_t, Sighting> undoubted{};
};

struct AssemblyOptions {
  bool fold = false;       ///< faces look alike: report min(theta, pi - theta)
  bool on_pin = false;     ///< held at its own middle: turns about the vertical where seen face on
  bool flat = false;       ///< always lies on its face: its node line stays where it is
  double mark_rad = 0.0;   ///< angle of the spin mark in the body, for the folded spin
  double readout_s = 0.0;  ///< rolling shutter: time from the first to the last row
  VideoInfo video{};       ///< whose rows these are
  const data::Camera* camera = nullptr;  ///< by which poses were measured
  /// Of a body that leans from it: the axis goes through it, and precession is where the centre is.
  std::optional<Eigen::Vector2d> pivot_m{};
  /// By frame index, where the camera moves: metres are those of a camera that does not.
  std::map<std::int64_t, PictureShift> shifts{};
};

/// Track samples of a path: metres and their covariance, unwrapped and folded angles, times of the
/// sample's own row.
/// @param floor of a track measured by rims alone, which are taken to lie on the floor that this
/// camera sees; without, it has no metres.
[[nodiscard]] data::Track assemble_track(const BodyPath& path, int object,
                                         const std::optional<data::Camera>& floor,
                                         const AssemblyOptions& options);

/// Median of the rim's semi-major axis over the path [px]: what the known radius is compared with.
[[nodiscard]] double usual_radius_px(const BodyPath& path);

/// Of the frame, or of the one nearest to it in which the floor told, known the worse the farther
/// that is: a hand may hide it for a while. None of a camera that stands still.
[[nodiscard]] PictureShift shift_in(const std::map<std::int64_t, PictureShift>& shifts,
                                    std::int64_t frame);

/// A track whose pixels are those of a camera that stands still, as its metres are.
[[nodiscard]] data::Track as_camera_at_rest_sees(
    data::Track track, const std::map<std::int64_t, PictureShift>& shifts);

}  // namespace trochoid::tracking
