#include "find/palette.hpp"

#include <algorithm>
#include <cmath>

namespace trochoid::tracking {
Palette::Cell Palette::cell_of(const std::array<std::uint8_t, 3>& colour, double gain) {
  const auto cell = [](double level) {
    return std::clamp(static_cast<int>(level) * kCells / 256, 0, kCells - 1);
  };
  return {cell(colour[0] / std::max(gain, 1e-3)), cell(colour[1]), cell(colour[2])};
}

std::size_t Palette::at(const Cell& cell) {
  return static_cast<std::size_t>((cell[0] * kCells + cell[1]) * kCells + cell[2]);
}

void Palette::learn(const FaceColours& face, double gain) {
  if (face.count == 0) return;
  constexpr double kSlowest = 0.03;  // some thirty frames are remembered
  const double rate = std::max(kSlowest, 1.0 / (learnt_ + 1.0));
  if (learnt_ > 0) {
    const double off = share(face, gain) - usual_share_;
    usual_share_ += rate * off;
    usual_scatter_ += rate * (std::abs(off) - usual_scatter_);
  }
  if (weights_.empty()) weights_.resize(kCells * kCells * kCells);
  for (float& weight : weights_) weight *= static_cast<float>(1.0 - rate);
  const auto part = static_cast<float>(rate / face.count);
  for (int i = 0; i < face.count; ++i) {
    const Cell cell = cell_of(face.at[static_cast<std::size_t>(i)], gain);
    for (int a = -1; a <= 1; ++a)
      for (int b = -1; b <= 1; ++b)
        for (int c = -1; c <= 1; ++c) {
          const Cell near{cell[0] + a, cell[1] + b, cell[2] + c};
          if (std::all_of(near.begin(), near.end(), [](int k) { return k >= 0 && k < kCells; }))
            weights_[at(near)] += part;
        }
  }
  ++learnt_;
}

double Palette::share(const FaceColours& face, double gain) const {
  if (learnt_ == 0 || face.count == 0) return 1.0;
  int shown = 0;
  for (int i = 0; i < face.count; ++i)
    shown += shows(face.at[static_cast<std::size_t>(i)], gain) ? 1 : 0;
  return shown / static_cast<double>(face.count);
}

bool Palette::fits(const FaceColours& face, double gain) const {
  constexpr double kLeast = 0.4, kScatters = 3.0;
  return share(face, gain) >= kLeast * (usual_share_ - kScatters * usual_scatter_);
}

}  // namespace trochoid::tracking
