#pragma once
#include <functional>
#include <memory>

#include "find/body_finder.hpp"

namespace trochoid::tracking {

/// Finds as `finder` does, and asks `checkpoint` before every look, which is what tracking spends
/// its time on: what that throws ends the work wherever it is.
[[nodiscard]] std::unique_ptr<BodyFinder> make_stoppable(std::unique_ptr<BodyFinder> finder,
                                                         std::function<void()> checkpoint);

}  // namespace trochoid::tracking
