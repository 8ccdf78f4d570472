#pragma once
#include <cstddef>
#include <string_view>

namespace trochoid::model {

/// Why a run ended. Every run ends in exactly one of these.
enum class Outcome {
  reached_end,
  flat,        ///< theta fell below the face-contact limit
  rim_switch,  ///< theta = pi/2 on a thick body: the contact jumps to the other rim
  lift_off,    ///< normal force reached zero
  at_rest,
  inconsistent_contact,  ///< Painleve: no admissible contact force
  step_limit,
  tolerance_not_reachable,  ///< step size fell to rounding
  out_of_domain,            ///< parameters or state outside the model's range
  chattering,               ///< sticking and slipping alternate too fast to be followed
  diverged,                 ///< two runs of different tolerance go different ways from here on
};
inline constexpr std::size_t kOutcomes = static_cast<std::size_t>(Outcome::diverged) + 1;

[[nodiscard]] std::string_view name(Outcome outcome);      ///< e.g. "rim_switch"
[[nodiscard]] std::string_view sentence(Outcome outcome);  ///< for people
/// Whether the integration gave up there; else the motion went so far, or ended there.
[[nodiscard]] bool broke_off(Outcome outcome);

}  // namespace trochoid::model
