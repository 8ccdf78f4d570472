#include "edges/stretch_kernel.hpp"

namespace trochoid::tracking::stretch {

extern const Kernel isa_baseline;
#if defined(__x86_64__)
extern const Kernel isa_avx2;
#endif

const Kernel& kernel() {
#if defined(__x86_64__)
  static const bool wide = __builtin_cpu_supports("avx2");
  if (wide) return isa_avx2;
#endif
  return isa_baseline;
}

}  // namespace trochoid::tracking::stretch
