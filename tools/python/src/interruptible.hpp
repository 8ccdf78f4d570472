#pragma once
#include <atomic>
#include <functional>

namespace trochoid::python {

/// Thrown out of a running computation when the user pressed Ctrl-C. Not a trochoid::Error: those
/// are answers a minimiser may try to live with.
struct Interrupted {};

/// Lets a computation ask whether it should go on.
class Interrupt {
 public:
  /// @throws Interrupted once the user has pressed Ctrl-C.
  void check() const {
    if (pressed_) throw Interrupted{};
  }
  void press() { pressed_ = true; }

 private:
  std::atomic<bool> pressed_{false};
};

/// Runs `work` in a thread of its own without the GIL, while the calling thread looks for signals
/// several times a second; returns or throws what `work` does. When a signal's handler raises (as
/// Ctrl-C's does, KeyboardInterrupt) `work` is asked to stop at its next interrupt.check(), and
/// that exception goes on when it has. So it is in a thread other than the main one, as long as
/// Ctrl-C has Python's own handler. Call with the GIL held.
void run_interruptibly(const std::function<void(const Interrupt&)>& work);

}  // namespace trochoid::python
