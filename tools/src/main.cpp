#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>
#include <string>
#include <system_error>

#include "commands.hpp"
#include "common/interruption.hpp"
#include "common/progress.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/fitting/fit.hpp"

namespace {

enum ExitStatus { kDone = 0, kError = 1, kUsage = 2, kNotGood = 3 };

/// Where a caller has closed one of them, a file opened later would take its place, and our words.
void open_standard_streams() {
  for (int stream = 0; stream <= STDERR_FILENO; ++stream)
    if (fcntl(stream, F_GETFD) < 0) (void)open("/dev/null", O_RDWR);
}

/// "trochoid study fits", as far as the words were understood.
std::string understood(const CLI::App& app) {
  std::string words = app.get_name();
  for (const CLI::App* command : app.get_subcommands()) words += " " + understood(*command);
  return words;
}

/// Whether a command that is not there would be in a build with tracking.
bool needs_tracking([[maybe_unused]] const std::string& command) {
#ifdef TROCHOID_HAS_TRACKING
  return false;
#else
  constexpr std::array<std::string_view, 9> kCommands{"init",   "calibrate", "run",
                                                      "track",  "overlay",   "campaign",
                                                      "render", "tracking",  "tracking-sweep"};
  return std::find(kCommands.begin(), kCommands.end(), command) != kCommands.end();
#endif
}

/// One line: what was wrong and where to look.
std::string usage_error(const CLI::App* app, const CLI::Error& error) {
  const std::string words = understood(*app);
  const std::vector<std::string> left = app->remaining(true);
  const bool unknown = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr &&
                       !left.empty() && !left.front().starts_with('-') &&
                       std::string_view(error.what()).find("subcommand") != std::string_view::npos;
  if (unknown && needs_tracking(left.front()))
    return fmt::format("trochoid: this trochoid was built without tracking: it has no '{}'\n",
                       left.front());
  return fmt::format("trochoid: {}; {} --help tells more\n",
                     unknown ? fmt::format("'{}' is no subcommand of {}", left.front(), words)
                             : std::string(error.what()),
                     words);
}

int run(int argc, char** argv) {
  CLI::App app{
      "Track spinning and rolling discs and rings in video, fit a rigid-body model to the "
      "path, and show prediction and observation together."};
  app.set_version_flag("--version", "trochoid " TROCHOID_VERSION);
  app.name("trochoid");
  app.failure_message(usage_error);
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
  // In the order of work: what --help lists first is wanted first.
#ifdef TROCHOID_HAS_TRACKING
  add_init_command(app);
  add_calibrate_command(app);
  add_run_command(app);
  add_track_command(app);
  add_overlay_command(app);
  add_campaign_command(app);
  add_render_command(app);
#endif
  add_fit_command(app);
  add_simulate_command(app);
  add_report_command(app);
  add_study_command(app);
  add_manual_command(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kUsage;
  }
  return kDone;
}

/// stderr may be closed or full as well.
void complain(const std::string& words) {
  std::fputs(("trochoid: " + words + "\n").c_str(), stderr);
}

/// Whoever stops reading what we print (head) has seen enough, and wants no complaint.
void check_printed() {
  if (std::fflush(stdout) == 0) return;
  if (errno == EPIPE) trochoid::tools::end_by(SIGPIPE);
  throw trochoid::InputError("standard output cannot be written (is the disk full?)");
}

}  // namespace

// The only place that catches: libraries throw, commands do not print errors.
int main(int argc, char** argv) try {
  open_standard_streams();
  trochoid::tools::clean_up_when_interrupted();
  const int status = run(argc, argv);
  check_printed();
  return status;
} catch (const trochoid::tools::NotGood& answer) {
  std::fflush(stdout);  // where both go into one file, the complaint follows the results
  complain(answer.what());
  return kNotGood;
} catch (const std::filesystem::filesystem_error& error) {
  complain(error.path1().string() + ": " + error.code().message());
  return kError;
} catch (const std::system_error& error) {
  if (error.code() == std::errc::broken_pipe) trochoid::tools::end_by(SIGPIPE);
  complain(error.what());
  return kError;
} catch (const std::bad_alloc&) {
  complain("out of memory");
  return kError;
} catch (const std::exception& error) {
  complain(error.what());
  return kError;
}
