#include "edges/stretch_kernel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "edges/normal_table.hpp"

namespace trochoid::tracking::stretch {

extern const Kernel isa_baseline;

namespace {

constexpr int kSamples = 24;
constexpr double kLargest[kShading] = {0.06, 0.06, 0.02, 0.02, 0.6};

// Noisy steps at different places, some of them with a strip beside.
std::vector<Sample> steps_of(unsigned seed, Block& block) {
  std::mt19937 random(seed);
  std::normal_distribution<float> noise;
  block.samples = kSamples;
  std::vector<Sample> samples(kSamples, Sample{});
  for (int l = 0; l < kLanes; ++l) {
    block.step_part[0][l] = 1.0f;
    block.sharp_px[l] = 0.8f;
    block.own_share[l] = 1.0f;
    block.reach_px[l] = 2.0f;
    block.strip_px[l] = l % 2 == 0 ? 0.0f : 2.0f;
    block.strip[l] = block.shading[kShading - 1][l] = l % 2 == 0 ? 0.0f : -30.0f;
    block.expected_level[1][l] = 139.0f;
    block.level_precision[1][l] = l % 3 == 0 ? 0.0f : 2.0f;
    const float at_px = 0.3f * noise(random);
    for (int k = 0; k < kSamples; ++k) {
      Sample& s = samples[static_cast<size_t>(k)];
      s.s_px[l] = 0.4f * static_cast<float>(k - kSamples / 2);
      const float share = 0.5f * std::erfc((at_px - s.s_px[l]) / (0.8f * std::sqrt(2.0f)));
      const float within_px = at_px - s.s_px[l] - block.strip_px[l];
      const float beyond = 0.5f * std::erfc(within_px / (0.8f * std::sqrt(2.0f)));
      s.light[l] = 60.0f + 80.0f * share + block.strip[l] * (beyond - share) + noise(random);
      s.ground[l] = s.valid[l] = 1.0f;
    }
  }
  return samples;
}

// The offsets a kernel finds.
Block fitted(const Kernel& kernel, unsigned seed) {
  Block block;
  std::vector<Sample> samples = steps_of(seed, block);
  const std::vector<float> gains(256, 1.0f);
  const Variances equal{{Floats{} + 1.0f, Floats{} + 1.0f, Floats{} + 1.0f}};
  kernel.find_columns(block, samples.data(), {NormalTable::instance().values(), gains.data()});
  kernel.sum_columns(block, samples.data(), equal, kLargest);
  kernel.find_noise(block, samples.data(), equal);
  kernel.find_offsets(block, samples.data(), equal);
  return block;
}

// To the last bit: products are fused into sums in neither. Without AVX2 both are the same kernel.
TEST(StretchKernel, EveryMachineFindsTheSameOffsets) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Block here = fitted(kernel(), seed), plain = fitted(isa_baseline, seed);
    for (int l = 0; l < kLanes; ++l) {
      ASSERT_NE(here.found[l], 0) << "seed " << seed << ", look " << l;
      EXPECT_EQ(here.offset_px[l], plain.offset_px[l]) << "seed " << seed;
      EXPECT_EQ(here.information[l], plain.information[l]) << "seed " << seed;
      EXPECT_EQ(here.strip_share[l], plain.strip_share[l]) << "seed " << seed;
    }
  }
}

TEST(StretchKernel, SamplesPastTheEndOfALookDoNotCount) {
  Block all, cut;
  std::vector<Sample> samples = steps_of(1, all), fewer = samples;
  cut = all;
  cut.samples = kSamples - 4;
  for (size_t k = kSamples - 4; k < kSamples; ++k) samples[k] = Sample{};
  fewer.resize(kSamples - 4);
  const std::vector<float> gains(256, 1.0f);
  const Variances equal{{Floats{} + 1.0f, Floats{} + 1.0f, Floats{} + 1.0f}};
  const Tables tables{NormalTable::instance().values(), gains.data()};
  kernel().find_columns(all, samples.data(), tables);
  kernel().find_columns(cut, fewer.data(), tables);
  for (auto* block : {&all, &cut}) {
    std::vector<Sample>& own = block == &all ? samples : fewer;
    kernel().sum_columns(*block, own.data(), equal, kLargest);
    kernel().find_noise(*block, own.data(), equal);
    kernel().find_offsets(*block, own.data(), equal);
  }
  for (int l = 0; l < kLanes; ++l) {
    EXPECT_EQ(all.offset_px[l], cut.offset_px[l]);
    EXPECT_EQ(all.noise_freedom[0][l], cut.noise_freedom[0][l]);
  }
}

}  // namespace
}  // namespace trochoid::tracking::stretch
