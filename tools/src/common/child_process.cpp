#include "common/child_process.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>

namespace trochoid::tools {
namespace {

constexpr const char* kNotStarted = "cannot be started: ";
// Where whoever started this program ignores SIGCHLD, the system does not keep it.
constexpr const char* kUnknownEnd = "how the process ended is not known";

/// In the child, between fork() and exec(), where nothing may be called that takes a lock.
[[noreturn]] void end_unstarted(int error) {
  for (const char* words : {kNotStarted, strerrordesc_np(error)})
    if (words != nullptr && ::write(STDERR_FILENO, words, std::strlen(words)) < 0) break;
  _exit(127);
}

ChildRun not_started(int error) {
  ChildRun run;
  run.error_output = kNotStarted + std::string(std::strerror(error));
  return run;
}

std::string ended_by(int signal) {
  const char* what = sigdescr_np(signal);
  return fmt::format("the process was ended by signal {} ({})", signal,
                     what != nullptr ? what : "unknown");
}

}  // namespace

ChildRun run_child(const std::vector<std::string>& arguments, const std::filesystem::path& output) {
  ChildRun run;
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  std::array<int, 2> pipe_ends{};
  if (pipe2(pipe_ends.data(), O_CLOEXEC) != 0) return not_started(errno);
  const auto start = std::chrono::steady_clock::now();
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != parent) _exit(127);  // it ended before it could be asked for a signal
    dup2(pipe_ends[1], STDERR_FILENO);
    const int nothing = open("/dev/null", O_RDWR);
    const int written = open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    if (nothing < 0 || written < 0) end_unstarted(errno);
    dup2(nothing, STDIN_FILENO);
    dup2(written, STDOUT_FILENO);
    execvp(argv[0], argv.data());
    end_unstarted(errno);
  }
  if (child < 0) run = not_started(errno);
  close(pipe_ends[1]);
  if (child > 0) {
    std::array<char, 4096> buffer{};
    for (ssize_t n = 0; (n = ::read(pipe_ends[0], buffer.data(), buffer.size())) > 0;)
      run.error_output.append(buffer.data(), static_cast<std::size_t>(n));
    int status = 0;
    rusage usage{};
    pid_t waited = 0;
    while ((waited = wait4(child, &status, 0, &usage)) < 0 && errno == EINTR) {
    }
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    run.seconds = elapsed.count();
    run.exit_status = waited == child && WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    run.started = run.exit_status != 127;
    if (waited != child || WIFSIGNALED(status)) {
      if (!run.error_output.empty() && run.error_output.back() != '\n') run.error_output += '\n';
      run.error_output += waited == child ? ended_by(WTERMSIG(status)) : kUnknownEnd;
      run.error_output += '\n';
    }
    run.peak_mb = static_cast<double>(usage.ru_maxrss) / 1024.0;  // Linux counts kB
  }
  close(pipe_ends[0]);
  return run;
}

std::string last_line(const std::string& text) {
  const std::size_t end = text.find_last_not_of(" \n\r");
  if (end == std::string::npos) return {};
  const std::size_t start = text.find_last_of("\n\r", end);
  return text.substr(start == std::string::npos ? 0 : start + 1, end - (start + 1) + 1);
}

std::string own_path() {
  return "/proc/self/exe";
}

}  // namespace trochoid::tools
