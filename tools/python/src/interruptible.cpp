#include "interruptible.hpp"

#include <pybind11/pybind11.h>

#include <chrono>
#include <future>

namespace trochoid::python {
namespace py = pybind11;

void run_interruptibly(const std::function<void(const Interrupt&)>& work) {
  using namespace std::chrono_literals;
  Interrupt interrupt;
  bool pressed = false;
  {
    const py::gil_scoped_release unlocked;
    auto done = std::async(std::launch::async, [&] { work(interrupt); });
    while (done.wait_for(50ms) != std::future_status::ready) {
      if (pressed) continue;
      const py::gil_scoped_acquire locked;
      pressed = PyErr_CheckSignals() != 0;
      if (pressed) {
        PyErr_Clear();  // raised anew below, when nothing runs any more
        interrupt.press();
      }
    }
    try {
      done.get();
    } catch (const Interrupted&) {
    }
  }
  if (!pressed) return;
  PyErr_SetNone(PyExc_KeyboardInterrupt);
  throw py::error_already_set();
}

}  // namespace trochoid::python
