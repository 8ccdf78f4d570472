#include "shading_prior.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace trochoid::tracking {
namespace {

// The least allows for what the model of an edge leaves that is no shading: pixels, compression.
// Less suits plain pictures, and misleads where contrast is low or the floor has a pattern: it is
// for curves all of whose looks together show so little.
constexpr double kPlainVariance = 3e-4, kLeastVariance = 0.03, kMostVariance = 1.0;

// Minimises x^T A x / 2 - b^T x over 0 <= x <= kMostVariance, A positive semidefinite, one
// coordinate at a time, from x.
Shading least_within_bounds(const ShadingMatrix& A, const Shading& b, Shading x) {
  constexpr int kSweeps = 3;
  const Shading inverse = A.diagonal().cwiseInverse();
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (int k = 0; k < kShading; ++k) {
      if (!(A(k, k) > 0.0)) continue;
      const double off = b[k] - A.col(k).dot(x);
      x[k] = std::clamp(x[k] + off * inverse[k], 0.0, kMostVariance);
    }
  return x;
}

// Inverse of a positive definite matrix, one pivot after the other (Gauss-Jordan).
ShadingMatrix inverse_of(ShadingMatrix m) {
  for (int k = 0; k < kShading; ++k) {
    const double inverse = 1.0 / m(k, k);
    const Shading column = m.col(k), scaled = inverse * column;
    m -= scaled * column.transpose();
    m.col(k) = scaled;
    m.row(k) = scaled.transpose();
    m(k, k) = -inverse;
  }
  return -m;
}

// With shading s of diagonal covariance V, right sides r = N s + noise have E[r_k^2] =
// sum_l N_kl^2 V_l + N_kk: sums of both sides over some looks.
struct Moments {
  ShadingMatrix squares = ShadingMatrix::Zero();
  Shading excess = Shading::Zero();

  void add(const ShadingEvidence& look, const Shading& rest, double sign) {
    squares += sign * look.normal.cwiseAbs2();
    excess += sign * (rest.cwiseAbs2() - look.normal.diagonal());
  }
  // From those of a look nearby.
  [[nodiscard]] Shading variances(const Shading& nearby) const {
    return least_within_bounds(squares, excess, nearby);
  }
  // From nothing.
  [[nodiscard]] Shading variances() const {
    constexpr int kRounds = 4;
    Shading found = Shading::Zero();
    for (int round = 0; round < kRounds; ++round) found = variances(found);
    return found;
  }
};

// What a look's slopes and bends may vary by at least, from the sums over its whole curve: as much
// as these show of any of them, and a standard deviation more (r_k^2 of noise alone has the
// variance 2 N_kk^2).
double least_variance(const Moments& curve) {
  const Eigen::Array<double, kShading, 1> sd =
      (2.0 / curve.squares.diagonal().array().max(1e-9)).sqrt();
  const Shading most = curve.variances() + sd.matrix();
  return std::clamp(most.head<kShading - 1>().maxCoeff(), kPlainVariance, kLeastVariance);
}

// A strip along the edge, the wall of the body mostly, is lit like nothing else.
ShadingEstimate estimate(const ShadingEvidence& look, const Shading& expected,
                         const Shading& seen_variance, double least) {
  Shading variance = seen_variance.cwiseMax(least);
  variance[kShading - 1] = kMostVariance;
  ShadingMatrix information = look.normal;
  information.diagonal() += variance.cwiseInverse();
  ShadingEstimate out;
  out.covariance = inverse_of(information);
  out.shading = expected + out.covariance * (look.right - look.normal * expected);
  out.unevenness = seen_variance.head<kShading - 1>().mean();
  return out;
}

// Where the normal points, in sectors.
double sectors_round(double direction_rad, int sectors) {
  return (direction_rad / (2.0 * std::numbers::pi) + 1.0) * sectors;
}

}  // namespace

std::vector<ShadingEstimate> shadings_given(const std::vector<ShadingEvidence>& looks,
                                            double variance) {
  std::vector<ShadingEstimate> out(looks.size());
  const Shading given = Shading::Constant(variance);
  for (std::size_t i = 0; i < looks.size(); ++i)
    if (looks[i].usable) out[i] = estimate(looks[i], Shading::Zero(), given, kLeastVariance);
  return out;
}

std::vector<ShadingEstimate> estimate_shadings(const std::vector<ShadingEvidence>& looks,
                                               const ShadingMemory& known) {
  constexpr std::size_t kLeastReach = 8;
  constexpr double kShare = 0.12;  // of the curve to either side
  std::vector<ShadingEstimate> out(looks.size());
  std::vector<Shading> expected(looks.size()), rest(looks.size());
  for (std::size_t i = 0; i < looks.size(); ++i) {
    expected[i] = known.expected(looks[i].curve, looks[i].direction_rad);
    rest[i] = looks[i].right - looks[i].normal * expected[i];
  }
  for (std::size_t first = 0, end = 0; first < looks.size(); first = end) {
    while (end < looks.size() && looks[end].curve == looks[first].curve) ++end;
    const auto share = static_cast<std::size_t>(kShare * static_cast<double>(end - first));
    const std::size_t reach = std::max(kLeastReach, share);
    const auto add = [&](std::size_t i, double sign, Moments& sums) {
      if (looks[i].usable) sums.add(looks[i], rest[i], sign);
    };
    Moments whole, around;
    for (std::size_t i = first; i < end; ++i) add(i, 1.0, whole);
    const double least = least_variance(whole);
    for (std::size_t i = first; i < std::min(end, first + reach); ++i) add(i, 1.0, around);
    Shading variances = around.variances();
    for (std::size_t i = first; i < end; ++i) {
      if (i + reach < end) add(i + reach, 1.0, around);
      if (i > first + reach) add(i - reach - 1, -1.0, around);
      variances = around.variances(variances);
      if (looks[i].usable) out[i] = estimate(looks[i], expected[i], variances, least);
    }
  }
  return out;
}

Eigen::Vector2d ShadingMemory::Sector::slopes() const {
  constexpr double kUsualVariance = 0.01;  // about zero
  return (normal + Eigen::Matrix2d::Identity() / kUsualVariance).inverse() * right;
}

void ShadingMemory::add(const ShadingEvidence& look) {
  if (!look.usable) return;
  const auto nearest =
      static_cast<std::size_t>(std::lround(sectors_round(look.direction_rad, kSectors)));
  Sector& sector = curves_[look.curve][nearest % kSectors];
  sector.normal += look.normal.topLeftCorner<2, 2>();
  sector.right += look.right.head<2>();
}

void ShadingMemory::add(const ShadingMemory& other) {
  for (const auto& [curve, sectors] : other.curves_) {
    auto& own = curves_[curve];
    for (std::size_t k = 0; k < sectors.size(); ++k)
      own[k].normal += sectors[k].normal, own[k].right += sectors[k].right;
  }
}

Shading ShadingMemory::expected(int curve, double direction_rad) const {
  Shading out = Shading::Zero();
  const auto at = curves_.find(curve);
  if (at == curves_.end()) return out;
  const double place = sectors_round(direction_rad, kSectors), part = place - std::floor(place);
  const auto before = static_cast<std::size_t>(place);
  out.head<2>() = (1.0 - part) * at->second[before % kSectors].slopes() +
                  part * at->second[(before + 1) % kSectors].slopes();
  return out;
}

}  // namespace trochoid::tracking
