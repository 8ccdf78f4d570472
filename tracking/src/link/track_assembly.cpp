#include "link/track_assembly.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "link/path_scatter.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

/// Keeps an angle continuous, from within half a turn of zero on: of all angle + k period the one
/// nearest to where the last two lead.
class Unwrapper {
 public:
  explicit Unwrapper(double period) : period_(period) {}

  double operator()(double angle, double t_s) {
    if (count_ > 0) {
      const double expected = last_ + (count_ > 1 ? rate_ * (t_s - last_t_) : 0.0);
      angle += period_ * std::round((expected - angle) / period_);
      if (t_s > last_t_) rate_ = (angle - last_) / (t_s - last_t_);
    } else {
      angle -= data::kTurn * std::ceil((angle - data::kPi) / data::kTurn);
    }
    last_ = angle;
    last_t_ = t_s;
    ++count_;
    return angle;
  }

 private:
  double period_, last_ = 0.0, last_t_ = 0.0, rate_ = 0.0;
  int count_ = 0;
};

double quality_of(const Sighting& seen) {
  const double spread = seen.rms_px / (0.3 + 0.02 * seen.rim.semi_minor_px());
  constexpr double kDoubtful = 0.4;
  return std::clamp(1.2 * seen.accepted / (1.0 + 0.25 * spread * spread), 0.0,
                    seen.attitude_doubtful ? kDoubtful : 1.0);
}

/// Whether the body lies: only then does the picture of its face turn as the body spins. One that
/// tilts gets narrower, or its narrow side goes round, and it shows its wall and the lamp's shading
/// in place of marks. The narrow side of one that lies and is seen from the side turns a little on
/// its way through the picture.
bool lies(const BodyPath& path) {
  // Of a disc that slides across the picture, seen at 45 degrees, 0.16; of one that goes round at a
  // tilt of 60 degrees, 0.9.
  constexpr double kAsRound = 0.1, kTurned = 0.3;
  const auto spread = [&](const auto& value) {
    std::vector<double> values;
    for (const auto& [index, at] : path.frames) values.push_back(value(at.seen.rim));
    return data::quantile(values, 0.9) - data::quantile(values, 0.1);
  };
  // 1 - minor / major, along twice its direction.
  const auto along = [](const Ellipse& rim) {
    return (rim.shape_px(0, 0) - rim.shape_px(1, 1)) / rim.semi_major_px();
  };
  const auto across = [](const Ellipse& rim) {
    return 2.0 * rim.shape_px(0, 1) / rim.semi_major_px();
  };
  const auto roundness = [](const Ellipse& rim) {
    return rim.semi_minor_px() / rim.semi_major_px();
  };
  return spread(roundness) < kAsRound && spread(along) < kTurned && spread(across) < kTurned;
}

/// Codecs hold back what hardly changes in a picture, and with it some of what creeps.
double sigma2_px2(const PictureShift& shift) {
  constexpr double kHeldBack = 0.15;
  return std::pow(shift.sigma_px, 2) + std::pow(kHeldBack * shift.crept_px, 2);
}

/// What a picture that has gone by so much says of the attitude: a camera that has leaned sees it
/// from elsewhere, one that has gone sideways does not, and the floor does not tell which.
void allow_for_leaning(const PictureShift& shift, const data::Camera& camera,
                       PoseMeasurement& measured) {
  constexpr double kPart = 0.5, kLeastTilt_rad = 1e-3;
  if (camera.projection == data::Camera::Projection::orthographic) return;
  const double sigma_rad = kPart * shift.px.norm() / camera.fx;
  const double across = std::max(std::sin(measured.pose.theta_rad), kLeastTilt_rad);
  measured.sigma_theta_rad = std::hypot(measured.sigma_theta_rad, sigma_rad);
  measured.sigma_phi_rad = std::hypot(measured.sigma_phi_rad, sigma_rad / across);
  // Counted from the node line, spin is off by what that is.
  if (measured.sigma_psi_rad)
    measured.sigma_psi_rad =
        std::hypot(*measured.sigma_psi_rad, std::cos(measured.pose.theta_rad) * sigma_rad / across);
}

/// What is measured turns with the picture about the vertical: precession, or where the node line
/// stays, as of a body that lies, spin.
void turn_back(double turn_rad, double sigma_rad, bool flat, PoseMeasurement& measured) {
  if (!flat) {
    measured.pose.phi_rad += turn_rad;
    measured.sigma_phi_rad = std::hypot(measured.sigma_phi_rad, sigma_rad);
    return;
  }
  measured.pose.psi_rad += std::copysign(1.0, std::cos(measured.pose.theta_rad)) * turn_rad;
  if (measured.sigma_psi_rad)
    measured.sigma_psi_rad = std::hypot(*measured.sigma_psi_rad, sigma_rad);
}

/// A pose as a camera that stands still would have seen it, but for how that leans.
void take_back(const PictureShift& shift, const AssemblyOptions& options,
               PoseMeasurement& measured) {
  data::Pose<>& pose = measured.pose;
  const Eigen::Matrix2d m_per_px =
      options.camera->jacobian_px_per_m(pose.centre_m).leftCols<2>().inverse();
  const Eigen::Vector2d before_m = pose.centre_m.head<2>();
  pose.centre_m.head<2>() -= m_per_px * shift.px;
  const Eigen::Matrix2d covariance_m2 = sigma2_px2(shift) * m_per_px * m_per_px.transpose();
  measured.covariance_m2 += covariance_m2;
  if (!options.flat) allow_for_leaning(shift, *options.camera, measured);
  if (!options.pivot_m) {
    // The image's y points down, the table's up.
    const double handed = std::copysign(1.0, m_per_px.determinant());
    turn_back(-handed * std::arg(shift.factor), shift.sigma_factor, options.flat, measured);
    return;
  }
  const Eigen::Vector2d from_m = before_m - *options.pivot_m,
                        to_m = pose.centre_m.head<2>() - *options.pivot_m;
  const double turn_rad =
      std::atan2(from_m.x() * to_m.y() - from_m.y() * to_m.x(), from_m.dot(to_m));
  const double sigma_rad = std::sqrt(0.5 * covariance_m2.trace()) / to_m.norm();
  pose.phi_rad += turn_rad;
  measured.sigma_phi_rad = std::hypot(measured.sigma_phi_rad, sigma_rad);
  // Spin is counted from the node line.
  const double of_spin = std::cos(pose.theta_rad);
  pose.psi_rad -= of_spin * turn_rad;
  if (measured.sigma_psi_rad)
    measured.sigma_psi_rad = std::hypot(*measured.sigma_psi_rad, of_spin * sigma_rad);
}

/// Metres stay unknown where no floor is seen.
void metres_from_rim(data::TrackSample& sample, const Sighting& seen, const PictureShift& shift,
                     const std::optional<data::Camera>& floor) {
  if (!floor) return;
  Eigen::Vector3d p;
  try {
    p = floor->table_from_image(seen.centre_px - shift.px, 0.0);
  } catch (const NumericalError&) {  // above the horizon, or where the distortion does not hold
    return;
  }
  const Eigen::Matrix2d px_per_m = floor->jacobian_px_per_m(p).leftCols<2>();
  const Eigen::Matrix2d m_per_px = px_per_m.inverse();
  sample.centre_m = p.head<2>();
  sample.covariance_m2 = m_per_px *
                         (seen.covariance_px2 + sigma2_px2(shift) * Eigen::Matrix2d::Identity()) *
                         m_per_px.transpose();
}

/// @param mark_rad of data::turned_over.
void angles_from_pose(data::TrackSample& sample, const PoseMeasurement& pose, bool fold,
                      double mark_rad) {
  const bool over = fold && pose.pose.theta_rad > 0.5 * data::kPi;
  const data::Pose<> p = over ? data::turned_over(pose.pose, mark_rad) : pose.pose;
  if (std::isfinite(pose.sigma_theta_rad)) sample.theta = {p.theta_rad, pose.sigma_theta_rad};
  if (std::isfinite(pose.sigma_phi_rad)) sample.phi = {p.phi_rad, pose.sigma_phi_rad};
  if (pose.sigma_psi_rad) sample.psi = {p.psi_rad, *pose.sigma_psi_rad};
}

/// Seen face on, nothing tells which way the axis leans: then the turn of the face about the
/// vertical is known, precession and spin together, and neither of them alone.
bool turns_face_on(const BodyPath& path) {
  constexpr double kVague_rad = 0.1;
  std::vector<double> sigmas_rad;
  for (const auto& [index, at] : path.frames)
    if (at.seen.pose && at.seen.pose->sigma_psi_rad)
      sigmas_rad.push_back(at.seen.pose->sigma_phi_rad);
  return !sigmas_rad.empty() && data::quantile(std::move(sigmas_rad), 0.5) > kVague_rad;
}

/// @param measured as the picture gave it: the spin's error holds the precession's of that pose.
/// @param phi_rad   of a camera that stands still.
void join_turns(const PoseMeasurement& measured, double phi_rad, data::TrackSample& sample) {
  if (sample.psi) {
    const double theta = measured.pose.theta_rad;
    const double of_phi =
        std::isfinite(measured.sigma_phi_rad) ? std::cos(theta) * measured.sigma_phi_rad : 0.0;
    // A lean that is not there moves a mark on its ellipse by so much.
    const double of_lean = 0.25 * theta * theta;
    const double own2 = *measured.sigma_psi_rad * *measured.sigma_psi_rad - of_phi * of_phi;
    sample.psi = {sample.psi->value_rad + phi_rad,
                  std::hypot(std::sqrt(std::max(own2, 0.0)), of_lean)};
  }
  sample.phi.reset();
}

/// Inflation of the covariances, smoothed over neighbours in time: one frame's own says as much
/// about the frame, partly hidden maybe, as about luck.
std::vector<double> smoothed_inflations(const BodyPath& path) {
  constexpr std::size_t kReach = 10;
  constexpr double kUsualScatter = 0.7;  // of the logarithm; more is the frame's own
  std::vector<double> logs;
  for (const auto& [index, at] : path.frames)
    logs.push_back(at.seen.pose ? std::log(at.seen.pose->inflation) : 0.0);
  std::vector<double> smoothed;
  for (std::size_t i = 0; i < logs.size(); ++i) {
    const std::size_t from = i - std::min(i, kReach), to = std::min(logs.size(), i + kReach + 1);
    double sum = 0.0;
    for (std::size_t k = from; k < to; ++k) sum += logs[k];
    const double around = sum / static_cast<double>(to - from);
    smoothed.push_back(std::exp(std::max(around, logs[i] - kUsualScatter)));
  }
  return smoothed;
}

/// What one picture says of its errors, the path may contradict.
void allow_for_scatter(data::Track& track) {
  const std::vector<double> centre = unclaimed_scatter(track, Measured::centre);
  for (std::size_t i = 0; i < centre.size(); ++i) track.samples[i].covariance_m2 *= centre[i];
  for (const auto& [what, angle] : {std::pair{Measured::theta, &data::TrackSample::theta},
                                    {Measured::phi, &data::TrackSample::phi},
                                    {Measured::psi, &data::TrackSample::psi}}) {
    const std::vector<double> scatter = unclaimed_scatter(track, what);
    for (std::size_t i = 0; i < scatter.size(); ++i)
      if (auto& seen = track.samples[i].*angle) seen->sigma_rad *= std::sqrt(scatter[i]);
  }
}

/// All of a path is seen in one reading or in another: frames do not scatter by that, and what they
/// do scatter by is beside it.
void allow_for_other_readings(const BodyPath& path, data::Track& track) {
  const auto grow = [](std::optional<data::MeasuredAngle>& angle, double by_rad) {
    if (angle) angle->sigma_rad = std::hypot(angle->sigma_rad, by_rad);
  };
  auto sample = track.samples.begin();
  for (const auto& [index, at] : path.frames) {
    data::TrackSample& of_frame = *sample++;
    if (!at.seen.pose) continue;
    const PoseSpread spread = spread_over_readings(path.readings, at.seen);
    const double theta = at.seen.pose->pose.theta_rad;
    of_frame.covariance_m2 += spread.m2;
    grow(of_frame.theta, std::sqrt(spread.theta_rad2));
    constexpr double kLeastSine = 1e-6;
    const double turn = std::sqrt(spread.across_rad2) / std::max(kLeastSine, std::sin(theta));
    grow(of_frame.phi, turn);
    // What precession is wrong by, spin takes back.
    if (of_frame.phi) grow(of_frame.psi, std::cos(theta) * turn);
  }
}

}  // namespace

PictureShift shift_in(const std::map<std::int64_t, PictureShift>& shifts, std::int64_t frame) {
  constexpr double kGoes_px = 0.1;  // a frame
  if (shifts.empty()) return {};
  auto nearest = shifts.lower_bound(frame);
  if (nearest == shifts.end() ||
      (nearest != shifts.begin() && frame - std::prev(nearest)->first < nearest->first - frame))
    --nearest;
  PictureShift shift = nearest->second;
  shift.sigma_px =
      std::hypot(shift.sigma_px, kGoes_px * static_cast<double>(std::abs(frame - nearest->first)));
  return shift;
}

data::Track as_camera_at_rest_sees(data::Track track,
                                   const std::map<std::int64_t, PictureShift>& shifts) {
  for (data::TrackSample& sample : track.samples)
    sample.centre_px -= shift_in(shifts, sample.frame).at(sample.centre_px).px;
  return track;
}

double usual_radius_px(const BodyPath& path) {
  std::vector<double> sizes;
  for (const auto& [index, at] : path.frames)
    if (at.seen.accepted > 0.7) sizes.push_back(at.seen.rim.semi_major_px());
  if (sizes.empty())
    for (const auto& [index, at] : path.frames) sizes.push_back(at.seen.rim.semi_major_px());
  if (sizes.empty()) return 0.0;
  return data::upper_median(std::move(sizes));
}

data::Track assemble_track(const BodyPath& path, int object,
                           const std::optional<data::Camera>& floor,
                           const AssemblyOptions& options) {
  data::Track track{.object = object, .samples = {}};
  Unwrapper phi(data::kTurn);
  Unwrapper psi(path.marks && path.marks->two_fold() ? data::kPi : data::kTurn);
  const std::vector<double> inflations = smoothed_inflations(path);
  auto inflation = inflations.begin();
  const bool face_on = options.on_pin && turns_face_on(path);
  const bool turns_as_it_spins = path.marks && lies(path);
  for (const auto& [index, at] : path.frames) {
    const Sighting& seen = at.seen;
    data::TrackSample sample;
    sample.frame = index;
    sample.t_s = at.t_s + options.readout_s * readout_share(options.video, seen.centre_px);
    sample.centre_px = seen.centre_px;
    sample.quality = quality_of(seen);
    const double usual = *inflation++;
    const PictureShift shift = shift_in(options.shifts, index).at(seen.centre_px);
    if (seen.pose) {
      PoseMeasurement pose = *seen.pose;
      pose.inflate(usual);
      if (!options.shifts.empty() && options.camera != nullptr) take_back(shift, options, pose);
      sample.centre_m = pose.pose.centre_m.head<2>();
      sample.covariance_m2 = pose.covariance_m2;
      angles_from_pose(sample, pose, options.fold, options.mark_rad);
      if (face_on) join_turns(*seen.pose, pose.pose.phi_rad, sample);
      // Counted from the node line, spin means nothing where that is not known.
      else if (!sample.phi && !options.flat)
        sample.psi.reset();
    } else {
      metres_from_rim(sample, seen, shift, floor);
      // The image's y points down, the table's up: turning right on the screen is a negative spin.
      if (turns_as_it_spins && seen.turned_rad)
        sample.psi = {
            std::arg(shift.factor) - (path.marks->reference_angle_rad() + *seen.turned_rad),
            std::hypot(seen.turned_sigma_rad, shift.sigma_factor)};
    }
    if (sample.phi) sample.phi->value_rad = phi(sample.phi->value_rad, sample.t_s);
    if (sample.psi) sample.psi->value_rad = psi(sample.psi->value_rad, sample.t_s);
    track.samples.push_back(std::move(sample));
  }
  allow_for_scatter(track);
  allow_for_other_readings(path, track);
  return track;
}

}  // namespace trochoid::tracking
