#include "observe/decompositions.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>

namespace trochoid::fitting {

LeastSquares::LeastSquares(const Eigen::MatrixXd& a) : qr_(a) {}

Eigen::VectorXd LeastSquares::solve(const Eigen::VectorXd& b) const {
  return qr_.solve(b);
}

Eigen::MatrixXd LeastSquares::solve_each(const Eigen::MatrixXd& b) const {
  return qr_.solve(b);
}

Eigen::Index LeastSquares::rank(double threshold) const {
  auto judged = qr_;
  return judged.setThreshold(threshold).rank();
}

NearestLeastSquares::NearestLeastSquares(const Eigen::MatrixXd& a) : span_(a) {}

Eigen::VectorXd NearestLeastSquares::solve(const Eigen::VectorXd& b) const {
  return span_.solve(b);
}

SymmetricEquations::SymmetricEquations(const Eigen::MatrixXd& a) : ldlt_(a) {}

Eigen::VectorXd SymmetricEquations::solve(const Eigen::VectorXd& b) const {
  return ldlt_.solve(b);
}

Eigen::MatrixXd SymmetricEquations::solve_each(const Eigen::MatrixXd& b) const {
  return ldlt_.solve(b);
}

double SymmetricEquations::log_determinant() const {
  return ldlt_.vectorD().cwiseMax(1e-300).array().log().sum();
}

Reflections::Reflections(const Eigen::MatrixXd& a) : qr_(a) {}

Eigen::MatrixXd Reflections::triangle() const {
  return qr_.matrixQR().topRows(std::min(qr_.rows(), qr_.cols())).triangularView<Eigen::Upper>();
}

Eigen::MatrixXd Reflections::turned(const Eigen::MatrixXd& directions) const {
  return qr_.householderQ() * directions;
}

Axes left_singular(const Eigen::MatrixXd& a) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeThinU);
  return {svd.singularValues(), svd.matrixU()};
}

Axes right_singular(const Eigen::MatrixXd& a) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeFullV);
  return {svd.singularValues(), svd.matrixV()};
}

double largest_singular_value(const Eigen::MatrixXd& a) {
  return Eigen::JacobiSVD<Eigen::MatrixXd>(a).singularValues()[0];
}

Axes principal_axes(const Eigen::MatrixXd& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(symmetric);
  return {axes.eigenvalues(), axes.eigenvectors()};
}

}  // namespace trochoid::fitting
