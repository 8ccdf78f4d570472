#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "commands.hpp"
#include "common/comparison_table.hpp"
#include "common/fit_job.hpp"
#include "common/odd_units.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/provenance.hpp"
#include "common/scene_library.hpp"
#include "common/timing.hpp"
#include "common/validators.hpp"
#include "common/value_words.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/moment.hpp"
#include "trochoid/fitting/fit.hpp"

// trochoid fit: tracks and a scene in, fit.json and a table of parameters out. No physics here.
namespace trochoid::tools {
namespace {

struct FitCommand {
  std::vector<std::string> tracks;
  std::string scene, output;
  std::optional<int> object;
  bool compare = false, json = false;
  fitting::FitOptions options;
};

std::string_view word(data::ParameterStatus status) {
  return status == data::ParameterStatus::free ? "fitted" : name(status);
}

void print_notes(const data::Fit& fit) {
  for (const std::string& warning : fit.warnings) fmt::print("  note: {}\n", warning);
  for (const data::BrokenDegeneracy& broken : fit.broken_degeneracies)
    fmt::print("  note: {}\n", broken.words);
}

void print(const data::Fit& fit) {
  fmt::print("model {}: {} ({}), start {}\n", fit.model, name(fit.outcome), fit.reason,
             fit.start_path);
  // Where no start led anywhere, there is nothing to count.
  if (fit.parameters.empty()) return print_notes(fit);
  if (fit.converged) fmt::print("  {}: {}\n", name(fit.verdict), fit.verdict_words);
  for (const data::FitParameter& p : fit.parameters)
    fmt::print("  {:<26} {:>28} {:<8} {:<8}{} {}\n", p.name, value_words(p.value, p.sigma),
               unit_words(p.unit), word(p.status), p.identifiable ? "" : " not identifiable;",
               p.note);
  fmt::print("  chi2 {:.6g} for {} degrees of freedom, noise x {:.3g}, whiteness p {:.2g}\n",
             fit.chi2, fit.dof, fit.noise_scale, fit.whiteness_p);
  fmt::print("  rank {} of {}, integration error {:.1e} sigma\n", fit.rank,
             fit.covariance_names.size(), fit.integration_error_sigma);
  for (const data::Profile& p : fit.profiles)
    fmt::print("  profile of {:<22} {:<9} 95 % {:.6g} .. {:.6g}\n", p.parameter, name(p.verdict),
               p.lower_95, p.upper_95);
  for (const data::BootstrapSpread& b : fit.bootstrap.parameters)
    fmt::print("  bootstrap of {:<20} ± {:.2g}  95 % {:.6g} .. {:.6g}\n", b.parameter, b.sigma,
               b.lower_95, b.upper_95);
  fmt::print("{}", comparison_table(fit.comparison));
  if (!fit.recommendation.empty()) fmt::print("  {}\n", fit.recommendation);
  print_notes(fit);
}

/// No fit is written over what its track was measured in, which is named without a folder.
void check_not_recording(const std::filesystem::path& output, const std::string& track,
                         const std::string& source) {
  std::error_code ignored;
  if (!source.empty() && output.filename() == source && std::filesystem::exists(output, ignored))
    throw InputError(fmt::format("{}: {} was tracked in a recording of this name; name another",
                                 output.string(), track));
}

/// The camera file by which a track's metres go, as its header names it; empty: none.
std::string camera_file_of(const data::TrackFile& file) {
  const std::string name = file.camera.substr(0, file.camera.find(':'));
  return name.ends_with(".json") ? name : "";
}

/// @param inputs  the files read.
/// @param remarks  what they note about their tracks.
/// @param cameras  of the tracks that were measured with one: what a scene without it leaves out.
std::vector<data::Track> read_tracks(const FitCommand& command, Checksums& inputs,
                                     std::vector<std::string>& remarks,
                                     std::vector<std::string>& cameras) {
  std::vector<data::Track> tracks;
  for (const std::string& path : command.tracks) {
    const data::TrackFile file = data::read_track(path);
    std::set<int> objects;
    for (const data::Track& track : file.tracks) objects.insert(track.object);
    for (const std::string& line : file.notes) remarks.push_back(path + ": " + line);
    if (const std::string camera = camera_file_of(file); !camera.empty())
      cameras.push_back(fmt::format(
          "{}: was measured with {}, which no scene names under [camera] file: what its "
          "calibration leaves uncertain is in no error bar",
          path, camera));
    add_track(inputs, path);
    add_recording(inputs, file.source, file.source_sha256, path);
    check_not_recording(command.output, path, file.source);
    const std::size_t before = tracks.size();
    for (const data::Track& track : file.tracks)
      if (!command.object || track.object == *command.object) {
        tell_odd_units(path, track);
        tracks.push_back(track);
      }
    if (tracks.size() == before)
      throw InputError(fmt::format("--object {}: no such number in {}, only {}",
                                   command.object.value_or(0), path, fmt::join(objects, ", ")));
  }
  return tracks;
}

data::Fit fitted(const FitCommand& command, const std::vector<data::Track>& tracks,
                 const data::Scene& scene) {
  fitting::FitOptions options = command.options;
  Progress progress("fit");
  if (talk() == Talk::verbose)
    options.log = detail;
  else
    options.progress = [&progress](const std::string& stage) { progress.update(stage); };
  return of_tracks(fmt::format("{}", fmt::join(command.tracks, ", ")), [&] {
    return in_scene(command.scene,
                    [&] { return fit_job(tracks, scene, options, command.compare); });
  });
}

/// What could explain a track that the fit does not.
std::string advice(const data::Fit& fit, const data::Scene& scene,
                   const fitting::FitOptions& options) {
  if (fit.outcome != data::FitOutcome::unexplained) return "";
  std::string words;
  if (fit.model.starts_with("top") && !scene.fit.free_pivot && !options.free_pivot)
    words += fmt::format("; the pivot was taken to be {}, --free-pivot fits it",
                         scene.support.pivot_m ? "where the scene has it" : "at x = y = 0");
  if (fit.comparison.empty()) words += "; --compare tries what the model lacks";
  return words;
}

void run(const FitCommand& command) {
  const Stopwatch watch;
  std::vector<std::filesystem::path> read(command.tracks.begin(), command.tracks.end());
  read.emplace_back(command.scene);
  check_outputs({command.output, timing_file(command.output)}, read);
  static_cast<void>(data::parse_window(command.options.from, command.options.to));
  Checksums inputs;
  std::vector<std::string> remarks, cameras;
  const std::vector<data::Track> tracks = read_tracks(command, inputs, remarks, cameras);
  data::Scene scene;
  if (!command.scene.empty()) {
    scene = load_scene(command.scene);
    add_scene(inputs, command.scene, scene);
  } else if (command.options.model.empty()) {
    throw InputError("give --scene scene.toml, or --model top (the only one that needs no body)");
  }
  data::Fit fit = fitted(command, tracks, scene);
  fit.inputs = std::move(inputs);
  if (!command.output.empty()) {
    data::write_fit(fit, command.output);
    write_timing(command.output, {{"command", "fit"},
                                  {"seconds", watch.seconds()},
                                  {"models", std::max<std::size_t>(1, fit.comparison.size())}});
  }
  if (command.json)
    fmt::print("{}", data::fit_text(fit, "fit"));
  else
    print(fit);
  if (scene.camera.file.empty()) remarks.insert(remarks.end(), cameras.begin(), cameras.end());
  for (const std::string& line : remarks) note(line);
  if (!fit.converged)
    throw NotGood(
        fmt::format("the fit is not good: {}{}", fit.reason, advice(fit, scene, command.options)));
}

}  // namespace

void add_fit_command(CLI::App& app) {
  auto command = std::make_shared<FitCommand>();
  auto* fit = app.add_subcommand("fit", "Fit model parameters to one or more tracks of a body");
  fit->add_option("track", command->tracks,
                  "Track CSV files (docs/formats.md); t_s,x_m,y_m will do")
      ->required();
  fit->add_option("--scene,-s", command->scene,
                  "Scene file, or a bundled scene's name: body, model, priors");
  fit->add_option("--model,-m", command->options.model,
                  "Model to fit, instead of the scene's; auto (also where the scene names none): "
                  "compare those that make sense")
      ->check(fitted_model());
  fit->add_option("--output,-o", command->output, "Where to write the fit (JSON)");
  fit->add_option("--object", command->object,
                  "Fit only the body with this number in the column object")
      ->check(whole_number());
  fit->add_option("--from", command->options.from, "First moment: seconds (1.5) or a frame (f120)");
  fit->add_option("--to", command->options.to, "Last moment: seconds or a frame");
  fit->add_flag("--free-pivot", command->options.free_pivot,
                "Also fit where the pivot is, x and y (model top)");
  fit->add_flag("--compare", command->compare,
                "Try the models that make sense for the scene; fit the simplest that suffices");
  fit->add_flag("--profile", command->options.profile,
                "Also profile likelihoods of all parameters but places and angles at the start");
  fit->add_option(
         "--bootstrap", command->options.bootstrap,
         "Number of fits to residuals resampled in blocks, for the shape of the error bars [0]")
      ->check(whole_number_within(0, 100000));
  fit->add_option("--threads", command->options.threads,
                  "At most so many threads; 0: all cores [0]")
      ->check(whole_number());
  fit->add_option("--seed", command->options.seed, "Seed of everything random [1]")->check(seed());
  fit->add_flag("--json", command->json, "Print the fit as its file holds it (JSON)");
  fit->footer("Example: trochoid fit ring.track.csv --scene ring.toml -o ring.fit.json");
  fit->callback([command] { run(*command); });
}

}  // namespace trochoid::tools
