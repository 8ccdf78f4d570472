#include "commands/body_camera.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/scene_library.hpp"
#include "common/value_words.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

// A height by tape counts for more than what the outlines tell of it, whichever is wrong.
void doubt_the_tape(const BodyCameraCommand& command, const tracking::BodyCamera& found) {
  constexpr double kContradicts = 3.0;
  constexpr double kWidest = 0.4, kNarrowest = 5.0;  // half and twice of what most cameras have
  if (!(command.camera_height_mm > 0.0)) return;
  const double widths = found.camera.fx / std::max(found.camera.width_px, found.camera.height_px);
  if (found.apart_sigmas > kContradicts)
    note(fmt::format(
        "the outlines alone put the camera {:.3g} m above the floor ({:.3g} to {:.3g}), {:.1f} "
        "sigmas from --camera-height-mm; check that height (floor to lens), radius_m and "
        "thickness_m",
        found.own_height_m, found.own_height_m * std::exp(-found.sigma_own_height),
        found.own_height_m * std::exp(found.sigma_own_height), found.apart_sigmas));
  else if (widths < kWidest || widths > kNarrowest)
    note(fmt::format(
        "at --camera-height-mm {:g} the focal length is {:.2g} times the longer side of the "
        "picture, of most cameras 0.7 to 2.5; is it in mm, from floor to lens?",
        command.camera_height_mm, widths));
}

nlohmann::ordered_json summary(const BodyCameraCommand& command,
                               const tracking::BodyCamera& found) {
  nlohmann::ordered_json out{{"camera", command.output.string()},
                             {"pictures", found.pictures},
                             {"rms_px", found.rms_px},
                             {"scale_px_per_m", found.scale_px_per_m},
                             {"sigma_scale_px_per_m", found.sigma_scale * found.scale_px_per_m},
                             {"height_m", found.height_m},
                             {"sigma_height_m", found.sigma_height * found.height_m}};
  if (command.camera_height_mm > 0.0) {
    out["height_by_outlines_m"] = found.own_height_m;
    out["sigma_height_by_outlines_m"] = found.sigma_own_height * found.own_height_m;
  }
  return out;
}

void tell(const BodyCameraCommand& command, const tracking::BodyCamera& found) {
  doubt_the_tape(command, found);
  if (command.json) return print_json(summary(command, found));
  fmt::print("{}: camera by the body's outline in {} pictures, rms {:.2f} px\n",
             command.output.string(), found.pictures, found.rms_px);
  const bool by_tape = command.camera_height_mm > 0.0;
  fmt::print("{}{}\n", overhead_words(found.camera),
             by_tape ? "" : "; a height by tape (--camera-height-mm) makes both better");
  fmt::print(
      "taken to look straight down, to about a degree, and its lens to bend little (k1 0 ± 0.03): "
      "pictures of a board would tell\n");
}

}  // namespace

tracking::BodyCamera camera_by_body(const std::filesystem::path& video, const data::Scene& scene,
                                    double height_mm) {
  constexpr double kMm = 1e-3, kPercent = 100.0;
  Progress progress("calibrate", "%");
  tracking::BodyCameraOptions how;
  if (height_mm > 0.0) how.height_m = kMm * height_mm;
  how.progress = [&](double share) {
    progress.update(static_cast<std::int64_t>(kPercent * share), 100);
  };
  return tracking::camera_from_body(video, scene, how);
}

std::string overhead_words(const data::Camera& camera) {
  const auto scale = [&](const data::Camera& by) {
    const Eigen::Vector3d middle_m = by.table_from_image({by.cx, by.cy});
    return std::sqrt(std::abs(by.jacobian_px_per_m(middle_m).leftCols<2>().determinant()));
  };
  const double scale_px_per_m = scale(camera), height_m = camera.position_m().z();
  constexpr double kPart = 1e-3;  // of a deviation: as straight as it is there
  double scale_variance = 0.0, height_variance = 0.0;
  const auto deviations = camera.likely_deviations();
  for (const auto& deviation : deviations.colwise()) {
    const data::Camera moved = camera.moved(kPart * deviation);
    scale_variance += std::pow((scale(moved) - scale_px_per_m) / kPart, 2);
    height_variance += std::pow((moved.position_m().z() - height_m) / kPart, 2);
  }
  const double factor = std::exp(std::sqrt(height_variance) / height_m);
  return fmt::format("scale {} px/m on the floor, {:.3g} m above it ({:.3g} to {:.3g})",
                     value_words(scale_px_per_m, std::sqrt(scale_variance)), height_m,
                     height_m / factor, height_m * factor);
}

std::string way_to_a_camera(const data::Scene& scene) {
  if (!scene.camera.file.empty() || scene.camera.scale_px_per_m) return {};
  if (!(scene.body && scene.body->radius_m > 0.0)) return {};
  try {
    tracking::check_tells_a_camera(scene);
    return "`trochoid calibrate VIDEO --scene SCENE` may make a camera file from this very "
           "recording, if its camera looks straight down";
  } catch (const InputError& error) {
    return std::string("the body tells no camera: ") + error.what();
  }
}

void calibrate_by_body(const BodyCameraCommand& command) {
  // The camera that the scene names is not read, and may be the one that is made.
  check_outputs({command.output}, {command.video});
  if (std::error_code ignored; std::filesystem::equivalent(command.output, command.scene, ignored))
    throw InputError(
        fmt::format("{}: is read by this command; name another output", command.output.string()));
  const data::Scene scene = data::read_scene(command.scene);
  in_scene(command.scene.string(), [&] { tracking::check_tells_a_camera(scene); });
  const tracking::BodyCamera found = camera_by_body(command.video, scene, command.camera_height_mm);
  data::write_camera(found.camera, command.output);
  tell(command, found);
}

}  // namespace trochoid::tools
