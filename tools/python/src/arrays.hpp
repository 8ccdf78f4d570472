#pragma once
#include <pybind11/numpy.h>

#include <Eigen/Core>
#include <string>
#include <vector>

#include "trochoid/data/track.hpp"

namespace trochoid::python {

/// Names of files may be no UTF-8, which Python's texts are: what is none becomes U+FFFD.
[[nodiscard]] pybind11::str text_of(const std::string& text);

/// A matrix as a new C-ordered array of the same shape.
[[nodiscard]] pybind11::array_t<double> array_of(const Eigen::Ref<const Eigen::MatrixXd>& matrix);
[[nodiscard]] pybind11::array_t<double> array_of(const std::vector<double>& values);

/// The samples of a track as arrays by name; n samples, unknown values NaN, unknown frames -1.
[[nodiscard]] pybind11::dict arrays_of(const data::Track& track);

/// The reverse. Only t_s is asked for; what else is there must have its shape.
/// @throws InputError naming `where` and the array that does not fit.
[[nodiscard]] data::Track track_of(const pybind11::dict& arrays, const std::string& where);

/// The same of several; errors count them from 1, as fits do.
[[nodiscard]] std::vector<data::Track> tracks_of(const pybind11::list& list);

/// A file's tracks and header as a dict, and back.
[[nodiscard]] pybind11::dict dict_of(const data::TrackFile& file);
[[nodiscard]] data::TrackFile file_of(const pybind11::dict& dict);

}  // namespace trochoid::python
