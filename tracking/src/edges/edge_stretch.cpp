#include "edges/edge_stretch.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "edges/normal_table.hpp"
#include "edges/stretch_kernel.hpp"
#include "edges/transfer_curve.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {

static_assert(Profile::kMost == stretch::kMostSamples);
namespace {

using stretch::Block;
using stretch::kLanes;
static_assert(stretch::kShading == kShading);
static_assert(Block::kMostSteps >= StretchProfile::kMostSteps);

constexpr double kLeastNoise2 = 0.05;  // [8-bit levels squared]

const std::array<float, 256>& gains_of_light() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (size_t i = 0; i < t.size(); ++i)
      t[i] = static_cast<float>(light_per_level(static_cast<double>(i)));
    return t;
  }();
  return table;
}

// Largest slopes [per px] and bends [per px^2], as shares of the light; largest difference of a
// strip, as a share of the light of the body.
Shading largest_shading() {
  constexpr double kSlope = 0.06, kBend = 0.02, kStrip = 0.6;
  return (Shading() << kSlope, kSlope, kBend, kBend, kStrip).finished();
}

using Noise = std::array<float, 3>;  // variance of a sample inside, outside and on the edge
constexpr Noise kEqual{1.0f, 1.0f, 1.0f};

// The light to one side of an edge, in units of that of the plate if there is one.
struct Level {
  double value = 0.0, variance = 0.0;
  double beyond = 0.0;    // that of the whole surface
  double per_unit = 1.0;  // light
  // Of a stretch of the outline around: looks, and their means.
  double count = 0.0, beyond_there = 0.0, square_there = 0.0, variance_there = 0.0;

  [[nodiscard]] double variance_of_mean() const { return variance_there / count; }
  // As the looks really differ, where that is less.
  [[nodiscard]] double seen_variance_of_mean() const {
    return std::min(variance_there, square_there) / count;
  }
};

// What one look says; shading over the most it can be.
struct CurveLook {
  bool usable = false;
  Shading most = Shading::Zero();  // shading, in levels
  double left_square = 0.0, freedom = 0.0;
  // Of the blur, over the variance of the noise; how it goes with shading.
  double blur_normal = 0.0, blur_right = 0.0;
  Shading blur_cross = Shading::Zero();
  ShadingEstimate estimate;
  double blur_step = 0.0, blur_information = 0.0;
  // Sums of squared residuals and their degrees of freedom beside the edge, inside and outside, and
  // on it: pixels that an edge crosses are noisier than either side (coding, sampling of the
  // scene).
  double light_square = 0.0;  // of all samples, in levels of light
  std::array<Level, 2> levels{};
  Eigen::Array3d noise_square = Eigen::Array3d::Zero(), noise_freedom = Eigen::Array3d::Zero();
};

// All looks, eight side by side.
class Fitting {
 public:
  Fitting(std::vector<StretchProfile>& profiles, const ShadingMemory& known);
  StretchFit run(bool weighed);

 private:
  void fill(size_t block);
  void sum(const std::vector<Noise>& noise);
  void take_sums(size_t i);
  [[nodiscard]] std::vector<double> noise_of_looks() const;
  void set_evidence(const std::vector<double>& noise2);
  [[nodiscard]] double find_shadings(const std::vector<double>& noise2, int rounds,
                                     std::optional<double> wider_px = {});
  void widen(double step);
  void find_noise(const std::vector<Noise>& assumed);
  void take_strips();
  void find_levels(EdgeSide side, const std::vector<double>& noise2);
  [[nodiscard]] double change_of_levels(size_t i) const;
  void find_stretches(EdgeSide side);
  void expect_levels(EdgeSide side);
  void compare_with_rest();
  [[nodiscard]] int surface(size_t i, EdgeSide side) const {
    return side == kOutside ? profiles_[i].outside : profiles_[i].curve;
  }
  [[nodiscard]] std::vector<Noise> noise_of_neighbours() const;
  void find_offsets(const std::vector<Noise>& noise);
  void describe_edge(size_t i);
  void compare_widths();

  [[nodiscard]] Block& block_of(size_t i) { return blocks_[i / kLanes]; }
  [[nodiscard]] stretch::Variances variances(const std::vector<Noise>& noise, size_t block) const;
  template <class Sum, class Of>
  [[nodiscard]] std::vector<Sum> sums_of_neighbours(double share_of_curve, const Sum& none,
                                                    const Of& of) const;

  std::vector<StretchProfile>& profiles_;
  std::vector<Block> blocks_;
  std::vector<size_t> first_sample_;  // of each block
  stretch::Sample* samples_;
  std::vector<CurveLook> looks_;
  std::vector<ShadingEvidence> evidence_;
  std::vector<Shading> expected_;  // empty: nothing is known
};

// Light of the background plate beside an edge; 1 without.
double light_of_plate(const Profile& profile) {
  if (!profile.plate) return 1.0;
  double sum = 0.0;
  for (int k = 0; k < profile.count; ++k)
    sum += static_cast<double>(profile.background[static_cast<size_t>(k)]);
  return std::max(1.0, sum / profile.count);
}

// How many steps a profile's edge is the mean of.
int steps_of(const StretchProfile& p) {
  return std::max(1, p.steps);
}

Fitting::Fitting(std::vector<StretchProfile>& profiles, const ShadingMemory& known)
    : profiles_(profiles), looks_(profiles.size()), evidence_(profiles.size()) {
  const size_t count = (profiles.size() + kLanes - 1) / kLanes;
  blocks_.resize(count);
  size_t samples = 0;
  for (size_t b = 0; b < count; ++b) {
    first_sample_.push_back(samples);
    for (size_t i = b * kLanes; i < std::min(profiles.size(), (b + 1) * kLanes); ++i) {
      blocks_[b].samples = std::max(blocks_[b].samples, profiles[i].profile.count);
      blocks_[b].steps = std::max(blocks_[b].steps, steps_of(profiles[i]));
    }
    samples += static_cast<size_t>(blocks_[b].samples);
  }
  // A megabyte: kept, not cleared and given back with every look at a picture.
  thread_local std::vector<stretch::Sample> buffer;
  if (buffer.size() < samples) buffer.resize(samples);
  samples_ = buffer.data();
  const stretch::Tables tables{NormalTable::instance().values(), gains_of_light().data()};
  for (size_t b = 0; b < count; ++b) {
    fill(b);
    stretch::kernel().find_columns(blocks_[b], samples_ + first_sample_[b], tables);
  }
  for (size_t i = 0; i < profiles.size(); ++i) {
    looks_[i].usable = evidence_[i].usable = block_of(i).usable[i % kLanes] != 0;
    evidence_[i].curve = profiles[i].curve;
    evidence_[i].direction_rad = profiles[i].direction_rad;
    profiles[i].edge.dimmed = 1.0;
    looks_[i].freedom = std::max(0.5, profiles[i].profile.count / profiles[i].profile.shared - 5.0);
  }
  if (known.empty()) return;
  for (const StretchProfile& p : profiles)
    expected_.push_back(known.expected(p.curve, p.direction_rad));
}

// Puts the samples of eight looks side by side.
void Fitting::fill(size_t block) {
  Block& b = blocks_[block];
  static const Profile kNone{};
  stretch::Lanes lanes;
  for (size_t l = 0; l < kLanes; ++l) {
    const size_t i = block * kLanes + l;
    const Profile& profile = i < profiles_.size() ? profiles_[i].profile : kNone;
    lanes.s_px[l] = profile.s_px.data(), lanes.light[l] = profile.light.data();
    lanes.ground[l] = profile.background.data();
    lanes.count[l] = profile.count;
    b.sharp_px[l] = 1.0f;
    if (i >= profiles_.size()) continue;
    const StretchProfile& p = profiles_[i];
    b.sharp_px[l] = static_cast<float>(p.steps > 0 ? p.sharp_px : p.blur_px);
    b.strip_px[l] = static_cast<float>(p.strip_px);
    b.curved[l] = p.curved ? 1.0f : 0.0f;
    b.own_share[l] = static_cast<float>(1.0 / profile.shared);
    b.reach_px[l] = static_cast<float>(p.reach_px);
    for (int j = 0; j < steps_of(p); ++j) {
      b.step_at_px[j][l] = p.steps > 0 ? p.step_at_px[static_cast<size_t>(j)] : 0.0f;
      b.step_part[j][l] = 1.0f / static_cast<float>(steps_of(p));
    }
    // Of mean one, so that levels and slopes compare with those of neighbours without a plate.
    if (p.plate) lanes.per_ground[l] = static_cast<float>(1.0 / light_of_plate(profile));
  }
  stretch::kernel().put_side_by_side(lanes, b.samples, samples_ + first_sample_[block]);
}

stretch::Variances Fitting::variances(const std::vector<Noise>& noise, size_t block) const {
  stretch::Variances out;
  for (size_t l = 0; l < kLanes; ++l) {
    const size_t i = std::min(block * kLanes + l, noise.size() - 1);
    for (size_t k = 0; k < 3; ++k) out.part[k][l] = noise[i][k];
  }
  return out;
}

// Sums of all columns, samples weighed by their noise.
void Fitting::sum(const std::vector<Noise>& noise) {
  const Shading largest = largest_shading();
  for (size_t b = 0; b < blocks_.size(); ++b)
    stretch::kernel().sum_columns(blocks_[b], samples_ + first_sample_[b], variances(noise, b),
                                  largest.data());
  for (size_t i = 0; i < looks_.size(); ++i) take_sums(i);
}

// Of one look, before the noise is known.
void Fitting::take_sums(size_t i) {
  CurveLook& look = looks_[i];
  if (!look.usable) return;
  const Block& b = block_of(i);
  const size_t l = i % kLanes;
  look.most = b.light[l] * largest_shading();
  look.most[kShading - 1] = b.body[l] * largest_shading()[kShading - 1];
  look.left_square = b.left_square[l];
  ShadingEvidence& e = evidence_[i];
  for (int j = 0; j < kShading; ++j) {
    for (int k = 0; k <= j; ++k)
      e.normal(j, k) = e.normal(k, j) =
          look.most[j] * look.most[k] * b.shading_normal[stretch::at(j, k)][l];
    e.right[j] = look.most[j] * b.shading_right[j][l];
    look.blur_cross[j] = look.most[j] * b.blur_cross[j][l];
  }
  look.blur_normal = b.blur_normal[l];
  look.blur_right = b.blur_right[l];
}

// Sum of `of(look)` over the neighbours of each look within its curve.
template <class Sum, class Of>
std::vector<Sum> Fitting::sums_of_neighbours(double share_of_curve, const Sum& none,
                                             const Of& of) const {
  std::vector<Sum> out(looks_.size(), none), before;
  for (size_t first = 0, end = 0; first < looks_.size(); first = end) {
    before.assign(1, none);
    for (; end < looks_.size() && profiles_[end].curve == profiles_[first].curve; ++end) {
      before.push_back(before.back());
      if (looks_[end].usable) before.back() += of(looks_[end]);
    }
    constexpr size_t kLeastReach = 4;
    const size_t count = end - first;
    const auto reach = std::max(
        kLeastReach, static_cast<size_t>(0.5 * share_of_curve * static_cast<double>(count)));
    for (size_t i = 0; i < count; ++i)
      out[first + i] = before[std::min(count, i + reach + 1)] - before[i - std::min(i, reach)];
  }
  return out;
}

// How noisy samples are is known from a stretch of the outline, not from a single look.
std::vector<double> Fitting::noise_of_looks() const {
  constexpr double kShare = 0.08;
  const auto sums = sums_of_neighbours(kShare, Eigen::Array2d(0.0, 0.0), [](const CurveLook& look) {
    return Eigen::Array2d(look.left_square, look.freedom);
  });
  std::vector<double> noise2(looks_.size());
  for (size_t i = 0; i < looks_.size(); ++i)
    noise2[i] =
        profiles_[i].profile.shared * kLeastNoise2 + sums[i][0] / std::max(sums[i][1], 1e-3);
  return noise2;
}

void Fitting::set_evidence(const std::vector<double>& noise2) {
  for (size_t i = 0; i < looks_.size(); ++i) {
    const double information = 1.0 / noise2[i];
    evidence_[i].normal *= information, evidence_[i].right *= information;
    CurveLook& look = looks_[i];
    look.blur_cross *= information;
    look.blur_normal *= information, look.blur_right *= information;
  }
}

// With the blur that goes with its shading.
void set_shading(const ShadingEstimate& estimate, CurveLook& look) {
  look.estimate = estimate;
  look.blur_information =
      look.blur_normal - look.blur_cross.dot(estimate.covariance * look.blur_cross);
  look.blur_step =
      look.blur_information > 0.0
          ? (look.blur_right - look.blur_cross.dot(estimate.shading)) / look.blur_information
          : 0.0;
}

// By how much the edges should be wider: the median, so that shadows that end beside some of them
// do not count.
double blur_step(const std::vector<CurveLook>& looks) {
  constexpr size_t kFewest = 8;
  constexpr double kLeastInformation = 30.0, kMost = 0.3;
  std::vector<double> steps;
  for (const CurveLook& look : looks)
    if (look.usable && look.blur_information > kLeastInformation)
      steps.push_back(std::clamp(look.blur_step, -kMost, kMost));
  if (steps.size() < kFewest) return 0.0;
  return data::upper_median(std::move(steps));
}

// Makes the edges of all looks wider.
void Fitting::widen(double step) {
  for (size_t i = 0; i < looks_.size(); ++i) {
    evidence_[i].right -= step * looks_[i].blur_cross;
    looks_[i].blur_right -= step * looks_[i].blur_normal;
  }
}

// Shading beside the edges and their common blur, which explains what it can first: a picture less
// sharp than expected looks as if it were brighter and darker beside every edge. From the start the
// edges are `wider_px` wider, or as much as they are with little shading. Returns by how much they
// are in the end.
double Fitting::find_shadings(const std::vector<double>& noise2, int rounds,
                              std::optional<double> wider_px) {
  constexpr double kLittle = 0.03;  // of the largest variance
  const auto take = [&](const std::vector<ShadingEstimate>& estimates) {
    for (size_t i = 0; i < looks_.size(); ++i)
      if (looks_[i].usable) set_shading(estimates[i], looks_[i]);
    return blur_step(looks_);
  };
  set_evidence(noise2);
  double wider = 0.0;
  double step = wider_px ? *wider_px : take(shadings_given(evidence_, kLittle));
  for (int round = 0; round < rounds; ++round) {
    wider += step;
    widen(step);
    step = take(estimate_shadings(evidence_, expected_));
  }
  return wider + step;
}

// Squared residuals beside and on the edge about the best step with this shading.
void Fitting::find_noise(const std::vector<Noise>& assumed) {
  for (size_t i = 0; i < looks_.size(); ++i) {
    Shading shading = looks_[i].most.cwiseProduct(looks_[i].estimate.shading);
    // No wall is darker than black.
    shading[kShading - 1] =
        std::max(shading[kShading - 1], -static_cast<double>(block_of(i).inner[i % kLanes]));
    for (int k = 0; k < kShading; ++k)
      block_of(i).shading[k][i % kLanes] = static_cast<float>(shading[k]);
  }
  for (size_t b = 0; b < blocks_.size(); ++b)
    stretch::kernel().find_noise(blocks_[b], samples_ + first_sample_[b], variances(assumed, b));
  for (size_t i = 0; i < looks_.size(); ++i) {
    CurveLook& look = looks_[i];
    if (!look.usable) continue;
    const Block& b = block_of(i);
    const size_t l = i % kLanes;
    look.light_square = static_cast<double>(b.light_square[l]);
    for (int k = 0; k < 3; ++k) {
      look.noise_square[k] = static_cast<double>(b.noise_square[k][l]);
      look.noise_freedom[k] = static_cast<double>(b.noise_freedom[k][l]);
    }
    // Of the shading the share that the samples determine and not what is known of it beforehand;
    // it comes from either side of the edge.
    const double shading = look.estimate.covariance.cwiseProduct(evidence_[i].normal).sum();
    constexpr double kLeastFreedom = 0.2;
    look.noise_freedom -= Eigen::Array3d(0.5, 0.5, 0.0) * shading;
    look.noise_freedom = look.noise_freedom.max(kLeastFreedom);
  }
}

// What strips there are, as far as the shading tells.
void Fitting::take_strips() {
  constexpr int kStrip = kShading - 1;
  for (Block& b : blocks_)
    for (size_t l = 0; l < kLanes; ++l)
      b.strip[l] = b.strip_px[l] > 0.0f ? b.shading[kStrip][l] : 0.0f;
}

// Variances of a sample from a stretch of the outline.
std::vector<Noise> Fitting::noise_of_neighbours() const {
  constexpr double kShare = 0.07;
  using Sums = Eigen::Array<double, 6, 1>;
  const auto sums = sums_of_neighbours(kShare, Sums(Sums::Zero()), [](const CurveLook& look) {
    return (Sums() << look.noise_square, look.noise_freedom).finished();
  });
  std::vector<Noise> out(looks_.size());
  for (size_t i = 0; i < looks_.size(); ++i)
    for (int k = 0; k < 3; ++k)
      out[i][static_cast<size_t>(k)] =
          static_cast<float>(profiles_[i].profile.shared *
                             std::max(sums[i][k] / std::max(sums[i][3 + k], 1e-3), kLeastNoise2));
  return out;
}

// The levels of a side as every look by itself knows them, and how far they are beyond the middle
// one of their surface. That one's own error, about 1.3 of a look's over the root of their number,
// is in no variance.
void Fitting::find_levels(EdgeSide side, const std::vector<double>& noise2) {
  std::map<int, std::vector<double>> values;
  for (size_t i = 0; i < looks_.size(); ++i) {
    if (!looks_[i].usable) continue;
    const Block& b = block_of(i);
    const size_t l = i % kLanes;
    Level& level = looks_[i].levels[side];
    level.per_unit = side == kOutside ? light_of_plate(profiles_[i].profile) : 1.0;
    level.value = static_cast<double>(side == kOutside ? b.outer[l] : b.inner[l]) / level.per_unit;
    const CurveLook& look = looks_[i];
    Shading pull;
    for (int k = 0; k < kShading; ++k)
      pull[k] = look.most[k] * static_cast<double>(b.level_pull[side][k][l]);
    const double of_shading = pull.dot(look.estimate.covariance * pull);
    level.variance = (noise2[i] * static_cast<double>(b.level_variance[side][l]) + of_shading) /
                     (level.per_unit * level.per_unit);
    values[surface(i, side)].push_back(level.value);
  }
  std::map<int, double> usual;
  for (auto& [at, all] : values) usual[at] = data::upper_median(std::move(all));
  for (size_t i = 0; i < looks_.size(); ++i)
    if (looks_[i].usable)
      looks_[i].levels[side].beyond = looks_[i].levels[side].value - usual[surface(i, side)];
}

void Fitting::find_stretches(EdgeSide side) {
  constexpr double kShare = 0.3;
  const auto sums = sums_of_neighbours(
      kShare, Eigen::Array4d(Eigen::Array4d::Zero()), [side](const CurveLook& look) {
        const Level& level = look.levels[side];
        return Eigen::Array4d(1.0, level.beyond, level.beyond * level.beyond, level.variance);
      });
  for (size_t i = 0; i < looks_.size(); ++i) {
    Level& level = looks_[i].levels[side];
    level.count = sums[i][0];
    const double count = std::max(1.0, level.count);
    level.beyond_there = sums[i][1] / count;
    level.square_there = sums[i][2] / count;
    level.variance_there = sums[i][3] / count;
  }
}

// By how much the levels of a look may differ from those of the whole surface because the light
// beside it changes across the edge, and so may along it.
double Fitting::change_of_levels(size_t i) const {
  // So large that levels are as good as free wherever shading shows; from recordings of a top
  // beside its shadow, where levels taken from elsewhere pull edges.
  constexpr double kChange_px = 40.0;
  constexpr double kNoise = 0.006;  // so uneven does noise make even light, by made pictures
  double uneven = looks_[i].estimate.unevenness - kNoise;
  if (!expected_.empty()) uneven += expected_[i].squaredNorm() / (kShading - 1);
  const double light = blocks_[i / kLanes].light[i % kLanes];
  return kChange_px * largest_shading()[0] * light * std::sqrt(std::max(0.0, uneven));
}

// What the levels of a side are by those of the whole surface, as far as a stretch of the outline
// agrees with these.
void Fitting::expect_levels(EdgeSide side) {
  constexpr double kFewest = 8.0;
  constexpr double kLeastShare = 1e-3;  // of the level: what no surface is more even than
  // What a stretch as a whole is beyond the surface pulls all of it one way and is known far better
  // than by squares of single looks, about sqrt(2 count) times: it counts for as much more.
  constexpr double kTogether = 10.0, kClearly = 2.0;  // the latter in standard deviations
  for (size_t i = 0; i < looks_.size(); ++i) {
    const Level& level = looks_[i].levels[side];
    if (!looks_[i].usable || level.count < kFewest) continue;
    const double together = std::max(0.0, level.beyond_there * level.beyond_there -
                                              kClearly * kClearly * level.variance_of_mean());
    // What neighbours differ by beyond their noise, and a standard deviation more.
    const double differ = std::max(0.0, level.square_there - level.variance_there) +
                          level.variance_there * std::sqrt(2.0 / level.count) +
                          kTogether * together;
    const double sd = std::hypot(level.per_unit * std::sqrt(differ), change_of_levels(i),
                                 kLeastShare * level.per_unit * level.value);
    Block& b = block_of(i);
    const size_t l = i % kLanes;
    b.expected_level[side][l] = static_cast<float>(level.per_unit * (level.value - level.beyond));
    b.level_precision[side][l] = static_cast<float>(1.0 / (sd * sd));
  }
}

// By how much the light outside may be less than where most of it falls on the same surface.
void Fitting::compare_with_rest() {
  constexpr double kBright = 0.8, kFewest = 8.0;
  const auto there = [](const Level& level) {
    return level.value - level.beyond + level.beyond_there;
  };
  const auto known = [&](size_t i) {
    return looks_[i].usable && looks_[i].levels[kOutside].count >= kFewest;
  };
  std::map<int, std::vector<double>> values;
  for (size_t i = 0; i < looks_.size(); ++i)
    if (known(i)) values[surface(i, kOutside)].push_back(there(looks_[i].levels[kOutside]));
  std::map<int, double> bright;
  for (auto& [at, all] : values) bright[at] = data::quantile(std::move(all), kBright);
  for (size_t i = 0; i < looks_.size(); ++i) {
    if (!known(i)) continue;
    const Level& level = looks_[i].levels[kOutside];
    const Block& b = block_of(i);
    const size_t l = i % kLanes;
    const double contrast = std::abs(static_cast<double>(b.outer[l] - b.inner[l]));
    const double less = std::max(0.0, bright[surface(i, kOutside)] - there(level));
    profiles_[i].edge.dimmed = level.per_unit * (less + std::sqrt(level.seen_variance_of_mean())) /
                               std::max(1.0, contrast);
  }
}

// The level beside the edge at a distance from it.
float shaded(float level, float slope, float bend, float s) {
  return level + s * (slope + s * bend);
}

// The light beside an edge that was found, and how certain it is.
void Fitting::describe_edge(size_t i) {
  StretchProfile& p = profiles_[i];
  ProfileEdge& e = p.edge;
  const Block& b = block_of(i);
  const size_t l = i % kLanes, block = i / kLanes;
  std::array<float, kShading> v{};
  for (size_t k = 0; k < kShading; ++k) v[k] = b.shading[k][l];
  const auto s = static_cast<float>(e.offset_px);
  const float ground =
      p.plate ? samples_[first_sample_[block] + p.profile.nearest(e.offset_px)].ground[l] : 1.0f;
  const float beside = p.strip_px > 0.0 ? v[4] : 0.0f;  // of the edge the strip's level counts
  const double inner = shaded(b.inner[l], v[0], v[2], s) + beside;
  e.contrast = shaded(b.outer[l], v[1], v[3], s) * ground - inner;
  e.mean_level = inner + 0.5 * e.contrast;
  e.inner_slope = v[0] + 2.0f * s * v[2];
  e.outer_slope = (v[1] + 2.0f * s * v[3]) * ground;
  const double square = looks_[i].light_square;
  const double freedom = std::max(1.0, looks_[i].noise_freedom.sum());
  constexpr double kLeastGainNoise2 = 0.1;
  e.lines = p.profile.lines;
  e.gain = 0.5 * freedom / p.profile.lines *
           std::log((square_without_edge(p.profile, p.plate) / p.profile.shared +
                     freedom * kLeastGainNoise2) /
                    (square + freedom * kLeastGainNoise2));
}

// The offsets with shadings given, samples weighed by their noise.
void Fitting::find_offsets(const std::vector<Noise>& noise) {
  for (size_t b = 0; b < blocks_.size(); ++b)
    stretch::kernel().find_offsets(blocks_[b], samples_ + first_sample_[b], variances(noise, b));
  for (size_t i = 0; i < looks_.size(); ++i) {
    const Block& b = block_of(i);
    const size_t l = i % kLanes;
    profiles_[i].found = b.found[l] != 0;
    if (!profiles_[i].found) continue;
    const CurveLook& look = looks_[i];
    Shading pull;
    for (int k = 0; k < kShading; ++k) pull[k] = look.most[k] * static_cast<double>(b.pull[k][l]);
    ProfileEdge& e = profiles_[i].edge;
    e.offset_px = static_cast<double>(b.offset_px[l]);
    e.strip_share = static_cast<double>(b.strip_share[l]);
    e.noise_variance_px2 = 1.0 / static_cast<double>(b.information[l]);
    const ShadingMatrix& covariance = look.estimate.covariance;
    e.shading_variance_px2 = pull.dot(covariance * pull);
    e.unevenness = look.estimate.unevenness;
    constexpr int kStrip = kShading - 1;
    e.strip_variance_px2 = std::pow(pull[kStrip] * covariance(kStrip, kStrip), 2);
    describe_edge(i);
  }
}

// By how much each edge is wider than usual here.
void Fitting::compare_widths() {
  constexpr double kScatter_px = 0.1;
  const double usual = blur_step(looks_);
  for (size_t i = 0; i < looks_.size(); ++i) {
    const double variance = 1.0 / std::max(looks_[i].blur_information, 1e-9);
    const double seen = 1.0 / (1.0 + variance / (kScatter_px * kScatter_px));
    profiles_[i].edge.wider_px = seen * (looks_[i].blur_step - usual);
    profiles_[i].edge.wider_variance_px2 = seen * seen * variance;
    if (!looks_[i].usable) continue;
    // The blur that is fitted is that of each step of an edge that moves.
    const StretchProfile& p = profiles_[i];
    const double per_px = 2.0 * (p.steps > 0 ? p.sharp_px : p.blur_px);
    profiles_[i].edge.beyond_blur2_px2 = per_px * looks_[i].blur_step;
    profiles_[i].edge.beyond_blur2_information = looks_[i].blur_information / (per_px * per_px);
  }
}

StretchFit Fitting::run(bool weighed) {
  const std::vector<Noise> equal(looks_.size(), kEqual);
  sum(equal);
  StretchFit out;
  const std::vector<double> noise2 = noise_of_looks();
  out.wider_px = find_shadings(noise2, weighed ? 1 : 2);
  find_noise(equal);
  std::vector<Noise> noise = noise_of_neighbours();
  if (weighed) {
    for (const EdgeSide side : {kInside, kOutside}) {
      find_levels(side, noise2);
      find_stretches(side);
      expect_levels(side);
    }
    compare_with_rest();
    take_strips();
    sum(noise);
    out.wider_px = find_shadings(std::vector<double>(looks_.size(), 1.0), 2, out.wider_px);
    find_noise(noise);
    noise = noise_of_neighbours();
  }
  find_offsets(noise);
  compare_widths();
  out.shading = std::move(evidence_);
  return out;
}

}  // namespace

StretchFit fit_stretches(std::vector<StretchProfile>& profiles, const ShadingMemory& known,
                         bool weighed) {
  return profiles.empty() ? StretchFit{} : Fitting(profiles, known).run(weighed);
}

}  // namespace trochoid::tracking
