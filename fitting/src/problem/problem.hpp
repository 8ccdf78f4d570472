#pragma once
#include <Eigen/Core>
#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "observe/observations.hpp"
#include "observe/timing.hpp"
#include "problem/free_parameter.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

/// Why predictions ended before the track did, and starts were not followed to its end, counted
/// while searching.
struct Shortfalls {
  std::array<std::atomic<int>, model::kOutcomes> by_outcome{};  ///< in the order of model::Outcome
  std::atomic<int> departed{0};  ///< starts whose path left the track's within a part of it
  std::atomic<int> track{-1};    ///< of several, the one that no start explains
  std::atomic<int> samples{0};   ///< of that one
  void count(model::Outcome outcome) { ++by_outcome[static_cast<std::size_t>(outcome)]; }
  /// A sentence; which reason was the commonest.
  [[nodiscard]] std::string words() const;
};

/// The longest window from the first sample on that a search explained, and with which values.
struct Partial {
  int samples = 0;
  double until_s = 0.0;    ///< when the last of them was taken
  Eigen::VectorXd values;  ///< of all predictor parameters
};

/// Velocity of the centre of a body that may slide and rolls.
struct RollingVelocity {
  Eigen::Vector2d m_s;
  Eigen::Matrix2Xd by;  ///< derivatives by the parameters asked for
};

/// @param values of all parameters; the velocity among them does not count.
/// @throws InputError if one lies outside its range.
[[nodiscard]] RollingVelocity rolling_velocity(const model::Predictor& predictor,
                                               const Eigen::VectorXd& values,
                                               const std::vector<int>& derivatives = {});

/// A predictor, the arcs it has to explain and what may vary. The vector u holds one entry per free
/// parameter, shared ones first.
struct Problem {
  const model::Predictor* predictor = nullptr;
  std::vector<ArcData> arcs;
  std::vector<FreeParameter> free;
  std::vector<Eigen::VectorXd> base;  ///< per arc, all predictor parameters; free ones are starts
  std::vector<Eigen::VectorXd> row_weights;  ///< per arc, sqrt of the robust weights; empty = 1
  double tolerance = 1e-8;
  Timing timing;
  bool rolls_at_first = false;  ///< of a sliding body, whose velocity is not free then
  bool rough = false;           ///< a search may end near the minimum: only a start is wanted
  std::function<void(const std::string& line)> log;  ///< may be empty
  /// Integration steps taken so far, one with derivatives counted by its cost; null: not counted.
  std::shared_ptr<double> work;
  std::shared_ptr<Shortfalls> shortfalls;  ///< null: not counted
  std::shared_ptr<Partial> partial;        ///< of a single-arc problem; null: not kept

  [[nodiscard]] int shared_count() const;
  /// Whether what the camera is off by is among the parameters (camera_off.hpp).
  [[nodiscard]] bool frees_camera() const;
  [[nodiscard]] std::string name(int free_index) const;  ///< with "@i" for own ones of arc i > 0
  [[nodiscard]] std::vector<int> columns_of(int arc) const;  ///< free indices seen by an arc
  [[nodiscard]] Eigen::VectorXd here() const;                ///< u of the values in `base`
  [[nodiscard]] Eigen::VectorXd start() const;  ///< the same to begin with, off all bounds
  [[nodiscard]] Eigen::VectorXd values(int arc, const Eigen::VectorXd& u) const;
  [[nodiscard]] double value(int free_index, const Eigen::VectorXd& u) const;
  void set_base(const Eigen::VectorXd& u);  ///< writes the values of u back into `base`
  [[nodiscard]] int rows() const;
  [[nodiscard]] int max_steps() const;  ///< of one integration

 private:
  [[nodiscard]] Eigen::VectorXd of_base(double (Transform::*u_of)(double) const) const;
};

enum class Weights { kept, dropped };
/// The problem with residuals in the sigmas that the tracks state, whatever noise was found, and
/// with or without the robust weights.
[[nodiscard]] Problem in_stated_sigmas(Problem problem, Weights weights);

/// One arc of a problem, weighted as in it, with the parameters it sees.
[[nodiscard]] Problem single_arc(const Problem& problem, int arc);

/// Whether a free parameter is the strength of a loss: short windows do not see it, and it may be
/// absent altogether. The friction of a sliding body and a top's a, b and l are not.
[[nodiscard]] bool is_loss(const Problem& problem, const FreeParameter& parameter);

/// Chooses transforms and priors: parameters named in scene.fit (or the model's own choice when it
/// names none) are free, those of role `initial` once per arc.
/// @throws InputError where the settings do not suit the model (check_settings).
[[nodiscard]] Problem make_problem(const model::Predictor& predictor, std::vector<ArcData> arcs,
                                   const data::Scene& scene);

/// Whitened, weighted residuals of one arc and their derivatives by u (columns_of order). A body
/// that falls flat before the arc ends lies where it fell from then on.
/// Returns false if the model has no prediction there (never leaves NaN behind).
/// @param held_too  false: derivatives by held parameters are not computed but zero.
[[nodiscard]] bool evaluate(const Problem& problem, int arc, const Eigen::VectorXd& u,
                            Eigen::VectorXd& residuals, Eigen::MatrixXd* jacobian,
                            bool held_too = true);

/// When the body of a single-arc problem falls flat at u, if it does so within the record.
[[nodiscard]] std::optional<double> falls_at_s(const Problem& problem, const Eigen::VectorXd& u);

/// Angle coordinates outside [0, pi] name the same attitude as folded ones: brings theta back and
/// turns phi, psi and the rates accordingly. `sign` receives the derivative of each folded value.
void fold_tilt(const model::Predictor& predictor, Eigen::VectorXd& values, Eigen::VectorXd& sign);

/// Of the two names of one attitude of a body whose faces look alike, (theta, phi) and (pi - theta,
/// phi + pi), takes the one with the lesser tilt at the start of each arc, and phi within half a
/// turn of zero. Leaves arcs alone where the spin angle is seen, and all of them where an angle or
/// a rate that turns round with the axis is given, bounded or known beforehand: by what was said of
/// it the body has but one of the names.
void name_attitudes(Problem& problem);

struct Solution {
  Eigen::VectorXd u;
  double chi2 = 0.0;  ///< twice the final cost: weighted residuals and priors
  bool usable = false;
  bool converged = false;
  int iterations = 0;
  std::string message;  ///< why not, unless converged
};

struct SolveOptions {
  int iterations = 60;
  double function_tolerance = 1e-9;
  double initial_radius = 1e4;
};

/// Levenberg-Marquardt (Ceres) from u: dense QR, or a sparse factorisation where there are many
/// arcs.
[[nodiscard]] Solution solve(const Problem& problem, const Eigen::VectorXd& u,
                             const SolveOptions& options = {});

/// The minimiser for any model. A body on its rim has long bent valleys with steep walls, and its
/// derivatives cost many plain predictions; the losses of a spin-down trade with each other along
/// one. There Levenberg-Marquardt with geodesic acceleration, which needs a quarter of the
/// derivatives and stops at no wall; elsewhere solve().
[[nodiscard]] Solution minimise(const Problem& problem, const Eigen::VectorXd& u,
                                const SolveOptions& options = {});

/// Readings within so many scaled sigmas count in full: clean Gaussian data are left alone.
inline constexpr double kInlier = 3.5;

/// Sets the arcs' noise_scale (if `rescale`) and robust weights from the residuals at u: a reading
/// d > kInlier scaled sigmas off is multiplied by (kInlier/d)^2. Each recording has its own scale
/// of a channel, and leans on what all of them say where it is short; positions that came without
/// covariance do not.
/// @returns the largest change of any weight or scale; 0, all left as it was, where the model has
///          no prediction at u, of which uncertainty() complains.
double reweight(Problem& problem, const Eigen::VectorXd& u, bool rescale);

/// What a reading's residuals are multiplied by for standing out.
[[nodiscard]] double robust_weight(const Problem& problem, int arc, const Reading& reading);

/// What the readings that stand out in a channel cost beyond their weighted squares. The cost whose
/// slope those weights give rises to 2 kInlier^2 for a reading far off: to give it up is not free.
[[nodiscard]] double cost_of_standing_out(const Problem& problem, Channel channel);

}  // namespace trochoid::fitting
