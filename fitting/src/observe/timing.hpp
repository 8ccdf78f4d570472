#pragma once
#include <vector>

#include "observe/observations.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

inline constexpr const char* kReadout = "readout_s";         ///< first to last row of an image
inline constexpr const char* kAngleDelay = "angle_delay_s";  ///< of the angles' clock

/// When samples were really taken, as parameters of a fit (role observation):
///   readout_s      rolling shutter: a sample at row y, whose time stamp was corrected with the
///                  scene's readout r0, was taken (readout - r0) y / (rows - 1) later;
///   angle_delay_s  angles belong to an instant that much later than the positions of their row of
///                  the track (two instruments, or a tracker that filters one of them).
struct Timing {
  double given_readout_s = 0.0;
  double rows = 0.0;  ///< of the image; 0: unknown
};

/// Whether a predictor has one of these parameters.
[[nodiscard]] bool has_timing(const model::Predictor& predictor);

/// The image's rows and the readout already allowed for.
/// @throws InputError if the readout is to be fitted and neither `rows` nor a camera file is given.
[[nodiscard]] Timing timing_of(const model::Predictor& predictor, const data::Scene& scene);

/// predictor.predict() for the samples of an arc at the times the parameters say, derivatives by
/// them included. Before the start of the arc the path is continued by reflection through its first
/// point, which is right to second order in the delay.
/// @param request  as for predict(); its t_s are the arc's own.
/// @throws NumericalError if the parameters put samples out of order.
[[nodiscard]] model::Prediction predict_timed(const model::Predictor& predictor,
                                              const Eigen::VectorXd& values,
                                              const model::PredictRequest& request,
                                              const ArcData& arc, const Timing& timing);

}  // namespace trochoid::fitting
