#include <cmath>
#include <limits>

#include "files_for_tests.hpp"
#include "trochoid/data/given_keys.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/scene_error.hpp"

namespace trochoid::data {
namespace {

constexpr const char* kFullScene = R"(
[body]
kind = "ring"
radius_m = 0.030
inner_radius_m = 0.027
thickness_m = 0.008
mass_kg = 0.0337
I_kg_m2 = 1
Is_kg_m2 = 1.5
mark = { distance_m = 0.0285, size_m = 0.001, angle_deg = 90, faces = "both" }

[support]
kind = "floor"

[camera]
file = "camera.json"
readout_s = 0.01
frame_rate_hz = 240

[tracking]
objects = 2
at_px = [10, 20.5]
from = 0.5
to = "f120"

[model]
name = "rolling"
gravity_m_s2 = 9.80
air_linear_N_m_s = [2.5e-6, 2.5e-6, 1.5e-5]
friction = 0.3

[start]
theta_rad = 1.2566
w2_rad_s = 24.73
w3_rad_s = 4.42

[run]
until_s = 9.0
rate_hz = 120
tolerance = 1e-10
integrator = "cvode-bdf"

[fit]
free = ["air_linear_N_m_s", "theta_rad"]
prior = { mass_kg = [0.0337, 0.0001] }
fixed = { friction = 0.2 }
bounds = { theta_rad = [0.1, inf] }
free_pivot = true
)";

// It overrules the camera's file, so that it matters even where it is the usual one.
TEST(SceneFile, KeepsATransferCurveThatIsTheUsualOne) {
  const Scene said = parse_scene("[camera]\ntransfer = \"sRGB\"\n", "scene.toml");
  EXPECT_EQ(said.camera.transfer, Transfer::srgb);
  EXPECT_EQ(parse_scene(to_toml(said), "scene.toml").camera.transfer, Transfer::srgb);
  EXPECT_FALSE(parse_scene("[camera]\n", "scene.toml").camera.transfer);
}

TEST(SceneFile, GivesEveryValueItHolds) {
  const Scene scene = parse_scene(kFullScene, "ring.toml");
  ASSERT_TRUE(scene.body);
  EXPECT_EQ(scene.body->kind, BodyKind::ring);
  EXPECT_EQ(scene.body->inner_radius_m, 0.027);
  EXPECT_EQ(scene.body->I_kg_m2, 1.0);
  ASSERT_EQ(scene.body->marks.size(), 1u);
  EXPECT_NEAR(scene.body->marks[0].angle_rad, std::acos(0.0), 1e-15);
  EXPECT_TRUE(scene.body->marks[0].on_upper_face && scene.body->marks[0].on_lower_face);
  EXPECT_EQ(scene.camera.file, "camera.json");
  EXPECT_EQ(scene.camera.frame_rate_hz, 240.0);
  EXPECT_EQ(scene.tracking.objects, 2);
  EXPECT_EQ(scene.tracking.at_px, Eigen::Vector2d(10, 20.5));
  EXPECT_EQ(scene.tracking.from, "0.5");
  EXPECT_EQ(scene.tracking.to, "f120");
  EXPECT_EQ(scene.model.name, "rolling");
  EXPECT_EQ(scene.model.gravity_m_s2, 9.80);
  EXPECT_EQ(scene.model.air_linear_N_m_s, Eigen::Vector3d(2.5e-6, 2.5e-6, 1.5e-5));
  EXPECT_FALSE(scene.model.gap_viscosity_Pa_s);
  EXPECT_EQ(scene.start.w2_rad_s, 24.73);
  EXPECT_EQ(scene.run.integrator, "cvode-bdf");
  EXPECT_EQ(scene.fit.free.size(), 2u);
  EXPECT_EQ(scene.fit.prior.at("mass_kg").sigma, 0.0001);
  EXPECT_EQ(scene.fit.fixed.at("friction"), 0.2);
  EXPECT_TRUE(std::isinf(scene.fit.bounds.at("theta_rad").second));
  EXPECT_TRUE(scene.fit.free_pivot);
}

TEST(SceneFile, SurvivesBeingWrittenAndReadAgain) {
  const std::string once = to_toml(parse_scene(kFullScene, "ring.toml"));
  const Scene again = parse_scene(once, "again.toml");
  EXPECT_EQ(to_toml(again), once);
  EXPECT_EQ(again.body, parse_scene(kFullScene, "ring.toml").body);
}

// Every key holds a value other than the default once, so that none can be lost unnoticed.
constexpr const char* kEveryKey = R"([body]
kind = "top"
radius_m = 0.5
inner_radius_m = 0.25
thickness_m = 0.125
axle_radius_m = 0.0625
axle_above_m = 0.5
mass_kg = 2.0
I_kg_m2 = 1.0
Is_kg_m2 = 1.5
l_m = 0.25
[[body.mark]]
distance_m = 0.25
size_m = 0.125
angle_rad = 1.5
faces = "lower"

[support]
kind = "pivot"
pivot_m = [0.5, -0.25, 1.0]
slope_x = 0.0625
slope_y = -0.125

[camera]
scale_px_per_m = 100.0
height_m = 2.0
readout_s = 0.5
rows = 720.0
frame_rate_hz = 60.0
missing_frames = [80, 159, 159]
exposure_s = 0.25
transfer = "linear"

[tracking]
objects = 3
at_px = [1.5, 2.5]
from = "0.5"
to = "f9"

[model]
name = "top-euler"
gravity_m_s2 = 9.5
air_linear_N_m_s = [1.0, 2.0, 3.0]
air_quadratic_N_m_s2 = [1.0, 2.0, 3.5]
air_force_N_s_m = 0.5
gap_viscosity_Pa_s = 1.8e-05
friction = 0.25
slip_regularisation_m_s = 0.001
contact_radius_m = 0.0234375
rolling_friction_m = 0.0001
pivoting_friction_m = 0.0002
contour_friction_m = 0.0003
couple_regularisation_rad_s = 0.01
drag_transverse_N_m_s = 0.125
drag_spin_N_m_s = 0.25
drag_spin_dry_N_m = 0.015625
drag_spin_quadratic_N_m_s2 = 0.0078125
spin_down_dry_rad_s2 = 0.5
spin_down_weakening_s_rad = 0.375
spin_down_viscous_1_s = 0.75
spin_down_quadratic_1_rad = 0.0625
spin_down_imbalance_sin_rad_s2 = -0.03125
spin_down_imbalance_cos_rad_s2 = 0.046875

[start]
theta_rad = 0.5
phi_rad = 0.25
psi_rad = -0.5
w1_rad_s = 1.5
w2_rad_s = 2.5
omega_s_rad_s = 155.0
x_m = 0.1
y_m = 0.2
vx_m_s = 0.3
vy_m_s = 0.4
w_body_rad_s = [1.0, 1.5, 2.0]
moments_kg_m2 = [0.5, 0.25, 0.75]

[run]
until_s = 9.5
rate_hz = 120.0
tolerance = 1e-09
integrator = "taylor"
rim_switch = "impact"

[fit]
free = ["l_m", "I_kg_m2"]
prior = { "mass_kg" = [2.0, 0.5] }
fixed = { "Is_kg_m2" = 0.25 }
bounds = { "I_kg_m2" = [0.5, inf] }
free_pivot = true
free_scale = true
)";

TEST(SceneFile, WritesEveryKeyThatDiffersFromItsDefault) {
  const std::string all = kEveryKey;
  EXPECT_EQ(to_toml(parse_scene(all, "all.toml")), all);
}

TEST(SceneFile, TellsWhatItSaysOfMotion) {
  const Scene scene = parse_scene(
      "[body]\nradius_m = 0.03\n[model]\nfriction = 0.3\ngravity_m_s2 = 9.81\n[start]\npsi_rad = "
      "0\n[run]\nrate_hz = 50\n",
      "test");
  const std::vector<std::string> expected{"model.friction", "start.psi_rad", "run.rate_hz"};
  EXPECT_EQ(given_keys(scene), expected);
  EXPECT_TRUE(given_keys(Scene{}).empty());
}

TEST(SceneFile, MayBeEmptyOrHoldOnlyABody) {
  EXPECT_FALSE(parse_scene("", "s").body);
  EXPECT_EQ(to_toml(Scene{}), "");
  EXPECT_EQ(parse_scene("[body]\nradius_m = 1", "s").support.kind, SupportKind::floor);
}

TEST(SceneFile, TakesATopOrAPivotPositionForAHeldBody) {
  EXPECT_EQ(parse_scene("[body]\nkind = 'top'", "s").support.kind, SupportKind::pivot);
  EXPECT_EQ(parse_scene("[support]\npivot_m = [0, 0, 0]", "s").support.kind, SupportKind::pivot);
  Scene free_top = parse_scene("[body]\nkind = 'top'\n[support]\nkind = 'floor'", "s");
  EXPECT_EQ(parse_scene(to_toml(free_top), "s").support.kind, SupportKind::floor);
}

TEST(SceneFile, LooksForItsCameraBesideItself) {
  const TestFolder folder;
  const auto path = folder.write("s.toml", "[camera]\nfile = 'camera.json'\n");
  EXPECT_EQ(read_scene(path).camera.file, (folder / "camera.json").string());
  const auto absolute = folder.write("a.toml", "[camera]\nfile = '/somewhere/c.json'\n");
  EXPECT_EQ(read_scene(absolute).camera.file, "/somewhere/c.json");
}

TEST(SceneFile, OfTheSamplesAndTheirObjectFilesAgree) {
  for (const char* sample : {"s1_disc_paper", "s5_top_marker"}) {
    const auto folder = std::filesystem::path(TROCHOID_SOURCE_DIR) / "data/samples" / sample;
    const Scene scene = read_scene(folder / "scene.toml");
    const Scene object = read_object(folder / "object.json");
    EXPECT_EQ(scene.body, object.body) << sample;
    EXPECT_EQ(scene.support.kind, object.support.kind);
    EXPECT_EQ(scene.support.pivot_m, object.support.pivot_m);
    EXPECT_TRUE(std::filesystem::exists(scene.camera.file));
  }
}

struct RefusedScene {
  const char* name;
  std::string text;
  const char* place;
  const char* reason;
};
class SceneRefusal : public testing::TestWithParam<RefusedScene> {};

TEST_P(SceneRefusal, NamesFileLineAndReason) {
  const std::string message =
      refusal([] { static_cast<void>(parse_scene(GetParam().text, "s.toml")); });
  EXPECT_EQ(message.rfind(std::string("s.toml") + GetParam().place, 0), 0u) << message;
  EXPECT_NE(message.find(GetParam().reason), std::string::npos) << message;
}

INSTANTIATE_TEST_SUITE_P(
    Files, SceneRefusal,
    testing::Values(
        RefusedScene{"UnknownKey", "[body]\nradius_m = 1\nradus_m = 2",
                     ":3:", "'radus_m' is not a key of [body]; did you mean radius_m?"},
        RefusedScene{"KeyLikeNoOther", "[camera]\nlens = 1\n",
                     ":2:", "'lens' is not a key of [camera]; it has file, "},
        RefusedScene{"UnknownTable", "\n[bodi]\nradius_m = 1", ":2:", "did you mean body?"},
        RefusedScene{
            "UnknownMarkKey",
            "[body]\nradius_m = 1\n[[body.mark]]\ndistance_m = 0.5\nsize_m = 0.1\nface = 1",
            ":6:", "did you mean faces?"},
        RefusedScene{"KeyOutsideTables", "radius_m = 1",
                     ":1:", "'radius_m' stands outside of every table"},
        RefusedScene{"NegativeRadius", "[body]\nradius_m = -1",
                     ":2:", "radius_m = -1 must be in metres, greater than 0"},
        RefusedScene{"Millimetres", "[body]\nradius_m = 45", ":2:", "at most 10"},
        RefusedScene{"ZeroRadius", "[body]\nradius_m = 0", ":2:", "greater than 0"},
        RefusedScene{"NoRadius", "[body]\nkind = 'disc'", ":1:", "needs radius_m"},
        RefusedScene{"NaN", "[body]\nradius_m = nan", ":2:", "greater than 0"},
        RefusedScene{"Infinite", "[body]\nradius_m = inf", ":2:", "greater than 0"},
        RefusedScene{"TextForNumber", "[body]\nradius_m = '0.03'", ":2:", "must be a number"},
        RefusedScene{"BoolForNumber", "[body]\nradius_m = true", ":2:", "must be a number"},
        RefusedScene{"BoreTooLarge", "[body]\nkind = 'ring'\nradius_m = 1\ninner_radius_m = 1.5",
                     ":4:", "must not exceed"},
        RefusedScene{"RingWithoutBore", "[body]\nkind = 'ring'\nradius_m = 1",
                     ":1:", "inner_radius_m"},
        RefusedScene{"BorderOutside", "[body]\nradius_m = 1\nborder_radius_m = 1.5",
                     ":3:", "border_radius_m = 1.5 must lie between"},
        RefusedScene{"BorderInTheBore",
                     "[body]\nkind = 'ring'\nradius_m = 1\ninner_radius_m = 0.8\n"
                     "border_radius_m = 0.7",
                     ":5:", "between inner_radius_m = 0.8 and radius_m = 1"},
        RefusedScene{"AxleTooThick", "[body]\nradius_m = 1\naxle_radius_m = 1",
                     ":3:", "axle_radius_m = 1 must be smaller than radius_m = 1"},
        RefusedScene{"FirstFrameMissing", "[camera]\nmissing_frames = [5, 0]",
                     ":2:", "numbers of frames after the first"},
        RefusedScene{"PartOfAFrameMissing", "[camera]\nmissing_frames = [5.5]", ":2:", "whole"},
        RefusedScene{"OneMissingFrameAlone", "[camera]\nmissing_frames = 5",
                     ":2:", "missing_frames must be a list of"},
        RefusedScene{"TooManyObjects", "[tracking]\nobjects = 65", ":2:", "1..64"},
        RefusedScene{"UnknownKind", "[body]\nkind = 'rign'\nradius_m = 1",
                     ":2:", "did you mean ring?"},
        RefusedScene{"NumberForKind", "[body]\nkind = 3", ":2:", "one of disc, ring, top"},
        RefusedScene{"ZeroMass", "[body]\nradius_m = 1\nmass_kg = 0", ":3:", "mass_kg = 0"},
        RefusedScene{"MarkOutside", "[body]\nradius_m = 1\nmark = {distance_m = 2, size_m = 0.1}",
                     ":3:", "outside radius_m"},
        RefusedScene{"MarkInTheBore",
                     "[body]\nkind = 'ring'\nradius_m = 1\ninner_radius_m = 0.8\n"
                     "mark = {distance_m = 0.5, size_m = 0.1}",
                     ":5:", "into the bore"},
        RefusedScene{"HeightWithoutScale", "[camera]\nheight_m = 1.2",
                     ":2:", "height_m needs scale_px_per_m"},
        RefusedScene{"MarkWithoutSize", "[body]\nradius_m = 1\nmark = {distance_m = 0.2}",
                     ":3:", "size_m"},
        RefusedScene{"MarkNoTable", "[body]\nradius_m = 1\nmark = 3", ":3:", "must be a table"},
        RefusedScene{"TwoAngles",
                     "[body]\nradius_m = 1\nmark = {distance_m = 0.2, size_m = 0.1, angle_deg = 1, "
                     "angle_rad = 1}",
                     ":3:", "keep one"},
        RefusedScene{"BodyNoTable", "body = 3", ":1:", "must be a table"},
        RefusedScene{"PivotOnTheFloor", "[support]\nkind = 'floor'\npivot_m = [0,0,0]",
                     ":3:", "pivot"},
        RefusedScene{"ShortPivot", "[support]\npivot_m = [0,0]", ":2:", "three numbers"},
        RefusedScene{"WordsInPivot", "[support]\npivot_m = [0,0,'a']", ":2:", "must be a number"},
        RefusedScene{"SteepFloor", "[support]\nslope_x = 0.3", ":2:", "between -0.2 and 0.2"},
        RefusedScene{"FileAndScale", "[camera]\nfile = 'c.json'\nscale_px_per_m = 100",
                     ":3:", "keep one"},
        RefusedScene{"EmptyFile", "[camera]\nfile = ''", ":2:", "leave the key out"},
        RefusedScene{"NegativeReadout", "[camera]\nreadout_s = -0.1", ":2:", "0 or greater"},
        RefusedScene{"NoObjects", "[tracking]\nobjects = 0", ":2:", "1..64"},
        RefusedScene{"HalfObjects", "[tracking]\nobjects = 1.5", ":2:", "whole number"},
        RefusedScene{"BadFrom", "[tracking]\nfrom = 'soon'", ":2:", "seconds (1.5) or a frame"},
        RefusedScene{"BackwardWindow", "[tracking]\nto = 1\nfrom = 2.5",
                     ":3:", "[tracking] from = 2.5 lies after to = 1"},
        RefusedScene{"BackwardFrames", "[tracking]\nfrom = 'f9'\nto = 'f8'",
                     ":2:", "exchange them"},
        RefusedScene{"UnknownModel", "[model]\nname = 'roling'", ":2:", "did you mean rolling?"},
        RefusedScene{"NegativeFriction", "[model]\nfriction = -0.1", ":2:", "0 or greater"},
        RefusedScene{"ScalarDrag", "[model]\nair_linear_N_m_s = 1e-6", ":2:", "three numbers"},
        RefusedScene{"BothRates", "[start]\nw2_rad_s = 1\ndphi_rad_s = 2", ":3:", "same thing"},
        RefusedScene{"SpinTwice", "[start]\nomega_s_rad_s = 0.5\nw3_rad_s = 50",
                     ":3:", "same thing"},
        RefusedScene{"TiltBeyondPi", "[start]\ntheta_rad = 4", ":2:", "pi"},
        RefusedScene{"LooseTolerance", "[run]\ntolerance = 1", ":2:", "1e-15"},
        RefusedScene{"EndlessRun", "[run]\nuntil_s = 1e300", ":2:", "rows"},
        RefusedScene{"UnknownIntegrator", "[run]\nintegrator = 'rk4'", ":2:", "dop853"},
        RefusedScene{"PriorWithoutSigma", "[fit]\nprior = { mass_kg = 0.03 }",
                     ":2:", "prior.mass_kg must be [value, sigma]"},
        RefusedScene{"PriorSigmaZero", "[fit]\nprior = { mass_kg = [0.03, 0] }", ":2:", "fixed"},
        RefusedScene{"BoundsReversed", "[fit]\nbounds = { l_m = [2, 1] }", ":2:", "lower < upper"},
        RefusedScene{"FreeTwice", "[fit]\nfree = ['l_m', 'l_m']", ":2:", "twice"},
        RefusedScene{"FreeNothing", "[fit]\nfree = []", ":2:", "names nothing"},
        RefusedScene{"FreeAndFixed", "[fit]\nfree = ['l_m']\nfixed = { l_m = 1 }",
                     ":2:", "free names l_m, which fixed gives a value"},
        RefusedScene{"CoefficientOfAFixedTerm", "[fit]\nfree = ['air[1]']\nfixed = { air = 1 }",
                     ":2:", "keep one"},
        RefusedScene{"PriorAndFixed", "[fit]\nfixed = { l_m = 1 }\nprior = { l_m = [1, 0.1] }",
                     ":3:", "keep one"},
        RefusedScene{"BoundedAndFixed", "[fit]\nfixed = { l_m = 1 }\nbounds = { l_m = [0, 2] }",
                     ":3:", "keep one"},
        RefusedScene{"FreeNoList", "[fit]\nfree = 'l_m'", ":2:", "list of names"},
        RefusedScene{"DoubledKey", "[body]\nradius_m = 1\nradius_m = 2", ":3:", "not TOML"},
        RefusedScene{"NotToml", "[body\nradius_m = 1", ":1:", "not TOML"},
        RefusedScene{"Nul", std::string("[body]\nradius_m = \0", 18), ":2:", "not TOML"},
        RefusedScene{"BrokenUtf8", "[body]\nkind = \"\xff\xfe\"", ":2:", "not TOML"},
        RefusedScene{"LongUnknownKey", "[body]\n" + std::string(100000, 'a') + " = 1",
                     ":2:", "..."},
        RefusedScene{"DeepNesting", "[fit]\nfree = " + std::string(100000, '['),
                     ":2:", "not TOML"}),
    [](const auto& instance) { return instance.param.name; });

// Whoever made the text can say what its line stands for, without reading the message.
TEST(SceneFile, SaysOnWhichLineItIsWrongApartFromTheWords) {
  try {
    (void)parse_scene("[body]\nradius_m = 1\nradus_m = 2\n", "scene");
    FAIL() << "it is wrong";
  } catch (const SceneError& error) {
    EXPECT_EQ(error.line(), 3U);
    EXPECT_EQ(std::string(error.what()), "scene:3: " + error.words());
  }
}

TEST(SceneFile, MayHaveLinesThatEndInCarriageReturnsAlone) {
  const TestFolder folder;
  EXPECT_EQ(
      read_scene(folder.write("cr.toml", "# a disc\r[body]\rradius_m = 0.03\r")).body->radius_m,
      0.03);
}

}  // namespace
}  // namespace trochoid::data
