#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "commands.hpp"
#include "common/outputs.hpp"
#include "common/scene_library.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/model/counted.hpp"
#include "trochoid/model/predictor.hpp"
#include "trochoid/model/rolling.hpp"
#include "trochoid/model/sliding.hpp"
#include "trochoid/model/top.hpp"
#ifdef TROCHOID_HAS_TRACKING
#include "trochoid/tracking/frame_source.hpp"
#endif

// study lean: what a scene leaves out, and what that saves. The full variant computes the same
// motion, with coefficients of zero.
namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct LeanOptions {
  fs::path out = "study-lean", video;
};

struct LeanRow {
  std::string part, has;
  long operations = 0;  ///< of one right-hand side, 0 = not applicable
  double time_us = 0.0;
};

/// Fastest of many runs, at least 50 ms of them.
double fastest_us(const std::function<void()>& work) {
  using Clock = std::chrono::steady_clock;
  constexpr double kEnough_us = 5e4;
  double best = INFINITY, spent = 0.0;
  while (spent < kEnough_us) {
    const auto start = Clock::now();
    work();
    const std::chrono::duration<double, std::micro> elapsed = Clock::now() - start;
    best = std::min(best, elapsed.count());
    spent += elapsed.count();
  }
  return best;
}

std::vector<double> times_s(double until_s, double rate_hz) {
  std::vector<double> t(static_cast<std::size_t>(until_s * rate_hz) + 1);
  std::iota(t.begin(), t.end(), 0.0);
  for (double& value : t) value /= rate_hz;
  return t;
}

double predict_us(const data::Scene& scene, const model::PredictRequest& request) {
  const auto predictor = model::make_predictor(scene);
  Eigen::VectorXd values(static_cast<Eigen::Index>(predictor->parameters().size()));
  for (Eigen::Index i = 0; i < values.size(); ++i)
    values[i] = predictor->parameters()[static_cast<std::size_t>(i)].value;
  return fastest_us([&] { (void)predictor->predict(values, request); });
}

template <int N>
model::State<model::Counted, N> counted_state(const model::State<double, N>& state) {
  model::State<model::Counted, N> counted;
  for (int i = 0; i < N; ++i) counted[i] = state[i];
  return counted;
}

template <template <class> class... Terms>
long rolling_operations() {
  const model::Rolling<model::Counted, Terms...> system{
      .body = {.m = 0.2, .A = 5e-5, .C = 1e-4, .R = 0.03, .h = 0.002}, .losses = {}};
  const model::State<model::Counted, 8> y{{0.1, 1.0, 0.2, 0.3, 4.0, -10.0, 0.0, 0.0}};
  return model::operations_of(system, y).total();
}

void add_terms(std::vector<LeanRow>& rows) {
  using namespace model;
  const std::vector<double> t_s = times_s(2.0, 240.0);
  PredictRequest request;
  request.t_s = t_s;
  data::Scene scene = load_scene("disc_rolling");
  const auto add = [&](const char* has, long operations) {
    rows.push_back({"terms of rolling", has, operations, predict_us(scene, request)});
  };
  add("none", rolling_operations<>());
  scene.model.air_linear_N_m_s = Eigen::Vector3d::Zero();
  add("linear air", rolling_operations<LinearAir>());
  scene.model.air_force_N_s_m = 0.0;
  add("all air", rolling_operations<LinearAir, QuadraticAir, AirForce, GapLayer>());
  scene.model.pivoting_friction_m = 0.0;
  add("all air, contact couples",
      rolling_operations<LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction,
                         PivotingFriction, ContourFriction>());
}

/// What the state has to hold, by what can change: the spin of a top without drag, the slip of a
/// body that rolls, are no components of it.
void add_states(std::vector<LeanRow>& rows) {
  using namespace model;
  constexpr int kEvaluations = 1000;
  const auto add = [&](const char* part, const char* has, const auto& counted, const auto& system,
                       auto state) {
    const long operations = operations_of(counted, counted_state(state)).total();
    auto rate = state;
    const double time_us = fastest_us([&] {
      for (int i = 0; i < kEvaluations; ++i) {
        system.derivative(0.0, state, rate);
        state[0] += 1e-12 * rate[0];  // each evaluation waits for the one before
      }
    });
    rows.push_back({part, has, operations, time_us});
  };
  constexpr const char *kTop = "state of a top, x 1000", *kFloor = "state on a floor, x 1000";
  add(kTop, "5: the spin is constant", Top<Counted>{20.0, 3.0, 5.0}, Top<double>{20.0, 3.0, 5.0},
      State<double, 5>{{0.3, 0.1, 0.2, 0.5, 0.8}});
  add(kTop, "7: drag slows it", TopWithDrag<Counted>{20.0, 0.1, 0.2},
      TopWithDrag<double>{20.0, 0.1, 0.2}, State<double, 7>{{0.3, 0.1, 3.0, 0.2, 0.5, 0.8, 5.0}});
  const RimBody disc{.m = 0.2, .A = 5e-5, .C = 1e-4, .R = 0.03, .h = 0.002};
  add(kFloor, "8: it rolls", Rolling<Counted>{.body = disc, .losses = {}},
      Rolling<double>{.body = disc, .losses = {}},
      State<double, 8>{{0.1, 1.0, 0.2, 0.3, 4.0, -10.0, 0.0, 0.0}});
  add(kFloor, "10: it slips",
      Sliding<Counted, Coulomb>{.body = disc, .losses = {}, .friction = {0.2}},
      Sliding<double, Coulomb>{.body = disc, .losses = {}, .friction = {0.2}},
      State<double, 10>{{0.1, 1.0, 0.2, 0.3, 4.0, -10.0, 0.0, 0.0, 0.05, 0.02}});
}

void add_outputs(std::vector<LeanRow>& rows) {
  using model::Observable;
  const data::Scene scene = load_scene("thesis-base");
  const std::vector<double> t_s = times_s(60.0, 100.0), end{60.0};
  const model::State<model::Counted, 5> y{{0.3, 0.1, 0.2, 0.5, 0.8}};
  const long operations =
      model::operations_of(model::Top<model::Counted>{20.0, 3.0, 5.0}, y).total();
  model::PredictRequest request;
  request.t_s = end;
  const auto add = [&](const char* has) {
    rows.push_back({"outputs of the top", has, operations, predict_us(scene, request)});
  };
  add("the end alone");
  request.t_s = t_s;
  add("x, y at 6001 times");
  request.observables = {Observable::x_m, Observable::y_m, Observable::theta_rad,
                         Observable::phi_rad};
  add("x, y, tilt, precession");
  request.observables.push_back(Observable::psi_rad);
  add("x, y and all angles");
  request.observables = {Observable::x_m, Observable::y_m};
  const auto predictor = model::make_predictor(scene);
  for (const char* name :
       {"a_1_s2", "b_1_s", "l_m", "theta_rad", "phi_rad", "dtheta_rad_s", "dphi_rad_s"})
    request.derivatives.push_back(predictor->index_of(name));
  add("x, y, 7 derivatives of each");
}

#ifdef TROCHOID_HAS_TRACKING
double decode_us(const fs::path& video, bool colour) {
  using Clock = std::chrono::steady_clock;
  tracking::SourceOptions options;
  options.colour = colour;
  const auto source = tracking::open_video(video, options);
  const auto start = Clock::now();
  int frames = 0;
  while (source->next()) ++frames;
  const std::chrono::duration<double, std::micro> elapsed = Clock::now() - start;
  return elapsed.count() / std::max(frames, 1);
}

/// Outlines are projected into the picture as it is; no picture is ever resampled to undistort it.
void add_undistortion(std::vector<LeanRow>& rows) {
  constexpr int kPoints = 1000;
  data::Camera camera = data::Camera::overhead(1280, 720, 2000.0, 1.2);
  const auto add = [&](const char* has) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    const double time_us = fastest_us([&] {
      for (int i = 0; i < kPoints; ++i)
        sum += camera.image_from_table(Eigen::Vector3d(1e-4 * i + 1e-12 * sum.x(), 0.02, 1e-5 * i));
    });
    rows.push_back({"projection, x 1000", has, 0, time_us});
  };
  add("a lens without distortion");
  camera.distortion = {-0.1, 0.02, 1e-4, 1e-4, 0.0};
  add("distortion, five terms");
}

void add_decoding(const fs::path& video, std::vector<LeanRow>& rows) {
  rows.push_back({"decoding, per frame", "luma", 0, decode_us(video, false)});
  rows.push_back({"decoding, per frame", "luma and colour", 0, decode_us(video, true)});
}
#endif

/// Shared libraries this process has mapped.
int libraries() {
  std::set<std::string> names;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    const std::size_t path = line.find('/');
    if (path != std::string::npos && line.find(".so", path) != std::string::npos)
      names.insert(line.substr(path));
  }
  return static_cast<int>(names.size());
}

void print_rows(const std::vector<LeanRow>& rows) {
  fmt::print("{:<27} {:<28} {:>12} {:>10} {:>9}\n", "part", "the scene has", "operations",
             "time_us", "of lean");
  double lean = 0.0;
  std::string part;
  for (const LeanRow& row : rows) {
    if (row.part != part) lean = row.time_us;
    part = row.part;
    fmt::print("{:<27} {:<28} {:>12} {:>10.1f} {:>8.2f}x\n", row.part, row.has,
               row.operations > 0 ? std::to_string(row.operations) : "-", row.time_us,
               row.time_us / lean);
  }
}

void run(const LeanOptions& options) {
  make_folder(options.out);
  std::vector<LeanRow> rows;
  add_terms(rows);
  add_states(rows);
  add_outputs(rows);
#ifdef TROCHOID_HAS_TRACKING
  add_undistortion(rows);
  if (!options.video.empty()) add_decoding(options.video, rows);
#endif
  print_rows(rows);
#ifdef TROCHOID_HAS_TRACKING
  const char* build = "with tracking; -DTROCHOID_TRACKING=OFF builds without OpenCV and libav";
#else
  const char* build = "simulator and fitter alone, without OpenCV and libav";
#endif
  fmt::print("shared libraries loaded: {} ({})\n", libraries(), build);
  fmt::print("operations: of one right-hand side; time: fastest run, 2 s at 240 Hz of rolling\n");
  std::string csv = "part,has,operations,time_us\n";
  for (const LeanRow& row : rows)
    csv += fmt::format("\"{}\",\"{}\",{},{}\n", row.part, row.has, row.operations, row.time_us);
  data::write_text(csv, options.out / "lean.csv");
}

}  // namespace

void add_study_lean(CLI::App& study) {
  auto options = std::make_shared<LeanOptions>();
  CLI::App* command = study.add_subcommand("lean", "What a scene leaves out, and what that saves");
  command->add_option("--out", options->out, "Folder for the table")->capture_default_str();
#ifdef TROCHOID_HAS_TRACKING
  command->add_option("--video", options->video, "Also time the decoding of this recording");
#endif
  command->footer("Example: trochoid study lean");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
