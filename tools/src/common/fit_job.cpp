#include "common/fit_job.hpp"

#include <algorithm>
#include <utility>

#include "trochoid/data/io.hpp"
#include "trochoid/data/moment.hpp"
#include "trochoid/fitting/compare.hpp"

namespace trochoid::tools {
namespace {

/// Times below 0 are those of a track that counts from an event.
void check_window(std::span<const data::Track> tracks, const fitting::FitOptions& options) {
  for (const data::Track& track : tracks)
    for (const data::TrackSample& sample : track.samples)
      if (sample.t_s < 0.0) return;
  (void)data::parse_recording_window(options.from, options.to);
}

}  // namespace

data::Scene with_rows(data::Scene scene) {
  constexpr const char* kReadout = "readout_s";
  const auto& free = scene.fit.free;
  const bool fitted = std::find(free.begin(), free.end(), kReadout) != free.end() ||
                      scene.fit.prior.contains(kReadout);
  if (!fitted || scene.camera.file.empty()) return scene;
  const data::Camera camera = data::read_camera(scene.camera.file);
  if (!scene.camera.rows) scene.camera.rows = camera.height_px;
  if (!(scene.camera.readout_s > 0.0)) scene.camera.readout_s = camera.readout_s.value_or(0.0);
  return scene;
}

data::Fit fit_job(std::span<const data::Track> tracks, data::Scene scene,
                  const fitting::FitOptions& options, bool compare) {
  check_window(tracks, options);
  scene = with_rows(std::move(scene));
  data::Fit fit;
  const bool unnamed = options.model.empty() && scene.model.name == "auto";
  if (compare || unnamed || options.model == "auto") {
    fitting::Comparison comparison = fitting::compare(tracks, scene, options);
    fit = std::move(comparison.fit);
    scene = std::move(comparison.scene);
  } else {
    fit = fitting::fit(tracks, scene, options);
  }
  fit.versions["trochoid"] = TROCHOID_VERSION;
  if (!options.model.empty() && !compare) scene.model.name = fit.model;
  if (scene.model.name == "auto") scene.model.name = fit.model;
  scene.fit.free_pivot = scene.fit.free_pivot || options.free_pivot;
  fit.scene_toml = data::to_toml(scene);
  return fit;
}

}  // namespace trochoid::tools
