#include "files_for_tests.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {
namespace {

const std::string kCamera = R"({
 "width": 800, "height": 600, "fps": 120, "shutter_fraction_of_frame": 0.25,
 "fx": 1180.0, "fy": 1181.0, "cx": 406.3, "cy": 293.1,
 "dist_k1_k2_p1_p2_k3": [-0.24, 0.07, 0.0, 0.0, 0.0], "transfer": "linear",
 "R_world_to_cam": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
 "t_world_to_cam_m": [0.0, 0.0, 0.62]
})";

std::string with(const std::string& from, const std::string& to) {
  std::string text = kCamera;
  return text.replace(text.find(from), from.size(), to);
}

std::string looking_up() {
  const std::string down = "[0, -1, 0], [0, 0, -1]", height = "0.62";
  std::string text = with(down, "[0, 1, 0], [0, 0, 1]");
  return text.replace(text.find(height), height.size(), "-0.62");
}

std::string uncertain(const std::string& covariance) {
  return with("\"transfer\"", "\"covariance\": " + covariance + ", \"transfer\"");
}

TEST(CameraFile, KeepsWhatTheCalibrationLeavesUncertain) {
  const TestFolder folder;
  const Camera camera = read_camera(folder.write(
      "c.json",
      uncertain(R"({"of": ["fx", "shift_z_m"], "matrix": [[4.0, 1.9e-3], [1.9e-3, 1e-6]]})")));
  EXPECT_EQ(camera.covariance(0, 0), 4.0);
  EXPECT_EQ(camera.covariance(14, 0), 1.9e-3);
  EXPECT_EQ(camera.covariance(1, 1), 0.0);
  write_camera(camera, folder / "d.json");
  EXPECT_EQ(read_camera(folder / "d.json").covariance, camera.covariance);
}

TEST(CameraFile, KeepsEverythingThroughAFile) {
  const TestFolder folder;
  const Camera camera = read_camera(folder.write("c.json", kCamera));
  EXPECT_EQ(camera.width_px, 800);
  EXPECT_EQ(camera.fy, 1181.0);
  EXPECT_EQ(camera.distortion[0], -0.24);
  EXPECT_EQ(camera.frame_rate_hz, 120.0);
  EXPECT_EQ(camera.exposure_fraction, 0.25);
  EXPECT_EQ(camera.transfer, Transfer::linear);
  write_camera(camera, folder / "d.json");
  const Camera again = read_camera(folder / "d.json");
  EXPECT_EQ(again.transfer, Transfer::linear);
  EXPECT_EQ(again.camera_from_table, camera.camera_from_table);
  EXPECT_EQ(again.camera_from_table_m, camera.camera_from_table_m);
  write_camera(again, folder / "e.json");
  EXPECT_EQ(content(folder / "d.json"), content(folder / "e.json"));
}

// Its transpose taken for its inverse, this one put a point 0.2 m off axis 0.1 px elsewhere.
TEST(CameraFile, OfARotationWithThreeDigitsLooksBackAlongItsOwnRays) {
  const TestFolder folder;
  const Camera camera = read_camera(folder.write(
      "c.json", with("[0, -1, 0], [0, 0, -1]", "[0, -0.940, -0.342], [0, 0.342, -0.940]")));
  const Eigen::Vector3d point_m(0.2, 0.1, 0.0);
  const Eigen::Vector3d back_m =
      camera.table_from_image(camera.image_from_table(point_m), point_m.z());
  EXPECT_LT((back_m - point_m).norm(), 1e-12);
}

TEST(CameraFile, KeepsAnOrthographicCameraOrthographic) {
  const TestFolder folder;
  write_camera(Camera::from_scale(640, 480, 2000.0), folder / "c.json");
  EXPECT_EQ(read_camera(folder / "c.json").projection, Camera::Projection::orthographic);
}

TEST(CameraFile, KeepsThatItsMetresGoByABody) {
  const TestFolder folder;
  Camera camera = Camera::overhead(640, 480, 1000.0, 1.2);
  for (const bool by_radius : {false, true}) {
    camera.metres_by_radius = by_radius;
    write_camera(camera, folder / "c.json");
    EXPECT_EQ(read_camera(folder / "c.json").metres_by_radius, by_radius);
  }
}

struct RefusedCamera {
  const char* name;
  std::string text;
  const char* reason;
};
class CameraRefusal : public testing::TestWithParam<RefusedCamera> {};

TEST_P(CameraRefusal, NamesFileAndKey) {
  const TestFolder folder;
  const auto path = folder.write("bad.json", GetParam().text);
  const std::string message = refusal([&] { static_cast<void>(read_camera(path)); });
  EXPECT_EQ(message.rfind(path.string(), 0), 0u) << message;
  EXPECT_NE(message.find(GetParam().reason), std::string::npos) << message;
}

INSTANTIATE_TEST_SUITE_P(
    Files, CameraRefusal,
    testing::Values(
        RefusedCamera{"Empty", "", "empty"}, RefusedCamera{"NotJson", "width = 3", "not JSON"},
        RefusedCamera{"Missing", with("\"fx\"", "\"gx\""), "key \"fx\" is missing"},
        RefusedCamera{"TwoFocalLengths", with("\"fx\"", "\"fx\": 900, \"fx\""),
                      "key \"fx\" is there twice"},
        RefusedCamera{"ZeroFocalLength", with("1180.0", "0"), "\"fx\" = 0 must be greater than 0"},
        RefusedCamera{"WordForNumber", with("406.3", "\"middle\""),
                      "\"cx\" must be a finite number"},
        RefusedCamera{"NoPixels", with("800", "0"), "\"width\""},
        RefusedCamera{"HalfPixels", with("800", "800.5"), "\"width\""},
        RefusedCamera{"ShortDistortion", with("-0.24, ", ""), "list of 5"},
        RefusedCamera{"Mirrored", with("[0, -1, 0]", "[0, 1, 0]"), "no rotation"},
        RefusedCamera{"Stretched", with("[1, 0, 0]", "[2, 0, 0]"), "no rotation"},
        RefusedCamera{"ShortRow", with("[1, 0, 0]", "[1, 0]"), "list of 3"},
        RefusedCamera{"UnknownCurve", with("\"linear\"", "\"log\""),
                      "\"transfer\" must be sRGB or linear"},
        RefusedCamera{"UnknownMetres", with("\"linear\"", "\"linear\", \"metres_by\": \"eye\""),
                      "\"metres_by\" must be calibration or body_radius"},
        RefusedCamera{"CentreFarOutside", with("406.3", "1e6"),
                      "\"cx\" = 1000000 lies so far outside a picture of 800 px"},
        RefusedCamera{"BelowTheFloor", with("0.62", "-0.62"), "above the floor"},
        RefusedCamera{"FocalLengthInMillimetres", with("1180.0", "4.5"),
                      "\"fx\" = 4.5 must be the focal length in pixels"},
        RefusedCamera{"LooksUp", looking_up(), "looks up"},
        RefusedCamera{"UncertainOfWhat", uncertain(R"({"of": ["f"], "matrix": [[1]]})"),
                      "\"f\" is none of fx, fy"},
        RefusedCamera{"UncertainTwice",
                      uncertain(R"({"of": ["fx", "fx"], "matrix": [[1, 0], [0, 1]]})"),
                      "named twice"},
        RefusedCamera{"UncertainByALine", uncertain(R"({"of": ["fx"], "matrix": [1]})"),
                      "list of 1"},
        RefusedCamera{"UncertainByTooFewRows",
                      uncertain(R"({"of": ["fx", "fy"], "matrix": [[1, 0]]})"), "must have 2 rows"},
        RefusedCamera{"UncertainByLessThanNothing",
                      uncertain(R"({"of": ["fx", "fy"], "matrix": [[1, 2], [2, 1]]})"),
                      "no covariance"},
        RefusedCamera{"LongShutter", with("0.25", "2.5"), "0..1"},
        RefusedCamera{"NoRate", with("\"fps\": 120", "\"fps\": 0"), "\"fps\" = 0"}),
    [](const auto& instance) { return instance.param.name; });

// The rendered recordings print truth with five digits after the point in pixels; metres with
// eight, which is 2e-5 px at the largest scale (2300 px / 0.83 m).
constexpr double kPrinted_px = 1e-4;

void expect_truth_projected(const std::filesystem::path& folder) {
  const Camera camera = read_camera(folder / "camera.json");
  const Table truth = read_table(folder / "truth.csv");
  const auto x = truth.column("x_m"), y = truth.column("y_m"), z = truth.column("z_m");
  const auto x_px = truth.column("x_px"), y_px = truth.column("y_px");
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Eigen::Vector2d image = camera.image_from_table(Eigen::Vector3d(x(i), y(i), z(i)));
    ASSERT_LT((image - Eigen::Vector2d(x_px(i), y_px(i))).norm(), kPrinted_px)
        << folder << " " << i;
    const Eigen::Vector3d back = camera.table_from_image(image, z(i));
    ASSERT_LT((back - Eigen::Vector3d(x(i), y(i), z(i))).norm(), 1e-12);
  }
}

TEST(CameraFile, OfTheSamplesProjectsTheTruthOntoItsPixels) {
  const auto samples = std::filesystem::path(TROCHOID_SOURCE_DIR) / "data/samples";
  expect_truth_projected(samples / "s1_disc_paper");
  expect_truth_projected(samples / "s5_top_marker");
}

TEST(CameraFile, OfATiltedDistortedCameraProjectsTheTruthOntoItsPixels) {
  const auto folder =
      std::filesystem::path(TROCHOID_SHARED_DIR) / "recordings/rendered/s3_disc_marker_tilted";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no larger recordings beside the sources";
  expect_truth_projected(folder);
}

}  // namespace
}  // namespace trochoid::data
