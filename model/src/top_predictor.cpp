#include <cmath>
#include <limits>

#include "decay.hpp"
#include "factories.hpp"
#include "top_dispatch.hpp"
#include "top_scene.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/model/events.hpp"

// The top as a function of its parameters: the kernel follows the axis k, everything else (length,
// pivot, azimuth, spin) enters the observation in closed form.
namespace trochoid::model {
namespace {

using Role = ParameterInfo::Role;

enum Parameter {
  kA,
  kB,
  kL,
  kGamma1,
  kGamma3,
  kDry,
  kQuadratic,
  kTheta,
  kPhi,
  kDtheta,
  kDphi,
  kPsi,
  kOmega,
  kPivotX,
  kPivotY
};

struct Entry {
  Parameter parameter;
  ParameterInfo info;
};

std::vector<Entry> entries(const TopSettings& top) {
  std::vector<Entry> list{{kA,
                           {"a_1_s2", "1/s^2", Role::dynamics, 0.0, kInfinity, true, top.a_1_s2,
                            true, "weight couple over moment, m g l / I"}},
                          {kB,
                           {"b_1_s", "1/s", Role::initial, -kInfinity, kInfinity, false, top.b_1_s,
                            true, "spin momentum over moment, Is omega_s / I"}},
                          {kL,
                           {"l_m", "m", Role::dynamics, 0.0, kInfinity, true, top.l_m, true,
                            "distance from pivot to centre of mass"}}};
  const auto drag = [&](bool named, Parameter which, const char* name, const char* unit,
                        double value, const char* meaning) {
    if (!named) return;
    list.push_back(
        {which, {name, unit, Role::dynamics, 0.0, kInfinity, true, value, true, meaning}});
  };
  drag(top.transverse_drag, kGamma1, "gamma1_1_s", "1/s", top.gamma1_1_s,
       "drag across the axis, c1 / I");
  drag(top.spin_drag, kGamma3, "gamma3_1_s", "1/s", top.gamma3_1_s, "drag on the spin, c3 / Is");
  drag(top.dry_drag, kDry, "gamma3_dry_1_s2", "1/s^2", top.dry_1_s2,
       "dry drag on the spin, t0 / I");
  drag(top.quadratic_drag, kQuadratic, "gamma3_quadratic", "1", top.quadratic,
       "quadratic drag on the spin, q3 I / Is^2");
  const std::vector<Entry> rest{
      {kTheta,
       {"theta_rad", "rad", Role::initial, 0.0, data::kPi, false, top.theta_rad, true, "tilt"}},
      {kPhi,
       {"phi_rad", "rad", Role::initial, -kInfinity, kInfinity, false, top.phi_rad, true,
        "precession angle"}},
      {kDtheta,
       {"dtheta_rad_s", "rad/s", Role::initial, -kInfinity, kInfinity, false, top.dtheta_rad_s,
        true, "tilting rate"}},
      {kDphi,
       {"dphi_rad_s", "rad/s", Role::initial, -kInfinity, kInfinity, false, top.dphi_rad_s, true,
        "precession rate"}},
      {kPsi,
       {"psi_rad", "rad", Role::initial, -kInfinity, kInfinity, false, top.psi_rad, false,
        "spin angle"}},
      {kOmega,
       {"omega_s_rad_s", "rad/s", Role::initial, -kInfinity, kInfinity, false, top.omega_s_rad_s,
        false, "spin about the own axis; only a mark shows it"}},
      {kPivotX,
       {"pivot_x_m", "m", Role::observation, -kInfinity, kInfinity, false, top.pivot_x_m, false,
        "pivot in the table frame"}},
      {kPivotY,
       {"pivot_y_m", "m", Role::observation, -kInfinity, kInfinity, false, top.pivot_y_m, false,
        "pivot in the table frame"}}};
  list.insert(list.end(), rest.begin(), rest.end());
  return list;
}

int lane_of(Parameter parameter) {
  switch (parameter) {
    case kA:
      return kTopA;
    case kB:
      return kTopB;
    case kGamma1:
      return kTopGamma1;
    case kGamma3:
      return kTopGamma3;
    case kDry:
      return kTopDry;
    case kQuadratic:
      return kTopQuadratic;
    case kTheta:
      return kTopTheta;
    case kDtheta:
      return kTopDtheta;
    case kDphi:
      return kTopDphi;
    default:
      return -1;
  }
}

class TopPredictor : public Predictor {
 public:
  using Kernel = void (*)(const TopRun&, TopResult&);
  TopPredictor(std::string name, Kernel kernel, bool writes_path, const TopSettings& top)
      : name_(std::move(name)), kernel_(kernel), writes_path_(writes_path), top_(top) {
    for (Entry& entry : entries(top)) {
      kinds_.push_back(entry.parameter);
      infos_.push_back(std::move(entry.info));
    }
  }
  [[nodiscard]] const std::string& model_name() const override { return name_; }
  [[nodiscard]] const std::vector<ParameterInfo>& parameters() const override { return infos_; }
  [[nodiscard]] Prediction predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                   const PredictRequest& request) const override;

 private:
  struct Work;
  [[nodiscard]] double get(const Eigen::Ref<const Eigen::VectorXd>& values, Parameter which) const;
  void point_at_path(Work& work, Prediction& prediction) const;
  void finish_path(const Work& work, Prediction& prediction) const;
  void fill_observable(const Work& work, int slot, Prediction& prediction) const;
  void fill_end(const Work& work, Prediction& prediction) const;
  [[nodiscard]] double derivative(const Work& work, Observable what, Parameter by, int n) const;

  std::string name_;
  Kernel kernel_;
  bool writes_path_;  ///< the kernel knows TopPath
  TopSettings top_;   ///< for the drags it has
  std::vector<Parameter> kinds_;
  std::vector<ParameterInfo> infos_;
};

/// One call's run and what it was asked.
struct TopPredictor::Work {
  const PredictRequest& request;
  TopRun run;
  TopResult result;
  double l_m, omega_s, psi_rad, pivot_x_m, pivot_y_m;
  std::vector<double> values, derivatives;

  [[nodiscard]] double value(int column, int n) const { return result.value[column][n]; }
  [[nodiscard]] double lane(int column, int n, int i) const {
    return result.derivative[column][i][n];
  }
  void prepare() {
    const std::size_t count = request.t_s.size();
    const int columns = run.with_angles ? kTopAngleColumns : kTopAxisColumns;
    const int lanes = !run.with_derivatives ? 0 : run.quadratic ? kTopMostLanes : kTopLanes;
    values.resize(count * columns);
    derivatives.resize(count * columns * lanes);
    for (int c = 0; c < columns; ++c) {
      result.value[c] = values.data() + c * count;
      for (int i = 0; i < lanes; ++i)
        result.derivative[c][i] = derivatives.data() + (c * lanes + i) * count;
    }
  }
  /// What b does, omega_s does alike: of one radian per second of spin at the start, with the
  /// derivative of b's part.
  [[nodiscard]] double share(double of_b) const { return of_b / run.variable[kTopB]; }
  [[nodiscard]] double share_by(Parameter by, double of_b_by, double share) const {
    return (of_b_by - (by == kB ? share : 0.0)) / run.variable[kTopB];
  }
  /// How far that has turned by time n, and its derivative.
  [[nodiscard]] double turn_s(int n) const {
    return counts_turns() ? share(value(kTopTurns, n)) : held() ? 0.0 : decayed(n).integral;
  }
  [[nodiscard]] double turn_s_by(Parameter by, int n) const {
    if (!counts_turns()) return by == kGamma3 && !held() ? decayed(n).by_rate : 0.0;
    return lane_of(by) < 0 ? 0.0 : share_by(by, lane(kTopTurns, n, lane_of(by)), turn_s(n));
  }
  /// A top without spin turns by nothing however that would slow it.
  [[nodiscard]] bool counts_turns() const {
    return (run.dry || run.quadratic) && run.variable[kTopB] != 0.0;
  }
  /// Dry drag lets none begin.
  [[nodiscard]] bool held() const { return run.spin_stops_s <= run.start_s; }
  [[nodiscard]] Decay decayed(int n) const {
    return decay(run.variable[kTopGamma3], request.t_s[n] - request.start_s);
  }
};

double TopPredictor::get(const Eigen::Ref<const Eigen::VectorXd>& values, Parameter which) const {
  for (std::size_t i = 0; i < kinds_.size(); ++i) {
    if (kinds_[i] == which) return values[static_cast<Eigen::Index>(i)];
  }
  return 0.0;
}

bool wants_path(const PredictRequest& request) {
  return request.observables == std::vector<Observable>{Observable::x_m, Observable::y_m};
}

bool wants_angles(const PredictRequest& request) {
  for (const Observable what : request.observables) {
    if (what == Observable::phi_rad || what == Observable::psi_rad) return true;
  }
  return request.want_end_state;
}

Prediction TopPredictor::predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                 const PredictRequest& request) const {
  check_request(*this, values, request);
  Work work{request,
            {},
            {},
            get(values, kL),
            get(values, kOmega),
            get(values, kPsi),
            get(values, kPivotX),
            get(values, kPivotY),
            {},
            {}};
  TopRun& run = work.run;
  for (const Parameter which : {kA, kB, kGamma1, kGamma3, kDry, kQuadratic, kTheta, kDtheta, kDphi})
    run.variable[lane_of(which)] = get(values, which);
  run.phi_rad = get(values, kPhi);
  run.drag = top_.drag;
  run.dry = top_.dry_drag;
  run.quadratic = top_.quadratic_drag;
  run.with_derivatives = !request.derivatives.empty();
  run.with_angles = wants_angles(request);
  run.start_s = request.start_s;
  run.spin_stops_s =
      run.start_s + spin_lasts_s(run.variable[kTopB], run.variable[kTopDry],
                                 run.variable[kTopGamma3], run.variable[kTopQuadratic]);
  run.t_s = request.t_s.data();
  run.count = static_cast<int>(request.t_s.size());
  run.end_s = request.t_s.empty() ? request.start_s : request.t_s.back();
  run.tolerance = request.tolerance;
  if (request.max_steps > 0) run.max_steps = request.max_steps;
  Prediction prediction;
  const auto rows = static_cast<Eigen::Index>(request.t_s.size() * request.observables.size());
  prediction.values.resize(rows);
  prediction.jacobian.resize(rows, static_cast<Eigen::Index>(request.derivatives.size()));
  if (writes_path_ && wants_path(request)) {
    point_at_path(work, prediction);
    kernel_(run, work.result);
    finish_path(work, prediction);
  } else {
    work.prepare();
    kernel_(run, work.result);
    for (std::size_t slot = 0; slot < request.observables.size(); ++slot)
      fill_observable(work, static_cast<int>(slot), prediction);
  }
  if (request.want_end_state) fill_end(work, prediction);
  prediction.outcome = outcome_of(static_cast<RunEnd>(work.result.end_reason));
  prediction.valid_until_s = work.result.reached_s;
  prediction.steps = work.result.steps;
  return prediction;
}

/// Lets the kernel write straight into the prediction.
void TopPredictor::point_at_path(Work& work, Prediction& prediction) const {
  TopPath& path = work.result.path;
  path.l_m = work.l_m;
  path.pivot_x_m = work.pivot_x_m;
  path.pivot_y_m = work.pivot_y_m;
  path.xy = prediction.values.data();
  for (std::size_t c = 0; c < work.request.derivatives.size(); ++c) {
    const Parameter by = kinds_[static_cast<std::size_t>(work.request.derivatives[c])];
    double* column = prediction.jacobian.col(static_cast<Eigen::Index>(c)).data();
    if (by == kL) path.by_l = column;
    if (by == kPhi) path.by_phi = column;
    if (lane_of(by) >= 0) path.by_variable[lane_of(by)] = column;
  }
}

/// Columns the kernel does not know, and what was not reached.
void TopPredictor::finish_path(const Work& work, Prediction& prediction) const {
  for (std::size_t c = 0; c < work.request.derivatives.size(); ++c) {
    const Parameter by = kinds_[static_cast<std::size_t>(work.request.derivatives[c])];
    if (lane_of(by) >= 0 || by == kL || by == kPhi) continue;
    auto column = prediction.jacobian.col(static_cast<Eigen::Index>(c));
    for (Eigen::Index n = 0; n < column.size(); ++n)
      column[n] = by == (n % 2 == 0 ? kPivotX : kPivotY) ? 1.0 : 0.0;
  }
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Index missing = prediction.values.size() - 2 * work.result.written;
  prediction.values.tail(missing).setConstant(kNan);
  prediction.jacobian.bottomRows(missing).setConstant(kNan);
}

double TopPredictor::derivative(const Work& work, Observable what, Parameter by, int n) const {
  const int lane = lane_of(by);
  const double kx = work.value(0, n), ky = work.value(1, n), kz = work.value(2, n);
  switch (what) {
    case Observable::x_m:
      if (lane >= 0) return work.l_m * work.lane(0, n, lane);
      return by == kL ? kx : by == kPhi ? -work.l_m * ky : by == kPivotX ? 1.0 : 0.0;
    case Observable::y_m:
      if (lane >= 0) return work.l_m * work.lane(1, n, lane);
      return by == kL ? ky : by == kPhi ? work.l_m * kx : by == kPivotY ? 1.0 : 0.0;
    case Observable::theta_rad: {
      if (lane < 0) return 0.0;
      const double s = std::hypot(kx, ky);
      const double dkx = work.lane(0, n, lane), dky = work.lane(1, n, lane);
      // Upright, the tilt grows by how far the axis moves, to whatever side.
      if (s == 0.0) return std::copysign(std::hypot(dkx, dky), kz);
      return kz * (kx * dkx + ky * dky) / s - s * work.lane(2, n, lane);
    }
    case Observable::phi_rad:
      return lane >= 0 ? work.lane(3, n, lane) : by == kPhi ? 1.0 : 0.0;
    case Observable::psi_rad: {
      double total = lane >= 0 ? work.lane(4, n, lane) : 0.0;
      total += work.omega_s * work.turn_s_by(by, n);
      if (by == kOmega) total += work.turn_s(n);
      if (by == kPsi) total += 1.0;
      return total;
    }
  }
  return 0.0;
}

void TopPredictor::fill_observable(const Work& work, int slot, Prediction& prediction) const {
  const PredictRequest& request = work.request;
  const auto stride = static_cast<int>(request.observables.size());
  const Observable what = request.observables[static_cast<std::size_t>(slot)];
  const auto value = [&](int n) {
    switch (what) {
      case Observable::x_m:
        return work.pivot_x_m + work.l_m * work.value(0, n);
      case Observable::y_m:
        return work.pivot_y_m + work.l_m * work.value(1, n);
      case Observable::theta_rad:
        return std::atan2(std::hypot(work.value(0, n), work.value(1, n)), work.value(2, n));
      case Observable::phi_rad:
        return work.value(3, n);
      case Observable::psi_rad:
        break;
    }
    return work.psi_rad + work.value(4, n) + work.omega_s * work.turn_s(n);
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const int count = static_cast<int>(request.t_s.size()), reached = work.result.written;
  for (int n = 0; n < count; ++n)
    prediction.values[n * stride + slot] = n < reached ? value(n) : kNan;
  for (std::size_t column = 0; column < request.derivatives.size(); ++column) {
    const Parameter by = kinds_[static_cast<std::size_t>(request.derivatives[column])];
    double* out = prediction.jacobian.col(static_cast<Eigen::Index>(column)).data() + slot;
    for (int n = 0; n < count; ++n)
      out[n * stride] = n < reached ? derivative(work, what, by, n) : kNan;
  }
}

void TopPredictor::fill_end(const Work& work, Prediction& prediction) const {
  const TopResult& result = work.result;
  const double ran_s = result.reached_s - work.request.start_s;
  const double gamma3 = work.run.variable[kTopGamma3];
  const Decay linear = work.held() ? Decay{0.0, 0.0} : decay(gamma3, ran_s);
  const bool counted = work.counts_turns();
  // Of one radian per second of spin at the start: what is left, and how far it has turned.
  const double left = counted       ? work.share(result.end[4])
                      : work.held() ? 0.0
                                    : std::exp(-gamma3 * ran_s);
  const double turn_s = counted ? work.share(result.end[6]) : linear.integral;
  // In the order of the initial parameters: b, theta, phi, dtheta, dphi, psi, omega_s.
  constexpr int kSource[] = {4, 0, 1, 2, 3, 5};
  prediction.end_state.resize(7);
  for (int i = 0; i < 6; ++i) prediction.end_state[i] = result.end[kSource[i]];
  prediction.end_state[5] += work.psi_rad + work.omega_s * turn_s;
  prediction.end_state[6] = work.omega_s * left;
  prediction.end_state_jacobian.setZero(7,
                                        static_cast<Eigen::Index>(work.request.derivatives.size()));
  for (std::size_t c = 0; c < work.request.derivatives.size(); ++c) {
    const Parameter by = kinds_[static_cast<std::size_t>(work.request.derivatives[c])];
    auto column = prediction.end_state_jacobian.col(static_cast<Eigen::Index>(c));
    const int lane = lane_of(by);
    for (int i = 0; i < 6 && lane >= 0; ++i) column[i] = result.end_derivative[kSource[i]][lane];
    if (by == kPhi) column[2] = 1.0;
    if (by == kPsi) column[5] = 1.0;
    if (by == kOmega) {
      column[5] = turn_s;
      column[6] = left;
    }
    if (counted && lane >= 0) {
      column[5] += work.omega_s * work.share_by(by, result.end_derivative[6][lane], turn_s);
      column[6] = work.omega_s * work.share_by(by, result.end_derivative[4][lane], left);
    } else if (by == kGamma3) {
      column[5] += work.omega_s * linear.by_rate;
      column[6] = -work.omega_s * left * ran_s;
    }
  }
}

}  // namespace

std::unique_ptr<Predictor> make_top(const data::Scene& scene) {
  return std::make_unique<TopPredictor>("top", run_top_here, true, top_for_prediction(scene));
}

std::unique_ptr<Predictor> make_top_euler(const data::Scene& scene) {
  return std::make_unique<TopPredictor>("top-euler", run_top_euler, false,
                                        without_drag(top_for_prediction(scene)));
}

}  // namespace trochoid::model
