#pragma once
#include <utility>

namespace trochoid::fitting {

/// How a free parameter is handed to the minimiser, so that it stays in its range.
///   identity  value = u
///   log       value = exp(u): positive, over decades
///   above     value = lower + exp(u);   below: value = upper - exp(u)
///   limited   value = upper/(1 + exp(-u)): positive, over decades, below a limit
///   between   value = lower + (upper - lower) (1 + tanh u)/2
struct Transform {
  enum class Kind { identity, log, above, below, limited, between };
  Kind kind = Kind::identity;
  double lower = 0.0, upper = 0.0;
  double inside = 0.0;  ///< above, below: least distance of a start from the bound, > 0
  [[nodiscard]] bool is_over_decades() const { return kind == Kind::log || kind == Kind::limited; }
  [[nodiscard]] double value(double u) const;
  [[nodiscard]] double slope(double u) const;  ///< d value / d u
  [[nodiscard]] double inverse(double value) const;
  /// The same to begin with: on a bound the slope is 0, and what begins there, or beyond, never
  /// leaves. It begins a little inside.
  [[nodiscard]] double start(double value) const;
  /// What its values lie between; may be infinite.
  [[nodiscard]] std::pair<double, double> limits() const;
};

}  // namespace trochoid::fitting
