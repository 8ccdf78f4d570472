#pragma once
#include <CLI/CLI.hpp>

#include "common/not_good.hpp"

/// One subcommand per file; each adds itself to the program.
namespace trochoid::tools {

void add_simulate_command(CLI::App& app);
void add_manual_command(CLI::App& app);
void add_fit_command(CLI::App& app);
void add_study_command(CLI::App& app);
void add_study_chain(CLI::App& study);
void add_study_fits(CLI::App& study);
void add_study_reference(CLI::App& study);
void add_report_command(CLI::App& app);
void add_study_lean(CLI::App& study);
void add_study_retrograde(CLI::App& study);
void add_study_solvers(CLI::App& study);
void add_study_stability(CLI::App& study);
void add_study_thesis(CLI::App& study);
#ifdef TROCHOID_HAS_TRACKING
void add_track_command(CLI::App& app);
void add_study_tracking(CLI::App& study);
void add_study_tracking_sweep(CLI::App& study);
void add_init_command(CLI::App& app);
void add_overlay_command(CLI::App& app);
void add_run_command(CLI::App& app);
/// What `trochoid run` would refuse before it looks into the recording.
/// @throws InputError as it would.
void check_run(const std::vector<std::string>& words);
void add_campaign_command(CLI::App& app);
void add_render_command(CLI::App& app);
void add_calibrate_command(CLI::App& app);
#endif

}  // namespace trochoid::tools
