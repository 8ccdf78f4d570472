#pragma once
#include <span>

#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::tools {

/// A scene with the image's height from its camera file, where the readout is to be fitted: a fit
/// that stores it is replayed without that file.
/// @throws InputError if the file cannot be read.
[[nodiscard]] data::Scene with_rows(data::Scene scene);

/// What `trochoid fit` does between reading and writing: fits the scene's model, or with `compare`
/// (or the model "auto" in the options) the simplest that suffices; puts the program's version and
/// the scene as resolved into the answer, so that it can be replayed alone.
/// @throws InputError as fitting::fit and fitting::compare do.
[[nodiscard]] data::Fit fit_job(std::span<const data::Track> tracks, data::Scene scene,
                                const fitting::FitOptions& options, bool compare);

}  // namespace trochoid::tools
