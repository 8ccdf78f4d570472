#include <algorithm>
#include <cmath>
#include <limits>

#include "common/constants.hpp"
#include "report/parts.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tools {
namespace {

void count_gaps(const data::Track& track, ReportFacts& facts) {
  for (std::size_t i = 1; i < track.samples.size(); ++i) {
    const std::int64_t step = track.samples[i].frame - track.samples[i - 1].frame;
    if (track.samples[i - 1].frame < 0 || step <= 1) continue;
    ++facts.gaps;
    facts.missing += static_cast<int>(step - 1);
  }
}

// So far from an accepted fit that it was given up.
bool lies_far_off(const Residual& residual, const ReportFacts& facts) {
  constexpr double kGivenUp = 11.0;  // sigmas: a fit gives it a tenth of its weight
  const Eigen::Vector2d off = residual.value_m.cwiseQuotient(residual.sigma_m);
  return facts.input.fit->converged && off.norm() > kGivenUp;
}

void measure_residuals(ReportFacts& facts) {
  double sum_m2 = 0.0, sum_sigma2 = 0.0;
  int count = 0, with_sigma = 0;
  for (const auto& list : facts.residuals)
    for (const Residual& residual : list) {
      ++facts.compared;
      if (lies_far_off(residual, facts)) {
        ++facts.far_off;
        continue;
      }
      for (int axis = 0; axis < 2; ++axis) {
        sum_m2 += std::pow(residual.value_m[axis], 2);
        ++count;
        const double sigma_m = residual.sigma_m[axis] / residual.noise_scale;
        if (!(sigma_m > 0.0)) continue;
        sum_sigma2 += std::pow(residual.value_m[axis] / sigma_m, 2);
        ++with_sigma;
      }
    }
  facts.rms_axis_m = count > 0 ? std::sqrt(sum_m2 / count) : kNaN;
  facts.rms_axis_sigma = with_sigma > 0 ? std::sqrt(sum_sigma2 / with_sigma) : kNaN;
}

double rms_spin_rad(const data::TrackFile& tracks, const PredictedPath& path) {
  double sum = 0.0;
  int count = 0;
  for (const data::Track& track : tracks.tracks)
    for (const data::TrackSample& sample : track.samples)
      if (const auto residual = spin_residual_rad(sample, track.object, path)) {
        sum += *residual * *residual;
        ++count;
      }
  return count > 0 ? std::sqrt(sum / count) : kNaN;
}

}  // namespace

bool has_metres(const data::TrackFile& file) {
  for (const data::Track& track : file.tracks)
    for (const data::TrackSample& sample : track.samples)
      if (sample.has_metres()) return true;
  return false;
}

ReportFacts gather(const ReportInput& input) {
  ReportFacts facts{.input = input, .prediction = {}, .residuals = {}};
  facts.first_s = std::numeric_limits<double>::infinity();
  facts.last_s = -facts.first_s;
  facts.metres = has_metres(input.tracks);
  std::vector<double> sigmas_m;
  for (const data::Track& track : input.tracks.tracks) {
    count_gaps(track, facts);
    for (const data::TrackSample& sample : track.samples) {
      facts.first_s = std::min(facts.first_s, sample.t_s);
      facts.last_s = std::max(facts.last_s, sample.t_s);
      if (sample.has_covariance())
        for (int axis = 0; axis < 2; ++axis)
          sigmas_m.push_back(std::sqrt(sample.covariance_m2(axis, axis)));
      ++facts.samples;
      if (sample.doubtful()) ++facts.doubtful;
    }
  }
  facts.median_sigma_m = data::median(std::move(sigmas_m));
  if (input.fit && !input.fit->parameters.empty()) {
    facts.prediction = replay(*input.fit, input.tracks, input.fit_track);
    facts.residuals = residuals(input.tracks, facts.prediction);
    measure_residuals(facts);
    facts.rms_spin_rad = rms_spin_rad(input.tracks, facts.prediction);
  }
  return facts;
}

}  // namespace trochoid::tools
