#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "commands.hpp"
#include "common/json_summary.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/provenance.hpp"
#include "common/validators.hpp"
#include "report/report.hpp"
#include "report/run_folder.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

struct ReportOptions {
  std::string folder, track, fit, output, path_svg;
  std::optional<int> fit_track;
  bool json = false;
};

ReportInput inputs(const ReportOptions& options) {
  if (options.folder.empty() == options.track.empty())
    throw InputError("report: give either the folder of a run or --track (with --fit)");
  if (!options.folder.empty()) return read_run_folder(options.folder);
  ReportInput input;
  input.tracks = data::read_track(options.track);
  input.title = input.tracks.source.empty() ? options.track : input.tracks.source;
  add_checksum(input.checksums, options.track);
  if (!options.fit.empty()) {
    input.fit = data::read_fit(options.fit);
    check_made_from(*input.fit, options.fit, options.track);
    input.fit_track = place_in_fit(*input.fit, options.fit, input.tracks, options.fit_track);
    input.scene = scene_with_camera(*input.fit, options.fit);
  }
  return input;
}

void run(const ReportOptions& options) {
  check_outputs({options.output, options.path_svg}, {options.track, options.fit});
  if (const std::string ending = std::filesystem::path(options.output).extension().string();
      ending != ".html" && ending != ".htm")
    throw InputError(fmt::format("-o {}: the report is a page, name it .html", options.output));
  if (!options.path_svg.empty() && std::filesystem::path(options.path_svg).extension() != ".svg")
    throw InputError(fmt::format("--path-svg {}: the picture is drawn in lines, name it .svg",
                                 options.path_svg));
  const ReportInput input = inputs(options);
  const std::string html = make_report(input);
  data::write_text(html, options.output);
  if (!options.path_svg.empty()) data::write_text(make_path_svg(input), options.path_svg);
  if (options.json)
    print_json({{"report", options.output}, {"bytes", html.size()}});
  else
    note("wrote " + options.output);
}

}  // namespace

void add_report_command(CLI::App& app) {
  const auto options = std::make_shared<ReportOptions>();
  CLI::App* command = app.add_subcommand(
      "report", "Write one HTML page that shows a run and opens without a network");
  command->add_option("folder", options->folder, "Folder a run has made");
  command->add_option("--track", options->track, "Track CSV, instead of a folder");
  command->add_option("--fit", options->fit, "Fit JSON made from that track")->needs("--track");
  command
      ->add_option("--fit-track", options->fit_track,
                   "Place of this track among those fitted together (0 = first)")
      ->check(whole_number())
      ->needs("--fit");
  command->add_option("-o,--output", options->output, "Page to write, .html")->required();
  command->add_option("--path-svg", options->path_svg,
                      "Also write the path as a picture for papers (.svg)");
  add_json_flag(*command, options->json);
  command->footer("Example:\n  trochoid report ring.trochoid/ -o report.html");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
