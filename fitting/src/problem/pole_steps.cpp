#include "problem/pole_steps.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "observe/angles.hpp"

namespace trochoid::fitting {
namespace {

using Vector4 = Eigen::Vector4d;
using Matrix4 = Eigen::Matrix4d;

constexpr double kAtThePole = 1e-9;  // keeps an azimuth defined

// Polar: theta, phi and their rates. Cartesian: p = theta (cos phi, sin phi) and p's rate q.
Vector4 cartesian(const Vector4& polar) {
  const double theta = polar[0], c = std::cos(polar[1]), s = std::sin(polar[1]);
  const double along = polar[2], across = theta * polar[3];
  return {theta * c, theta * s, along * c - across * s, along * s + across * c};
}

// The one whose azimuth is nearest.
Vector4 polar(const Vector4& at, double near_phi) {
  const double theta = std::max(std::hypot(at[0], at[1]), kAtThePole);
  const double direction = std::atan2(at[1], at[0]), c = std::cos(direction),
               s = std::sin(direction);
  return {theta, continued(direction, near_phi), at[2] * c + at[3] * s,
          (at[3] * c - at[2] * s) / theta};
}

// d cartesian / d polar.
Matrix4 slope(const Vector4& polar) {
  const double theta = polar[0], c = std::cos(polar[1]), s = std::sin(polar[1]);
  const double along = polar[2], rate = polar[3];
  Matrix4 j = Matrix4::Zero();
  j.col(0) << c, s, -rate * s, rate * c;
  j.col(1) << -theta * s, theta * c, -along * s - theta * rate * c, along * c - theta * rate * s;
  j.col(2) << 0.0, 0.0, c, s;
  j.col(3) << 0.0, 0.0, -theta * s, theta * c;
  return j;
}

class PoleSteps : public ceres::Manifold {
 public:
  PoleSteps(int size, const std::array<int, 4>& polar, const std::vector<int>& held)
      : size_(size), polar_(polar) {
    for (int i = 0; i < size; ++i)
      if (std::find(held.begin(), held.end(), i) == held.end()) moved_.push_back(i);
  }
  [[nodiscard]] int AmbientSize() const override { return size_; }
  [[nodiscard]] int TangentSize() const override { return static_cast<int>(moved_.size()); }

  bool Plus(const double* x, const double* delta, double* sum) const override {
    std::copy_n(x, size_, sum);
    Vector4 step = Vector4::Zero();
    for (std::size_t k = 0; k < moved_.size(); ++k)
      if (const int place = place_of(moved_[k]); place >= 0)
        step[place] = delta[k];
      else
        sum[moved_[k]] += delta[k];
    if (!step.isZero(0.0)) put(polar(cartesian(get(x)) + step, x[polar_[1]]), sum);
    return true;
  }
  bool PlusJacobian(const double* x, double* jacobian) const override {
    const Matrix4 inverse = slope(get(x)).inverse();
    Eigen::Map<RowMajor> j(jacobian, size_, TangentSize());
    j.setZero();
    for (std::size_t k = 0; k < moved_.size(); ++k) {
      const auto column = static_cast<Eigen::Index>(k);
      if (const int place = place_of(moved_[k]); place >= 0)
        for (int row = 0; row < 4; ++row) j(polar_[row], column) = inverse(row, place);
      else
        j(moved_[k], column) = 1.0;
    }
    return j.allFinite();
  }
  bool Minus(const double* y, const double* x, double* difference) const override {
    const Vector4 step = cartesian(get(y)) - cartesian(get(x));
    for (std::size_t k = 0; k < moved_.size(); ++k) {
      const int place = place_of(moved_[k]);
      difference[k] = place >= 0 ? step[place] : y[moved_[k]] - x[moved_[k]];
    }
    return true;
  }
  bool MinusJacobian(const double* x, double* jacobian) const override {
    const Matrix4 forward = slope(get(x));
    Eigen::Map<RowMajor> j(jacobian, TangentSize(), size_);
    j.setZero();
    for (std::size_t k = 0; k < moved_.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      if (const int place = place_of(moved_[k]); place >= 0)
        for (int column = 0; column < 4; ++column) j(row, polar_[column]) = forward(place, column);
      else
        j(row, moved_[k]) = 1.0;
    }
    return true;
  }

 private:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  [[nodiscard]] int place_of(int entry) const {
    const auto* at = std::find(polar_.begin(), polar_.end(), entry);
    return at == polar_.end() ? -1 : static_cast<int>(at - polar_.begin());
  }
  [[nodiscard]] Vector4 get(const double* x) const {
    return {x[polar_[0]], x[polar_[1]], x[polar_[2]], x[polar_[3]]};
  }
  void put(const Vector4& values, double* x) const {
    for (int i = 0; i < 4; ++i) x[polar_[i]] = values[i];
  }

  int size_;
  std::array<int, 4> polar_;  // entries of the block: theta, phi and their rates
  std::vector<int> moved_;
};

}  // namespace

std::unique_ptr<ceres::Manifold> pole_steps(const Problem& problem, int first, int size,
                                            const Eigen::VectorXd& u,
                                            const std::vector<int>& held) {
  constexpr double kNear_rad = 0.3;
  constexpr const char* kNames[] = {"theta_rad", "phi_rad", "dtheta_rad_s", "dphi_rad_s"};
  if (!problem.predictor->model_name().starts_with("top")) return nullptr;
  std::array<int, 4> polar{-1, -1, -1, -1};
  for (int i = 0; i < size; ++i) {
    const FreeParameter& parameter = problem.free[first + i];
    const bool plain = parameter.transform.kind == Transform::Kind::identity;
    for (int k = 0; k < 4; ++k)
      if (plain && parameter.index == problem.predictor->index_of(kNames[k])) polar[k] = i;
  }
  for (const int entry : polar)
    if (entry < 0 || std::find(held.begin(), held.end(), entry) != held.end()) return nullptr;
  const double theta = u[first + polar[0]];
  if (!(theta > kAtThePole && theta < kNear_rad)) return nullptr;
  return std::make_unique<PoleSteps>(size, polar, held);
}

}  // namespace trochoid::fitting
