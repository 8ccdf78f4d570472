#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.hpp"
#include "common/json_object.hpp"
#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/pending_folder.hpp"
#include "common/progress.hpp"
#include "common/render_targets.hpp"
#include "common/scene_library.hpp"
#include "common/validators.hpp"
#include "draw/encoded_file.hpp"
#include "draw/render_motion.hpp"
#include "draw/render_picture.hpp"
#include "draw/render_truth.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/model/simulate.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct RenderOptions {
  std::string scene;
  fs::path output, camera;
  double rate_hz = 0.0, until_s = 0.0;
  std::optional<int> width_px, height_px;  ///< of a camera that is no file's
  int quality = 14;
  double body = -1.0, floor = -1.0;  // brightness, instead of the style's colours
  std::optional<double> exposure;    // share of the frame interval, instead of the scene's
  bool no_shadow = false, lossless = false, json = false;
  RenderStyle style;
};

data::Camera camera_of(const RenderOptions& options, const data::Scene& scene,
                       const RenderedMotion& motion) {
  if (!options.camera.empty()) return data::read_camera(options.camera);
  if (!scene.camera.file.empty() && (options.width_px || options.height_px))
    throw InputError(
        fmt::format("{}: camera.file = '{}' says how large the pictures are; leave --width and "
                    "--height out, or "
                    "camera.file",
                    options.scene, scene.camera.file));
  constexpr int kWidth_px = 640, kHeight_px = 480;
  const int width_px = options.width_px.value_or(kWidth_px),
            height_px = options.height_px.value_or(kHeight_px);
  if (auto camera = data::camera_of(scene, width_px, height_px)) return *camera;
  return camera_over(motion, scene.body->radius_m, width_px, height_px);
}

void check_targets(const RenderOptions& options, const RenderTargets& targets) {
  if (named_as_folder(options.output)) check_folder(options.output);
  if (named_as_folder(options.output) && !fs::exists(options.output)) return;
  for (const fs::path& file : {targets.video, targets.truth, targets.camera, targets.object})
    check_output(file, {options.scene, options.camera});
  check_not_filmed(targets);
}

// As a share of the frame interval: by option, scene, camera file.
double exposure_of(const RenderOptions& options, const data::Scene& scene,
                   const data::Camera& camera) {
  if (options.exposure) return *options.exposure;
  if (!scene.camera.exposure_s)
    return camera.exposure_fraction.value_or(RenderStyle{}.exposure_fraction);
  constexpr double kRounding = 1e-3;
  const double share = *scene.camera.exposure_s * scene.run.rate_hz;
  if (share > 1.0 + kRounding)
    throw InputError(fmt::format(
        "{}: camera.exposure_s = {:g} is longer than a frame at {:g} frames per second; --exposure "
        "gives another",
        options.scene, *scene.camera.exposure_s, scene.run.rate_hz));
  return std::min(share, 1.0);
}

RenderStyle style_of(const RenderOptions& options, const data::Camera& camera) {
  RenderStyle style = options.style;
  style.exposure_fraction = *camera.exposure_fraction;
  style.shadow = !options.no_shadow;
  if (options.body >= 0.0) style.body.setConstant(static_cast<float>(options.body));
  if (options.floor >= 0.0) style.floor.setConstant(static_cast<float>(options.floor));
  return style;
}

// Containers keep times as whole ticks: frames that come faster share one, or are slowed down.
void check_rate(const std::string& scene, double rate_hz, const fs::path& video) {
  constexpr double kSlowest_Hz = 1e-3, kMp4Ticks_Hz = 1e6, kMatroskaTicks_Hz = 1e3;
  const std::string ending = video.extension().string();
  const double fastest_Hz = ending == ".mkv" ? kMatroskaTicks_Hz : kMp4Ticks_Hz;
  if (rate_hz < kSlowest_Hz || rate_hz > fastest_Hz)
    throw InputError(fmt::format(
        "{}: run.rate_hz (--rate) = {:g} frames per second do not go into an {} file; from {:g} to "
        "{:g} do",
        scene, rate_hz, ending, kSlowest_Hz, fastest_Hz));
}

// The scene with what the options set in it; run.rate_hz is the video's.
data::Scene scene_to_draw(const RenderOptions& options, const RenderTargets& targets) {
  data::Scene scene = load_scene(options.scene);
  if (!scene.body || !(scene.body->radius_m > 0.0))
    throw InputError(fmt::format("{}: [body] needs a radius_m to be seen", options.scene));
  if (options.rate_hz > 0.0) scene.run.rate_hz = options.rate_hz;
  if (options.until_s > 0.0) scene.run.until_s = options.until_s;
  constexpr double kMostFrames =
      data::Table::kMostRows / RenderedMotion::kPerFrame;  // hours of drawing
  check_rate(options.scene, scene.run.rate_hz, targets.video);
  check_length(options.scene, scene.run.until_s, scene.run.rate_hz, kMostFrames, "frames");
  return scene;
}

RenderedMotion simulated(const std::string& scene_name, data::Scene scene) {
  scene.run.rate_hz *= RenderedMotion::kPerFrame;
  const model::Trajectory run = in_scene(scene_name, [&] { return model::simulate(scene); });
  tell_idle_keys(scene_name, scene);
  if (run.values.rows() == 0)
    throw InputError(fmt::format("{}: the start leaves nothing to draw: {} Start elsewhere",
                                 scene_name, model::sentence(run.outcome)));
  return {run, scene.run.rate_hz};
}

// Rows read for longer than a frame lasts would still be read when the next one begins.
void check_readout(const std::string& file, const data::Camera& camera,
                   const RenderedMotion& motion) {
  const double readout_s = camera.readout_s.value_or(0.0);
  constexpr double kRounding = 1e-2;
  if (readout_s * *camera.frame_rate_hz > 1.0 + kRounding)
    throw InputError(
        fmt::format("{}: readout_s = {:g} is longer than a frame at {:g} frames per second", file,
                    readout_s, *camera.frame_rate_hz));
  if (readout_s > motion.end_s())
    throw InputError(
        fmt::format("{}: readout_s = {:g} is longer than the motion, which ends at {:.3g} s", file,
                    readout_s, motion.end_s()));
}

data::Camera recording_camera(const RenderOptions& options, const data::Scene& scene,
                              const RenderedMotion& motion) {
  data::Camera camera = camera_of(options, scene, motion);
  if (!options.lossless && (camera.width_px % 2 != 0 || camera.height_px % 2 != 0))
    throw InputError(fmt::format("{} x {} px: H.264 needs even numbers; or --lossless",
                                 camera.width_px, camera.height_px));
  camera.frame_rate_hz = scene.run.rate_hz;
  camera.exposure_fraction = exposure_of(options, scene, camera);
  const bool of_scene = scene.camera.readout_s > 0.0;
  if (of_scene) camera.readout_s = scene.camera.readout_s;
  check_readout(of_scene ? options.scene : camera.file, camera, motion);
  if (scene.camera.transfer) camera.transfer = *scene.camera.transfer;
  return camera;
}

// Poses spread over the time the shutter is open around t_s.
std::vector<data::Pose<>> exposed_poses(const RenderedMotion& motion, double t_s, double rate_hz,
                                        const RenderStyle& style) {
  std::vector<data::Pose<>> poses;
  for (int i = 0; i < style.times; ++i)
    poses.push_back(
        motion.at(t_s + ((i + 0.5) / style.times - 0.5) * style.exposure_fraction / rate_hz));
  return poses;
}

// When a row is read, after the first one.
double read_s(const data::Camera& camera, double row_px) {
  const double share = row_px / std::max(1, camera.height_px - 1);
  return camera.readout_s.value_or(0.0) * std::clamp(share, 0.0, 1.0);
}

// When the row that shows the body's centre is read, of a picture whose first one is read at t_s.
double centre_read_s(const RenderedMotion& motion, const data::Camera& camera, double t_s) {
  constexpr int kRounds = 20;  // each leaves of the error what the centre moves by while it is read
  double at_s = t_s;
  for (int round = 0; camera.readout_s && round < kRounds; ++round)
    at_s = t_s + read_s(camera, camera.image_from_table<double>(motion.at(at_s).centre_m).y());
  return at_s;
}

// The lamp flickers with the mains.
double brightness_at(double t_s, const RenderStyle& style) {
  return 1.0 + style.flicker * std::sin(data::kTurn * 100.0 * t_s);
}

// Of the picture whose first row is read at t_s, with the flicker of the light.
cv::Mat light_at(const PictureRenderer& renderer, const RenderedMotion& motion,
                 const data::Camera& camera, double t_s, const RenderStyle& style) {
  const auto exposed = [&](double at_s) {
    return exposed_poses(motion, at_s, *camera.frame_rate_hz, style);
  };
  if (!camera.readout_s) return renderer.light(exposed(t_s)) * brightness_at(t_s, style);
  const auto row_s = [&](double row_px) { return t_s + read_s(camera, row_px); };
  cv::Mat light = renderer.rolling_light([&](double row_px) { return exposed(row_s(row_px)); });
  for (int row = 0; row < light.rows; ++row) light.row(row) *= brightness_at(row_s(row), style);
  return light;
}

// What the whole will take, from its first pictures; nothing where that is no time to wait for.
void tell_cost(int done, int frames, const data::Camera& camera, double elapsed_s) {
  constexpr double kWorthTelling_s = 5.0;
  const double left_s = elapsed_s * (frames - done) / done;
  if (left_s > kWorthTelling_s)
    note(
        fmt::format("{} frames of {} x {} px, about {}; lower --rate, --until, --times or "
                    "--samples make that less",
                    frames, camera.width_px, camera.height_px, duration_words(left_s)));
}

// Draws every frame. @returns the table of the truth.
std::string draw(const RenderedMotion& motion, const data::Scene& scene, const data::Camera& camera,
                 const RenderStyle& style, int frames, EncodedFile& video) {
  const double rate_hz = scene.run.rate_hz;
  const PictureRenderer renderer(*scene.body, camera, style);
  std::string truth = kTruthHeader;
  Progress progress("render");
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  constexpr int kFirst = 8;  // they tell what one takes
  for (int frame = 0; frame < frames; ++frame) {
    const double t_s = frame / rate_hz;
    video.write(renderer.picture(light_at(renderer, motion, camera, t_s, style), frame));
    const double centre_s = centre_read_s(motion, camera, t_s);
    truth += truth_row(frame, centre_s, motion.at(centre_s), camera);
    progress.update(frame + 1, frames);
    if (frame + 1 == kFirst)
      tell_cost(kFirst, frames, camera,
                std::chrono::duration<double>(Clock::now() - start).count());
  }
  return truth;
}

// What the scene promises and the recording does not show.
void tell_unseen(const RenderedMotion& motion, const data::Scene& scene, const data::Camera& camera,
                 int frames) {
  const auto seen = [&](int frame) {
    return in_picture(motion.at(frame / scene.run.rate_hz), camera);
  };
  int outside = 0, first = -1;
  for (int frame = 0; frame < frames; ++frame)
    if (!seen(frame) && outside++ == 0) first = frame;
  if (outside > 0)
    note(fmt::format(
        "the body's centre is outside the picture in {} of {} frames, first at {:.3g} s", outside,
        frames, first / scene.run.rate_hz));
  if (motion.outcome() != model::Outcome::reached_end)
    note(fmt::format("the motion ends at {:.3g} s of {:g} s: {}", motion.end_s(), scene.run.until_s,
                     model::sentence(motion.outcome())));
  if (scene.tracking.objects > 1)
    note(fmt::format("one body is drawn; [tracking] objects = {} is for following a recording",
                     scene.tracking.objects));
  if (const auto& rate_hz = scene.camera.frame_rate_hz; rate_hz && *rate_hz != scene.run.rate_hz)
    note(fmt::format(
        "drawn at run.rate_hz = {:g}; [camera] frame_rate_hz = {:g} is for following a recording "
        "whose file has another, leave it out to follow this one",
        scene.run.rate_hz, *rate_hz));
}

void tell(const RenderOptions& options, const RenderTargets& targets, const data::Camera& camera,
          int frames) {
  if (options.json)
    return print_json({{"video", targets.video.string()},
                       {"truth", targets.truth.string()},
                       {"camera", targets.camera.string()},
                       {"object", targets.object.string()},
                       {"frames", frames},
                       {"frame_rate_hz", *camera.frame_rate_hz},
                       {"width_px", camera.width_px},
                       {"height_px", camera.height_px}});
  fmt::print("{}: {} frames of {} x {} at {:.6g} Hz, truth in {}\n", targets.video.string(), frames,
             camera.width_px, camera.height_px, *camera.frame_rate_hz, targets.truth.string());
}

// All files of the recording, whole.
void write_recording(const RenderOptions& options, const data::Scene& scene,
                     const RenderedMotion& motion, const data::Camera& camera, int frames,
                     const RenderTargets& targets) {
  EncodedFile video(targets.video, {camera.width_px, camera.height_px}, scene.run.rate_hz,
                    options.lossless ? coding::kLossless : coding::h264(options.quality));
  const std::string truth = draw(motion, scene, camera, style_of(options, camera), frames, video);
  video.finish();
  data::write_text(truth, targets.truth);
  data::write_camera(camera, targets.camera);
  data::write_text(json_text(object_of(scene, motion.model())) + "\n", targets.object);
  video.commit();
}

// A folder that was not there comes to be with all files in it or not at all.
void write_with_folder(const RenderOptions& options, const data::Scene& scene,
                       const RenderedMotion& motion, const data::Camera& camera, int frames,
                       const RenderTargets& targets) {
  const fs::path outermost = folder_to_make(options.output);
  if (outermost.empty()) return write_recording(options, scene, motion, camera, frames, targets);
  PendingFolder pending(outermost);
  const fs::path folder =
      (pending.path() / options.output.lexically_relative(outermost)).lexically_normal();
  pending.told_by_its_name([&] {
    make_folder(folder);
    write_recording(options, scene, motion, camera, frames, targets_in(folder, options.lossless));
  });
  pending.commit();
}

void run(const RenderOptions& options) {
  const RenderTargets targets = targets_of(options.output, options.lossless);
  check_targets(options, targets);
  const data::Scene scene = scene_to_draw(options, targets);
  const RenderedMotion motion = simulated(options.scene, scene);
  const data::Camera camera = recording_camera(options, scene, motion);
  const double last_s = motion.end_s() - camera.readout_s.value_or(0.0);
  const int frames =
      std::max(1, static_cast<int>(std::floor(last_s * scene.run.rate_hz + 1e-9)) + 1);
  write_with_folder(options, scene, motion, camera, frames, targets);
  tell_unseen(motion, scene, camera, frames);
  tell(options, targets, camera, frames);
}

void add_look_options(CLI::App& command, RenderOptions& options) {
  RenderStyle& style = options.style;
  command.add_option("--body", options.body, "Brightness of the body, 0..1")
      ->check(number_within(0.0, 1.0));
  command.add_option("--floor", options.floor, "Brightness of the floor, 0..1")
      ->check(number_within(0.0, 1.0));
  command
      .add_option("--texture", style.texture,
                  "Texture of the floor, relative standard deviation of its brightness [0.05]")
      ->check(number_within(0.0, 1.0));
  command.add_option("--gloss", style.gloss, "Strength of highlights on the body, 0: matt [0.1]")
      ->check(number_within(0.0, 10.0));
  command.add_flag("--no-shadow", options.no_shadow, "The body casts no shadow");
  command.add_option("--blur", style.blur_px, "Blur of the lens, standard deviation [px, 0.5]")
      ->check(number_within(0.0, 20.0));
  command
      .add_option("--noise", style.noise_levels,
                  "Noise of the camera, standard deviation [8-bit levels, 1]")
      ->check(number_within(0.0, 100.0));
  command
      .add_option(
          "--exposure", options.exposure,
          "Exposure time as a share of the frame interval [as the camera has it, else 0.25]")
      ->check(number_within(0.0, 1.0));
  command
      .add_option("--flicker", style.flicker,
                  "Flicker of the light at 100 Hz, relative amplitude [0]")
      ->check(number_within(0.0, 0.9));
  command.add_option("--samples", style.samples, "Rays across a pixel on an edge [8]")
      ->check(whole_number_within(1, 64));
  command.add_option("--times", style.times, "Moments averaged over the exposure [5]")
      ->check(whole_number_within(1, 64));
  command.add_option("--seed", style.seed, "Seed of texture and noise [1]")->check(seed());
}

}  // namespace

void add_render_command(CLI::App& app) {
  auto options = std::make_shared<RenderOptions>();
  CLI::App* command =
      app.add_subcommand("render", "Make a recording of a simulated scene, with its truth");
  command
      ->add_option("--scene,-s", options->scene,
                   "Scene file (TOML), or the name of a bundled scene")
      ->required();
  command
      ->add_option("-o,--output", options->output,
                   "Clip to write (.mp4, .mkv), or a folder for video.mp4, truth.csv, camera.json "
                   "and object.json")
      ->required()
      ->transform([](const std::string& name) {  // no folder is made that is left again
        return fs::path(name).lexically_normal().string();
      });
  CLI::Option* camera = command->add_option("--camera", options->camera,
                                            "Camera file [the scene's, else from above]");
  command
      ->add_option("--width", options->width_px,
                   "Width of the pictures [px, the camera file's, else 640]")
      ->check(whole_number_within(32, 8192))
      ->excludes(camera);
  command
      ->add_option("--height", options->height_px,
                   "Height of the pictures [px, the camera file's, else 480]")
      ->check(whole_number_within(32, 8192))
      ->excludes(camera);
  command->add_option("--rate", options->rate_hz, "Frame rate [Hz, the scene's run.rate_hz]")
      ->check(frame_rate());
  command->add_option("--until", options->until_s, "End time [s, the scene's run.until_s]")
      ->check(positive_number());
  command->add_option("--crf", options->quality, "H.264 quality, 0 best .. 51 [14]")
      ->check(whole_number_within(0, 51));
  command->add_flag("--lossless", options->lossless, "FFV1 instead of H.264 (needs .mkv)")
      ->excludes("--crf");
  add_look_options(*command, *options);
  add_json_flag(*command, options->json);
  command->footer(
      "Example: trochoid render --scene disc_rolling -o planned.mp4 --blur 1 --noise 2");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
