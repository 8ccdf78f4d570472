#include "top_dispatch.hpp"

namespace trochoid::model {
inline namespace isa_baseline {
void run_top(const TopRun& run, TopResult& result);
}

void run_top_here(const TopRun& run, TopResult& result) {
  isa_baseline::run_top(run, result);
}

}  // namespace trochoid::model
