#include "commands/body_camera.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/scene_library.hpp"
#include "common/value_words.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/tracking/body_camera.hpp"

namespace trochoid::tools {
namespace {

void tell(const BodyCameraCommand& command, const tracking::BodyCamera& found) {
  const double sigma_scale = found.sigma_scale * found.scale_px_per_m,
               sigma_height_m = found.sigma_height * found.height_m;
  if (command.json)
    return print_json({{"camera", command.output.string()},
                       {"pictures", found.pictures},
                       {"rms_px", found.rms_px},
                       {"scale_px_per_m", found.scale_px_per_m},
                       {"sigma_scale_px_per_m", sigma_scale},
                       {"height_m", found.height_m},
                       {"sigma_height_m", sigma_height_m}});
  fmt::print("{}: camera by the body's outline in {} pictures, rms {:.2f} px\n",
             command.output.string(), found.pictures, found.rms_px);
  fmt::print("scale {} px/m on the floor, {} m above it{}\n",
             value_words(found.scale_px_per_m, sigma_scale),
             value_words(found.height_m, sigma_height_m),
             command.camera_height_mm > 0.0
                 ? ""
                 : "; a height taken by tape (--camera-height-mm) makes both better");
  fmt::print(
      "taken to look straight down, to about a degree, and its lens to be without distortion: "
      "pictures of a board would tell\n");
}

}  // namespace

void calibrate_by_body(const BodyCameraCommand& command) {
  check_outputs({command.output}, {command.video, command.scene});
  const data::Scene scene = data::read_scene(command.scene);
  in_scene(command.scene.string(), [&] { tracking::check_tells_a_camera(scene); });
  tracking::BodyCamera found;
  {
    Progress progress("calibrate", "%");
    tracking::BodyCameraOptions how;
    constexpr double kMm = 1e-3, kPercent = 100.0;
    if (command.camera_height_mm > 0.0) how.height_m = kMm * command.camera_height_mm;
    how.progress = [&](double share) {
      progress.update(static_cast<std::int64_t>(kPercent * share), 100);
    };
    found = tracking::camera_from_body(command.video, scene, how);
  }
  data::write_camera(found.camera, command.output);
  tell(command, found);
}

}  // namespace trochoid::tools
