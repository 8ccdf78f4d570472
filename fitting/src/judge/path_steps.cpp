#include "judge/path_steps.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "observe/decompositions.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::fitting {

double usual_step_s(const ArcData& arc) {
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < arc.t_s.size(); ++i) steps_s.push_back(arc.t_s[i] - arc.t_s[i - 1]);
  return data::median(std::move(steps_s));
}

bool is_whole(const TimeJump& jump) {
  constexpr double kNear = 0.35, kTold = 0.15;
  const double whole = std::round(jump.frames);
  return whole != 0.0 && std::abs(jump.frames - whole) < kNear && jump.sigma < kTold;
}

namespace {

constexpr int kBeside = 10;  // samples before a step, and from it on
constexpr int kOrder = 6;    // coefficients of a quintic

// 1, t, t^2, ...
Eigen::RowVectorXd powers(double t) {
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Ones(kOrder);
  for (int k = 1; k < kOrder; ++k) row[k] = t * row[k - 1];
  return row;
}

// Their derivatives.
Eigen::RowVectorXd slopes(double t) {
  const Eigen::RowVectorXd power = powers(t);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(kOrder);
  for (int k = 1; k < kOrder; ++k) row[k] = k * power[k - 1];
  return row;
}

// A quintic in time through the positions about a sample, of which those from it on may be of other
// times: Gauss-Newton for its coefficients and the frames between, from none.
std::optional<TimeJump> step_of_path(const ArcData& arc, const Eigen::MatrixX2d& at_m,
                                     double frame_s, int sample) {
  constexpr int kRounds = 6, kUnknowns = 2 * kOrder + 1;
  constexpr double kRank = 1e-12;
  TimeJump jump{.sample = sample};
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(4 * kBeside, kUnknowns);
  Eigen::VectorXd b(a.rows()), unknowns = Eigen::VectorXd::Zero(kUnknowns);
  for (int round = 0; round < kRounds; ++round) {
    for (int i = -kBeside; i < kBeside; ++i) {
      const double tau = (arc.t_s[sample + i] - arc.t_s[sample]) / frame_s;
      const double t = (tau + (i >= 0 ? jump.frames : 0.0)) / kBeside;
      for (int axis = 0; axis < 2; ++axis) {
        const int row = 2 * (i + kBeside) + axis;
        a.row(row).segment<kOrder>(kOrder * axis) = powers(t);
        a(row, kUnknowns - 1) =
            i >= 0 ? slopes(t).dot(unknowns.segment<kOrder>(kOrder * axis)) / kBeside : 0.0;
        b[row] = at_m(sample + i, axis);
      }
    }
    const bool standing = round == 0;  // nothing is known of the velocity yet
    const auto columns = standing ? kUnknowns - 1 : kUnknowns;
    const LeastSquares least(a.leftCols(columns));
    if (least.rank(kRank) < columns) return std::nullopt;
    unknowns.head(columns) = least.solve(b);
    if (!standing) jump.frames += unknowns[kUnknowns - 1];
    if (!(std::abs(jump.frames) < kBeside)) return std::nullopt;
  }
  const double variance =
      (b - a * unknowns).squaredNorm() / static_cast<double>(a.rows() - kUnknowns);
  const Eigen::VectorXd last = Eigen::VectorXd::Unit(kUnknowns, kUnknowns - 1);
  const Eigen::MatrixXd normal = a.transpose() * a;
  jump.sigma = std::sqrt(variance * SymmetricEquations(normal).solve(last)[kUnknowns - 1]);
  return jump;
}

// Those that stand out among the ones beside them.
std::vector<TimeJump> steps_of_path(const ArcData& arc) {
  constexpr double kStandsOut = 6.0;
  const Eigen::MatrixX2d at_m = arc.positions_m();
  const double frame_s = usual_step_s(arc);
  const auto count = static_cast<int>(arc.t_s.size());
  std::vector<TimeJump> found;
  for (int sample = kBeside; sample + kBeside <= count; ++sample) {
    const auto jump = step_of_path(arc, at_m, frame_s, sample);
    const auto bars = [](const TimeJump& j) { return std::abs(j.frames) / j.sigma; };
    if (!jump || !is_whole(*jump) || !(bars(*jump) > kStandsOut)) continue;
    if (found.empty() || sample - found.back().sample > kBeside)
      found.push_back(*jump);
    else if (bars(*jump) > bars(found.back()))
      found.back() = *jump;
  }
  return found;
}

}  // namespace

void tell_steps_of_path(const Problem& problem, data::Fit& fit) {
  constexpr std::size_t kFew = 6, kRarely = 40;  // else times jitter, or the path has corners
  for (const ArcData& arc : problem.arcs) {
    if (arc.observable_index(model::Observable::x_m) < 0) continue;
    const std::vector<TimeJump> jumps = steps_of_path(arc);
    if (jumps.empty() || jumps.size() > std::min(kFew, arc.t_s.size() / kRarely)) continue;
    std::vector<std::string> told;
    for (const TimeJump& jump : jumps)
      told.push_back(fmt::format("{:.2f} ± {:.2f} at {:.4g} s", jump.frames, jump.sigma,
                                 arc.t_s[jump.sample]));
    fit.warnings.push_back(fmt::format(
        "the body goes on by whole frames at once ({}): did the recorder drop pictures, or write "
        "some twice, and the times not show it?",
        fmt::join(told, ", ")));
  }
}

}  // namespace trochoid::fitting
