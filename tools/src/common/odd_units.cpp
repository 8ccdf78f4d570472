#include "common/odd_units.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "common/progress.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tools {
namespace {

using data::MeasuredAngle;
using data::TrackSample;

// Positions farther from the middle of the path than a laboratory is wide: most of them, if they
// are not in metres; a few, if the tracker erred.
void tell_far_positions(const std::string& path, const data::Track& track) {
  constexpr double kWide_m = 20.0, kFew = 0.2;
  std::vector<double> x_m, y_m;
  for (const TrackSample& sample : track.samples)
    if (sample.has_metres()) x_m.push_back(sample.centre_m.x()), y_m.push_back(sample.centre_m.y());
  if (x_m.empty()) return;
  const std::size_t seen = x_m.size();
  const Eigen::Vector2d middle_m(data::median(std::move(x_m)), data::median(std::move(y_m)));
  std::vector<double> far_s;
  for (const TrackSample& sample : track.samples)
    if (sample.has_metres() && (sample.centre_m - middle_m).stableNorm() > kWide_m)
      far_s.push_back(sample.t_s);
  if (far_s.empty()) return;
  const bool few = static_cast<double>(far_s.size()) <= kFew * static_cast<double>(seen);
  note(fmt::format("{}: {} of {} positions are more than {:g} m from the middle of the path{}",
                   path, far_s.size(), seen, kWide_m,
                   few ? fmt::format(", the first at t = {:.4g} s; where the tracker erred, leave "
                                     "the row out",
                                     far_s.front())
                       : "; are x_m, y_m in metres?"));
}

void tell_odd_times(const std::string& path, const data::Track& track) {
  constexpr double kSparse_s = 1.0;
  if (track.samples.size() < 2) return;
  const double step_s = (track.samples.back().t_s - track.samples.front().t_s) /
                        static_cast<double>(track.samples.size() - 1);
  if (step_s >= kSparse_s)
    note(fmt::format("{}: samples are {:.3g} s apart; is t_s in seconds?", path, step_s));
}

double usual_step_s(const data::Track& track) {
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < track.samples.size(); ++i)
    steps_s.push_back(track.samples[i].t_s - track.samples[i - 1].t_s);
  return data::median(std::move(steps_s));
}

// More than half a turn a row cannot be followed, and a full turn that is left out is one of 2 pi;
// over a gap a body may turn by any angle. A tilt beyond pi no track may hold (check_sample), and a
// body that hardly leans has a vague precession: of the spin alone a large error is odd.
void tell_odd_angle(const std::string& path, const data::Track& track, const char* name,
                    std::optional<MeasuredAngle> TrackSample::*angle) {
  constexpr double kVague_rad = 0.5, kWrapped_rad = 2.0 * data::kTurn;
  std::vector<double> steps_rad, sigmas_rad;
  double longest_rad = 0.0;
  const double gap_s = 1.5 * usual_step_s(track);
  std::optional<double> last_rad;
  double last_s = 0.0;
  for (const TrackSample& sample : track.samples) {
    if (sample.t_s - last_s > gap_s) last_rad.reset();
    last_s = sample.t_s;
    const auto& read = sample.*angle;
    if (!read) {
      last_rad.reset();
      continue;
    }
    sigmas_rad.push_back(read->sigma_rad);
    if (last_rad) steps_rad.push_back(std::abs(read->value_rad - *last_rad));
    if (last_rad) longest_rad = std::max(longest_rad, steps_rad.back());
    last_rad = read->value_rad;
  }
  if (steps_rad.empty()) return;
  const double usual_rad = data::median(std::move(steps_rad));
  const double sigma_rad = data::median(std::move(sigmas_rad));
  if (usual_rad > data::kPi || longest_rad > kWrapped_rad)
    note(
        fmt::format("{}: {}_rad changes by {:.3g} from one row to the next, at most by {:.3g}; is "
                    "it in radians?",
                    path, name, usual_rad, longest_rad));
  else if (sigma_rad > kVague_rad && angle == &TrackSample::psi)
    note(fmt::format("{}: sigma_{}_rad is {:.3g}, which tells hardly any angle; is it in radians?",
                     path, name, sigma_rad));
}

}  // namespace

void tell_odd_units(const std::string& path, const data::Track& track) {
  tell_far_positions(path, track);
  tell_odd_times(path, track);
  tell_odd_angle(path, track, "theta", &TrackSample::theta);
  tell_odd_angle(path, track, "phi", &TrackSample::phi);
  tell_odd_angle(path, track, "psi", &TrackSample::psi);
}

}  // namespace trochoid::tools
