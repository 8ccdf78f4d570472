#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "factories.hpp"
#include "rim_kernel.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"

// Rolling, sliding and smooth-floor bodies as functions of their parameters. Position and spin
// angle are cyclic, and so is the azimuth of a body that rolls on a level floor: their derivatives
// need no lane.
namespace trochoid::model {
namespace {

using Role = ParameterInfo::Role;

enum class Floor { rolling, smooth, sliding };

/// Places of the parameters in RimInput: initial state, losses, friction, slope along x and y.
constexpr int kInitial = 10, kFriction = kInitial + kLosses, kSlipScale = kFriction + 1,
              kSlope = kSlipScale + 1;
enum Slot : int { kTheta, kPhi, kPsi, kW1, kW2, kW3, kX, kY, kVx, kVy };

template <class S>
S& slot(RimInput<S>& in, int index) {
  S* const initial[kInitial] = {&in.theta, &in.phi, &in.psi, &in.w1, &in.w2,
                                &in.w3,    &in.x,   &in.y,   &in.vx, &in.vy};
  if (index < kInitial) return *initial[index];
  if (index < kFriction) return in.losses.value[index - kInitial];
  if (index < kSlope) return index == kFriction ? in.friction : in.eps_v;
  return index == kSlope ? in.losses.rise.x : in.losses.rise.y;
}

ParameterInfo initial_parameter(const char* name, const char* unit, double value,
                                const char* meaning) {
  return {name, unit, Role::initial, -kInfinity, kInfinity, false, value, true, meaning};
}

struct Entries {
  std::vector<ParameterInfo> infos;
  std::vector<int> slots;
  void add(const ParameterInfo& info, int slot) {
    infos.push_back(info);
    slots.push_back(slot);
  }
};

void add_initial(const RimStart& start, Floor floor, Entries& entries) {
  ParameterInfo theta = initial_parameter("theta_rad", "rad", start.theta_rad, "tilt of the axis");
  theta.lower = kFlat_rad;
  theta.upper = data::kPi - theta.lower;
  entries.add(theta, kTheta);
  entries.add(initial_parameter("phi_rad", "rad", start.phi_rad, "precession angle"), kPhi);
  ParameterInfo psi = initial_parameter("psi_rad", "rad", start.psi_rad, "spin angle");
  psi.worth_fitting = false;  // only a mark shows it
  entries.add(psi, kPsi);
  entries.add(initial_parameter("w1_rad_s", "rad/s", start.w1_rad_s, "tilting rate"), kW1);
  entries.add(
      initial_parameter("w2_rad_s", "rad/s", start.w2_rad_s, "angular velocity up the disc plane"),
      kW2);
  entries.add(initial_parameter("w3_rad_s", "rad/s", start.w3_rad_s, "spin about the axis"), kW3);
  entries.add(initial_parameter("x_m", "m", start.x_m, "centre of mass"), kX);
  entries.add(initial_parameter("y_m", "m", start.y_m, "centre of mass"), kY);
  if (floor == Floor::rolling) return;
  entries.add(initial_parameter("vx_m_s", "m/s", start.vx_m_s, "velocity of the centre"), kVx);
  entries.add(initial_parameter("vy_m_s", "m/s", start.vy_m_s, "velocity of the centre"), kVy);
}

void add_dynamics(const data::ModelSettings& model, Floor floor, Entries& entries) {
  for (const ParameterInfo& info : loss_parameters(model)) {
    int index = 0;
    while (info.name != kLossNames[index]) ++index;
    entries.add(info, kInitial + index);
  }
  if (floor != Floor::sliding) return;
  if (!model.friction)
    throw InputError("model.friction is missing: the sliding model needs the Coulomb coefficient");
  entries.add({"friction", "1", Role::dynamics, 0.0, kInfinity, true, *model.friction, true,
               "Coulomb coefficient of the floor"},
              kFriction);
  // Coulomb's law itself has no slip speed to fit.
  if (const double eps_m_s = model.slip_regularisation_m_s.value_or(0.0); eps_m_s > 0.0)
    entries.add({"slip_regularisation_m_s", "m/s", Role::dynamics, 0.0, kInfinity, true, eps_m_s,
                 false, "slip speed over which friction sets in"},
                kSlipScale);
}

void add_slope(const std::optional<Eigen::Vector2d>& slope, Entries& entries) {
  if (!slope) return;
  int place = kSlope;
  for (const ParameterInfo& info : slope_parameters(*slope)) entries.add(info, place++);
}

class RimPredictor : public Predictor {
 public:
  RimPredictor(const data::Scene& scene, Floor floor, const char* name)
      : name_(name),
        floor_(floor),
        model_{rim_body(scene), scene.model, floor_slope(scene).has_value()},
        fixed_(loss_values(scene.model)),
        impact_(scene.run.rim_switch == "impact") {
    const RimStart start = rim_start_or_typical(scene, model_.body);
    add_initial(start, floor, entries_);
    add_dynamics(scene.model, floor, entries_);
    add_slope(floor_slope(scene), entries_);
  }
  [[nodiscard]] const std::string& model_name() const override { return name_; }
  [[nodiscard]] const std::vector<ParameterInfo>& parameters() const override {
    return entries_.infos;
  }
  [[nodiscard]] Prediction predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                   const PredictRequest& request) const override;

 private:
  struct Call;
  template <class S>
  [[nodiscard]] RimInput<S> input(const Eigen::Ref<const Eigen::VectorXd>& values) const;
  template <class S>
  [[nodiscard]] RimPath<S> run(const RimInput<S>& in, const Call& call) const;
  template <class S>
  [[nodiscard]] RimPath<S> seen(RimPath<S> path, const Call& call) const;
  template <class S>
  void fill_values(const RimPath<S>& path, Call& call, Prediction& out) const;
  void fill_lanes(const RimPath<Dual8>& path, const Call& call, const std::vector<int>& columns,
                  Prediction& out) const;
  void shorten(const RimPath<Dual8>& path, Call& call, Prediction& out) const;
  void fill_cyclic(const Call& call, Prediction& out) const;
  [[nodiscard]] bool cyclic(int parameter) const {
    const int s = entries_.slots[static_cast<std::size_t>(parameter)];
    const bool turns_alike = floor_ == Floor::rolling && !model_.sloped;
    return s == kX || s == kY || s == kPsi || (s == kPhi && turns_alike);
  }
  [[nodiscard]] int initial_count() const { return floor_ == Floor::rolling ? 8 : kInitial; }

  std::string name_;
  Floor floor_;
  RimModel model_;
  LossValues<double> fixed_;
  bool impact_;
  Entries entries_;
};

/// One call: the request with times counted from its start.
struct RimPredictor::Call {
  const Eigen::Ref<const Eigen::VectorXd>& values;
  const PredictRequest& request;
  std::vector<double> t_s;
  RimRunOptions options;
  std::vector<World<double>> path_m;  ///< the centre at the times reached
};

int row_component(Observable what) {
  switch (what) {
    case Observable::phi_rad:
      return 0;
    case Observable::theta_rad:
      return 1;
    case Observable::psi_rad:
      return 2;
    case Observable::x_m:
      return 3;
    case Observable::y_m:
      return 4;
  }
  return 0;
}

template <class S>
RimInput<S> RimPredictor::input(const Eigen::Ref<const Eigen::VectorXd>& values) const {
  RimInput<S> in{};
  in.losses.air_ratio = fixed_.air_ratio;
  in.losses.quadratic_ratio = fixed_.quadratic_ratio;
  in.losses.eps_w = fixed_.eps_w;
  for (std::size_t i = 0; i < entries_.slots.size(); ++i)
    slot(in, entries_.slots[i]) = S(values[static_cast<Eigen::Index>(i)]);
  return in;
}

template <class S>
RimPath<S> RimPredictor::run(const RimInput<S>& in, const Call& call) const {
  switch (floor_) {
    case Floor::rolling:
      return run_rolling(model_, in, call.options, call.t_s);
    case Floor::smooth:
      return run_smooth(model_, in, call.options, call.t_s);
    case Floor::sliding:
      break;
  }
  return run_sliding(model_, in, call.options, call.t_s);
}

/// A run's path as far as it was asked for. A body that falls from the least tilt the model follows
/// is on its face within a millisecond.
template <class S>
RimPath<S> RimPredictor::seen(RimPath<S> path, const Call& call) const {
  if (path.end.outcome != Outcome::flat || !call.request.lies_where_it_fell) return path;
  const State<S, 10>& y = path.end.y;
  const double tilt_rad = value_of(y[Rim::theta]) < 0.5 * data::kPi ? 0.0 : data::kPi;
  path.rows.resize(call.t_s.size(), {y[Rim::phi], S(tilt_rad), y[Rim::psi], y[Rim::x], y[Rim::y]});
  return path;
}

/// Initial-state parameters that describe the state at the end of a run.
template <class S>
std::array<S, kInitial> end_parameters(const RimBody& given, const RimRunEnd<S>& end) {
  RimBody body = given;
  body.side = end.side;
  const State<S, 10>& y = end.y;
  const S vn = y[Rim::un] - body.R * y[Rim::w3] + body.signed_h() * y[Rim::w2];
  const S vt = y[Rim::ut] - tilt(body, y[Rim::theta]).z * y[Rim::w1];
  const World<S> v = world_from_node(Horizontal<S>{vn, vt}, y[Rim::phi]);
  return {y[Rim::theta], y[Rim::phi], y[Rim::psi], y[Rim::w1], y[Rim::w2],
          y[Rim::w3],    y[Rim::x],   y[Rim::y],   v.x,        v.y};
}

template <class S>
void RimPredictor::fill_values(const RimPath<S>& path, Call& call, Prediction& out) const {
  const auto& wanted = call.request.observables;
  const auto stride = static_cast<Eigen::Index>(wanted.size());
  for (const auto& row : path.rows) call.path_m.push_back({value_of(row[3]), value_of(row[4])});
  for (std::size_t n = 0; n < path.rows.size(); ++n)
    for (std::size_t o = 0; o < wanted.size(); ++o)
      out.values[static_cast<Eigen::Index>(n) * stride + static_cast<Eigen::Index>(o)] =
          value_of(path.rows[n][row_component(wanted[o])]);
  out.outcome = path.end.outcome;
  out.valid_until_s = call.request.start_s + path.end.end_s;
  out.steps = path.end.work;
  if (!call.request.want_end_state) return;
  const auto end = end_parameters(model_.body, path.end);
  out.end_state.resize(initial_count());
  for (int i = 0; i < initial_count(); ++i) out.end_state[i] = value_of(end[i]);
}

void RimPredictor::fill_lanes(const RimPath<Dual8>& path, const Call& call,
                              const std::vector<int>& columns, Prediction& out) const {
  const auto& wanted = call.request.observables;
  const auto stride = static_cast<Eigen::Index>(wanted.size());
  const std::size_t known = std::min(path.rows.size(), call.path_m.size());
  for (std::size_t lane = 0; lane < columns.size(); ++lane) {
    auto column = out.jacobian.col(columns[lane]);
    for (std::size_t n = 0; n < known; ++n)
      for (std::size_t o = 0; o < wanted.size(); ++o)
        column[static_cast<Eigen::Index>(n) * stride + static_cast<Eigen::Index>(o)] =
            path.rows[n][row_component(wanted[o])].derivative[lane];
  }
  if (!call.request.want_end_state) return;
  const auto end = end_parameters(model_.body, path.end);
  for (std::size_t lane = 0; lane < columns.size(); ++lane)
    for (int i = 0; i < initial_count(); ++i)
      out.end_state_jacobian(i, columns[lane]) = end[i].derivative[lane];
}

/// More parameters than lanes take several runs of the same motion, each with steps of its own: it
/// is known as far as the one that ends first.
void RimPredictor::shorten(const RimPath<Dual8>& path, Call& call, Prediction& out) const {
  if (path.rows.size() >= call.path_m.size()) return;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::size_t missing = call.request.t_s.size() - path.rows.size();
  const auto rows = static_cast<Eigen::Index>(missing * call.request.observables.size());
  out.values.tail(rows).setConstant(kNan);
  out.jacobian.bottomRows(rows).setConstant(kNan);
  out.outcome = path.end.outcome;
  out.valid_until_s = call.request.start_s + path.end.end_s;
  call.path_m.resize(path.rows.size());
}

/// A shift of the start shifts the path, a turn of the start turns it about the start: derivative
/// of what is seen by the cyclic parameter `by` when the centre is at `from_start` of its start.
double cyclic_rate(int by, Observable what, const World<double>& from_start) {
  if (by == kX) return what == Observable::x_m ? 1.0 : 0.0;
  if (by == kY) return what == Observable::y_m ? 1.0 : 0.0;
  if (by == kPsi) return what == Observable::psi_rad ? 1.0 : 0.0;
  if (what == Observable::x_m) return -from_start.y;
  if (what == Observable::y_m) return from_start.x;
  return what == Observable::phi_rad ? 1.0 : 0.0;
}

void RimPredictor::fill_cyclic(const Call& call, Prediction& out) const {
  const auto& wanted = call.request.observables;
  const double x0 = call.values[kX], y0 = call.values[kY];
  for (std::size_t c = 0; c < call.request.derivatives.size(); ++c) {
    const int parameter = call.request.derivatives[c];
    if (!cyclic(parameter)) continue;
    const int by = entries_.slots[static_cast<std::size_t>(parameter)];
    const auto column = static_cast<Eigen::Index>(c);
    Eigen::Index row = 0;
    for (const World<double>& at : call.path_m)
      for (const Observable what : wanted)
        out.jacobian(row++, column) = cyclic_rate(by, what, {at.x - x0, at.y - y0});
    if (!call.request.want_end_state) continue;
    out.end_state_jacobian.col(column).setZero();
    const World<double> end{out.end_state[kX] - x0, out.end_state[kY] - y0};
    constexpr std::pair<int, Observable> kSeen[] = {{kPhi, Observable::phi_rad},
                                                    {kPsi, Observable::psi_rad},
                                                    {kX, Observable::x_m},
                                                    {kY, Observable::y_m}};
    for (const auto& [index, what] : kSeen)
      out.end_state_jacobian(index, column) = cyclic_rate(by, what, end);
  }
}

/// Enough for minutes of motion; run_sliding() may raise it to what stability needs.
constexpr int kMostSteps = 300000;

unsigned components_of(const PredictRequest& request) {
  constexpr int kState[] = {Rim::phi, Rim::theta, Rim::psi, Rim::x, Rim::y};
  unsigned mask = 1u << Rim::x | 1u << Rim::y;  // the derivative by phi needs both
  for (const Observable what : request.observables) mask |= 1u << kState[row_component(what)];
  return mask;
}

Prediction RimPredictor::predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                 const PredictRequest& request) const {
  check_request(*this, values, request);
  Call call{values, request, since_start_s(request), {}, {}};
  call.options.tolerance = request.tolerance;
  // Rows are read off steps: where none but the start is asked for, one is made all the same.
  constexpr double kInstant_s = 1e-9;
  call.options.end_s = call.t_s.empty() ? 0.0 : std::max(call.t_s.back(), kInstant_s);
  call.options.impact_at_rim = impact_;
  call.options.max_steps =
      request.max_steps > 0 ? std::min(request.max_steps, kMostSteps) : kMostSteps;
  call.options.components = components_of(request);
  // Sliding that starts from rest turns the faster the slower it is: a threshold of sticking far
  // below what the tolerance resolves would cost ten times the steps.
  constexpr double kFinest = 1e-7;
  call.options.stick_factor = std::max(1.0, request.tolerance / kFinest);
  call.options.skips_onset = true;
  call.options.rolls_at_first = request.rolls_at_first;

  Prediction out = unknown_prediction(request);
  if (request.want_end_state) out.end_state_jacobian.resize(initial_count(), out.jacobian.cols());
  std::vector<int> active;  // columns that need a lane
  for (std::size_t c = 0; c < request.derivatives.size(); ++c)
    if (!cyclic(request.derivatives[c])) active.push_back(static_cast<int>(c));
  if (active.empty()) fill_values(seen(run(input<double>(values), call), call), call, out);
  for (std::size_t from = 0; from < active.size(); from += Dual8::kLanes) {
    const std::size_t to = std::min(active.size(), from + Dual8::kLanes);
    const std::vector<int> columns(active.begin() + static_cast<std::ptrdiff_t>(from),
                                   active.begin() + static_cast<std::ptrdiff_t>(to));
    RimInput<Dual8> in = input<Dual8>(values);
    for (std::size_t lane = 0; lane < columns.size(); ++lane) {
      const int parameter = request.derivatives[static_cast<std::size_t>(columns[lane])];
      set_lane(slot(in, entries_.slots[static_cast<std::size_t>(parameter)]).derivative, lane, 1.0);
    }
    const RimPath<Dual8> path = seen(run(in, call), call);
    if (from == 0) fill_values(path, call, out);
    fill_lanes(path, call, columns, out);
    shorten(path, call, out);
  }
  fill_cyclic(call, out);
  return out;
}

}  // namespace

std::unique_ptr<Predictor> make_rolling(const data::Scene& scene) {
  return std::make_unique<RimPredictor>(scene, Floor::rolling, "rolling");
}
std::unique_ptr<Predictor> make_smooth(const data::Scene& scene) {
  return std::make_unique<RimPredictor>(scene, Floor::smooth, "smooth");
}
std::unique_ptr<Predictor> make_sliding(const data::Scene& scene) {
  return std::make_unique<RimPredictor>(scene, Floor::sliding, "sliding");
}

}  // namespace trochoid::model
