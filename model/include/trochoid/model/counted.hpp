#pragma once
#include <cmath>

/// A scalar that counts what is done to it: what a right-hand side costs, whatever the machine.
namespace trochoid::model {

/// Operations since the last reset, of this thread.
struct OperationCount {
  long sums = 0;       ///< additions, subtractions, changes of sign
  long products = 0;   ///< multiplications
  long quotients = 0;  ///< divisions
  long functions = 0;  ///< square roots, sines, cosines
  [[nodiscard]] long total() const { return sums + products + quotients + functions; }
};

class Counted {
 public:
  double value = 0.0;
  Counted() = default;
  Counted(double v) : value(v) {}  // NOLINT: constants enter as written

  [[nodiscard]] static OperationCount& count() {
    thread_local OperationCount counts;
    return counts;
  }

  Counted& operator+=(const Counted& b) { return *this = *this + b; }
  Counted& operator-=(const Counted& b) { return *this = *this - b; }

  friend Counted operator+(const Counted& a, const Counted& b) {
    return ++count().sums, Counted(a.value + b.value);
  }
  friend Counted operator-(const Counted& a, const Counted& b) {
    return ++count().sums, Counted(a.value - b.value);
  }
  friend Counted operator-(const Counted& a) { return ++count().sums, Counted(-a.value); }
  friend Counted operator*(const Counted& a, const Counted& b) {
    return ++count().products, Counted(a.value * b.value);
  }
  friend Counted operator/(const Counted& a, const Counted& b) {
    return ++count().quotients, Counted(a.value / b.value);
  }
  friend Counted sqrt(const Counted& a) { return ++count().functions, Counted(std::sqrt(a.value)); }
  friend Counted sin(const Counted& a) { return ++count().functions, Counted(std::sin(a.value)); }
  friend Counted cos(const Counted& a) { return ++count().functions, Counted(std::cos(a.value)); }
  friend double value_of(const Counted& a) { return a.value; }
};

/// Operations of one evaluation of a system over Counted.
template <class System, class State>
[[nodiscard]] OperationCount operations_of(const System& system, const State& y) {
  State rate;
  Counted::count() = {};
  system.derivative(0.0, y, rate);
  return Counted::count();
}

}  // namespace trochoid::model
