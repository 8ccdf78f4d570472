#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "commands.hpp"
#include "commands/body_camera.hpp"
#include "common/calibrate_views.hpp"
#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/validators.hpp"
#include "draw/canvas.hpp"
#include "draw/encoded_file.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/tracking/calibration.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct CalibrateOptions {
  std::vector<fs::path> inputs;
  std::string pattern = "9x6", dictionary = "4X4_50", floor;
  double square_mm = 0.0, marker_mm = 0.0, floor_height_mm = 0.0, radius_mm = 0.0;
  fs::path floor_points, circle_points, output, picture, scene;
  double camera_height_mm = 0.0;
  bool json = false;
};

tracking::BoardPattern pattern_of(const CalibrateOptions& options) {
  tracking::BoardPattern pattern;
  char rest = 0;
  if (std::sscanf(options.pattern.c_str(), "%dx%d%c", &pattern.columns, &pattern.rows, &rest) != 2)
    throw InputError(fmt::format("--pattern {}: write columns x rows, e.g. 9x6", options.pattern));
  pattern.square_m = 1e-3 * options.square_mm;
  if (options.marker_mm > 0.0) pattern.marker_m = 1e-3 * options.marker_mm;
  pattern.dictionary = options.dictionary;
  return pattern;
}

std::size_t worst_view(const tracking::Calibration& result) {
  std::size_t worst = 0;
  double worst_px = -1.0;
  for (std::size_t i = 0; i < result.view_rms_px.size(); ++i)
    if (!is_left_out(result, i) && result.view_rms_px[i] > worst_px)
      worst = i, worst_px = result.view_rms_px[i];
  return worst;
}

std::vector<Eigen::Vector2d> points(const fs::path& path, const char* x, const char* y,
                                    Eigen::Index fewest) {
  const data::Table table = data::read_table(path);
  const Eigen::VectorXd u = table.column(x), v = table.column(y);
  if (u.size() < fewest)
    throw InputError(fmt::format("{}: {} point{}; at least {} are needed", path.string(), u.size(),
                                 u.size() == 1 ? "" : "s", fewest));
  if (!u.allFinite() || !v.allFinite())
    throw InputError(fmt::format("{}: a point lacks its {} or {}", path.string(), x, y));
  std::vector<Eigen::Vector2d> out;
  for (Eigen::Index i = 0; i < u.size(); ++i) out.emplace_back(u[i], v[i]);
  return out;
}

tracking::FloorPoints floor_points(const CalibrateOptions& options) {
  constexpr Eigen::Index kFewest = 4;
  return {points(options.floor_points, "x_m", "y_m", kFewest),
          points(options.floor_points, "x_px", "y_px", kFewest)};
}

std::vector<Eigen::Vector2d> circle_points(const CalibrateOptions& options) {
  constexpr Eigen::Index kFewest = 6;
  return points(options.circle_points, "x_px", "y_px", kFewest);
}

// The table frame from whatever says where the floor is; a sentence about it.
std::string place_floor(const CalibrateOptions& options, const BoardViews& views,
                        tracking::Calibration& result) {
  const double height_m = 1e-3 * options.floor_height_mm;
  data::Camera& camera = result.camera;
  if (!options.floor_points.empty()) {
    const tracking::FloorPoints floor = floor_points(options);
    const double rms = tracking::set_floor(camera, floor, height_m, result.rms_px);
    return fmt::format("floor from {} points, rms {:.3f} px", floor.table_m.size(), rms);
  }
  if (!options.circle_points.empty()) {
    const double rms = tracking::set_floor_from_circle(
        camera, circle_points(options), 1e-3 * options.radius_mm, height_m, result.rms_px);
    return fmt::format("floor from a circle, rms {:.3f} px", rms);
  }
  const tracking::BoardView& view = views.found[floor_view(options.floor, views)];
  const double rms =
      tracking::set_floor(camera, {view.board_m, view.image_px}, height_m, result.rms_px);
  return fmt::format(
      "floor: the board in {}, rms {:.3f} px{}; origin in its middle, x along its rows", view.name,
      rms, options.floor.empty() ? " (the first picture; choose another with --floor)" : "");
}

// The corners found and, twenty times enlarged, how far the camera puts them elsewhere.
void draw_check(const CalibrateOptions& options, const BoardViews& views, data::Camera camera) {
  constexpr double kEnlarged = 20.0;
  const std::size_t shown = floor_view(options.floor, views);
  const tracking::BoardView& view = views.found[shown];
  (void)tracking::set_floor(camera, {view.board_m, view.image_px}, 0.0);
  cv::Mat picture;
  cv::cvtColor(views.pictures[shown], picture, cv::COLOR_GRAY2BGR);
  for (std::size_t i = 0; i < view.image_px.size(); ++i) {
    const Eigen::Vector2d at = view.image_px[i];
    const Eigen::Vector2d there =
        camera.image_from_table<double>({view.board_m[i].x(), view.board_m[i].y(), 0.0});
    const Eigen::Vector2d tip = at + kEnlarged * (there - at);
    cv::circle(picture, cv::Point2d(at.x(), at.y()), 4, palette::blue, 1, cv::LINE_AA);
    cv::line(picture, cv::Point2d(at.x(), at.y()), cv::Point2d(tip.x(), tip.y()),
             palette::vermillion, 2, cv::LINE_AA);
  }
  cv::putText(picture, "residuals x 20", {12, picture.rows - 14}, cv::FONT_HERSHEY_SIMPLEX, 0.55,
              palette::vermillion, 1, cv::LINE_AA);
  write_picture(picture, options.picture);
}

nlohmann::json json_of(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json();
}

// Standard deviation of where a pixel's point of the floor is, the longer axis [m].
double floor_sigma_m(const data::Camera& camera, const Eigen::Vector2d& image_px) {
  constexpr double kPart = 1e-3;  // of a deviation, so that the distortion holds
  const Eigen::Vector3d here = camera.table_from_image(image_px);
  const auto deviations = camera.likely_deviations();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
  for (Eigen::Index k = 0; k < deviations.cols(); ++k) {
    const data::Camera moved = camera.moved(kPart * deviations.col(k));
    const Eigen::Vector2d off = (moved.table_from_image(image_px) - here).head<2>() / kPart;
    covariance += off * off.transpose();
  }
  return std::sqrt(covariance.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff());
}

// The same in the middle of the picture and at the worst of its corners that show the floor.
struct FloorSigma {
  std::optional<double> middle_m;  ///< nothing if no floor is seen there
  double worst_m = 0.0;
};

FloorSigma floor_sigma(const data::Camera& camera) {
  const Eigen::Vector2d size(camera.width_px - 1, camera.height_px - 1);
  FloorSigma out;
  for (const Eigen::Vector2d& share :
       {Eigen::Vector2d(0.5, 0.5), Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(1.0, 0.0),
        Eigen::Vector2d(0.0, 1.0), Eigen::Vector2d(1.0, 1.0)}) {
    try {
      const double here_m = floor_sigma_m(camera, size.cwiseProduct(share));
      if (share.x() == 0.5) out.middle_m = here_m;
      out.worst_m = std::max(out.worst_m, here_m);
    } catch (const NumericalError&) {  // above the horizon, or where the distortion does not hold
    }
  }
  return out;
}

void tell(const CalibrateOptions& options, const BoardViews& views,
          const tracking::Calibration& result, const std::string& floor) {
  const std::size_t worst = worst_view(result);
  const double worst_px = result.view_rms_px[worst];
  const std::string& worst_name = views.found[worst].name;
  std::vector<std::string> left_out;
  for (std::size_t i = 0; i < views.found.size(); ++i)
    if (is_left_out(result, i)) left_out.push_back(views.found[i].name);
  const data::Camera& c = result.camera;
  const Eigen::Vector3d at = c.position_m();
  const FloorSigma known = floor_sigma(c);
  if (options.json)
    return print_json({{"camera", options.output.string()},
                       {"views", views.found.size()},
                       {"pictures", views.looked_at},
                       {"rms_px", result.rms_px},
                       {"worst_view", worst_name},
                       {"worst_rms_px", worst_px},
                       {"left_out", left_out},
                       {"sigma_focal_px", result.sigma_focal_px},
                       {"sigma_centre_px", result.sigma_centre_px},
                       {"floor", floor},
                       {"floor_sigma_m", {json_of(known.middle_m), known.worst_m}},
                       {"camera_m", {at.x(), at.y(), at.z()}}});
  fmt::print(
      "{}: board found in {} of {} pictures{}, reprojection rms {:.3f} px (worst {:.3f} in {})\n",
      options.output.string(), views.found.size(), views.looked_at,
      left_out.empty() ? "" : fmt::format(", {} left out", left_out.size()), result.rms_px,
      worst_px, worst_name);
  fmt::print(
      "fx {:.2f} fy {:.2f} ± {:.2f} px, centre {:.2f}, {:.2f} ± {:.2f} px, k1 {:.4f} ± "
      "{:.4f}, k2 {:.4f}\n",
      c.fx, c.fy, result.sigma_focal_px, c.cx, c.cy, result.sigma_centre_px, c.distortion[0],
      result.sigma_k1, c.distortion[1]);
  fmt::print("{}; camera at {:.4f}, {:.4f}, {:.4f} m\n", floor, at.x(), at.y(), at.z());
  constexpr double kMm = 1e3;
  fmt::print(
      "a point of the floor is known to {}{:.2g} mm at the worst corner (lengths "
      "that were given taken as exact)\n",
      known.middle_m
          ? fmt::format("{:.2g} mm in the middle of the picture, ", kMm * *known.middle_m)
          : "",
      kMm * known.worst_m);
}

// Before the pictures, which take time to look at.
void check_points(const CalibrateOptions& options) {
  if (!options.floor_points.empty()) (void)floor_points(options);
  if (options.circle_points.empty()) return;
  (void)circle_points(options);
  if (!(options.radius_mm > 0.0))
    throw InputError("--circle-points needs --radius-mm, the radius of the circle");
}

void check_names(const CalibrateOptions& options) {
  std::vector<fs::path> inputs = board_files(options.inputs, options.floor);
  inputs.push_back(options.floor_points);
  inputs.push_back(options.circle_points);
  check_outputs({options.picture, options.output}, inputs);
  if (!options.picture.empty()) check_picture_name(options.picture);
}

void calibrate_by_scene(const CalibrateOptions& options) {
  if (options.inputs.size() > 1)
    throw InputError(fmt::format("with --scene one recording is looked at, not also {}",
                                 options.inputs[1].string()));
  calibrate_by_body({options.inputs.front(), options.scene, options.output,
                     options.camera_height_mm, options.json});
}

void run(const CalibrateOptions& options) {
  if (!options.scene.empty()) return calibrate_by_scene(options);
  if (!(options.square_mm > 0.0))
    throw InputError(
        "give --square-mm, the side of a square of the board, or --scene, whose body of known "
        "size tells the camera");
  check_names(options);
  check_points(options);
  const tracking::BoardPattern pattern = pattern_of(options);
  BoardViews views = look_at_inputs(options.inputs, options.floor, pattern);
  tracking::Calibration result = tracking::calibrate(views.found, views.size);
  set_aside(result, views);
  const std::string floor = place_floor(options, views, result);
  // The picture first, which may fail: an earlier camera is still there then.
  if (!options.picture.empty()) draw_check(options, views, result.camera);
  data::write_camera(result.camera, options.output);
  tell(options, views, result, floor);
  constexpr double kPoor_px = 1.0;
  if (result.rms_px > kPoor_px)
    throw NotGood(
        fmt::format("reprojection rms {:.2f} px is poor: a bent board, motion blur or "
                    "wrong corners",
                    result.rms_px));
  const bool on_board = options.floor_points.empty() && options.circle_points.empty();
  if (on_board && is_left_out(result, floor_view(options.floor, views)))
    throw NotGood(
        fmt::format("{}: contradicts the other pictures, and the floor is taken from it; name "
                    "another with --floor",
                    views.found[floor_view(options.floor, views)].name));
}

}  // namespace

void add_calibrate_command(CLI::App& app) {
  auto options = std::make_shared<CalibrateOptions>();
  CLI::App* command =
      app.add_subcommand("calibrate",
                         "Find a camera from pictures of a board, and the floor, or "
                         "from the recording of a body of known size");
  command
      ->add_option("inputs", options->inputs,
                   "Pictures of the board, a folder of them or a video; with --scene the recording")
      ->required();
  CLI::Option* pattern = command->add_option(
      "--pattern", options->pattern,
      "Columns x rows: inner corners of a chessboard, squares of a ChArUco board [9x6]");
  constexpr double kLeast_mm = 0.5, kMost_mm = 1000.0;  // no slip between millimetres and metres
  CLI::Option* square =
      command->add_option("--square-mm", options->square_mm, "Side of a square [mm]")
          ->check(number_within(kLeast_mm, kMost_mm));
  command
      ->add_option("--marker-mm", options->marker_mm,
                   "Side of a marker [mm]: the board is a ChArUco board")
      ->check(positive_number());
  command
      ->add_option("--dictionary", options->dictionary, "ArUco dictionary of the markers [4X4_50]")
      ->needs("--marker-mm");
  command->add_option(
      "--floor", options->floor,
      "Picture in which the board lies on the floor, one of the others or of its own "
      "[the first]");
  command
      ->add_option("--floor-height-mm", options->floor_height_mm,
                   "Height of that board, of the points or of the circle above the floor [mm, 0]")
      ->check(number_within(-1e5, 1e5).description(""));
  command
      ->add_option("--floor-points", options->floor_points,
                   "CSV with x_px, y_px, x_m, y_m of four or more points of the floor")
      ->excludes("--floor");
  command
      ->add_option("--circle-points", options->circle_points,
                   "CSV with x_px, y_px of points on the rim of a body at rest on its face")
      ->excludes("--floor")
      ->excludes("--floor-points");
  command->add_option("--radius-mm", options->radius_mm, "Radius of that rim [mm]")
      ->check(positive_number())
      ->needs("--circle-points");
  CLI::Option* picture =
      command->add_option("--picture", options->picture,
                          "Picture of the corners and their residuals to write (.png, .jpg)");
  command
      ->add_option("--scene", options->scene,
                   "Without a board: the scene of a recording with a disc or ring of known size on "
                   "the floor, under a camera that looks straight down")
      ->excludes(pattern)
      ->excludes(square)
      ->excludes(picture)
      ->excludes("--marker-mm")
      ->excludes("--floor")
      ->excludes("--floor-height-mm")
      ->excludes("--floor-points")
      ->excludes("--circle-points");
  command
      ->add_option("--camera-height-mm", options->camera_height_mm,
                   "Height of the lens above the floor, with --scene, taken as good to 2 % [mm]")
      ->check(number_within(10.0, 1e5))
      ->needs("--scene");
  command->add_option("-o,--output", options->output, "Camera file to write (JSON)")->required();
  add_json_flag(*command, options->json);
  command->footer(
      "Examples:\n  trochoid calibrate board/*.png --pattern 9x6 --square-mm 20 -o camera.json\n"
      "  trochoid calibrate ring.mp4 --scene ring.toml --camera-height-mm 800 -o camera.json");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
