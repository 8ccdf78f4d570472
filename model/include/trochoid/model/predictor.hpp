#pragma once
#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "trochoid/data/scene.hpp"
#include "trochoid/model/outcome.hpp"

namespace trochoid::model {

/// What a camera or a mark can see of a model.
enum class Observable { x_m, y_m, theta_rad, phi_rad, psi_rad };

/// One number a prediction depends on. Names and units are those of the scene file and of fit.json.
struct ParameterInfo {
  enum class Role {
    dynamics,     ///< belongs to the body and the table: shared between arcs and recordings
    initial,      ///< state at the start time: own to each arc
    observation,  ///< pivot position and the like
  };
  std::string name;
  std::string unit;
  Role role = Role::dynamics;
  double lower = 0.0, upper = 0.0;  ///< physical range, may be infinite
  bool logarithmic = false;         ///< positive over decades: fit its logarithm
  double value = 0.0;               ///< default: from the scene's [body], [model], [start]
  bool worth_fitting = true;        ///< the model's choice when the scene names no free parameters
  std::string meaning;              ///< one phrase for reports
};

struct PredictRequest {
  std::span<const double> t_s;  ///< ascending; all >= start_s
  double start_s = 0.0;         ///< time the initial state belongs to
  std::vector<Observable> observables{Observable::x_m, Observable::y_m};
  std::vector<int> derivatives;  ///< indices into parameters(); empty: values only
  double tolerance = 1e-9;
  /// Integration steps after which the run ends as step_limit (a fit's wild trial point may ask for
  /// millions); 0 = the model's own limit. Sliding with regularised friction may take more: as many
  /// as stability asks for, whatever the motion.
  int max_steps = 0;
  /// Also return the state at the last time, expressed in the `initial` parameters (for shooting).
  bool want_end_state = false;
  /// After a body has fallen flat it lies there: rows go on, without tilt, where it fell.
  bool lies_where_it_fell = false;
  /// A body that may slide rolls at start_s: vx_m_s and vy_m_s do not count. Where friction sets in
  /// softly it creeps, as fast as the friction that holds it asks for (S22).
  bool rolls_at_first = false;
};

/// Row n * observables.size() + o belongs to time n, observable o. After an early end the remaining
/// rows are NaN (unless it lies_where_it_fell), `outcome` says why and `valid_until_s` says when.
struct Prediction {
  Eigen::VectorXd values;
  Eigen::MatrixXd jacobian;            ///< rows as values, one column per requested derivative
  Eigen::VectorXd end_state;           ///< in the order of the `initial` parameters
  Eigen::MatrixXd end_state_jacobian;  ///< one column per requested derivative
  Outcome outcome = Outcome::reached_end;
  double valid_until_s = 0.0;
  int steps = 0;  ///< that took the time of an explicit one: an implicit one counts as three
};

/// A model bound to a scene's geometry and terms, as a function of its parameters. Thread-safe:
/// predict() may be called from several threads.
class Predictor {
 public:
  virtual ~Predictor() = default;
  [[nodiscard]] virtual const std::string& model_name() const = 0;
  [[nodiscard]] virtual const std::vector<ParameterInfo>& parameters() const = 0;
  /// Never returns NaN before valid_until_s.
  /// @throws InputError if a value is not finite or outside its range, or t_s is not ascending.
  [[nodiscard]] virtual Prediction predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                           const PredictRequest& request) const = 0;
  [[nodiscard]] int index_of(const std::string& parameter) const;  ///< -1 if there is none
};

/// Chooses the equations and terms once. Names: top, top-euler, rolling, sliding, puck, pivot,
/// smooth.
/// @throws InputError naming the missing field if the scene lacks what the model needs.
[[nodiscard]] std::unique_ptr<Predictor> make_predictor(const data::Scene& scene);

}  // namespace trochoid::model
