#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

namespace trochoid::data {

/// A place at which a path, smooth before and after, goes on by whole usual steps in time too far,
/// or too little: as where a recorder dropped pictures, or wrote one twice, and numbered and timed
/// the others as if it had not.
struct PathStep {
  int sample = 0;                    ///< the first after it
  double frames = 0.0, sigma = 0.0;  ///< by how many steps its time is too early
  double way = 0.0;                  ///< how far the path goes in that time [as positions]
};

/// All such places, from a quintic in time about each sample that ten others before it and nine
/// after it leave without a gap. A place stands out by six standard deviations among those beside.
/// @param t_s  ascending [s]. @param at  as many positions [any unit].
[[nodiscard]] std::vector<PathStep> path_steps(const std::vector<double>& t_s,
                                               const Eigen::MatrixX2d& at);

/// Those of them whose standard deviation is at most so many frames, if they are rare: many are of
/// times that jitter, or of a path with corners, and none is told.
/// @param least_way  how far a step leads at least [as positions]: pictures of a body at rest that
/// a codec holds and renews lie closer together than any can be measured, in steps of their own.
[[nodiscard]] std::vector<PathStep> clear_path_steps(const std::vector<double>& t_s,
                                                     const Eigen::MatrixX2d& at, double most_sigma,
                                                     double least_way);

/// "0.99 ± 0.01 at 0.8 s, ...": the steps of a path with these times.
[[nodiscard]] std::string words_of(const std::vector<PathStep>& steps,
                                   const std::vector<double>& t_s);

}  // namespace trochoid::data
