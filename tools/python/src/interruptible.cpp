#include "interruptible.hpp"

#include <pybind11/pybind11.h>

#include <chrono>
#include <future>
#include <optional>

namespace trochoid::python {
namespace py = pybind11;

void run_interruptibly(const std::function<void(const Interrupt&)>& work) {
  using namespace std::chrono_literals;
  Interrupt interrupt;
  std::optional<py::error_already_set> raised;  // by a signal handler, Ctrl-C's mostly
  {
    const py::gil_scoped_release unlocked;
    auto done = std::async(std::launch::async, [&] { work(interrupt); });
    while (done.wait_for(50ms) != std::future_status::ready) {
      if (raised) continue;
      const py::gil_scoped_acquire locked;
      if (PyErr_CheckSignals() == 0) continue;
      raised.emplace();
      interrupt.press();
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
