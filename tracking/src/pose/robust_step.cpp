#include "pose/robust_step.hpp"

#include <Eigen/Cholesky>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "pose/arrow_system.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

// Unknowns: per group the error of the edge model as a function of direction, given at kKnots
// directions and blended between them; then the pose and the nuisances common to the outline.
constexpr int kCommon = 7, kKnots = 8;
static_assert(data::PoseMotion::kMost + kCommon + kGroups * kKnots <= ArrowSystem::kMost);
constexpr int kRow = 12;  // two knots, the pose, four of those common to the outline; even
static_assert(2 + data::PoseMotion::kMost + 4 <= kRow);
using Vector = ArrowSystem::Vector;

// Where the pose begins among the unknowns.
int pose_at(bool directions) {
  return directions ? kGroups * kKnots : 0;
}

// The rim may be a little larger or smaller than the caliper says, edges a little towards the
// bright side of where the transfer curve puts them.
constexpr double kSwellSdPx = 0.1;
constexpr double kPolaritySdPx = 0.2;
// An edge's shift by a transfer curve other than the usual one, per contrast over mean level.
constexpr double kToneSdPx = 0.05;
// The colour planes: towards the brighter side, and as a whole beyond half a pixel of the other
// common place of the samples.
constexpr double kColourPolaritySdPx = 0.3, kColourShiftSdPx = 0.08;

// By what share the shadow beside the body may be wider or narrower than expected.
constexpr double kShadowSd = 0.5;

// The few unknowns an equation depends on, in the order of their indices but for the knots.
struct EquationRow {
  std::array<int, kRow> index{};
  std::array<double, kRow> value{};  // 0 beyond `count`
  int count = 0;

  EquationRow(const EdgeEquation& e, bool directions) {
    if (directions) {
      // Cosine and sine keep the variance the same between the knots.
      const double place = (e.direction_rad / data::kTurn + 1.0) * kKnots;
      const int knot = static_cast<int>(place);
      const double part = 0.5 * data::kPi * (place - knot);
      const int first = e.group * kKnots;
      add(first + knot % kKnots, e.model_px * std::cos(part));
      add(first + (knot + 1) % kKnots, e.model_px * std::sin(part));
      if (index[0] > index[1]) std::swap(index[0], index[1]), std::swap(value[0], value[1]);
    }
    const int first = pose_at(directions), n = static_cast<int>(e.motion.size());
    for (int i = 0; i < n; ++i) add(first + i, e.motion[i]);
    add(first + n, e.swell);
    if (e.colour) {
      add(first + n + 2, e.polarity);
      add(first + n + 3, e.normal.x());
      add(first + n + 4, e.normal.y());
    } else {
      add(first + n + 1, e.polarity);
      add(first + n + 5, e.tone);
      add(first + n + 6, e.shadow_px);
    }
  }
  void add(int i, double v) {
    index[static_cast<size_t>(count)] = i;
    value[static_cast<size_t>(count)] = v;
    ++count;
  }
  [[nodiscard]] double dot(const Vector& x) const {
    double sum = 0.0;
    for (int k = 0; k < count; ++k)
      sum += value[static_cast<size_t>(k)] * x[static_cast<size_t>(index[static_cast<size_t>(k)])];
    return sum;
  }
  // Adds weight * row^T.
  void add_to(double weight, Vector& x) const {
    for (int k = 0; k < count; ++k)
      x[static_cast<size_t>(index[static_cast<size_t>(k)])] +=
          weight * value[static_cast<size_t>(k)];
  }
};

// Adds weight * row^T row and weight * row * offset of many rows to a system. Neighbours depend on
// the same unknowns: their sums are kept beside each other until that changes.
class Accumulating {
 public:
  explicit Accumulating(ArrowSystem& system) : system_(system) {}
  ~Accumulating() { flush(); }
  Accumulating(const Accumulating&) = delete;
  Accumulating& operator=(const Accumulating&) = delete;

  void add(const EquationRow& row, double weight, double offset) {
    if (like_ == nullptr || row.index != like_->index) {
      flush();
      like_ = &row;
      for (auto& sums : square_) sums.fill(0.0);
      right_.fill(0.0);
    }
    // Half of the square, in whole pairs: unrolled, so that these are added two at a time.
#pragma GCC unroll 12
    for (size_t a = 0; a < kRow; ++a) {
      const double w = weight * row.value[a];
      right_[a] += w * offset;
#pragma GCC unroll 12
      for (size_t b = 0; b < a / 2 * 2 + 2; ++b) square_[a][b] += w * row.value[b];
    }
  }

 private:
  void flush() {
    for (int a = 0; like_ != nullptr && a < like_->count; ++a) {
      const auto k = static_cast<size_t>(a);
      system_.right(like_->index[k]) += right_[k];
      for (size_t l = 0; l <= k; ++l) system_(like_->index[k], like_->index[l]) += square_[k][l];
    }
  }

  ArrowSystem& system_;
  const EquationRow* like_ = nullptr;
  std::array<std::array<double, kRow>, kRow> square_;
  std::array<double, kRow> right_;
};

ArrowSystem prior_information(const data::PoseMotion::Step& prior_sd, bool directions) {
  const int n = static_cast<int>(prior_sd.size()), first = pose_at(directions);
  ArrowSystem system(directions ? kGroups : 0, directions ? kKnots : 0, n + kCommon);
  for (int i = 0; i < first; ++i) system(i, i) = 1.0;
  const auto expect = [&](int i, double sd) { system(first + i, first + i) = 1.0 / (sd * sd); };
  for (int i = 0; i < n; ++i) expect(i, prior_sd[i]);
  expect(n, kSwellSdPx);
  expect(n + 1, kPolaritySdPx);
  expect(n + 2, kColourPolaritySdPx);
  expect(n + 3, kColourShiftSdPx);
  expect(n + 4, kColourShiftSdPx);
  expect(n + 5, kToneSdPx);
  expect(n + 6, kShadowSd);
  return system;
}

// Errors of neighbouring edges are correlated (texture, relief, compression). Sums over blocks of
// the outline show by how much the variance of a sum exceeds that of independent errors; the fit
// itself takes `fitted` degrees of freedom out of the blocks.
double correlation_factor(const std::vector<EdgeEquation>& equations, double scale2,
                          double fitted) {
  constexpr double kBlocks = 32.0;
  double total_arc = 0.0;
  for (const auto& e : equations) total_arc += e.arc_px;
  const double block_arc = total_arc / kBlocks;
  double observed = 0.0, independent = 0.0, arc = 0.0, sum = 0.0, variance = 0.0;
  int blocks = 0, curve = equations.front().curve;
  const auto close = [&] {
    if (variance > 0.0) observed += sum * sum, independent += variance, ++blocks;
    arc = sum = variance = 0.0;
  };
  for (const auto& e : equations) {
    if (e.curve != curve || arc + 0.5 * e.arc_px > block_arc) close();
    curve = e.curve;
    const double w = e.weight / e.variance_px2;
    sum += w * e.residual_px;
    variance += w * w * e.variance_px2 * scale2;
    arc += e.arc_px;
  }
  close();
  const double freedom = std::max(0.3 * blocks, blocks - fitted);
  return std::max(1.0, observed / std::max(independent, 1e-30) * blocks / freedom);
}

constexpr size_t kSectors = 6;
using Sectors = std::array<ArrowSystem, kSectors>;

// What the equations of each sixth of all directions say.
Sectors sectors_of(const std::vector<EdgeEquation>& equations, const std::vector<EquationRow>& rows,
                   const ArrowSystem& prior, double scale) {
  ArrowSystem none = prior;
  none.add(prior, -1.0);
  Sectors sectors;
  sectors.fill(none);
  for (size_t k = 0; k < kSectors; ++k) {
    Accumulating sums(sectors[k]);
    for (size_t i = 0; i < equations.size(); ++i) {
      const EdgeEquation& e = equations[i];
      const double turn = e.direction_rad / data::kTurn + 1.0;
      if (static_cast<size_t>(turn * kSectors) % kSectors == k)
        sums.add(rows[i], e.weight / (e.variance_px2 * scale * scale), e.offset_px);
    }
  }
  return sectors;
}

// What whole stretches of the outline do to the answer: how far it moves when one sixth of all
// directions is left out, over what the covariance expects. Sees errors that neighbours share,
// whatever their cause.
double jackknife_ratio(const ArrowSystem& all, const Sectors& sectors,
                       const Eigen::MatrixXd& covariance) {
  const Eigen::Index n = covariance.rows();
  Eigen::MatrixXd answers(n, kSectors);
  for (size_t k = 0; k < kSectors; ++k) {
    ArrowSystem rest = all;
    rest.add(sectors[k], -1.0);
    if (!rest.factorise()) return std::numeric_limits<double>::infinity();
    const Vector x = rest.solved_right();
    for (Eigen::Index i = 0; i < n; ++i)
      answers(i, static_cast<Eigen::Index>(k)) = x[static_cast<size_t>(kGroups * kKnots + i)];
  }
  const Eigen::VectorXd mean = answers.rowwise().mean();
  const Eigen::MatrixXd off = answers.colwise() - mean;
  const Eigen::MatrixXd variance = (kSectors - 1.0) / kSectors * off * off.transpose();
  return covariance.ldlt().solve(variance).trace() / static_cast<double>(n);
}

// What errors common to whole sides of the outline do to the answer: no residual shows them, and
// nothing is estimated of them.
Eigen::MatrixXd common_covariance(const std::vector<EdgeEquation>& equations,
                                  const std::vector<EquationRow>& rows,
                                  const ArrowSystem& factorised, double scale, int first,
                                  int count) {
  constexpr size_t kLower = 4, kOuterFlanks = 5, kBoreFlanks = 6, kOuterTwist = 7, kBoreTwist = 8,
                   kPatterns = 9;
  std::array<Vector, kPatterns> patterns{};
  for (size_t i = 0; i < equations.size(); ++i) {
    const EdgeEquation& e = equations[i];
    const double weight = e.weight / (e.variance_px2 * scale * scale);
    if (e.group < 2) {
      const auto side = static_cast<size_t>(2 * e.group);
      rows[i].add_to(weight * e.common_px * e.normal.x(), patterns[side]);
      rows[i].add_to(weight * e.common_px * e.normal.y(), patterns[side + 1]);
    }
    if (e.lower_px > 0.0) rows[i].add_to(weight * e.lower_px, patterns[kLower]);
    if (e.flank_px != 0.0)
      rows[i].add_to(weight * e.flank_px, patterns[e.swell > 0.0 ? kOuterFlanks : kBoreFlanks]);
    if (e.twist_px != 0.0)
      rows[i].add_to(weight * e.twist_px, patterns[e.swell > 0.0 ? kOuterTwist : kBoreTwist]);
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(count, count);
  for (Vector& pattern : patterns) {
    factorised.solve(pattern);
    const Eigen::Map<const Eigen::VectorXd> answer(&pattern[static_cast<size_t>(first)], count);
    covariance += answer * answer.transpose();
  }
  return covariance;
}

// The answer to offsets that grow along x, or y, with one motion of the body.
std::array<PoseMeasurement::PerMotion, 2> sheared_by_motion(
    const std::vector<EdgeEquation>& equations, const std::vector<EquationRow>& rows,
    const ArrowSystem& factorised, double scale, int first, int count) {
  std::array<PoseMeasurement::PerMotion, 2> sheared;
  for (const int axis : {0, 1}) {
    auto& answers = sheared[static_cast<size_t>(axis)];
    answers.resize(count, count);
    for (int j = 0; j < count; ++j) {
      Vector pattern{};
      for (size_t i = 0; i < equations.size(); ++i) {
        const EdgeEquation& e = equations[i];
        rows[i].add_to(
            e.weight / (e.variance_px2 * scale * scale) * e.motion[j] * e.from_centre_px[axis],
            pattern);
      }
      factorised.solve(pattern);
      answers.col(j) =
          Eigen::Map<const Eigen::VectorXd>(&pattern[static_cast<size_t>(first)], count);
    }
  }
  return sheared;
}

// Tukey's weights about the solution so far, for errors that are `scale` times as large as claimed.
double weigh(std::vector<EdgeEquation>& equations, const std::vector<EquationRow>& rows,
             const Vector& x, double least_scale_px, const std::vector<double>& per_sd,
             std::vector<double>& sizes) {
  constexpr double kTukey = 4.685;  // 95 % efficiency for normal errors
  for (size_t i = 0; i < equations.size(); ++i) {
    auto& e = equations[i];
    e.residual_px = e.offset_px - rows[i].dot(x);
    sizes[i] = std::abs(e.residual_px) * per_sd[i];
  }
  // Never below what the edges claim.
  const double scale = std::max(data::kSdOverMedianDistance * data::upper_median(sizes), 1.0);
  for (size_t i = 0; i < equations.size(); ++i) {
    auto& e = equations[i];
    const double bound = kTukey * std::max(scale, least_scale_px * per_sd[i]);
    const double t = sizes[i] / bound;
    e.weight = t < 1.0 ? (1.0 - t * t) * (1.0 - t * t) : 0.0;
  }
  return scale;
}

// Tukey-weighted least squares as it goes: the last solution and the system that gave it.
struct Solving {
  std::vector<EdgeEquation>& equations;
  const std::vector<EquationRow>& rows;
  const ArrowSystem& prior;
  int first, count;  // the pose among the unknowns
  double least_scale_px;
  Vector x{};
  ArrowSystem system{};  // factorised
  double scale = 1.0;
  std::vector<double> sizes{}, per_sd{};

  bool run() {
    constexpr int kIterations = 8;
    constexpr double kSettled = 0.03;  // in standard deviations
    sizes.resize(equations.size());
    for (const EdgeEquation& e : equations) per_sd.push_back(1.0 / std::sqrt(e.variance_px2));
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      scale = weigh(equations, rows, x, least_scale_px, per_sd, sizes);
      system = prior;
      accumulate();
      Vector information{};
      for (int i = first; i < first + count; ++i) information[at(i)] = system(i, i);
      if (!system.factorise()) return false;
      const Vector next = system.solved_right();
      double change2 = 0.0;
      for (int i = first; i < first + count; ++i) {
        if (!std::isfinite(next[at(i)])) return false;
        change2 += std::pow(next[at(i)] - x[at(i)], 2) * information[at(i)];
      }
      x = next;
      if (change2 < kSettled * kSettled) break;
    }
    return true;
  }
  void accumulate() {
    Accumulating sums(system);
    for (size_t i = 0; i < equations.size(); ++i)
      if (equations[i].weight > 0.0)
        sums.add(rows[i], equations[i].weight / (equations[i].variance_px2 * scale * scale),
                 equations[i].offset_px);
  }
  static constexpr size_t at(int i) { return static_cast<size_t>(i); }
};

// Diagonal of the covariance of all unknowns, and the whole of it for the pose.
Vector variances(const ArrowSystem& factorised, int first, Eigen::MatrixXd& pose) {
  const auto count = static_cast<int>(pose.rows());
  Vector all{};
  for (int i = 0; i < factorised.size(); ++i) {
    Vector unit{};
    unit[static_cast<size_t>(i)] = 1.0;
    factorised.solve(unit);
    all[static_cast<size_t>(i)] = unit[static_cast<size_t>(i)];
    if (i < first || i >= first + count) continue;
    for (int j = 0; j < count; ++j) pose(j, i - first) = unit[static_cast<size_t>(first + j)];
  }
  return all;
}

std::vector<EquationRow> rows_of(const std::vector<EdgeEquation>& equations, bool directions) {
  std::vector<EquationRow> rows;
  rows.reserve(equations.size());
  for (const EdgeEquation& e : equations) rows.emplace_back(e, directions);
  return rows;
}

}  // namespace

bool solve_robustly(std::vector<EdgeEquation>& equations, const data::PoseMotion::Step& prior_sd,
                    double least_scale_px, bool directions, RobustSolution& out) {
  constexpr size_t kFewest = 8;
  if (equations.size() < kFewest) return false;
  const auto n = static_cast<int>(prior_sd.size());
  const int first = pose_at(directions);
  const ArrowSystem prior = prior_information(prior_sd, directions);
  const std::vector<EquationRow> rows = rows_of(equations, directions);
  Solving solving{equations, rows, prior, first, n, least_scale_px};
  if (!solving.run()) return false;
  double square = 0.0, weight = 0.0;
  for (size_t i = 0; i < equations.size(); ++i) {
    auto& e = equations[i];
    e.residual_px = e.offset_px - rows[i].dot(solving.x);
    square += e.weight * e.residual_px * e.residual_px;
    weight += e.weight;
  }
  if (!(weight > 0.0)) return false;
  const auto of = [&](int i) { return solving.x[static_cast<size_t>(first + i)]; };
  out.step.resize(n);
  for (int i = 0; i < n; ++i) out.step[i] = of(i);
  out.scale = solving.scale;
  out.swell_px = of(n);
  out.polarity_px = of(n + 1);
  out.colour_shift_px = {of(n + 3), of(n + 4)};
  out.rms_px = std::sqrt(square / weight);
  return true;
}

void find_uncertainty(const std::vector<EdgeEquation>& equations,
                      const data::PoseMotion::Step& prior_sd, bool rows_in_turn,
                      RobustSolution& solution) {
  const auto n = static_cast<int>(prior_sd.size());
  const int first = pose_at(true);
  const ArrowSystem prior = prior_information(prior_sd, true);
  const std::vector<EquationRow> rows = rows_of(equations, true);
  const Sectors sectors = sectors_of(equations, rows, prior, solution.scale);
  ArrowSystem all = prior;
  for (const ArrowSystem& sector : sectors) all.add(sector, 1.0);
  ArrowSystem factorised = all;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  solution.covariance = solution.common = Eigen::MatrixXd::Constant(n, n, kInfinity);
  if (!factorised.factorise()) return;
  Eigen::MatrixXd inverse(n, n);
  const Vector variance = variances(factorised, first, inverse);
  for (const int axis : {0, 1}) {
    const double all_know = 1.0 / variance[static_cast<size_t>(first + n + 3 + axis)];
    const double edges_know = all_know - 1.0 / (kColourShiftSdPx * kColourShiftSdPx);
    constexpr double kLeast = 1e-3;
    if (edges_know < kLeast) continue;
    solution.colour_information[axis] = edges_know;
    solution.colour_off_px[axis] = solution.colour_shift_px[axis] * all_know / edges_know;
  }
  double weight = 0.0, z2 = 0.0;
  for (const EdgeEquation& e : equations) {
    weight += e.weight;
    z2 += e.weight * e.residual_px * e.residual_px / e.variance_px2;
  }
  const double scale2 = std::max(z2 / weight, 1.0);
  // Of each unknown the share that the edges determine and not the prior.
  double fitted = 0.0;
  for (int i = 0; i < factorised.size(); ++i)
    fitted += 1.0 - prior(i, i) * variance[static_cast<size_t>(i)];
  // Noise grows with the correlation, what the edge models may be wrong by does not.
  const double grown =
      correlation_factor(equations, scale2, fitted) * scale2 / (solution.scale * solution.scale);
  solution.covariance = grown * inverse;
  // Six answers tell a ratio roughly; a third of the belief stays with what the covariance says.
  constexpr double kMost = 25.0, kBelieved = 2.0 / 3.0;
  const double ratio = jackknife_ratio(all, sectors, solution.covariance);
  if (std::isfinite(ratio))
    solution.inflation = std::min(kBelieved * ratio + 1.0 - kBelieved, kMost);
  if (rows_in_turn)
    solution.sheared = sheared_by_motion(equations, rows, factorised, solution.scale, first, n);
  solution.common = common_covariance(equations, rows, factorised, solution.scale, first, n);
  solution.covariance = solution.inflation * solution.covariance + solution.common;
}

}  // namespace trochoid::tracking
