#include "observe/angles.hpp"

#include <cmath>

#include "trochoid/data/angle.hpp"

namespace trochoid::fitting {

double continued(double angle_rad, double from_rad) {
  return from_rad + data::wrapped(angle_rad - from_rad);
}

AngleSeries angle_series(const ArcData& arc, Channel channel) {
  AngleSeries series;
  for (const Reading& reading : arc.readings) {
    if (reading.channel != channel) continue;
    const double angle = reading.value.x();
    series.t_s.push_back(arc.t_s[reading.sample]);
    series.angle_rad.push_back(
        series.angle_rad.empty() ? angle : continued(angle, series.angle_rad.back()));
  }
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
