#include "commands.hpp"

namespace trochoid::tools {

void add_study_command(CLI::App& app) {
  CLI::App* study = app.add_subcommand(
      "study",
      "Measure the program itself: error against run time, and what survives the extremes");
  study->require_subcommand(1);
  study->footer("Example: trochoid study fits --count 100");
  add_study_chain(*study);
  add_study_fits(*study);
  add_study_reference(*study);
  add_study_lean(*study);
  add_study_retrograde(*study);
  add_study_solvers(*study);
  add_study_stability(*study);
  add_study_thesis(*study);
#ifdef TROCHOID_HAS_TRACKING
  add_study_tracking(*study);
  add_study_tracking_sweep(*study);
#endif
}

}  // namespace trochoid::tools
