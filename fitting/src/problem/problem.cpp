#include "problem/problem.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "observe/angles.hpp"
#include "observe/camera_error.hpp"
#include "observe/camera_off.hpp"
#include "observe/observed.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {

using model::ParameterInfo;

double Transform::value(double u) const {
  switch (kind) {
    case Kind::log:
      return std::exp(u);
    case Kind::above:
      return lower + std::exp(u);
    case Kind::below:
      return upper - std::exp(u);
    case Kind::limited:
      return upper / (1.0 + std::exp(-u));
    case Kind::between:
      return lower + 0.5 * (upper - lower) * (1.0 + std::tanh(u));
    default:
      return u;
  }
}

double Transform::slope(double u) const {
  switch (kind) {
    case Kind::log:
    case Kind::above:
      return std::exp(u);
    case Kind::below:
      return -std::exp(u);
    case Kind::limited: {
      const double share = 1.0 / (1.0 + std::exp(-u));
      return upper * share * (1.0 - share);
    }
    case Kind::between: {
      const double t = std::tanh(u);
      return 0.5 * (upper - lower) * (1.0 - t * t);
    }
    default:
      return 1.0;
  }
}

double Transform::inverse(double value) const {
  constexpr double kLeast = 1e-300, kLeastShare = 1e-9, kMostShare = 1.0 - 1e-12;
  switch (kind) {
    case Kind::log:
      return std::log(std::max(value, kLeast));
    case Kind::above:
      return std::log(std::max(value - lower, kLeastShare * inside));
    case Kind::below:
      return std::log(std::max(upper - value, kLeastShare * inside));
    case Kind::limited: {
      const double share = std::clamp(value / upper, kLeast, kMostShare);
      return std::log(share / (1.0 - share));
    }
    case Kind::between: {
      const double t = 2.0 * (value - lower) / (upper - lower) - 1.0;
      return std::atanh(std::clamp(t, -kMostShare, kMostShare));
    }
    default:
      return value;
  }
}

double Transform::start(double value) const {
  constexpr double kShare = 1e-3;
  switch (kind) {
    case Kind::above:
      return inverse(std::max(value, lower + inside));
    case Kind::below:
      return inverse(std::min(value, upper - inside));
    case Kind::limited:
      return inverse(std::min(value, (1.0 - kShare) * upper));
    case Kind::between: {
      const double margin = 0.5 * kShare * (upper - lower);
      return inverse(std::clamp(value, lower + margin, upper - margin));
    }
    default:
      return inverse(value);
  }
}

std::pair<double, double> Transform::limits() const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  switch (kind) {
    case Kind::log:
      return {0.0, kInfinity};
    case Kind::above:
      return {lower, kInfinity};
    case Kind::below:
      return {-kInfinity, upper};
    case Kind::limited:
      return {0.0, upper};
    case Kind::between:
      return {lower, upper};
    default:
      return {-kInfinity, kInfinity};
  }
}

bool Problem::frees_camera() const {
  return first_camera_off(*predictor) >= 0;
}

int Problem::shared_count() const {
  return static_cast<int>(
      std::count_if(free.begin(), free.end(), [](const FreeParameter& p) { return p.arc < 0; }));
}

std::string Problem::name(int free_index) const {
  const FreeParameter& parameter = free[free_index];
  const std::string& plain = predictor->parameters()[parameter.index].name;
  return parameter.arc > 0 ? fmt::format("{}@{}", plain, parameter.arc) : plain;
}

std::vector<int> Problem::columns_of(int arc) const {
  std::vector<int> columns;
  for (int i = 0; i < static_cast<int>(free.size()); ++i)
    if (free[i].arc < 0 || free[i].arc == arc) columns.push_back(i);
  return columns;
}

Eigen::VectorXd Problem::start() const {
  return of_base(&Transform::start);
}

Eigen::VectorXd Problem::here() const {
  return of_base(&Transform::inverse);
}

Eigen::VectorXd Problem::of_base(double (Transform::*u_of)(double) const) const {
  Eigen::VectorXd u(free.size());
  for (int i = 0; i < static_cast<int>(free.size()); ++i)
    u[i] = (free[i].transform.*u_of)(base[std::max(0, free[i].arc)][free[i].index]);
  return u;
}

RollingVelocity rolling_velocity(const model::Predictor& predictor, const Eigen::VectorXd& values,
                                 const std::vector<int>& derivatives) {
  constexpr std::array<double, 1> kStart_s{0.0};
  model::PredictRequest request;
  request.t_s = kStart_s;
  request.derivatives = derivatives;
  request.want_end_state = request.rolls_at_first = true;
  const model::Prediction start = predictor.predict(values, request);
  const std::vector<int> velocity{predictor.index_of("vx_m_s"), predictor.index_of("vy_m_s")};
  RollingVelocity result{start.end_state(velocity), {}};
  if (!derivatives.empty()) result.by = start.end_state_jacobian(velocity, Eigen::all);
  return result;
}

Eigen::VectorXd Problem::values(int arc, const Eigen::VectorXd& u) const {
  Eigen::VectorXd values = base[arc];
  for (const int i : columns_of(arc)) values[free[i].index] = free[i].transform.value(u[i]);
  return values;
}

double Problem::value(int free_index, const Eigen::VectorXd& u) const {
  return free[free_index].transform.value(u[free_index]);
}

void Problem::set_base(const Eigen::VectorXd& u) {
  for (int arc = 0; arc < static_cast<int>(arcs.size()); ++arc) {
    Eigen::VectorXd sign;
    base[arc] = values(arc, u);
    fold_tilt(*predictor, base[arc], sign);
    const int vx = predictor->index_of("vx_m_s"), vy = predictor->index_of("vy_m_s");
    if (!rolls_at_first || vx < 0) continue;  // an easier model may have none
    const Eigen::Vector2d v_m_s = rolling_velocity(*predictor, base[arc]).m_s;
    base[arc][vx] = v_m_s.x();
    base[arc][vy] = v_m_s.y();
  }
}

int Problem::max_steps() const {
  // Motion that a camera follows turns less than once per sample; a step covers a good part of a
  // turn. Sliding changes its direction fast wherever it is slow.
  std::size_t samples = 0;
  for (const ArcData& arc : arcs) samples = std::max(samples, arc.t_s.size());
  const bool slides = predictor->model_name() == "sliding";
  const int steps = (slides ? 20000 : 2000) + 20 * static_cast<int>(samples);
  // A search may give up what a polish, finer, has to follow to the end.
  constexpr double kSearching = 1e-8, kPower = 0.25, kMost = 15.0;
  return static_cast<int>(steps * std::clamp(std::pow(kSearching / tolerance, kPower), 1.0, kMost));
}

int Problem::rows() const {
  int rows = 0;
  for (const ArcData& arc : arcs) rows += arc.rows;
  return rows;
}

std::string Shortfalls::words() const {
  int all = 0;
  std::size_t commonest = 0;
  for (std::size_t i = 0; i < by_outcome.size(); ++i) {
    all += by_outcome[i];
    if (by_outcome[i] > by_outcome[commonest]) commonest = i;
  }
  constexpr int kFew = 24;  // a search begins with as many
  if (track >= 0 && samples < kFew)
    return fmt::format("track {}: its {} samples are too few to find its motion from; leave it out",
                       track + 1, samples.load());
  const std::string where = track >= 0 ? fmt::format("track {}: ", track + 1) : "";
  if (departed > all)
    return fmt::format(
        "{}the model does not move as the track does: of {} starts none explains more than a part "
        "of it",
        where, departed.load());
  if (all == 0)
    return where +
           "no start could be made from the track: is it too short, or does nothing in it move as "
           "the model does?";
  std::string_view ending = model::sentence(static_cast<model::Outcome>(commonest));
  ending.remove_suffix(ending.ends_with('.') ? 1 : 0);
  return fmt::format(
      "{}no start led to a prediction of the whole track: {} attempts ended before it, {} of them "
      "so: {}; are the body's dimensions, the scale and the frame rate right?",
      where, all, by_outcome[commonest].load(), ending);
}

Problem in_stated_sigmas(Problem problem, Weights weights) {
  for (ArcData& arc : problem.arcs) arc.noise_scale.fill(1.0);
  if (weights == Weights::dropped)
    for (Eigen::VectorXd& of_arc : problem.row_weights) of_arc.resize(0);
  return problem;
}

Problem single_arc(const Problem& problem, int arc) {
  Problem part = problem;
  part.arcs = {problem.arcs[arc]};
  part.base = {problem.base[arc]};
  part.row_weights = {problem.row_weights[arc]};
  part.free.clear();
  for (FreeParameter parameter : problem.free)
    if (parameter.arc < 0 || parameter.arc == arc) {
      parameter.arc = std::min(parameter.arc, 0);
      part.free.push_back(parameter);
    }
  return part;
}

bool is_loss(const Problem& problem, const FreeParameter& parameter) {
  const model::ParameterInfo& info = problem.predictor->parameters()[parameter.index];
  return info.role == model::ParameterInfo::Role::dynamics && info.name != "a_1_s2" &&
         info.name != "b_1_s" && info.name != "l_m" && info.name != "friction" &&
         info.name != kSlipScale && !is_slope(info.name);
}

namespace {

bool listed(const std::vector<std::string>& names, const std::string& name) {
  return std::any_of(names.begin(), names.end(),
                     [&](const std::string& entry) { return means(entry, name); });
}

void check_names(const model::Predictor& predictor, const data::FitSettings& settings) {
  const auto known = [&](const std::string& name) {
    return std::any_of(predictor.parameters().begin(), predictor.parameters().end(),
                       [&](const ParameterInfo& info) { return means(name, info.name); });
  };
  const auto complain = [&](const std::string& key, const std::string& name) {
    std::string all;
    for (const ParameterInfo& info : predictor.parameters())
      all += (all.empty() ? "" : ", ") + info.name;
    throw InputError(
        fmt::format("[fit] {}: model '{}' has no parameter '{}'; it has {}, and those of losses "
                    "named under [model]",
                    key, predictor.model_name(), name, all));
  };
  for (const std::string& name : settings.free)
    if (!known(name)) complain("free", name);
  for (const auto& [name, value] : settings.fixed)
    if (!known(name)) complain("fixed", name);
  for (const auto& [name, bounds] : settings.bounds)
    if (!known(name)) complain("bounds", name);
}

// A value the model cannot have would be refused at every attempt of the search, and a prior about
// one would bend all the others. Attitudes are folded into their range.
void check_values(const model::Predictor& predictor, const data::FitSettings& settings) {
  constexpr double kSure = 3.0;  // standard deviations
  for (const ParameterInfo& info : predictor.parameters()) {
    const data::Prior* prior = said_of(info.name, settings.prior);
    const auto refuse_prior = [&](double lower, double upper, const char* whose) {
      if (prior != nullptr && !(prior->value + kSure * prior->sigma >= lower &&
                                prior->value - kSure * prior->sigma <= upper))
        throw InputError(fmt::format("[fit] prior: {} = {} ± {} lies outside {} {} .. {}",
                                     info.name, prior->value, prior->sigma, whose, lower, upper));
    };
    if (const auto* bounds = said_of(info.name, settings.bounds))
      refuse_prior(bounds->first, bounds->second, "its bounds");
    if (info.role == ParameterInfo::Role::initial) continue;
    refuse_prior(info.lower, info.upper, "what the model can have,");
    if (const double* value = said_of(info.name, settings.fixed);
        value != nullptr && !(*value >= info.lower && *value <= info.upper))
      throw InputError(fmt::format("[fit] fixed: {} = {} must lie between {} and {}", info.name,
                                   *value, info.lower, info.upper));
  }
}

// A thousandth of the bound's size or the parameter's: of a coefficient, known by its decades, what
// the scene gives; of a state, what such bodies have.
double inside_of(const ParameterInfo& info, double bound) {
  constexpr double kShare = 1e-3, kUsual_m = 0.1;
  double usual = info.unit == "rad" || info.unit == "rad/s" || info.unit == "1/s" ? 1.0 : kUsual_m;
  if (info.logarithmic) usual = std::numeric_limits<double>::min() / kShare;
  return kShare * std::max({std::abs(bound), std::abs(info.value), usual});
}

Transform transform_of(const ParameterInfo& info, const std::string& model,
                       const data::FitSettings& settings) {
  if (const auto* bounds = said_of(info.name, settings.bounds)) {
    const auto [lower, upper] = *bounds;
    const bool low = std::isfinite(lower), high = std::isfinite(upper);
    // What cannot be negative is no more so for a bound from above.
    const bool from_zero = info.logarithmic && !(lower > 0.0);
    if (high && from_zero && upper > 0.0) return {Transform::Kind::between, 0.0, upper};
    if (low && high) return {Transform::Kind::between, lower, upper};
    if (low && !from_zero) return {Transform::Kind::above, lower, upper, inside_of(info, lower)};
    if (high) return {Transform::Kind::below, lower, upper, inside_of(info, upper)};
  }
  // Beyond a coefficient of about 1.1 a disc on its rim has no consistent contact (Painleve).
  constexpr double kMostFriction = 1.1;
  if (info.name == "friction" && model == "sliding")
    return {Transform::Kind::limited, 0.0, std::max(kMostFriction, 1.5 * info.value)};
  if (is_slope(info.name)) return {Transform::Kind::between, info.lower, info.upper};
  if (info.name == "contact_radius_m") return {Transform::Kind::limited, 0.0, info.upper};
  if (info.name == kSlipScale) {
    const double sharpest_m_s = std::min(kSharpest_m_s, 0.5 * info.value);
    return {Transform::Kind::above, sharpest_m_s, 0.0, 1e-3 * sharpest_m_s};
  }
  return {info.logarithmic ? Transform::Kind::log : Transform::Kind::identity, 0.0, 0.0};
}

bool is_pivot(const std::string& name) {
  return name == "pivot_x_m" || name == "pivot_y_m";
}

bool is_free(const ParameterInfo& info, const data::FitSettings& settings) {
  if (said_of(info.name, settings.fixed) != nullptr) return false;
  for (const char* asked_for : {kScale, kTimeFactor, kReadout, kAngleDelay})
    if (info.name == asked_for) return true;
  if (is_pivot(info.name) && settings.free_pivot) return true;
  // What is known to some error only is to be fitted.
  if (is_pivot(info.name))
    return listed(settings.free, info.name) || settings.prior.contains(info.name);
  if ((info.name == kSlipScale || is_slope(info.name)) && settings.prior.contains(info.name))
    return true;
  const bool chosen = !std::all_of(settings.free.begin(), settings.free.end(), leaves_choice);
  if (!chosen || info.role == ParameterInfo::Role::initial)
    return info.worth_fitting || listed(settings.free, info.name);
  return listed(settings.free, info.name);
}

}  // namespace

bool tells_of_a_film(const data::Scene& scene) {
  const auto told = [](const auto& said) { return said.contains("gap_viscosity_Pa_s"); };
  return scene.model.gap_viscosity_Pa_s.value_or(0.0) >= kThickestAir_Pa_s ||
         told(scene.fit.fixed) || told(scene.fit.prior) || told(scene.fit.bounds);
}

bool means(const std::string& entry, const std::string& parameter) {
  return parameter == entry || (parameter.starts_with(entry) && parameter[entry.size()] == '[');
}

bool is_slope(const std::string& name) {
  return name == kSlopeX || name == kSlopeY;
}

bool leaves_choice(const std::string& name) {
  return is_pivot(name) || is_slope(name) || name == kReadout || name == kAngleDelay ||
         name == kSlipScale;
}

const data::Prior* prior_of(const std::string& parameter, int arc,
                            const data::FitSettings& settings) {
  if (arc >= 0)
    if (const auto own = settings.prior.find(fmt::format("{}@{}", parameter, arc));
        own != settings.prior.end())
      return &own->second;
  return said_of(parameter, settings.prior);
}

FreeParameter free_parameter(const model::Predictor& predictor, const data::FitSettings& settings,
                             int index, int arc, double value) {
  const ParameterInfo& info = predictor.parameters()[index];
  FreeParameter parameter{index, arc, transform_of(info, predictor.model_name(), settings), {}, {}};
  parameter.given = value;
  parameter.turns = info.name == "phi_rad" || info.name == "psi_rad";
  if (const auto* prior = prior_of(info.name, arc, settings)) parameter.prior = *prior;
  return parameter;
}

double off_prior(const data::Prior& prior, double value, bool turns) {
  const double off = value - prior.value;
  return (turns ? data::wrapped(off) : off) / prior.sigma;
}

Problem make_problem(const model::Predictor& predictor, std::vector<ArcData> arcs,
                     const data::Scene& scene) {
  check_names(predictor, scene.fit);
  check_values(predictor, scene.fit);
  Problem problem;
  problem.predictor = &predictor;
  problem.arcs = std::move(arcs);
  const auto& parameters = predictor.parameters();
  const int count = static_cast<int>(parameters.size());
  Eigen::VectorXd values(count);
  for (int i = 0; i < count; ++i) {
    const double* fixed = said_of(parameters[i].name, scene.fit.fixed);
    values[i] = fixed != nullptr ? *fixed : parameters[i].value;
  }
  problem.base.assign(problem.arcs.size(), values);
  problem.row_weights.resize(problem.arcs.size());
  problem.timing = timing_of(predictor, scene);
  const auto add = [&](int index, int arc) {
    FreeParameter parameter = free_parameter(predictor, scene.fit, index, arc, values[index]);
    // What is known of the camera widens the error bars; a model that is not the whole truth must
    // not bend it.
    const std::string& name = parameters[index].name;
    const bool camera = name == kScale || name == kTimeFactor;
    if (camera && parameter.prior && !scene.fit.free_scale) {
      parameter.held = true;
      for (Eigen::VectorXd& base : problem.base) base[index] = parameter.prior->value;
    }
    problem.free.push_back(parameter);
  };
  for (int i = 0; i < count; ++i)
    if (parameters[i].role != ParameterInfo::Role::initial && is_free(parameters[i], scene.fit))
      add(i, -1);
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc)
    for (int i = 0; i < count; ++i)
      if (parameters[i].role == ParameterInfo::Role::initial && is_free(parameters[i], scene.fit))
        add(i, arc);
  return problem;
}

void fold_tilt(const model::Predictor& predictor, Eigen::VectorXd& values, Eigen::VectorXd& sign) {
  sign = Eigen::VectorXd::Ones(values.size());
  const int theta = predictor.index_of("theta_rad"), phi = predictor.index_of("phi_rad");
  if (theta < 0 || phi < 0) return;
  const double turn = data::kTurn;
  double tilt = std::fmod(values[theta], turn);
  if (tilt < 0.0) tilt += turn;
  const bool folded = tilt > data::kPi;
  values[theta] = folded ? turn - tilt : tilt;
  if (!folded) return;
  // (-theta, phi) and (theta, phi + pi) point the axis the same way; the node line turns over.
  values[phi] += data::kPi;
  sign[theta] = -1.0;
  for (const char* rate : {"dtheta_rad_s", "w1_rad_s", "w2_rad_s"})
    if (const int i = predictor.index_of(rate); i >= 0) {
      values[i] = -values[i];
      sign[i] = -1.0;
    }
  if (const int psi = predictor.index_of("psi_rad"); psi >= 0) values[psi] -= data::kPi;
}

void name_attitudes(Problem& problem) {
  const model::Predictor& predictor = *problem.predictor;
  const int theta = predictor.index_of("theta_rad"), phi = predictor.index_of("phi_rad");
  if (theta < 0 || phi < 0) return;
  const auto may_be_anything = [&](int index) {
    const auto is_it = [&](const FreeParameter& p) { return p.index == index; };
    const auto spoken_of = [&](const FreeParameter& p) {
      return is_it(p) && (p.prior || p.transform.kind != Transform::Kind::identity);
    };
    const auto& free = problem.free;
    return std::any_of(free.begin(), free.end(), is_it) &&
           std::none_of(free.begin(), free.end(), spoken_of);
  };
  // Along axes that turn round with the name.
  const std::array<int, 2> turning{predictor.index_of("w1_rad_s"), predictor.index_of("w3_rad_s")};
  if (!may_be_anything(theta) || !may_be_anything(phi)) return;
  for (const int rate : turning)
    if (rate >= 0 && !may_be_anything(rate)) return;
  for (std::size_t arc = 0; arc < problem.arcs.size(); ++arc) {
    Eigen::VectorXd& values = problem.base[arc];
    const bool marked = problem.arcs[arc].observable_index(model::Observable::psi_rad) >= 0;
    if (problem.arcs[arc].folded && !marked && values[theta] > 0.5 * data::kPi) {
      values[theta] = data::kPi - values[theta];
      values[phi] += data::kPi;
      for (const int rate : turning)
        if (rate >= 0) values[rate] = -values[rate];
    }
    values[phi] = data::wrapped(values[phi]);
  }
}

namespace {

// A step with up to eight derivatives costs about six plain ones.
void count_work(const Problem& problem, std::size_t derivatives, int steps) {
  if (!problem.work) return;
  const double times = derivatives == 0 ? 1.0 : 6.0 * static_cast<double>((derivatives + 7) / 8);
  *problem.work += times * steps;
}

// What the model says an arc would show at these values.
model::PredictRequest request_of(const Problem& problem, const ArcData& data) {
  model::PredictRequest request;
  request.t_s = data.t_s;
  request.start_s = data.start_s;
  request.observables = data.observables;
  request.tolerance = problem.tolerance;
  request.max_steps = problem.max_steps();
  request.lies_where_it_fell = true;
  request.rolls_at_first = problem.rolls_at_first;
  return request;
}
model::Prediction predicted(const Problem& problem, const ArcData& data,
                            const Eigen::VectorXd& values, const model::PredictRequest& request) {
  return has_timing(*problem.predictor)
             ? predict_timed(*problem.predictor, values, request, data, problem.timing)
             : problem.predictor->predict(values, request);
}

// Residuals of what a camera would have measured that is off by as much less.
void measure_by_right_camera(const Problem& problem, const ArcData& data,
                             const Eigen::VectorXd& values, const std::vector<int>& columns,
                             Eigen::VectorXd& residuals, Eigen::MatrixXd* jacobian) {
  const Eigen::Index first = first_camera_off(*problem.predictor);
  for (std::size_t k = 0; k < data.camera_shifts.size(); ++k) {
    const Eigen::Index index = first + static_cast<Eigen::Index>(k);
    const Eigen::VectorXd shift = whitened(data, data.camera_shifts[k]);
    residuals -= values[index] * shift;
    for (std::size_t c = 0; jacobian != nullptr && c < columns.size(); ++c)
      if (problem.free[columns[c]].index == index)
        jacobian->col(static_cast<Eigen::Index>(c)) -= shift;
  }
}

}  // namespace

std::optional<double> falls_at_s(const Problem& problem, const Eigen::VectorXd& u) {
  Eigen::VectorXd values = problem.values(0, u), sign;
  if (!values.allFinite()) return std::nullopt;
  fold_tilt(*problem.predictor, values, sign);
  const ArcData& data = problem.arcs[0];
  try {
    const model::Prediction run = predicted(problem, data, values, request_of(problem, data));
    count_work(problem, 0, run.steps);
    if (run.outcome == model::Outcome::flat) return run.valid_until_s;
  } catch (const Error&) {  // outside the model's range
  }
  return std::nullopt;
}

bool evaluate(const Problem& problem, int arc, const Eigen::VectorXd& u, Eigen::VectorXd& residuals,
              Eigen::MatrixXd* jacobian, bool held_too) {
  const ArcData& data = problem.arcs[arc];
  Eigen::VectorXd values = problem.values(arc, u);
  if (!values.allFinite()) return false;
  Eigen::VectorXd sign;
  fold_tilt(*problem.predictor, values, sign);
  const std::vector<int> columns = problem.columns_of(arc);
  model::PredictRequest request = request_of(problem, data);
  if (jacobian != nullptr)
    for (const int i : columns)
      if (held_too || !problem.free[i].held) request.derivatives.push_back(problem.free[i].index);
  model::Prediction prediction;
  try {
    prediction = predicted(problem, data, values, request);
  } catch (const Error&) {  // outside the model's range: a rejected step
    if (problem.shortfalls) problem.shortfalls->count(model::Outcome::out_of_domain);
    return false;
  }
  count_work(problem, request.derivatives.size(), prediction.steps);
  if (jacobian != nullptr && request.derivatives.size() < columns.size()) {
    Eigen::MatrixXd all =
        Eigen::MatrixXd::Zero(prediction.values.size(), static_cast<int>(columns.size()));
    for (int c = 0, from = 0; c < static_cast<int>(columns.size()); ++c)
      if (!problem.free[columns[c]].held) all.col(c) = prediction.jacobian.col(from++);
    prediction.jacobian = std::move(all);
  }
  whiten(data, prediction.values, prediction.jacobian, residuals, jacobian);
  if (problem.frees_camera())
    measure_by_right_camera(problem, data, values, columns, residuals, jacobian);
  if (!residuals.allFinite()) {
    if (problem.shortfalls) problem.shortfalls->count(prediction.outcome);
    return false;
  }
  if (jacobian != nullptr) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const FreeParameter& parameter = problem.free[columns[c]];
      jacobian->col(c) *= sign[parameter.index] * parameter.transform.slope(u[columns[c]]);
    }
    if (!jacobian->allFinite()) return false;
  }
  for (const Reading& reading : data.readings) {
    const int width = rows_of(reading.channel);
    const double weight = robust_weight(problem, arc, reading) / noise_scale(data, reading.channel);
    if (weight == 1.0) continue;
    residuals.segment(reading.row, width) *= weight;
    if (jacobian != nullptr) jacobian->middleRows(reading.row, width) *= weight;
  }
  return true;
}

}  // namespace trochoid::fitting
