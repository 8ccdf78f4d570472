#include "study/made_tracks.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/table.hpp"
#include "trochoid/model/inertia.hpp"
#include "trochoid/model/predictor.hpp"
#include "trochoid/model/simulate.hpp"
#include "trochoid/model/sundials.hpp"

namespace trochoid::tools {
namespace {

using Generator = std::mt19937_64;

double uniform(double low, double high, Generator& generator) {
  return std::uniform_real_distribution<double>(low, high)(generator);
}

double log_uniform(double low, double high, Generator& generator) {
  return std::exp(uniform(std::log(low), std::log(high), generator));
}

double either_sign(Generator& generator) {
  return uniform(0.0, 1.0, generator) < 0.5 ? -1.0 : 1.0;
}

void add_noise(MadeTrack& made, double sigma_m, Generator& generator) {
  std::normal_distribution<double> normal;
  for (data::TrackSample& sample : made.track.samples) {
    const Eigen::Vector2d noise{normal(generator), normal(generator)};
    sample.centre_m += sigma_m * noise;
    made.chi2_of_truth += noise.squaredNorm();
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * sigma_m * sigma_m;
  }
}

std::vector<double> even_times(double duration_s, int samples) {
  std::vector<double> t_s;
  for (int i = 0; i < samples; ++i) t_s.push_back(duration_s * i / (samples - 1));
  return t_s;
}

// --- the heavy symmetric top ------------------------------------------------------------------

struct TopTruth {
  double a, b, l, theta, phi, dtheta, dphi;
  [[nodiscard]] std::map<std::string, double> by_name() const {
    return {{"a_1_s2", a},        {"b_1_s", b},     {"l_m", l},
            {"theta_rad", theta}, {"phi_rad", phi}, {"dtheta_rad_s", dtheta},
            {"dphi_rad_s", dphi}};
  }
};

// Period of theta: u = cos(theta) obeys u'^2 = (1-u^2)(2 eps - 2 a u) - (beta - b u)^2, a cubic
// with roots u1 <= u <= u2 <= u3; T = 2 K(m)/lambda.
double nutation_period_s(const TopTruth& top) {
  const double c = std::cos(top.theta), s2 = 1.0 - c * c;
  const double beta = top.dphi * s2 + top.b * c;
  const double eps = 0.5 * (top.dtheta * top.dtheta + top.dphi * top.dphi * s2) + top.a * c;
  // 2a u^3 - (2 eps + b^2) u^2 + (2 beta b - 2a) u + 2 eps - beta^2 = 0, monic and depressed.
  const double p2 = -(2.0 * eps + top.b * top.b) / (2.0 * top.a);
  const double p1 = (2.0 * beta * top.b - 2.0 * top.a) / (2.0 * top.a);
  const double p0 = (2.0 * eps - beta * beta) / (2.0 * top.a);
  const double q = p1 - p2 * p2 / 3.0;
  const double r = p2 * (2.0 * p2 * p2 / 27.0 - p1 / 3.0) + p0;
  const double size = 2.0 * std::sqrt(std::max(-q / 3.0, 0.0));
  const double angle = std::acos(std::clamp(3.0 * r / (q * size), -1.0, 1.0)) / 3.0;
  std::array<double, 3> root{};
  for (int k = 0; k < 3; ++k) root[k] = size * std::cos(angle - data::kTurn * k / 3.0) - p2 / 3.0;
  std::sort(root.begin(), root.end());
  const double lambda = std::sqrt(0.5 * top.a * (root[2] - root[0]));
  const double modulus2 = (root[1] - root[0]) / (root[2] - root[0]);
  return 2.0 * std::comp_ellint_1(std::sqrt(std::clamp(modulus2, 0.0, 1.0))) / lambda;
}

TopTruth random_top(Generator& generator) {
  TopTruth top{};
  top.b = log_uniform(0.5, 40.0, generator) * either_sign(generator);
  top.a = top.b * top.b * log_uniform(0.015, 0.75, generator);
  top.l = log_uniform(0.01, 0.2, generator);
  top.theta = uniform(0.25, 1.2, generator);
  top.phi = uniform(-data::kPi, data::kPi, generator);
  top.dtheta = 0.3 * std::abs(top.b) * uniform(-1.0, 1.0, generator);
  top.dphi = 0.3 * std::abs(top.b) * uniform(-1.0, 1.0, generator);
  return top;
}

data::Scene top_scene() {
  data::Scene scene;
  scene.model.name = "top";
  scene.support.kind = data::SupportKind::pivot;
  scene.support.pivot_m = Eigen::Vector3d::Zero();
  return scene;
}

// Angular momentum over I (L) and axis k as world vectors: L' = a z x k, k' = L x k.
data::Track top_path(const TopTruth& top, const std::vector<double>& t_s) {
  model::Ode ode;
  ode.states = 6;
  ode.derivative = [a = top.a](double, const double* y, double* dy) {
    dy[0] = -a * y[4];
    dy[1] = a * y[3];
    dy[2] = 0.0;
    dy[3] = y[1] * y[5] - y[2] * y[4];
    dy[4] = y[2] * y[3] - y[0] * y[5];
    dy[5] = y[0] * y[4] - y[1] * y[3];
  };
  const double s = std::sin(top.theta), c = std::cos(top.theta);
  const Eigen::Vector3d node(std::cos(top.phi), std::sin(top.phi), 0.0);
  const Eigen::Vector3d k(s * std::sin(top.phi), -s * std::cos(top.phi), c);
  // L = dtheta node + dphi sin(theta) e2 + b k with e2 = k x node.
  const Eigen::Vector3d L = top.dtheta * node + top.dphi * s * k.cross(node) + top.b * k;
  Eigen::VectorXd start(6);
  start << L, k;
  model::SundialsOptions options;
  options.method = model::SundialsMethod::arkode_erk;
  options.rtol = 1e-11;
  options.atol = Eigen::VectorXd::Constant(6, 1e-12);
  const model::SundialsRun run = model::integrate_sundials(ode, 0.0, start, t_s, options);
  data::Track track;
  for (Eigen::Index i = 0; i < run.states.rows(); ++i) {
    data::TrackSample sample;
    sample.t_s = t_s[static_cast<std::size_t>(i)];
    sample.centre_m = top.l * run.states.row(i).segment<2>(3).transpose();
    track.samples.push_back(sample);
  }
  return track;
}

// Cramer-Rao standard deviation of l over l.
double length_error(const TopTruth& top, const std::vector<double>& t_s, double noise) {
  const auto predictor = model::make_predictor(top_scene());
  Eigen::VectorXd values(predictor->parameters().size());
  for (Eigen::Index i = 0; i < values.size(); ++i)
    values[i] = predictor->parameters()[static_cast<std::size_t>(i)].value;
  model::PredictRequest request;
  request.t_s = t_s;
  int column = 0, length = 0;
  std::vector<double> scale;
  for (const auto& [name, value] : top.by_name()) {
    const int index = predictor->index_of(name);
    values[index] = value;
    request.derivatives.push_back(index);
    if (name == "l_m") length = column;
    scale.push_back(std::max(std::abs(value), 1.0));
    ++column;
  }
  const model::Prediction run = predictor->predict(values, request);
  const Eigen::MatrixXd scaled =
      run.jacobian * Eigen::Map<const Eigen::VectorXd>(scale.data(), column).asDiagonal();
  if (!scaled.allFinite()) return 1.0;
  const Eigen::MatrixXd inverse =
      (scaled.transpose() * scaled).ldlt().solve(Eigen::MatrixXd::Identity(column, column));
  const double variance = inverse(length, length) * scale[length] * scale[length];
  return variance > 0.0 ? noise * std::sqrt(variance) : 1.0;
}

void make_top(const MadeTrackOptions& options, Generator& generator, MadeTrack& made) {
  const bool thesis = options.model == "thesis";
  TopTruth top{0.098, 0.75, 0.1, data::kPi / 3.0, 0.0, 0.0, 0.0};
  double duration_s = options.duration_s > 0.0 ? options.duration_s : 10.0;
  std::vector<double> t_s;
  for (bool drawn = false; !drawn;) {
    if (!thesis) top = random_top(generator);
    int samples = static_cast<int>(std::lround(duration_s * options.rate_hz)) + 1;
    if (!thesis && options.duration_s <= 0.0) {
      duration_s = 2.5 * nutation_period_s(top);
      samples = 150;
    }
    if (!std::isfinite(duration_s)) continue;
    t_s = even_times(duration_s, samples);
    drawn = thesis || length_error(top, t_s, options.noise) < 0.1;
  }
  made.scene = top_scene();
  made.track = top_path(top, t_s);
  made.truth = top.by_name();
  made.judged = {"a_1_s2", "b_1_s", "l_m"};
  add_noise(made, options.noise * top.l, generator);
}

// --- bodies on the floor ----------------------------------------------------------------------

// Runs the scene, through SUNDIALS (not the stepper the fit uses) where its model goes through
// that: a puck does not. An early end (flat, rim switch) leaves a shorter track.
void simulate(double psi_sigma_rad, Generator& generator, MadeTrack& made) {
  data::Scene scene = made.scene;
  scene.run.integrator = scene.model.name == "puck" ? "dop853" : "cvode-adams";
  scene.run.tolerance = 1e-11;
  const model::Trajectory run = model::simulate(scene);
  const data::Table table{.header = {}, .columns = run.columns, .values = run.values};
  const Eigen::VectorXd t = table.column("t_s"), x = table.column("x_m"), y = table.column("y_m");
  std::normal_distribution<double> normal;
  for (Eigen::Index i = 0; i < t.size(); ++i) {
    data::TrackSample sample;
    sample.t_s = t[i];
    sample.centre_m = {x[i], y[i]};
    if (psi_sigma_rad > 0.0) {
      const double noise = normal(generator);
      made.chi2_of_truth += noise * noise;
      sample.psi =
          data::MeasuredAngle{table.column("psi_rad")[i] + psi_sigma_rad * noise, psi_sigma_rad};
    }
    made.track.samples.push_back(sample);
  }
}

void random_body(Generator& generator, data::Body& body) {
  const bool ring = uniform(0.0, 1.0, generator) < 0.5;
  body.kind = ring ? data::BodyKind::ring : data::BodyKind::disc;
  body.radius_m = uniform(0.015, 0.05, generator);
  if (ring) body.inner_radius_m = body.radius_m * uniform(0.7, 0.95, generator);
  body.thickness_m = body.radius_m * uniform(0.05, 0.3, generator);
  body.mass_kg = 8000.0 * data::kPi * body.thickness_m *
                 (body.radius_m * body.radius_m - body.inner_radius_m * body.inner_radius_m);
}

void make_rolling(const MadeTrackOptions& options, Generator& generator, MadeTrack& made) {
  for (;;) {
    made = {};
    data::Scene& scene = made.scene;
    random_body(generator, scene.body.emplace());
    scene.model.name = "rolling";
    const double R = scene.body->radius_m, g = scene.model.gravity_m_s2;
    const model::CentralInertia inertia = model::central_inertia(*scene.body);
    const double theta = uniform(0.6, 1.3, generator);
    // Precession of the Euler disc at that tilt, the CoM at rest; the spin sets it in motion.
    const double precession =
        std::sqrt(inertia.mass_kg * g * R / (inertia.transverse_kg_m2 * std::sin(theta))) *
        uniform(0.85, 1.2, generator) * either_sign(generator);
    const double unit = inertia.mass_kg * std::sqrt(g * R * R * R);
    const double across = unit * log_uniform(1e-3, 1e-2, generator);
    const double along = across * uniform(0.5, 6.0, generator);
    scene.model.air_linear_N_m_s = Eigen::Vector3d(across, across, along);
    scene.start.theta_rad = theta;
    scene.start.phi_rad = uniform(-data::kPi, data::kPi, generator);
    scene.start.w1_rad_s = 0.05 * precession * uniform(-1.0, 1.0, generator);
    scene.start.w2_rad_s = precession * std::sin(theta);
    scene.start.w3_rad_s = precession * uniform(-0.3, 0.3, generator);
    scene.run.until_s =
        options.duration_s > 0.0 ? options.duration_s : 8.0 * data::kTurn / std::abs(precession);
    const int samples =
        options.duration_s > 0.0 ? static_cast<int>(options.duration_s * options.rate_hz) : 150;
    scene.run.rate_hz = samples / scene.run.until_s;
    simulate(0.0, generator, made);
    if (static_cast<int>(made.track.samples.size()) < samples) continue;
    made.truth = {{"theta_rad", theta},
                  {"phi_rad", *scene.start.phi_rad},
                  {"w1_rad_s", *scene.start.w1_rad_s},
                  {"w2_rad_s", *scene.start.w2_rad_s},
                  {"w3_rad_s", *scene.start.w3_rad_s},
                  {"x_m", made.track.samples[0].centre_m.x()},
                  {"y_m", made.track.samples[0].centre_m.y()}};
    add_noise(made, options.noise * R, generator);
    // The fit is told that there is air, and a typical size.
    scene.start = {};
    scene.model.air_linear_N_m_s = Eigen::Vector3d::Constant(3e-3 * unit);
    const auto predictor = model::make_predictor(scene);
    for (const model::ParameterInfo& info : predictor->parameters())
      if (info.name.starts_with("air_linear")) {
        made.truth[info.name] = info.name.ends_with("[3]") ? along : across;
        made.judged.push_back(info.name);
      }
    return;
  }
}

void make_puck(const MadeTrackOptions& options, Generator& generator, MadeTrack& made) {
  data::Scene& scene = made.scene;
  data::Body& body = scene.body.emplace();
  body.kind = data::BodyKind::disc;
  body.radius_m = uniform(0.015, 0.05, generator);
  body.thickness_m = 0.2 * body.radius_m;
  scene.support.kind = data::SupportKind::flat;
  scene.model.name = "puck";
  const double friction = log_uniform(0.05, 0.4, generator);
  scene.model.friction = friction;
  const double speed = log_uniform(0.2, 2.0, generator);
  const double heading = uniform(-data::kPi, data::kPi, generator);
  scene.start.x_m = scene.start.y_m = 0.0;
  scene.start.vx_m_s = speed * std::cos(heading);
  scene.start.vy_m_s = speed * std::sin(heading);
  scene.start.psi_rad = uniform(-data::kPi, data::kPi, generator);
  scene.start.w3_rad_s =
      either_sign(generator) * speed / body.radius_m * log_uniform(0.05, 3.0, generator);
  // 0.8 of the time to rest without spin; with spin it slides on a little longer.
  scene.run.until_s = options.duration_s > 0.0
                          ? options.duration_s
                          : 0.8 * speed / (friction * scene.model.gravity_m_s2);
  scene.run.rate_hz = std::max(options.rate_hz, 30.0 / scene.run.until_s);
  made.truth = {{"friction", friction},
                {"x_m", 0.0},
                {"y_m", 0.0},
                {"vx_m_s", *scene.start.vx_m_s},
                {"vy_m_s", *scene.start.vy_m_s},
                {"psi_rad", *scene.start.psi_rad},
                {"w3_rad_s", *scene.start.w3_rad_s},
                {"contact_radius_m", body.radius_m}};
  made.judged = {"friction"};
  simulate(data::kPi / 180.0, generator, made);
  add_noise(made, options.noise * body.radius_m, generator);
  scene.start = {};
  scene.model.friction = 0.2;
}

}  // namespace

MadeTrack make_track(const MadeTrackOptions& options, std::mt19937_64& generator) {
  MadeTrack made;
  if (options.model == "top" || options.model == "thesis")
    make_top(options, generator, made);
  else if (options.model == "rolling")
    make_rolling(options, generator, made);
  else if (options.model == "puck")
    make_puck(options, generator, made);
  else
    throw InputError(
        fmt::format("--model {}: made tracks are top, thesis, rolling or puck", options.model));
  return made;
}

std::mt19937_64 generator_of(std::uint64_t seed, int scene) {
  // seed_seq takes 32 bits of each number.
  std::seed_seq sequence{seed & 0xffffffffU, seed >> 32U, static_cast<std::uint64_t>(scene)};
  return std::mt19937_64(sequence);
}

std::map<std::string, double> start_off(const MadeTrack& made, std::mt19937_64& generator) {
  std::map<std::string, double> start;
  for (const auto& [name, value] : made.truth) {
    const double off = either_sign(generator) * uniform(0.3, 0.5, generator);
    start[name] = std::abs(value) > 0.0 ? value * (1.0 + off) : off;
  }
  return start;
}

}  // namespace trochoid::tools
