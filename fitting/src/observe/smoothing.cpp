#include "observe/smoothing.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "trochoid/data/quantile.hpp"

namespace trochoid::fitting {
namespace {

constexpr int kMaxColumns = 4;
using Coefficients = Eigen::Matrix<double, 4, Eigen::Dynamic, 0, 4, kMaxColumns>;

// Basis 1, u, u^2, u^3 of u = (t - t_at)/scale at the samples of a window, one column each.
Eigen::Matrix4Xd basis_of(std::span<const double> t_s, int first, int count, int at, double scale) {
  Eigen::Matrix4Xd basis(4, count);
  for (int i = 0; i < count; ++i) {
    const double u = (t_s[first + i] - t_s[at]) / scale;
    basis.col(i) << 1.0, u, u * u, u * u * u;
  }
  return basis;
}

// Cubics through windows of samples. Windows of evenly spaced samples about their middle are all
// alike: their coefficients are one set of weights on the samples.
class WindowCubics {
 public:
  WindowCubics(std::span<const double> t_s, const Eigen::MatrixXd& samples, int half_width)
      : t_s_(t_s), samples_(samples), half_width_(half_width), even_since_(t_s.size(), 0) {
    constexpr double kJitter = 1e-6;  // of a step
    for (std::size_t i = 2; i < t_s.size(); ++i) {
      const double step_s = t_s[i] - t_s[i - 1], before_s = t_s[i - 1] - t_s[i - 2];
      const bool even = std::abs(step_s - before_s) < kJitter * before_s;
      even_since_[i] = even ? even_since_[i - 1] : static_cast<int>(i) - 1;
    }
  }

  // About the time of sample `at`: rows are c0..c3 of sum c_k (t - t_at)^k.
  [[nodiscard]] Coefficients operator()(int first, int count, int at) {
    const double scale = std::max(t_s_[first + count - 1] - t_s_[first], 1e-300);
    const bool usual = count == 2 * half_width_ + 1 && at == first + half_width_;
    Coefficients c(4, samples_.cols());
    if (usual && even_since_[first + count - 1] <= first) {
      if (weights_.cols() == 0) {
        const Eigen::Matrix4Xd basis = basis_of(t_s_, first, count, at, scale);
        weights_ = Eigen::Matrix4d(basis * basis.transpose()).ldlt().solve(basis);
      }
      c.noalias() = weights_ * samples_.middleRows(first, count);
    } else {
      const Eigen::Matrix4Xd basis = basis_of(t_s_, first, count, at, scale);
      c.noalias() = basis * samples_.middleRows(first, count);
      c = Eigen::Matrix4d(basis * basis.transpose()).ldlt().solve(c).eval();
    }
    for (int k = 1; k < 4; ++k) c.bottomRows(4 - k) /= scale;
    return c;
  }

 private:
  std::span<const double> t_s_;
  const Eigen::MatrixXd& samples_;
  int half_width_;
  std::vector<int> even_since_;  ///< per sample, the first of the evenly spaced ones it ends
  Eigen::Matrix4Xd weights_;
};

int window_start(int at, int half_width, int count, int n) {
  return std::clamp(at - half_width, 0, n - count);
}

double robust_sigma(std::vector<double> residuals) {
  for (double& residual : residuals) residual = std::abs(residual);
  return data::kSdOverMedianDistance * median_or_zero(std::move(residuals));
}

// Variance of the centre residual of a w-sample cubic is sigma^2 (1 - leverage).
double centre_leverage(int w) {
  return (9.0 * w * w - 21.0) / (4.0 * w * (static_cast<double>(w) * w - 4.0));
}

// Residuals about the window cubics at every `stride`-th inner sample.
std::vector<double> centre_residuals(std::span<const double> t_s, const Eigen::MatrixXd& samples,
                                     int half_width, int stride) {
  const int n = static_cast<int>(t_s.size());
  WindowCubics cubic(t_s, samples, half_width);
  std::vector<double> residuals;
  for (int at = half_width; at < n - half_width; at += stride) {
    const Coefficients c = cubic(at - half_width, 2 * half_width + 1, at);
    for (Eigen::Index k = 0; k < samples.cols(); ++k) residuals.push_back(samples(at, k) - c(0, k));
  }
  return residuals;
}

// Enough windows for a noise estimate to 10 %, however long the track.
int sparse_stride(int n) {
  return std::max(1, n / 150);
}

}  // namespace

double median_or_zero(std::vector<double> values) {
  return values.empty() ? 0.0 : data::median(std::move(values));
}

SmoothCurve smooth(std::span<const double> t_s, const Eigen::MatrixXd& samples, int half_width) {
  const int n = static_cast<int>(t_s.size());
  const int count = std::min(2 * half_width + 1, n);
  SmoothCurve out{samples, samples, samples, half_width};
  WindowCubics cubic(t_s, samples, half_width);
  for (int at = 0; at < n; ++at) {
    const Coefficients c = cubic(window_start(at, half_width, count, n), count, at);
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
  if (n < kFewestForNoise) return least;
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
