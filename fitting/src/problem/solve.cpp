#include <ceres/ceres.h>
#include <fmt/core.h>
#include <glog/logging.h>

#include "problem/pole_steps.hpp"
#include "problem/problem.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {
namespace {

// All residuals of one arc, so that one integration serves them all. Blocks: shared, own (those
// that exist). Returns false where the model has no prediction: a rejected step.
class ArcCost : public ceres::CostFunction {
 public:
  ArcCost(const Problem& problem, int arc) : problem_(problem), arc_(arc) {
    columns_ = problem.columns_of(arc);
    shared_ = problem.shared_count();
    own_ = static_cast<int>(columns_.size()) - shared_;
    set_num_residuals(problem.arcs[arc].rows);
    if (shared_ > 0) mutable_parameter_block_sizes()->push_back(shared_);
    if (own_ > 0) mutable_parameter_block_sizes()->push_back(own_);
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    Eigen::VectorXd u = Eigen::VectorXd::Zero(problem_.free.size());
    for (int c = 0; c < static_cast<int>(columns_.size()); ++c)
      u[columns_[c]] = c < shared_ ? blocks[0][c] : blocks[shared_ > 0 ? 1 : 0][c - shared_];
    Eigen::VectorXd r;
    Eigen::MatrixXd j;
    if (!evaluate(problem_, arc_, u, r, jacobians != nullptr ? &j : nullptr, false)) return false;
    Eigen::Map<Eigen::VectorXd>(residuals, r.size()) = r;
    if (jacobians == nullptr) return true;
    write(j.leftCols(shared_), shared_ > 0 ? jacobians[0] : nullptr);
    write(j.rightCols(own_), own_ > 0 ? jacobians[shared_ > 0 ? 1 : 0] : nullptr);
    return true;
  }

 private:
  static void write(const Eigen::Ref<const Eigen::MatrixXd>& part, double* target) {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    if (target == nullptr || part.cols() == 0) return;
    if (part.cols() == 1)
      Eigen::Map<Eigen::VectorXd>(target, part.rows()) = part.col(0);
    else
      Eigen::Map<RowMajor>(target, part.rows(), part.cols()) = part;
  }

  const Problem& problem_;
  int arc_;
  std::vector<int> columns_;
  int shared_ = 0, own_ = 0;
};

// What is known from outside, (value - prior)/sigma; or a soft prior, the same on u itself.
class PriorCost : public ceres::CostFunction {
 public:
  PriorCost(const Transform& transform, const data::Prior& prior, bool turns, int size, int entry)
      : transform_(transform), prior_(prior), turns_(turns), size_(size), entry_(entry) {
    set_num_residuals(1);
    mutable_parameter_block_sizes()->push_back(size);
  }
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const double u = blocks[0][entry_];
    residuals[0] = off_prior(prior_, transform_.value(u), turns_);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      std::fill_n(jacobians[0], size_, 0.0);
      jacobians[0][entry_] = transform_.slope(u) / prior_.sigma;
    }
    return true;
  }

 private:
  Transform transform_;
  data::Prior prior_;
  bool turns_;
  int size_, entry_;
};

// Positions of the blocks in u: shared parameters first, then arc by arc.
struct Blocks {
  std::vector<int> first, size;
  explicit Blocks(const Problem& problem) {
    first.push_back(0);
    size.push_back(problem.shared_count());
    for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
      first.push_back(first.back() + size.back());
      size.push_back(static_cast<int>(problem.columns_of(arc).size()) - size.front());
    }
  }
};

// Parameters held for now are left out of their block's steps; near a pole steps are not those of
// the angles.
void hold(const Problem& problem, const Blocks& blocks, Eigen::VectorXd& u,
          ceres::Problem& ceres_problem) {
  for (int block = 0; block < static_cast<int>(blocks.size.size()); ++block) {
    std::vector<int> held;
    for (int i = 0; i < blocks.size[block]; ++i)
      if (problem.free[blocks.first[block] + i].held) held.push_back(i);
    double* const values = u.data() + blocks.first[block];
    if (auto steps = pole_steps(problem, blocks.first[block], blocks.size[block], u, held)) {
      ceres_problem.SetManifold(values, steps.release());
      continue;
    }
    if (held.empty()) continue;
    if (static_cast<int>(held.size()) == blocks.size[block])
      ceres_problem.SetParameterBlockConstant(values);
    else
      ceres_problem.SetManifold(values, new ceres::SubsetManifold(blocks.size[block], held));
  }
}

void add_costs(const Problem& problem, const Blocks& blocks, Eigen::VectorXd& u,
               ceres::Problem& ceres_problem) {
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    std::vector<double*> used;
    if (blocks.size[0] > 0) used.push_back(u.data());
    if (blocks.size[arc + 1] > 0) used.push_back(u.data() + blocks.first[arc + 1]);
    ceres_problem.AddResidualBlock(new ArcCost(problem, arc), nullptr, used);
  }
  const auto add_prior = [&](int i, const Transform& transform, const data::Prior& prior,
                             bool turns) {
    const int block = problem.free[i].arc + 1;
    ceres_problem.AddResidualBlock(
        new PriorCost(transform, prior, turns, blocks.size[block], i - blocks.first[block]),
        nullptr, u.data() + blocks.first[block]);
  };
  for (int i = 0; i < static_cast<int>(problem.free.size()); ++i) {
    const FreeParameter& parameter = problem.free[i];
    if (parameter.prior) add_prior(i, parameter.transform, *parameter.prior, parameter.turns);
    if (parameter.soft_prior) add_prior(i, Transform{}, *parameter.soft_prior, false);
  }
}

}  // namespace

namespace {

// Creeping along a flat valley when the iterations ran out: the last ten changed chi-square by less
// than 1, which moves nothing by more than its error bar.
bool settled(const ceres::Solver::Summary& summary) {
  const std::size_t n = summary.iterations.size();
  return summary.termination_type == ceres::NO_CONVERGENCE && n > 10 &&
         summary.iterations[n - 11].cost - summary.final_cost < 0.5;
}

}  // namespace

void silence_solver_log() {
  FLAGS_minloglevel = google::GLOG_FATAL;
}

Solution solve(const Problem& problem, const Eigen::VectorXd& u, const SolveOptions& options) {
  Solution solution;
  solution.u = u;
  ceres::Problem ceres_problem;
  const Blocks blocks(problem);
  add_costs(problem, blocks, solution.u, ceres_problem);
  hold(problem, blocks, solution.u, ceres_problem);
  ceres::Solver::Options ceres_options;
  // Of many arcs, each with a state of its own, most of the Jacobian is zeros: QR, which is more
  // accurate, would cost the cube of their number.
  constexpr std::size_t kMany = 8;
  ceres_options.linear_solver_type =
      problem.arcs.size() > kMany ? ceres::SPARSE_NORMAL_CHOLESKY : ceres::DENSE_QR;
  ceres_options.max_num_iterations = options.iterations;
  ceres_options.function_tolerance = options.function_tolerance;
  ceres_options.parameter_tolerance = 1e-11;
  ceres_options.gradient_tolerance = 1e-12;
  ceres_options.initial_trust_region_radius = options.initial_radius;
  ceres_options.max_num_consecutive_invalid_steps = 20;
  ceres_options.logging_type = ceres::SILENT;
  ceres_options.num_threads = 1;  // sums in one order: the same bits whatever the machine
  ceres::Solver::Summary summary;
  ceres::Solve(ceres_options, &ceres_problem, &summary);
  solution.chi2 = 2.0 * summary.final_cost;
  solution.usable = summary.IsSolutionUsable() && std::isfinite(solution.chi2);
  solution.converged = summary.termination_type == ceres::CONVERGENCE || settled(summary);
  solution.iterations = static_cast<int>(summary.iterations.size()) - 1;
  if (!solution.converged)
    solution.message = fmt::format("the minimum was not reached in {} steps", solution.iterations);
  if (problem.log)
    problem.log(fmt::format(
        "{} rows, {} parameters: chi2 {:.6g} -> {:.6g} in {} iterations, {} "
        "derivatives, {:.3g} s, work {:.3g}: {}",
        problem.rows(), problem.free.size(), 2.0 * summary.initial_cost, solution.chi2,
        solution.iterations, summary.num_jacobian_evaluations, summary.total_time_in_seconds,
        problem.work ? *problem.work : 0.0, summary.message));
  return solution;
}

}  // namespace trochoid::fitting
