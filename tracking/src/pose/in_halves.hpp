#pragma once
#include <cstddef>
#include <future>

namespace trochoid::tracking {

/// Runs work(i) for i of 0..count, every other one in a second thread. What it gives must not
/// depend on the order.
template <class Work>
void in_halves(std::size_t count, const Work& work) {
  const auto every_other = [&](std::size_t first) {
    for (std::size_t i = first; i < count; i += 2) work(i);
  };
  if (count < 2) return every_other(0);
  auto other = std::async(std::launch::async, every_other, 1);
  every_other(0);
  other.get();
}

}  // namespace trochoid::tracking
