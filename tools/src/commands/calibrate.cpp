#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>

#include "commands.hpp"
#include "commands/body_camera.hpp"
#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
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

// Pictures with the board found in them, all of one size and taken with the camera held one way.
struct Views {
  std::vector<tracking::BoardView> found;
  std::vector<cv::Mat> pictures;  ///< of `found`
  cv::Size size;
  std::string floor;  ///< the one of the floor, by its name in `found`; empty: not said
  std::string first;  ///< file that shows the floor if none is said to
  int looked_at = 0;
  std::string other_board;  ///< what is seen of one that was not looked for, in words
  std::optional<int> orientation;

  // Turned upright, pictures taken with the camera the other way up are another camera's: its
  // principal point is mirrored.
  void held_alike(int one, const std::string& name) {
    if (orientation.value_or(one) != one)
      throw InputError(
          fmt::format("{}: the camera was held another way than for the pictures before it (Exif "
                      "orientation {} after {}); take them alike, or remove what they say of it",
                      name, one, *orientation));
    orientation = one;
  }

  void look(const cv::Mat& luma, const std::string& name, const tracking::BoardPattern& pattern) {
    if (looked_at++ == 0) size = luma.size();
    if (luma.size() != size)
      throw InputError(
          fmt::format("{} is {} x {}, the pictures before it {} x {}; one camera has "
                      "one size",
                      name, luma.cols, luma.rows, size.width, size.height));
    if (auto view = tracking::find_board(luma, pattern, name)) {
      found.push_back(std::move(*view));
      pictures.push_back(luma);
    } else if (other_board.empty() && !pattern.marker_m) {
      const auto seen = tracking::chessboard_in(luma, pattern);
      if (seen && *seen != cv::Size(pattern.columns, pattern.rows))
        other_board =
            fmt::format("the board in {} has {}x{} inner corners", name, seen->width, seen->height);
    }
  }
};

// A picture, or a video: that shows the board in hundreds of frames, so two per second are looked
// at, and of those found only the ones where it has moved.
void look_into(const fs::path& path, const tracking::BoardPattern& pattern, Views& views) {
  constexpr double kEvery_s = 0.5, kMoved = 0.03;
  constexpr std::size_t kMost = 40;
  const auto source = tracking::open_video(path);
  views.held_alike(source->info().orientation, path.string());
  auto frame = source->next(), following = source->next();
  if (!following) return views.look(frame->luma, path.string(), pattern);
  double next_s = 0.0;
  const std::size_t first = views.found.size();
  for (; frame; frame = std::exchange(following, following ? source->next() : std::nullopt)) {
    if (frame->t_s < next_s) continue;
    next_s = frame->t_s + kEvery_s;
    const std::size_t before = views.found.size();
    views.look(frame->luma, fmt::format("{} frame {}", path.string(), frame->index), pattern);
    if (before == first || views.found.size() == before) continue;
    const auto &a = views.found[before - 1].image_px, &b = views.found[before].image_px;
    double moved = 0.0;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
      moved += (a[i] - b[i]).norm() / static_cast<double>(std::min(a.size(), b.size()));
    if (moved < kMoved * frame->luma.cols) views.found.pop_back(), views.pictures.pop_back();
    if (views.found.size() - first >= kMost) break;
  }
}

// Pictures and videos, those of folders and patterns one by one.
std::vector<fs::path> inputs_of(const CalibrateOptions& options) {
  std::vector<fs::path> files;
  for (const fs::path& input : options.inputs) {
    const std::vector<fs::path> some = fs::is_directory(input)
                                           ? tracking::pictures_in(input)
                                           : tracking::files_of_recording(input);
    files.insert(files.end(), some.begin(), some.end());
  }
  for (const fs::path& file : files)
    if (!fs::exists(file)) throw InputError(fmt::format("{}: no such file", file.string()));
  return files;
}

// What --floor names: a file, be it called otherwise among the inputs, or one of these by its name
// alone; as it is if neither, such as a picture of a video.
fs::path floor_among(const std::vector<fs::path>& files, const fs::path& floor) {
  std::error_code ignored;
  const auto among = [&](const auto& is_it) {
    const auto at = std::find_if(files.begin(), files.end(), is_it);
    return at == files.end() ? floor : *at;
  };
  if (fs::is_regular_file(floor, ignored))
    return among([&](const fs::path& file) { return fs::equivalent(file, floor, ignored); });
  return among([&](const fs::path& file) { return file.filename() == floor; });
}

// All pictures and videos, that of the floor first if it is one.
std::vector<fs::path> files_of(const CalibrateOptions& options) {
  std::vector<fs::path> files = inputs_of(options);
  const fs::path floor = floor_among(files, options.floor);
  std::error_code ignored;
  const auto at = std::find(files.begin(), files.end(), floor);
  if (at != files.end())
    std::rotate(files.begin(), at, at + 1);
  else if (fs::is_regular_file(floor, ignored))
    files.insert(files.begin(), floor);
  return files;
}

// The same picture under two names tells nothing twice.
std::vector<fs::path> each_once(const std::vector<fs::path>& files) {
  std::vector<fs::path> chosen;
  std::map<std::string, fs::path> by_checksum;
  for (const fs::path& file : files) {
    const auto [same, fresh] = by_checksum.emplace(data::sha256_of_file(file), file);
    if (fresh)
      chosen.push_back(file);
    else
      note(fmt::format("{}: is the same picture as {} and counts once", file.string(),
                       same->second.string()));
  }
  return chosen;
}

Views look_at_inputs(const CalibrateOptions& options, const tracking::BoardPattern& pattern) {
  Views views;
  Progress progress("calibrate", "files");
  std::vector<fs::path> files = each_once(files_of(options));
  views.floor = floor_among(files, options.floor).string();
  views.first = files.front().string();
  // The boards say what size pictures have.
  if (files.front() == views.floor) std::rotate(files.begin(), files.begin() + 1, files.end());
  for (std::size_t i = 0; i < files.size(); ++i) {
    look_into(files[i], pattern, views);
    progress.update(static_cast<std::int64_t>(i + 1), static_cast<std::int64_t>(files.size()));
  }
  if (views.found.size() < 3) {
    const bool in_all = static_cast<int>(views.found.size()) == views.looked_at;
    throw InputError(
        fmt::format("the board ({} of {:g} mm) is whole in {} of {} pictures; three are needed{}",
                    options.pattern, options.square_mm, views.found.size(), views.looked_at,
                    in_all                       ? ", tilted in different directions"
                    : !views.other_board.empty() ? "; " + views.other_board
                    : pattern.marker_m           ? ". Is --pattern the number of squares?"
                                                 : ". Is --pattern the number of inner corners?"));
  }
  return views;
}

std::string told(const tracking::LeftOut& out, const std::string& name) {
  const std::size_t corners = out.corners_px.size();
  if (corners > 0)
    return fmt::format("{}: {} contradict{} the rest and {} left out, at ({:.0f}, {:.0f}) px{}",
                       name, corners == 1 ? "a corner" : fmt::format("{} corners", corners),
                       corners == 1 ? "s" : "", corners == 1 ? "is" : "are", out.corners_px[0].x(),
                       out.corners_px[0].y(), corners > 1 ? " and more" : "");
  return fmt::format(
      "{}: contradicts the other pictures{} and is left out; is it the same board, flat and sharp?",
      name, std::isfinite(out.rms_px) ? fmt::format(" (rms {:.2f} px)", out.rms_px) : "");
}

// What contradicts the rest is told, and wrong corners are gone from their views.
void set_aside(const tracking::Calibration& result, Views& views) {
  for (const tracking::LeftOut& out : result.left_out) {
    tracking::BoardView& view = views.found[out.view];
    note(told(out, view.name));
    for (const Eigen::Vector2d& corner : out.corners_px) {
      const auto at = std::find(view.image_px.begin(), view.image_px.end(), corner);
      view.board_m.erase(view.board_m.begin() + (at - view.image_px.begin()));
      view.image_px.erase(at);
    }
  }
}

bool is_left_out(const tracking::Calibration& result, std::size_t view) {
  return std::any_of(result.left_out.begin(), result.left_out.end(), [view](const auto& out) {
    return out.view == view && out.corners_px.empty();
  });
}

std::size_t worst_view(const tracking::Calibration& result) {
  std::size_t worst = 0;
  double worst_px = -1.0;
  for (std::size_t i = 0; i < result.view_rms_px.size(); ++i)
    if (!is_left_out(result, i) && result.view_rms_px[i] > worst_px)
      worst = i, worst_px = result.view_rms_px[i];
  return worst;
}

std::size_t floor_view(const CalibrateOptions& options, const Views& views) {
  if (options.floor.empty()) {
    if (views.found.front().name.starts_with(views.first)) return 0;
    throw InputError(fmt::format(
        "{}: the board is not seen whole in this, the first picture, which is taken for "
        "that of the floor; name another with --floor",
        views.first));
  }
  for (std::size_t i = 0; i < views.found.size(); ++i)
    if (views.found[i].name == views.floor) return i;
  std::error_code ignored;
  throw InputError(
      fmt::format("--floor {}: {}", options.floor,
                  fs::exists(views.floor, ignored)
                      ? "the board is not seen whole in it"
                      : "no such picture; give a file, or the name of one among the pictures"));
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
std::string place_floor(const CalibrateOptions& options, const Views& views,
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
  const tracking::BoardView& view = views.found[floor_view(options, views)];
  const double rms =
      tracking::set_floor(camera, {view.board_m, view.image_px}, height_m, result.rms_px);
  return fmt::format(
      "floor: the board in {}, rms {:.3f} px{}; origin in its middle, x along its rows", view.name,
      rms, options.floor.empty() ? " (the first picture; choose another with --floor)" : "");
}

// The corners found and, twenty times enlarged, how far the camera puts them elsewhere.
void draw_check(const CalibrateOptions& options, const Views& views, data::Camera camera) {
  constexpr double kEnlarged = 20.0;
  const std::size_t shown = floor_view(options, views);
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

void tell(const CalibrateOptions& options, const Views& views, const tracking::Calibration& result,
          const std::string& floor) {
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
  std::vector<fs::path> inputs = files_of(options);
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
  Views views = look_at_inputs(options, pattern);
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
  if (on_board && is_left_out(result, floor_view(options, views)))
    throw NotGood(
        fmt::format("{}: contradicts the other pictures, and the floor is taken from it; name "
                    "another with --floor",
                    views.found[floor_view(options, views)].name));
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
