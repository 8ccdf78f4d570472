#pragma once

namespace trochoid::tracking {

/// How closely an outline is looked at: quick, which looks only once, is for a first look and long
/// recordings, exact for a last look. `trochoid study chain` shows what each costs and gives.
enum class Effort { quick, normal, exact };

/// In how many places edges are looked for along an outline, at most about so many: one for each
/// pixel of a short one, longer ones are sampled more sparsely.
[[nodiscard]] constexpr double most_looks(Effort effort) {
  switch (effort) {
    case Effort::quick:
      return 120.0;
    case Effort::exact:
      return 1000.0;
    case Effort::normal:
      break;
  }
  return 450.0;
}

/// A picture is looked at once, or in passing first, at every second place, and again when the
/// frames around it are known (not where its attitude stays doubtful).
enum class Visit { only, first, again };

}  // namespace trochoid::tracking
