// A small path tracer of its own for recordings with truth: it shares no line with the project, so that
// a tracker may be judged on pictures the project's renderer did not make. gen.py writes what it reads.
//
//   tracer SCENE POSES > frames.f32
//
// SCENE: lines "key number...", see read_scene(). POSES: doubles, per frame `steps` poses spread over the
// exposure, each x y z qw qx qy qz (body to world, m); of these the first row is exposed to the first `row_steps`,
// the last row to the last, those between in proportion. Out: per frame height x width x 3 linear floats.
//
// Light: two rectangular lamps and a sky, sampled by R_d sequences (shifted golden ratios); body: diffuse
// with a glossy lobe, lit by lamps, sky and one bounce off floor or body; floor: Lambertian (x, y, 0) with a
// procedural texture and a mirror-like sheen. What the floor gets without the body is tabulated; samples add
// only the difference the body makes, so pixels it cannot reach are exactly still and cost nothing.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

struct V {
  double x = 0, y = 0, z = 0;
};
V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
V operator*(V a, V b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
V operator*(double s, V a) { return {s * a.x, s * a.y, s * a.z}; }
double dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V cross(V a, V b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
double norm(V a) { return std::sqrt(dot(a, a)); }
V unit(V a) { return (1.0 / norm(a)) * a; }
constexpr double kPi = 3.14159265358979323846, kFar = 1e30, kSkin = 1e-7;

struct Random {
  std::uint64_t state;
  double operator()() {  // splitmix64
    std::uint64_t z = (state += 0x9e3779b97f4a7c15ULL);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
  }
};

/// Points of the R_d sequence: stratified in every dimension and in most pairs of them.
struct Stratified {
  static constexpr int kDimensions = 11;
  std::array<double, kDimensions> step{};
  Stratified() {
    double g = 1.0;
    for (int i = 0; i < 60; ++i) g = std::pow(1.0 + g, 1.0 / (kDimensions + 1));
    for (int d = 0; d < kDimensions; ++d) step[d] = std::fmod(std::pow(g, -(d + 1.0)), 1.0);
  }
  double at(int d, int sample, double shift) const {
    const double u = shift + sample * step[d];
    return u - std::floor(u);
  }
};
const Stratified kSequence;
enum Dimension { kPixelX, kPixelY, kTime, kLampU, kLampV, kLamp2U, kLamp2V, kSkyU, kSkyV, kLobeU, kLobeV };
using Draw = std::array<double, Stratified::kDimensions>;

// --- Texture: value noise and the floors made of it -------------------------------------------------
double cell(int i, int j) {
  return Random{(static_cast<std::uint64_t>(static_cast<std::uint32_t>(i)) << 32) ^ static_cast<std::uint32_t>(j)}();
}
double noise(double x, double y) {
  const double fx = std::floor(x), fy = std::floor(y), u = x - fx, v = y - fy;
  const int i = static_cast<int>(fx), j = static_cast<int>(fy);
  const double a = u * u * (3 - 2 * u), b = v * v * (3 - 2 * v);
  return (1 - b) * ((1 - a) * cell(i, j) + a * cell(i + 1, j)) +
         b * ((1 - a) * cell(i, j + 1) + a * cell(i + 1, j + 1)) - 0.5;
}
double cloud(double x, double y, int octaves) {
  double sum = 0, weight = 1;
  for (int k = 0; k < octaves; ++k, weight *= 0.6, x = 2.03 * x + 7.1, y = 1.97 * y - 3.3) sum += weight * noise(x, y);
  return sum;
}

enum FloorKind { kPlain, kPaper, kWood, kSpeckle, kSquared };

// --- Scene ------------------------------------------------------------------------------------------
struct Lamp {
  V centre, u, v, radiance, normal;
  double area = 0;
};
struct Post {  // standing on the floor, does not move
  double x, y, radius, height;
  V albedo;
};
struct Pose {
  V at;
  std::array<V, 3> axis;  // columns of the rotation: body axes in the world
  V to_body(V w) const { return {dot(axis[0], w), dot(axis[1], w), dot(axis[2], w)}; }
  V to_world(V b) const { return b.x * axis[0] + b.y * axis[1] + b.z * axis[2]; }
};
struct Scene {
  int width, height, samples, steps, row_steps, floor_kind;
  double fx, fy, cx, cy, k1, k2;
  std::array<V, 3> rows;  // world to camera
  V eye;
  double R, Ri, h, axle_radius, axle_from, axle_to, reach;
  V face, wall, mirror, mark, floor, sky_up, sky_side;
  double lobe, grain, mark_at, mark_radius, mark_angle, floor_contrast, floor_scale, floor_cos, floor_sin, floor_sheen;
  int mark_up, mark_down;
  std::uint64_t seed;
  std::array<Lamp, 2> lamps;
  std::vector<Post> posts;
};

Scene read_scene(const char* path) {
  std::ifstream in(path);
  std::map<std::string, std::vector<double>> keys;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string key;
    words >> key;
    keys[key] = std::vector<double>(std::istream_iterator<double>(words), {});
  }
  const auto list = [&](const std::string& key, std::size_t n) -> const std::vector<double>& {
    const auto& values = keys[key];
    if (values.size() < n) throw std::runtime_error(std::string(path) + ": key " + key);
    return values;
  };
  const auto one = [&](const std::string& key) { return list(key, 1)[0]; };
  const auto vec = [&](const std::string& key, std::size_t i = 0) {
    const auto& n = list(key, i + 3);
    return V{n[i], n[i + 1], n[i + 2]};
  };
  const auto whole = [&](const std::string& key) { return static_cast<int>(one(key)); };
  Scene s;
  s.width = whole("width"), s.height = whole("height"), s.samples = whole("samples"), s.steps = whole("steps");
  s.row_steps = whole("row_steps");
  s.fx = one("fx"), s.fy = one("fy"), s.cx = one("cx"), s.cy = one("cy"), s.k1 = one("k1"), s.k2 = one("k2");
  for (std::size_t i = 0; i < 3; ++i) s.rows[i] = vec("R", 3 * i);
  s.eye = vec("eye");
  s.R = one("radius"), s.Ri = one("inner_radius"), s.h = one("half_thickness");
  s.axle_radius = one("axle_radius"), s.axle_from = one("axle_from"), s.axle_to = one("axle_to");
  s.reach = std::max({std::hypot(s.R, s.h), -s.axle_from, s.axle_to});
  s.face = vec("face"), s.wall = vec("wall"), s.mirror = vec("mirror"), s.mark = vec("mark");
  s.lobe = one("lobe"), s.grain = one("grain");
  s.mark_at = one("mark_at"), s.mark_radius = one("mark_radius"), s.mark_angle = one("mark_angle");
  s.mark_up = whole("mark_up"), s.mark_down = whole("mark_down");
  s.floor_kind = whole("floor_kind"), s.floor = vec("floor"), s.floor_contrast = one("floor_contrast");
  s.floor_scale = one("floor_scale"), s.floor_cos = std::cos(one("floor_turn")),
  s.floor_sin = std::sin(one("floor_turn")), s.floor_sheen = one("floor_sheen");
  s.sky_up = vec("sky_up"), s.sky_side = vec("sky_side");
  s.seed = static_cast<std::uint64_t>(one("seed"));
  for (int i = 0; i < 2; ++i) {
    const std::string key = "lamp" + std::to_string(i);
    Lamp& l = s.lamps[i];
    l = {vec(key), vec(key, 3), vec(key, 6), vec(key, 9), {}, 0};
    const V n = cross(l.u, l.v);  // half edges: the lamp is 2u by 2v
    l.area = 4 * norm(n), l.normal = unit(n);
    if (l.normal.z > 0) l.normal = -1.0 * l.normal;
  }
  const auto& p = keys["posts"];
  for (std::size_t i = 0; i + 7 <= p.size(); i += 7)
    s.posts.push_back({p[i], p[i + 1], p[i + 2], p[i + 3], {p[i + 4], p[i + 5], p[i + 6]}});
  return s;
}

V floor_albedo(const Scene& s, double wx, double wy) {
  const double c = s.floor_cos, d = s.floor_sin;
  const double x = (c * wx + d * wy) / s.floor_scale, y = (-d * wx + c * wy) / s.floor_scale;
  double f = 0.1 * cloud(0.15 * x, 0.15 * y, 2);
  switch (s.floor_kind) {
    case kPlain:
      break;
    case kPaper:
      f += 0.5 * cloud(x, 3 * y, 2) + 0.3 * noise(9 * x, 9 * y);
      break;
    case kWood: {
      const double plank = std::floor(0.05 * y), warp = 6 * noise(0.03 * x + 13 * plank, 0.2 * y);
      f += 0.7 * cloud(0.08 * x + 31 * plank, 1.2 * y + warp, 3) + 0.5 * (cell(static_cast<int>(plank), 5) - 0.5);
      if (0.05 * y - plank < 0.012) f -= 0.9;
      break;
    }
    case kSpeckle:
      f += noise(x, y) > 0.18 ? 0.8 : noise(1.7 * x + 5, 1.7 * y) < -0.22 ? -0.9 : 0.25 * noise(4 * x, 4 * y);
      break;
    case kSquared: {
      const auto line = [](double q, double w) { return std::abs(q - std::round(q)) < w; };
      if (line(0.1 * x, 0.012) || line(0.1 * y, 0.012))
        f -= 1.0;
      else if (line(0.5 * x, 0.03) || line(0.5 * y, 0.03))
        f -= 0.45;
      break;
    }
  }
  const double g = std::clamp(1 + s.floor_contrast * f, 0.02, 1.8);
  return {std::min(0.95, g * s.floor.x), std::min(0.95, g * s.floor.y), std::min(0.95, g * s.floor.z)};
}

V sky(const Scene& s, V d) {
  const double up = std::max(0.0, d.z);
  return up * s.sky_up + (1 - up) * s.sky_side;
}

// --- Rays -------------------------------------------------------------------------------------------
enum Part { kNothing, kFace, kWall, kAxle, kPost, kFloor };
struct Hit {
  double t = kFar;
  Part part = kNothing;
  V n, local;
  const Post* post = nullptr;
};

/// The tube of radius r about z between z0 and z1, seen from outside and from inside.
void hit_tube(V o, V d, double r, double z0, double z1, Part part, Hit& hit) {
  const double a = d.x * d.x + d.y * d.y, b = o.x * d.x + o.y * d.y, c = o.x * o.x + o.y * o.y - r * r;
  const double q = b * b - a * c;
  if (q <= 0 || a < 1e-18) return;
  for (const double t : {(-b - std::sqrt(q)) / a, (-b + std::sqrt(q)) / a}) {
    const V p = o + t * d;
    if (t < kSkin || t >= hit.t || p.z < z0 || p.z > z1) continue;
    hit = {t, part, {p.x / r, p.y / r, 0}, p, hit.post};
    return;
  }
}
void hit_lid(V o, V d, double r0, double r1, double z, Part part, Hit& hit) {
  const double t = (z - o.z) / d.z;
  if (!(t > kSkin && t < hit.t)) return;
  const V p = o + t * d;
  const double r2 = p.x * p.x + p.y * p.y;
  if (r2 >= r0 * r0 && r2 <= r1 * r1) hit = {t, part, {0, 0, 1}, p, hit.post};
}

bool near(V o, V d, V centre, double radius) {
  const V to = centre - o;
  const double along = dot(to, d), off2 = dot(to, to) - along * along;
  return off2 < radius * radius && along > -radius;
}

Hit hit_body(const Scene& s, const Pose& pose, V o, V d) {
  Hit hit;
  if (!near(o, d, pose.at, s.reach)) return hit;
  const V lo = pose.to_body(o - pose.at), ld = pose.to_body(d);
  hit_tube(lo, ld, s.R, -s.h, s.h, kWall, hit);
  if (s.Ri > 0) hit_tube(lo, ld, s.Ri, -s.h, s.h, kWall, hit);
  hit_lid(lo, ld, s.Ri, s.R, s.h, kFace, hit);
  hit_lid(lo, ld, s.Ri, s.R, -s.h, kFace, hit);
  if (s.axle_radius > 0) {
    hit_tube(lo, ld, s.axle_radius, s.axle_from, s.axle_to, kAxle, hit);
    hit_lid(lo, ld, 0, s.axle_radius, s.axle_to, kAxle, hit);
  }
  if (hit.part != kNothing) hit.n = pose.to_world(hit.n);
  return hit;
}

Hit hit_things(const Scene& s, const Pose* pose, V o, V d) {
  Hit hit;
  if (pose) hit = hit_body(s, *pose, o, d);
  for (const Post& post : s.posts) {
    const V at{post.x, post.y, 0};
    Hit own;
    own.t = hit.t, own.post = &post;
    hit_tube(o - at, d, post.radius, 0, post.height, kPost, own);
    hit_lid(o - at, d, 0, post.radius, post.height, kPost, own);
    if (own.part == kPost) hit = own;
  }
  if (dot(hit.n, d) > 0) hit.n = -1.0 * hit.n;
  return hit;
}

// --- Light ------------------------------------------------------------------------------------------
struct Frame {
  V t, b, n;
  explicit Frame(V normal) : n(normal) {
    t = unit(std::abs(n.x) > 0.5 ? cross(n, {0, 1, 0}) : cross(n, {1, 0, 0}));
    b = cross(n, t);
  }
  /// Direction of density proportional to cos^power about n.
  V lobe(double u, double v, double power) const {
    const double c = power == 1 ? std::sqrt(1 - u) : std::pow(1 - u, 1 / (power + 1));
    const double r = std::sqrt(std::max(0.0, 1 - c * c));
    return r * std::cos(2 * kPi * v) * t + r * std::sin(2 * kPi * v) * b + c * n;
  }
};

class Light {
 public:
  Light(const Scene& scene, double reach_m) : s_(scene), reach_(reach_m) {
    constexpr int kN = 24;
    for (int j = 0; j <= kGrid; ++j)
      for (int i = 0; i <= kGrid; ++i) {
        const V p{(2.0 * i / kGrid - 1) * reach_, (2.0 * j / kGrid - 1) * reach_, 0};
        V sum;
        for (const Lamp& l : s_.lamps)
          for (int k = 0; k < kN * kN; ++k)
            sum = sum + (1.0 / (kN * kN)) * from_lamp(l, p, {0, 0, 1}, (k % kN + 0.5) / kN, (k / kN + 0.5) / kN).first;
        table_[j][i] = sum;
      }
    // Integral of sky times cosine: up and side weigh 2/3 and 1/3.
    sky_ = kPi * ((2.0 / 3) * s_.sky_up + (1.0 / 3) * s_.sky_side);
  }

  /// Irradiance a lamp's point (u, v) stands for, unhindered, and the vector to it.
  static std::pair<V, V> from_lamp(const Lamp& l, V p, V n, double u, double v) {
    const V to = l.centre + (2 * u - 1) * l.u + (2 * v - 1) * l.v - p;
    const double d2 = dot(to, to), d = std::sqrt(d2);
    const double c = dot(n, to) / d, cl = -dot(l.normal, to) / d;
    if (c <= 0 || cl <= 0) return {{}, to};
    return {(c * cl * l.area / d2) * l.radiance, to};
  }

  /// What leaves the floor at p towards the viewer.
  V floor(const Pose* pose, V p, V albedo, V view, const Draw& u, Random& random, int depth) const {
    V E = unhindered(p);
    const bool blockers = pose || !s_.posts.empty();
    if (blockers) {
      for (int k = 0; k < 2; ++k) {
        const auto [light, to] = from_lamp(s_.lamps[k], p, {0, 0, 1}, u[kLampU + 2 * k], u[kLampV + 2 * k]);
        if (light.x + light.y + light.z > 0 && blocked(pose, p, unit(to))) E = E - light;
      }
      const V d = Frame({0, 0, 1}).lobe(u[kSkyU], u[kSkyV], 1);
      const Hit hit = hit_things(s_, pose, p, d);
      if (hit.part != kNothing) E = E + kPi * (thing(pose, hit, p, d, random, depth + 1) - sky(s_, d));
    }
    E = {std::max(0.0, E.x), std::max(0.0, E.y), std::max(0.0, E.z)};
    V out = (1 / kPi) * (albedo * E);
    if (s_.floor_sheen <= 0) return out;
    const V r = Frame(unit(V{view.x, view.y, -view.z})).lobe(u[kLobeU], u[kLobeV], 800);
    const double fresnel = s_.floor_sheen * (0.04 + 0.96 * std::pow(1 - std::abs(view.z), 5));
    const Hit hit = blockers && depth == 0 ? hit_things(s_, pose, p, r) : Hit{};
    return out + fresnel * (hit.part != kNothing ? thing(pose, hit, p, r, random, depth + 1) : sky(s_, r));
  }

  /// What leaves body or post at a hit of the ray (o, d). Several samples of the lamps where it is seen
  /// directly are not worth their cost beside those of the pixel.
  V thing(const Pose* pose, const Hit& hit, V o, V d, Random& random, int depth) const {
    Draw u;
    for (double& value : u) value = random();
    return thing(pose, hit, o, d, u, random, depth);
  }
  V thing(const Pose* pose, const Hit& hit, V o, V d, const Draw& u, Random& random, int depth) const {
    const V p = o + hit.t * d;
    const V albedo = colour(hit);
    const double gleam = s_.mirror.x + s_.mirror.y + s_.mirror.z, c = std::max(0.0, -dot(hit.n, d));
    const V mirrored = unit(d + 2 * c * hit.n);
    const auto lobe_density = [&](V way) {
      return (s_.lobe + 1) / (2 * kPi) * std::pow(std::max(0.0, dot(mirrored, way)), s_.lobe);
    };
    // A lamp seen in the gloss is looked for both by lamp and by lobe, each weighed by its density; without
    // that a small lamp in a wide lobe is a rain of sparks. Caustics, which have them too, are left out.
    V E, glint;
    for (int k = 0; k < 2; ++k) {
      const Lamp& l = s_.lamps[k];
      const auto [light, to] = from_lamp(l, p, hit.n, u[kLampU + 2 * k], u[kLampV + 2 * k]);
      if (light.x + light.y + light.z <= 0 || blocked(pose, p, unit(to))) continue;
      E = E + light;
      const double density = lobe_density(unit(to));
      glint = glint + (density / (density + lamp_density(l, to))) * l.radiance;
    }
    const V bounce = Frame(hit.n).lobe(u[kSkyU], u[kSkyV], 1);
    V out = (1 / kPi) * (albedo * (E + kPi * arriving(pose, p, bounce, random, depth, 0)));
    if (gleam > 0 && hit.part != kPost && depth < 2) {
      const V r = Frame(mirrored).lobe(u[kLobeU], u[kLobeV], s_.lobe);
      const double rise = std::pow(1 - c, 5);
      const V fresnel{s_.mirror.x + (1 - s_.mirror.x) * rise, s_.mirror.y + (1 - s_.mirror.y) * rise,
                      s_.mirror.z + (1 - s_.mirror.z) * rise};
      if (dot(r, hit.n) > 0)
        out = out + fresnel * arriving(pose, p, r, random, depth, depth == 0 ? lobe_density(r) : 0);
      if (depth == 0) out = out + fresnel * glint;
    }
    return out;
  }

 private:
  V unhindered(V p) const {
    const auto place = [&](double q) { return std::clamp((q / reach_ + 1) * kGrid / 2, 0.0, kGrid - 1e-9); };
    const double x = place(p.x), y = place(p.y);
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const double a = x - i, b = y - j;
    return (1 - b) * ((1 - a) * table_[j][i] + a * table_[j][i + 1]) +
           b * ((1 - a) * table_[j + 1][i] + a * table_[j + 1][i + 1]) + sky_;
  }
  bool blocked(const Pose* pose, V p, V d) const { return hit_things(s_, pose, p, d).part != kNothing; }

  /// Density with which from_lamp() picks this way to a lamp, per solid angle.
  static double lamp_density(const Lamp& l, V to) {
    const double d2 = dot(to, to);
    return d2 * std::sqrt(d2) / (l.area * std::max(1e-12, -dot(l.normal, to)));
  }

  /// @param density with which the way was chosen, if lamps count on it; else 0.
  V arriving(const Pose* pose, V p, V d, Random& random, int depth, double density) const {
    const Hit hit = hit_things(s_, pose, p, d);
    if (hit.part != kNothing)
      return depth < 2 ? thing(pose, hit, p, d, random, depth + 1) : 0.3 * (colour(hit) * sky(s_, {0, 0, 1}));
    if (d.z < -1e-6) {
      const V q = p - (p.z / d.z) * d;
      if (depth >= 2 || std::hypot(q.x, q.y) > reach_) return (0.7 / kPi) * (s_.floor * unhindered(q));
      Draw u;
      for (double& value : u) value = random();
      return floor(pose, {q.x, q.y, 0}, s_.floor, d, u, random, depth + 1);
    }
    if (density > 0)
      for (const Lamp& l : s_.lamps) {
        const double t = dot(l.centre - p, l.normal) / dot(d, l.normal);
        const V off = p + t * d - l.centre;
        if (t > 0 && std::abs(dot(off, l.u)) < dot(l.u, l.u) && std::abs(dot(off, l.v)) < dot(l.v, l.v))
          return (density / (density + lamp_density(l, t * d))) * l.radiance;
      }
    return sky(s_, d);
  }

  V colour(const Hit& hit) const {
    if (hit.part == kPost) return hit.post->albedo;
    if (hit.part == kAxle) return {0.35, 0.35, 0.36};
    const V q = hit.local;
    const bool marked = q.z > 0 ? s_.mark_up : s_.mark_down;
    if (hit.part == kFace && marked &&
        std::hypot(q.x - s_.mark_at * std::cos(s_.mark_angle), q.y - s_.mark_at * std::sin(s_.mark_angle)) <
            s_.mark_radius)
      return s_.mark;
    const V base = hit.part == kFace ? s_.face : s_.wall;
    if (s_.grain <= 0) return base;
    const double f = 1 + s_.grain * cloud(6 * q.x / s_.R, 6 * q.y / s_.R + (q.z > 0 ? 50 : 0), 3);
    return std::clamp(f, 0.1, 1.6) * base;
  }

  static constexpr int kGrid = 64;
  const Scene& s_;
  double reach_;
  V table_[kGrid + 1][kGrid + 1], sky_;
};

// --- Camera -----------------------------------------------------------------------------------------
/// World direction through the distorted pixel (x, y); the fixed point of the radial model.
V through(const Scene& s, double x, double y) {
  const double u0 = (x - s.cx) / s.fx, v0 = (y - s.cy) / s.fy;
  double u = u0, v = v0;
  for (int i = 0; i < 12; ++i) {
    const double r2 = u * u + v * v, f = 1 + r2 * (s.k1 + r2 * s.k2);
    u = u0 / f, v = v0 / f;
  }
  return unit(u * s.rows[0] + v * s.rows[1] + s.rows[2]);
}

class Camera {
 public:
  Camera(const Scene& scene, const Light& light) : s_(scene), light_(light) {
    still_.resize(static_cast<std::size_t>(s_.width) * s_.height);
    spot_ = ground_ = still_;
    corner_.resize(static_cast<std::size_t>(s_.width + 1) * (s_.height + 1));
    for (int row = 0; row <= s_.height; ++row)
      for (int x = 0; x <= s_.width; ++x) corner_[row * (s_.width + 1) + x] = through(s_, x - 0.5, row - 0.5);
#pragma omp parallel for schedule(dynamic, 8)
    for (int row = 0; row < s_.height; ++row)
      for (int x = 0; x < s_.width; ++x) {
        const std::size_t i = index(x, row);
        spot_[i] = on_floor(ray(x, row, 0.5, 0.5));
        for (int k = 0; k < kStill * kStill; ++k) {
          const V p = on_floor(ray(x, row, (k % kStill + 0.5) / kStill, (k / kStill + 0.5) / kStill));
          ground_[i] = ground_[i] + (1.0 / (kStill * kStill)) * floor_albedo(s_, p.x, p.y);
        }
        still_[i] = pixel(nullptr, x, row, s_.posts.empty() ? 16 : 64, Random{s_.seed + i}());
      }
  }

  /// A frame from the poses during its exposure.
  std::vector<float> expose(const std::vector<Pose>& poses, int number) const {
    std::vector<float> out(3 * still_.size());
#pragma omp parallel for schedule(dynamic, 4)
    for (int row = 0; row < s_.height; ++row)
      for (int x = 0; x < s_.width; ++x) {
        const std::size_t i = index(x, row);
        const double shift = Random{s_.seed * 7919 + i * 104729 + static_cast<std::uint64_t>(number) * 1299709}();
        const int samples = samples_for(poses, spot_[i]);
        const V c = samples > 0 ? pixel(&poses, x, row, samples, shift) : far(poses[poses.size() / 2], i);
        out[3 * i] = static_cast<float>(c.x), out[3 * i + 1] = static_cast<float>(c.y),
                out[3 * i + 2] = static_cast<float>(c.z);
      }
    return out;
  }

 private:
  static constexpr int kStill = 6;

  std::size_t index(int x, int row) const { return static_cast<std::size_t>(row) * s_.width + x; }
  V on_floor(V d) const { return s_.eye - (s_.eye.z / d.z) * d; }
  V ray(int x, int row, double u, double v) const {
    const V* a = &corner_[row * (s_.width + 1) + x];
    const V* b = a + s_.width + 1;
    return unit((1 - v) * ((1 - u) * a[0] + u * a[1]) + v * ((1 - u) * b[0] + u * b[1]));
  }

  /// All where the body may hide the floor's spot from the eye, a third where it may from a lamp or a good
  /// part of the sky, else none.
  int samples_for(const std::vector<Pose>& poses, V spot) const {
    const double moved = norm(poses.front().at - poses.back().at), margin = 1.05 * s_.reach + moved;
    const V at = poses[poses.size() / 2].at;
    if (near(s_.eye, unit(spot - s_.eye), at, margin)) return s_.samples;
    const V below{at.x, at.y, 0};
    if (norm(spot - below) < (s_.floor_sheen > 0 ? 3 : 2) * margin) return s_.samples / 3;
    for (const Lamp& l : s_.lamps) {
      const V to = l.centre - spot;
      const double blur = (norm(l.u) + norm(l.v)) * norm(at - spot) / norm(to);
      if (l.radiance.x > 0 && near(spot, unit(to), at, margin + blur)) return s_.samples / 3;
    }
    return 0;
  }

  V pixel(const std::vector<Pose>* poses, int x, int row, int samples, double shift) const {
    Random still{s_.seed + 31 * index(x, row)}, moving{static_cast<std::uint64_t>(shift * 0x1p52)};
    Draw shifts;
    for (int d = 0; d < Stratified::kDimensions; ++d) shifts[d] = d < kTime ? still() : moving();
    V sum;
    for (int k = 0; k < samples; ++k) {
      Draw u;
      for (int d = 0; d < Stratified::kDimensions; ++d) u[d] = kSequence.at(d, k, shifts[d]);
      const V d = ray(x, row, u[kPixelX], u[kPixelY]);
      const double step = u[kTime] * s_.row_steps + (s_.steps - s_.row_steps) * (row / (s_.height - 1.0));
      const Pose* pose = poses ? &(*poses)[static_cast<std::size_t>(step)] : nullptr;
      const Hit hit = hit_things(s_, pose, s_.eye, d);
      if (hit.part != kNothing)
        sum = sum + light_.thing(pose, hit, s_.eye, d, u, moving, 0);
      else
        sum = sum + light_.floor(pose, on_floor(d), ground_[index(x, row)], d, u, moving, 0);
    }
    return (1.0 / samples) * sum;
  }

  /// The still picture less the sky a small body far off takes away (its area seen from there).
  V far(const Pose& pose, std::size_t i) const {
    const V to = pose.at - spot_[i];
    const double d2 = dot(to, to), tilt = std::abs(dot(pose.axis[2], to)) / std::sqrt(d2);
    const double area =
        kPi * (s_.R * s_.R - s_.Ri * s_.Ri) * tilt + 4 * s_.R * s_.h * std::sqrt(std::max(0.0, 1 - tilt * tilt));
    const double taken = area * to.z / std::sqrt(d2) / d2 / kPi;
    return still_[i] - (taken * 0.7) * (ground_[i] * s_.sky_side);
  }

  const Scene& s_;
  const Light& light_;
  std::vector<V> still_, spot_, ground_, corner_;
};

Pose pose_of(const double* n) {
  const double w = n[3], x = n[4], y = n[5], z = n[6];
  return {{n[0], n[1], n[2]},
          {{{1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
            {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
            {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}}}};
}

int main(int argc, char** argv) try {
  if (argc != 3) throw std::runtime_error("usage: tracer SCENE POSES > frames.f32");
  const Scene scene = read_scene(argv[1]);
  std::ifstream in(argv[2], std::ios::binary);
  const Light light(scene, 1.3 * scene.eye.z * (0.3 + std::hypot(scene.width, scene.height) / scene.fx));
  const Camera camera(scene, light);
  std::vector<double> numbers(static_cast<std::size_t>(7 * scene.steps));
  for (int frame = 0;
       in.read(reinterpret_cast<char*>(numbers.data()), static_cast<std::streamsize>(8 * numbers.size())); ++frame) {
    std::vector<Pose> poses;
    for (int k = 0; k < scene.steps; ++k) poses.push_back(pose_of(&numbers[static_cast<std::size_t>(7 * k)]));
    const std::vector<float> picture = camera.expose(poses, frame);
    std::fwrite(picture.data(), sizeof(float), picture.size(), stdout);
  }
  return 0;
} catch (const std::exception& error) {
  std::cerr << "tracer: " << error.what() << '\n';
  return 1;
}
