#include "edges/colour_edges.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <random>

#include "drawn_clip.hpp"
#include "find/background.hpp"
#include "find/body_finder.hpp"
#include "geometry/contour.hpp"
#include "trochoid/tracking/outline_fit.hpp"

namespace trochoid::tracking {
namespace {

using Rgb = std::array<double, 3>;  // levels 0..255

double light_of_level(double level) {
  const double v = level / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

double level_of_light(double light) {
  return 255.0 * (light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055);
}

struct Photograph {
  cv::Mat luma, chroma;
};

// Where samples of chroma lie: amid four pixels, or beside the left two.
enum class Site { amid, left };

cv::Mat half_size(const cv::Mat& plane, Site site) {
  cv::Mat half, at = plane;
  if (site == Site::left) {
    const cv::Mat around = (cv::Mat_<double>(1, 3) << 0.25, 0.5, 0.25);
    cv::filter2D(plane, at, -1, around);
    cv::Mat columns(plane.rows, plane.cols / 2, plane.type());
    for (int x = 0; x < columns.cols; ++x) at.col(2 * x).copyTo(columns.col(x));
    at = columns;
  }
  cv::resize(at, half, plane.size() / 2, 0.0, 0.0, cv::INTER_AREA);
  return half;
}

// A body on its floor as a camera sees them: light mixes in the lens and on the sensor, then gets
// the sRGB curve, luma and chroma by BT.601, chroma as the mean of four pixels.
// @param covered share of a point that the body covers; @param floor its colour at a point.
Photograph photographed(const cv::Size& size, const Rgb& body,
                        const std::function<Rgb(double, double)>& floor,
                        const std::function<double(double, double)>& covered, double noise = 0.5,
                        Site site = Site::amid) {
  constexpr int kFine = 4;
  constexpr double kLensPx = 0.5;
  std::array<cv::Mat, 3> levels;
  for (std::size_t c = 0; c < 3; ++c) {
    cv::Mat fine(size.height * kFine, size.width * kFine, CV_64F);
    for (int y = 0; y < fine.rows; ++y)
      for (int x = 0; x < fine.cols; ++x) {
        const double px = (x + 0.5) / kFine - 0.5, py = (y + 0.5) / kFine - 0.5;
        const double share = covered(px, py);
        fine.at<double>(y, x) =
            share * light_of_level(body[c]) + (1.0 - share) * light_of_level(floor(px, py)[c]);
      }
    cv::GaussianBlur(fine, fine, {}, kLensPx * kFine);
    cv::resize(fine, levels[c], size, 0.0, 0.0, cv::INTER_AREA);
    for (double& v : cv::Mat_<double>(levels[c])) v = level_of_light(v);
  }
  const cv::Mat luma = 0.299 * levels[0] + 0.587 * levels[1] + 0.114 * levels[2];
  cv::Mat cb = (levels[2] - luma) / 1.772 + 128.0, cr = (levels[0] - luma) / 1.402 + 128.0;
  for (cv::Mat* plane : {&cb, &cr}) *plane = half_size(*plane, site);
  std::mt19937 random(21);
  Photograph out{developed(luma, noise, random), {}};
  cv::merge(std::vector<cv::Mat>{developed(cb, noise, random), developed(cr, noise, random)},
            out.chroma);
  return out;
}

struct ThinDisc {
  data::Body body;
  data::Camera camera = data::Camera::from_scale(160, 140, 1000.0);
  ThinDisc() { body.radius_m = 0.036, body.thickness_m = 1e-4; }

  [[nodiscard]] data::Pose<> at(const Eigen::Vector2d& centre_px, double theta_rad,
                                double phi_rad = 0.0) const {
    data::Pose<> pose;
    pose.theta_rad = theta_rad, pose.phi_rad = phi_rad;
    pose.centre_m = camera.table_from_image(
        centre_px, data::height_on_floor_m(theta_rad, body.radius_m, body.half_thickness_m()));
    return pose;
  }
};

// In the picture y points down: precession turns the other way round.
bool in_ellipse(double x, double y, double a, double b, double phi_rad) {
  const double c = std::cos(phi_rad), s = -std::sin(phi_rad);
  return std::hypot((c * x + s * y) / a, (-s * x + c * y) / b) < 1.0;
}

// As bright as its floor, brown on blue, and precessing by half a radian while the shutter is open:
// its ends sweep over 18 px, farther than they are wide. Seen more from aside it is narrower still.
TEST(ColourEdges, ADiscThatTurnsUnderTheOpenShutterIsMeasuredByWhatItCovers) {
  constexpr double kTurned_rad = 0.5, kFraction = 0.5, kRadius_px = 36.0;
  constexpr int kMoments = 41;
  const ThinDisc disc;
  const Eigen::Vector2d centre(80.3, 70.2);
  for (const double theta_rad : {1.15, 1.35}) {
    const auto covered = [&](double x, double y) {
      int inside = 0;
      for (int k = 0; k < kMoments; ++k)
        inside +=
            in_ellipse(x - centre.x(), y - centre.y(), kRadius_px, kRadius_px * std::cos(theta_rad),
                       kTurned_rad * ((k + 0.5) / kMoments - 0.5))
                ? 1
                : 0;
      return static_cast<double>(inside) / kMoments;
    };
    const auto [luma, chroma] = photographed(
        {160, 140}, {100.0, 86.0, 66.0},
        [](double, double) -> Rgb {
          return {76.0, 88.0, 118.0};
        },
        covered);
    const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
    const Eigen::Vector2d off(1.0, -0.5);
    const cv::Mat no_plate;
    const auto seen = fitter.measure(
        {.luma = luma,
         .background = no_plate,
         .detection = {},
         .predicted = disc.at(centre + off, theta_rad + 0.02, 0.02),
         .previous = disc.at(centre + off, theta_rad + 0.02, 0.02 - kTurned_rad / kFraction),
         .exposure_fraction = kFraction,
         .chroma = chroma});
    ASSERT_TRUE(seen);
    constexpr double kTolerance_px = 0.1;
    EXPECT_NEAR(seen->centre_px.x(), centre.x(), kTolerance_px);
    EXPECT_NEAR(seen->centre_px.y(), centre.y(), kTolerance_px);
  }
}

// What the colour planes alone say of a disc where it is predicted to be.
struct ByColour {
  std::vector<OutlineSample> outline;
  std::vector<ColourEdge> edges;
};

ByColour seen_by_colour(const ThinDisc& disc, const Photograph& picture,
                        const data::Pose<>& predicted) {
  const data::PoseMotion motion(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  const ColourWindow colour = colour_window(picture.luma, picture.chroma, {0, 0, 160, 140},
                                            disc.body, disc.camera, predicted);
  ByColour seen{outline_samples(disc.body, predicted, disc.camera, motion, 2.0), {}};
  constexpr double kBlurPx = 0.6, kReachPx = 3.0;
  seen.edges = find_colour_edges(colour, {seen.outline, Moments(), data::PoseMotion::Step()},
                                 kBlurPx, kReachPx);
  return seen;
}

// A top's axis that points at the camera, all but, left its distance from the pivot open: the disc
// was looked for behind the camera, where nothing of it is seen.
TEST(ColourEdges, AnOutlineOfWhichNothingIsSeenHasNone) {
  const ThinDisc disc;
  const cv::Mat luma(140, 160, CV_8U, cv::Scalar(90)), chroma(70, 80, CV_8UC2, cv::Scalar(90, 90));
  const ColourWindow colour = colour_window(luma, chroma, {0, 0, 160, 140}, disc.body, disc.camera,
                                            disc.at({80.3, 70.2}, 0.3));
  const std::vector<OutlineSample> nothing;
  EXPECT_TRUE(
      find_colour_edges(colour, {nothing, Moments(), data::PoseMotion::Step()}, 0.6, 3.0).empty());
}

// The centre of a disc predicted 0.4 px beside its place.
Eigen::Vector2d centre_by_colour(const ThinDisc& disc, const Photograph& picture,
                                 const Eigen::Vector2d& centre, double theta_rad) {
  const auto [outline, edges] =
      seen_by_colour(disc, picture, disc.at(centre + Eigen::Vector2d(0.4, 0.0), theta_rad));
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const ColourEdge& found : edges) {
    const Eigen::Vector2d n = outline[found.sample].normal_px;
    const Eigen::Vector3d row(n.x(), n.y(), 1.0);  // and of the size
    const double weight = 1.0 / (found.edge.noise_variance_px2 + found.edge.shading_variance_px2);
    normal += weight * row * row.transpose();
    right += weight * found.edge.offset_px * row;
  }
  const Eigen::Vector3d answer = normal.ldlt().solve(right);
  return centre + Eigen::Vector2d(0.4, 0.0) + answer.head<2>();
}

// Beside a disc lies its shadow: there the floor has less of its colour, as it has less light.
TEST(ColourEdges, AFloorThatShowsLessColourInTheShadeDoesNotPullTheDisc) {
  constexpr double kTheta = 0.3, kRadius_px = 36.0;
  const ThinDisc disc;
  const Eigen::Vector2d centre(80.3, 70.2);
  const auto floor = [&](double x, double y) -> Rgb {
    const double shade =
        in_ellipse(x - centre.x() - 9.0, y - centre.y(), 34.0, 34.0, 0.0) ? 0.6 : 1.0;
    return {shade * 120.0, shade * 150.0, shade * 215.0};
  };
  const auto covered = [&](double x, double y) {
    return in_ellipse(x - centre.x(), y - centre.y(), kRadius_px, kRadius_px * std::cos(kTheta),
                      0.0)
               ? 1.0
               : 0.0;
  };
  const Photograph picture = photographed({160, 140}, {150.0, 60.0, 40.0}, floor, covered);
  constexpr double kTolerance_px = 0.12;
  EXPECT_LT((centre_by_colour(disc, picture, centre, kTheta) - centre).norm(), kTolerance_px);
}

// Glints that have no colour, on a tenth of the rim and all to one side.
TEST(ColourEdges, GlintsOnOneSideAreOutliers) {
  constexpr double kTheta = 0.3, kRadius_px = 36.0;
  const ThinDisc disc;
  const Eigen::Vector2d centre(80.3, 70.2);
  const auto in_disc = [&](double x, double y) {
    return in_ellipse(x - centre.x(), y - centre.y(), kRadius_px, kRadius_px * std::cos(kTheta),
                      0.0);
  };
  Photograph picture = photographed(
      {160, 140}, {150.0, 60.0, 40.0},
      [](double, double) -> Rgb {
        return {120.0, 150.0, 215.0};
      },
      [&](double x, double y) { return in_disc(x, y) ? 1.0 : 0.0; });
  for (int y = 58; y < 82; y += 4)
    for (int x = 108; x < 114; x += 2)
      if (in_disc(x, y)) picture.chroma.at<cv::Vec2b>(y / 2, x / 2) = {128, 128};
  constexpr double kTolerance_px = 0.08;
  EXPECT_LT((centre_by_colour(disc, picture, centre, kTheta) - centre).norm(), kTolerance_px);
}

constexpr double kThinRadius_px = 36.0;  // of ThinDisc

// One colour on another.
Photograph brown_on_blue(const Eigen::Vector2d& centre, double theta_rad, Site site = Site::amid) {
  constexpr double kNoise = 0.5;
  return photographed(
      {160, 140}, {150.0, 60.0, 40.0},
      [](double, double) -> Rgb {
        return {120.0, 150.0, 215.0};
      },
      [&](double x, double y) {
        return in_ellipse(x - centre.x(), y - centre.y(), kThinRadius_px,
                          kThinRadius_px * std::cos(theta_rad), 0.0)
                   ? 1.0
                   : 0.0;
      },
      kNoise, site);
}

// Coders spread colours over neighbouring pixels of the planes. Of edges twice as wide as they are
// taken for, the offset comes out at half of what it is.
TEST(ColourEdges, OffsetsOfColoursThatTheCoderHasBlurredAreNotShrunk) {
  constexpr double kTheta = 0.3, kSpread = 0.6;  // the latter: sd in pixels of the planes
  const ThinDisc disc;
  const Eigen::Vector2d centre(80.3, 70.2);
  Photograph picture = brown_on_blue(centre, kTheta);
  cv::GaussianBlur(picture.chroma, picture.chroma, {}, kSpread);
  constexpr double kTolerance_px = 0.08;  // of the 0.4 px that are to be seen
  EXPECT_LT((centre_by_colour(disc, picture, centre, kTheta) - centre).norm(), kTolerance_px);
}

// Colours that lie half a pixel to the left of where they are looked for seem to lie to the right.
TEST(OutlineFitter, TellsHowFarColoursLieOffLuma) {
  constexpr double kTheta = 0.3;
  const ThinDisc disc;
  const Eigen::Vector2d centre(80.3, 70.2);
  const auto [luma, chroma] = brown_on_blue(centre, kTheta, Site::left);
  const OutlineFitter fitter(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  const cv::Mat no_plate;
  for (const double site_px : {0.0, -0.5}) {
    const auto seen = fitter.measure({.luma = luma,
                                      .background = no_plate,
                                      .detection = {},
                                      .predicted = disc.at(centre, kTheta),
                                      .chroma = chroma,
                                      .chroma_site_px = {site_px, 0.0}});
    ASSERT_TRUE(seen);
    constexpr double kTolerance_px = 0.15;  // half of what Tukey's weights may take off it
    EXPECT_NEAR(seen->colour_off_px.x(), 0.5 + site_px, kTolerance_px);
    EXPECT_NEAR(seen->colour_off_px.y(), 0.0, kTolerance_px);
    EXPECT_GT(seen->colour_information.minCoeff(), 50.0);
  }
}

TEST(CylinderFinder, LooksForColoursWhereTheBackgroundSaysTheyLie) {
  constexpr double kTheta = 0.3, kFloor = 148.0;  // luma of the blue
  const ThinDisc disc;
  const Eigen::Vector2d centre(80.3, 70.2);
  const Photograph picture = brown_on_blue(centre, kTheta, Site::left);
  const cv::Size size = picture.luma.size();
  Frame frame;
  frame.luma = picture.luma, frame.chroma = picture.chroma;
  const auto finder =
      make_cylinder_finder(disc.body, {data::SupportKind::floor, {}}, disc.camera, 0.0);
  Sighting guess;
  guess.pose.emplace().pose = disc.at(centre, kTheta);
  finder->place(guess);
  const Background amid =
      Background::from_samples({{cv::Mat(size, CV_8U, cv::Scalar(kFloor))}, {}});
  const auto off_px = [&](const Background& background) {
    Plate plate;
    background.scaled_into(plate, 1.0, cv::Rect({}, size));
    Look look{.frame = frame, .background = plate};
    look.predicted = &guess;
    const auto seen = finder->find(look);
    return seen && seen->pose ? seen->pose->colour_off_px.x() : std::nan("");
  };
  constexpr double kTolerance_px = 0.15;  // half of what Tukey's weights may take off it
  EXPECT_NEAR(off_px(amid), 0.5, kTolerance_px);
  EXPECT_NEAR(off_px(amid.sited_at({-0.5, 0.0})), 0.0, kTolerance_px);
}

// The wall of a disc shows more of its colour where it faces the camera and less where it turns
// away and shines; no pixel of the planes shows it alone.
TEST(ColourEdges, AWallOfOtherColoursAllAlongDoesNotPullTheRim) {
  constexpr double kTheta = 0.8, kRadius_px = 36.0, kHalfThickness_px = 3.5;
  ThinDisc disc;
  disc.body.thickness_m = 2e-3 * kHalfThickness_px;
  const Eigen::Vector2d centre(80.3, 70.2);
  const double lower_px = kHalfThickness_px * std::sin(kTheta);
  const auto in_face = [&](double x, double y, double along_px) {
    return in_ellipse(x - centre.x(), y - centre.y() - along_px, kRadius_px,
                      kRadius_px * std::cos(kTheta), 0.0);
  };
  const auto colour_at = [&](double x, double y) -> Rgb {
    if (in_face(x, y, lower_px)) return {170.0, 70.0, 50.0};
    const bool beside = std::abs(y - centre.y()) < lower_px && in_face(x, centre.y(), 0.0);
    if (in_face(x, y, -lower_px) || beside) {
      const double turned = std::pow((x - centre.x()) / kRadius_px, 2);
      return {170.0, 55.0 + 40.0 * turned, 35.0 + 50.0 * turned};
    }
    return {120.0, 150.0, 215.0};
  };
  Photograph picture =
      photographed({160, 140}, {0.0, 0.0, 0.0}, colour_at, [](double, double) { return 0.0; });
  constexpr double kSpread = 0.5;  // by the coder: sd in pixels of the planes
  cv::GaussianBlur(picture.chroma, picture.chroma, {}, kSpread);
  const ByColour seen = seen_by_colour(disc, picture, disc.at(centre, kTheta));
  double off_px = 0.0;
  int count = 0;
  for (const ColourEdge& found : seen.edges) {
    const OutlineSample& sample = seen.outline[found.sample];
    const bool towards_the_ends = std::abs(sample.normal_px.x()) > 0.5;
    if (sample.edge == data::OutlinePoint::Edge::lower_rim && towards_the_ends)
      off_px += found.edge.offset_px, ++count;
  }
  ASSERT_GT(count, 10);
  constexpr double kTolerance_px = 0.06;
  EXPECT_NEAR(off_px / count, 0.0, kTolerance_px);
}

// What colours a flat disc of one colour on a floor of another shows.
ColourWindow seen_on(const Rgb& disc_colour, const Rgb& floor_colour) {
  const ThinDisc disc;
  const Eigen::Vector2d centre(80.3, 70.2);
  const Photograph picture = photographed(
      {160, 140}, disc_colour, [&](double, double) { return floor_colour; },
      [&](double x, double y) {
        return in_ellipse(x - centre.x(), y - centre.y(), 36.0, 36.0, 0.0) ? 1.0 : 0.0;
      });
  return colour_window(picture.luma, picture.chroma, {0, 0, 160, 140}, disc.body, disc.camera,
                       disc.at(centre, 0.0));
}

// Black covers half of a pixel of orange: what is left of the light is coded as 0.735 of the level,
// and of the colour as much.
TEST(ColourMixing, HalfOfABrightColourBesideBlackIsMostOfIt) {
  const ColourMixing mixing = seen_on({1.0, 1.0, 1.0}, {230.0, 160.0, 90.0}).mixing_in(1.0);
  constexpr double kTolerance = 0.03;  // what sRGB is besides a power
  EXPECT_NEAR(mixing.shown(0.5), 1.0 - 0.735, kTolerance);
  EXPECT_NEAR(mixing.shown(0.0), 0.0, 1e-9);
  EXPECT_NEAR(mixing.shown(1.0), 1.0, 1e-9);
}

// Brown and tan: half of each is more of the tan's colour than tan itself.
TEST(ColourMixing, ColoursThatGoPastEachOtherMixAsLight) {
  const ColourWindow colour = seen_on({90.0, 60.0, 30.0}, {200.0, 170.0, 130.0});
  ASSERT_FALSE(colour.empty());
  for (const double shade : ColourWindow::kShades)
    for (double covered = 0.0; covered <= 1.0; covered += 0.05) {
      EXPECT_GE(colour.mixing_in(shade).shown(covered), -1e-9) << shade << ", " << covered;
      EXPECT_LE(colour.mixing_in(shade).shown(covered), 1.0 + 1e-9) << shade << ", " << covered;
      EXPECT_GE(colour.mixing_in(shade).slope(covered), -1e-9) << shade << ", " << covered;
    }
}

// A ring lying flat below the camera: its upper rim and, deeper in, the lower rim of its bore are
// two circles about one centre.
TEST(Contour, DistancesAreThoseFromTheCirclesOfARing) {
  data::Body ring;
  ring.kind = data::BodyKind::ring;
  ring.radius_m = 0.036, ring.inner_radius_m = 0.026, ring.thickness_m = 0.004;
  const auto camera = data::Camera::overhead(160, 140, 1000.0, 1.0);
  const data::PoseMotion motion(ring, {data::SupportKind::flat, {}}, camera);
  data::Pose<> pose;
  const Eigen::Vector2d centre(79.5, 69.5);
  pose.centre_m = camera.table_from_image(centre, 0.002);
  const auto outline = outline_samples(ring, pose, camera, motion, 2.0);
  const Contour rim(outline, Contour::Of::rim), bore(outline, Contour::Of::bore);
  ASSERT_FALSE(rim.empty());
  ASSERT_FALSE(bore.empty());
  constexpr double kRim_px = 36.0 / (1.0 - 0.004), kBore_px = 26.0;
  constexpr double kTolerance_px = 0.01;  // samples are 2 px apart: chords would be off by 0.02
  for (const double angle_rad : {0.1, 1.3, 2.9, -2.0})
    for (const double radius_px : {24.0, 31.0, 38.5}) {
      const Eigen::Vector2d p =
          centre + radius_px * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
      EXPECT_NEAR(rim.nearest(p).off_px, radius_px - kRim_px, kTolerance_px);
      EXPECT_NEAR(bore.nearest(p).off_px, kBore_px - radius_px, kTolerance_px);
      EXPECT_TRUE(rim.may_be_within(std::abs(radius_px - kRim_px) + 0.1, p));
    }
  EXPECT_FALSE(rim.may_be_within(5.0, centre));
}

// A disc seen from aside is five times as long as wide: from its middle, the nearest point lies in
// quite another direction than the point asked about.
TEST(Contour, TheNearestPointOfAFlatEllipseIsFound) {
  const ThinDisc disc;
  const data::PoseMotion motion(disc.body, {data::SupportKind::floor, {}}, disc.camera);
  const Eigen::Vector2d centre(80.3, 70.2);
  const auto outline =
      outline_samples(disc.body, disc.at(centre, std::acos(0.2), 0.4), disc.camera, motion, 1.5);
  const Contour rim(outline, Contour::Of::rim);
  int near = 0;
  for (double y = 30.0; y < 110.0; y += 2.3)
    for (double x = 40.0; x < 120.0; x += 2.7) {
      const Eigen::Vector2d p(x, y);
      double least = 1e9;
      for (const OutlineSample& sample : outline)
        if (sample.silhouette) least = std::min(least, (sample.image_px - p).norm());
      constexpr double kFarPx = 10.0, kBetweenPx = 0.8;  // half of what samples are apart
      if (least > kFarPx) continue;
      ++near;
      EXPECT_NEAR(std::abs(rim.nearest(p).off_px), least, kBetweenPx) << x << ", " << y;
    }
  EXPECT_GT(near, 100);
}

}  // namespace
}  // namespace trochoid::tracking
