#include "judge/influence.hpp"

#include <algorithm>

#include "observe/decompositions.hpp"
#include "problem/linearise.hpp"

namespace trochoid::fitting {
namespace {

struct Sample {
  int arc = 0, index = 0;
  double leverage = 0.0;
};

// The share a sample with these readings has in the direction of the parameters it says most of: 1
// where it alone does; 0 where all directions together leave it no more than `least`.
double leverage_of(const std::vector<const Reading*>& readings, const Eigen::MatrixXd& rows,
                   double least) {
  double all = 0.0;  // shares in all directions together
  for (const Reading* reading : readings)
    all += rows.middleRows(reading->row, rows_of(reading->channel)).squaredNorm();
  if (all < least) return 0.0;
  Eigen::MatrixXd own(0, rows.cols());
  for (const Reading* reading : readings) {
    const int width = rows_of(reading->channel);
    own.conservativeResize(own.rows() + width, Eigen::NoChange);
    own.bottomRows(width) = rows.middleRows(reading->row, width);
  }
  const double largest = largest_singular_value(own);
  return largest * largest;
}

std::vector<Sample> carrying_most(const Problem& problem, const Eigen::VectorXd& u) {
  constexpr double kMostOfIt = 0.8;
  constexpr std::size_t kFew = 3;
  const Eigen::MatrixXd basis = reachable(linearise(problem, u));
  std::vector<Sample> samples;
  int row = 0;
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc) {
    const ArcData& data = problem.arcs[arc];
    const Eigen::MatrixXd rows = basis.middleRows(row, data.rows);
    row += data.rows;
    std::vector<std::vector<const Reading*>> of_sample(data.t_s.size());
    for (const Reading& reading : data.readings) of_sample[reading.sample].push_back(&reading);
    for (int i = 0; i < static_cast<int>(data.t_s.size()); ++i)
      if (const double share = leverage_of(of_sample[i], rows, kMostOfIt); share > kMostOfIt)
        samples.push_back({arc, i, share});
  }
  std::stable_sort(samples.begin(), samples.end(),
                   [](const Sample& a, const Sample& b) { return a.leverage > b.leverage; });
  samples.resize(std::min(samples.size(), kFew));
  return samples;
}

// The same problem, to which a sample says nothing.
Problem without_weight_of(Problem problem, const Sample& sample) {
  const ArcData& data = problem.arcs[sample.arc];
  Eigen::VectorXd& weights = problem.row_weights[sample.arc];
  if (weights.size() == 0) weights = Eigen::VectorXd::Ones(data.rows);
  for (const Reading& reading : data.readings)
    if (reading.sample == sample.index)
      weights.segment(reading.row, rows_of(reading.channel)).setZero();
  return problem;
}

}  // namespace

std::vector<InfluentialSample> influential_samples(const Problem& problem, const Solution& solution,
                                                   const Eigen::VectorXd& sigmas) {
  // A sample with nine tenths of a direction moves it by three error bars when it goes, and that is
  // in order.
  constexpr double kFar = 5.0;
  const SolveOptions down{.iterations = 60, .function_tolerance = 1e-7};
  std::vector<InfluentialSample> found;
  for (const Sample& sample : carrying_most(problem, solution.u)) {
    Problem others = without_weight_of(problem, sample);
    // The integration's noise stops a descent along a floor that hardly slopes.
    constexpr double kFine = 1e-8;
    others.tolerance = std::min(problem.tolerance, kFine);
    const Solution there = minimise(others, solution.u, down);
    if (!there.usable) continue;
    InfluentialSample without{problem.arcs[sample.arc].t_s[sample.index],
                              Eigen::VectorXd(sigmas.size())};
    for (int i = 0; i < static_cast<int>(sigmas.size()); ++i)
      without.shift[i] = problem.value(i, there.u) - problem.value(i, solution.u);
    if ((without.shift.cwiseAbs() - kFar * sigmas).maxCoeff() > 0.0)
      found.push_back(std::move(without));
  }
  return found;
}

}  // namespace trochoid::fitting
