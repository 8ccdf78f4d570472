#include "common/fit_job.hpp"

#include "trochoid/data/io.hpp"
#include "trochoid/fitting/compare.hpp"

namespace trochoid::tools {

data::Fit fit_job(std::span<const data::Track> tracks, data::Scene scene,
                  const fitting::FitOptions& options, bool compare) {
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
  fit.scene_toml = data::to_toml(scene);
  return fit;
}

}  // namespace trochoid::tools
