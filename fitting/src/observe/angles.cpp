#include "observe/angles.hpp"

#include <cmath>
#include <cstddef>
#include <deque>

#include "observe/smoothing.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {

double continued(double angle_rad, double from_rad) {
  return from_rad + data::wrapped(angle_rad - from_rad);
}

std::vector<double> continued_along_rate(const std::vector<double>& t_s,
                                         const std::vector<double>& angle_rad) {
  constexpr std::size_t kLatest = 31;
  std::deque<double> rates;
  for (std::size_t i = 1; i < t_s.size() && rates.size() < kLatest; ++i)
    rates.push_back((angle_rad[i] - angle_rad[i - 1]) / (t_s[i] - t_s[i - 1]));
  std::vector<double> along = angle_rad;
  for (std::size_t i = 1; i < t_s.size(); ++i) {
    const double step_s = t_s[i] - t_s[i - 1];
    const double rate = median_or_zero({rates.begin(), rates.end()});
    along[i] = continued(angle_rad[i], along[i - 1] + rate * step_s);
    rates.push_back((along[i] - along[i - 1]) / step_s);
    rates.pop_front();
  }
  return along;
}

AngleSeries angle_series(const ArcData& arc, Channel channel) {
  AngleSeries series;
  for (const Reading& reading : arc.readings) {
    if (reading.channel != channel) continue;
    series.t_s.push_back(arc.t_s[reading.sample]);
    series.angle_rad.push_back(reading.value.x());
  }
  if (channel == Channel::psi)
    series.angle_rad = continued_along_rate(series.t_s, series.angle_rad);
  else
    for (std::size_t i = 1; i < series.angle_rad.size(); ++i)
      series.angle_rad[i] = continued(series.angle_rad[i], series.angle_rad[i - 1]);
  return series;
}

Eigen::VectorXd precessions(const Eigen::MatrixX2d& places) {
  Eigen::VectorXd out(places.rows());
  for (Eigen::Index i = 0; i < out.size(); ++i) {
    out[i] = std::atan2(places(i, 0), -places(i, 1));
    if (i > 0) out[i] = continued(out[i], out[i - 1]);
  }
  return out;
}

}  // namespace trochoid::fitting
