#pragma once
#include <Eigen/Core>

#include "problem/problem.hpp"

namespace trochoid::fitting {

inline constexpr double kQuantile95 = 3.841458820694124;  ///< chi-square, one degree of freedom

/// Chi-square with one parameter held ever farther from a solution and everything else fitted
/// again, each time from where the last one ended. The l of a top takes the axis with it: longer,
/// it stands more upright, and its path begins as before.
class OneParameter {
 public:
  struct Place {
    double offset = 0.0;     ///< of the parameter's u from the solution
    Eigen::VectorXd others;  ///< u of the other free parameters
  };

  OneParameter(const Problem& problem, const Solution& solution, int index);

  /// Rise of chi-square with the parameter at u + offset. Infinite where the model has no
  /// prediction.
  [[nodiscard]] double rise(double offset, const SolveOptions& options = {});
  /// Where the last call that found a prediction ended.
  [[nodiscard]] const Place& place() const { return place_; }
  void start_from(const Place& place) { place_ = place; }
  /// u of all free parameters there.
  [[nodiscard]] Eigen::VectorXd all() const;

 private:
  [[nodiscard]] double outside(double u) const;
  [[nodiscard]] Eigen::VectorXd carried_to(double offset) const;

  const Problem& problem_;
  const Solution& solution_;
  int index_;
  bool length_of_top_;
  Problem held_;
  Place place_;
};

}  // namespace trochoid::fitting
