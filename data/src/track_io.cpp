#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "csv.hpp"
#include "text.hpp"
#include "track_check.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

// Track CSV, version 1: docs/formats.md.
namespace trochoid::data {
namespace {

constexpr int kTrackVersion = 1;
constexpr const char* kUnits = "s, m, m^2, px, rad";
constexpr int kMaxObject = 1000000;

struct AngleColumns {
  const char* value;
  const char* sigma;
  std::optional<MeasuredAngle> TrackSample::*member;
};
constexpr std::array<AngleColumns, 3> kAngles{{
    {"theta_rad", "sigma_theta_rad", &TrackSample::theta},
    {"phi_rad", "sigma_phi_rad", &TrackSample::phi},
    {"psi_rad", "sigma_psi_rad", &TrackSample::psi},
}};

// --- reading -----------------------------------------------------------------------------------

struct TrackColumns {
  int frame, t, x, y, sxx, sxy, syy, x_px, y_px, quality, object;
  std::array<std::pair<int, int>, kAngles.size()> angles;

  explicit TrackColumns(const CsvReader& csv)
      : frame(csv.index_of("frame")),
        t(csv.index_of("t_s")),
        x(csv.index_of("x_m")),
        y(csv.index_of("y_m")),
        sxx(csv.index_of("sxx_m2")),
        sxy(csv.index_of("sxy_m2")),
        syy(csv.index_of("syy_m2")),
        x_px(csv.index_of("x_px")),
        y_px(csv.index_of("y_px")),
        quality(csv.index_of("quality")),
        object(csv.index_of("object")) {
    for (std::size_t i = 0; i < kAngles.size(); ++i) {
      const int sigma = csv.index_of(kAngles[i].sigma);
      // An angle of unknown weight (a trajectory of simulate, another tool's export) is passed
      // over.
      angles[i] = {sigma < 0 ? -1 : csv.index_of(kAngles[i].value), sigma};
    }
  }
  [[nodiscard]] bool sufficient() const {
    return t >= 0 && ((x >= 0 && y >= 0) || (x_px >= 0 && y_px >= 0));
  }
};

/// Nothing was seen in a row whose places are all unknown.
bool gives_no_place(const CsvReader& csv, const TrackColumns& columns) {
  return csv.unknown(columns.x) && csv.unknown(columns.y) && csv.unknown(columns.x_px) &&
         csv.unknown(columns.y_px);
}

std::int64_t integer(CsvReader& csv, int column, double largest) {
  const double value = csv.number(column);
  if (!(value >= 0.0 && value <= largest && value == std::floor(value)))
    throw InputError(fmt::format("{}: {} = {} must be a whole number in 0..{}", csv.place(),
                                 csv.columns()[column], in_quotes(csv.cell(column)), largest));
  return static_cast<std::int64_t>(value);
}

std::optional<MeasuredAngle> read_angle(CsvReader& csv, std::pair<int, int> columns,
                                        const AngleColumns& names) {
  const double value = csv.number(columns.first), sigma = csv.number(columns.second);
  if (std::isnan(value)) return std::nullopt;
  if (std::isnan(sigma))
    throw InputError(fmt::format("{}: {} is given without {}; give both or neither", csv.place(),
                                 names.value, names.sigma));
  constexpr double kMostTilt_rad = 3.2;  // pi, and what three digits make of it
  if (names.member == &TrackSample::theta && std::abs(value) > kMostTilt_rad)
    throw InputError(
        fmt::format("{}: theta_rad = {:g} is no tilt: angles are in radians, a tilt at "
                    "most pi",
                    csv.place(), value));
  return MeasuredAngle{value, sigma};
}

TrackSample read_sample(CsvReader& csv, const TrackColumns& columns) {
  TrackSample sample;
  constexpr double kMaxFrame = 1e15;
  if (columns.frame >= 0 && !csv.cell(columns.frame).empty())
    sample.frame = integer(csv, columns.frame, kMaxFrame);
  sample.t_s = csv.number(columns.t);
  if (std::isnan(sample.t_s))
    throw InputError(fmt::format("{}: t_s is empty; every row needs its time", csv.place()));
  sample.centre_m = {csv.number(columns.x), csv.number(columns.y)};
  // Read first: a refusal in the middle of Eigen's comma list would end in its assertion.
  const double sxx = csv.number(columns.sxx), sxy = csv.number(columns.sxy),
               syy = csv.number(columns.syy);
  sample.covariance_m2 << sxx, sxy, sxy, syy;
  sample.centre_px = {csv.number(columns.x_px), csv.number(columns.y_px)};
  for (std::size_t i = 0; i < kAngles.size(); ++i)
    sample.*kAngles[i].member = read_angle(csv, columns.angles[i], kAngles[i]);
  sample.quality = csv.number(columns.quality);
  constexpr std::array kPlaces{std::pair("x_m", "y_m"), std::pair("x_px", "y_px")};
  const std::array places{sample.centre_m, sample.centre_px};
  for (std::size_t i = 0; i < places.size(); ++i)
    if (std::isnan(places[i].x()) != std::isnan(places[i].y()))
      throw InputError(
          fmt::format("{}: {} is given without {}; give both or neither", csv.place(),
                      std::isnan(places[i].x()) ? kPlaces[i].second : kPlaces[i].first,
                      std::isnan(places[i].x()) ? kPlaces[i].first : kPlaces[i].second));
  return sample;
}

void read_header(const CsvReader& csv, const std::string& where, TrackFile& file) {
  constexpr std::string_view kMagic = "trochoid track ";
  for (const auto& [key, value] : csv.header()) {
    if (key.starts_with(kMagic)) {
      if (key != fmt::format("{}{}", kMagic, kTrackVersion))
        throw InputError(fmt::format("{}: is {}, this program reads version {}", where,
                                     in_quotes(key), kTrackVersion));
    } else if (key == "units") {
      if (value != kUnits)
        throw InputError(
            fmt::format("{}: units {} are not read, need '{}'", where, in_quotes(value), kUnits));
    } else if (key == "source") {
      file.source = value;
    } else if (key == "sha256") {
      file.source_sha256 = value;
    } else if (key == "camera") {
      file.camera = value;
    } else if (key == "made by") {
      file.made_by = value;
    } else if (key == "angles") {
      file.angles_folded = value == "folded";
    } else if (key == "smoothed") {
      throw InputError(fmt::format(
          "{}: holds smoothed positions, which are no measurements: give the track itself", where));
    } else if (key == "note") {
      file.notes.push_back(value);
    } else {
      file.notes.push_back(value.empty() ? key : fmt::format("{}: {}", key, value));
    }
  }
}

// --- writing -----------------------------------------------------------------------------------

struct Row {
  const TrackSample* sample;
  int object;
};

// Several bodies are written frame by frame; within a frame in the order of the tracks.
std::vector<Row> rows_by_time(const TrackFile& file) {
  std::vector<Row> rows;
  for (const Track& track : file.tracks)
    for (const TrackSample& sample : track.samples) rows.push_back({&sample, track.object});
  std::stable_sort(rows.begin(), rows.end(),
                   [](const Row& a, const Row& b) { return a.sample->t_s < b.sample->t_s; });
  return rows;
}

std::string header_of(const TrackFile& file) {
  std::string text = header_line(fmt::format("trochoid track {}", kTrackVersion));
  text += header_line("units", kUnits);
  const auto add = [&](const char* key, const std::string& value) {
    if (!value.empty()) text += header_line(key, value);
  };
  add("source", file.source);
  add("sha256", file.source_sha256);
  add("camera", file.camera);
  add("made by", file.made_by);
  if (file.angles_folded) add("angles", "folded");
  for (const std::string& note : file.notes) add("note", note);
  return text;
}

class RowWriter {
 public:
  RowWriter(bool with_angles, bool with_object)
      : with_angles_(with_angles), with_object_(with_object) {}

  [[nodiscard]] std::string columns() const {
    std::string text = "frame,t_s,x_m,y_m,sxx_m2,sxy_m2,syy_m2,x_px,y_px";
    if (with_angles_) {
      for (const AngleColumns& angle : kAngles) text += fmt::format(",{}", angle.value);
      for (const AngleColumns& angle : kAngles) text += fmt::format(",{}", angle.sigma);
    }
    text += ",quality";
    if (with_object_) text += ",object";
    return text + "\n";
  }

  void add(const Row& row) {
    const TrackSample& s = *row.sample;
    if (s.frame >= 0) fmt::format_to(std::back_inserter(out_), "{}", s.frame);
    cell(s.t_s);
    for (const double value :
         {s.centre_m.x(), s.centre_m.y(), s.covariance_m2(0, 0), s.covariance_m2(0, 1),
          s.covariance_m2(1, 1), s.centre_px.x(), s.centre_px.y()})
      cell(value);
    if (with_angles_) {
      for (const AngleColumns& angle : kAngles) cell(value_of(s.*angle.member));
      for (const AngleColumns& angle : kAngles) cell(sigma_of(s.*angle.member));
    }
    cell(s.quality);
    if (with_object_) fmt::format_to(std::back_inserter(out_), ",{}", row.object);
    out_.push_back('\n');
  }
  [[nodiscard]] std::string text() const { return fmt::to_string(out_); }

 private:
  static double value_of(const std::optional<MeasuredAngle>& angle) {
    return angle ? angle->value_rad : TrackSample::kUnknown;
  }
  static double sigma_of(const std::optional<MeasuredAngle>& angle) {
    return angle ? angle->sigma_rad : TrackSample::kUnknown;
  }
  void cell(double value) {
    out_.push_back(',');
    if (!std::isnan(value)) fmt::format_to(std::back_inserter(out_), "{}", value);
  }

  bool with_angles_, with_object_;
  fmt::memory_buffer out_;
};

}  // namespace

TrackFile read_track(const std::filesystem::path& path) {
  const std::string where = path.string();
  const std::string text = read_text(path, std::size_t{1} << 30);
  CsvReader csv(text, where);
  const TrackColumns columns(csv);
  if (!columns.sufficient())
    throw InputError(fmt::format(
        "{}: columns {}; a track needs t_s,x_m,y_m (or t_s,x_px,y_px), separated by commas, "
        "semicolons or tabs",
        csv.place(), in_quotes(join(csv.columns(), ","))));
  std::map<int, Track> tracks;
  std::size_t rows = 0, left_out = 0;
  for (; csv.next(); ++rows) {
    const int object =
        columns.object < 0 ? 0 : static_cast<int>(integer(csv, columns.object, kMaxObject));
    if (gives_no_place(csv, columns)) {
      ++left_out;
      continue;
    }
    Track& track = tracks[object];
    track.object = object;
    const TrackSample sample = read_sample(csv, columns);
    check_sample(sample, track.samples.empty() ? nullptr : &track.samples.back(), csv.place());
    track.samples.push_back(sample);
  }
  TrackFile file;
  read_header(csv, where, file);
  if (tracks.empty())
    throw InputError(
        fmt::format("{}: holds no samples{}", where, rows == 0 ? "" : ": no row gives a position"));
  if (left_out > 0)
    file.notes.push_back(
        fmt::format("{} of {} rows give no position and are left out: gaps", left_out, rows));
  for (auto& [object, track] : tracks) file.tracks.push_back(std::move(track));
  return file;
}

void write_track(const TrackFile& file, const std::filesystem::path& path) {
  for (const Track& track : file.tracks) check(track, path.string());
  const std::vector<Row> rows = rows_by_time(file);
  if (rows.empty()) throw InputError(fmt::format("{}: no samples to write", path.string()));
  const bool with_angles = std::any_of(rows.begin(), rows.end(), [](const Row& row) {
    return row.sample->theta || row.sample->phi || row.sample->psi;
  });
  RowWriter writer(with_angles, file.tracks.size() > 1 || file.tracks.front().object != 0);
  for (const Row& row : rows) writer.add(row);
  write_text(header_of(file) + writer.columns() + writer.text(), path);
}

}  // namespace trochoid::data
