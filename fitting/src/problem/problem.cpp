#include "problem/problem.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "observe/camera_off.hpp"
#include "observe/observed.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {

using model::ParameterInfo;

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

Problem make_problem(const model::Predictor& predictor, std::vector<ArcData> arcs,
                     const data::Scene& scene) {
  check_settings(predictor, scene.fit);
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

}  // namespace trochoid::fitting
