#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>

#include "commands.hpp"
#include "interruption.hpp"
#include "progress.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/fitting/fit.hpp"

namespace {

enum ExitStatus { kDone = 0, kError = 1, kUsage = 2, kNotGood = 3 };

int run(int argc, char** argv) {
  CLI::App app{
      "Track spinning and rolling discs and rings in video, fit a rigid-body model to the "
      "path, and show prediction and observation together."};
  app.set_version_flag("--version", "trochoid " TROCHOID_VERSION);
  app.require_subcommand(1);
  app.fallthrough();  // --quiet and --verbose may stand before or after the command
  app.add_flag_callback(
      "-q,--quiet", [] { trochoid::tools::set_talk(trochoid::tools::Talk::quiet); },
      "No progress and no remarks on stderr, errors only");
  app.add_flag_callback(
      "-v,--verbose", [] { trochoid::tools::set_talk(trochoid::tools::Talk::verbose); },
      "Say on stderr what is being done and why");
  trochoid::fitting::silence_solver_log();
  using namespace trochoid::tools;
  add_simulate_command(app);
  add_fit_command(app);
  add_study_command(app);
  add_report_command(app);
#ifdef TROCHOID_HAS_TRACKING
  add_track_command(app);
  add_overlay_command(app);
  add_run_command(app);
  add_campaign_command(app);
  add_render_command(app);
  add_calibrate_command(app);
  add_init_command(app);
#endif
  add_manual_command(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kUsage;
  }
  return kDone;
}

}  // namespace

// The only place that catches: libraries throw, commands do not print errors.
int main(int argc, char** argv) try {
  trochoid::tools::clean_up_when_interrupted();
  return run(argc, argv);
} catch (const trochoid::tools::NotGood& answer) {
  fmt::print(stderr, "trochoid: {}\n", answer.what());
  return kNotGood;
} catch (const std::filesystem::filesystem_error& error) {
  fmt::print(stderr, "trochoid: {}: {}\n", error.path1().string(), error.code().message());
  return kError;
} catch (const std::exception& error) {
  fmt::print(stderr, "trochoid: {}\n", error.what());
  return kError;
}
