#include <optional>
#include <utility>
#include <vector>

#include "observe/camera_error.hpp"
#include "observe/camera_off.hpp"
#include "observe/observed.hpp"
#include "problem/problem.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {

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
