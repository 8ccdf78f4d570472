#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/prediction.hpp"
#include "trochoid/data/fit.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"

namespace trochoid::tools {

/// What a report shows. Only the track is needed; every part that is absent leaves its section out.
struct ReportInput {
  std::string title;  ///< usually the recording's file name
  data::TrackFile tracks;
  std::optional<data::Fit> fit;
  std::string no_fit_reason;  ///< why there is none, one sentence
  std::optional<data::Scene> scene;
  int fit_track = 0;
  std::optional<std::filesystem::path> video;  ///< overlay mp4, embedded
  double video_rate_hz = 0.0;
  std::vector<double> video_t_s;  ///< moment of the recording each picture of the overlay shows
  std::int64_t frames = 0;        ///< of the recording within the tracked span, 0 = unknown
  std::string command;            ///< that makes this report again
  std::map<std::string, std::string> checksums;         ///< file name -> sha256
  std::vector<std::pair<std::string, double>> times_s;  ///< stage -> run time
};

/// The whole report as one HTML page that needs nothing else, not even a network.
/// @throws InputError if the embedded files cannot be read or the fit does not belong to the track.
[[nodiscard]] std::string make_report(const ReportInput& input);

/// The x-y path with equal axes as an SVG picture of its own, for papers.
[[nodiscard]] std::string make_path_svg(const ReportInput& input);

}  // namespace trochoid::tools
