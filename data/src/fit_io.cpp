#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "json_read.hpp"
#include "text.hpp"
#include "trochoid/data/io.hpp"

// Fit JSON, version 1: docs/formats.md. The keys are listed once, below; the reader and the writer
// walk the same lists. JSON has no infinity and no NaN: they travel as "Infinity", "-Infinity",
// null.
namespace trochoid::data {
namespace {

using Json = nlohmann::ordered_json;
constexpr int kFitVersion = 1;

// Each value has a spelling.
template <class Enum>
constexpr bool all_spelled(Enum last) {
  return spellings(last).size() == static_cast<std::size_t>(last) + 1;
}
static_assert(all_spelled(ParameterStatus::prior) && all_spelled(FitOutcome::not_identifiable) &&
              all_spelled(FitVerdict::unexplained) && all_spelled(ProfileVerdict::flat));

template <class Visit>
void parameter_keys(Visit&& visit) {
  visit("name", &FitParameter::name);
  visit("value", &FitParameter::value);
  visit("sigma", &FitParameter::sigma);
  visit("unit", &FitParameter::unit);
  visit("status", &FitParameter::status);
  visit("identifiable", &FitParameter::identifiable);
  visit("note", &FitParameter::note);
}

template <class Visit>
void arc_keys(Visit&& visit) {
  visit("track", &FitArc::track);
  visit("object", &FitArc::object);
  visit("from_s", &FitArc::from_s);
  visit("to_s", &FitArc::to_s);
  visit("samples", &FitArc::samples);
  visit("noise_scale", &FitArc::noise_scale);
}

template <class Visit>
void null_vector_keys(Visit&& visit) {
  visit("components", &NullVector::components);
  visit("words", &NullVector::words);
}

template <class Visit>
void broken_degeneracy_keys(Visit&& visit) {
  visit("readings", &BrokenDegeneracy::readings);
  visit("parameters", &BrokenDegeneracy::parameters);
  visit("words", &BrokenDegeneracy::words);
}

template <class Visit>
void score_keys(Visit&& visit) {
  visit("model", &ModelScore::model);
  visit("parameters", &ModelScore::parameters);
  visit("chi2", &ModelScore::chi2);
  visit("aicc", &ModelScore::aicc);
  visit("bic", &ModelScore::bic);
  visit("whiteness_p", &ModelScore::whiteness_p);
  visit("held_back_rms_sigma", &ModelScore::held_back_rms_sigma);
  visit("recommended", &ModelScore::recommended);
  visit("reason", &ModelScore::reason);
}

template <class Visit>
void profile_keys(Visit&& visit) {
  visit("parameter", &Profile::parameter);
  visit("verdict", &Profile::verdict);
  visit("lower_95", &Profile::lower_95);
  visit("upper_95", &Profile::upper_95);
  visit("values", &Profile::values);
  visit("delta_chi2", &Profile::delta_chi2);
}

template <class Visit>
void spread_keys(Visit&& visit) {
  visit("parameter", &BootstrapSpread::parameter);
  visit("sigma", &BootstrapSpread::sigma);
  visit("lower_95", &BootstrapSpread::lower_95);
  visit("upper_95", &BootstrapSpread::upper_95);
}

template <class Visit>
void bootstrap_keys(Visit&& visit) {
  visit("draws", &Bootstrap::draws);
  visit("failed", &Bootstrap::failed);
  visit("block_s", &Bootstrap::block_s);
  visit("parameters", &Bootstrap::parameters);
}

template <class Visit>
void fit_file_keys(Visit&& visit) {
  visit("model", &Fit::model);
  visit("converged", &Fit::converged);
  visit("outcome", &Fit::outcome);
  visit("reason", &Fit::reason);
  visit("verdict", &Fit::verdict);
  visit("verdict_words", &Fit::verdict_words);
  visit("start_path", &Fit::start_path);
  visit("parameters", &Fit::parameters);
  visit("covariance_names", &Fit::covariance_names);
  visit("covariance", &Fit::covariance);
  visit("chi2", &Fit::chi2);
  visit("dof", &Fit::dof);
  visit("noise_scale", &Fit::noise_scale);
  visit("aicc", &Fit::aicc);
  visit("bic", &Fit::bic);
  visit("whiteness_p", &Fit::whiteness_p);
  visit("correlation_time_s", &Fit::correlation_time_s);
  visit("rank", &Fit::rank);
  visit("condition", &Fit::condition);
  visit("null_vectors", &Fit::null_vectors);
  visit("broken_degeneracies", &Fit::broken_degeneracies);
  visit("integration_error_sigma", &Fit::integration_error_sigma);
  visit("time_origin_s", &Fit::time_origin_s);
  visit("arcs", &Fit::arcs);
  visit("comparison", &Fit::comparison);
  visit("recommendation", &Fit::recommendation);
  visit("profiles", &Fit::profiles);
  visit("bootstrap", &Fit::bootstrap);
  visit("warnings", &Fit::warnings);
  visit("inputs", &Fit::inputs);
  visit("versions", &Fit::versions);
  visit("seed", &Fit::seed);
  visit("scene_toml", &Fit::scene_toml);
}

// Which list belongs to which struct.
template <class Visit>
void keys_of(const FitParameter*, Visit&& visit) {
  parameter_keys(visit);
}
template <class Visit>
void keys_of(const FitArc*, Visit&& visit) {
  arc_keys(visit);
}
template <class Visit>
void keys_of(const NullVector*, Visit&& visit) {
  null_vector_keys(visit);
}
template <class Visit>
void keys_of(const BrokenDegeneracy*, Visit&& visit) {
  broken_degeneracy_keys(visit);
}
template <class Visit>
void keys_of(const ModelScore*, Visit&& visit) {
  score_keys(visit);
}
template <class Visit>
void keys_of(const Profile*, Visit&& visit) {
  profile_keys(visit);
}
template <class Visit>
void keys_of(const BootstrapSpread*, Visit&& visit) {
  spread_keys(visit);
}
template <class Visit>
void keys_of(const Bootstrap*, Visit&& visit) {
  bootstrap_keys(visit);
}
template <class Visit>
void keys_of(const Fit*, Visit&& visit) {
  fit_file_keys(visit);
}

template <class T>
concept Record = requires(const T* record) {
  keys_of(record, [](const char*, auto) {});
};

// --- writing -----------------------------------------------------------------------------------

Json to_json(double value) {
  if (std::isnan(value)) return nullptr;
  if (std::isinf(value)) return value > 0.0 ? "Infinity" : "-Infinity";
  return value;
}
Json to_json(bool value) {
  return value;
}
Json to_json(int value) {
  return value;
}
Json to_json(std::uint64_t value) {
  return value;
}
Json to_json(const std::string& value) {
  return value;
}
template <Spelled Enum>
Json to_json(Enum value) {
  return name(value);
}
Json to_json(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < matrix.cols(); ++j) row.push_back(to_json(matrix(i, j)));
    rows.push_back(std::move(row));
  }
  return rows;
}
template <class T>
Json to_json(const std::map<std::string, T>& values);
template <class T>
Json to_json(const std::vector<T>& values);
template <Record T>
Json to_json(const T& record) {
  Json json = Json::object();
  keys_of(&record, [&](const char* key, auto member) { json[key] = to_json(record.*member); });
  return json;
}
template <class T>
Json to_json(const std::map<std::string, T>& values) {
  Json json = Json::object();
  for (const auto& [name, value] : values) json[name] = to_json(value);
  return json;
}
template <class T>
Json to_json(const std::vector<T>& values) {
  Json json = Json::array();
  for (const T& value : values) json.push_back(to_json(value));
  return json;
}

// --- reading -----------------------------------------------------------------------------------

// `place` is "file: key" for messages.
[[noreturn]] void refuse(const std::string& place, std::string_view wanted) {
  throw InputError(fmt::format("{} must be {}", place, wanted));
}

void from_json(const nlohmann::json& json, double& value, const std::string& place) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (json.is_null())
    value = std::numeric_limits<double>::quiet_NaN();
  else if (json == "Infinity")
    value = kInfinity;
  else if (json == "-Infinity")
    value = -kInfinity;
  else if (json.is_number())
    value = json.get<double>();
  else
    refuse(place, "a number, null, \"Infinity\" or \"-Infinity\"");
}
void from_json(const nlohmann::json& json, bool& value, const std::string& place) {
  if (!json.is_boolean()) refuse(place, "true or false");
  value = json.get<bool>();
}
void from_json(const nlohmann::json& json, int& value, const std::string& place) {
  const bool fits = json.is_number_integer() && json >= std::numeric_limits<int>::min() &&
                    json <= std::numeric_limits<int>::max();
  if (!fits) refuse(place, "a whole number");
  value = json.get<int>();
}
void from_json(const nlohmann::json& json, std::uint64_t& value, const std::string& place) {
  if (!json.is_number_unsigned()) refuse(place, "a whole number >= 0");
  value = json.get<std::uint64_t>();
}
void from_json(const nlohmann::json& json, std::string& value, const std::string& place) {
  if (!json.is_string()) refuse(place, "text");
  value = json.get<std::string>();
}
template <Spelled Enum>
void from_json(const nlohmann::json& json, Enum& value, const std::string& place) {
  const auto words = spellings(value);
  const auto found = json.is_string()
                         ? std::find(words.begin(), words.end(), json.get<std::string>())
                         : words.end();
  if (found == words.end()) {
    const auto first = words.begin() + (words.front().empty() ? 1 : 0), last = words.end() - 1;
    refuse(place, fmt::format("{} or {}", fmt::join(first, last, ", "), *last));
  }
  value = static_cast<Enum>(found - words.begin());
}
void from_json(const nlohmann::json& json, Eigen::MatrixXd& matrix, const std::string& place) {
  if (!json.is_array()) refuse(place, "a list of rows");
  const std::size_t size = json.size();
  matrix.resize(static_cast<Eigen::Index>(size), static_cast<Eigen::Index>(size));
  for (std::size_t i = 0; i < size; ++i) {
    if (!json[i].is_array() || json[i].size() != size)
      refuse(place, "square: as many columns as rows");
    for (std::size_t j = 0; j < size; ++j)
      from_json(json[i][j], matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)),
                place);
  }
}
template <class T>
void from_json(const nlohmann::json& json, std::map<std::string, T>& values,
               const std::string& place);
template <class T>
void from_json(const nlohmann::json& json, std::vector<T>& values, const std::string& place);
template <Record T>
void from_json(const nlohmann::json& json, T& record, const std::string& place) {
  if (!json.is_object()) refuse(place, "an object {...}");
  keys_of(&record, [&](const char* key, auto member) {
    if (const auto found = json.find(key); found != json.end())
      from_json(*found, record.*member, fmt::format("{}: \"{}\"", place, key));
  });
}
template <class T>
void from_json(const nlohmann::json& json, std::map<std::string, T>& values,
               const std::string& place) {
  if (!json.is_object()) refuse(place, "an object {...}");
  for (const auto& [name, value] : json.items())
    from_json(value, values[name], fmt::format("{}: {}", place, in_quotes(name)));
}
template <class T>
void from_json(const nlohmann::json& json, std::vector<T>& values, const std::string& place) {
  if (!json.is_array()) refuse(place, "a list [...]");
  for (std::size_t i = 0; i < json.size(); ++i)
    from_json(json[i], values.emplace_back(), fmt::format("{}[{}]", place, i));
}

void check_fit(const Fit& fit, const std::string& where) {
  for (std::size_t i = 0; i < fit.parameters.size(); ++i)
    if (fit.parameters[i].name.empty())
      throw InputError(fmt::format("{}: \"parameters\"[{}] has no name", where, i));
  if (fit.covariance.rows() != static_cast<Eigen::Index>(fit.covariance_names.size()))
    throw InputError(fmt::format("{}: \"covariance\" has {} rows for {} \"covariance_names\"",
                                 where, fit.covariance.rows(), fit.covariance_names.size()));
}

}  // namespace

Fit parse_fit(const std::string& text, const std::string& where) {
  const nlohmann::json json = parse_json_object(text, where);
  const JsonReader reader(json, where);
  const double version = reader.number("trochoid_fit");
  if (version != kFitVersion)
    reader.fail(fmt::format("\"trochoid_fit\" is version {}, this program reads version {}",
                            version, kFitVersion));
  for (const char* needed : {"model", "outcome", "parameters"})
    static_cast<void>(reader.at(needed));
  Fit fit;
  from_json(json, fit, where);
  for (std::size_t i = 0; i < fit.parameters.size(); ++i)
    if (!json["parameters"][i].contains("value"))
      reader.fail(fmt::format("\"parameters\"[{}] has no \"value\"", i));
  check_fit(fit, where);
  return fit;
}

Fit read_fit(const std::filesystem::path& path) {
  return parse_fit(read_text(path), path.string());
}

std::string fit_text(const Fit& fit, const std::string& where) {
  check_fit(fit, where);
  Json json;
  json["trochoid_fit"] = kFitVersion;
  json.update(to_json(fit));
  // Text from outside (a file name) may be broken UTF-8: replace it rather than refuse to write.
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

void write_fit(const Fit& fit, const std::filesystem::path& path) {
  write_text(fit_text(fit, path.string()), path);
}

}  // namespace trochoid::data
