#pragma once
#include "top_kernel.hpp"

namespace trochoid::model {

/// Instruction sets there is a copy of the kernel for.
enum class InstructionSet { baseline, avx2, avx512 };
[[nodiscard]] bool available(InstructionSet set);
/// The widest this machine has.
[[nodiscard]] InstructionSet widest();

/// By Taylor series, with the copy made for `set`, which must be available.
void run_top_on(InstructionSet set, const TopRun& run, TopResult& result);
/// The same with the widest.
void run_top_here(const TopRun& run, TopResult& result);

/// By DOP853, values only.
void run_top_dop853(const TopRun& run, TopResult& result);

/// The thesis' Euler-angle equations; drag is not in them.
void run_top_euler(const TopRun& run, TopResult& result);

}  // namespace trochoid::model
