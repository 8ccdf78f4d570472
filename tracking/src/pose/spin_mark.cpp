#include "pose/spin_mark.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "geometry/bilinear.hpp"
#include "geometry/outline_samples.hpp"
#include "trochoid/data/angle.hpp"

namespace trochoid::tracking {
namespace {

constexpr int kFaceRings = 12, kFaceSpokes = 256;

constexpr double kFaceSpoke_rad = data::kTurn / kFaceSpokes;

// Cosine and sine of every spoke.
struct Spokes {
  std::array<float, kFaceSpokes> cosine, sine;
  Spokes() {
    for (size_t i = 0; i < kFaceSpokes; ++i) {
      const double angle = kFaceSpoke_rad * static_cast<double>(i);
      cosine[i] = static_cast<float>(std::cos(angle));
      sine[i] = static_cast<float>(std::sin(angle));
    }
  }
};
const Spokes& spokes() {
  static const Spokes table;
  return table;
}

using Face = Eigen::Matrix<float, kFaceRings, kFaceSpokes, Eigen::RowMajor>;

// Marks of the face that is seen, and the band of radii they and their surroundings take.
struct Band {
  std::vector<data::SpinMark> marks;
  bool upper = true;
  double from_m = 0.0, to_m = 0.0;

  [[nodiscard]] double radius_m(int ring) const {
    return from_m + (to_m - from_m) * (ring + 0.5) / kFaceRings;
  }
};

Band band_of(const data::Body& body, bool upper) {
  constexpr double kAround = 1.6;  // of the mark's size: its own surroundings
  Band band;
  band.upper = upper;
  band.from_m = body.radius_m;
  for (const data::SpinMark& mark : body.marks) {
    if (!(upper ? mark.on_upper_face : mark.on_lower_face)) continue;
    band.marks.push_back(mark);
    band.from_m = std::min(band.from_m, mark.distance_m - kAround * mark.size_m);
    band.to_m = std::max(band.to_m, mark.distance_m + kAround * mark.size_m);
  }
  band.from_m = std::max({band.from_m, 1.1 * body.inner_radius_m, 0.1 * body.radius_m});
  band.to_m = std::min(band.to_m, 0.93 * body.radius_m);  // the blur of the rim stays out
  return band;
}

Face unroll(const cv::Mat& luma, const Band& band, const data::Body& body,
            const data::Camera& camera, const data::Pose<>& pose) {
  const Eigen::Vector3d axis = data::symmetry_axis(pose.theta_rad, pose.phi_rad);
  const Eigen::Vector3d centre =
      pose.centre_m + (band.upper ? 1.0 : -1.0) * body.half_thickness_m() * axis;
  const Eigen::Vector3d along = node_line(pose), across = axis.cross(along);
  Face face;
  for (int i = 0; i < kFaceSpokes; ++i) {
    const auto k = static_cast<size_t>(i);
    const Eigen::Vector3d out = static_cast<double>(spokes().cosine[k]) * along +
                                static_cast<double>(spokes().sine[k]) * across;
    for (int ring = 0; ring < kFaceRings; ++ring) {
      const Eigen::Vector2d p = camera.image_from_table<double>(centre + band.radius_m(ring) * out);
      face(ring, i) = bilinear_inside<float>(luma, p.x(), p.y());
    }
  }
  return face;
}

// How much of each sample the marks cover at psi = 0, blurred by `blur_m`.
Face coverage(const Band& band, double blur_m) {
  constexpr double kFar = 5.0;  // blurs from the mark there is none of it
  Face cover = Face::Zero();
  for (const data::SpinMark& mark : band.marks)
    for (int i = 0; i < kFaceSpokes; ++i) {
      const double cosine = std::cos(kFaceSpoke_rad * i - mark.angle_rad);
      for (int ring = 0; ring < kFaceRings; ++ring) {
        const double radius = band.radius_m(ring);
        const double apart2 = radius * radius + mark.distance_m * mark.distance_m -
                              2.0 * radius * mark.distance_m * cosine;
        const double far = mark.size_m + kFar * blur_m;
        if (apart2 > far * far) continue;
        const double beyond = std::sqrt(std::max(0.0, apart2)) - mark.size_m;
        cover(ring, i) +=
            static_cast<float>(0.5 * std::erfc(beyond / (std::numbers::sqrt2 * blur_m)));
      }
    }
  return cover;
}

// Takes out what light does to a plain face: a level per ring, and a slope across the face.
void level(const Band& band, Face& face) {
  Eigen::Matrix2f normal = Eigen::Matrix2f::Zero();
  Eigen::Vector2f right = Eigen::Vector2f::Zero();
  for (int ring = 0; ring < kFaceRings; ++ring) {
    face.row(ring).array() -= face.row(ring).mean();
    const auto radius = static_cast<float>(band.radius_m(ring));
    for (int i = 0; i < kFaceSpokes; ++i) {
      const auto k = static_cast<size_t>(i);
      const Eigen::Vector2f slope(radius * spokes().cosine[k], radius * spokes().sine[k]);
      normal += slope * slope.transpose();
      right += face(ring, i) * slope;
    }
  }
  const Eigen::Vector2f slope = normal.inverse() * right;
  for (int ring = 0; ring < kFaceRings; ++ring) {
    const auto radius = static_cast<float>(band.radius_m(ring));
    for (int i = 0; i < kFaceSpokes; ++i) {
      const auto k = static_cast<size_t>(i);
      face(ring, i) -= radius * (slope[0] * spokes().cosine[k] + slope[1] * spokes().sine[k]);
    }
  }
}

// Sample areas differ from ring to ring; so do their weights.
void weigh(const Band& band, Face& face) {
  for (int ring = 0; ring < kFaceRings; ++ring)
    face.row(ring) *= static_cast<float>(std::sqrt(band.radius_m(ring) / band.to_m));
}

std::vector<float> correlations(const Face& face, const Face& marks) {
  std::vector<float> sums(kFaceSpokes, 0.0F);
  std::array<float, 2 * kFaceSpokes> twice;  // a turn and the next: no index wraps
  for (int ring = 0; ring < kFaceRings; ++ring) {
    for (size_t i = 0; i < twice.size(); ++i)
      twice[i] = face(ring, static_cast<int>(i % kFaceSpokes));
    for (size_t i = 0; i < kFaceSpokes; ++i) {
      const float m = marks(ring, static_cast<int>(i));
      for (size_t s = 0; s < kFaceSpokes; ++s) sums[s] += m * twice[i + s];
    }
  }
  return sums;
}

double turn_power(const Face& marks) {
  double power = 0.0;
  for (int ring = 0; ring < kFaceRings; ++ring)
    for (int i = 0; i < kFaceSpokes; ++i) {
      const double slope =
          (marks(ring, (i + 1) % kFaceSpokes) - marks(ring, (i + kFaceSpokes - 1) % kFaceSpokes)) /
          (2.0 * kFaceSpoke_rad);
      power += slope * slope;
    }
  return power;
}

// The largest value, and the largest one that is not on its flank.
struct Peak {
  int at = 0;
  float height = 0.0F, second = 0.0F;
};

Peak find_peak(const std::vector<float>& sums, int flank) {
  Peak peak;
  for (int s = 0; s < kFaceSpokes; ++s)
    if (const float v = std::abs(sums[static_cast<size_t>(s)]); v > peak.height)
      peak.at = s, peak.height = v;
  for (int s = 0; s < kFaceSpokes; ++s) {
    const int off = std::abs(s - peak.at);
    if (std::min(off, kFaceSpokes - off) > flank)
      peak.second = std::max(peak.second, std::abs(sums[static_cast<size_t>(s)]));
  }
  return peak;
}

// The mean over `half` spokes to either side of each: what turning while the shutter is open does
// to a row.
template <class Row>
void smear(Row&& row, int half) {
  if (half == 0) return;
  std::array<float, kFaceSpokes> mean{};
  const auto at = [&](int i) { return row[(i + kFaceSpokes) % kFaceSpokes]; };
  float sum = 0.0F;
  for (int i = -half; i <= half; ++i) sum += at(i);
  for (int i = 0; i < kFaceSpokes; ++i) {
    mean[static_cast<size_t>(i)] = sum / static_cast<float>(2 * half + 1);
    sum += at(i + half + 1) - at(i - half);
  }
  for (int i = 0; i < kFaceSpokes; ++i) row[i] = mean[static_cast<size_t>(i)];
}

// The marks as they look smeared, and how like them the face is at every angle: likeness to smeared
// marks is smeared likeness.
struct Match {
  Face marks;
  std::vector<float> sums;
  int smeared = 0;  ///< spokes to either side
  Peak peak;
  double likeness = 0.0;
};

Match match(const Face& marks, const std::vector<float>& sums, double all, int smeared, int flank) {
  Match found{marks, sums, smeared, {}, 0.0};
  for (int ring = 0; ring < kFaceRings; ++ring) smear(found.marks.row(ring), smeared);
  smear(found.sums.data(), smeared);
  found.peak = find_peak(found.sums, flank + 2 * smeared);
  found.likeness = found.peak.height / std::sqrt(std::max(found.marks.squaredNorm() * all, 1e-12));
  return found;
}

// The body turned by so much while the shutter was open as makes its marks likest; by next to
// nothing unless that is clearly less like them.
Match likeliest(const Face& marks, const std::vector<float>& sums, double all, int flank) {
  constexpr double kClearly = 1.2;
  constexpr int kLeast = 3,
                kMost = kFaceSpokes / 6;  // a third of a turn: beyond that a mark is a ring
  Match best = match(marks, sums, all, 0, flank);
  for (int smeared = kLeast; smeared <= kMost; smeared += smeared / 3) {
    Match other = match(marks, sums, all, smeared, flank);
    if (other.likeness > (best.smeared == 0 ? kClearly : 1.0) * best.likeness)
      best = std::move(other);
  }
  return best;
}

}  // namespace

std::optional<MarkReading> read_marks(const cv::Mat& luma, const data::Body& body,
                                      const data::Camera& camera, const data::Pose<>& pose) {
  constexpr double kBlurPx = 0.8, kLeastPx = 3.0;
  constexpr double kStandsOut = 1.5, kLeastLikeness = 0.5, kGrazing = 0.15;
  const Eigen::Vector3d axis = data::symmetry_axis(pose.theta_rad, pose.phi_rad);
  const double facing = axis.dot(direction_to(camera, pose.centre_m));
  const Band band = band_of(body, facing > 0.0);
  if (band.marks.empty() || !(band.to_m > band.from_m) || std::abs(facing) < kGrazing)
    return std::nullopt;
  const double px_per_m = camera.jacobian_px_per_m(pose.centre_m).norm() / std::sqrt(2.0);
  if ((band.to_m - band.from_m) * px_per_m * std::abs(facing) < kLeastPx) return std::nullopt;
  Face face = unroll(luma, band, body, camera, pose);
  Face marks = coverage(band, kBlurPx / px_per_m);
  for (Face* f : {&face, &marks}) {
    level(band, *f);
    weigh(band, *f);
  }
  double widest = 0.0;
  for (const data::SpinMark& mark : band.marks)
    widest = std::max(widest, mark.size_m / std::max(mark.distance_m, mark.size_m));
  const double all = face.squaredNorm();
  const Match best = likeliest(marks, correlations(face, marks), all,
                               static_cast<int>(2.2 * widest / kFaceSpoke_rad) + 2);
  const Peak& peak = best.peak;
  const double power = best.marks.squaredNorm();
  if (peak.height < kStandsOut * peak.second || best.likeness < kLeastLikeness) return std::nullopt;
  const auto value = [&](int s) {
    return static_cast<double>(
        std::abs(best.sums[static_cast<size_t>((s + kFaceSpokes) % kFaceSpokes)]));
  };
  const double before = value(peak.at - 1), after = value(peak.at + 1);
  const double bend = before - 2.0 * peak.height + after;
  const double fine = bend < 0.0 ? 0.5 * (before - after) / bend : 0.0;
  MarkReading reading;
  reading.psi_rad = kFaceSpoke_rad * (peak.at + fine);
  // What the marks do not explain, per sample; several samples share a pixel.
  const double contrast = peak.height / power;
  const double unlike =
      std::max(all - contrast * contrast * power, 0.0) / (kFaceRings * kFaceSpokes);
  const double area_px2 = data::kPi * (band.to_m * band.to_m - band.from_m * band.from_m) *
                          px_per_m * px_per_m * std::abs(facing);
  const double per_pixel = std::max(1.0, kFaceRings * kFaceSpokes / area_px2);
  reading.sigma_rad =
      std::sqrt((unlike + 0.1) * per_pixel / (contrast * contrast * turn_power(best.marks)));
  reading.bright = best.sums[static_cast<size_t>(peak.at)] > 0.0F;
  reading.radius_px = 0.5 * (band.from_m + band.to_m) * px_per_m;
  return reading;
}

}  // namespace trochoid::tracking
