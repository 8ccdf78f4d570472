#include <fmt/format.h>

#include <algorithm>

#include "body_rules.hpp"
#include "json_read.hpp"
#include "scene_keys.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/io.hpp"

// object.json of a recording with truth: docs/formats.md. Only what somebody with a caliper and a
// balance would know is taken; the law, its parameters and the distance from pivot to CoM are what
// a fit has to find, so they stay behind.
namespace trochoid::data {
namespace {

double length(const JsonReader& json, const char* key, const Range& range) {
  const double value = json.number(key);
  if (!range.holds(value))
    json.fail(fmt::format("\"{}\" = {} must be {}", key, value, range.words));
  return value;
}

// The first of several spellings that is there.
double length_of(const JsonReader& json, std::initializer_list<const char*> keys,
                 const Range& range, double otherwise) {
  for (const char* key : keys)
    if (json.has(key)) return length(json, key, range);
  return otherwise;
}

SpinMark read_marker(const nlohmann::json& object, const std::string& where) {
  if (!object.is_object())
    throw InputError(fmt::format("{}: every entry of \"markers\" must be an object", where));
  const JsonReader json(object, where + ": markers");
  SpinMark mark;
  mark.distance_m = length(json, "r_m", kNonNegative);
  mark.size_m = length(json, "radius_m", kPositive);
  mark.angle_rad = radians(json.number_or("angle_deg", 0.0));
  if (json.has("faces")) {
    const nlohmann::json& faces = json.at("faces");
    const auto holds = [&](int face) {
      return faces.is_array() && std::find(faces.begin(), faces.end(), face) != faces.end();
    };
    mark.on_upper_face = holds(1);
    mark.on_lower_face = holds(-1);
    if (!mark.on_upper_face && !mark.on_lower_face)
      json.fail("\"faces\" must be a list of 1 (upper) and -1 (lower)");
  }
  return mark;
}

Body read_body(const JsonReader& json) {
  Body body;
  const std::string type = json.text("type");
  if (type != "disc" && type != "ring") json.fail("\"type\" must be disc or ring");
  body.kind = type == "ring" ? BodyKind::ring : BodyKind::disc;
  body.radius_m = length_of(json, {"R_m", "R_outer_m"}, kSize, 0.0);
  if (body.radius_m == 0.0) json.fail("key \"R_m\" (or \"R_outer_m\") is missing");
  body.inner_radius_m = length_of(json, {"R_inner_m"}, kSizeOrNone, 0.0);
  body.border_radius_m = length_of(json, {"R_border_m"}, kSizeOrNone, 0.0);
  body.thickness_m = length_of(json, {"thickness_m", "height_m"}, kSizeOrNone, 0.0);
  body.axle_radius_m = length_of(json, {"axle_radius_m"}, kSizeOrNone, 0.0);
  body.axle_above_m = length_of(json, {"axle_above_upper_face_m"}, kSizeOrNone, 0.0);
  if (json.has("mass_kg")) body.mass_kg = length(json, "mass_kg", kPositive);
  if (json.has("markers")) {
    if (!json.at("markers").is_array()) json.fail("\"markers\" must be a list");
    for (const nlohmann::json& marker : json.at("markers"))
      body.marks.push_back(read_marker(marker, json.where()));
  }
  const BodyKeys keys{.radius = json.has("R_m") ? "\"R_m\"" : "\"R_outer_m\"",
                      .inner_radius = "\"R_inner_m\"",
                      .border_radius = "\"R_border_m\"",
                      .axle_radius = "\"axle_radius_m\"",
                      .marks = "\"markers\"",
                      .mark_distance = "\"r_m\""};
  if (const auto fault = fault_of(body, keys)) json.fail(fault->words);
  return body;
}

}  // namespace

Scene read_object(const std::filesystem::path& path) {
  const nlohmann::json object = read_json_object(path);
  const JsonReader json(object, path.string());
  Scene scene;
  scene.body = read_body(json);
  if (json.has("pivot_m")) {
    const auto p = json.numbers("pivot_m", 3);
    scene.support.kind = SupportKind::pivot;
    scene.support.pivot_m = Eigen::Vector3d(p[0], p[1], p[2]);
    scene.model.name = "top";
  }
  return scene;
}

}  // namespace trochoid::data
