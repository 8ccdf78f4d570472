#include "trochoid/tracking/calibration.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <functional>
#include <numbers>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tracking {
namespace {

constexpr double kSquare_m = 0.02;
constexpr int kColumns = 9, kRows = 6;

data::Camera lens() {
  data::Camera camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.fx = camera.fy = 900.0;
  camera.cx = 327.0;
  camera.cy = 233.5;
  camera.distortion = {-0.2, 0.06, 0.0, 0.0, 0.0};
  return camera;
}

// The lens looking at the middle of the board from a distance, tilted about x and y [rad].
data::Camera looking(double distance_m, double about_x, double about_y) {
  data::Camera camera = lens();
  const Eigen::Matrix3d down = Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal();
  camera.camera_from_table = Eigen::AngleAxisd(about_x, Eigen::Vector3d::UnitX()) *
                             Eigen::AngleAxisd(about_y, Eigen::Vector3d::UnitY()) * down;
  camera.camera_from_table_m = {0.0, 0.0, distance_m};
  return camera;
}

const std::vector<std::array<double, 3>> kLooks{{0.5, 0.0, 0.0},  {0.45, 0.5, 0.0},
                                                {0.5, -0.5, 0.1}, {0.45, 0.0, 0.5},
                                                {0.5, 0.1, -0.5}, {0.4, 0.3, 0.3}};

// Blurred step: where `u` squares from the edge of the board lie in black or white, as -1 or +1.
double stripes(double u, double px_per_square) {
  constexpr double kBlur_px = 0.8;
  const double edge = std::round(u);
  const double side = static_cast<int>(edge) % 2 == 0 ? 1.0 : -1.0;
  return side * std::tanh((u - edge) * px_per_square / kBlur_px);
}

// A chessboard lying on the table plane as the camera sees it; its corners are exact.
cv::Mat draw_chessboard(const data::Camera& camera) {
  const double px_per_square =
      kSquare_m * camera.jacobian_px_per_m(Eigen::Vector3d::Zero()).col(0).norm();
  cv::Mat picture(camera.height_px, camera.width_px, CV_8UC1, cv::Scalar(230));
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x) {
      const Eigen::Vector3d p =
          camera.table_from_image({static_cast<double>(x), static_cast<double>(y)});
      const double u = p.x() / kSquare_m + 0.5 * (kColumns + 1);
      const double v = p.y() / kSquare_m + 0.5 * (kRows + 1);
      if (u < 0.0 || v < 0.0 || u > kColumns + 1 || v > kRows + 1) continue;
      const double value = 130.0 - 100.0 * stripes(u, px_per_square) * stripes(v, px_per_square);
      picture.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(value);
    }
  return picture;
}

TEST(Calibration, FindsTheCameraThatDrewTheBoards) {
  std::vector<BoardView> views;
  for (const auto& [distance, about_x, about_y] : kLooks) {
    const auto view = find_board(draw_chessboard(looking(distance, about_x, about_y)),
                                 {kColumns, kRows, kSquare_m, {}, {}}, "drawn");
    ASSERT_TRUE(view);
    views.push_back(*view);
  }
  Calibration result = calibrate(views, {640, 480});
  // Corners are found to a few hundredths of a pixel; six views of 54 corners.
  constexpr double kCorner_px = 0.05, kFocal_px = 1.5, kCentre_px = 1.5, kK1 = 0.01;
  EXPECT_LT(result.rms_px, kCorner_px);
  EXPECT_NEAR(result.camera.fx, 900.0, kFocal_px);
  EXPECT_NEAR(result.camera.fy, 900.0, kFocal_px);
  EXPECT_NEAR(result.camera.cx, 327.0, kCentre_px);
  EXPECT_NEAR(result.camera.cy, 233.5, kCentre_px);
  EXPECT_NEAR(result.camera.distortion[0], -0.2, kK1);
  // Five sigma hold the truth.
  EXPECT_LT(std::abs(result.camera.fx - 900.0), 5.0 * result.sigma_focal_px + 0.1);
  // The first board lies on the floor, 3 mm thick.
  constexpr double kThick_m = 0.003, kHeight_m = 0.001;
  const double rms = set_floor(result.camera, {views[0].board_m, views[0].image_px}, kThick_m);
  EXPECT_LT(rms, kCorner_px);
  EXPECT_NEAR(result.camera.position_m().z(), 0.5 + kThick_m, kHeight_m);
  EXPECT_NEAR(result.camera.position_m().head<2>().norm(), 0.0, kHeight_m);
}

// Shrunk to a quick look, boards of a sixth of the picture's width lose corners at their far side,
// and the others make a board of fewer columns.
TEST(Calibration, FindsABoardThatLooksLikeASmallerOneAtAQuickLook) {
  for (const auto& [distance, about_x, about_y] :
       {std::array{1.4, 0.0, -0.5}, {1.7, 0.0, 0.3}, {1.7, 0.4, 0.0}})
    EXPECT_TRUE(find_board(draw_chessboard(looking(distance, about_x, about_y)),
                           {kColumns, kRows, kSquare_m, {}, {}}, "drawn"))
        << distance << " m, " << about_x << ", " << about_y;
}

TEST(Calibration, PlacesTheFloorByFourPoints) {
  const data::Camera truth = looking(0.6, 0.3, -0.2);
  FloorPoints points;
  for (const auto& p : {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(0.1, 0.0),
                        Eigen::Vector2d(0.1, 0.08), Eigen::Vector2d(0.0, 0.08)}) {
    points.table_m.push_back(p);
    points.image_px.push_back(truth.image_from_table<double>({p.x(), p.y(), 0.0}));
  }
  data::Camera camera = lens();
  EXPECT_LT(set_floor(camera, points, 0.0), 1e-6);
  EXPECT_LT((camera.position_m() - truth.position_m()).norm(), 1e-6);
  EXPECT_LT((camera.camera_from_table - truth.camera_from_table).norm(), 1e-6);
  points.table_m.pop_back();
  points.image_px.pop_back();
  EXPECT_THROW((void)set_floor(camera, points, 0.0), InputError);
}

TEST(Calibration, RefusesFloorPointsOnOneLine) {
  data::Camera camera = lens();
  FloorPoints points;
  for (const double along_m : {0.0, 0.03, 0.07, 0.1}) {
    points.table_m.emplace_back(0.6 * along_m, 0.8 * along_m);
    points.image_px.emplace_back(200.0 + 600.0 * along_m, 150.0 + 800.0 * along_m);
  }
  EXPECT_THROW((void)set_floor(camera, points, 0.0), InputError);
}

TEST(Calibration, PlacesTheFloorByACircle) {
  const data::Camera truth = looking(0.6, 0.35, -0.1);
  constexpr double kRadius_m = 0.04, kHeight_m = 0.008;
  std::vector<Eigen::Vector2d> rim;
  for (int i = 0; i < 24; ++i) {
    const double a = 2.0 * std::numbers::pi * i / 24;
    rim.push_back(truth.image_from_table<double>(
        {kRadius_m * std::cos(a) + 0.01, kRadius_m * std::sin(a), kHeight_m}));
  }
  data::Camera camera = lens();
  EXPECT_LT(set_floor_from_circle(camera, rim, kRadius_m, kHeight_m), 1e-6);
  EXPECT_NEAR(camera.position_m().z(), truth.position_m().z(), 1e-6);
  const Eigen::Vector3d up = camera.camera_from_table.col(2);
  EXPECT_LT((up - truth.camera_from_table.col(2)).norm(), 1e-6);
}

TEST(Calibration, RefusesPointsThroughWhichNoCircleGoes) {
  constexpr int kPoints = 24;
  const auto zigzag = [](double half_px) {
    std::vector<Eigen::Vector2d> rim;
    for (int i = 0; i < kPoints; ++i)
      rim.emplace_back(180.0 + 4.0 * i, 150.0 + (i % 2 == 0 ? half_px : -half_px));
    return rim;
  };
  data::Camera camera = lens();
  EXPECT_THROW((void)set_floor_from_circle(camera, zigzag(0.0), 0.04, 0.0), InputError);
  EXPECT_THROW((void)set_floor_from_circle(camera, zigzag(0.5), 0.04, 0.0), NumericalError);
  EXPECT_EQ(camera.camera_from_table, lens().camera_from_table) << "the camera has been moved";
}

TEST(Calibration, ReadsACharucoBoardAlsoWhenPartOfItIsHidden) {
  const auto board = cv::aruco::CharucoBoard::create(
      7, 5, 0.02F, 0.015F, cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50));
  cv::Mat picture;
  board->draw({560, 400}, picture, 0, 1);
  cv::copyMakeBorder(picture, picture, 40, 40, 40, 40, cv::BORDER_CONSTANT, cv::Scalar(255));
  picture(cv::Rect(0, 0, 120, 120)).setTo(128);
  const auto view = find_board(picture, {7, 5, 0.02, 0.015, "4X4_50"}, "charuco");
  ASSERT_TRUE(view);
  ASSERT_GT(view->image_px.size(), 15U);
  // 80 px per square, the middle of the board in the middle of the picture.
  constexpr double kCorner_px = 0.1;
  for (std::size_t i = 0; i < view->image_px.size(); ++i) {
    const Eigen::Vector2d expected(319.5 + 4000.0 * view->board_m[i].x(),
                                   239.5 - 4000.0 * view->board_m[i].y());
    EXPECT_LT((view->image_px[i] - expected).norm(), kCorner_px) << i;
  }
}

// A board that is always square to the camera has the same picture at any focal length.
TEST(Calibration, RefusesBoardsThatAreNeverTilted) {
  std::vector<BoardView> views(4);
  for (std::size_t k = 0; k < views.size(); ++k)
    for (int row = 0; row < kRows; ++row)
      for (int column = 0; column < kColumns; ++column) {
        const Eigen::Vector2d corner(column, row);
        const auto shift = static_cast<double>(k);
        views[k].board_m.push_back(kSquare_m * corner);
        views[k].image_px.push_back(40.0 * corner + Eigen::Vector2d(100.0 + 20.0 * shift, 110.0));
      }
  EXPECT_THROW((void)calibrate(views, {640, 480}), NumericalError);
}

TEST(Calibration, RefusesOneTiltHoweverOftenItIsSeen) {
  for (const auto& [distance, about_x, about_y] : kLooks) {
    const auto view = find_board(draw_chessboard(looking(distance, about_x, about_y)),
                                 {kColumns, kRows, kSquare_m, {}, {}}, "drawn");
    ASSERT_TRUE(view);
    EXPECT_THROW((void)calibrate(std::vector<BoardView>(8, *view), {640, 480}), NumericalError)
        << about_x << ", " << about_y;
  }
}

std::vector<BoardView> drawn_views() {
  std::vector<BoardView> views;
  for (const auto& [distance, about_x, about_y] : kLooks)
    views.push_back(*find_board(draw_chessboard(looking(distance, about_x, about_y)),
                                {kColumns, kRows, kSquare_m, {}, {}}, "drawn"));
  return views;
}

// A camera's optics do not depend on how large the board is said to be.
TEST(Calibration, KnowsTheOpticsWhateverTheSizeOfTheBoard) {
  std::vector<BoardView> views = drawn_views();
  const Calibration usual = calibrate(views, {640, 480});
  for (BoardView& view : views)
    for (Eigen::Vector2d& p : view.board_m) p *= 1e-3;
  const Calibration small = calibrate(views, {640, 480});
  constexpr double kSame_px = 0.01;
  EXPECT_NEAR(small.camera.fx, usual.camera.fx, kSame_px);
  EXPECT_NEAR(small.camera.cy, usual.camera.cy, kSame_px);
  EXPECT_NEAR(small.sigma_focal_px, usual.sigma_focal_px, kSame_px);
  EXPECT_TRUE(small.left_out.empty());
}

// Squares 3 % longer than wide: another board, or a sheet that the printer stretched.
TEST(Calibration, LeavesOutTheViewOfAnotherBoard) {
  std::vector<BoardView> views = drawn_views();
  for (Eigen::Vector2d& p : views[3].board_m) p.x() *= 1.03;
  const Calibration result = calibrate(views, {640, 480});
  ASSERT_EQ(result.left_out.size(), 1U);
  EXPECT_EQ(result.left_out[0].view, 3U);
  EXPECT_TRUE(result.left_out[0].corners_px.empty());
  // All together make it 928 px.
  constexpr double kFocal_px = 3.0;
  EXPECT_NEAR(result.camera.fx, 900.0, kFocal_px);
  // Each view keeps its place, and the one left out the rms that the others see in it.
  ASSERT_EQ(result.view_rms_px.size(), views.size());
  EXPECT_EQ(result.view_rms_px[3], result.left_out[0].rms_px);
  EXPECT_GT(result.view_rms_px[3], 5.0 * result.rms_px);
}

// The sheet's middle stands up by 2 mm over a length of 160.
TEST(Calibration, LeavesOutTheViewOfABentBoard) {
  constexpr double kSag_m = 0.002, kHalf_m = 4.0 * kSquare_m;
  std::vector<BoardView> views = drawn_views();
  const auto& [distance, about_x, about_y] = kLooks[4];
  const data::Camera camera = looking(distance, about_x, about_y);
  for (std::size_t i = 0; i < views[4].board_m.size(); ++i) {
    const Eigen::Vector2d at = views[4].board_m[i];
    const double up = kSag_m * (1.0 - std::pow(at.x() / kHalf_m, 2));
    views[4].image_px[i] += camera.image_from_table<double>({at.x(), at.y(), up}) -
                            camera.image_from_table<double>({at.x(), at.y(), 0.0});
  }
  const Calibration result = calibrate(views, {640, 480});
  ASSERT_EQ(result.left_out.size(), 1U);
  EXPECT_EQ(result.left_out[0].view, 4U);
}

TEST(Calibration, LeavesOutOnlyTheCornerThatIsWrong) {
  std::vector<BoardView> views = drawn_views();
  views[2].image_px[10] += Eigen::Vector2d(12.0, 5.0);
  const Calibration result = calibrate(views, {640, 480});
  ASSERT_EQ(result.left_out.size(), 1U);
  EXPECT_EQ(result.left_out[0].view, 2U);
  ASSERT_EQ(result.left_out[0].corners_px.size(), 1U);
  EXPECT_EQ(result.left_out[0].corners_px[0], views[2].image_px[10]);
  constexpr double kCorner_px = 0.05;
  EXPECT_LT(result.view_rms_px[2], kCorner_px);
}

// Shaky hands in every picture are no reason to throw pictures away.
TEST(Calibration, LeavesNoViewOutThatIsAsGoodAsTheOthers) {
  constexpr double kNoise_px = 0.2;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    std::vector<BoardView> views = drawn_views();
    std::mt19937 random(seed);
    std::normal_distribution<double> noise_px(0.0, kNoise_px);
    for (BoardView& view : views)
      for (Eigen::Vector2d& p : view.image_px)
        p += Eigen::Vector2d{noise_px(random), noise_px(random)};
    EXPECT_TRUE(calibrate(views, {640, 480}).left_out.empty()) << seed;
  }
}

// Corners of the boards of kLooks, off by noise of 0.1 px.
constexpr double kCornerNoise_px = 0.1;

std::vector<BoardView> noisy_views(std::mt19937_64& generator) {
  std::normal_distribution<double> normal(0.0, kCornerNoise_px);
  std::vector<BoardView> views;
  for (const auto& [distance, about_x, about_y] : kLooks) {
    const data::Camera camera = looking(distance, about_x, about_y);
    BoardView view;
    for (int i = 0; i < kColumns * kRows; ++i) {
      view.board_m.emplace_back(kSquare_m * (i % kColumns - 0.5 * (kColumns - 1)),
                                kSquare_m * (i / kColumns - 0.5 * (kRows - 1)));
      const Eigen::Vector2d& at = view.board_m.back();
      view.image_px.push_back(camera.image_from_table<double>({at.x(), at.y(), 0.0}) +
                              Eigen::Vector2d{normal(generator), normal(generator)});
    }
    views.push_back(std::move(view));
  }
  return views;
}

// Points of a plane as the true camera sees them, off by so much.
std::vector<Eigen::Vector2d> noisy_images(const data::Camera& truth,
                                          const std::vector<Eigen::Vector3d>& points_m,
                                          double noise_px, std::mt19937_64& generator) {
  std::normal_distribution<double> normal(0.0, noise_px);
  std::vector<Eigen::Vector2d> out;
  for (const Eigen::Vector3d& at : points_m)
    out.push_back(truth.image_from_table<double>(at) +
                  Eigen::Vector2d{normal(generator), normal(generator)});
  return out;
}

// What the true camera is off by, as the one found counts it.
data::Camera::Deviation off_by(const data::Camera& found, const data::Camera& truth) {
  const Eigen::AngleAxisd turn(
      Eigen::Matrix3d(truth.camera_from_table * found.camera_from_table.transpose()));
  data::Camera::Deviation out;
  out << truth.fx - found.fx, truth.fy - found.fy, truth.cx - found.cx, truth.cy - found.cy,
      Eigen::Matrix<double, 5, 1>::Zero(), turn.angle() * turn.axis(),
      truth.camera_from_table_m - found.camera_from_table_m;
  for (int i = 0; i < 5; ++i) out[4 + i] = truth.distortion[i] - found.distortion[i];
  return out;
}

// Mean over seeds of the square of what the camera is off by in its own standard deviations, over
// how many numbers are uncertain: 1 if these are honest.
double normalised_square(const data::Camera& truth,
                         const std::function<void(Calibration&, const std::vector<BoardView>&,
                                                  std::mt19937_64&)>& place_floor) {
  constexpr int kSeeds = 25;
  double sum = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 generator(static_cast<std::uint64_t>(seed));
    const std::vector<BoardView> views = noisy_views(generator);
    Calibration result = calibrate(views, {640, 480});
    place_floor(result, views, generator);
    const Eigen::MatrixXd causes = result.camera.likely_deviations();
    const Eigen::VectorXd along = causes.colPivHouseholderQr().solve(off_by(result.camera, truth));
    sum += along.squaredNorm() / static_cast<double>(causes.cols()) / kSeeds;
  }
  return sum;
}

// Of 25 times 13 or 14 squares the mean scatters by sqrt(2 / 340) = 8 %; four of these.
constexpr double kHonest = 0.3;

TEST(Calibration, KnowsHowFarACameraMayBeOffWhereABoardShowsTheFloor) {
  const auto& [distance, about_x, about_y] = kLooks[0];
  EXPECT_NEAR(normalised_square(looking(distance, about_x, about_y),
                                [](Calibration& result, const auto& views, auto&) {
                                  (void)set_floor(result.camera,
                                                  {views[0].board_m, views[0].image_px}, 0.0,
                                                  result.rms_px);
                                }),
              1.0, kHonest);
}

// Points that somebody picked: of eight numbers less six their own scatter tells little, and
// counts, by Student's factor, where it is larger than the corners'. As good as these they are
// charged too much; five times worse, their squares hang on two numbers and have long tails.
TEST(Calibration, KnowsHowFarACameraMayBeOffWhereFourPointsShowTheFloor) {
  const data::Camera truth = looking(0.6, 0.3, -0.2);
  const std::vector<Eigen::Vector2d> table_m{{0.0, 0.0}, {0.1, 0.0}, {0.1, 0.08}, {0.0, 0.08}};
  std::vector<Eigen::Vector3d> points_m;
  for (const Eigen::Vector2d& at : table_m) points_m.emplace_back(at.x(), at.y(), 0.0);
  const auto with_noise = [&](double noise_px) {
    return normalised_square(truth, [&](Calibration& result, const auto&, auto& generator) {
      (void)set_floor(result.camera, {table_m, noisy_images(truth, points_m, noise_px, generator)},
                      0.0, result.rms_px);
    });
  };
  constexpr double kHalf = 0.5, kPicked = 2.0;
  const double as_corners = with_noise(kCornerNoise_px);
  EXPECT_LT(as_corners, 1.0 + kHonest);
  EXPECT_GT(as_corners, kHalf * (1.0 - kHonest));
  EXPECT_LT(with_noise(5.0 * kCornerNoise_px), kPicked);
}

TEST(Calibration, KnowsHowFarACameraMayBeOffWhereACircleShowsTheFloor) {
  // Its x is to the right in the picture and its origin under the circle, as the found one's; of
  // the two planes that look the same this one is seen more squarely.
  data::Camera truth = looking(0.6, 0.05, 0.0);
  truth.camera_from_table_m = {0.12, 0.06, 0.6};
  constexpr double kRadius_m = 0.08, kHeight_m = 0.008;
  std::vector<Eigen::Vector3d> rim_m;
  for (int i = 0; i < 24; ++i) {
    const double a = 2.0 * std::numbers::pi * i / 24;
    rim_m.emplace_back(kRadius_m * std::cos(a), kRadius_m * std::sin(a), kHeight_m);
  }
  EXPECT_NEAR(normalised_square(truth,
                                [&](Calibration& result, const auto&, auto& generator) {
                                  (void)set_floor_from_circle(
                                      result.camera,
                                      noisy_images(truth, rim_m, kCornerNoise_px, generator),
                                      kRadius_m, kHeight_m, result.rms_px);
                                }),
              1.0, kHonest);
}

TEST(Calibration, RefusesTooLittle) {
  EXPECT_FALSE(find_board(cv::Mat(240, 320, CV_8UC1, cv::Scalar(128)), {}, "grey"));
  EXPECT_THROW((void)calibrate({}, {640, 480}), InputError);
  BoardPattern pattern;
  pattern.square_m = 0.0;
  EXPECT_THROW((void)find_board(cv::Mat(240, 320, CV_8UC1), pattern, "x"), InputError);
}

// Photo-realistic boards by another renderer, with its camera.
TEST(Calibration, FindsTheCameraOfARenderedRecording) {
  const std::filesystem::path folder =
      std::filesystem::path(TROCHOID_SHARED_DIR) / "recordings/rendered/s3_disc_marker_tilted";
  if (!std::filesystem::exists(folder / "calib")) GTEST_SKIP() << "no recordings";
  std::vector<BoardView> views;
  cv::Size size;
  for (int i = 0; i < 10; ++i) {
    const std::string name = "view_0" + std::to_string(i) + ".png";
    const cv::Mat picture = cv::imread((folder / "calib" / name).string(), cv::IMREAD_GRAYSCALE);
    size = picture.size();
    if (auto view = find_board(picture, {9, 6, 0.02, {}, {}}, name)) views.push_back(*view);
  }
  ASSERT_GE(views.size(), 8U);
  Calibration result = calibrate(views, size);
  const data::Camera truth = data::read_camera(folder / "camera.json");
  constexpr double kFocal_px = 3.0, kPosition_m = 0.002;
  EXPECT_LT(result.rms_px, 0.15);
  EXPECT_NEAR(result.camera.fx, truth.fx, kFocal_px);
  EXPECT_NEAR(result.camera.distortion[0], truth.distortion[0], 0.01);
  (void)set_floor(result.camera, {views[0].board_m, views[0].image_px}, 0.003);
  EXPECT_NEAR(result.camera.position_m().z(), truth.position_m().z(), kPosition_m);
  EXPECT_NEAR(result.camera.position_m().norm(), truth.position_m().norm(), kPosition_m);
}

}  // namespace
}  // namespace trochoid::tracking
