#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace trochoid::tracking {

// The transfer curve that cameras apply to light, sRGB (IEC 61966-2-1; BT.709 differs by less than
// two levels): levels of the picture and linear light, both 0..255.

/// The light of a level; of one outside 0..255, that of the end it is beyond.
inline double light_of(double level) {
  const double v = std::clamp(level / 255.0, 0.0, 1.0);
  return 255.0 * (v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
}

/// The same of the levels 0..255 of a picture.
inline const std::array<double, 256>& light_of_levels() {
  static const std::array<double, 256> table = [] {
    std::array<double, 256> light{};
    for (std::size_t i = 0; i < light.size(); ++i) light[i] = light_of(static_cast<double>(i));
    return light;
  }();
  return table;
}

/// The level of light; without light 0.
inline double level_of(double light) {
  const double v = std::max(0.0, light / 255.0);
  return 255.0 * (v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1.0 / 2.4) - 0.055);
}

/// By how much the light grows per level where there is so much of it.
inline double light_per_level(double light) {
  const double v = std::max(0.0, light / 255.0);
  return v <= 0.0031308 ? 1.0 / 12.92 : 2.4 / 1.055 * std::pow(v, 1.4 / 2.4);
}

}  // namespace trochoid::tracking
