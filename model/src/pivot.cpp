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

constexpr double kInfinity = std::numeric_limits<double>::infinity();
using Role = ParameterInfo::Role;
using Dual8 = Dual<8>;

enum Parameter : int { kPsi, kW3, kDry, kViscous, kQuadratic, kParameters };

struct PivotScene {
  double value[kParameters] = {};
  bool present[kParameters] = {true, true, false, false, false};
  Eigen::Vector3d pivot_m = Eigen::Vector3d::Zero();
};

PivotScene pivot_scene(const data::Scene& scene) {
  const data::ModelSettings& model = scene.model;
  PivotScene pivot;
  const std::optional<double> terms[] = {model.spin_down_dry_rad_s2, model.spin_down_viscous_1_s,
                                         model.spin_down_quadratic_1_rad};
  const char* const names[] = {"spin_down_dry_rad_s2", "spin_down_viscous_1_s",
                               "spin_down_quadratic_1_rad"};
  for (int i = 0; i < 3; ++i) {
    pivot.present[kDry + i] = terms[i].has_value();
    pivot.value[kDry + i] = terms[i].value_or(0.0);
    if (!(pivot.value[kDry + i] >= 0.0) || !std::isfinite(pivot.value[kDry + i]))
      throw InputError(fmt::format("model.{} = {} must be 0 or greater: a loss takes energy",
                                   names[i], pivot.value[kDry + i]));
  }
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

template <class S>
PivotPath<S> run_pivot(const S (&p)[kParameters], std::span<const double> t_s, double tolerance,
                       int max_steps = 0) {
  using P = Pivot<S>;
  const double sense = value_of(p[kW3]) < 0.0 ? -1.0 : 1.0;
  PivotPath<S> path;
  const auto add = [&](const S& turned, const S& speed) {
    path.rows.push_back({p[kPsi] + sense * turned, sense * speed});
  };
  const P pivot{p[kDry], p[kViscous], p[kQuadratic]};
  auto control = uniform_control<2>(tolerance);
  if (max_steps > 0) control.max_steps = max_steps;
  DormandPrince<P> stepper(pivot, control);
  State<S, 2> y{S(0.0), p[kW3] * sense};
  const double end_s = t_s.empty() ? 0.0 : t_s.back();
  if (value_of(y[P::speed]) > 0.0) {
    stepper.start(0.0, y);
    // Without dry friction the speed only tends to zero; rounding must not stop it.
    const EventRule stops[] = {{-1, value_of(p[kDry]) > 0.0}};
    const auto result = integrate(
        stepper, end_s, t_s.data(), static_cast<int>(t_s.size()),
        [&](auto& s, int first, int last) {
          for (int n = first; n < last; ++n) {
            const double u = s.fraction(t_s[static_cast<std::size_t>(n)]);
            add(s.dense(P::psi, u), s.dense(P::speed, u));
          }
        },
        DormandPrince<P>::kAll, stops);
    path.counts = stepper.counts();
    path.end = result.end;
    y = result.y;
    if (result.end == RunEnd::event) path.rest_s = result.t_s;
  } else if (value_of(p[kDry]) > 0.0 || value_of(y[P::speed]) == 0.0) {
    path.rest_s = 0.0;
  }
  if (std::isfinite(path.rest_s))  // the angle's derivatives do not jump: its rate is zero here
    while (path.rows.size() < t_s.size()) add(y[P::psi], S(0.0));
  return path;
}

class PivotPredictor : public Predictor {
 public:
  explicit PivotPredictor(const data::Scene& scene) : scene_(pivot_scene(scene)) {
    const ParameterInfo all[kParameters] = {
        {"psi_rad", "rad", Role::initial, -kInfinity, kInfinity, false, 0.0, true, "spin angle"},
        {"w3_rad_s", "rad/s", Role::initial, -kInfinity, kInfinity, false, 0.0, true, "spin"},
        {"spin_down_dry_rad_s2", "rad/s^2", Role::dynamics, 0.0, kInfinity, true, 0.0, true,
         "dry couple over axial moment"},
        {"spin_down_viscous_1_s", "1/s", Role::dynamics, 0.0, kInfinity, true, 0.0, true,
         "viscous couple over axial moment and spin"},
        {"spin_down_quadratic_1_rad", "1/rad", Role::dynamics, 0.0, kInfinity, true, 0.0, true,
         "quadratic couple over axial moment and spin squared"}};
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
  std::vector<double> t_s;
  for (const double t : request.t_s) t_s.push_back(t - request.start_s);
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto rows = static_cast<Eigen::Index>(request.t_s.size() * request.observables.size());
  Prediction out;
  out.values.setConstant(rows, kNan);
  out.jacobian.setConstant(rows, static_cast<Eigen::Index>(request.derivatives.size()), kNan);
  if (request.derivatives.empty()) {
    double p[kParameters] = {};
    for (std::size_t i = 0; i < kinds_.size(); ++i)
      p[kinds_[i]] = values[static_cast<Eigen::Index>(i)];
    fill(run_pivot(p, t_s, request.tolerance, request.max_steps), request, out);
    return out;
  }
  Dual8 p[kParameters];
  for (std::size_t i = 0; i < kinds_.size(); ++i)
    p[kinds_[i]] = Dual8(values[static_cast<Eigen::Index>(i)]);
  for (std::size_t c = 0; c < request.derivatives.size(); ++c)
    p[kinds_[static_cast<std::size_t>(request.derivatives[c])]].derivative[c] = 1.0;
  fill(run_pivot(p, t_s, request.tolerance, request.max_steps), request, out);
  return out;
}

}  // namespace

std::unique_ptr<Predictor> make_pivot(const data::Scene& scene) {
  return std::make_unique<PivotPredictor>(scene);
}

Trajectory simulate_pivot(const data::Scene& scene) {
  const PivotScene pivot = pivot_scene(scene);
  const std::vector<double> t_s = output_times_s(scene.run);
  const auto path = run_pivot(pivot.value, t_s, scene.run.tolerance);
  const auto check = run_pivot(pivot.value, t_s, finer(scene.run.tolerance));
  // Without a body of known mass the run has no energy.
  const bool weighed = scene.body && scene.body->kind != data::BodyKind::top && scene.body->mass_kg;
  const double axial = weighed ? central_inertia(*scene.body).axial_kg_m2 : 0.0;

  Trajectory run;
  run.model = "pivot";
  run.integrator = "dop853";
  run.integrator_reason = "not stiff";
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
    if (weighed) row.push_back(0.5 * axial * w * w);
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
