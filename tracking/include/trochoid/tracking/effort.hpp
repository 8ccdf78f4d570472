#pragma once

namespace trochoid::tracking {

/// How closely an outline is looked at: quick is for a first look and long recordings, exact for a
/// last look. `trochoid study chain` shows what each costs and gives.
enum class Effort { quick, normal, exact };

/// Where edges are looked for along an outline.
struct Sampling {
  double least_step_px;  ///< neighbours nearer than this show the same pixels
  double points;         ///< at most about so many; longer outlines are sampled more sparsely
};
[[nodiscard]] constexpr Sampling sampling_of(Effort effort) {
  switch (effort) {
    case Effort::quick:
      return {2.0, 120.0};
    case Effort::exact:
      return {1.0, 1000.0};
    case Effort::normal:
      break;
  }
  return {1.0, 450.0};
}

}  // namespace trochoid::tracking
