#include "trochoid/tracking/smooth.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "find/usual_frames.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/quantile.hpp"
#include "trochoid/data/white_jerk.hpp"

namespace trochoid::tracking {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
using State = Eigen::Vector3d;  // value, rate, acceleration
using Square = Eigen::Matrix3d;

/// A series in units of the median step in time and of the median sigma.
struct Series {
  std::vector<double> t, value, variance;
};

struct Moment {
  State predicted, filtered;
  Square predicted_cov, filtered_cov;
};

/// Kalman filter; returns the likelihood that matters for the choice of q.
struct Filtered {
  std::vector<Moment> moments;
  double log_determinant = 0.0, square = 0.0;
  int counted = 0;

  /// @param free_scale the sigmas are right up to a common factor, which is projected out.
  [[nodiscard]] double cost(bool free_scale) const {
    if (!free_scale) return log_determinant + square;
    return log_determinant + counted * std::log(std::max(square / counted, 1e-30));
  }
};

Filtered filter(const Series& s, double q) {
  constexpr double kVague = 1e6;
  constexpr int kLearning = 3;  // innovations that only find out where it is
  Filtered out;
  State x = State::Zero();
  for (const double v : s.value)
    if (!std::isnan(v)) {
      x[0] = v;
      break;
    }
  Square P = kVague * Square::Identity();
  int seen = 0;
  for (std::size_t i = 0; i < s.t.size(); ++i) {
    Moment m;
    if (i > 0) {
      const double dt = s.t[i] - s.t[i - 1];
      const Square F = data::white_jerk_transition(dt);
      x = F * x;
      P = F * P * F.transpose() + q * data::white_jerk_covariance(dt);
    }
    m.predicted = x;
    m.predicted_cov = P;
    if (!std::isnan(s.value[i])) {
      const double S = P(0, 0) + s.variance[i], innovation = s.value[i] - x[0];
      const State gain = P.col(0) / S;
      x += gain * innovation;
      Square keep = Square::Identity();
      keep.col(0) -= gain;
      P = keep * P * keep.transpose() + s.variance[i] * gain * gain.transpose();
      if (++seen > kLearning) {
        out.log_determinant += std::log(S);
        out.square += innovation * innovation / S;
        ++out.counted;
      }
    }
    m.filtered = x;
    m.filtered_cov = P;
    out.moments.push_back(m);
  }
  return out;
}

double likeliest_density(const Series& s, bool free_scale) {
  constexpr double kLeast = -10.0, kMost = 4.0, kStep = 0.25;  // decades
  double best = 1.0, least = std::numeric_limits<double>::infinity();
  for (double decade = kLeast; decade <= kMost; decade += kStep) {
    const double q = std::pow(10.0, decade), cost = filter(s, q).cost(free_scale);
    if (cost < least) least = cost, best = q;
  }
  return best;
}

}  // namespace

std::vector<SmoothState> smooth(const std::vector<double>& t_s, const std::vector<double>& value,
                                const std::vector<double>& sigma) {
  std::vector<double> sigmas;
  for (std::size_t i = 0; i < sigma.size(); ++i)
    if (!std::isnan(value[i]) && !std::isnan(sigma[i])) sigmas.push_back(sigma[i]);
  const double usual_sigma = data::median(sigmas);  // NaN without any
  const bool free_scale = !(usual_sigma > 0.0);
  const double step_s = data::usual_step_s(t_s), unit = free_scale ? 1.0 : usual_sigma;
  Series s;
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    s.t.push_back(t_s[i] / step_s);
    s.value.push_back(value[i] / unit);
    s.variance.push_back(free_scale ? 1.0 : sigma[i] * sigma[i] / (unit * unit));
  }
  const Filtered f = filter(s, likeliest_density(s, free_scale));
  const double scale = free_scale ? std::sqrt(f.square / std::max(1, f.counted)) : 1.0;
  std::vector<SmoothState> result(t_s.size());
  State x = State::Zero();
  Square P = Square::Zero();
  for (std::size_t i = t_s.size(); i-- > 0;) {
    const Moment& m = f.moments[i];
    if (i + 1 == t_s.size()) {
      x = m.filtered;
      P = m.filtered_cov;
    } else {
      const Moment& next = f.moments[i + 1];
      const Square F = data::white_jerk_transition(s.t[i + 1] - s.t[i]);
      const Square back = next.predicted_cov.ldlt().solve(F * m.filtered_cov).transpose();
      x = m.filtered + back * (x - next.predicted);
      P = m.filtered_cov + back * (P - next.predicted_cov) * back.transpose();
    }
    result[i] = {.value = x[0] * unit,
                 .sigma = scale * std::sqrt(std::max(0.0, P(0, 0))) * unit,
                 .rate = x[1] * unit / step_s};
  }
  return result;
}

namespace {

constexpr std::int64_t kFewestSamples = 6;  // samples that tell how a body moves

/// Consecutive frames of one body, measured or interpolated.
struct Stretch {
  std::vector<std::int64_t> frame;
  std::vector<double> t_s;
  std::vector<const data::TrackSample*> sample;  ///< null: interpolated
};

std::vector<Stretch> stretches_of(const data::Track& track) {
  constexpr double kLongestGap = 30.0;  // usual frames: the motion across it is a guess
  std::vector<Stretch> all(1);
  for (const auto& sample : track.samples) {
    if (!all.back().frame.empty()) {
      const auto& last = *all.back().sample.back();
      const std::int64_t gap = sample.frame - last.frame;
      const auto frames = static_cast<double>(gap);
      if (frames * usual_frames((sample.t_s - last.t_s) / frames) > kLongestGap) {
        all.emplace_back();
      } else {
        for (std::int64_t k = 1; k < gap; ++k) {
          all.back().frame.push_back(last.frame + k);
          all.back().t_s.push_back(last.t_s +
                                   (sample.t_s - last.t_s) * static_cast<double>(k) / frames);
          all.back().sample.push_back(nullptr);
        }
      }
    }
    all.back().frame.push_back(sample.frame);
    all.back().t_s.push_back(sample.t_s);
    all.back().sample.push_back(&sample);
  }
  return all;
}

/// Samples of a stretch.
std::int64_t measured(const Stretch& stretch) {
  return std::count_if(stretch.sample.begin(), stretch.sample.end(),
                       [](const auto* sample) { return sample != nullptr; });
}

std::vector<SmoothState> smoothed(const Stretch& stretch, int axis, bool metres) {
  std::vector<double> value, sigma;
  for (const auto* sample : stretch.sample) {
    value.push_back(sample == nullptr ? kUnknown
                                      : (metres ? sample->centre_m : sample->centre_px)[axis]);
    sigma.push_back(sample == nullptr || !metres ? kUnknown
                                                 : std::sqrt(sample->covariance_m2(axis, axis)));
  }
  return smooth(stretch.t_s, value, sigma);
}

}  // namespace

SmoothTrack smooth_track(const data::TrackFile& file) {
  SmoothTrack result;
  data::Table& table = result.table;
  table.columns = {"frame",  "t_s",  "x_m",  "y_m",        "sigma_x_m",  "sigma_y_m",    "vx_m_s",
                   "vy_m_s", "x_px", "y_px", "sigma_x_px", "sigma_y_px", "interpolated", "object"};
  table.header = {{"smoothed", "Rauch-Tung-Striebel; never a measurement: fit the track itself"}};
  std::vector<double> cells;
  for (const data::Track& track : file.tracks) {
    if (std::any_of(track.samples.begin(), track.samples.end(),
                    [](auto& s) { return s.frame < 0; }))
      throw TrackError("to be smoothed, a track needs the number of each sample's frame");
    for (const Stretch& stretch : stretches_of(track)) {
      if (measured(stretch) < kFewestSamples) {
        result.left_out += measured(stretch);
        continue;
      }
      const bool metres = std::all_of(stretch.sample.begin(), stretch.sample.end(), [](auto* s) {
        return s == nullptr || (s->has_metres() && s->has_covariance());
      });
      const bool pixels = std::all_of(stretch.sample.begin(), stretch.sample.end(), [](auto* s) {
        return s == nullptr || s->centre_px.allFinite();
      });
      std::vector<SmoothState> mx(stretch.t_s.size(), {kUnknown, kUnknown, kUnknown});
      auto my = mx, px = mx, py = mx;
      if (pixels) px = smoothed(stretch, 0, false), py = smoothed(stretch, 1, false);
      if (metres) mx = smoothed(stretch, 0, true), my = smoothed(stretch, 1, true);
      for (std::size_t i = 0; i < px.size(); ++i) {
        const bool interpolated = stretch.sample[i] == nullptr;
        result.interpolated += interpolated ? 1 : 0;
        cells.insert(cells.end(), {static_cast<double>(stretch.frame[i]), stretch.t_s[i],
                                   mx[i].value, my[i].value, mx[i].sigma, my[i].sigma, mx[i].rate,
                                   my[i].rate, px[i].value, py[i].value, px[i].sigma, py[i].sigma,
                                   interpolated ? 1.0 : 0.0, static_cast<double>(track.object)});
      }
    }
  }
  table.set_rows(cells);
  return result;
}

}  // namespace trochoid::tracking
