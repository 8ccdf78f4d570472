#pragma once
#include <cstddef>

#include "trochoid/model/isa.hpp"

/// Scalars of the equations of motion: double, and Dual<N> = a value with N derivatives, carried
/// forward through every operation (chain rule, exact to rounding). The derivatives are N lanes
/// (N = 4, 8 or 16) in whole registers; unused lanes cost nothing extra and stay zero. Comparisons
/// and branches look at the value alone.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

// Lanes are whole registers: a vector type wider than the machine's is put together from single
// numbers in memory wherever a number multiplies it, which takes longer than the arithmetic.
template <int N>
struct TwoHalves;
template <int N>
struct LanesOf {
  using Type = TwoHalves<N>;
};
template <>
struct LanesOf<4> {
  typedef double Type __attribute__((vector_size(32)));
};
#if TROCHOID_REGISTER_LANES == 8
template <>
struct LanesOf<8> {
  typedef double Type __attribute__((vector_size(64)));
};
#endif

/// Lanes of more than one register, with the operations of one.
template <int N>
struct TwoHalves {
  typename LanesOf<N / 2>::Type low, high;

  [[nodiscard]] TROCHOID_INLINE double operator[](std::size_t lane) const {
    return lane < N / 2 ? low[lane] : high[lane - N / 2];
  }
  TROCHOID_INLINE TwoHalves& operator+=(const TwoHalves& b) { return *this = *this + b; }
  TROCHOID_INLINE TwoHalves& operator-=(const TwoHalves& b) { return *this = *this - b; }
  TROCHOID_INLINE TwoHalves& operator*=(double b) { return *this = *this * b; }

  friend TROCHOID_INLINE TwoHalves operator-(const TwoHalves& a) { return {-a.low, -a.high}; }
  friend TROCHOID_INLINE TwoHalves operator+(const TwoHalves& a, const TwoHalves& b) {
    return {a.low + b.low, a.high + b.high};
  }
  friend TROCHOID_INLINE TwoHalves operator-(const TwoHalves& a, const TwoHalves& b) {
    return {a.low - b.low, a.high - b.high};
  }
  friend TROCHOID_INLINE TwoHalves operator*(const TwoHalves& a, const TwoHalves& b) {
    return {a.low * b.low, a.high * b.high};
  }
  friend TROCHOID_INLINE TwoHalves operator*(const TwoHalves& a, double b) {
    return {a.low * b, a.high * b};
  }
  friend TROCHOID_INLINE TwoHalves operator*(double a, const TwoHalves& b) {
    return {a * b.low, a * b.high};
  }
};

template <class Lanes>
TROCHOID_INLINE void set_lane(Lanes& lanes, std::size_t lane, double value) {
  lanes[lane] = value;
}
template <int N>
TROCHOID_INLINE void set_lane(TwoHalves<N>& lanes, std::size_t lane, double value) {
  if (lane < N / 2)
    set_lane(lanes.low, lane, value);
  else
    set_lane(lanes.high, lane - N / 2, value);
}

template <int N>
struct Dual {
  using Lanes = typename LanesOf<N>::Type;
  static constexpr int kLanes = N;

  double value;
  Lanes derivative;

  TROCHOID_INLINE Dual() : value(0.0), derivative{} {}
  TROCHOID_INLINE Dual(double constant) : value(constant), derivative{} {}  // NOLINT: as written
  TROCHOID_INLINE Dual(double v, const Lanes& d) : value(v), derivative(d) {}
  /// The variable that lane `lane` differentiates by.
  [[nodiscard]] static Dual variable(double value, int lane) {
    Dual result(value);
    set_lane(result.derivative, lane, 1.0);
    return result;
  }

  TROCHOID_INLINE Dual& operator+=(const Dual& b) {
    value += b.value;
    derivative += b.derivative;
    return *this;
  }
  TROCHOID_INLINE Dual& operator-=(const Dual& b) {
    value -= b.value;
    derivative -= b.derivative;
    return *this;
  }
  TROCHOID_INLINE Dual& operator+=(double b) {
    value += b;
    return *this;
  }
  TROCHOID_INLINE Dual& operator-=(double b) {
    value -= b;
    return *this;
  }
  TROCHOID_INLINE Dual& operator*=(const Dual& b) { return *this = *this * b; }
  TROCHOID_INLINE Dual& operator/=(const Dual& b) { return *this = *this / b; }
  TROCHOID_INLINE Dual& operator*=(double b) {
    value *= b;
    derivative *= b;
    return *this;
  }
  TROCHOID_INLINE Dual& operator/=(double b) { return *this *= 1.0 / b; }

  friend TROCHOID_INLINE Dual operator-(const Dual& a) { return {-a.value, -a.derivative}; }
  friend TROCHOID_INLINE Dual operator+(const Dual& a, const Dual& b) {
    return {a.value + b.value, a.derivative + b.derivative};
  }
  friend TROCHOID_INLINE Dual operator-(const Dual& a, const Dual& b) {
    return {a.value - b.value, a.derivative - b.derivative};
  }
  friend TROCHOID_INLINE Dual operator*(const Dual& a, const Dual& b) {
    return {a.value * b.value, a.value * b.derivative + b.value * a.derivative};
  }
  friend TROCHOID_INLINE Dual operator/(const Dual& a, const Dual& b) {
    const double reciprocal = 1.0 / b.value;
    const double quotient = a.value * reciprocal;
    return {quotient, (a.derivative - quotient * b.derivative) * reciprocal};
  }
  friend TROCHOID_INLINE Dual operator+(const Dual& a, double b) {
    return {a.value + b, a.derivative};
  }
  friend TROCHOID_INLINE Dual operator+(double a, const Dual& b) {
    return {a + b.value, b.derivative};
  }
  friend TROCHOID_INLINE Dual operator-(const Dual& a, double b) {
    return {a.value - b, a.derivative};
  }
  friend TROCHOID_INLINE Dual operator-(double a, const Dual& b) {
    return {a - b.value, -b.derivative};
  }
  friend TROCHOID_INLINE Dual operator*(const Dual& a, double b) {
    return {a.value * b, a.derivative * b};
  }
  friend TROCHOID_INLINE Dual operator*(double a, const Dual& b) {
    return {a * b.value, a * b.derivative};
  }
  friend TROCHOID_INLINE Dual operator/(const Dual& a, double b) { return a * (1.0 / b); }
  friend TROCHOID_INLINE Dual operator/(double a, const Dual& b) {
    const double reciprocal = 1.0 / b.value;
    const double quotient = a * reciprocal;
    return {quotient, b.derivative * (-quotient * reciprocal)};
  }

  friend TROCHOID_INLINE bool operator<(const Dual& a, const Dual& b) { return a.value < b.value; }
  friend TROCHOID_INLINE bool operator>(const Dual& a, const Dual& b) { return a.value > b.value; }
  friend TROCHOID_INLINE bool operator<=(const Dual& a, const Dual& b) {
    return a.value <= b.value;
  }
  friend TROCHOID_INLINE bool operator>=(const Dual& a, const Dual& b) {
    return a.value >= b.value;
  }
};

/// The number without its derivatives: what step control and events look at.
TROCHOID_INLINE double value_of(double x) {
  return x;
}
template <int N>
TROCHOID_INLINE double value_of(const Dual<N>& x) {
  return x.value;
}

/// Elementary functions on double, so that an equation calls sin(x) whatever its scalar is.
TROCHOID_INLINE double sqrt(double x) {
  return __builtin_sqrt(x);
}
TROCHOID_INLINE double sin(double x) {
  return __builtin_sin(x);
}
TROCHOID_INLINE double cos(double x) {
  return __builtin_cos(x);
}
TROCHOID_INLINE double exp(double x) {
  return __builtin_exp(x);
}
TROCHOID_INLINE double log(double x) {
  return __builtin_log(x);
}
TROCHOID_INLINE double abs(double x) {
  return __builtin_fabs(x);
}
TROCHOID_INLINE double pow(double x, double y) {
  return __builtin_pow(x, y);
}
TROCHOID_INLINE double atan2(double y, double x) {
  return __builtin_atan2(y, x);
}
TROCHOID_INLINE double hypot(double x, double y) {
  return __builtin_hypot(x, y);
}

template <int N>
TROCHOID_INLINE Dual<N> sqrt(const Dual<N>& x) {
  const double root = __builtin_sqrt(x.value);
  return {root, x.derivative * (0.5 / root)};
}
template <int N>
TROCHOID_INLINE Dual<N> sin(const Dual<N>& x) {
  return {__builtin_sin(x.value), x.derivative * __builtin_cos(x.value)};
}
template <int N>
TROCHOID_INLINE Dual<N> cos(const Dual<N>& x) {
  return {__builtin_cos(x.value), x.derivative * -__builtin_sin(x.value)};
}
template <int N>
TROCHOID_INLINE Dual<N> exp(const Dual<N>& x) {
  const double power = __builtin_exp(x.value);
  return {power, x.derivative * power};
}
template <int N>
TROCHOID_INLINE Dual<N> log(const Dual<N>& x) {
  return {__builtin_log(x.value), x.derivative * (1.0 / x.value)};
}
/// |x|; at 0 the derivative from the right.
template <int N>
TROCHOID_INLINE Dual<N> abs(const Dual<N>& x) {
  return x.value < 0.0 ? -x : x;
}
/// x^y for a constant exponent; x > 0, or y an integer.
template <int N>
TROCHOID_INLINE Dual<N> pow(const Dual<N>& x, double y) {
  return {__builtin_pow(x.value, y), x.derivative * (y * __builtin_pow(x.value, y - 1.0))};
}
template <int N>
TROCHOID_INLINE Dual<N> atan2(const Dual<N>& y, const Dual<N>& x) {
  const double squared = x.value * x.value + y.value * y.value;
  return {__builtin_atan2(y.value, x.value),
          (x.value * y.derivative - y.value * x.derivative) * (1.0 / squared)};
}
template <int N>
TROCHOID_INLINE Dual<N> hypot(const Dual<N>& x, const Dual<N>& y) {
  const double length = __builtin_hypot(x.value, y.value);
  return {length, (x.value * x.derivative + y.value * y.derivative) * (1.0 / length)};
}

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
