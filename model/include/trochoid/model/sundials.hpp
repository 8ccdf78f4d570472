#pragma once
#include <Eigen/Core>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "trochoid/model/dormand_prince.hpp"
#include "trochoid/model/outcome.hpp"

/// SUNDIALS' CVODE and ARKODE behind one call: the independent check of our own steppers, the stiff
/// one and its derivatives included.
namespace trochoid::model {

/// Forward sensitivities s = dy/dp carried beside the states: s' = (df/dy) s + df/dp. They take
/// part in the error control, with the states' absolute tolerances per unit of the parameter.
struct Sensitivities {
  Eigen::MatrixXd start;  ///< dy/dp at the start, states x parameters
  /// Writes s' to ds, both states x parameters, column by column.
  std::function<void(double t_s, const double* y, const double* s, double* ds)> derivative;
};

/// y' = f(t, y) with what an implicit or event-seeking solver may want besides. Functions may write
/// NaN: the solver then shortens its step and, if that does not help, ends with
/// tolerance_not_reachable.
struct Ode {
  int states = 0;
  std::function<void(double t_s, const double* y, double* dy)> derivative;
  /// d(dy_i)/d(y_j) at jacobian[i + j * states]; empty: difference quotients.
  std::function<void(double t_s, const double* y, double* jacobian)> jacobian;
  int events = 0;
  std::function<void(double t_s, const double* y, double* g)> event_functions;
  bool events_fall = false;  ///< an event is a fall through zero only, not a sign change either way
  Sensitivities sensitivities;  ///< of no parameter unless asked; cvode_bdf only
};

enum class SundialsMethod {
  cvode_adams,  ///< non-stiff, fixed-point iteration
  cvode_bdf,    ///< stiff, Newton with dense Jacobian
  arkode_erk,   ///< explicit Runge-Kutta of order 8
  arkode_dirk,  ///< stiff, diagonally implicit Runge-Kutta of order 5
};

struct SundialsOptions {
  SundialsMethod method = SundialsMethod::cvode_bdf;
  double rtol = 1e-10;
  Eigen::VectorXd atol;  ///< one per state, >= 0; with regularised friction the velocities' must be
                         ///< well below the regularisation, or stick is not resolved
  int max_steps = 5000000;  ///< from one output time to the next
  /// Outputs from the solver's own interpolation instead of steps that end there: fewer steps on a
  /// dense grid, but the derivative is also evaluated a little beyond the last time.
  bool interpolate = false;
};

struct SundialsRun {
  Eigen::MatrixXd states;         ///< one row per time reached
  Eigen::MatrixXd sensitivities;  ///< one row per time reached: states x parameters, by column
  Eigen::VectorXd end_state;      ///< where the run ended: last time, or the event
  double end_s = 0.0;
  int event = -1;  ///< index of the event function that made the event, -1 if none
  Outcome outcome = Outcome::reached_end;
  std::string message;  ///< SUNDIALS' own words if it gave up
  long steps = 0, evaluations = 0, failed = 0;
};

/// Integrates from (start_s, y0) through ascending times; stops at the first event
/// (times after it have no row) or when the solver gives up (outcome says so).
/// @throws InputError if sizes do not match, a time precedes the start or the method carries no
///         sensitivities.
[[nodiscard]] SundialsRun integrate_sundials(const Ode& ode, double start_s,
                                             const Eigen::VectorXd& y0, std::span<const double> t_s,
                                             const SundialsOptions& options);

/// An Ode from a system written for our own steppers over Dual<N> with N >= kStates: exact Jacobian
/// columns come from its derivative lanes, values from its values().
template <class DualSystem>
[[nodiscard]] Ode make_ode(const DualSystem& system) {
  using Dual = typename DualSystem::Scalar;
  constexpr int n = DualSystem::kStates;
  static_assert(Dual::kLanes >= n, "one lane per state");
  Ode ode;
  ode.states = n;
  ode.derivative = [values = system.values()](double t_s, const double* y, double* dy) {
    State<double, n> state, rate;
    for (int i = 0; i < n; ++i) state[i] = y[i];
    values.derivative(t_s, state, rate);
    for (int i = 0; i < n; ++i) dy[i] = rate[i];
  };
  ode.jacobian = [system](double t_s, const double* y, double* jacobian) {
    State<Dual, n> state, rate;
    for (int i = 0; i < n; ++i) state[i] = Dual::variable(y[i], i);
    system.derivative(t_s, state, rate);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) jacobian[i + j * n] = rate[i].derivative[j];
  };
  return ode;
}

}  // namespace trochoid::model
