#include "common/interruption.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <string_view>
#include <thread>

#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

std::array<int, 2> wake_up{};  // a pipe: all a signal handler may do is write to it

void on_signal(int number) {
  const int before = errno;
  const auto byte = static_cast<unsigned char>(number);
  [[maybe_unused]] const ssize_t written = ::write(wake_up[1], &byte, 1);
  errno = before;
}

void wait_for_signal() {
  unsigned char number = 0;
  while (::read(wake_up[0], &number, 1) != 1) {
  }
  data::remove_pending_and_stop();
  constexpr std::string_view kWords = "\rtrochoid: interrupted, unfinished files are removed\n";
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, kWords.data(), kWords.size());
  end_by(number);
}

}  // namespace

void end_by(int number) {
  std::signal(number, SIG_DFL);
  std::raise(number);
  _exit(128 + number);
}

void clean_up_when_interrupted() {
  // A file beyond the caller's limit (ulimit -f), or a program that was to read from us and did not
  // start, is then a write that fails, and told like a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  if (pipe2(wake_up.data(), O_CLOEXEC) != 0) return;
  std::thread(wait_for_signal).detach();
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    // What the caller has switched off stays off: nohup, background jobs of a script.
    if (sigaction(number, nullptr, &before) != 0 || before.sa_handler == SIG_IGN) continue;
    struct sigaction action {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    sigaction(number, &action, nullptr);
  }
}

}  // namespace trochoid::tools
