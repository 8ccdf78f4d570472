#pragma once
#include <map>
#include <set>
#include <span>
#include <string>

#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"
#include "trochoid/fitting/fit.hpp"

namespace trochoid::fitting {

/// What a minimum's tangent plane says of a model with further losses, in chi-square by the noise
/// there: the score test (Rao, Proc. Camb. Phil. Soc. 44, 50, 1948). Costs a run with
/// derivatives where a fit takes dozens.
struct ScoreTest {
  struct Change {
    double chi2 = 0.0;   ///< afterwards
    int parameters = 0;  ///< more of them that are fitted, or fewer
    /// Where the tangent plane has the minimum: of the parameters that are fitted, by name.
    std::map<std::string, double> values = {};
    /// Where losses are only added: by how many of its error bars without them the parameter they
    /// move most is off, the shift and what its variance grows by together. Else 0, as where the
    /// data do not tell the parameters apart.
    double moves = 0.0;
    /// What their variances grow by, by name, in independent noise.
    std::map<std::string, double> further = {};
    /// Error bars of what is added, by name, likewise.
    std::map<std::string, double> sigmas = {};
  };
  double before = 0.0;            ///< chi-square without the further losses
  std::map<int, Change> instead;  ///< with them and without some losses, by their key
  int rows = 0;                   ///< measurements
};

/// @param options  its start holds the values at the minimum, those of one arc alone under their
/// names there ("x_m@1"), and next to nothing of the further losses.
/// @param further  names of their parameters.
/// @param others   names of the parameters of losses, further ones among them, that may be left out
/// together, by a key of their own.
/// @throws NumericalError where the model has no prediction.
[[nodiscard]] ScoreTest score_test(std::span<const data::Track> tracks, const data::Scene& scene,
                                   const FitOptions& options, const std::set<std::string>& further,
                                   const std::map<int, std::set<std::string>>& others);

/// How many times less than its change a chi-square tells, where what is left at a minimum hangs
/// together; at least 1. The square of Uncertainty::widened, which offsets of a whole record are
/// not in: nothing that is left tells of them.
/// @param options  its start holds the values at the minimum.
/// @throws NumericalError where the model has no prediction.
[[nodiscard]] double variance_inflation(std::span<const data::Track> tracks,
                                        const data::Scene& scene, const FitOptions& options);

/// doubt_as_a_whole() (second_thoughts.hpp) for a fit whose values `options.start` holds; what its
/// error bars, wider by now, leave open of the motion is not identifiable, and the verdict weak.
void doubt_as_a_whole(std::span<const data::Track> tracks, const data::Scene& scene,
                      const FitOptions& options, data::Fit& fit);

}  // namespace trochoid::fitting
