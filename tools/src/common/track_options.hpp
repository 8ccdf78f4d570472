#pragma once
#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>

#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/tracking/tracker.hpp"

namespace trochoid::tools {

/// What a caller may say of how a recording is tracked, in place of its scene: the options of the
/// commands that track, and the arguments of Python's.
struct TrackChoices {
  std::optional<int> objects;
  std::optional<Eigen::Vector2d> at_px;
  std::string from, to;  ///< as in tracking::TrackOptions
  std::optional<double> rate_hz;
  tracking::Effort effort = tracking::Effort::normal;
};

/// The scene with what was chosen put in.
/// @throws InputError naming a choice that can be none.
[[nodiscard]] data::Scene chosen_scene(data::Scene scene, const TrackChoices& choices);
/// How to track a scene that chosen_scene() has made.
[[nodiscard]] tracking::TrackOptions track_options(const data::Scene& scene,
                                                   const TrackChoices& choices);

/// The files a command tracks from.
struct TrackInputs {
  std::filesystem::path video, scene, camera;
};

/// Declares VIDEO, --scene, --camera, --objects, --at, --from, --to, --rate and --effort.
/// @param effort_words what the efforts mean to this command.
void add_track_options(CLI::App& command, TrackInputs& inputs, TrackChoices& choices,
                       const std::string& effort_words);

[[nodiscard]] std::string effort_name(tracking::Effort effort);
[[nodiscard]] bool is_effort(const std::string& name);
/// @throws InputError unless the name is quick, normal or exact.
[[nodiscard]] tracking::Effort effort_named(const std::string& name);

/// What is found in a track to be sure of, once its files are written.
/// @throws NotGood if fewer bodies were found than wanted, or one only in frames that are doubtful.
void check_found(const data::TrackFile& found, int wanted);

}  // namespace trochoid::tools
