#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "factories.hpp"
#include "puck_run.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/events.hpp"
#include "trochoid/model/inertia.hpp"

// The puck as a function of its parameters and as a table; position and spin angle are cyclic.
namespace trochoid::model {
namespace {

using Role = ParameterInfo::Role;
using Dual8 = Dual<8>;

enum Parameter : int {
  kX,
  kY,
  kVx,
  kVy,
  kPsi,
  kW3,
  kInitial,
  kFriction = kInitial,
  kDrag,
  kContact,
  kSlopeX,
  kSlopeY,
  kAll
};

struct PuckScene {
  double gravity = 9.81, radius_m = 0.0, bore = 0.0, gyration = 0.5;
  double mass_kg = 1.0, height_m = 0.0;
  bool mass_known = false, drag = false, sloped = false;
  double value[kAll] = {};  ///< by Parameter
};

// On its very rim a body turns as hard as an even face half as large again.
constexpr double kWidestContact = 1.5;
// A smaller one does not brake its turning within any recording; on none there is no turning to
// tell.
constexpr double kLeastContact = 1e-3;

PuckScene puck_scene(const data::Scene& scene) {
  if (!scene.body) throw InputError("[body] is missing: the puck model needs kind and radius_m");
  if (!scene.model.friction)
    throw InputError("model.friction is missing: the puck model needs the Coulomb coefficient");
  const CentralInertia inertia = central_inertia(*scene.body);
  if (scene.model.air_force_N_s_m && !inertia.mass_known)
    throw InputError(
        "body.mass_kg is missing: model.air_force_N_s_m acts as coefficient over mass; weigh the "
        "body");
  if (!(scene.model.gravity_m_s2 > 0.0))
    throw InputError(
        fmt::format("model.gravity_m_s2 = {} must be greater than 0", scene.model.gravity_m_s2));
  const double radius_m = scene.body->radius_m;
  if (const double contact_m = scene.model.contact_radius_m.value_or(radius_m);
      !(contact_m >= kLeastContact * radius_m && contact_m <= kWidestContact * radius_m))
    throw InputError(
        fmt::format("model.contact_radius_m = {} must lie between {:g} and {} times radius_m = {}",
                    contact_m, kLeastContact, kWidestContact, radius_m));
  PuckScene puck;
  puck.gravity = scene.model.gravity_m_s2;
  puck.radius_m = radius_m;
  // A hoop without width has no face; this one's error is its width over R, 1e-5.
  constexpr double kWidestBore = 1.0 - 1e-5;
  puck.bore = std::min(scene.body->inner_radius_m / puck.radius_m, kWidestBore);
  puck.gyration = inertia.axial_kg_m2 / (inertia.mass_kg * puck.radius_m * puck.radius_m);
  puck.mass_kg = inertia.mass_kg;
  puck.mass_known = inertia.mass_known;
  puck.height_m = scene.body->half_thickness_m();
  puck.drag = scene.model.air_force_N_s_m.has_value();
  const std::optional<Eigen::Vector2d> slope = floor_slope(scene);
  puck.sloped = slope.has_value();
  const data::StartSettings& start = scene.start;
  const double initial[] = {start.x_m.value_or(0.0),
                            start.y_m.value_or(0.0),
                            start.vx_m_s.value_or(0.0),
                            start.vy_m_s.value_or(0.0),
                            start.psi_rad.value_or(0.0),
                            start.w3_rad_s.value_or(start.dpsi_rad_s.value_or(0.0)),
                            *scene.model.friction,
                            scene.model.air_force_N_s_m.value_or(0.0),
                            scene.model.contact_radius_m.value_or(puck.radius_m),
                            slope ? slope->x() : 0.0,
                            slope ? slope->y() : 0.0};
  std::copy(std::begin(initial), std::end(initial), puck.value);
  return puck;
}

constexpr double kLeastFriction = 1e-9;  // below it the stretched time loses its meaning

std::vector<ParameterInfo> puck_parameters(const PuckScene& puck) {
  const auto initial = [&](Parameter which, const char* name, const char* unit,
                           const char* meaning) {
    return ParameterInfo{name,      unit,  Role::initial,     -kInfinity,
                         kInfinity, false, puck.value[which], which != kPsi,
                         meaning};
  };
  std::vector<ParameterInfo> list{
      initial(kX, "x_m", "m", "centre of mass"),
      initial(kY, "y_m", "m", "centre of mass"),
      initial(kVx, "vx_m_s", "m/s", "velocity of the centre"),
      initial(kVy, "vy_m_s", "m/s", "velocity of the centre"),
      initial(kPsi, "psi_rad", "rad", "angle turned about the vertical"),
      initial(kW3, "w3_rad_s", "rad/s", "spin about the vertical"),
      {"friction", "1", Role::dynamics, kLeastFriction, kInfinity, true, puck.value[kFriction],
       true, "Coulomb coefficient of face and floor"}};
  if (puck.drag)
    list.push_back({"air_force_N_s_m", "N s/m", Role::dynamics, 0.0, kInfinity, true,
                    puck.value[kDrag], true, "air force on the centre of mass"});
  // Only a spin that is seen tells how far out the face rests on the floor.
  list.push_back({"contact_radius_m", "m", Role::dynamics, kLeastContact * puck.radius_m,
                  kWidestContact * puck.radius_m, true, puck.value[kContact], false,
                  "radius of the contact, as of an evenly pressed face"});
  if (puck.sloped)
    for (const ParameterInfo& info : slope_parameters({puck.value[kSlopeX], puck.value[kSlopeY]}))
      list.push_back(info);
  return list;
}

template <class S>
Puck<S> puck_system(const PuckScene& scene, const S (&p)[kAll]) {
  Puck<S> puck;
  puck.friction = p[kFriction];
  puck.drag_1_s = p[kDrag] * (1.0 / scene.mass_kg);
  puck.rise_x = p[kSlopeX];
  puck.rise_y = p[kSlopeY];
  puck.gravity = scene.gravity;
  puck.radius = p[kContact];
  puck.bore = scene.bore;
  const S ratio = scene.radius_m / p[kContact];
  puck.gyration = scene.gyration * ratio * ratio;
  return puck;
}

/// Runs from parameter values, in the order of `Parameter`.
template <class S>
PuckPath<S> puck_path(const PuckScene& scene, const S (&p)[kAll], std::span<const double> t_s,
                      double tolerance, int max_steps = 0) {
  const State<S, 7> start{p[kVx], p[kVy], p[kW3] * p[kContact], p[kX], p[kY], p[kPsi], S(0.0)};
  return run_puck(puck_system<S>(scene, p), start, t_s, tolerance, max_steps);
}

/// The six initial parameters that describe a state.
template <class S>
State<S, kInitial> parameters_of(const State<S, 7>& s, const S& contact_radius_m) {
  using P = Puck<S>;
  return {s[P::x], s[P::y], s[P::vx], s[P::vy], s[P::psi], s[P::q] / contact_radius_m};
}

class PuckPredictor : public Predictor {
 public:
  explicit PuckPredictor(const data::Scene& scene)
      : scene_(puck_scene(scene)), infos_(puck_parameters(scene_)) {
    for (int kind = 0; kind < kAll; ++kind)
      if (has(static_cast<Parameter>(kind))) kinds_.push_back(kind);
  }
  [[nodiscard]] const std::string& model_name() const override { return name_; }
  [[nodiscard]] const std::vector<ParameterInfo>& parameters() const override { return infos_; }
  [[nodiscard]] Prediction predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                   const PredictRequest& request) const override;

 private:
  template <class S>
  void fill(const PuckPath<S>& path, const S& contact_radius_m, const PredictRequest& request,
            Prediction& out) const;
  [[nodiscard]] bool has(Parameter kind) const {
    if (kind == kDrag) return scene_.drag;
    return scene_.sloped || (kind != kSlopeX && kind != kSlopeY);
  }
  /// Place and angle at the start only add to those later; their derivatives need no lane.
  [[nodiscard]] bool cyclic(int parameter) const {
    const int kind = kinds_[static_cast<std::size_t>(parameter)];
    return kind == kX || kind == kY || kind == kPsi;
  }

  std::string name_ = "puck";
  PuckScene scene_;
  std::vector<ParameterInfo> infos_;
  std::vector<int> kinds_;  ///< of each parameter, a Parameter
};

/// A puck lies flat: its tilt and node line are zero by convention.
template <class S>
S seen(const State<S, 7>& s, Observable what) {
  using P = Puck<S>;
  switch (what) {
    case Observable::x_m:
      return s[P::x];
    case Observable::y_m:
      return s[P::y];
    case Observable::psi_rad:
      return s[P::psi];
    case Observable::theta_rad:
    case Observable::phi_rad:
      break;
  }
  return S(0.0);
}

template <class S>
void PuckPredictor::fill(const PuckPath<S>& path, const S& contact_radius_m,
                         const PredictRequest& request, Prediction& out) const {
  // `seen_kind`: the initial parameter that would read the same as `value`, for cyclic columns.
  const auto put = [&](Eigen::Index row, const S& value, int seen_kind, Eigen::VectorXd& values,
                       Eigen::MatrixXd& jacobian) {
    values[row] = value_of(value);
    if constexpr (requires { value.derivative; }) {
      int lane = 0;
      for (Eigen::Index c = 0; c < jacobian.cols(); ++c) {
        const int parameter = request.derivatives[static_cast<std::size_t>(c)];
        jacobian(row, c) =
            cyclic(parameter)
                ? (kinds_[static_cast<std::size_t>(parameter)] == seen_kind ? 1.0 : 0.0)
                : value.derivative[lane++];
      }
    }
  };
  const auto kind_of = [](Observable what) {
    return what == Observable::x_m       ? static_cast<int>(kX)
           : what == Observable::y_m     ? static_cast<int>(kY)
           : what == Observable::psi_rad ? static_cast<int>(kPsi)
                                         : -1;
  };
  Eigen::Index row = 0;
  for (const auto& s : path.rows)
    for (const Observable what : request.observables)
      put(row++, seen(s, what), kind_of(what), out.values, out.jacobian);
  out.outcome = outcome_of(run_end_of(path.end));
  out.valid_until_s = path.rows.empty() ? request.start_s : request.t_s[path.rows.size() - 1];
  out.steps = path.statistics.steps;
  if (!request.want_end_state || path.rows.empty()) return;
  const auto end = parameters_of(path.rows.back(), contact_radius_m);
  out.end_state.resize(kInitial);
  out.end_state_jacobian.resize(kInitial, out.jacobian.cols());
  for (int i = 0; i < kInitial; ++i) put(i, end[i], i, out.end_state, out.end_state_jacobian);
}

Prediction PuckPredictor::predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                  const PredictRequest& request) const {
  check_request(*this, values, request);
  const std::vector<double> t_s = since_start_s(request);
  Prediction out = unknown_prediction(request);
  const auto given = [&](auto& p) {
    for (int kind = 0; kind < kAll; ++kind) p[kind] = scene_.value[kind];
    for (std::size_t i = 0; i < kinds_.size(); ++i)
      p[kinds_[i]] = values[static_cast<Eigen::Index>(i)];
  };
  if (request.derivatives.empty()) {
    double p[kAll] = {};
    given(p);
    fill(puck_path(scene_, p, t_s, request.tolerance, request.max_steps), p[kContact], request,
         out);
    return out;
  }
  Dual8 p[kAll];  // at most eight parameters are not cyclic
  given(p);
  int lane = 0;
  for (const int parameter : request.derivatives)
    if (!cyclic(parameter))
      set_lane(p[kinds_[static_cast<std::size_t>(parameter)]].derivative, lane++, 1.0);
  fill(puck_path(scene_, p, t_s, request.tolerance, request.max_steps), p[kContact], request, out);
  return out;
}

std::vector<std::string> puck_columns(bool mass_known) {
  std::vector<std::string> columns = euler_columns();
  if (!mass_known) columns.pop_back();  // energy needs the mass
  for (const char* name : {"w3_rad_s", "vx_m_s", "vy_m_s"}) columns.emplace_back(name);
  if (mass_known)
    for (const char* name : {"normal_force_N", "force_x_N", "force_y_N"})
      columns.emplace_back(name);
  return columns;
}

}  // namespace

std::unique_ptr<Predictor> make_puck(const data::Scene& scene) {
  return std::make_unique<PuckPredictor>(scene);
}

Trajectory simulate_puck(const data::Scene& scene) {
  const PuckScene puck = puck_scene(scene);
  if (!(puck.value[kFriction] >= kLeastFriction))
    throw InputError(fmt::format("model.friction = {} must be at least {}", puck.value[kFriction],
                                 kLeastFriction));
  const double rise = std::hypot(puck.value[kSlopeX], puck.value[kSlopeY]);
  if (!(rise < puck.value[kFriction]))  // it turns back, or never stops
    throw InputError(
        fmt::format("support: a floor that rises by {:.3g} per length holds no puck of "
                    "model.friction = {:.3g}, which must be greater",
                    rise, puck.value[kFriction]));
  const std::vector<double> t_s = output_times_s(scene.run);
  const double tolerance = scene.run.tolerance;
  const auto path = puck_path(puck, puck.value, t_s, tolerance);
  const auto check = puck_path(puck, puck.value, t_s, finer(tolerance));
  const auto system = puck_system<double>(puck, puck.value);

  Trajectory run;
  run.model = "puck";
  run.integrator = "dop853";
  run.integrator_reason = "smooth in the stretched time in which rest lies at infinity";
  run.columns = puck_columns(puck.mass_known);
  run.values.resize(static_cast<Eigen::Index>(path.rows.size()),
                    static_cast<Eigen::Index>(run.columns.size()));
  for (std::size_t n = 0; n < path.rows.size(); ++n) {
    using P = Puck<double>;
    const auto& s = path.rows[n];
    const double w = s[P::q] / puck.value[kContact], m = puck.mass_kg;
    std::vector<double> row{t_s[n], 0.0, 0.0,     s[P::psi], 0.0,
                            0.0,    w,   s[P::x], s[P::y],   puck.height_m};
    const double kinetic =
        0.5 * m *
        (s[P::vx] * s[P::vx] + s[P::vy] * s[P::vy] + value_of(system.gyration) * s[P::q] * s[P::q]);
    const double height_m =
        puck.height_m + puck.value[kSlopeX] * s[P::x] + puck.value[kSlopeY] * s[P::y];
    if (puck.mass_known) row.push_back(kinetic + m * puck.gravity * height_m);
    row.insert(row.end(), {w, s[P::vx], s[P::vy]});
    if (puck.mass_known) {
      const bool moves = t_s[n] < path.rest_s;
      const auto a = moves ? system.acceleration(s) : FaceForce<double>{0.0, 0.0, 0.0};
      const double drag = value_of(system.drag_1_s);
      row.insert(row.end(), {m * puck.gravity,
                             m * (a.x + drag * s[P::vx] + puck.gravity * puck.value[kSlopeX]),
                             m * (a.y + drag * s[P::vy] + puck.gravity * puck.value[kSlopeY])});
    }
    run.values.row(static_cast<Eigen::Index>(n)) =
        Eigen::Map<const Eigen::RowVectorXd>(row.data(), static_cast<Eigen::Index>(row.size()));
    if (n >= check.rows.size()) continue;
    const auto& finer_s = check.rows[n];
    run.error_estimate_m = std::max(run.error_estimate_m,
                                    std::hypot(s[P::x] - finer_s[P::x], s[P::y] - finer_s[P::y]));
    run.error_estimate_rad =
        std::max(run.error_estimate_rad, std::abs(s[P::psi] - finer_s[P::psi]));
  }
  run.statistics = path.statistics;
  run.end_s = path.rows.empty() ? 0.0 : t_s[path.rows.size() - 1];
  run.outcome = outcome_of(run_end_of(path.end));
  if (std::isfinite(path.rest_s) && path.rest_s <= t_s.back()) {
    run.events.push_back({path.rest_s, "at_rest"});
    run.outcome = Outcome::at_rest;
  }
  return run;
}

}  // namespace trochoid::model
