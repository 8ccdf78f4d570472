#include "smoothing.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "trochoid/data/quantile.hpp"

namespace trochoid::fitting {
namespace {

constexpr int kMaxColumns = 4;
using Coefficients = Eigen::Matrix<double, 4, Eigen::Dynamic, 0, 4, kMaxColumns>;

// Cubic through one window about the time of sample `at`: rows are c0..c3 of sum c_k (t - t_at)^k.
Coefficients window_cubic(std::span<const double> t_s, const Eigen::MatrixXd& samples, int first,
                          int count, int at) {
  const double scale = std::max(t_s[first + count - 1] - t_s[first], 1e-300);
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Coefficients right = Coefficients::Zero(4, samples.cols());
  for (int i = first; i < first + count; ++i) {
    const double u = (t_s[i] - t_s[at]) / scale;
    const Eigen::Vector4d basis(1.0, u, u * u, u * u * u);
    normal.noalias() += basis * basis.transpose();
    right.noalias() += basis * samples.row(i);
  }
  Coefficients c = normal.ldlt().solve(right);
  for (int k = 1; k < 4; ++k) c.bottomRows(4 - k) /= scale;
  return c;
}

int window_start(int at, int half_width, int count, int n) {
  return std::clamp(at - half_width, 0, n - count);
}

double robust_sigma(std::vector<double> residuals) {
  for (double& residual : residuals) residual = std::abs(residual);
  return 1.4826 * median(std::move(residuals));
}

// Variance of the centre residual of a w-sample cubic is sigma^2 (1 - leverage).
double centre_leverage(int w) {
  return (9.0 * w * w - 21.0) / (4.0 * w * (static_cast<double>(w) * w - 4.0));
}

// Residuals about the window cubics at every `stride`-th inner sample.
std::vector<double> centre_residuals(std::span<const double> t_s, const Eigen::MatrixXd& samples,
                                     int half_width, int stride) {
  const int n = static_cast<int>(t_s.size());
  std::vector<double> residuals;
  for (int at = half_width; at < n - half_width; at += stride) {
    const Coefficients c = window_cubic(t_s, samples, at - half_width, 2 * half_width + 1, at);
    for (Eigen::Index k = 0; k < samples.cols(); ++k) residuals.push_back(samples(at, k) - c(0, k));
  }
  return residuals;
}

// Enough windows for a noise estimate to 10 %, however long the track.
int sparse_stride(int n) {
  return std::max(1, n / 150);
}

}  // namespace

double median(std::vector<double> values) {
  return values.empty() ? 0.0 : data::median(std::move(values));
}

SmoothCurve smooth(std::span<const double> t_s, const Eigen::MatrixXd& samples, int half_width) {
  const int n = static_cast<int>(t_s.size());
  const int count = std::min(2 * half_width + 1, n);
  SmoothCurve out{samples, samples, samples, half_width};
  for (int at = 0; at < n; ++at) {
    const Coefficients c =
        window_cubic(t_s, samples, window_start(at, half_width, count, n), count, at);
    out.value.row(at) = c.row(0);
    out.first.row(at) = c.row(1);
    out.second.row(at) = 2.0 * c.row(2);
  }
  return out;
}

double noise_about_smooth_curve(std::span<const double> t_s, const Eigen::MatrixXd& samples) {
  const int n = static_cast<int>(t_s.size());
  const double extent =
      n > 0 ? (samples.colwise().maxCoeff() - samples.colwise().minCoeff()).maxCoeff() : 0.0;
  const double least = std::max(1e-9 * extent, 1e-12);
  if (n < 9) return std::max(1e-3 * extent, least);
  const double sigma = robust_sigma(centre_residuals(t_s, samples, 3, sparse_stride(n)));
  return std::max(sigma / std::sqrt(1.0 - centre_leverage(7)), least);
}

SmoothCurve smooth_auto(std::span<const double> t_s, const Eigen::MatrixXd& samples) {
  const int n = static_cast<int>(t_s.size());
  const double noise = noise_about_smooth_curve(t_s, samples);
  int best = 3;
  for (int half_width = 4; 2 * half_width + 1 <= n / 2; half_width += 1 + half_width / 3) {
    const double sigma =
        robust_sigma(centre_residuals(t_s, samples, half_width, sparse_stride(n))) /
        std::sqrt(1.0 - centre_leverage(2 * half_width + 1));
    // 1.2: a lack of fit of two thirds of the noise; wider windows would bias the derivatives.
    if (sigma > 1.2 * noise) break;
    best = half_width;
  }
  return smooth(t_s, samples, best);
}

namespace {

// Weights of the divided difference of t_s[first .. first + order], of unit length.
Eigen::VectorXd difference_weights(std::span<const double> t_s, int first, int order) {
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(order + 1);
  const double unit = (t_s[first + order] - t_s[first]) / order;
  for (int i = 0; i <= order; ++i)
    for (int k = 0; k <= order; ++k)
      if (k != i) weights[i] *= unit / (t_s[first + i] - t_s[first + k]);
  return weights.normalized();
}

}  // namespace

double white_noise(std::span<const double> t_s, const Eigen::MatrixXd& samples) {
  const int n = static_cast<int>(t_s.size());
  double least = std::numeric_limits<double>::infinity();
  if (n < 20) return least;
  for (const int order : {6, 8}) {
    std::vector<double> differences;
    for (int first = 0; first + order < n; ++first) {
      const Eigen::VectorXd weights = difference_weights(t_s, first, order);
      for (Eigen::Index c = 0; c < samples.cols(); ++c)
        differences.push_back(weights.dot(samples.col(c).segment(first, order + 1)));
    }
    least = std::min(least, robust_sigma(std::move(differences)));
  }
  return least;
}

}  // namespace trochoid::fitting
