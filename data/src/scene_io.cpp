#include <fmt/format.h>

#include "body_rules.hpp"
#include "scene_reader.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/given_keys.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/moment.hpp"
#include "trochoid/data/scene_error.hpp"
#include "trochoid/data/start_rates.hpp"

// Scene TOML: docs/formats.md. The keys are listed in scene_keys.hpp.
namespace trochoid::data {
namespace {

// Reads every listed key of `reader` into `object`.
template <class Object>
auto into(TableReader& reader, Object& object) {
  return [&](const char* key, auto member, const auto& constraint) {
    reader.read(key, object.*member, constraint);
  };
}

void read_faces(TableReader& reader, SpinMark& mark) {
  constexpr Words<3> kFaces{"upper", "lower", "both"};
  std::string faces = "upper";
  reader.read("faces", faces, kFaces);
  mark.on_upper_face = faces != "lower";
  mark.on_lower_face = faces != "upper";
}

SpinMark read_mark(const toml::node& node, const std::string& where) {
  TableReader reader(node.as_table(), "[[body.mark]]", where);
  if (!node.is_table())
    throw SceneError(where, node.source().begin.line,
                     "mark must be a table, e.g. { distance_m = 0.02, size_m = 0.004 }");
  SpinMark mark;
  mark_keys(into(reader, mark));
  std::optional<double> angle_deg;
  reader.read("angle_deg", angle_deg, kAny);
  if (angle_deg && reader.has("angle_rad"))
    reader.fail("angle_deg", "angle_deg and angle_rad are both given; keep one");
  if (angle_deg) mark.angle_rad = radians(*angle_deg);
  read_faces(reader, mark);
  reader.refuse_unknown();
  if (!reader.has("distance_m"))
    reader.fail("", "a mark needs distance_m, from the axis to its centre");
  if (!reader.has("size_m")) reader.fail("", "a mark needs size_m, its radius");
  return mark;
}

void check_body(const TableReader& reader, const Body& body) {
  const bool shaped = body.kind != BodyKind::top;
  if (shaped && !reader.has("radius_m"))
    reader.fail("", "[body] needs radius_m, the outer radius of the rim");
  const BodyKeys keys{.radius = "radius_m",
                      .inner_radius = "inner_radius_m",
                      .border_radius = "border_radius_m",
                      .axle_radius = "axle_radius_m",
                      .marks = "mark",
                      .mark_distance = "distance_m"};
  if (const auto fault = fault_of(body, keys)) reader.fail(fault->key, fault->words);
}

Body read_body(const toml::table& table, const std::string& where) {
  TableReader reader(&table, "[body]", where);
  Body body;
  body_keys(into(reader, body));
  if (const toml::node* node = reader.find("mark")) {
    if (const toml::array* list = node->as_array())
      for (const toml::node& item : *list) body.marks.push_back(read_mark(item, where));
    else
      body.marks.push_back(read_mark(*node, where));
  }
  reader.refuse_unknown();
  check_body(reader, body);
  return body;
}

void check_support(const TableReader& reader, Support& support, const std::optional<Body>& body) {
  const bool held = support.pivot_m || (body && body->kind == BodyKind::top);
  if (held && !reader.has("kind")) support.kind = SupportKind::pivot;
  if (support.pivot_m && support.kind != SupportKind::pivot)
    reader.fail("pivot_m", "pivot_m is given, but kind is not \"pivot\"");
}

void check_camera(const TableReader& reader, const CameraSettings& camera) {
  if (camera.file.empty()) {
    if (reader.has("height_m") && !reader.has("scale_px_per_m"))
      reader.fail("height_m",
                  "height_m needs scale_px_per_m, the pixels per metre on the floor: how large a "
                  "body looks gives no focal length");
    return;
  }
  for (const char* key : {"scale_px_per_m", "height_m"})
    if (reader.has(key))
      reader.fail(key,
                  fmt::format("{} and file are both given; the camera file holds the scale, keep "
                              "one",
                              key));
}

void check_start(const TableReader& reader, const StartSettings& start) {
  if (const auto twice = rate_named_twice(start))
    reader.fail(twice->second,
                fmt::format("{} and {} say the same thing; keep one", twice->first, twice->second));
}

void check_run(const TableReader& reader, const RunSettings& run) {
  if (run.until_s * run.rate_hz > Table::kMostRows)
    reader.fail(reader.has("until_s") ? "until_s" : "rate_hz",
                fmt::format("until_s = {} at rate_hz = {} makes more than {} rows", run.until_s,
                            run.rate_hz, Table::kMostRows));
}

void check_tracking(const TableReader& reader, const TrackingSettings& tracking) {
  if (Window{parse_moment(tracking.from), parse_moment(tracking.to)}.reversed())
    reader.fail("from", fmt::format("[tracking] from = {} lies after to = {}; exchange them",
                                    tracking.from, tracking.to));
}

// A term may be free but for some of its coefficients, which have names of their own; fixed, it is
// fixed in all.
void check_fit(const TableReader& reader, const FitSettings& fit) {
  if (reader.has("free") && fit.free.empty())
    reader.fail(
        "free",
        "free = [] names nothing; leave the key out for the model's choice, or name a value "
        "of the start, e.g. [\"theta_rad\"], to fit the start alone");
  const auto refuse = [&](const char* key, const std::string& name) {
    reader.fail(key, fmt::format("{} names {}, which fixed gives a value; keep one", key, name));
  };
  const auto fixed = [&](const std::string& name) {
    return fit.fixed.contains(name) || fit.fixed.contains(name.substr(0, name.find('[')));
  };
  for (const std::string& name : fit.free)
    if (fixed(name)) refuse("free", name);
  for (const auto& [name, prior] : fit.prior)
    if (fixed(name)) refuse("prior", name);
  for (const auto& [name, bounds] : fit.bounds)
    if (fixed(name)) refuse("bounds", name);
}

Scene scene_of(const toml::table& root, const std::string& where) {
  TableReader top(&root, "a scene's tables", where);
  const auto section = [&](const char* name) {
    const toml::node* node = top.find(name);
    if (node && !node->is_table())
      throw SceneError(where, node->source().begin.line,
                       fmt::format("{} must be a table: [{}]", name, name));
    return node ? node->as_table() : nullptr;
  };
  Scene scene;
  if (const toml::table* body = section("body")) scene.body = read_body(*body, where);
  const auto read = [&](const char* name, auto& settings, auto keys, auto check) {
    TableReader reader(section(name), fmt::format("[{}]", name), where);
    keys(into(reader, settings));
    reader.refuse_unknown();
    check(reader);
  };
  const auto unchecked = [](const TableReader&) {};
  read(
      "support", scene.support, [](auto&& v) { support_keys(v); },
      [&](const TableReader& r) { check_support(r, scene.support, scene.body); });
  read(
      "camera", scene.camera, [](auto&& v) { camera_keys(v); },
      [&](const TableReader& r) { check_camera(r, scene.camera); });
  read(
      "tracking", scene.tracking, [](auto&& v) { tracking_keys(v); },
      [&](const TableReader& r) { check_tracking(r, scene.tracking); });
  read(
      "model", scene.model, [](auto&& v) { model_keys(v); }, unchecked);
  read(
      "start", scene.start, [](auto&& v) { start_keys(v); },
      [&](const TableReader& reader) { check_start(reader, scene.start); });
  read(
      "run", scene.run, [](auto&& v) { run_keys(v); },
      [&](const TableReader& r) { check_run(r, scene.run); });
  read(
      "fit", scene.fit, [](auto&& v) { fit_keys(v); },
      [&](const TableReader& r) { check_fit(r, scene.fit); });
  for (const auto& [key, node] : root)
    if (!node.is_table() && !node.is_array_of_tables())
      throw SceneError(where, key.source().begin.line,
                       fmt::format("{} stands outside of every table; lengths belong under [body], "
                                   "for instance",
                                   in_quotes(key.str())));
  top.refuse_unknown();
  return scene;
}

// --- writing -----------------------------------------------------------------------------------

std::string toml_number(double value) {
  std::string text = shortest(value);
  // TOML takes a number without point or exponent for an integer, and those end at 2^63.
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string toml_text(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\')
      out += fmt::format("\\{}", c);
    else if (static_cast<unsigned char>(c) < ' ' || c == '\x7f')
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(static_cast<unsigned char>(c)));
    else
      out += c;
  }
  return out + "\"";
}

// toml_value(value, constraint): how a value is spelt.
std::string toml_value(double value, const Range&) {
  return toml_number(value);
}
std::string toml_value(int value, const Range&) {
  return std::to_string(value);
}
std::string toml_value(bool value, AnyText) {
  return value ? "true" : "false";
}
std::string toml_value(const std::string& value, AnyText) {
  return toml_text(value);
}
std::string toml_value(const std::string& value, TimeOrFrame) {
  return toml_text(value);
}
template <int N>
std::string toml_value(const Eigen::Matrix<double, N, 1>& value, const Range&) {
  std::vector<std::string> items;
  for (const double item : value) items.push_back(toml_number(item));
  return fmt::format("[{}]", join(items, ", "));
}
template <std::size_t N>
std::string toml_value(const std::string& value, const Words<N>&) {
  return toml_text(value);
}
template <class Enum, std::size_t N>
requires std::is_enum_v<Enum> std::string toml_value(Enum value, const Words<N>& words) {
  return toml_text(words[static_cast<std::size_t>(value)]);
}
std::string toml_value(const std::vector<std::string>& values, AnyText) {
  std::vector<std::string> items;
  for (const std::string& value : values) items.push_back(toml_text(value));
  return fmt::format("[{}]", join(items, ", "));
}
std::string toml_value(const std::vector<std::int64_t>& values, const Range&) {
  return fmt::format("[{}]", fmt::join(values, ", "));
}
std::string toml_value(const Prior& prior, const Range&) {
  return fmt::format("[{}, {}]", toml_number(prior.value), toml_number(prior.sigma));
}
std::string toml_value(const std::pair<double, double>& bounds, const Range&) {
  return fmt::format("[{}, {}]", toml_number(bounds.first), toml_number(bounds.second));
}
template <class T>
std::string toml_value(const std::map<std::string, T>& values, const Range& range) {
  std::vector<std::string> items;
  for (const auto& [name, value] : values)
    items.push_back(fmt::format("{} = {}", toml_text(name), toml_value(value, range)));
  return fmt::format("{{ {} }}", join(items, ", "));
}

// Last, so that it finds the spellings above. Only values that are set are written.
template <class T, class Constraint>
std::string toml_value(const std::optional<T>& value, const Constraint& constraint) {
  return toml_value(*value, constraint);
}

template <class T>
bool same(const T& a, const T& b) {
  return a == b;
}
bool same(const std::map<std::string, Prior>& a, const std::map<std::string, Prior>& b) {
  return a.empty() && b.empty();
}

// visit(key, value, constraint) for everything that differs from the default.
template <class Object, class Keys, class Visit>
void for_given(const Object& object, Keys keys, Visit visit) {
  const Object standard{};
  keys([&](const char* key, auto member, const auto& constraint) {
    if (!same(object.*member, standard.*member)) visit(key, object.*member, constraint);
  });
}

// The same as "key = value" lines.
template <class Object, class Keys>
std::string lines_of(const Object& object, Keys keys) {
  std::string text;
  for_given(object, keys, [&](const char* key, const auto& value, const auto& constraint) {
    text += fmt::format("{} = {}\n", key, toml_value(value, constraint));
  });
  return text;
}

std::string body_text(const Body& body) {
  std::string text = "[body]\n" + lines_of(body, [](auto&& v) { body_keys(v); });
  for (const SpinMark& mark : body.marks) {
    text += "[[body.mark]]\n" + lines_of(mark, [](auto&& v) { mark_keys(v); });
    // The reader wants the distance spelt out, also when the dot sits on the axis.
    if (mark.distance_m == 0.0) text += "distance_m = 0.0\n";
    const char* faces = !mark.on_lower_face ? "upper" : mark.on_upper_face ? "both" : "lower";
    text += fmt::format("faces = \"{}\"\n", faces);
  }
  return text;
}

}  // namespace

Scene parse_scene(const std::string& toml, const std::string& where) {
  try {
    return scene_of(toml::parse(toml, where), where);
  } catch (const toml::parse_error& error) {
    throw SceneError(where, error.source().begin.line,
                     "not TOML: " + one_line(error.description()));
  }
}

Scene read_scene(const std::filesystem::path& path) {
  Scene scene = parse_scene(read_text(path), path.string());
  if (!scene.camera.file.empty())
    scene.camera.file = (path.parent_path() / scene.camera.file).lexically_normal().string();
  return scene;
}

std::vector<std::string> given_keys(const Scene& scene) {
  std::vector<std::string> names;
  const auto add = [&](const char* table, const auto& object, auto keys) {
    for_given(object, keys, [&](const char* key, const auto&, const auto&) {
      names.push_back(fmt::format("{}.{}", table, key));
    });
  };
  add("support", scene.support, [](auto&& v) { support_keys(v); });
  add("model", scene.model, [](auto&& v) { model_keys(v); });
  add("start", scene.start, [](auto&& v) { start_keys(v); });
  add("run", scene.run, [](auto&& v) { run_keys(v); });
  return names;
}

std::string to_toml(const Scene& scene) {
  std::string text;
  const auto add = [&](const char* name, const std::string& lines) {
    if (!lines.empty()) text += fmt::format("{}[{}]\n{}", text.empty() ? "" : "\n", name, lines);
  };
  if (scene.body) text += body_text(*scene.body);
  std::string support = lines_of(scene.support, [](auto&& v) { support_keys(v); });
  // A shapeless top is held at a pivot unless the file says otherwise; so say it.
  if (scene.body && scene.body->kind == BodyKind::top && scene.support.kind == SupportKind::floor)
    support = "kind = \"floor\"\n" + support;
  add("support", support);
  add("camera", lines_of(scene.camera, [](auto&& v) { camera_keys(v); }));
  add("tracking", lines_of(scene.tracking, [](auto&& v) { tracking_keys(v); }));
  add("model", lines_of(scene.model, [](auto&& v) { model_keys(v); }));
  add("start", lines_of(scene.start, [](auto&& v) { start_keys(v); }));
  add("run", lines_of(scene.run, [](auto&& v) { run_keys(v); }));
  add("fit", lines_of(scene.fit, [](auto&& v) { fit_keys(v); }));
  return text;
}

}  // namespace trochoid::data
