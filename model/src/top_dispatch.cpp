#include "top_dispatch.hpp"

namespace trochoid::model {
inline namespace isa_baseline {
void run_top(const TopRun& run, TopResult& result);
}
namespace isa_avx2 {
void run_top(const TopRun& run, TopResult& result);
}
namespace isa_avx512 {
void run_top(const TopRun& run, TopResult& result);
}

bool available(InstructionSet set) {
  switch (set) {
    case InstructionSet::baseline:
      return true;
    case InstructionSet::avx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    case InstructionSet::avx512:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
             __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw") &&
             available(InstructionSet::avx2);
  }
  return false;
}

InstructionSet widest() {
  static const InstructionSet set = available(InstructionSet::avx512) ? InstructionSet::avx512
                                    : available(InstructionSet::avx2) ? InstructionSet::avx2
                                                                      : InstructionSet::baseline;
  return set;
}

void run_top_on(InstructionSet set, const TopRun& run, TopResult& result) {
  switch (set) {
    case InstructionSet::baseline:
      return isa_baseline::run_top(run, result);
    case InstructionSet::avx2:
      return isa_avx2::run_top(run, result);
    case InstructionSet::avx512:
      return isa_avx512::run_top(run, result);
  }
}

void run_top_here(const TopRun& run, TopResult& result) {
  run_top_on(widest(), run, result);
}

}  // namespace trochoid::model
