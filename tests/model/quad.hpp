#pragma once
#include "trochoid/model/taylor.hpp"

// Of libquadmath, whose header only GCC finds.
extern "C" {
__extension__ typedef __float128 trochoid_float128;
trochoid_float128 sinq(trochoid_float128) noexcept;
trochoid_float128 cosq(trochoid_float128) noexcept;
}

namespace trochoid::model {

/// Quadruple precision (113 bits) as a scalar of the equations: what double-precision runs and
/// their derivatives are compared with.
struct Quad {
  using Raw = trochoid_float128;
  Raw v;

  Quad() : v(0) {}
  Quad(double x) : v(x) {}  // NOLINT: as the equations write constants
  explicit Quad(Raw x, int) : v(x) {}
  Quad& operator+=(const Quad& b) { return *this = *this + b; }
  Quad& operator-=(const Quad& b) { return *this = *this - b; }
  friend Quad operator-(const Quad& a) { return Quad(-a.v, 0); }
  friend Quad operator+(const Quad& a, const Quad& b) { return Quad(a.v + b.v, 0); }
  friend Quad operator-(const Quad& a, const Quad& b) { return Quad(a.v - b.v, 0); }
  friend Quad operator*(const Quad& a, const Quad& b) { return Quad(a.v * b.v, 0); }
  friend Quad operator/(const Quad& a, const Quad& b) { return Quad(a.v / b.v, 0); }
};
inline double value_of(const Quad& x) {
  return static_cast<double>(x.v);
}
inline Quad sin(const Quad& x) {
  return Quad(sinq(x.v), 0);
}
inline Quad cos(const Quad& x) {
  return Quad(cosq(x.v), 0);
}
inline void multiply_add(Quad& sum, const Quad& a, const Quad& b) {
  sum += a * b;
}
inline Quad divided(const Quad& x, int n) {
  return x / Quad(static_cast<double>(n));
}

}  // namespace trochoid::model
