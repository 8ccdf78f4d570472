#pragma once
#include <filesystem>

namespace trochoid::tools {

/// The thesis' base case, 60 s with x and y at 6001 times, by trochoid's predictor and by others in
/// the same run: SUNDIALS' CVODE Adams, and scipy's DOP853 and Octave's ode45 where installed. All
/// are compared with the 80-bit reference. Prints the rows and whether each bar is held; writes
/// the rows as CSV.
void study_solver_bars(int repeats, const std::filesystem::path& csv);

}  // namespace trochoid::tools
