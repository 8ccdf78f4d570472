#pragma once
#include "top_kernel.hpp"
#include "trochoid/model/taylor.hpp"

/// The path of the centre of mass at the output times of one step, eight times per instruction.
namespace trochoid::model {
inline namespace TROCHOID_ISA {
namespace top_kernel {

typedef double Eight __attribute__((vector_size(64)));
constexpr int kEight = 8;

/// Coefficients of x and y of one quantity (the value, or one derivative), copied together.
struct PathSeries {
  double x[kTaylorOrder + 1], y[kTaylorOrder + 1];
};

/// Writes what `emit(x, y, out)` makes of the series at times [first, last), interleaved.
template <class Emit>
TROCHOID_INLINE void write_column(const PathSeries& series, double t0_s, const double* t_s,
                                  int first, int last, double* column, Emit emit) {
  for (int n = first; n < last; n += kEight) {
    const int count = last - n < kEight ? last - n : kEight;
    Eight s;
    if (count == kEight) {
      __builtin_memcpy(&s, t_s + n, sizeof s);
    } else {
      s = Eight{} + t0_s;
      for (int i = 0; i < count; ++i) s[i] = t_s[n + i];
    }
    s -= t0_s;
    Eight x = Eight{} + series.x[kTaylorOrder], y = Eight{} + series.y[kTaylorOrder];
    for (int i = kTaylorOrder - 1; i >= 0; --i) {
      x = x * s + series.x[i];
      y = y * s + series.y[i];
    }
    emit(x, y);
    Eight pair[2] = {__builtin_shufflevector(x, y, 0, 8, 1, 9, 2, 10, 3, 11),
                     __builtin_shufflevector(x, y, 4, 12, 5, 13, 6, 14, 7, 15)};
    double* out = column + 2 * static_cast<long>(n);
    if (count == kEight) {
      __builtin_memcpy(out, pair, sizeof pair);
    } else {
      __builtin_memcpy(out, pair, sizeof(double) * 2 * static_cast<unsigned long>(count));
    }
  }
}

template <class S>
void write_path(const Series<S>& kx, const Series<S>& ky, double t0_s, const double* t_s, int first,
                int last, const TopPath& path) {
  if (first == last) return;
  const double l = path.l_m, px = path.pivot_x_m, py = path.pivot_y_m;
  PathSeries series;
  for (int n = 0; n <= kTaylorOrder; ++n) {
    series.x[n] = value_of(kx[n]);
    series.y[n] = value_of(ky[n]);
  }
  write_column(series, t0_s, t_s, first, last, path.xy,
               [l, px, py](Eight& x, Eight& y) TROCHOID_LAMBDA_INLINE {
                 x = x * l + px;
                 y = y * l + py;
               });
  if constexpr (requires { S::kLanes; }) {
    const double* xy = path.xy;
    for (int n = 2 * first; n < 2 * last; n += 2) {
      if (path.by_phi == nullptr) break;
      path.by_phi[n] = py - xy[n + 1];
      path.by_phi[n + 1] = xy[n] - px;
    }
    const auto as_it_is = [](Eight&, Eight&) TROCHOID_LAMBDA_INLINE {};
    if (path.by_l != nullptr) write_column(series, t0_s, t_s, first, last, path.by_l, as_it_is);
    for (int lane = 0; lane < S::kLanes; ++lane) {
      double* column = path.by_variable[lane];
      if (column == nullptr) continue;
      for (int n = 0; n <= kTaylorOrder; ++n) {
        series.x[n] = l * kx[n].derivative[lane];
        series.y[n] = l * ky[n].derivative[lane];
      }
      write_column(series, t0_s, t_s, first, last, column, as_it_is);
    }
  }
}

}  // namespace top_kernel
}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
