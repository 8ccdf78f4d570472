#include "observe/timing.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::fitting {
namespace {

using model::Observable;
using model::Prediction;
using model::PredictRequest;

// What is seen at any instants, also before the start: there twice the start less the mirrored
// instant.
class Continued {
 public:
  Continued(const model::Predictor& predictor, const Eigen::VectorXd& values,
            const PredictRequest& request)
      : predictor_(predictor), values_(values), request_(request) {}

  [[nodiscard]] Prediction at(const std::vector<double>& t_s) const {
    std::vector<double> asked;
    const double start_s = request_.start_s;
    const bool early = std::any_of(t_s.begin(), t_s.end(), [&](double t) { return t < start_s; });
    if (early) asked.push_back(start_s);
    for (const double t : t_s) asked.push_back(t < start_s ? 2.0 * start_s - t : t);
    std::vector<std::size_t> order(asked.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t i, std::size_t j) { return asked[i] < asked[j]; });
    std::vector<double> ascending;
    for (const std::size_t i : order) ascending.push_back(asked[i]);
    PredictRequest request = request_;
    request.t_s = ascending;
    const Prediction raw = predictor_.predict(values_, request);
    std::vector<Eigen::Index> place(asked.size());
    for (std::size_t i = 0; i < order.size(); ++i) place[order[i]] = static_cast<Eigen::Index>(i);

    const auto width = static_cast<Eigen::Index>(request_.observables.size());
    Prediction out = raw;
    const auto n = static_cast<Eigen::Index>(t_s.size());
    out.values.resize(n * width);
    out.jacobian.resize(n * width, raw.jacobian.cols());
    for (Eigen::Index i = 0; i < n; ++i) {
      const bool mirrored = t_s[static_cast<std::size_t>(i)] < start_s;
      const Eigen::Index from = width * place[static_cast<std::size_t>(i + (early ? 1 : 0))];
      const double sign = mirrored ? -1.0 : 1.0;
      out.values.segment(width * i, width) = sign * raw.values.segment(from, width);
      out.jacobian.middleRows(width * i, width) = sign * raw.jacobian.middleRows(from, width);
      if (!mirrored) continue;
      const Eigen::Index start = width * place[0];
      out.values.segment(width * i, width) += 2.0 * raw.values.segment(start, width);
      out.jacobian.middleRows(width * i, width) += 2.0 * raw.jacobian.middleRows(start, width);
    }
    return out;
  }

 private:
  const model::Predictor& predictor_;
  const Eigen::VectorXd& values_;
  const PredictRequest& request_;
};

// The same with the rate of everything seen in the last place of `rates`.
struct WithRates {
  Prediction prediction;
  Eigen::VectorXd rates;
};

WithRates with_rates(const model::Predictor& predictor, const Eigen::VectorXd& values,
                     const PredictRequest& request, const std::vector<double>& t_s,
                     bool rates_wanted) {
  WithRates out{Continued(predictor, values, request).at(t_s), {}};
  if (!rates_wanted) return out;
  // A fiftieth of the mean distance of samples: the motion is resolved by those.
  const double step_s = 0.02 * (t_s.back() - t_s.front()) /
                        std::max<double>(1.0, static_cast<double>(t_s.size()) - 1.0);
  if (!(step_s > 0.0)) throw NumericalError("a rate needs samples at two instants at least");
  PredictRequest plain = request;
  plain.derivatives.clear();
  // The later one runs beyond the last sample, where the body may have come to its end: backward.
  std::vector<double> earlier = t_s, much_earlier = t_s;
  for (double& t : earlier) t -= step_s;
  for (double& t : much_earlier) t -= 2.0 * step_s;
  const Continued path(predictor, values, plain);
  out.rates =
      (3.0 * out.prediction.values - 4.0 * path.at(earlier).values + path.at(much_earlier).values) /
      (2.0 * step_s);
  return out;
}

bool is_angle(Observable what) {
  return what != Observable::x_m && what != Observable::y_m;
}

}  // namespace

bool has_timing(const model::Predictor& predictor) {
  return predictor.index_of(kReadout) >= 0 || predictor.index_of(kAngleDelay) >= 0;
}

Timing timing_of(const model::Predictor& predictor, const data::Scene& scene) {
  Timing timing{scene.camera.readout_s, 0.0};
  if (predictor.index_of(kReadout) < 0) return timing;
  if (scene.camera.rows)
    timing.rows = *scene.camera.rows;
  else if (!scene.camera.file.empty())
    timing.rows = data::read_camera(scene.camera.file).height_px;
  else
    throw InputError(
        "[fit] readout_s is to be fitted but the image's height is unknown; give [camera] rows");
  return timing;
}

Prediction predict_timed(const model::Predictor& predictor, const Eigen::VectorXd& values,
                         const PredictRequest& request, const ArcData& arc, const Timing& timing) {
  const int readout = predictor.index_of(kReadout), delay = predictor.index_of(kAngleDelay);
  const double later_s = readout >= 0 ? values[readout] - timing.given_readout_s : 0.0;
  const double behind_s = delay >= 0 ? values[delay] : 0.0;
  const std::size_t n = arc.t_s.size();
  const auto width = static_cast<Eigen::Index>(request.observables.size());
  std::vector<double> share(n, 0.0), position_s = arc.t_s, angle_s;
  for (std::size_t i = 0; readout >= 0 && i < n; ++i) {
    if (i < arc.row_px.size() && std::isfinite(arc.row_px[i]))
      share[i] = arc.row_px[i] / std::max(1.0, timing.rows - 1.0);
    position_s[i] += later_s * share[i];
  }
  if (!std::is_sorted(position_s.begin(), position_s.end()))
    throw NumericalError("readout_s puts samples out of order");
  angle_s = position_s;
  for (double& t : angle_s) t += behind_s;

  PredictRequest inner = request;
  std::erase_if(inner.derivatives, [&](int index) { return index == readout || index == delay; });
  const bool rates = inner.derivatives.size() < request.derivatives.size();
  const WithRates at_positions = with_rates(predictor, values, inner, position_s, rates);
  const bool apart =
      delay >= 0 && std::any_of(request.observables.begin(), request.observables.end(), is_angle);
  const WithRates at_angles =
      apart ? with_rates(predictor, values, inner, angle_s, rates) : WithRates{};

  Prediction out = at_positions.prediction;
  out.jacobian.setZero(out.values.size(), static_cast<Eigen::Index>(request.derivatives.size()));
  for (Eigen::Index row = 0; row < out.values.size(); ++row) {
    const auto sample = static_cast<std::size_t>(row / width);
    const bool angle = is_angle(request.observables[static_cast<std::size_t>(row % width)]);
    const WithRates& source = apart && angle ? at_angles : at_positions;
    out.values[row] = source.prediction.values[row];
    Eigen::Index from = 0;
    for (std::size_t c = 0; c < request.derivatives.size(); ++c) {
      double& entry = out.jacobian(row, static_cast<Eigen::Index>(c));
      const int index = request.derivatives[c];
      if (index == readout)
        entry = source.rates[row] * share[sample];
      else if (index == delay)
        entry = angle ? source.rates[row] : 0.0;
      else
        entry = source.prediction.jacobian(row, from++);
    }
  }
  return out;
}

}  // namespace trochoid::fitting
