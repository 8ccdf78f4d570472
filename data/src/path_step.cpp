#include "trochoid/data/path_step.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <optional>

#include "trochoid/data/quantile.hpp"

namespace trochoid::data {
namespace {

constexpr int kBeside = 10;  // samples before a step, and from it on
constexpr int kOrder = 6;    // coefficients of a quintic
constexpr int kUnknowns = 2 * kOrder + 1;

using Powers = Eigen::Matrix<double, 1, kOrder>;

// 1, t, t^2, ...
Powers powers(double t) {
  Powers row = Powers::Ones();
  for (int k = 1; k < kOrder; ++k) row[k] = t * row[k - 1];
  return row;
}

// Their derivatives.
Powers slopes(double t) {
  const Powers power = powers(t);
  Powers row = Powers::Zero();
  for (int k = 1; k < kOrder; ++k) row[k] = k * power[k - 1];
  return row;
}

bool has_gap(const std::vector<double>& t_s, int sample, double step_s) {
  constexpr double kGap = 1.5;  // usual steps
  for (int i = sample - kBeside + 1; i < sample + kBeside; ++i)
    if (t_s[i] - t_s[i - 1] > kGap * step_s) return true;
  return false;
}

// A quintic through the positions about a sample, of which those from it on may be of other times:
// Gauss-Newton for its coefficients and the frames between, from none.
std::optional<PathStep> step_at(const std::vector<double>& t_s, const Eigen::MatrixX2d& at,
                                double step_s, int sample) {
  constexpr int kRounds = 6;
  PathStep step{.sample = sample};
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(4 * kBeside, kUnknowns);
  Eigen::VectorXd b(a.rows()), unknowns = Eigen::VectorXd::Zero(kUnknowns);
  for (int round = 0; round < kRounds; ++round) {
    for (int i = -kBeside; i < kBeside; ++i) {
      const double tau = (t_s[sample + i] - t_s[sample]) / step_s;
      const double t = (tau + (i >= 0 ? step.frames : 0.0)) / kBeside;
      for (int axis = 0; axis < 2; ++axis) {
        const int row = 2 * (i + kBeside) + axis;
        a.row(row).segment<kOrder>(kOrder * axis) = powers(t);
        a(row, kUnknowns - 1) =
            i >= 0 ? slopes(t).dot(unknowns.segment<kOrder>(kOrder * axis)) / kBeside : 0.0;
        b[row] = at(sample + i, axis);
      }
    }
    const bool standing = round == 0;  // nothing is known of the velocity yet
    const int columns = standing ? kUnknowns - 1 : kUnknowns;
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(a.leftCols(columns));
    if (qr.rank() < columns) return std::nullopt;
    unknowns.head(columns) = qr.solve(b);
    if (!standing) step.frames += unknowns[kUnknowns - 1];
    if (!(std::abs(step.frames) < kBeside)) return std::nullopt;
  }
  const Powers slope = slopes(0.5 * step.frames / kBeside) / kBeside;
  step.way = std::abs(step.frames) * std::hypot(slope.dot(unknowns.head<kOrder>()),
                                                slope.dot(unknowns.segment<kOrder>(kOrder)));
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(a);
  const Eigen::MatrixXd upper = qr.matrixR().topRows(kUnknowns).triangularView<Eigen::Upper>();
  const Eigen::VectorXd last =
      qr.colsPermutation().transpose() * Eigen::VectorXd::Unit(kUnknowns, kUnknowns - 1);
  const double variance =
      (b - a * unknowns).squaredNorm() / static_cast<double>(a.rows() - kUnknowns);
  step.sigma =
      std::sqrt(variance) * upper.transpose().triangularView<Eigen::Lower>().solve(last).norm();
  return step;
}

bool is_whole(const PathStep& step) {
  constexpr double kNear = 0.1, kSigmas = 3.0, kTold = 0.15;
  const double whole = std::round(step.frames);
  return whole != 0.0 && std::abs(step.frames - whole) < kNear + kSigmas * step.sigma &&
         step.sigma < kTold;
}

}  // namespace

std::vector<PathStep> path_steps(const std::vector<double>& t_s, const Eigen::MatrixX2d& at) {
  constexpr double kStandsOut = 6.0;
  const double step_s = usual_step_s(t_s);
  const auto count = static_cast<int>(t_s.size());
  std::vector<PathStep> found;
  for (int sample = kBeside; sample + kBeside <= count; ++sample) {
    if (has_gap(t_s, sample, step_s)) continue;
    const auto step = step_at(t_s, at, step_s, sample);
    const auto bars = [](const PathStep& s) { return std::abs(s.frames) / s.sigma; };
    if (!step || !is_whole(*step) || !(bars(*step) > kStandsOut)) continue;
    if (found.empty() || sample - found.back().sample > kBeside)
      found.push_back(*step);
    else if (bars(*step) > bars(found.back()))
      found.back() = *step;
  }
  return found;
}

std::vector<PathStep> clear_path_steps(const std::vector<double>& t_s, const Eigen::MatrixX2d& at,
                                       double most_sigma, double least_way) {
  constexpr std::size_t kFew = 6, kRarely = 40;
  std::vector<PathStep> steps = path_steps(t_s, at);
  std::erase_if(
      steps, [&](const PathStep& step) { return step.sigma > most_sigma || step.way < least_way; });
  if (steps.size() > std::min(kFew, t_s.size() / kRarely)) steps.clear();
  return steps;
}

std::string words_of(const std::vector<PathStep>& steps, const std::vector<double>& t_s) {
  std::string words;
  for (const PathStep& step : steps)
    words += fmt::format("{}{:.2f} ± {:.2f} at {:.4g} s", words.empty() ? "" : ", ", step.frames,
                         step.sigma, t_s[step.sample]);
  return words;
}

}  // namespace trochoid::data
