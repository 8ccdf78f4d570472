#include "trochoid/data/parallel.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace trochoid::data {

void in_parallel(std::size_t count, int threads, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex mutex;
  const auto worker = [&] {
    for (std::size_t i = next++; i < count; i = next++) {
      try {
        work(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
        next = count;
      }
    }
  };
  const std::size_t most =
      threads > 0 ? static_cast<std::size_t>(threads) : std::thread::hardware_concurrency();
  const std::size_t used = std::min(std::max<std::size_t>(most, 1), count);
  std::vector<std::thread> team;
  team.reserve(used);
  try {
    for (std::size_t i = 1; i < used; ++i) team.emplace_back(worker);
  } catch (const std::exception&) {  // no more threads to be had: those there are do the work
  }
  worker();
  for (std::thread& member : team) member.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace trochoid::data
