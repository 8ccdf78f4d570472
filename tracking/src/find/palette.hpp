#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "find/contrast.hpp"

namespace trochoid::tracking {

/// The colours a body's face has shown so far, at the brightness of the background plate: what
/// tells it from a hand or a bar of about its outline. Old ones fade as new ones come.
class Palette {
 public:
  /// @param gain of the frame's brightness over the plate's.
  void learn(const FaceColours& face, double gain);
  /// Whether it has shown this colour.
  [[nodiscard]] bool shows(const std::array<std::uint8_t, 3>& colour, double gain) const {
    return learnt_ > 0 && weights_[at(cell_of(colour, gain))] > kShown;
  }
  /// Share 0..1 of a face in such colours; 1 before any were learnt, or of a face out of sight.
  [[nodiscard]] double share(const FaceColours& face, double gain) const;
  /// False for a face with clearly fewer of them than its own faces have had as they came; where
  /// gloss changes those all the time, nothing is told.
  [[nodiscard]] bool fits(const FaceColours& face, double gain) const;

 private:
  static constexpr int kCells = 32;  // per plane, of 8 levels
  /// Of what its faces were made of lately: a few points that saw something else do not count.
  static constexpr float kShown = 0.015F;
  using Cell = std::array<int, 3>;
  [[nodiscard]] static Cell cell_of(const std::array<std::uint8_t, 3>& colour, double gain);
  [[nodiscard]] static std::size_t at(const Cell& cell);

  int learnt_ = 0;
  double usual_share_ = 1.0, usual_scatter_ = 0.05;
  std::vector<float> weights_;  ///< by cell; each colour is spread over its neighbours, too
};

}  // namespace trochoid::tracking
