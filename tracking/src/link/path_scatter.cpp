#include "link/path_scatter.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

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

// A measured quantity and its covariance, of one entry or two.
struct Reading {
  Eigen::VectorXd value;
  Eigen::MatrixXd covariance;
};

std::optional<Reading> reading_of(const data::TrackSample& sample, Measured what) {
  if (what == Measured::centre) {
    if (!sample.has_covariance()) return std::nullopt;
    return Reading{sample.centre_m, sample.covariance_m2};
  }
  const auto& angle = what == Measured::theta ? sample.theta
                      : what == Measured::phi ? sample.phi
                                              : sample.psi;
  if (!angle) return std::nullopt;
  const double variance = angle->sigma_rad * angle->sigma_rad;
  return Reading{Eigen::VectorXd::Constant(1, angle->value_rad),
                 Eigen::MatrixXd::Constant(1, 1, variance)};
}

// Whether the samples from `first` on are frames one after the other, at equal times.
bool even(const std::vector<data::TrackSample>& samples, std::size_t first, std::size_t order) {
  constexpr double kUneven = 0.1;
  const double mean_s =
      (samples[first + order].t_s - samples[first].t_s) / static_cast<double>(order);
  for (std::size_t k = first; k < first + order; ++k) {
    if (samples[k + 1].frame != samples[k].frame + 1) return false;
    if (std::abs(samples[k + 1].t_s - samples[k].t_s - mean_s) > kUneven * mean_s) return false;
  }
  return true;
}

// The squared difference of one order from a sample on over what the covariances allow it, mean of
// its directions; NaN where there is none.
double square_at(const std::vector<data::TrackSample>& samples, Measured what,
                 const std::vector<double>& weights, std::size_t first) {
  Reading sum;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const auto reading = reading_of(samples[first + k], what);
    if (!reading) return std::numeric_limits<double>::quiet_NaN();
    if (k == 0) sum = {0.0 * reading->value, 0.0 * reading->covariance};
    sum.value += weights[k] * reading->value;
    sum.covariance += weights[k] * weights[k] * reading->covariance;
  }
  return sum.value.dot(sum.covariance.ldlt().solve(sum.value)) /
         static_cast<double>(sum.value.size());
}

// Of all samples; NaN also where frames are missing.
std::vector<double> squares_of(const std::vector<data::TrackSample>& samples, Measured what,
                               std::size_t order) {
  const std::vector<double> weights = difference_of(order);
  std::vector<double> squares(samples.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t first = 0; first + order < samples.size(); ++first)
    if (even(samples, first, order)) squares[first] = square_at(samples, what, weights, first);
  return squares;
}

// The median of the mean of one or two squared standard normal numbers.
double usual_square(Measured what) {
  return what == Measured::centre ? 0.6931 : 0.4549;
}

// In a stretch about a sample; infinite where too little tells.
double median_about(const std::vector<double>& squares, std::size_t i, std::size_t order) {
  constexpr std::size_t kReach = 20, kFewest = 12;
  std::vector<double> near;
  const std::size_t middle = i - std::min(i, order / 2);
  for (std::size_t k = middle - std::min(middle, kReach);
       k < std::min(squares.size(), middle + kReach + 1); ++k)
    if (std::isfinite(squares[k])) near.push_back(squares[k]);
  if (near.size() < kFewest) return std::numeric_limits<double>::infinity();
  return data::median(std::move(near));
}

}  // namespace

std::vector<double> unclaimed_scatter(const data::Track& track, Measured what) {
  constexpr double kUnknown = std::numeric_limits<double>::infinity();
  std::vector<double> least(track.samples.size(), kUnknown);
  for (std::size_t order = kLeastOrder; order <= kMostOrder; ++order) {
    const std::vector<double> squares = squares_of(track.samples, what, order);
    for (std::size_t i = 0; i < least.size(); ++i)
      least[i] = std::min(least[i], median_about(squares, i, order) / usual_square(what));
  }
  for (double& ratio : least) ratio = ratio == kUnknown ? 1.0 : std::max(1.0, ratio);
  return least;
}

}  // namespace trochoid::tracking
