#pragma once
#include <cstddef>
#include <functional>

namespace trochoid::data {

/// Calls work(0) ... work(count - 1), each once, from `threads` threads (0: all cores), or as many
/// as are to be had, in whatever order they come free; returns when all are done. The first
/// exception thrown by `work` ends the rest and is thrown on. Results do not depend on the number
/// of threads if work(i) writes to places of its own.
void in_parallel(std::size_t count, int threads, const std::function<void(std::size_t)>& work);

}  // namespace trochoid::data
