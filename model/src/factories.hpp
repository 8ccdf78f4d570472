#pragma once
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "trochoid/model/predictor.hpp"
#include "trochoid/model/simulate.hpp"

/// One function per rung; predictor.cpp and simulate.cpp choose by the scene's model name.
namespace trochoid::model {

/// A range of a parameter that has no end.
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::unique_ptr<Predictor> make_top(const data::Scene& scene);
std::unique_ptr<Predictor> make_top_euler(const data::Scene& scene);
std::unique_ptr<Predictor> make_rolling(const data::Scene& scene);
std::unique_ptr<Predictor> make_smooth(const data::Scene& scene);
std::unique_ptr<Predictor> make_sliding(const data::Scene& scene);
std::unique_ptr<Predictor> make_puck(const data::Scene& scene);
std::unique_ptr<Predictor> make_pivot(const data::Scene& scene);

Trajectory simulate_free(const data::Scene& scene);
Trajectory simulate_top(const data::Scene& scene);
Trajectory simulate_top_euler(const data::Scene& scene);
/// @param law  rolling, smooth or sliding.
Trajectory simulate_rim(const data::Scene& scene, const std::string& law);
Trajectory simulate_puck(const data::Scene& scene);
Trajectory simulate_pivot(const data::Scene& scene);

/// The rung a scene means: its model.name, or for "auto" what its support and terms say.
[[nodiscard]] std::string law_of(const data::Scene& scene);

/// Checks what every predictor promises: as many finite values as parameters, each in its range,
/// times ascending from start_s. @throws InputError.
void check_request(const Predictor& predictor, const Eigen::Ref<const Eigen::VectorXd>& values,
                   const PredictRequest& request);

/// The times asked for, counted from the start [s].
[[nodiscard]] std::vector<double> since_start_s(const PredictRequest& request);

/// An answer of the size asked for in which nothing is known yet: NaN throughout.
[[nodiscard]] Prediction unknown_prediction(const PredictRequest& request);

/// The output times of a scene's [run]: 0, 1/rate, ... up to until_s. @throws InputError.
[[nodiscard]] std::vector<double> output_times_s(const data::RunSettings& run);

/// At most one of a rate's names may be given, as StartSettings has it. @throws InputError.
void check_rates(const data::StartSettings& start);

/// The floor's rise per length along x and y, where the scene gives it or speaks of it in [fit].
/// @throws InputError if it is steeper than Support::kSteepest.
[[nodiscard]] std::optional<Eigen::Vector2d> floor_slope(const data::Scene& scene);

/// `slope_x` and `slope_y`. Stated alone they are known: the model's choice is not to fit them.
[[nodiscard]] std::vector<ParameterInfo> slope_parameters(const Eigen::Vector2d& slope);

/// The columns every run with Euler angles begins with: t_s, phi_rad, ... energy_J.
[[nodiscard]] const std::vector<std::string>& euler_columns();

/// Tolerance of the second run an error estimate compares with: a hundredth, but not below what
/// rounding leaves.
[[nodiscard]] double finer(double tolerance);

/// Fills error_estimate_rad from the differences between a run and its finer repetition, one per
/// row. Beyond the first row where they exceed 0.05 rad the motion is not known (rounding has
/// decided it): the run is cut there and ends as diverged.
void end_where_unknown(const Eigen::VectorXd& apart_rad, Trajectory& trajectory);

}  // namespace trochoid::model
