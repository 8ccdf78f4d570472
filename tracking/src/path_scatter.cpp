#include "path_scatter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

constexpr std::size_t kLeastOrder = 3, kMostOrder = 8;

// Coefficients of the difference of an order: binomial, with alternating signs.
std::vector<double> difference_of(std::size_t order) {
  std::vector<double> row{1.0};
  for (std::size_t k = 0; k < order; ++k) {
    row.push_back(0.0);
    for (std::size_t j = row.size() - 1; j > 0; --j) row[j] -= row[j - 1];
  }
  return row;
}

// Whether the samples from `first` on are frames one after the other, at equal times.
bool even(const std::vector<data::TrackSample>& samples, std::size_t first, std::size_t order) {
  constexpr double kUneven = 0.1;
  const double mean_s =
      (samples[first + order].t_s - samples[first].t_s) / static_cast<double>(order);
  for (std::size_t k = first; k < first + order; ++k) {
    if (!samples[k].has_covariance() || samples[k + 1].frame != samples[k].frame + 1) return false;
    if (std::abs(samples[k + 1].t_s - samples[k].t_s - mean_s) > kUneven * mean_s) return false;
  }
  return samples[first + order].has_covariance();
}

// Squared differences of one order over what the covariances allow them, mean of both directions,
// by their first sample; NaN where there is none.
std::vector<double> squares_of(const std::vector<data::TrackSample>& samples, std::size_t order) {
  const std::vector<double> weights = difference_of(order);
  std::vector<double> squares(samples.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t first = 0; first + order < samples.size(); ++first) {
    if (!even(samples, first, order)) continue;
    Eigen::Vector2d difference = Eigen::Vector2d::Zero();
    Eigen::Matrix2d allowed = Eigen::Matrix2d::Zero();
    for (std::size_t k = 0; k <= order; ++k) {
      difference += weights[k] * samples[first + k].centre_m;
      allowed += weights[k] * weights[k] * samples[first + k].covariance_m2;
    }
    squares[first] = 0.5 * difference.dot(allowed.ldlt().solve(difference));
  }
  return squares;
}

// The ratio of variances in a stretch about a sample; infinite where too little tells.
double ratio_about(const std::vector<double>& squares, std::size_t i, std::size_t order) {
  constexpr std::size_t kReach = 20, kFewest = 12;
  std::vector<double> near;
  const std::size_t middle = i - std::min(i, order / 2);
  for (std::size_t k = middle - std::min(middle, kReach);
       k < std::min(squares.size(), middle + kReach + 1); ++k)
    if (std::isfinite(squares[k])) near.push_back(squares[k]);
  if (near.size() < kFewest) return std::numeric_limits<double>::infinity();
  return data::median(std::move(near)) /
         std::numbers::ln2;  // that of two normal errors' mean square
}

}  // namespace

std::vector<double> unclaimed_scatter(const data::Track& track) {
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  std::vector<double> least(track.samples.size(), kUnknown);
  for (std::size_t order = kLeastOrder; order <= kMostOrder; ++order) {
    const std::vector<double> squares = squares_of(track.samples, order);
    for (std::size_t i = 0; i < least.size(); ++i)
      least[i] = std::min(least[i], ratio_about(squares, i, order));
  }
  for (double& ratio : least) ratio = ratio == kUnknown ? 1.0 : std::max(1.0, ratio);
  return least;
}

}  // namespace trochoid::tracking
