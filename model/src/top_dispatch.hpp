#pragma once
#include "top_kernel.hpp"

namespace trochoid::model {

/// Runs the copy of the top's kernel made for the widest vectors of this machine.
void run_top_here(const TopRun& run, TopResult& result);

/// The thesis' Euler-angle equations; drag is not in them.
void run_top_euler(const TopRun& run, TopResult& result);

}  // namespace trochoid::model
