#include "arrays.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "trochoid/data/error.hpp"

namespace trochoid::python {
namespace py = pybind11;
namespace {

using Values = py::array_t<double, py::array::c_style | py::array::forcecast>;
using data::MeasuredAngle;
using data::TrackSample;
using Angle = std::optional<MeasuredAngle> TrackSample::*;

struct AngleNames {
  const char *value, *sigma;
  Angle member;
};
constexpr AngleNames kAngles[] = {{"theta_rad", "sigma_theta_rad", &TrackSample::theta},
                                  {"phi_rad", "sigma_phi_rad", &TrackSample::phi},
                                  {"psi_rad", "sigma_psi_rad", &TrackSample::psi}};

std::string words_of(const std::vector<py::ssize_t>& shape) {
  return fmt::format("({})", fmt::join(shape, ", "));
}

/// Empty where numpy would have to make numbers of something else: of complex ones, of dates.
Values numbers_of(const py::object& given) {
  const py::array array = py::array::ensure(given);
  constexpr std::string_view kOtherKinds = "cmM";
  const bool other = array && kOtherKinds.find(array.dtype().kind()) != std::string_view::npos;
  Values values = array && !other ? Values::ensure(array) : py::reinterpret_steal<Values>(nullptr);
  PyErr_Clear();
  return values;
}

/// The array of that name with the shape asked for, or nothing if it is None or absent.
std::optional<Values> values_of(const py::dict& arrays, const char* name,
                                const std::vector<py::ssize_t>& shape, const std::string& where) {
  if (!arrays.contains(name) || arrays[name].is_none()) return std::nullopt;
  const Values values = numbers_of(arrays[name]);
  if (!values) throw InputError(fmt::format("{}: {} is not an array of numbers", where, name));
  const std::vector<py::ssize_t> got(values.shape(), values.shape() + values.ndim());
  if (got != shape)
    throw InputError(fmt::format("{}: {} has the shape {}, expected {}", where, name, words_of(got),
                                 words_of(shape)));
  return values;
}

std::int64_t frame_number(double value, const std::string& where) {
  constexpr double kLargest = 9007199254740992.0;  // 2^53: whole numbers are exact up to here
  if (!(value >= -1.0 && value <= kLargest) || value != std::floor(value))
    throw InputError(fmt::format("{}: frame {} is no frame number", where, value));
  return static_cast<std::int64_t>(value);
}

void set_angles(const py::dict& arrays, const std::string& where, data::Track& track) {
  const auto n = static_cast<py::ssize_t>(track.samples.size());
  for (const AngleNames& angle : kAngles) {
    const auto values = values_of(arrays, angle.value, {n}, where);
    const auto sigmas = values_of(arrays, angle.sigma, {n}, where);
    if (!values) continue;
    if (!sigmas)
      throw InputError(fmt::format("{}: {} is given without {}", where, angle.value, angle.sigma));
    for (py::ssize_t i = 0; i < n; ++i)
      if (!std::isnan(values->at(i)))
        track.samples[static_cast<std::size_t>(i)].*(angle.member) =
            MeasuredAngle{values->at(i), sigmas->at(i)};
  }
}

/// Rows without a position are gaps, as in a file, unless the track is of angles alone.
void leave_out_gaps(data::Track& track) {
  const auto has_place = [](const TrackSample& sample) {
    return !sample.centre_m.array().isNaN().all() || !sample.centre_px.array().isNaN().all();
  };
  if (!std::any_of(track.samples.begin(), track.samples.end(), has_place)) return;
  std::erase_if(track.samples, [&](const TrackSample& sample) { return !has_place(sample); });
}

}  // namespace

py::str text_of(const std::string& text) {
  PyObject* decoded =
      PyUnicode_DecodeUTF8(text.data(), static_cast<py::ssize_t>(text.size()), "replace");
  if (decoded == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::str>(decoded);
}

py::array_t<double> array_of(const Eigen::Ref<const Eigen::MatrixXd>& matrix) {
  py::array_t<double> array({matrix.rows(), matrix.cols()});
  auto view = array.mutable_unchecked<2>();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) view(i, j) = matrix(i, j);
  return array;
}

py::array_t<double> array_of(const std::vector<double>& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
}

py::dict arrays_of(const data::Track& track) {
  const auto n = static_cast<py::ssize_t>(track.samples.size());
  py::array_t<std::int64_t> frame(n);
  py::array_t<double> t_s(n), centre_m({n, py::ssize_t{2}}), centre_px({n, py::ssize_t{2}});
  py::array_t<double> covariance_m2({n, py::ssize_t{2}, py::ssize_t{2}}), quality(n);
  std::vector<py::array_t<double>> angles;
  for (std::size_t k = 0; k < 2 * std::size(kAngles); ++k) angles.emplace_back(n);
  for (py::ssize_t i = 0; i < n; ++i) {
    const TrackSample& sample = track.samples[static_cast<std::size_t>(i)];
    frame.mutable_at(i) = sample.frame;
    t_s.mutable_at(i) = sample.t_s;
    quality.mutable_at(i) = sample.quality;
    for (int a = 0; a < 2; ++a) {
      centre_m.mutable_at(i, a) = sample.centre_m[a];
      centre_px.mutable_at(i, a) = sample.centre_px[a];
      for (int b = 0; b < 2; ++b) covariance_m2.mutable_at(i, a, b) = sample.covariance_m2(a, b);
    }
    for (std::size_t k = 0; k < std::size(kAngles); ++k) {
      const auto& angle = sample.*(kAngles[k].member);
      angles[2 * k].mutable_at(i) = angle ? angle->value_rad : TrackSample::kUnknown;
      angles[2 * k + 1].mutable_at(i) = angle ? angle->sigma_rad : TrackSample::kUnknown;
    }
  }
  py::dict arrays;
  arrays["object"] = track.object;
  arrays["frame"] = frame;
  arrays["t_s"] = t_s;
  arrays["centre_m"] = centre_m;
  arrays["covariance_m2"] = covariance_m2;
  arrays["centre_px"] = centre_px;
  arrays["quality"] = quality;
  for (std::size_t k = 0; k < std::size(kAngles); ++k) {
    arrays[kAngles[k].value] = angles[2 * k];
    arrays[kAngles[k].sigma] = angles[2 * k + 1];
  }
  return arrays;
}

data::Track track_of(const py::dict& arrays, const std::string& where) {
  if (!arrays.contains("t_s")) throw InputError(where + ": t_s is missing");
  const Values t_s = numbers_of(arrays["t_s"]);
  if (!t_s || t_s.ndim() != 1)
    throw InputError(where + ": t_s is not a one-dimensional array of numbers");
  const py::ssize_t n = t_s.shape(0);
  const auto frame = values_of(arrays, "frame", {n}, where);
  const auto centre_m = values_of(arrays, "centre_m", {n, 2}, where);
  const auto covariance_m2 = values_of(arrays, "covariance_m2", {n, 2, 2}, where);
  const auto centre_px = values_of(arrays, "centre_px", {n, 2}, where);
  const auto quality = values_of(arrays, "quality", {n}, where);
  const auto asymmetric = [&](py::ssize_t i) {
    const double a = covariance_m2->at(i, 0, 1), b = covariance_m2->at(i, 1, 0);
    constexpr double kRounding = 1e-9;
    return std::abs(a - b) > kRounding * std::max(std::abs(a), std::abs(b));
  };
  data::Track track;
  if (arrays.contains("object")) track.object = arrays["object"].cast<int>();
  track.samples.resize(static_cast<std::size_t>(n));
  for (py::ssize_t i = 0; i < n; ++i) {
    TrackSample& sample = track.samples[static_cast<std::size_t>(i)];
    sample.t_s = t_s.at(i);
    if (covariance_m2 && asymmetric(i))
      throw InputError(fmt::format("{}: covariance_m2[{}] is not symmetric", where, i));
    if (frame) sample.frame = frame_number(frame->at(i), where);
    if (quality) sample.quality = quality->at(i);
    for (int a = 0; a < 2; ++a) {
      if (centre_m) sample.centre_m[a] = centre_m->at(i, a);
      if (centre_px) sample.centre_px[a] = centre_px->at(i, a);
      for (int b = 0; b < 2 && covariance_m2; ++b)
        sample.covariance_m2(a, b) = covariance_m2->at(i, a, b);
    }
  }
  set_angles(arrays, where, track);
  data::check(track, where);
  leave_out_gaps(track);
  return track;
}

py::dict dict_of(const data::TrackFile& file) {
  py::list tracks;
  for (const data::Track& track : file.tracks) tracks.append(arrays_of(track));
  py::dict dict;
  dict["tracks"] = tracks;
  dict["source"] = text_of(file.source);
  dict["source_sha256"] = file.source_sha256;
  dict["camera"] = text_of(file.camera);
  dict["made_by"] = text_of(file.made_by);
  dict["angles_folded"] = file.angles_folded;
  py::list notes;
  for (const std::string& note : file.notes) notes.append(text_of(note));
  dict["notes"] = notes;
  return dict;
}

std::vector<data::Track> tracks_of(const py::list& list) {
  std::vector<data::Track> tracks;
  for (const py::handle track : list)
    tracks.push_back(track_of(track.cast<py::dict>(), fmt::format("track {}", tracks.size() + 1)));
  return tracks;
}

data::TrackFile file_of(const py::dict& dict) {
  data::TrackFile file;
  file.source = dict["source"].cast<std::string>();
  file.source_sha256 = dict["source_sha256"].cast<std::string>();
  file.camera = dict["camera"].cast<std::string>();
  file.made_by = dict["made_by"].cast<std::string>();
  file.angles_folded = dict["angles_folded"].cast<bool>();
  file.notes = dict["notes"].cast<std::vector<std::string>>();
  file.tracks = tracks_of(dict["tracks"]);
  if (file.tracks.empty()) throw InputError("there is no track; give at least one");
  return file;
}

}  // namespace trochoid::python
