#pragma once
#include "top_kernel.hpp"

namespace trochoid::model {

/// By Taylor series, with the copy of the kernel made for the widest vectors of this machine.
void run_top_here(const TopRun& run, TopResult& result);

/// By DOP853, values only.
void run_top_dop853(const TopRun& run, TopResult& result);

/// The thesis' Euler-angle equations; drag is not in them.
void run_top_euler(const TopRun& run, TopResult& result);

}  // namespace trochoid::model
