#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace trochoid::tools {

/// One program's run of the thesis' base case.
struct SolverRow {
  std::string who;
  double tolerance, error_over_l, time_us;
};

/// A limit the solvers are held to.
struct SolverBar {
  std::string what;
  bool at_least;  ///< else at most
  double required;
  double measured;  ///< NaN: the other program is not installed

  [[nodiscard]] bool held() const;
};

/// The time `who` takes for this error, interpolated between its rows on either side (logarithms of
/// both); beyond them the nearest row's. NaN without a row.
[[nodiscard]] double time_at_error_us(const std::vector<SolverRow>& rows, const std::string& who,
                                      double error_over_l);

/// The bars, measured by `rows`, which must hold trochoid's at 1e-10 with and without derivatives.
[[nodiscard]] std::vector<SolverBar> solver_bars(const std::vector<SolverRow>& rows);

/// The thesis' base case, 60 s with x and y at 6001 times, by trochoid's predictor and by others in
/// the same run: SUNDIALS' CVODE Adams, and scipy's DOP853 and Octave's ode45 where installed. All
/// are compared with the 80-bit reference. Prints the rows and whether each bar is held; writes
/// the rows as CSV.
void study_solver_bars(int repeats, const std::filesystem::path& csv);

}  // namespace trochoid::tools
