#pragma once
#include <Eigen/Core>
#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "observe/observations.hpp"
#include "observe/timing.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::fitting {

/// How friction sets in: the slip speed of the regularised law, absent in Coulomb's.
inline constexpr const char* kSlipScale = "slip_regularisation_m_s";
/// How much the floor rises per length.
inline constexpr const char* kSlopeX = "slope_x";
inline constexpr const char* kSlopeY = "slope_y";
/// A law sharper than that makes stiff equations, and no camera tells it from Coulomb's.
inline constexpr double kSharpest_m_s = 5e-5;

inline constexpr double kAirViscosity_Pa_s = 1.8e-5;
/// The gap layer's law for small tilts may miss air's viscosity by a few times, not by more.
inline constexpr double kThickestAir_Pa_s = 10.0 * kAirViscosity_Pa_s;
/// Whether a scene speaks of a gap layer of its own: as viscous as water, or by what [fit] says.
[[nodiscard]] bool tells_of_a_film(const data::Scene& scene);

/// How a free parameter is handed to the minimiser, so that it stays in its range.
///   identity  value = u
///   log       value = exp(u): positive, over decades
///   above     value = lower + exp(u);   below: value = upper - exp(u)
///   limited   value = upper/(1 + exp(-u)): positive, over decades, below a limit
///   between   value = lower + (upper - lower) (1 + tanh u)/2
struct Transform {
  enum class Kind { identity, log, above, below, limited, between };
  Kind kind = Kind::identity;
  double lower = 0.0, upper = 0.0;
  double inside = 0.0;  ///< above, below: least distance of a start from the bound, > 0
  [[nodiscard]] bool is_over_decades() const { return kind == Kind::log || kind == Kind::limited; }
  [[nodiscard]] double value(double u) const;
  [[nodiscard]] double slope(double u) const;  ///< d value / d u
  [[nodiscard]] double inverse(double value) const;
  /// The same to begin with: on a bound the slope is 0, and what begins there, or beyond, never
  /// leaves. It begins a little inside.
  [[nodiscard]] double start(double value) const;
  /// What its values lie between; may be infinite.
  [[nodiscard]] std::pair<double, double> limits() const;
};

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

struct FreeParameter {
  int index = 0;  ///< into Predictor::parameters()
  int arc = -1;   ///< -1: shared by all arcs
  Transform transform;
  std::optional<data::Prior> prior;
  std::optional<data::Prior> soft_prior;  ///< on u, while exploring: short windows see no friction
  double given = 0.0;  ///< value before any fitting: the scene's, or the model's default
  bool held = false;   ///< stays where it is for now
  bool turns = false;  ///< an angle that whole turns bring back
};

/// How far a value is from what is known of it beforehand [standard deviations].
/// @param turns  whole turns are no distance.
[[nodiscard]] double off_prior(const data::Prior& prior, double value, bool turns);

/// Whether it came to lie where it is no longer sought, as a friction that is never overcome.
[[nodiscard]] inline bool at_its_limit(const FreeParameter& parameter, double value) {
  return parameter.transform.kind == Transform::Kind::limited &&
         value > 0.98 * parameter.transform.upper;
}

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

/// Whether a name under [fit] means a parameter: its own, or that of a term, which stands for all
/// its components ("air_linear_N_m_s" for "air_linear_N_m_s[1]").
[[nodiscard]] bool means(const std::string& entry, const std::string& parameter);

/// What a table under [fit] says of a parameter: by its own name, else by its term's; null:
/// nothing.
template <class Value>
const Value* said_of(const std::string& parameter, const std::map<std::string, Value>& entries) {
  auto entry = entries.find(parameter);
  if (entry == entries.end()) entry = entries.find(parameter.substr(0, parameter.find('[')));
  return entry == entries.end() ? nullptr : &entry->second;
}

/// What is known beforehand of a parameter in an arc: of that arc alone ("theta_rad@1"), else of
/// all.
/// @param arc  -1: shared by all.
[[nodiscard]] const data::Prior* prior_of(const std::string& parameter, int arc,
                                          const data::FitSettings& settings);

/// Whether a parameter is how much the floor rises.
[[nodiscard]] bool is_slope(const std::string& name);

/// Whether naming a parameter in [fit] free leaves the model its own choice of the others: where
/// its pivot is, when it was seen, how friction sets in, whether the floor is level.
[[nodiscard]] bool leaves_choice(const std::string& name);

/// A parameter to be fitted, as [fit] bounds it and knows it beforehand.
/// @param index  into predictor.parameters() @param arc  whose it is, -1: all of them share it
/// @param value  before any fitting, in the parameter's unit
[[nodiscard]] FreeParameter free_parameter(const model::Predictor& predictor,
                                           const data::FitSettings& settings, int index, int arc,
                                           double value);

/// Chooses transforms and priors: parameters named in scene.fit (or the model's own choice when it
/// names none) are free, those of role `initial` once per arc.
/// @throws InputError for a free or fixed name the model does not have.
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
