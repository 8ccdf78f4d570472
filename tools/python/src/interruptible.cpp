#include "interruptible.hpp"

#include <pybind11/pybind11.h>

#include <chrono>
#include <csignal>
#include <future>
#include <mutex>
#include <optional>

namespace trochoid::python {
namespace py = pybind11;
namespace {

std::atomic<unsigned> presses{0};
struct sigaction pythons_own {};

void count_press(int number) {
  ++presses;
  pythons_own.sa_handler(number);
}

/// While any is alive, Ctrl-C is counted before Python hears of it. Python tells its main thread
/// alone: what an executor's threads have begun would go on to its end, and the program with it.
class Listener {
 public:
  Listener() {
    const std::lock_guard lock(mutex());
    if (alive()++ > 0) return;
    if (sigaction(SIGINT, nullptr, &pythons_own) != 0 || (pythons_own.sa_flags & SA_SIGINFO) != 0 ||
        pythons_own.sa_handler == SIG_IGN || pythons_own.sa_handler == SIG_DFL)
      return;
    struct sigaction ours = pythons_own;
    ours.sa_handler = count_press;
    sigaction(SIGINT, &ours, nullptr);
  }
  ~Listener() {
    const std::lock_guard lock(mutex());
    struct sigaction current {};
    if (--alive() > 0 || sigaction(SIGINT, nullptr, &current) != 0) return;
    if (current.sa_handler == count_press) sigaction(SIGINT, &pythons_own, nullptr);
  }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  [[nodiscard]] bool heard() const { return presses != before_; }

 private:
  static std::mutex& mutex() {
    static std::mutex only;
    return only;
  }
  static int& alive() {
    static int count = 0;
    return count;
  }
  unsigned before_ = presses;
};

/// Whether the calling thread is one that Python tells nothing of signals, while Ctrl-C means what
/// it does by default: the end.
bool misses_control_c() {
  const auto signals = py::module_::import("signal"), threads = py::module_::import("threading");
  return !threads.attr("current_thread")().is(threads.attr("main_thread")()) &&
         signals.attr("getsignal")(SIGINT).equal(signals.attr("default_int_handler"));
}

}  // namespace

void run_interruptibly(const std::function<void(const Interrupt&)>& work) {
  using namespace std::chrono_literals;
  Interrupt interrupt;
  std::optional<Listener> listener;
  if (misses_control_c()) listener.emplace();
  std::optional<py::error_already_set> raised;  // by a signal handler, Ctrl-C's mostly
  const auto stop = [&] {
    raised.emplace();
    interrupt.press();
  };
  {
    const py::gil_scoped_release unlocked;
    auto done = std::async(std::launch::async, [&] { work(interrupt); });
    while (done.wait_for(50ms) != std::future_status::ready) {
      if (raised) continue;
      const py::gil_scoped_acquire locked;
      if (PyErr_CheckSignals() != 0) {
        stop();
      } else if (listener && listener->heard()) {
        PyErr_SetNone(PyExc_KeyboardInterrupt);
        stop();
      }
    }
    try {
      done.get();
    } catch (...) {
      if (!raised) throw;
    }
  }
  if (raised) throw *raised;
}

}  // namespace trochoid::python
