#pragma once
#include "trochoid/model/isa.hpp"

/// Arithmetic on numbers with derivatives in AVX2's registers where the machine has them, chosen at
/// run time where it is done: one Dual<8> is two of them, or four of the baseline's.
namespace trochoid::model {
inline namespace TROCHOID_ISA {

#if defined(__x86_64__)
// What `work` calls has to be TROCHOID_INLINE: only code inlined here is compiled for the wider
// set. Every `work` is a type of its own; files that share one, from a template in a header, need
// the same flags for floating point.
template <class Work>
__attribute__((target("avx2,fma"))) void in_avx2(const Work& work) {
  work();
}
#endif

/// Calls work(), a TROCHOID_LAMBDA_INLINE lambda, compiled for wide vectors where S has
/// derivatives. The results differ between machines by rounding,
/// unless fused products are off (-ffp-contract=off).
template <class S, class Work>
TROCHOID_INLINE void widely(const Work& work) {
#if defined(__x86_64__)
  if constexpr (requires { S::kLanes; })
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return in_avx2(work);
#endif
  work();
}

}  // namespace TROCHOID_ISA
}  // namespace trochoid::model
