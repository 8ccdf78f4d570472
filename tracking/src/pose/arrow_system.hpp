#pragma once
#include <algorithm>
#include <array>
#include <cmath>

namespace trochoid::tracking {

/// Normal equations of a least-squares fit with a few unknowns common to all equations and rings of
/// unknowns of which an equation sees two neighbours of one ring only: rings first, the common
/// ones last. The Cholesky factor then keeps the zeros in front of each row.
class ArrowSystem {
 public:
  static constexpr int kMost = 44;
  ArrowSystem() = default;
  /// All zero. @param rings, knots numbers of rings and of unknowns in each.
  ArrowSystem(int rings, int knots, int common) : size_(rings * knots + common) {
    for (int i = 0; i < size_; ++i) {
      const int knot = i % std::max(knots, 1), ring = i - knot;
      // The last of a ring is the neighbour of its first.
      first_[at(i)] = i >= rings * knots  ? 0
                      : knot == knots - 1 ? ring
                                          : ring + std::max(0, knot - 1);
      std::fill(row(i) + first_[at(i)], row(i) + i + 1, 0.0);
    }
  }
  [[nodiscard]] int size() const { return size_; }
  /// Element i, j with j <= i, within the pattern.
  double& operator()(int i, int j) { return row(i)[j]; }
  [[nodiscard]] double operator()(int i, int j) const { return row(i)[j]; }
  [[nodiscard]] double right(int i) const { return right_[at(i)]; }
  double& right(int i) { return right_[at(i)]; }

  /// Adds `sign` times another system of the same pattern.
  void add(const ArrowSystem& other, double sign) {
    for (int i = 0; i < size_; ++i) {
      for (int j = first_[at(i)]; j <= i; ++j) row(i)[j] += sign * other.row(i)[j];
      right_[at(i)] += sign * other.right_[at(i)];
    }
  }
  /// Replaces the matrix by its Cholesky factor; false if it is not positive definite.
  [[nodiscard]] bool factorise() {
    for (int i = 0; i < size_; ++i) {
      double* a = row(i);
      for (int j = first_[at(i)]; j <= i; ++j) {
        const double* b = row(j);
        double sum = a[j];
        for (int k = std::max(first_[at(i)], first_[at(j)]); k < j; ++k) sum -= a[k] * b[k];
        if (j < i) {
          a[j] = sum / b[j];
        } else if (sum > 0.0) {
          a[i] = std::sqrt(sum);
        } else {
          return false;
        }
      }
    }
    return true;
  }
  using Vector = std::array<double, kMost>;
  /// After factorise(): solves in place.
  void solve(Vector& x) const {
    for (int i = 0; i < size_; ++i) {
      const double* a = row(i);
      double sum = x[at(i)];
      for (int k = first_[at(i)]; k < i; ++k) sum -= a[k] * x[at(k)];
      x[at(i)] = sum / a[i];
    }
    for (int i = size_; i-- > 0;) {
      const double* a = row(i);
      const double value = x[at(i)] /= a[i];
      for (int k = first_[at(i)]; k < i; ++k) x[at(k)] -= a[k] * value;
    }
  }
  [[nodiscard]] Vector solved_right() const {
    Vector x = right_;
    solve(x);
    return x;
  }

 private:
  static constexpr std::size_t at(int i) { return static_cast<std::size_t>(i); }
  [[nodiscard]] double* row(int i) { return &values_[at(i) * kMost]; }
  [[nodiscard]] const double* row(int i) const { return &values_[at(i) * kMost]; }

  int size_ = 0;
  std::array<int, kMost> first_{};
  std::array<double, kMost * kMost> values_;
  Vector right_{};
};

}  // namespace trochoid::tracking
