#pragma once
#include <Eigen/Cholesky>
#include <Eigen/QR>

namespace trochoid::fitting {

// What fits ask of a dense matrix's decompositions. These are no templates: a compiler takes
// seconds for each of Eigen's wherever one is used, here once for all.

/// Places x of least |a x - b|, by Householder reflections that take the longest column first.
class LeastSquares {
 public:
  explicit LeastSquares(const Eigen::MatrixXd& a);
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& b) const;
  /// Each column of b by itself.
  [[nodiscard]] Eigen::MatrixXd solve_each(const Eigen::MatrixXd& b) const;
  /// How many columns are independent of each other, to `threshold` of the largest pivot.
  [[nodiscard]] Eigen::Index rank(double threshold) const;

 private:
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr_;
};

/// Of the places x of least |a x - b| the one nearest to zero, where the columns of a depend on
/// each other.
class NearestLeastSquares {
 public:
  explicit NearestLeastSquares(const Eigen::MatrixXd& a);
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& b) const;

 private:
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> span_;
};

/// a x = b for a symmetric a without negative eigenvalues, of which the lower triangle is read.
class SymmetricEquations {
 public:
  SymmetricEquations() = default;
  explicit SymmetricEquations(const Eigen::MatrixXd& a);
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& b) const;
  /// Each column of b by itself.
  [[nodiscard]] Eigen::MatrixXd solve_each(const Eigen::MatrixXd& b) const;
  /// Logarithm of the determinant, with 1e-300 for each pivot below that.
  [[nodiscard]] double log_determinant() const;

 private:
  Eigen::LDLT<Eigen::MatrixXd> ldlt_;
};

/// a = Q R, without exchange of columns.
class Reflections {
 public:
  explicit Reflections(const Eigen::MatrixXd& a);
  /// R, in as many rows as a has rows or columns, whichever are fewer.
  [[nodiscard]] Eigen::MatrixXd triangle() const;
  /// Q times what has as many rows as a.
  [[nodiscard]] Eigen::MatrixXd turned(const Eigen::MatrixXd& directions) const;

 private:
  Eigen::HouseholderQR<Eigen::MatrixXd> qr_;
};

/// Singular values, largest first, or eigenvalues, least first, with one direction per column.
struct Axes {
  Eigen::VectorXd values;
  Eigen::MatrixXd directions;
};

/// Left singular vectors, one for each singular value.
[[nodiscard]] Axes left_singular(const Eigen::MatrixXd& a);
/// Right singular vectors, as many as a has columns.
[[nodiscard]] Axes right_singular(const Eigen::MatrixXd& a);
[[nodiscard]] double largest_singular_value(const Eigen::MatrixXd& a);
/// Eigenvectors of a symmetric matrix.
[[nodiscard]] Axes principal_axes(const Eigen::MatrixXd& symmetric);

}  // namespace trochoid::fitting
