#include "judge/statistics.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "judge/directions.hpp"
#include "observe/camera_error.hpp"
#include "observe/camera_off.hpp"
#include "observe/decompositions.hpp"
#include "observe/smoothing.hpp"
#include "problem/linearise.hpp"
#include "problem/valley.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::fitting {

double natural_size(const Problem& problem, int index, const Eigen::VectorXd& u) {
  const FreeParameter& parameter = problem.free[index];
  const model::ParameterInfo& info = problem.predictor->parameters()[parameter.index];
  const double value = std::abs(problem.value(index, u));
  const ArcData& arc = problem.arcs[std::max(0, parameter.arc)];
  const double duration = std::max(arc.duration_s(), 1e-9);
  if (info.unit == "rad") return 1.0;
  if (is_slope(info.name)) return std::max(value, data::radians(0.5));  // what an eye sees
  if (info.unit == kDeviations) return 3.0;  // deviations are hardly ever larger
  // A loss that came out as nothing is known if its error is small against the given value's.
  if (info.logarithmic) return std::max({value, 0.1 * std::abs(parameter.given), 1e-300});
  if (info.unit == "s")  // a clock's error is known if it is known to a frame
    return duration / std::max<double>(1.0, static_cast<double>(arc.t_s.size()) - 1.0);
  if (info.unit == "rad/s" || info.unit == "1/s") return std::max(value, 1.0 / duration);
  double extent = 1.0;
  if (arc.observable_index(model::Observable::x_m) >= 0 && arc.t_s.size() > 1)
    extent = std::max(extent_m(arc), 1e-9);
  if (info.unit == "m") return std::max(value, extent);
  if (info.unit == "m/s") return std::max(value, extent / duration);
  return value > 0.0 ? value : 1.0;
}

namespace {

// Which way each sample of an arc may be off together with all the others.
using Ways = std::function<std::vector<Eigen::Vector2d>(const ArcData&)>;

Ways along(int axis) {
  return [axis](const ArcData& arc) {
    return std::vector<Eigen::Vector2d>(arc.t_s.size(), Eigen::Vector2d::Unit(axis));
  };
}

// To the side the face seen from above looks to, where its light differs; nowhere where that is not
// seen.
std::vector<Eigen::Vector2d> towards_seen_face(const ArcData& arc) {
  std::vector<Eigen::Vector2d> ways(arc.t_s.size(), Eigen::Vector2d::Zero());
  double upper = 1.0;  // axis 3 sticks out of the face that is seen; -1: out of the other
  int sample = -1;
  for (const Reading& reading : arc.readings) {
    if (reading.sample != sample) upper = 1.0;
    sample = reading.sample;
    const double angle = reading.value[0];
    if (reading.channel == Channel::theta && angle > 0.5 * data::kPi) upper = -1.0;
    if (reading.channel == Channel::phi)
      ways[static_cast<std::size_t>(sample)] =
          upper * Eigen::Vector2d(std::sin(angle), -std::cos(angle));
  }
  return ways;
}

// What an offset that all readings of a channel have in common, in all recordings alike, does to
// the residuals: a tracker may be off altogether (light, shadow, camera), and no number of samples
// averages that away. As a rule by half of what readings scatter by, and where they scatter by much
// less than the tracker expects, by a quarter of that (of the filmed bodies of docs/trust.md).
Eigen::VectorXd common_offset(const Problem& problem, const Linearised& all, Channel channel,
                              const Ways& ways) {
  constexpr double kOfScatter = 0.5, kOfStated = 0.25;
  Eigen::VectorXd rows = Eigen::VectorXd::Zero(all.jacobian.rows());
  std::vector<double> sizes, scales;
  int first = 0;
  for (int a = 0; a < static_cast<int>(problem.arcs.size()); ++a) {
    const ArcData& arc = problem.arcs[static_cast<std::size_t>(a)];
    const std::vector<Eigen::Vector2d> way = ways(arc);
    const int width = rows_of(channel);
    const double scale = noise_scale(arc, channel);
    for (const Reading& reading : arc.readings) {
      if (reading.channel != channel || !arc.filmed) continue;
      const Eigen::Vector2d row =
          reading.whitener.transpose() * way[static_cast<std::size_t>(reading.sample)] / scale;
      rows.segment(first + reading.row, width) =
          robust_weight(problem, a, reading) * row.head(width);
      scales.push_back(scale);
      if (!row.isZero()) sizes.push_back(row.head(width).norm());
    }
    first += arc.rows;
  }
  const double typical = median_or_zero(std::move(sizes));
  if (!(typical > 0.0)) return rows;
  return std::max(kOfScatter, kOfStated / median_or_zero(std::move(scales))) / typical * rows;
}

// What the camera's likely deviations do to the residuals of all channels, one each.
std::vector<Eigen::VectorXd> camera_offsets(const Problem& problem, const Linearised& all) {
  std::vector<Eigen::VectorXd> out(problem.arcs.front().camera_shifts.size(),
                                   Eigen::VectorXd::Zero(all.jacobian.rows()));
  int first = 0;
  for (int a = 0; a < static_cast<int>(problem.arcs.size()); ++a) {
    const ArcData& arc = problem.arcs[static_cast<std::size_t>(a)];
    for (std::size_t k = 0; k < out.size(); ++k) {
      Eigen::VectorXd rows = whitened(arc, arc.camera_shifts[k]);
      for (const Reading& reading : arc.readings)
        rows.segment(reading.row, rows_of(reading.channel)) *=
            robust_weight(problem, a, reading) / noise_scale(arc, reading.channel);
      out[k].segment(first, arc.rows) = rows;
    }
    first += arc.rows;
  }
  return out;
}

data::NullVector null_vector(const Problem& problem, const Eigen::VectorXd& direction, double sd) {
  data::NullVector vector;
  std::string list;
  for (Eigen::Index i = 0; i < direction.size(); ++i) {
    const std::string name = problem.name(static_cast<int>(i));
    vector.components[name] = direction[i];
    if (std::abs(direction[i]) < 0.25) continue;
    list += fmt::format("{}{} ({:+.2f})", list.empty() ? "" : ", ", name, direction[i]);
  }
  vector.words = std::isfinite(sd)
                     ? fmt::format(
                           "the data hardly see the direction {}: moved together they are "
                           "uncertain by {:.3g} of their size",
                           list, sd)
                     : fmt::format("the data do not see the direction {}", list);
  return vector;
}

}  // namespace

namespace {

// What was known beforehand stays known, however the data's share was widened.
void heed_priors(const Problem& problem, Eigen::MatrixXd& covariance) {
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    if (!problem.free[i].prior) continue;
    const double known = problem.free[i].prior->sigma * problem.free[i].prior->sigma;
    if (!(covariance(i, i) > known)) continue;
    const Eigen::VectorXd column = covariance.col(i);
    covariance -= (covariance(i, i) - known) / (covariance(i, i) * covariance(i, i)) * column *
                  column.transpose();
  }
}

// Counts the directions the data see, and says which they do not.
void judge_directions(const Problem& problem, const Directions& seen, Uncertainty& result) {
  for (Eigen::Index i = 0; i < seen.singular.size(); ++i) {
    const bool sees = seen.inverse[i] > 0.0;
    if (sees && seen.singular[i] > 1.0)
      ++result.rank;
    else
      result.null_vectors.push_back(
          null_vector(problem, seen.axes.col(i), sees ? seen.inverse[i] : INFINITY));
  }
  result.condition =
      std::max(seen.singular.maxCoeff(), 1e-300) / std::max(seen.singular.minCoeff(), 1e-300);
}

// What the scales of a channel's noise add to twice the negative logarithm of the likelihood.
double log_determinant_of_scales(const Problem& problem, Channel channel) {
  double sum = 0.0;
  for (const ArcData& arc : problem.arcs) {
    const auto read = static_cast<double>(
        std::count_if(arc.readings.begin(), arc.readings.end(),
                      [&](const Reading& reading) { return reading.channel == channel; }));
    sum += 2.0 * rows_of(channel) * read * std::log(noise_scale(arc, channel));
  }
  return sum;
}

// Noise of all channels, and the offsets that may be common to a whole record: the tracker's, and
// what the camera's calibration allows for.
struct Noise {
  std::vector<ChannelNoise> channels;
  std::vector<Eigen::VectorXd> offsets, of_camera;
};

Noise noise_of(const Problem& problem, const Linearised& all, const Eigen::MatrixXd& scaled,
               const Directions& seen, Uncertainty& result) {
  Noise found;
  const Eigen::MatrixXd unit_steps = seen.axes * seen.inverse.asDiagonal();
  result.whiteness = {};
  result.drift = {};
  result.minus2_log_likelihood = 0.0;
  for (int c = 0; c < kChannels; ++c) {
    const auto channel = static_cast<Channel>(c);
    if (std::find(all.channel.begin(), all.channel.end(), channel) == all.channel.end()) continue;
    found.channels.push_back(channel_noise(problem, all, channel, scaled, unit_steps));
    const Whiteness& one = found.channels.back().whiteness;
    result.minus2_log_likelihood += found.channels.back().minus2_log_likelihood +
                                    log_determinant_of_scales(problem, channel) +
                                    cost_of_standing_out(problem, channel);
    found.offsets.push_back(common_offset(problem, all, channel, along(0)));
    if (channel == Channel::position) {
      found.offsets.push_back(common_offset(problem, all, channel, along(1)));
      found.offsets.push_back(common_offset(problem, all, channel, towards_seen_face));
    }
    if (found.channels.back().drift.gain > result.drift.gain)
      result.drift = found.channels.back().drift;
    result.whiteness.p_value = std::min(result.whiteness.p_value, one.p_value);
    if (one.inflation > result.whiteness.inflation) {
      result.whiteness.inflation = one.inflation;
      result.whiteness.correlation_time_s = one.correlation_time_s;
    }
  }
  if (!problem.frees_camera()) found.of_camera = camera_offsets(problem, all);
  return found;
}

// The sandwich covariance of noise that may hang together.
Eigen::MatrixXd sandwich(const Problem& problem, const Linearised& all, const Noise& noise,
                         const Eigen::MatrixXd& scaled, const Eigen::MatrixXd& bread) {
  const auto rows = static_cast<double>(problem.rows());
  constexpr double kFewest = 5.0;  // fewer say nothing of the noise at all
  const double few =
      data::student_factor(std::max(kFewest, rows - static_cast<double>(problem.free.size())));
  Eigen::MatrixXd filling = Eigen::MatrixXd::Zero(scaled.cols(), scaled.cols());
  for (const ChannelNoise& one : noise.channels)
    filling += few * few * seen_through(problem, all, one, scaled);
  const auto priors = scaled.bottomRows(scaled.rows() - problem.rows());
  filling += priors.transpose() * priors;
  return bread * filling * bread;
}

// What offsets that are common to a whole record add to it.
Eigen::MatrixXd of_offsets(const std::vector<Eigen::VectorXd>& offsets,
                           const Eigen::MatrixXd& scaled, const Eigen::MatrixXd& bread) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(bread.rows(), bread.cols());
  for (const Eigen::VectorXd& offset : offsets) {
    const Eigen::VectorXd shift = bread * (scaled.transpose() * offset);
    covariance += shift * shift.transpose();
  }
  return covariance;
}

// How far along each direction its surroundings are looked at. A step of more than a parameter's
// natural size is none to its surroundings, but a loss that hardly acts is small beside what it may
// be, and what it bends the others by goes with the square of that.
Eigen::VectorXd farthest_along(const Problem& problem, const Eigen::MatrixXd& axes) {
  constexpr double kOrdinary = 1.0, kOfLosses = 30.0;
  std::vector<Eigen::Index> losses, others;
  for (Eigen::Index i = 0; i < axes.rows(); ++i)
    (is_loss(problem, problem.free[i]) ? losses : others).push_back(i);
  Eigen::VectorXd farthest(axes.cols());
  for (Eigen::Index k = 0; k < farthest.size(); ++k)
    farthest[k] =
        std::min(kOrdinary / axes.col(k)(others).norm(), kOfLosses / axes.col(k)(losses).norm());
  return farthest;
}

// Median over the parameters of how many times wider the error bars are than those of independent
// residuals.
double typical_widening(const Eigen::VectorXd& variance, const Eigen::VectorXd& plain) {
  std::vector<double> ratios;
  for (Eigen::Index i = 0; i < plain.size(); ++i)
    if (plain[i] > 0.0) ratios.push_back(std::sqrt(variance[i] / plain[i]));
  return std::max(1.0, median_or_zero(std::move(ratios)));
}

}  // namespace

Eigen::VectorXd variances_given(const Eigen::MatrixXd& covariance, const std::vector<int>& known) {
  if (known.empty()) return covariance.diagonal();
  const Eigen::MatrixXd across = covariance(Eigen::all, known);
  Eigen::VectorXd rest =
      (covariance -
       across * SymmetricEquations(covariance(known, known)).solve_each(across.transpose()))
          .diagonal()
          .cwiseMax(0.0);
  for (const int i : known) rest[i] = 0.0;
  return rest;
}

namespace {

// Losses that came out as nothing.
std::vector<int> vanished(const Problem& problem) {
  std::vector<int> out;
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
    if (const FreeParameter& parameter = problem.free[i];
        parameter.held && parameter.transform.is_over_decades() &&
        !at_its_limit(parameter, problem.base.front()[parameter.index]))
      out.push_back(i);
  return out;
}

// None of them is below 0: what one may be is what it may be without the others, whatever it could
// trade with these.
void heed_floor(const Problem& problem, const Eigen::VectorXd& u, Uncertainty& result) {
  constexpr double kTrades = 0.25;  // of its variance: looked at more closely
  const std::vector<int> losses = vanished(problem);
  if (losses.size() < 2) return;
  const Eigen::MatrixXd covariance = result.covariance;
  for (const int loss : losses) {
    std::vector<int> others = losses;
    std::erase(others, loss);
    if (variances_given(covariance, others)[loss] > kTrades * covariance(loss, loss)) continue;
    Problem alone = problem;
    alone.free.clear();
    std::vector<int> kept;
    for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
      if (std::find(others.begin(), others.end(), i) == others.end())
        kept.push_back(i), alone.free.push_back(problem.free[i]);
    const Uncertainty without = uncertainty(alone, u(kept));
    const auto place = std::find(kept.begin(), kept.end(), loss) - kept.begin();
    const double shrunk = std::sqrt(without.covariance(place, place) / covariance(loss, loss));
    if (!(shrunk < 1.0)) continue;
    for (Eigen::MatrixXd* each : {&result.covariance, &result.of_camera}) {
      each->row(loss) *= shrunk;
      each->col(loss) *= shrunk;
    }
    result.identifiable[loss] = without.identifiable[static_cast<std::size_t>(place)];
  }
}

}  // namespace

Uncertainty uncertainty(const Problem& problem, const Eigen::VectorXd& u) {
  const Linearised all = linearise(problem, u);
  const int count = static_cast<int>(problem.free.size());
  Uncertainty result;
  Eigen::VectorXd size(count);
  for (int i = 0; i < count; ++i) size[i] = natural_size(problem, i, u);
  const Eigen::MatrixXd scaled = all.jacobian * size.asDiagonal();
  const Directions seen = directions_of(scaled);
  judge_directions(problem, seen, result);
  const Noise noise = noise_of(problem, all, scaled, seen, result);
  const Eigen::MatrixXd scatter = sandwich(problem, all, noise, scaled, seen.bread);
  const Eigen::MatrixXd of_camera = of_offsets(noise.of_camera, scaled, seen.bread);
  Eigen::MatrixXd covariance = scatter + of_offsets(noise.offsets, scaled, seen.bread) + of_camera;
  result.chi2_inflation.resize(count);
  for (int i = 0; i < count; ++i)
    result.chi2_inflation[i] =
        seen.bread(i, i) > 0.0 ? std::max(1.0, covariance(i, i) / seen.bread(i, i)) : 1.0;
  // What the camera may do is no walk along the valley but a shift of known direction.
  const Eigen::VectorXd sd = (seen.axes.transpose() * (covariance - of_camera) * seen.axes)
                                 .diagonal()
                                 .cwiseMax(0.0)
                                 .cwiseSqrt();
  const Eigen::MatrixXd to_sizes = seen.axes * seen.inverse.asDiagonal();
  const Valley valley{problem,
                      u,
                      all,
                      scaled * seen.axes,
                      size.asDiagonal() * seen.axes,
                      seen.inverse,
                      farthest_along(problem, seen.axes)};
  covariance += to_sizes * valley.bends(sd) * to_sizes.transpose();
  covariance += seen.blind;  // after the sandwich, whose filling knows nothing of these directions
  result.covariance = size.asDiagonal() * covariance * size.asDiagonal();
  heed_priors(problem, result.covariance);
  const Eigen::MatrixXd plain = size.asDiagonal() * (seen.bread + seen.blind) * size.asDiagonal();
  Eigen::MatrixXd hung = size.asDiagonal() * (scatter + seen.blind) * size.asDiagonal();
  heed_priors(problem, hung);
  const std::vector<int> kept = kept_parameters(problem);
  result.widened = typical_widening(variances_given(hung, kept), variances_given(plain, kept));
  result.identifiable.resize(count);
  for (int i = 0; i < count; ++i) result.identifiable[i] = covariance(i, i) < 1.0;
  result.of_camera = size.asDiagonal() * of_camera * size.asDiagonal();
  heed_floor(problem, u, result);
  return result;
}

double integration_error_sigma(const Problem& problem, const Eigen::VectorXd& u) {
  Problem finer = problem, coarser = problem;
  finer.tolerance = std::max(problem.tolerance * 1e-2, 1e-13);
  coarser.tolerance = problem.tolerance * 1e2;
  double worst = 0.0;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    Eigen::VectorXd here, other;
    // Where a finer run exceeds the step limit, a coarser one says more than there is.
    if (!evaluate(problem, arc, u, here, nullptr) ||
        (!evaluate(finer, arc, u, other, nullptr) && !evaluate(coarser, arc, u, other, nullptr)))
      return std::numeric_limits<double>::infinity();
    worst = std::max(worst, (here - other).cwiseAbs().maxCoeff());
  }
  return worst;
}

Criteria criteria(const Problem& problem, const Eigen::VectorXd& u, double minus2_log_likelihood) {
  const Problem plain = in_stated_sigmas(problem, Weights::kept);
  Criteria result;
  for (int arc = 0; arc < static_cast<int>(plain.arcs.size()); ++arc) {
    Eigen::VectorXd r;
    if (!evaluate(plain, arc, u, r, nullptr)) {
      result.chi2 = result.aicc = result.bic = std::numeric_limits<double>::infinity();
      return result;
    }
    result.chi2 += r.squaredNorm();
    result.rows += static_cast<int>(r.size());
  }
  const double n = result.rows;
  const double k = static_cast<double>(problem.free.size()) + 1.0;
  result.bic = minus2_log_likelihood + k * std::log(n);
  // Akaike's correction has no meaning for fewer rows than that.
  result.aicc = minus2_log_likelihood + 2.0 * k + 2.0 * k * (k + 1.0) / std::max(1.0, n - k - 1.0);
  return result;
}

}  // namespace trochoid::fitting
