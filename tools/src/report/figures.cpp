#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "common/constants.hpp"
#include "draw/svg.hpp"
#include "report/parts.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/model/predictor.hpp"

namespace trochoid::tools {
namespace {

constexpr std::size_t kMostPointsDrawn = 6000;  // per curve: more cannot be told apart in print

// x-y of the samples in millimetres or pixels (then y up, as on paper), where they have one.
std::vector<Eigen::Vector2d> observed_points(const ReportFacts& facts, const data::Track& track) {
  std::vector<Eigen::Vector2d> points;
  for (const data::TrackSample& sample : track.samples) {
    const Eigen::Vector2d point =
        facts.metres ? Eigen::Vector2d(sample.centre_m * kMmPerM)
                     : Eigen::Vector2d(sample.centre_px.x(), -sample.centre_px.y());
    if (point.allFinite()) points.push_back(point);
  }
  return points;
}

std::vector<Eigen::Vector2d> every_nth(std::vector<Eigen::Vector2d> points) {
  const std::size_t stride = points.size() / kMostPointsDrawn + 1;
  if (stride == 1) return points;
  std::vector<Eigen::Vector2d> kept;
  for (std::size_t i = 0; i < points.size(); i += stride) kept.push_back(points[i]);
  kept.push_back(points.back());
  return kept;
}

std::vector<double> whitened(const std::vector<Residual>& list, int axis) {
  std::vector<double> values;
  for (const Residual& residual : list)
    if (residual.sigma_m[axis] > 0.0)
      values.push_back(residual.value_m[axis] / residual.sigma_m[axis]);
  return values;
}

double correlation(const std::vector<double>& values, std::size_t lag) {
  double mean = 0.0, variance = 0.0, product = 0.0;
  for (const double value : values) mean += value / static_cast<double>(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    variance += std::pow(values[i] - mean, 2);
    if (i >= lag) product += (values[i] - mean) * (values[i - lag] - mean);
  }
  return variance > 0.0 ? product / variance : 0.0;
}

}  // namespace

std::string path_figure(const ReportFacts& facts) {
  Range x = Range::empty(), y = Range::empty();
  std::vector<std::vector<Eigen::Vector2d>> observed, predicted;
  const auto add = [&](std::vector<Eigen::Vector2d> points) {
    for (const Eigen::Vector2d& point : points) {
      x.include(point.x());
      y.include(point.y());
    }
    return points;
  };
  for (const data::Track& track : facts.input.tracks.tracks)
    observed.push_back(every_nth(add(observed_points(facts, track))));
  for (const PredictedArc& arc : facts.prediction.arcs) {
    std::vector<Eigen::Vector2d> points;
    for (const data::Pose<>& pose : arc.pose) points.push_back(pose.centre_m.head<2>() * kMmPerM);
    predicted.push_back(every_nth(add(std::move(points))));
  }
  const char* unit = facts.metres ? "mm" : "px";
  SvgPlot plot(
      "path", x, y,
      {fmt::format("x [{}]", unit), fmt::format("{}y [{}]", facts.metres ? "" : "-", unit)},
      SvgPlot::Scale::equal, 560.0, 500.0);
  for (const auto& points : observed) plot.dots(points, ink::observed, 2.4);
  for (const auto& points : predicted) plot.line(points, ink::predicted, 1.3);
  for (const auto& points : observed)
    if (!points.empty()) plot.words(points.front(), "start", ink::words);
  plot.key("observed", ink::observed, false);
  if (!predicted.empty()) plot.key("predicted", ink::predicted, true);
  for (std::size_t i = 0; i < observed.size(); ++i) {
    plot.cursor(fmt::format("observed{}", i), ink::observed);
    plot.cursor(fmt::format("predicted{}", i), ink::predicted);
  }
  return plot.text();
}

std::string histogram_figure(const ReportFacts& facts) {
  constexpr double kReach = 4.0;
  constexpr int kBins = 32;
  std::vector<double> counts(kBins, 0.0);
  double total = 0.0;
  for (const auto& list : facts.residuals)
    for (int axis = 0; axis < 2; ++axis)
      for (const double value : whitened(list, axis)) {
        const int bin = static_cast<int>(std::floor((value + kReach) * kBins / (2.0 * kReach)));
        counts[static_cast<std::size_t>(std::clamp(bin, 0, kBins - 1))] += 1.0;
        total += 1.0;
      }
  if (total == 0.0) return {};
  const double width = 2.0 * kReach / kBins;
  double highest = 0.45;
  for (const double count : counts) highest = std::max(highest, count / (total * width));
  SvgPlot plot("histogram", {-kReach, kReach}, {0.0, highest}, {"residual [sigma]", "density"},
               SvgPlot::Scale::linear, 420.0, 280.0);
  for (int bin = 0; bin < kBins; ++bin) {
    const double left = -kReach + bin * width;
    plot.bar({left + 0.05 * width, left + 0.95 * width},
             {0.0, counts[static_cast<std::size_t>(bin)] / (total * width)}, ink::band);
  }
  std::vector<Eigen::Vector2d> bell;
  for (double z = -kReach; z <= kReach; z += 0.05)
    bell.emplace_back(z, std::exp(-0.5 * z * z) / std::sqrt(2.0 * data::kPi));
  plot.line(bell, ink::words, 1.5);
  plot.key("normal", ink::words, true);
  return plot.text();
}

std::string correlation_figure(const ReportFacts& facts) {
  constexpr std::size_t kLags = 30;
  const auto longest =
      std::max_element(facts.residuals.begin(), facts.residuals.end(),
                       [](const auto& a, const auto& b) { return a.size() < b.size(); });
  if (longest == facts.residuals.end() || longest->size() < 2 * kLags) return {};
  SvgPlot plot("correlation", {0.0, static_cast<double>(kLags)}, {-0.5, 1.0},
               {"lag [frames]", "autocorrelation"}, SvgPlot::Scale::linear, 420.0, 280.0);
  const double bound = 1.96 / std::sqrt(static_cast<double>(longest->size()));
  plot.bar({0.0, static_cast<double>(kLags)}, {-bound, bound}, ink::band);
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double> values;
    for (const Residual& residual : *longest) values.push_back(residual.value_m[axis]);
    std::vector<Eigen::Vector2d> points;
    for (std::size_t lag = 0; lag <= kLags; ++lag)
      points.emplace_back(static_cast<double>(lag), correlation(values, lag));
    plot.line(points, axis == 0 ? ink::x : ink::y, 1.2, axis == 0 ? "" : "4 3");
    plot.dots(points, axis == 0 ? ink::x : ink::y, 2.5);
    plot.key(axis == 0 ? "x" : "y", axis == 0 ? ink::x : ink::y, false);
  }
  return plot.text();
}

std::string cost_figure(const ReportFacts& facts) {
  if (facts.prediction.arcs.empty()) return {};
  using Clock = std::chrono::steady_clock;
  constexpr double kTightest = 1e-12;
  Eigen::VectorXd truth;
  std::vector<Eigen::Vector2d> points;
  for (double tolerance = kTightest; tolerance < 2e-4; tolerance *= 10.0) {
    const auto start = Clock::now();
    const auto arc =
        replay_first_arc(*facts.input.fit, facts.input.tracks, facts.input.fit_track, tolerance);
    const double took_s = std::chrono::duration<double>(Clock::now() - start).count();
    if (!arc) return {};
    if (truth.size() == 0) {
      truth = *arc;
      continue;
    }
    double worst = 0.0;
    for (Eigen::Index i = 0; i < truth.size(); ++i)
      if (std::isfinite(truth[i]) && std::isfinite((*arc)[i]))
        worst = std::max(worst, std::abs(truth[i] - (*arc)[i]));
    if (worst > 0.0 && took_s > 0.0) points.emplace_back(std::log10(took_s), std::log10(worst));
  }
  if (points.size() < 3) return {};
  Range x = Range::empty(), y = Range::empty();
  for (const Eigen::Vector2d& point : points) {
    x.include(point.x());
    y.include(point.y());
  }
  if (std::isfinite(facts.median_sigma_m)) y.include(std::log10(facts.median_sigma_m));
  // Whole decades, so that the axis has numbers on it; room above for the key.
  x = {std::floor(x.low), std::ceil(x.high)};
  y.high += 0.25 * y.span();
  SvgPlot plot("cost", x, y, {"run time of one prediction [s]", "largest error of x, y [m]"},
               SvgPlot::Scale::logarithmic, 420.0, 280.0);
  plot.line(points, ink::predicted, 1.5);
  plot.dots(points, ink::predicted, 3.0);
  plot.key("integration", ink::predicted, true);
  if (std::isfinite(facts.median_sigma_m)) {
    const double level = std::log10(facts.median_sigma_m);
    const std::vector<Eigen::Vector2d> noise{{x.low - 1.0, level}, {x.high + 1.0, level}};
    plot.line(noise, ink::observed, 1.5, "5 4");
    plot.key("sigma of the track", ink::observed, true);
  }
  return plot.text();
}

}  // namespace trochoid::tools
