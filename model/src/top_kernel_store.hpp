#pragma once
#include "top_kernel.hpp"
#include "trochoid/model/dual.hpp"

/// Between the plain numbers of a TopRun and the scalars of the equations.
namespace trochoid::model {
inline namespace TROCHOID_ISA {
namespace top_kernel {

template <class S>
TROCHOID_INLINE S variable(const TopRun& run, TopVariable which) {
  if constexpr (requires { S::kLanes; }) {
    return S::variable(run.variable[which], which);
  } else {
    return run.variable[which];
  }
}

TROCHOID_INLINE void store(TopResult& result, int column, int n, double x) {
  if (result.value[column] != nullptr) result.value[column][n] = x;
}
template <int Lanes>
TROCHOID_INLINE void store(TopResult& result, int column, int n, const Dual<Lanes>& x) {
  store(result, column, n, x.value);
  for (int lane = 0; lane < Lanes; ++lane) {
    double* out = result.derivative[column][lane];
    if (out != nullptr) out[n] = x.derivative[lane];
  }
}
TROCHOID_INLINE void store_end(TopResult& result, int i, double x) {
  result.end[i] = x;
}
template <int Lanes>
TROCHOID_INLINE void store_end(TopResult& result, int i, const Dual<Lanes>& x) {
  result.end[i] = x.value;
  for (int lane = 0; lane < Lanes; ++lane) {
    result.end_derivative[i][lane] = x.derivative[lane];
  }
}

}  // namespace top_kernel
}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
