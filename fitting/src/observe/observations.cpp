#include "observe/observations.hpp"

#include <fmt/core.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "observe/angles.hpp"
#include "observe/consensus.hpp"
#include "observe/direction.hpp"
#include "observe/smoothing.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::fitting {
namespace {

using model::Observable;

Observable observable_of(Channel channel) {
  switch (channel) {
    case Channel::theta:
      return Observable::theta_rad;
    case Channel::phi:
      return Observable::phi_rad;
    case Channel::psi:
      return Observable::psi_rad;
    default:
      return Observable::x_m;
  }
}

std::string words_of(const data::TrackSample& sample) {
  return fmt::format("the sample at t = {:g} s{}", sample.t_s,
                     sample.frame >= 0 ? fmt::format(" (frame {})", sample.frame) : "");
}

void add_angle(ArcData& arc, int index, Channel channel, const data::TrackSample& sample,
               const std::optional<data::MeasuredAngle>& angle, const char* name) {
  if (!angle) return;
  if (!(angle->sigma_rad > 0.0))
    throw TrackError(fmt::format(
        "sigma_{0}_rad of {1} is {2:g}: an angle without error, which no fit can weigh; give "
        "sigma_{0}_rad > 0, or leave {0}_rad and sigma_{0}_rad empty",
        name, words_of(sample), angle->sigma_rad));
  Reading reading{.sample = index, .channel = channel};
  reading.value = {angle->value_rad, 0.0};
  reading.whitener(0, 0) = 1.0 / angle->sigma_rad;
  arc.readings.push_back(reading);
}

void number_rows(ArcData& arc) {
  arc.rows = 0;
  for (Reading& reading : arc.readings) {
    reading.row = arc.rows;
    arc.rows += rows_of(reading.channel);
  }
}

// W with W W^T = inverse covariance: the inverse of the transposed Cholesky factor.
Eigen::Matrix2d whitener_of(const data::TrackSample& sample) {
  const Eigen::LLT<Eigen::Matrix2d> cholesky(sample.covariance_m2);
  if (cholesky.info() != Eigen::Success)
    throw TrackError(
        fmt::format("sxx_m2, sxy_m2, syy_m2 of {} leave a direction without error, which no fit "
                    "can weigh; give sxx_m2, syy_m2 > 0 and sxy_m2^2 < sxx_m2 syy_m2, or leave all "
                    "three empty",
                    words_of(sample)));
  const Eigen::Matrix2d lower = cholesky.matrixL();
  return lower.inverse().transpose();
}

// Farther away rounding is no longer small beside what a camera sees.
void check_place(const data::TrackSample& sample) {
  constexpr double kFarthest_m = 1e4;
  const bool along_x = std::abs(sample.centre_m.x()) > kFarthest_m;
  if (!along_x && !(std::abs(sample.centre_m.y()) > kFarthest_m)) return;
  throw TrackError(fmt::format(
      "{} lies at {} = {:g}, farther than {:g} km away; give metres, or leave the row out if the "
      "tracker erred",
      words_of(sample), along_x ? "x_m" : "y_m", sample.centre_m[along_x ? 0 : 1],
      1e-3 * kFarthest_m));
}

void set_position_noise(ArcData& arc, double sigma_m) {
  for (Reading& reading : arc.readings)
    if (reading.channel == Channel::position)
      reading.whitener = Eigen::Matrix2d::Identity() / sigma_m;
}

// From the scatter about a smooth curve of the samples one body can have visited.
void guess_position_noise(ArcData& arc) {
  arc.sigma_unknown = true;
  set_position_noise(arc, noise_about_smooth_curve(arc.t_s, arc.positions_m()));
  const ArcData kept = arc.keep(consistent_samples(arc));
  set_position_noise(arc, noise_about_smooth_curve(kept.t_s, kept.positions_m()));
}

// Where some samples state their noise the others are as noisy as those are as a rule.
// @param unstated  indices of the others' positions among the readings.
void complete_position_noise(ArcData& arc, const std::vector<std::size_t>& unstated,
                             std::vector<double> stated_m) {
  if (!unstated.empty() && stated_m.empty() && arc.t_s.size() >= 3) guess_position_noise(arc);
  if (stated_m.empty()) return;
  const double usual_m = median_or_zero(std::move(stated_m));
  for (const std::size_t i : unstated)
    arc.readings[i].whitener = Eigen::Matrix2d::Identity() / usual_m;
}

}  // namespace

int ArcData::observable_index(Observable observable) const {
  for (std::size_t i = 0; i < observables.size(); ++i)
    if (observables[i] == observable) return static_cast<int>(i);
  return -1;
}

Eigen::MatrixX2d ArcData::positions_m() const {
  Eigen::MatrixX2d positions(t_s.size(), 2);
  for (const Reading& reading : readings)
    if (reading.channel == Channel::position)
      positions.row(reading.sample) = reading.value.transpose();
  return positions;
}

ArcData ArcData::keep(const std::vector<int>& samples) const {
  ArcData part = *this;
  part.t_s.clear();
  part.row_px.clear();
  part.readings.clear();
  std::vector<int> renumbered(t_s.size(), -1);
  for (const int i : samples) {
    renumbered[i] = static_cast<int>(part.t_s.size());
    part.t_s.push_back(t_s[i]);
    part.row_px.push_back(row_px[i]);
  }
  for (Reading reading : readings) {
    reading.sample = renumbered[reading.sample];
    if (reading.sample >= 0) part.readings.push_back(reading);
  }
  for (CameraShifts& shifts : part.camera_shifts)
    shifts = CameraShifts(shifts(samples, Eigen::all));
  number_rows(part);
  return part;
}

ArcData ArcData::slice(int first, int last, int step) const {
  std::vector<int> samples;
  for (int i = first; i < last; i += step) samples.push_back(i);
  return keep(samples);
}

ArcData ArcData::without(Channel channel) const {
  ArcData part = *this;
  std::erase_if(part.readings, [&](const Reading& reading) { return reading.channel == channel; });
  std::erase(part.observables, observable_of(channel));
  number_rows(part);
  return part;
}

ArcData make_arc(const data::Track& track, int first, int last, const ChannelChoice& choice,
                 bool folded) {
  ArcData arc;
  arc.object = track.object;
  arc.folded = folded;
  if (choice.position) arc.observables = {Observable::x_m, Observable::y_m};
  std::vector<double> stated_m;
  std::vector<std::size_t> unstated;
  for (int i = first; i < last; ++i) {
    const data::TrackSample& sample = track.samples[i];
    if (choice.position && !sample.has_metres()) continue;
    const int index = static_cast<int>(arc.t_s.size());
    if (choice.position) {
      check_place(sample);
      Reading reading{.sample = index, .channel = Channel::position, .value = sample.centre_m};
      if (sample.has_covariance()) {
        reading.whitener = whitener_of(sample);
        stated_m.push_back(std::sqrt(0.5 * sample.covariance_m2.trace()));
      } else {
        unstated.push_back(arc.readings.size());
      }
      arc.readings.push_back(reading);
    }
    if (choice.theta) add_angle(arc, index, Channel::theta, sample, sample.theta, "theta");
    if (choice.phi) add_angle(arc, index, Channel::phi, sample, sample.phi, "phi");
    if (choice.psi) add_angle(arc, index, Channel::psi, sample, sample.psi, "psi");
    arc.filmed |= sample.centre_px.allFinite();
    arc.t_s.push_back(sample.t_s);
    arc.row_px.push_back(sample.centre_px.y());
  }
  for (const Channel channel : {Channel::theta, Channel::phi, Channel::psi}) {
    bool present = false;
    for (const Reading& reading : arc.readings) present |= reading.channel == channel;
    if (present) arc.observables.push_back(observable_of(channel));
  }
  number_rows(arc);
  if (!arc.t_s.empty()) arc.start_s = arc.t_s.front();
  complete_position_noise(arc, unstated, std::move(stated_m));
  return arc;
}

void share_guessed_noise(std::span<ArcData> arcs) {
  const ArcData* longest = nullptr;
  for (const ArcData& arc : arcs)
    if (arc.sigma_unknown && (longest == nullptr || arc.t_s.size() > longest->t_s.size()))
      longest = &arc;
  if (longest == nullptr) return;
  const double sigma_m = 1.0 / longest->readings.front().whitener(0, 0);
  for (ArcData& arc : arcs)
    if (arc.sigma_unknown) set_position_noise(arc, sigma_m);
}

namespace {

// Typical rate of an angle about a reading: the median over the steps near it [rad/s].
double local_rate(const ArcData& arc, const std::vector<const Reading*>& readings, int about) {
  constexpr int kSteps = 8;
  const int n = static_cast<int>(readings.size());
  std::vector<double> rates;
  for (int i = std::max(0, about - kSteps); i < std::min(n - 1, about + kSteps); ++i)
    rates.push_back(data::wrapped(readings[i + 1]->value.x() - readings[i]->value.x()) /
                    (arc.t_s[readings[i + 1]->sample] - arc.t_s[readings[i]->sample]));
  return median_or_zero(std::move(rates));
}

// How far an angle lies off the chord through two other readings, and what a curved path adds to
// that per unit of its second derivative.
struct OffChord {
  double off_rad, sag_s2;
};

OffChord off_chord(const ArcData& arc, const std::vector<const Reading*>& readings, int at,
                   int first, int second, double rate) {
  const Reading &one = *readings[first], &other = *readings[second];
  const double whole_s = arc.t_s[other.sample] - arc.t_s[one.sample];
  const double part_s = arc.t_s[readings[at]->sample] - arc.t_s[one.sample];
  const double here = readings[at]->value.x() - one.value.x();
  const double way = other.value.x() - one.value.x();
  return {
      data::wrapped(here - rate * part_s - part_s / whole_s * data::wrapped(way - rate * whole_s)),
      0.5 * part_s * (whole_s - part_s)};
}

// Chords between the neighbours on either side; near the ends, where there are not two of them,
// chords on one side as well.
std::vector<OffChord> chords_about(const ArcData& arc, const std::vector<const Reading*>& readings,
                                   int at) {
  constexpr int kFarthest = 6, kFewest = 2;
  const int n = static_cast<int>(readings.size());
  const double rate = local_rate(arc, readings, at);
  const int between = std::min({kFarthest, at, n - 1 - at});
  std::vector<OffChord> chords;
  for (int m = 1; m <= between; ++m)
    chords.push_back(off_chord(arc, readings, at, at - m, at + m, rate));
  const int inwards = 2 * at < n ? 1 : -1;
  for (int m = 1; between < kFewest && 2 * m <= kFarthest; ++m)
    chords.push_back(off_chord(arc, readings, at, at + inwards * m, at + 2 * inwards * m, rate));
  return chords;
}

// Distance of each angle of a channel from the parabola through two pairs of its neighbours, the
// lower third over such pairs: where every fifth reading is wrong, more than half of them are.
std::vector<double> neighbour_distance(const ArcData& arc,
                                       const std::vector<const Reading*>& readings) {
  std::vector<double> distance(readings.size(), 0.0);
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const std::vector<OffChord> chords = chords_about(arc, readings, static_cast<int>(i));
    std::vector<double> off;
    for (const OffChord& near : chords)
      for (const OffChord& far : chords)
        if (std::abs(far.sag_s2) > 2.0 * std::abs(near.sag_s2))
          off.push_back(std::abs((far.sag_s2 * near.off_rad - near.sag_s2 * far.off_rad) /
                                 (far.sag_s2 - near.sag_s2)));
    if (off.empty()) continue;
    const auto third = off.begin() + static_cast<std::ptrdiff_t>(off.size() / 3);
    std::nth_element(off.begin(), third, off.end());
    distance[i] = *third;
  }
  return distance;
}

// The samples whose positions no body can have visited on its way between the others.
void doubt_path(const ArcData& arc, std::vector<bool>& doubtful) {
  if (arc.observable_index(Observable::x_m) < 0) return;
  constexpr double kAnything = 1e-3;  // of a guess, so that the path itself says how noisy it is
  const double unit = (arc.sigma_unknown ? kAnything : 1.0) * std::sqrt(2.0);
  std::vector<double> sigma_m;
  for (const Reading& reading : arc.readings)
    if (reading.channel == Channel::position) sigma_m.push_back(unit / reading.whitener.norm());
  std::vector<bool> off(arc.t_s.size(), true);
  for (const int i : consistent_path(arc.t_s, arc.positions_m(), sigma_m)) off[i] = false;
  for (std::size_t i = 0; i < off.size(); ++i)
    if (off[i]) doubtful[i] = true;
}

}  // namespace

std::vector<int> consistent_samples(const ArcData& arc) {
  constexpr double kFar = 10.0;  // times the typical distance: curvature varies by a few
  const int n = static_cast<int>(arc.t_s.size());
  std::vector<bool> doubtful(n, false);
  doubt_path(arc, doubtful);
  for (const Channel channel : {Channel::theta, Channel::phi}) {
    std::vector<const Reading*> readings;
    for (const Reading& reading : arc.readings)
      if (reading.channel == channel && !doubtful[reading.sample]) readings.push_back(&reading);
    if (readings.size() < 24) continue;
    const std::vector<double> distance = neighbour_distance(arc, readings);
    const double limit = kFar * median_or_zero(distance);
    for (std::size_t i = 0; i < readings.size(); ++i)
      if (distance[i] > limit) doubtful[readings[i]->sample] = true;
  }
  std::vector<int> kept, all;
  for (int i = 0; i < n; ++i) {
    all.push_back(i);
    if (!doubtful[i]) kept.push_back(i);
  }
  return 5 * kept.size() > 3 * all.size() ? kept : all;
}

double extent_m(const ArcData& arc) {
  constexpr double kBeyondAnyMotion = 10.0;  // of what most of the samples extend over
  const auto range = [](const Eigen::MatrixX2d& xy) {
    return (xy.colwise().maxCoeff() - xy.colwise().minCoeff()).maxCoeff();
  };
  if (arc.t_s.empty() || arc.observable_index(Observable::x_m) < 0) return 0.0;
  const Eigen::MatrixX2d xy = arc.positions_m();
  double most = 0.0;
  for (const int axis : {0, 1}) {
    const std::vector<double> along(xy.col(axis).begin(), xy.col(axis).end());
    most = std::max(most, data::quantile(along, 0.9) - data::quantile(along, 0.1));
  }
  const double whole = range(xy);
  // To look for glitches is dear, and most tracks have none so far away.
  if (whole <= kBeyondAnyMotion * most) return whole;
  return range(xy(consistent_samples(arc), Eigen::all));
}

double excess_scatter(const ArcData& arc, Channel channel) {
  std::vector<double> t_s, values, sigmas;
  const bool planar = channel == Channel::position;
  for (const Reading& reading : arc.readings) {
    if (reading.channel != channel) continue;
    double value = reading.value.x();
    if (!planar && !values.empty()) value = continued(value, values.back());
    t_s.push_back(arc.t_s[reading.sample]);
    values.push_back(value);
    sigmas.push_back((planar ? std::sqrt(2.0) : 1.0) / reading.whitener.norm());
    if (!planar) sigmas.back() = 1.0 / reading.whitener(0, 0);
  }
  if (values.size() < 9) return 1.0;
  Eigen::MatrixXd curve =
      Eigen::Map<Eigen::VectorXd>(values.data(), static_cast<int>(values.size()));
  if (planar) curve = arc.positions_m();
  const double noise = std::min(noise_about_smooth_curve(t_s, curve), white_noise(t_s, curve));
  const double most =
      std::ssize(values) < kFewestForNoise ? kMisjudged : std::numeric_limits<double>::infinity();
  return std::clamp(noise / median_or_zero(std::move(sigmas)), 1.0, most);
}

bool shows_direction(const ArcData& arc, std::size_t i) {
  return !arc.angles_apart && arc.readings[i].channel == Channel::theta &&
         i + 1 < arc.readings.size() && arc.readings[i + 1].channel == Channel::phi &&
         arc.readings[i + 1].sample == arc.readings[i].sample;
}

Eigen::Vector2d weights_of_direction(const Reading& tilt, const Reading& precession) {
  const double sine =
      std::max(std::sin(tilt.value.x()), std::sin(std::min(1.0, 1.0 / tilt.whitener(0, 0))));
  return {tilt.whitener(0, 0), precession.whitener(0, 0) / sine};
}

void whiten(const ArcData& arc, const Eigen::VectorXd& values, const Eigen::MatrixXd& jacobian,
            Eigen::VectorXd& out, Eigen::MatrixXd* out_jacobian) {
  const int width = static_cast<int>(arc.observables.size());
  std::array<int, kChannels> column{};
  for (int c = 0; c < kChannels; ++c)
    column[c] = arc.observable_index(observable_of(static_cast<Channel>(c)));
  out.resize(arc.rows);
  if (out_jacobian != nullptr) out_jacobian->resize(arc.rows, jacobian.cols());
  bool other_face = false;  // of the sample at hand
  for (std::size_t i = 0; i < arc.readings.size(); ++i) {
    const Reading& reading = arc.readings[i];
    const int first = reading.sample * width;
    const int source = first + column[static_cast<int>(reading.channel)];
    if (reading.channel == Channel::position) {
      const Eigen::Matrix2d wt = reading.whitener.transpose();
      out.segment<2>(reading.row) = wt * (values.segment<2>(source) - reading.value);
      if (out_jacobian != nullptr)
        out_jacobian->middleRows<2>(reading.row).noalias() = wt * jacobian.middleRows<2>(source);
      continue;
    }
    if (i == 0 || arc.readings[i - 1].sample != reading.sample ||
        arc.readings[i - 1].channel == Channel::position) {
      const int theta = column[static_cast<int>(Channel::theta)];
      other_face = arc.folded && theta >= 0 && values[first + theta] > 0.5 * data::kPi;
    }
    if (shows_direction(arc, i)) {
      const Reading& turned = arc.readings[++i];
      const int phi = first + column[static_cast<int>(Channel::phi)];
      const Departure off = departure({reading.value.x(), turned.value.x()},
                                      {values[source], values[phi]}, arc.folded);
      other_face = off.other_face;
      const Eigen::Vector2d weight = weights_of_direction(reading, turned);
      out[reading.row] = weight[0] * off.way[0];
      out[turned.row] = weight[1] * off.way[1];
      if (out_jacobian != nullptr) {
        const Eigen::Matrix2d slope = weight.asDiagonal() * off.slope;
        for (int k = 0; k < 2; ++k)
          out_jacobian->row(k == 0 ? reading.row : turned.row) =
              slope(k, 0) * jacobian.row(source) + slope(k, 1) * jacobian.row(phi);
      }
      continue;
    }
    double predicted = values[source];
    double sign = 1.0;
    // Equal faces: (theta, phi, psi) and (pi - theta, phi + pi, pi - psi) are the same picture,
    // with marks alike on both.
    if (other_face) {
      const bool turns = reading.channel == Channel::phi;
      predicted = turns ? predicted + data::kPi : data::kPi - predicted;
      sign = turns ? 1.0 : -1.0;
    }
    const double weight = sign * reading.whitener(0, 0);
    out[reading.row] = reading.whitener(0, 0) * data::wrapped(predicted - reading.value.x());
    if (out_jacobian != nullptr) out_jacobian->row(reading.row) = weight * jacobian.row(source);
  }
}

}  // namespace trochoid::fitting
