#include "study/tracking_scores.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <complex>
#include <limits>
#include <map>
#include <optional>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/pose.hpp"

namespace trochoid::tools {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// Root mean square of what was added; NaN of nothing.
class Rms {
 public:
  void add(double error) { sum_ += error * error, ++count_; }
  [[nodiscard]] double square() const { return count_ > 0 ? sum_ / count_ : kUnknown; }
  [[nodiscard]] double value() const { return std::sqrt(square()); }
  [[nodiscard]] int count() const { return count_; }

 private:
  double sum_ = 0.0;
  int count_ = 0;
};

struct Attitude {
  double theta, phi, psi;
};

/// The one of two indistinguishable attitudes with the smaller tilt.
Attitude folded(Attitude a, const data::Body& body) {
  if (!body.faces_look_alike() || a.theta <= 0.5 * data::kPi) return a;
  const double mark = body.marks.empty() ? 0.0 : body.marks.front().angle_rad;
  const data::Pose<> over = data::turned_over(
      data::Pose<>{.theta_rad = a.theta, .phi_rad = a.phi, .psi_rad = a.psi}, mark);
  return {over.theta_rad, over.phi_rad, over.psi_rad};
}

double turn_difference(double a, double b) {
  return data::wrapped(a - b);
}

std::map<std::int64_t, Eigen::Index> rows_by_frame(const data::Table& table) {
  std::map<std::int64_t, Eigen::Index> rows;
  const Eigen::VectorXd frames = table.column("frame");
  for (Eigen::Index i = 0; i < frames.size(); ++i) rows[std::llround(frames[i])] = i;
  return rows;
}

class AngleErrors {
 public:
  void add(double error_rad, double sigma_rad) {
    degrees_.add(data::degrees(error_rad));
    normalised_.add(error_rad / sigma_rad);
  }
  [[nodiscard]] TruthScore::Angle score() const { return {degrees_.value(), normalised_.square()}; }

 private:
  Rms degrees_, normalised_;
};

struct AttitudeErrors {
  AngleErrors tilt, precession, spin;

  void add(const data::TrackSample& sample, const Attitude& truth, const data::Body& body) {
    if (!sample.theta || truth.theta < data::radians(15.0) || truth.theta > data::radians(75.0))
      return;
    const Attitude ours = folded({sample.theta->value_rad, sample.phi ? sample.phi->value_rad : 0.0,
                                  sample.psi ? sample.psi->value_rad : 0.0},
                                 body);
    tilt.add(ours.theta - truth.theta, sample.theta->sigma_rad);
    if (sample.phi) precession.add(turn_difference(ours.phi, truth.phi), sample.phi->sigma_rad);
    if (sample.psi) spin.add(turn_difference(ours.psi, truth.psi), sample.psi->sigma_rad);
  }
};

}  // namespace

TruthScore score_against_truth(const data::Track& track, const data::Table& truth,
                               const data::Body& body, double size_px) {
  TruthScore score;
  std::map<std::int64_t, const data::TrackSample*> samples;
  for (const auto& sample : track.samples) samples[sample.frame] = &sample;
  const auto column = [&](const char* name) { return truth.column(name); };
  const Eigen::VectorXd x_px = column("x_px"), y_px = column("y_px"), x_m = column("x_m"),
                        y_m = column("y_m"), theta = column("theta_rad"), phi = column("phi_rad"),
                        psi = column("psi_rad");
  const Eigen::VectorXd visible =
      truth.has("vis_frac") ? column("vis_frac") : Eigen::VectorXd::Ones(x_px.size()).eval();
  Rms pixels, metres, normalised;
  AttitudeErrors attitude;
  for (const auto& [frame, row] : rows_by_frame(truth)) {
    const auto found = samples.find(frame);
    const bool counts = visible[row] >= 0.5;
    score.frames += counts ? 1 : 0;
    if (found == samples.end()) {
      score.lost += counts ? 1 : 0;
      continue;
    }
    const data::TrackSample& sample = *found->second;
    const Eigen::Vector2d error_px = sample.centre_px - Eigen::Vector2d(x_px[row], y_px[row]);
    if (error_px.norm() > std::max(5.0, size_px)) {
      ++score.wrong;
      continue;
    }
    score.found += counts ? 1 : 0;
    pixels.add(error_px.norm());
    score.bias_px += error_px;
    if (error_px.norm() > score.largest_px)
      score.largest_px = error_px.norm(), score.worst_frame = frame;
    attitude.add(sample, folded({theta[row], phi[row], psi[row]}, body), body);
    if (!sample.has_metres()) continue;
    const Eigen::Vector2d error_m = sample.centre_m - Eigen::Vector2d(x_m[row], y_m[row]);
    metres.add(1e3 * error_m.norm());
    score.bias_mm += 1e3 * error_m;
    if (sample.has_covariance())
      normalised.add(std::sqrt(0.5 * error_m.dot(sample.covariance_m2.ldlt().solve(error_m))));
  }
  score.rms_px = pixels.value();
  score.rms_mm = metres.value();
  if (pixels.count() > 0) score.bias_px /= pixels.count();
  if (metres.count() > 0) score.bias_mm /= metres.count();
  score.normalised = normalised.square();
  score.tilt = attitude.tilt.score();
  score.precession = attitude.precession.score();
  score.spin = attitude.spin.score();
  return score;
}

namespace {

/// Labelled angle of a row [deg], clockwise on the screen, and its period.
struct LabelledAngle {
  std::optional<Eigen::VectorXd> values_deg;
  double period_deg = 360.0;
};

LabelledAngle labelled_angle(const data::Table& labels) {
  if (labels.has("theta_deg")) return {labels.column("theta_deg"), 360.0};
  if (labels.has("theta_mod180_deg")) return {labels.column("theta_mod180_deg"), 180.0};
  return {};
}

/// Mean and scatter of angle differences on the circle of their period.
void score_angles(LabelScore& score, const std::vector<double>& differences_deg,
                  double period_deg) {
  score.angles = static_cast<int>(differences_deg.size());
  std::complex<double> sum = 0.0;
  for (const double d : differences_deg) sum += std::polar(1.0, data::kTurn * d / period_deg);
  score.angle_offset_deg = std::arg(sum) / data::kTurn * period_deg;
  Rms scatter;
  for (const double d : differences_deg)
    scatter.add(std::remainder(d - score.angle_offset_deg, period_deg));
  score.angle_rms_deg = scatter.value();
}

LabelScore score_track(const data::Track& track, const data::Table& labels,
                       std::int64_t first_frame) {
  LabelScore score;
  score.object = track.object;
  std::map<std::int64_t, const data::TrackSample*> samples;
  for (const auto& sample : track.samples) samples[sample.frame] = &sample;
  const Eigen::VectorXd x = labels.column("x_px"), y = labels.column("y_px"),
                        uncertainty = labels.column("uncertainty_px");
  const LabelledAngle angle = labelled_angle(labels);
  std::vector<double> differences_deg;
  Eigen::Array2d squares = Eigen::Array2d::Zero();
  double largest = 0.0;
  for (const auto& [frame, row] : rows_by_frame(labels)) {
    if (frame < first_frame) continue;
    ++score.frames;
    const auto found = samples.find(frame);
    if (found == samples.end()) continue;
    ++score.found;
    const Eigen::Vector2d error_px = found->second->centre_px - Eigen::Vector2d(x[row], y[row]);
    const Eigen::Vector2d normalised = error_px / uncertainty[row];
    squares += normalised.array().square();
    score.bias_px += error_px;
    if (normalised.norm() > largest) largest = normalised.norm(), score.worst_frame = frame;
    if (!angle.values_deg || std::isnan((*angle.values_deg)[row]) || !found->second->psi) continue;
    // Our spin counts anticlockwise seen from above, the labels clockwise on the screen.
    differences_deg.push_back(-data::degrees(found->second->psi->value_rad) -
                              (*angle.values_deg)[row]);
  }
  if (score.found > 0) {
    score.rms = (squares / score.found).sqrt();
    score.bias_px /= score.found;
  }
  if (!differences_deg.empty()) score_angles(score, differences_deg, angle.period_deg);
  return score;
}

}  // namespace

LabelScore score_against_labels(const data::TrackFile& file, const data::Table& labels,
                                const std::string& name, std::int64_t first_frame) {
  LabelScore best;
  double best_value = std::numeric_limits<double>::infinity();
  for (const data::Track& track : file.tracks) {
    LabelScore score = score_track(track, labels, first_frame);
    if (score.found == 0) {
      best.frames = std::max(best.frames, score.frames);
      continue;
    }
    const double missing = score.frames - score.found;
    const double value = score.rms.squaredNorm() * score.found + 100.0 * missing;
    if (value < best_value) best_value = value, best = score;
  }
  best.label = name;
  return best;
}

double px_per_m(const data::Camera& camera) {
  return camera.jacobian_px_per_m({0.0, 0.0, 0.0}).leftCols<2>().norm() / std::sqrt(2.0);
}

}  // namespace trochoid::tools
