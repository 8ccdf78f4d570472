#include <algorithm>
#include <cmath>
#include <limits>

#include "observe/angles.hpp"
#include "observe/decompositions.hpp"
#include "start/strategy.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"

// Multiple shooting. Segment j has its own initial state s_j; residuals r_j(s_j, p) and end state
// e_j(s_j, p). Continuity s_{j+1} = e_j is linearised,
//   ds_{j+1} = E_j ds_j + G_j dp + (e_j - s_{j+1}),
// so every ds_j is affine in (ds_0, dp): the chain is condensed to a small least-squares problem
// (Bock's method). A step is damped until the merit function, residuals plus gaps, falls.
namespace trochoid::fitting {
namespace {

struct Segment {
  ArcData data;
  double end_s = 0.0;
};

struct Linear {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;  // columns: state, then dynamics
  Eigen::VectorXd end;
  Eigen::MatrixXd end_jacobian;
};

class Chain {
 public:
  Chain(const Problem& problem, int segments) : problem_(problem) {
    const auto& parameters = problem.predictor->parameters();
    for (int i = 0; i < static_cast<int>(parameters.size()); ++i)
      if (parameters[i].role == model::ParameterInfo::Role::initial) state_.push_back(i);
    for (int i = 0; i < static_cast<int>(problem.free.size()); ++i)
      if (problem.free[i].arc < 0) dynamics_.push_back(i);
    const ArcData& arc = problem.arcs[0];
    const int n = static_cast<int>(arc.t_s.size());
    for (int j = 0; j < segments; ++j) {
      const int first = static_cast<int>(static_cast<long>(n) * j / segments);
      const int last = static_cast<int>(static_cast<long>(n) * (j + 1) / segments);
      Segment segment{arc.slice(first, last), last < n ? arc.t_s[last] : arc.t_s[n - 1]};
      segment.data.start_s = arc.t_s[first];
      segments_.push_back(std::move(segment));
    }
  }
  [[nodiscard]] int segments() const { return static_cast<int>(segments_.size()); }
  [[nodiscard]] int states() const { return static_cast<int>(state_.size()); }
  [[nodiscard]] const Segment& segment(int j) const { return segments_[j]; }
  [[nodiscard]] const std::vector<int>& state() const { return state_; }
  [[nodiscard]] const std::vector<int>& dynamics() const { return dynamics_; }

  // Residuals and end state of segment j; p in transformed coordinates.
  bool linearise(int j, const Eigen::VectorXd& s, const Eigen::VectorXd& p, bool derivatives,
                 Linear& out) const;

 private:
  const Problem& problem_;
  std::vector<int> state_, dynamics_;
  std::vector<Segment> segments_;
};

bool Chain::linearise(int j, const Eigen::VectorXd& s, const Eigen::VectorXd& p, bool derivatives,
                      Linear& out) const {
  const Segment& segment = segments_[j];
  const bool last = j + 1 == segments();
  Eigen::VectorXd values = problem_.base[0];
  for (int i = 0; i < states(); ++i) values[state_[i]] = s[i];
  for (std::size_t i = 0; i < dynamics_.size(); ++i) {
    const FreeParameter& parameter = problem_.free[dynamics_[i]];
    values[parameter.index] = parameter.transform.value(p[static_cast<int>(i)]);
  }
  if (!values.allFinite()) return false;
  Eigen::VectorXd sign;
  fold_tilt(*problem_.predictor, values, sign);
  std::vector<double> times = segment.data.t_s;
  if (!last) times.push_back(segment.end_s);
  model::PredictRequest request;
  request.t_s = times;
  request.start_s = segment.data.start_s;
  request.observables = segment.data.observables;
  request.tolerance = problem_.tolerance;
  request.max_steps = problem_.max_steps();
  request.want_end_state = !last;
  if (derivatives) {
    request.derivatives = state_;
    for (const int i : dynamics_) request.derivatives.push_back(problem_.free[i].index);
  }
  model::Prediction prediction;
  try {
    prediction = problem_.predictor->predict(values, request);
  } catch (const Error&) {
    return false;
  }
  whiten(segment.data, prediction.values, prediction.jacobian, out.residuals,
         derivatives ? &out.jacobian : nullptr);
  if (!out.residuals.allFinite()) return false;
  if (!last) {
    if (prediction.end_state.size() != states() || !prediction.end_state.allFinite()) return false;
    out.end = prediction.end_state;
    out.end_jacobian = prediction.end_state_jacobian;
  }
  if (!derivatives) return true;
  for (int i = 0; i < static_cast<int>(request.derivatives.size()); ++i) {
    double factor = sign[request.derivatives[i]];
    if (i >= states()) {
      const FreeParameter& parameter = problem_.free[dynamics_[i - states()]];
      factor *= parameter.transform.slope(p[i - states()]);
    }
    out.jacobian.col(i) *= factor;
    if (!last) out.end_jacobian.col(i) *= factor;
  }
  return out.jacobian.allFinite() && (last || out.end_jacobian.allFinite());
}

// Difference of two states; angles by the shortest way.
Eigen::VectorXd gap(const model::Predictor& predictor, const std::vector<int>& state,
                    const Eigen::VectorXd& to, const Eigen::VectorXd& from) {
  Eigen::VectorXd difference = to - from;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (predictor.parameters()[state[i]].unit == "rad")
      difference[i] = data::wrapped(difference[i]);
  return difference;
}

struct Iterate {
  std::vector<Eigen::VectorXd> s;
  Eigen::VectorXd p;
};

struct Merit {
  bool ok = false;
  double chi2 = 0.0, gaps = 0.0;  // gaps: sum |gap_i|/scale_i
};

}  // namespace

namespace {

class Shooter {
 public:
  Shooter(const Problem& problem, int segments) : problem_(problem), chain_(problem, segments) {}

  Found run(Iterate iterate) {
    Merit merit = evaluate_at(iterate);
    for (int iteration = 0; iteration < 60 && merit.ok; ++iteration) {
      Iterate step;
      if (!newton_step(iterate, step)) break;
      const double before = merit.chi2;
      if (!advance(iterate, step, merit)) {
        damping_ *= 10.0;
        if (damping_ > 1e8) break;
        continue;
      }
      damping_ = std::max(damping_ * 0.1, 1e-8);
      if (merit.gaps < 1e-6 && std::abs(before - merit.chi2) < 1e-6 * (1.0 + merit.chi2)) break;
    }
    Problem polished = problem_;
    for (int i = 0; i < chain_.states(); ++i) polished.base[0][chain_.state()[i]] = iterate.s[0][i];
    for (std::size_t i = 0; i < chain_.dynamics().size(); ++i) {
      const FreeParameter& parameter = problem_.free[chain_.dynamics()[i]];
      polished.base[0][parameter.index] = parameter.transform.value(iterate.p[static_cast<int>(i)]);
    }
    return judged(
        polished,
        minimise(polished, polished.start(), {.iterations = 30, .function_tolerance = 1e-3}),
        "multiple_shooting");
  }

  [[nodiscard]] const Chain& chain() const { return chain_; }

 private:
  Merit evaluate_at(const Iterate& at) const {
    Merit merit;
    Linear linear;
    for (int j = 0; j < chain_.segments(); ++j) {
      if (!chain_.linearise(j, at.s[j], at.p, false, linear)) return {};
      merit.chi2 += linear.residuals.squaredNorm();
      if (j + 1 < chain_.segments())
        merit.gaps += gap(*problem_.predictor, chain_.state(), linear.end, at.s[j + 1])
                          .cwiseQuotient(at.s[j + 1].cwiseAbs().cwiseMax(1.0))
                          .norm();
    }
    merit.ok = std::isfinite(merit.chi2);
    return merit;
  }

  // Condensed Gauss-Newton step with damping on the reduced unknowns.
  bool newton_step(const Iterate& at, Iterate& step) {
    const int ns = chain_.states(), np = static_cast<int>(chain_.dynamics().size());
    const int unknowns = ns + np;
    // ds_j = map_j (ds_0, dp) + shift_j
    Eigen::MatrixXd map = Eigen::MatrixXd::Identity(ns, unknowns);
    Eigen::VectorXd shift = Eigen::VectorXd::Zero(ns);
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns);
    std::vector<Eigen::MatrixXd> maps;
    std::vector<Eigen::VectorXd> shifts;
    for (int j = 0; j < chain_.segments(); ++j) {
      maps.push_back(map);
      shifts.push_back(shift);
      Linear linear;
      if (!chain_.linearise(j, at.s[j], at.p, true, linear)) return false;
      Eigen::MatrixXd condensed = linear.jacobian.leftCols(ns) * map;
      condensed.rightCols(np) += linear.jacobian.rightCols(np);
      const Eigen::VectorXd offset = linear.residuals + linear.jacobian.leftCols(ns) * shift;
      normal.noalias() += condensed.transpose() * condensed;
      right.noalias() -= condensed.transpose() * offset;
      if (j + 1 == chain_.segments()) break;
      const Eigen::MatrixXd next = linear.end_jacobian.leftCols(ns) * map;
      shift = linear.end_jacobian.leftCols(ns) * shift +
              gap(*problem_.predictor, chain_.state(), linear.end, at.s[j + 1]);
      map = next;
      map.rightCols(np) += linear.end_jacobian.rightCols(np);
    }
    Eigen::VectorXd diagonal = normal.diagonal().cwiseMax(1e-12 * normal.diagonal().maxCoeff());
    normal.diagonal() += damping_ * diagonal;
    const Eigen::VectorXd delta = SymmetricEquations(normal).solve(right);
    if (!delta.allFinite()) return false;
    step.p = delta.tail(np);
    step.s.clear();
    for (int j = 0; j < chain_.segments(); ++j) step.s.push_back(maps[j] * delta + shifts[j]);
    return true;
  }

  // Backtracking on the l1 merit; the weight of the gaps grows with the chi-square to be defended.
  bool advance(Iterate& iterate, const Iterate& step, Merit& merit) const {
    const double weight = 10.0 * (1.0 + merit.chi2);
    const double before = merit.chi2 + weight * merit.gaps;
    for (double length = 1.0; length > 0.01; length *= 0.5) {
      Iterate trial = iterate;
      trial.p += length * step.p;
      for (std::size_t j = 0; j < trial.s.size(); ++j) trial.s[j] += length * step.s[j];
      const Merit after = evaluate_at(trial);
      if (!after.ok || after.chi2 + weight * after.gaps >= before) continue;
      iterate = std::move(trial);
      merit = after;
      return true;
    }
    return false;
  }

  const Problem& problem_;
  Chain chain_;
  double damping_ = 1e-3;
};

}  // namespace

Found multiple_shooting(const Problem& problem, int segments, const NodeStarter& nodes) {
  Shooter shooter(problem, segments);
  Iterate iterate;
  const Chain& chain = shooter.chain();
  iterate.p.resize(static_cast<int>(chain.dynamics().size()));
  const Eigen::VectorXd u = problem.start();
  for (std::size_t i = 0; i < chain.dynamics().size(); ++i)
    iterate.p[static_cast<int>(i)] = u[chain.dynamics()[i]];
  for (int j = 0; j < segments; ++j) {
    Eigen::VectorXd values = problem.base[0];
    nodes(chain.segment(j).data.start_s, values);
    Eigen::VectorXd s(chain.states());
    for (int i = 0; i < chain.states(); ++i) s[i] = values[chain.state()[i]];
    iterate.s.push_back(s);
  }
  return shooter.run(std::move(iterate));
}

}  // namespace trochoid::fitting
