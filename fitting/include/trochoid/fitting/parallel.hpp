#pragma once
#include <functional>

namespace trochoid::fitting {

/// Calls work(0) ... work(count - 1), each once, from `threads` threads (0: all cores) in whatever
/// order they come free; returns when all are done. The first exception thrown by `work` ends the
/// rest and is thrown on. Results do not depend on the number of threads if work(i) writes to
/// places of its own.
void in_parallel(int count, int threads, const std::function<void(int)>& work);

}  // namespace trochoid::fitting
