#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "trochoid/data/camera.hpp"
#include "trochoid/data/pose.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::tools {

/// Poses of a run at any time, between samples by cubics through four of them.
class RenderedMotion {
 public:
  static constexpr int kPerFrame = 16;  ///< samples of the run per frame of the recording

  /// @param rate_hz  of the run's samples
  /// @throws InputError for a model whose body does not move in space
  RenderedMotion(const model::Trajectory& run, double rate_hz);

  [[nodiscard]] const std::string& model() const { return model_; }
  [[nodiscard]] model::Outcome outcome() const { return outcome_; }
  [[nodiscard]] double end_s() const;
  [[nodiscard]] data::Pose<> at(double t_s) const;

 private:
  std::string model_;
  double rate_hz_;
  model::Outcome outcome_;
  std::vector<Eigen::VectorXd> columns_;
};

/// A camera straight above that shows the whole path with room for a body of that radius.
[[nodiscard]] data::Camera camera_over(const RenderedMotion& motion, double radius_m, int width_px,
                                       int height_px);

}  // namespace trochoid::tools
