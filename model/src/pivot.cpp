#include "trochoid/model/pivot.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "factories.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/inertia.hpp"

// Spin-down on a fixed pivot as a function of its parameters and as a table.
namespace trochoid::model {
namespace {

using Role = ParameterInfo::Role;
using Dual8 = Dual<8>;

enum Parameter : int {
  kPsi,
  kW3,
  kDry,
  kWeakening,
  kViscous,
  kQuadratic,
  kSine,
  kCosine,
  kParameters
};
static_assert(kParameters <= Dual8::kLanes);

struct PivotScene {
  double value[kParameters] = {};
  bool present[kParameters] = {true, true};
  Eigen::Vector3d pivot_m = Eigen::Vector3d::Zero();
};

PivotScene pivot_scene(const data::Scene& scene) {
  const data::ModelSettings& model = scene.model;
  PivotScene pivot;
  const auto take = [&](Parameter which, const std::optional<double>& term) {
    pivot.present[which] = term.has_value();
    pivot.value[which] = term.value_or(0.0);
  };
  const auto take_loss = [&](Parameter which, const char* name, const std::optional<double>& term) {
    take(which, term);
    if (!(pivot.value[which] >= 0.0) || !std::isfinite(pivot.value[which]))
      throw InputError(fmt::format("model.{} = {} must be 0 or greater: a loss takes energy", name,
                                   pivot.value[which]));
  };
  take_loss(kDry, "spin_down_dry_rad_s2", model.spin_down_dry_rad_s2);
  take_loss(kWeakening, "spin_down_weakening_s_rad", model.spin_down_weakening_s_rad);
  take_loss(kViscous, "spin_down_viscous_1_s", model.spin_down_viscous_1_s);
  take_loss(kQuadratic, "spin_down_quadratic_1_rad", model.spin_down_quadratic_1_rad);
  if (pivot.present[kWeakening] && !pivot.present[kDry])
    throw InputError("model.spin_down_weakening_s_rad weakens spin_down_dry_rad_s2: give that too");
  take(kSine, model.spin_down_imbalance_sin_rad_s2);
  take(kCosine, model.spin_down_imbalance_cos_rad_s2);
  const data::StartSettings& start = scene.start;
  pivot.value[kPsi] = start.psi_rad.value_or(0.0);
  pivot.value[kW3] =
      start.w3_rad_s.value_or(start.dpsi_rad_s.value_or(start.omega_s_rad_s.value_or(0.0)));
  if (scene.support.pivot_m) pivot.pivot_m = *scene.support.pivot_m;
  return pivot;
}

/// Angle and angular velocity at ascending times from 0; at rest both stay.
template <class S>
struct PivotPath {
  std::vector<State<S, 2>> rows;
  double rest_s = kInfinity;
  StepCounts counts;
  RunEnd end = RunEnd::reached_end;
};

template <bool Unbalanced, class S>
PivotPath<S> run_pivot_with(const S (&p)[kParameters], std::span<const double> t_s,
                            double tolerance, int max_steps) {
  using P = Pivot<S, Unbalanced>;
  constexpr bool kDerives = requires {
    S::kLanes;
  };
  PivotPath<S> path;
  const auto add = [&](const S& turned, const S& speed) {
    path.rows.push_back({p[kPsi] + turned, speed});
  };
  P pivot{p[kPsi], p[kDry], p[kWeakening], p[kViscous], p[kQuadratic], p[kSine], p[kCosine]};
  const double dry = value_of(p[kDry]);
  auto control = uniform_control<2>(tolerance);
  // A weight that is nothing leaves a run of long steps, over which its derivative turns many
  // times.
  control.control_derivatives = Unbalanced;
  if (max_steps > 0) control.max_steps = max_steps;
  // Without dry friction a balanced disc's speed only tends to zero; rounding must not stop it.
  const EventRule stops[] = {{-1, Unbalanced || dry > 0.0}};
  const double end_s = t_s.empty() ? 0.0 : t_s.back();
  State<S, 2> y{S(0.0), p[kW3]};
  double from_s = 0.0;
  bool turning = value_of(y[P::speed]) != 0.0;  // else: at an instant of rest
  if (turning) pivot.sense = value_of(y[P::speed]) < 0.0 ? -1.0 : 1.0;
  while (true) {
    if (!turning) {
      const double pull = pivot.values().weight(value_of(y[P::turned]));
      // What nothing pulls or holds stays, but goes away by any other speed: it has derivatives.
      const bool poised = kDerives && dry == 0.0 && from_s == 0.0;
      if (std::abs(pull) <= dry && !poised) {
        path.rest_s = from_s;
        break;
      }
      P back = pivot;
      back.sense = pull < 0.0 ? -1.0 : 1.0;
      if (from_s > 0.0) {
        const double rate = (pivot.sense * pull - dry);
        y = across_event(pivot, back, from_s, y, event_delay(y[P::speed] * pivot.sense, rate),
                         [](const State<S, 2>& at) { return at; });
      }
      pivot = back;
    }
    DormandPrince<P> stepper(pivot, control);
    stepper.start(from_s, y);
    const std::size_t done = path.rows.size();
    const auto result = integrate(
        stepper, end_s, t_s.data() + done, static_cast<int>(t_s.size() - done),
        [&](auto& s, int first, int last) {
          for (int n = first; n < last; ++n) {
            const double u = s.fraction(t_s[done + static_cast<std::size_t>(n)]);
            add(s.dense(P::turned, u), s.dense(P::speed, u));
          }
        },
        DormandPrince<P>::kAll, stops, turning ? -1 : 0);
    path.counts.steps += stepper.counts().steps;
    path.counts.rejected += stepper.counts().rejected;
    path.counts.evaluations += stepper.counts().evaluations;
    control.max_steps -= stepper.counts().steps;
    path.end = result.end;
    y = result.y;
    if (result.end != RunEnd::event) return path;
    from_s = result.t_s;
    turning = false;
  }
  // The angle's derivatives do not jump: its rate is zero here.
  while (path.rows.size() < t_s.size()) add(y[P::turned], S(0.0));
  return path;
}

template <class S>
PivotPath<S> run_pivot(const PivotScene& scene, const S (&p)[kParameters],
                       std::span<const double> t_s, double tolerance, int max_steps = 0) {
  return scene.present[kSine] || scene.present[kCosine]
             ? run_pivot_with<true>(p, t_s, tolerance, max_steps)
             : run_pivot_with<false>(p, t_s, tolerance, max_steps);
}

class PivotPredictor : public Predictor {
 public:
  explicit PivotPredictor(const data::Scene& scene) : scene_(pivot_scene(scene)) {
    const auto loss = [](const char* name, const char* unit, const char* meaning) {
      return ParameterInfo{name, unit, Role::dynamics, 0.0, kInfinity, true, 0.0, true, meaning};
    };
    const auto any = [](const char* name, const char* unit, Role role, const char* meaning) {
      return ParameterInfo{name, unit, role, -kInfinity, kInfinity, false, 0.0, true, meaning};
    };
    const ParameterInfo all[kParameters] = {
        any("psi_rad", "rad", Role::initial, "spin angle"),
        any("w3_rad_s", "rad/s", Role::initial, "spin"),
        loss("spin_down_dry_rad_s2", "rad/s^2", "dry couple over axial moment"),
        loss("spin_down_weakening_s_rad", "s/rad", "dry couple falls to half at 1 over this"),
        loss("spin_down_viscous_1_s", "1/s", "viscous couple over axial moment and spin"),
        loss("spin_down_quadratic_1_rad", "1/rad",
             "quadratic couple over axial moment and spin squared"),
        any("spin_down_imbalance_sin_rad_s2", "rad/s^2", Role::dynamics,
            "couple of the weight over axial moment, against sin(psi)"),
        any("spin_down_imbalance_cos_rad_s2", "rad/s^2", Role::dynamics,
            "couple of the weight over axial moment, against cos(psi)")};
    for (int i = 0; i < kParameters; ++i) {
      if (!scene_.present[i]) continue;
      infos_.push_back(all[i]);
      infos_.back().value = scene_.value[i];
      kinds_.push_back(i);
    }
  }
  [[nodiscard]] const std::string& model_name() const override { return name_; }
  [[nodiscard]] const std::vector<ParameterInfo>& parameters() const override { return infos_; }
  [[nodiscard]] Prediction predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                   const PredictRequest& request) const override;

 private:
  template <class S>
  void fill(const PivotPath<S>& path, const PredictRequest& request, Prediction& out) const;

  std::string name_ = "pivot";
  PivotScene scene_;
  std::vector<ParameterInfo> infos_;
  std::vector<int> kinds_;
};

template <class S>
void PivotPredictor::fill(const PivotPath<S>& path, const PredictRequest& request,
                          Prediction& out) const {
  const auto put = [&](Eigen::Index row, const S& value, Eigen::VectorXd& values,
                       Eigen::MatrixXd& jacobian) {
    values[row] = value_of(value);
    if constexpr (requires { value.derivative; }) {
      for (Eigen::Index c = 0; c < jacobian.cols(); ++c) jacobian(row, c) = value.derivative[c];
    }
  };
  // The centre rests at the pivot, and tilt and node line are zero by convention.
  const auto seen = [&](const State<S, 2>& s, Observable what) {
    if (what == Observable::psi_rad) return s[0];
    if (what == Observable::x_m) return S(scene_.pivot_m.x());
    return what == Observable::y_m ? S(scene_.pivot_m.y()) : S(0.0);
  };
  Eigen::Index row = 0;
  for (const auto& s : path.rows)
    for (const Observable what : request.observables)
      put(row++, seen(s, what), out.values, out.jacobian);
  const bool early = path.end != RunEnd::event && path.end != RunEnd::reached_end;
  out.outcome = early ? outcome_of(path.end) : Outcome::reached_end;
  out.valid_until_s = path.rows.empty() ? request.start_s : request.t_s[path.rows.size() - 1];
  out.steps = path.counts.steps;
  if (!request.want_end_state || path.rows.empty()) return;
  out.end_state.resize(2);
  out.end_state_jacobian.resize(2, out.jacobian.cols());
  for (int i = 0; i < 2; ++i) put(i, path.rows.back()[i], out.end_state, out.end_state_jacobian);
}

Prediction PivotPredictor::predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                   const PredictRequest& request) const {
  check_request(*this, values, request);
  const std::vector<double> t_s = since_start_s(request);
  Prediction out = unknown_prediction(request);
  if (request.derivatives.empty()) {
    double p[kParameters] = {};
    for (std::size_t i = 0; i < kinds_.size(); ++i)
      p[kinds_[i]] = values[static_cast<Eigen::Index>(i)];
    fill(run_pivot(scene_, p, t_s, request.tolerance, request.max_steps), request, out);
    return out;
  }
  Dual8 p[kParameters];
  for (std::size_t i = 0; i < kinds_.size(); ++i)
    p[kinds_[i]] = Dual8(values[static_cast<Eigen::Index>(i)]);
  for (std::size_t c = 0; c < request.derivatives.size(); ++c)
    set_lane(p[kinds_[static_cast<std::size_t>(request.derivatives[c])]].derivative, c, 1.0);
  fill(run_pivot(scene_, p, t_s, request.tolerance, request.max_steps), request, out);
  return out;
}

}  // namespace

std::unique_ptr<Predictor> make_pivot(const data::Scene& scene) {
  return std::make_unique<PivotPredictor>(scene);
}

Trajectory simulate_pivot(const data::Scene& scene) {
  const PivotScene pivot = pivot_scene(scene);
  const std::vector<double> t_s = output_times_s(scene.run);
  const auto path = run_pivot(pivot, pivot.value, t_s, scene.run.tolerance);
  const auto check = run_pivot(pivot, pivot.value, t_s, finer(scene.run.tolerance));
  // Without a body of known mass the run has no energy.
  const bool weighed = scene.body && scene.body->kind != data::BodyKind::top && scene.body->mass_kg;
  const double axial = weighed ? central_inertia(*scene.body).axial_kg_m2 : 0.0;

  Trajectory run;
  run.model = "pivot";
  run.integrator = "dop853";
  run.integrator_reason = "smooth up to the instant of rest";
  run.error_estimate_m = std::numeric_limits<double>::quiet_NaN();
  run.columns = euler_columns();
  if (!weighed) run.columns.pop_back();
  run.columns.emplace_back("w3_rad_s");
  run.values.resize(static_cast<Eigen::Index>(path.rows.size()),
                    static_cast<Eigen::Index>(run.columns.size()));
  for (std::size_t n = 0; n < path.rows.size(); ++n) {
    const double psi = path.rows[n][0], w = path.rows[n][1];
    std::vector<double> row{
        t_s[n],           0.0, 0.0, psi, 0.0, 0.0, w, pivot.pivot_m.x(), pivot.pivot_m.y(),
        pivot.pivot_m.z()};
    const double lift_rad2_s2 =
        pivot.value[kCosine] * std::sin(psi) - pivot.value[kSine] * std::cos(psi);
    if (weighed) row.push_back(axial * (0.5 * w * w + lift_rad2_s2));
    row.push_back(w);
    run.values.row(static_cast<Eigen::Index>(n)) =
        Eigen::Map<const Eigen::RowVectorXd>(row.data(), static_cast<Eigen::Index>(row.size()));
    if (n < check.rows.size())
      run.error_estimate_rad = std::max(run.error_estimate_rad, std::abs(psi - check.rows[n][0]));
  }
  run.statistics = {path.counts.steps, path.counts.rejected, path.counts.evaluations};
  run.end_s = path.rows.empty() ? 0.0 : t_s[path.rows.size() - 1];
  run.outcome = path.end == RunEnd::event ? Outcome::reached_end : outcome_of(path.end);
  if (path.rest_s <= t_s.back()) {
    run.events.push_back({path.rest_s, "at_rest"});
    run.outcome = Outcome::at_rest;
  }
  return run;
}

}  // namespace trochoid::model
