#pragma once
#include <cstdint>

#include "problem/problem.hpp"
#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Spread of the parameters when the residuals of the solution are drawn again, in circular blocks
/// (so that their correlation in time survives), put onto the prediction and fitted: error bars
/// that assume neither Gaussian nor independent noise (Kuensch, Ann. Statist. 17, 1217, 1989).
/// @param correlation_time_s  of the residuals; blocks are six times that or the cube root of the
///                            number of samples, whichever is longer.
/// The result depends on the seed, not on the number of threads.
[[nodiscard]] data::Bootstrap bootstrap(const Problem& problem, const Solution& solution,
                                        double correlation_time_s, int draws, std::uint64_t seed,
                                        int threads);

}  // namespace trochoid::fitting
