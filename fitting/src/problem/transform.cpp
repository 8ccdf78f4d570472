#include "problem/transform.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace trochoid::fitting {

double Transform::value(double u) const {
  switch (kind) {
    case Kind::log:
      return std::exp(u);
    case Kind::above:
      return lower + std::exp(u);
    case Kind::below:
      return upper - std::exp(u);
    case Kind::limited:
      return upper / (1.0 + std::exp(-u));
    case Kind::between:
      return lower + 0.5 * (upper - lower) * (1.0 + std::tanh(u));
    default:
      return u;
  }
}

double Transform::slope(double u) const {
  switch (kind) {
    case Kind::log:
    case Kind::above:
      return std::exp(u);
    case Kind::below:
      return -std::exp(u);
    case Kind::limited: {
      const double share = 1.0 / (1.0 + std::exp(-u));
      return upper * share * (1.0 - share);
    }
    case Kind::between: {
      const double t = std::tanh(u);
      return 0.5 * (upper - lower) * (1.0 - t * t);
    }
    default:
      return 1.0;
  }
}

double Transform::inverse(double value) const {
  constexpr double kLeast = 1e-300, kLeastShare = 1e-9, kMostShare = 1.0 - 1e-12;
  switch (kind) {
    case Kind::log:
      return std::log(std::max(value, kLeast));
    case Kind::above:
      return std::log(std::max(value - lower, kLeastShare * inside));
    case Kind::below:
      return std::log(std::max(upper - value, kLeastShare * inside));
    case Kind::limited: {
      const double share = std::clamp(value / upper, kLeast, kMostShare);
      return std::log(share / (1.0 - share));
    }
    case Kind::between: {
      const double t = 2.0 * (value - lower) / (upper - lower) - 1.0;
      return std::atanh(std::clamp(t, -kMostShare, kMostShare));
    }
    default:
      return value;
  }
}

double Transform::start(double value) const {
  constexpr double kShare = 1e-3;
  switch (kind) {
    case Kind::above:
      return inverse(std::max(value, lower + inside));
    case Kind::below:
      return inverse(std::min(value, upper - inside));
    case Kind::limited:
      return inverse(std::min(value, (1.0 - kShare) * upper));
    case Kind::between: {
      const double margin = 0.5 * kShare * (upper - lower);
      return inverse(std::clamp(value, lower + margin, upper - margin));
    }
    default:
      return inverse(value);
  }
}

std::pair<double, double> Transform::limits() const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  switch (kind) {
    case Kind::log:
      return {0.0, kInfinity};
    case Kind::above:
      return {lower, kInfinity};
    case Kind::below:
      return {-kInfinity, upper};
    case Kind::limited:
      return {0.0, upper};
    case Kind::between:
      return {lower, upper};
    default:
      return {-kInfinity, kInfinity};
  }
}

}  // namespace trochoid::fitting
