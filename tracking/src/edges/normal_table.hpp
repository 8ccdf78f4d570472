#pragma once
#include <algorithm>
#include <array>

namespace trochoid::tracking {

/// Normal distribution and density, tabulated: edge fits evaluate them a million times a second.
class NormalTable {
 public:
  struct Step {
    float share, density;
  };
  static const NormalTable& instance();
  /// Shares and densities in turns, from -4 in steps of 1/64.
  [[nodiscard]] const float* values() const { return &entries_[0].share; }
  [[nodiscard]] Step at(float x) const {
    const float place = (std::clamp(x, -kRange, kRange) + kRange) * kPerUnit;
    const int i = static_cast<int>(place);
    const float part = place - static_cast<float>(i);
    const auto& low = entries_[static_cast<std::size_t>(i)];
    const auto& high = entries_[static_cast<std::size_t>(i) + 1];
    return {low.share + part * (high.share - low.share),
            low.density + part * (high.density - low.density)};
  }

 private:
  NormalTable();
  static constexpr float kRange = 4.0f;
  static constexpr int kPerUnit = 64;
  std::array<Step, 2 * 4 * kPerUnit + 2> entries_{};
};

}  // namespace trochoid::tracking
