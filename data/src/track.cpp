#include "trochoid/data/track.hpp"

#include <fmt/format.h>

#include <cmath>

#include "track_check.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::data {
namespace {

template <class Values>
bool known_or_unknown_as_a_whole(const Values& values) {
  return values.allFinite() || values.array().isNaN().all();
}

void check_centre(const TrackSample& sample, const std::string& place) {
  if (!known_or_unknown_as_a_whole(sample.centre_m))
    throw InputError(fmt::format("{}: x_m,y_m = {},{} is not finite; leave both empty if unknown",
                                 place, sample.centre_m.x(), sample.centre_m.y()));
  if (!known_or_unknown_as_a_whole(sample.centre_px))
    throw InputError(fmt::format("{}: x_px,y_px = {},{} is not finite; leave both empty if unknown",
                                 place, sample.centre_px.x(), sample.centre_px.y()));
}

void check_covariance(const TrackSample& sample, const std::string& place) {
  const Eigen::Matrix2d& s = sample.covariance_m2;
  if (!known_or_unknown_as_a_whole(s))
    throw InputError(fmt::format(
        "{}: sxx_m2,sxy_m2,syy_m2 must be three finite numbers, or all be empty", place));
  if (!s.allFinite()) return;
  // The product is compared with room for rounding. Fully correlated and vanishing errors can be
  // read, drawn and written; only a fit has no use for them and says the same.
  constexpr double kRounding = 1e-9;
  const bool positive = s(0, 0) >= 0.0 && s(1, 1) >= 0.0 &&
                        s(0, 1) * s(0, 1) <= s(0, 0) * s(1, 1) * (1.0 + kRounding);
  if (!positive)
    throw InputError(
        fmt::format("{}: sxx_m2,sxy_m2,syy_m2 = {},{},{} is no covariance; give sxx_m2, syy_m2 > 0 "
                    "and sxy_m2^2 < sxx_m2 syy_m2, or leave all three empty",
                    place, s(0, 0), s(0, 1), s(1, 1)));
}

void check_angle(const std::optional<MeasuredAngle>& angle, const char* name,
                 const std::string& place) {
  if (!angle) return;
  if (!std::isfinite(angle->value_rad))
    throw InputError(fmt::format("{}: {}_rad = {} is not finite; leave it empty if unknown", place,
                                 name, angle->value_rad));
  if (!std::isfinite(angle->sigma_rad) || angle->sigma_rad < 0.0)
    throw InputError(fmt::format("{}: sigma_{}_rad = {} must be a finite number >= 0", place, name,
                                 angle->sigma_rad));
}

}  // namespace

void check_sample(const TrackSample& sample, const TrackSample* previous,
                  const std::string& place) {
  if (!std::isfinite(sample.t_s))
    throw InputError(fmt::format("{}: t_s = {} is not a finite time", place, sample.t_s));
  if (previous && !(sample.t_s > previous->t_s))
    throw InputError(fmt::format(
        "{}: t_s = {} does not increase (previous {}); {}", place, sample.t_s, previous->t_s,
        sample.t_s < previous->t_s ? "sort the track"
                                   : "leave one of the rows out, or write times with more digits"));
  // Two rows of one frame: two tracks in one, or a tracker that saw two bodies.
  if (previous && sample.frame >= 0 && sample.frame <= previous->frame)
    throw InputError(fmt::format(
        "{}: frame = {} does not increase (previous {}); one row for each frame and body", place,
        sample.frame, previous->frame));
  check_centre(sample, place);
  check_covariance(sample, place);
  check_angle(sample.theta, "theta", place);
  check_angle(sample.phi, "phi", place);
  check_angle(sample.psi, "psi", place);
  if (!std::isnan(sample.quality) && !(sample.quality >= 0.0 && sample.quality <= 1.0))
    throw InputError(fmt::format("{}: quality = {} must lie in 0..1", place, sample.quality));
}

void check(const Track& track, const std::string& where) {
  const TrackSample* previous = nullptr;
  for (std::size_t i = 0; i < track.samples.size(); ++i) {
    const TrackSample& sample = track.samples[i];
    const std::string frame = sample.frame >= 0 ? fmt::format(" (frame {})", sample.frame) : "";
    check_sample(sample, previous,
                 fmt::format("{}: object {} sample {}{}", where, track.object, i, frame));
    previous = &sample;
  }
}

}  // namespace trochoid::data
