#include "edges/shading_prior.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "edges/stretch_kernel.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::tracking {
namespace {

// The least allows for what the model of an edge leaves that is no shading: pixels, compression.
// Less suits plain pictures, and misleads where contrast is low or the floor has a pattern: it is
// for curves all of whose looks together show so little.
constexpr double kPlainVariance = 3e-4, kLeastVariance = 0.03, kMostVariance = 1.0;

// What a look's slopes and bends may vary by at least, from the sums over its whole curve: as much
// as these show of any of them, and a standard deviation more (r_k^2 of noise alone has the
// variance 2 N_kk^2).
double least_variance(const Shading& variances, const Shading& squares) {
  const Eigen::Array<double, kShading, 1> sd = (2.0 / squares.array().max(1e-9)).sqrt();
  const Shading most = variances + sd.matrix();
  return std::clamp(most.head<kShading - 1>().maxCoeff(), kPlainVariance, kLeastVariance);
}

// Doubles from one element of an array to the next.
template <class Element>
constexpr int stride_of() {
  static_assert(sizeof(Element) % sizeof(double) == 0);
  return static_cast<int>(sizeof(Element) / sizeof(double));
}

// Looks as the kernels read them, with what of each right side is not expected.
class Looks {
 public:
  Looks(const std::vector<ShadingEvidence>& looks, const std::vector<Shading>& expected)
      : looks_(looks), expected_(expected) {
    for (const ShadingEvidence& look : looks) usable_.push_back(look.usable ? 1 : 0);
    if (expected.empty()) return;
    rest_.resize(looks.size());
    for (std::size_t i = 0; i < looks.size(); ++i)
      rest_[i] = looks[i].right - looks[i].normal * expected[i];
  }
  [[nodiscard]] stretch::CurveLooks within(std::size_t first, std::size_t end) const {
    constexpr int kStride = stride_of<ShadingEvidence>();
    const bool plain = expected_.empty();
    return {static_cast<int>(end - first),
            looks_[first].normal.data(),
            plain ? looks_[first].right.data() : rest_[first].data(),
            kStride,
            plain ? kStride : stride_of<Shading>(),
            &usable_[first]};
  }
  // With variances that were seen and what they are at least.
  [[nodiscard]] std::vector<ShadingEstimate> estimates(std::vector<Shading> variances,
                                                       const std::vector<double>& least) const {
    const std::size_t n = looks_.size();
    std::vector<ShadingEstimate> out(n);
    if (n == 0) return out;
    for (std::size_t i = 0; i < n; ++i) {
      out[i].unevenness = variances[i].head<kShading - 1>().mean();
      variances[i] = variances[i].cwiseMax(least[i]);
      // A strip along the edge, the wall of the body mostly, is lit like nothing else.
      variances[i][kShading - 1] = kMostVariance;
    }
    constexpr int kStride = stride_of<ShadingEstimate>();
    stretch::kernel().estimate(within(0, n), variances[0].data(), out[0].covariance.data(), kStride,
                               out[0].shading.data(), kStride);
    for (std::size_t i = 0; i < n; ++i) {
      if (!usable_[i]) out[i] = {};
      if (usable_[i] && !expected_.empty()) out[i].shading += expected_[i];
    }
    return out;
  }

 private:
  const std::vector<ShadingEvidence>& looks_;
  const std::vector<Shading>& expected_;
  std::vector<unsigned char> usable_;
  std::vector<Shading> rest_;
};

// Where the normal points, in sectors.
double sectors_round(double direction_rad, int sectors) {
  return (direction_rad / data::kTurn + 1.0) * sectors;
}

}  // namespace

std::vector<ShadingEstimate> shadings_given(const std::vector<ShadingEvidence>& looks,
                                            double variance) {
  const std::vector<Shading> nothing;
  return Looks(looks, nothing)
      .estimates(std::vector<Shading>(looks.size(), Shading::Constant(variance)),
                 std::vector<double>(looks.size(), 0.0));
}

std::vector<ShadingEstimate> estimate_shadings(const std::vector<ShadingEvidence>& looks,
                                               const std::vector<Shading>& expected) {
  constexpr std::size_t kLeastReach = 8;
  constexpr double kShare = 0.12;  // of the curve to either side
  const Looks all(looks, expected);
  std::vector<Shading> variances(looks.size());
  std::vector<double> least(looks.size());
  for (std::size_t first = 0, end = 0; first < looks.size(); first = end) {
    while (end < looks.size() && looks[end].curve == looks[first].curve) ++end;
    const auto share = static_cast<std::size_t>(kShare * static_cast<double>(end - first));
    Shading curve, squares;
    stretch::kernel().find_variances(all.within(first, end),
                                     static_cast<int>(std::max(kLeastReach, share)),
                                     variances[first].data(), curve.data(), squares.data());
    std::fill(least.begin() + static_cast<std::ptrdiff_t>(first),
              least.begin() + static_cast<std::ptrdiff_t>(end), least_variance(curve, squares));
  }
  return all.estimates(std::move(variances), least);
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
