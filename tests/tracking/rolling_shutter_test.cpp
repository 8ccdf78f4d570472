#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "drawn_clip.hpp"
#include "link/rolling_shutter.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/pose_motion.hpp"
#include "trochoid/tracking/tracker.hpp"

// Recordings whose rows are read one after the other.
namespace trochoid::tracking {
namespace {

constexpr double kPicturesPerS = 100.0, kReadInTurn_s = 0.009, kDisc_m = 0.02;
constexpr int kRowLength_px = 320, kRowsInTurn = 140, kPicturesInTurn = 36;

/// A thin disc that goes its way over the floor while its tilt turns about the vertical.
struct Going {
  double turning_rad_s = 9.0, spin_rad_s = 0.0;
  bool marked = false;

  [[nodiscard]] data::Pose<> at(double t_s) const {
    data::Pose<> pose;
    pose.theta_rad = 0.8;
    pose.phi_rad = 0.3 + turning_rad_s * t_s;
    pose.psi_rad = 0.5 + spin_rad_s * t_s;
    pose.centre_m = {-0.045 + 0.25 * t_s, 0.003 - 0.02 * t_s, kDisc_m * std::sin(pose.theta_rad)};
    return pose;
  }
};

constexpr double kMarkOut = 0.55, kMarkRadius = 0.22;  // over the disc's radius

/// From the middle of the disc to where a pixel's ray meets its plane, over its radius: along the
/// node line, and up.
Eigen::Vector2d on_face(const data::Camera& camera, const data::Pose<>& pose,
                        const Eigen::Vector2d& pixel) {
  const Eigen::Vector3d floor = camera.table_from_image(pixel, 0.0),
                        above = camera.table_from_image(pixel, kDisc_m), axis = data::axis_of(pose);
  const double share = axis.dot(pose.centre_m - floor) / axis.dot(above - floor);
  const Eigen::Vector3d arm = (floor + share * (above - floor) - pose.centre_m) / kDisc_m;
  return {arm.dot(data::node_line(pose)), arm.dot(data::ascent(pose))};
}

/// How much of a pixel a round spot on the disc covers, blurred by 0.7 px.
double cover_of(const data::Camera& camera, const data::Pose<>& pose, const Eigen::Vector2d& pixel,
                const Eigen::Vector2d& middle, double radius) {
  constexpr double kBlur_px = 0.7, kStep_px = 0.01, kFar = 0.4;
  const auto out_at = [&](double dx, double dy) {
    return (on_face(camera, pose, pixel + Eigen::Vector2d(dx, dy)) - middle).norm() - radius;
  };
  const double out = out_at(0.0, 0.0);
  if (out > kFar) return 0.0;
  const double slope =
      std::hypot(out_at(kStep_px, 0.0) - out, out_at(0.0, kStep_px) - out) / kStep_px;
  return 0.5 * std::erfc(out / std::max(slope, 1e-6) / (kBlur_px * std::numbers::sqrt2));
}

/// Each row as the disc is when that is read.
void draw_read_in_turn(const data::Camera& camera, const Going& going, cv::Mat& picture,
                       int frame) {
  constexpr double kLevel = 50.0, kMarkLevel = 220.0;
  for (int y = 0; y < picture.rows; ++y) {
    const data::Pose<> pose =
        going.at(frame / kPicturesPerS + kReadInTurn_s * y / (picture.rows - 1.0));
    const Eigen::Vector2d mark =
        kMarkOut * Eigen::Vector2d(std::cos(pose.psi_rad), std::sin(pose.psi_rad));
    for (int x = 0; x < picture.cols; ++x) {
      const double disc = cover_of(camera, pose, {x, y}, {0.0, 0.0}, 1.0);
      if (disc == 0.0) continue;
      const double marked = going.marked ? cover_of(camera, pose, {x, y}, mark, kMarkRadius) : 0.0;
      const double level = kLevel + marked * (kMarkLevel - kLevel);
      picture.at<double>(y, x) += disc * (level - picture.at<double>(y, x));
    }
  }
}

struct OffInTurn {
  double centre_m = 0.0, tilt_rad = 0.0, precession_rad = 0.0, spin_rad = 0.0;  // rms
};

OffInTurn off_of(const data::Track& track, const Going& going) {
  OffInTurn sum;
  int told = 0;
  for (const data::TrackSample& sample : track.samples) {
    if (!sample.phi) continue;
    ++told;
    const data::Pose<> pose = going.at(sample.t_s);
    sum.centre_m += (sample.centre_m - pose.centre_m.head<2>()).squaredNorm();
    sum.tilt_rad += std::pow(sample.theta->value_rad - pose.theta_rad, 2);
    sum.precession_rad += std::pow(data::wrapped(sample.phi->value_rad - pose.phi_rad), 2);
    if (going.marked && sample.psi)
      sum.spin_rad += std::pow(data::wrapped(sample.psi->value_rad - pose.psi_rad), 2);
  }
  EXPECT_GT(told, 0.85 * kPicturesInTurn);
  return {std::sqrt(sum.centre_m / told), std::sqrt(sum.tilt_rad / told),
          std::sqrt(sum.precession_rad / told), std::sqrt(sum.spin_rad / told)};
}

/// A recording of it, and what its track is off by.
class ReadInTurn {
 public:
  explicit ReadInTurn(const Going& going) : folder_("rolling"), going_(going) {
    write_clip(folder_ / "clip.mkv", drawn_floor(kRowLength_px, kRowsInTurn, 190.0),
               kPicturesInTurn, 1.0,
               [&](cv::Mat& picture, int i) { draw_read_in_turn(camera_, going_, picture, i); });
    scene_.body.emplace();
    scene_.body->radius_m = kDisc_m;
    scene_.body->thickness_m = 1e-5;
    if (going.marked)
      scene_.body->marks.push_back(
          {.distance_m = kMarkOut * kDisc_m, .size_m = kMarkRadius * kDisc_m});
  }

  [[nodiscard]] OffInTurn off(bool known) const {
    data::Camera camera = camera_;
    if (known) camera.readout_s = kReadInTurn_s;  // the scene says nothing
    return off_of(track_video(folder_ / "clip.mkv", scene_, camera).file.tracks.at(0), going_);
  }

 private:
  ScratchFolder folder_;
  Going going_;
  data::Camera camera_ = data::Camera::overhead(kRowLength_px, kRowsInTurn, 2000.0, 0.2);
  data::Scene scene_;
};

TEST(RollingShutter, LeavesCentreTiltAndPrecessionThoseOfTheMomentATrackTells) {
  const ReadInTurn recording({});
  const OffInTurn at_once = recording.off(false), in_turn = recording.off(true);
  EXPECT_LT(in_turn.centre_m, 3e-5);
  EXPECT_LT(in_turn.tilt_rad, 0.002);
  EXPECT_LT(in_turn.precession_rad, 0.003);
  EXPECT_GT(at_once.tilt_rad, 0.02);
  EXPECT_GT(at_once.precession_rad, 0.04);
}

// Between two pictures the tilt's direction turns by 0.3 rad: half of that, by which the way from
// one to the other leads elsewhere than the body goes, is told from the motion itself.
TEST(RollingShutter, GoesTheWayABodyGoesWhereThatTurnsFromPictureToPicture) {
  const OffInTurn off = ReadInTurn({.turning_rad_s = 30.0}).off(true);
  EXPECT_LT(off.centre_m, 4e-5);
  EXPECT_LT(off.tilt_rad, 0.004);
  EXPECT_LT(off.precession_rad, 0.006);
}

// By the time the row of its mark is read, a disc is elsewhere and leans another way: the mark is
// not where its spin alone would have taken it.
TEST(RollingShutter, ReadsAMarkWhereTheWholeMotionTakesIt) {
  const OffInTurn off = ReadInTurn({.spin_rad_s = 20.0, .marked = true}).off(true);
  EXPECT_LT(off.spin_rad, 0.006);
}

// Between the row of its centre and that of its mark a puck goes on, which turns the line from one
// to the other as its spin does: here by up to 0.1 rad.
TEST(RollingShutter, LeavesSpinThatOfTheMomentATrackTells) {
  constexpr double kGoes_m_s = 0.8, kSpin_rad_s = 10.0, kMark_m = 0.015;
  constexpr int kPictures = 20;
  data::Body body;
  body.radius_m = kDisc_m;
  body.thickness_m = 1e-5;
  body.marks = {{.distance_m = kMark_m, .size_m = 0.002}};
  const data::Support flat{data::SupportKind::flat, {}};
  const data::Camera camera = data::Camera::from_scale(kRowLength_px, kRowsInTurn, 2000.0);
  const int motions = data::PoseMotion(body, flat, camera).count();
  RollingShutter shutter{.readout_s = kReadInTurn_s, .video = {}, .camera = camera};
  shutter.video.width_px = kRowLength_px;
  shutter.video.height_px = kRowsInTurn;
  const auto centre_m = [&](double t_s) {
    return Eigen::Vector3d(kGoes_m_s * (t_s - 0.1), 0.0, body.half_thickness_m());
  };
  const auto mark_m = [&](double t_s) {
    const double psi_rad = kSpin_rad_s * t_s;
    return Eigen::Vector3d(centre_m(t_s) +
                           kMark_m * Eigen::Vector3d(std::cos(psi_rad), std::sin(psi_rad), 0.0));
  };
  const auto read_s = [&](const Eigen::Vector3d& at_m) {
    return kReadInTurn_s * readout_share(shutter.video, camera.image_from_table<double>(at_m));
  };
  BodyPath path;
  std::vector<double> spins_rad;
  for (int i = 0; i < kPictures; ++i) {
    const double first_row_s = i / kPicturesPerS, here_s = first_row_s + read_s(centre_m(0.0));
    double of_mark_s = here_s;
    for (int round = 0; round < 20; ++round) of_mark_s = first_row_s + read_s(mark_m(of_mark_s));
    const Eigen::Vector3d out = mark_m(of_mark_s) - centre_m(here_s);
    PoseMeasurement seen;
    seen.pose.centre_m = centre_m(here_s);
    seen.pose.psi_rad = std::atan2(out.y(), out.x());
    seen.sigma_psi_rad = 0.01;
    seen.rows_in_turn = true;
    for (auto& sheared : seen.sheared) sheared.setZero(motions, motions);
    BodyPath::At& at = path.frames[i];
    at.t_s = first_row_s;
    at.seen.centre_px = camera.image_from_table<double>(seen.pose.centre_m);
    at.seen.pose = seen;
    spins_rad.push_back(kSpin_rad_s * here_s);
  }
  undo_rolling_shutter(shutter, body, flat, path);
  for (const auto& [index, at] : path.frames)
    EXPECT_NEAR(std::remainder(at.seen.pose->pose.psi_rad - spins_rad[static_cast<size_t>(index)],
                               2.0 * std::numbers::pi),
                0.0, 0.002)
        << index;
}

}  // namespace
}  // namespace trochoid::tracking
