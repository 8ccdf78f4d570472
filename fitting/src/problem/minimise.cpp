#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include "observe/decompositions.hpp"
#include "problem/problem.hpp"

// Levenberg-Marquardt with geodesic acceleration: what is left of the residuals beyond the tangent
// plane, seen at a tenth of a step, bends the step along the valley [TranstrumSethna2012].
namespace trochoid::fitting {
namespace {

// Residuals of a single-arc problem, below them what is known from outside; derivatives if wanted.
bool all_rows(const Problem& problem, const Eigen::VectorXd& u, Eigen::VectorXd& rows,
              Eigen::MatrixXd* jacobian) {
  if (!evaluate(problem, 0, u, rows, jacobian, false)) return false;
  const auto add = [&](Eigen::Index i, double residual, double slope) {
    rows.conservativeResize(rows.size() + 1);
    rows[rows.size() - 1] = residual;
    if (jacobian == nullptr) return;
    jacobian->conservativeResize(jacobian->rows() + 1, Eigen::NoChange);
    jacobian->bottomRows<1>().setZero();
    (*jacobian)(jacobian->rows() - 1, i) = slope;
  };
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const FreeParameter& known = problem.free[i];
    // A held parameter still pays for its distance from what was known of it.
    if (known.prior)
      add(i, off_prior(*known.prior, known.transform.value(u[i]), known.turns),
          known.held ? 0.0 : known.transform.slope(u[i]) / known.prior->sigma);
    if (known.soft_prior && !known.held)
      add(i, (u[i] - known.soft_prior->value) / known.soft_prior->sigma,
          1.0 / known.soft_prior->sigma);
  }
  return true;
}

class GeodesicDescent {
 public:
  GeodesicDescent(const Problem& problem, const Eigen::VectorXd& u, const SolveOptions& options)
      : problem_(problem), options_(options), damping_(1.0 / options.initial_radius), u_(u) {}

  Solution run() {
    Solution solution;
    solution.u = u_;
    solution.chi2 = std::numeric_limits<double>::infinity();
    if (!all_rows(problem_, u_, rows_, nullptr) || !look()) {
      solution.message = "no prediction at the start";
      return solution;
    }
    solution.usable = true;
    // What is less moves nothing by a hundredth of its error bar.
    constexpr double kEnough = 1e-7;
    const double enough = std::max(options_.function_tolerance, kEnough);
    const double before = chi2_;
    std::deque<double> lately;
    for (int idle = 0; solution.iterations < options_.iterations;) {
      const double last = chi2_;
      lately.push_back(last);
      if (lately.size() > kLately) lately.pop_front();
      const bool moved = advance();
      ++solution.iterations;
      idle = last - chi2_ < enough * chi2_ ? idle + 1 : 0;
      // A strongly damped step that gains little may be the first of many.
      constexpr double kFree = 1e-3;
      solution.converged = moved ? idle > (damping_ < kFree ? 0 : 1) : !no_trial_finite_;
      if (!moved || solution.converged || solution.iterations == options_.iterations || !look())
        break;
    }
    // Creeping along a flat valley when the steps ran out.
    if (solution.iterations == options_.iterations && lately.size() == kLately)
      solution.converged = solution.converged || lately.front() - chi2_ < 1.0;
    solution.u = u_;
    solution.chi2 = chi2_;
    if (!solution.converged)
      solution.message =
          fmt::format("the minimum was not reached in {} steps", solution.iterations);
    if (problem_.log)
      problem_.log(fmt::format(
          "{} rows, {} parameters: chi2 {:.6g} -> {:.6g} in {} steps, {}, "
          "work {:.3g}",
          problem_.rows(), problem_.free.size(), before, chi2_, solution.iterations,
          fmt::format("damping {:.2g}", damping_), problem_.work ? *problem_.work : 0.0));
    return solution;
  }

 private:
  // Derivatives where we are. The residuals stay those of the run without: with derivatives the
  // integration takes other steps, and where friction is nearly sharp its error changes chi-square
  // by more than a step along the valley gains; only like is compared with like.
  bool look() {
    Eigen::VectorXd rows;
    if (!all_rows(problem_, u_, rows, &jacobian_)) return false;
    chi2_ = rows_.squaredNorm();
    normal_ = jacobian_.transpose() * jacobian_;
    constexpr double kLeast = 1e-6;  // of what no residual sees yet
    scale2_ = normal_.diagonal().cwiseMax(kLeast);
    return true;
  }

  // The damped linear problem's answer to these residuals.
  [[nodiscard]] Eigen::VectorXd answer(const Eigen::VectorXd& rows) const {
    return unit_.cwiseProduct(
        equations_.solve(unit_.cwiseProduct(-(jacobian_.transpose() * rows))));
  }
  void factorise() {
    Eigen::MatrixXd damped = normal_;
    damped.diagonal() += damping_ * scale2_;
    unit_ = damped.diagonal().cwiseSqrt().cwiseInverse();
    equations_ = SymmetricEquations(unit_.asDiagonal() * damped * unit_.asDiagonal());
  }
  void damp(double times) {
    constexpr double kSome = 1e-9;
    damping_ = times * std::max(damping_, kSome);
  }

  // A step that leads downhill, or none (no entries).
  struct Way {
    Eigen::VectorXd step, rows;
    double chi2 = std::numeric_limits<double>::infinity(), kept = 0.0, damping = 0.0;
  };

  // One step downhill, with as much damping as it takes. @returns false where there is none. A step
  // that is too long for its bend may lead down as well, far above the valley's floor: it is taken
  // if a few shorter ones are bent too (bodies seen by their positions alone take twice as long
  // without, and some end in another valley).
  bool advance() {
    constexpr int kAttempts = 14, kPatience = 3;
    constexpr double kNothing = 1e-12, kSome = 0.25;
    Way straight;
    int waited = 0;
    no_trial_finite_ = true;
    for (int attempt = 0; attempt < kAttempts && waited <= kPatience; ++attempt) {
      factorise();
      const Eigen::VectorXd step = answer(rows_);
      const double predicted = chi2_ - (rows_ + jacobian_ * step).squaredNorm();
      if (!(predicted > kNothing * chi2_)) {
        no_trial_finite_ = false;
        break;
      }
      const Eigen::VectorXd bend = bend_of(step);
      if (bend.size() > 0) {
        const Way way = tried(step + 0.5 * bend, predicted);
        if (way.chi2 < std::min(chi2_, straight.chi2)) return take(way);
        no_trial_finite_ = no_trial_finite_ && !std::isfinite(way.chi2);
        damp(std::isfinite(way.chi2) ? 5.0 : 30.0);
      } else if (straight.step.size() == 0) {
        Way way = tried(step, predicted);
        no_trial_finite_ = no_trial_finite_ && !std::isfinite(way.chi2);
        damp(std::isfinite(way.chi2) ? 4.0 : 30.0);
        if (way.kept > kSome) straight = std::move(way);
      } else {
        damp(4.0);
      }
      waited += straight.step.size() > 0 ? 1 : 0;
    }
    return straight.step.size() > 0 && take(straight);
  }

  [[nodiscard]] Way tried(const Eigen::VectorXd& step, double predicted) const {
    Way way;
    way.step = step;
    way.damping = damping_;
    if (!all_rows(problem_, u_ + step, way.rows, nullptr)) return way;
    way.chi2 = way.rows.squaredNorm();
    way.kept = (chi2_ - way.chi2) / predicted;
    return way;
  }

  // Damping is lowered fast and raised slowly: the valley's floor is found by long steps.
  bool take(const Way& way) {
    constexpr double kMuch = 0.75, kSome = 0.25, kLeastDamping = 1e-12;
    damping_ = way.damping;
    if (way.kept > kSome)
      damping_ = std::max(damping_ * (way.kept > kMuch ? 0.05 : 0.2), kLeastDamping);
    u_ += way.step;
    rows_ = way.rows;
    chi2_ = way.chi2;
    return true;
  }

  // Second derivative of the step along the valley, from the residuals at a tenth of it; empty
  // where it is no small correction.
  [[nodiscard]] Eigen::VectorXd bend_of(const Eigen::VectorXd& step) const {
    constexpr double kShare = 0.1, kMostBent = 0.75;
    Eigen::VectorXd rows;
    if (!all_rows(problem_, u_ + kShare * step, rows, nullptr)) return {};
    const Eigen::VectorXd bend =
        answer(2.0 / (kShare * kShare) * (rows - rows_ - kShare * (jacobian_ * step)));
    const Eigen::VectorXd scale = scale2_.cwiseSqrt();
    const bool small =
        2.0 * scale.cwiseProduct(bend).norm() <= kMostBent * scale.cwiseProduct(step).norm();
    return small ? bend : Eigen::VectorXd{};
  }

  static constexpr std::size_t kLately = 10;  // steps
  const Problem& problem_;
  const SolveOptions& options_;
  /// No step tried in the last advance led where anything can be predicted.
  bool no_trial_finite_ = false;
  double damping_, chi2_ = 0.0;
  Eigen::VectorXd u_, rows_, scale2_, unit_;
  Eigen::MatrixXd jacobian_, normal_;
  SymmetricEquations equations_;
};

}  // namespace

Solution minimise(const Problem& problem, const Eigen::VectorXd& u, const SolveOptions& options) {
  const bool rim = problem.predictor->index_of("w1_rad_s") >= 0;
  const bool spin_down = problem.predictor->model_name() == "pivot";
  if (problem.arcs.size() > 1 || !(rim || spin_down)) return solve(problem, u, options);
  if (rim) return GeodesicDescent(problem, u, options).run();
  // From afar its bent steps go astray where an angle is off by turns.
  const Solution near = solve(problem, u, options);
  return GeodesicDescent(problem, near.usable ? near.u : u, options).run();
}

}  // namespace trochoid::fitting
