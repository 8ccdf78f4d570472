#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "factories.hpp"
#include "rim_kernel.hpp"
#include "solve.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/model/inertia.hpp"
#include "trochoid/model/sundials.hpp"

// Whole runs of bodies with rim contact as tables: state, contact point, and with a known mass
// energy and contact force.
namespace trochoid::model {
namespace {

struct Columns {
  bool mass_known = false;
  bool exact_friction = false;  ///< rolling and sliding phases alternate: say which

  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> list = euler_columns();
    if (!mass_known) list.pop_back();
    for (const char* name : {"w1_rad_s", "w2_rad_s", "w3_rad_s", "vx_m_s", "vy_m_s"})
      list.emplace_back(name);
    if (mass_known)
      for (const char* name : {"normal_force_N", "force_x_N", "force_y_N"}) list.emplace_back(name);
    for (const char* name : {"contact_x_m", "contact_y_m", "slip_m_s"}) list.emplace_back(name);
    if (exact_friction) list.emplace_back("mode");
    return list;
  }
};

template <class S, template <class> class... Terms>
ContactForce<S> force_of(const Rolling<S, Terms...>& system, const State<S, 8>& /*y*/,
                         const NodeMotion<S>& q) {
  return system.contact_force(q, system.acceleration(q));
}
template <class S, template <class> class Friction, template <class> class... Terms>
ContactForce<S> force_of(const Sliding<S, Friction, Terms...>& system, const State<S, 10>& y,
                         const NodeMotion<S>& q) {
  return system.contact(q, system.slip(y)).force;
}

/// One row of the table.
template <class System>
std::vector<double> row_of(const Columns& columns, const System& system, double t_s,
                           const State<double, System::kStates>& y) {
  const NodeMotion<double> q = system.motion(y);
  const double dphi = q.w2 / q.at.s;
  std::vector<double> row{t_s,  y[Rim::phi],           y[Rim::theta], y[Rim::psi], dphi,
                          q.w1, q.w3 - q.precession_k, y[Rim::x],     y[Rim::y],   q.at.z};
  if (columns.mass_known) {
    row.push_back(energy_J(system.body, q));
    if constexpr (requires { system.losses.rise; })
      row.back() += system.losses.energy_J(system.body, y[Rim::x], y[Rim::y]);
  }
  const World<double> v = world_from_node(horizontal_velocity(q), y[Rim::phi]);
  row.insert(row.end(), {q.w1, q.w2, q.w3, v.x, v.y});
  if (columns.mass_known) {
    const ContactForce<double> force = force_of(system, y, q);
    const World<double> f =
        world_from_node(Horizontal<double>{force.along_n, force.along_mh}, y[Rim::phi]);
    row.insert(row.end(), {force.normal, f.x, f.y});
  }
  const World<double> arm = world_from_node(Horizontal<double>{0.0, -q.at.slope}, y[Rim::phi]);
  constexpr bool slides = System::kStates == 10;
  Horizontal<double> u{0.0, 0.0};
  if constexpr (slides) u = system.slip(y);
  row.insert(row.end(), {y[Rim::x] + arm.x, y[Rim::y] + arm.y, std::hypot(u.along_n, u.along_mh)});
  if (columns.exact_friction) row.push_back(slides ? 1.0 : 0.0);
  return row;
}

/// A finished run before it becomes a Trajectory.
struct RimRecord {
  std::vector<std::vector<double>> rows;
  RimRunEnd<double> end;
};

/// What a scene asks for, ready to run at any tolerance.
struct RimJob {
  RimModel model;
  RimInput<double> input;
  Columns columns;
  std::vector<double> t_s;
  std::string law;
  bool impact = false;
  Method method = Method::dop853;

  [[nodiscard]] RimRunOptions options(double tolerance, double stick) const {
    RimRunOptions options;
    options.tolerance = tolerance;
    // Rows are read off steps: where none but the start is asked for, one is made all the same.
    constexpr double kInstant_s = 1e-9;
    options.end_s = std::max(t_s.back(), kInstant_s);
    options.impact_at_rim = impact;
    options.stick_factor = stick;
    options.stiff = method == Method::radau;
    return options;
  }
  [[nodiscard]] Coulomb<double> friction() const { return {input.friction, input.eps_v}; }
};

template <template <class> class Friction, template <class> class... Terms>
RimRecord run_phases(const RimJob& job, const Friction<double>& friction, double limit,
                     Regime regime, const RimRunOptions& options, TermList<Terms...>) {
  RimRecord record;
  RimRun<double, Friction, Terms...> run(job.model.body,
                                         make_losses<Losses<double, Terms...>>(job.input.losses),
                                         friction, limit, options, job.t_s);
  record.end = run.run(rim_state(job.model.body, job.input), regime,
                       [&](auto& stepper, int first, int last) {
                         for (int n = first; n < last; ++n) {
                           const double t = job.t_s[static_cast<std::size_t>(n)];
                           const auto y = stepper.dense_state(stepper.fraction(t));
                           record.rows.push_back(row_of(job.columns, stepper.system(), t, y));
                         }
                       });
  return record;
}

/// The system for SUNDIALS, its Jacobian from `duals`, its events included.
template <class System, class DualSystem>
[[nodiscard]] Ode rim_ode(const System& system, const DualSystem& duals) {
  constexpr int n = System::kStates;
  Ode ode = make_ode(duals);
  ode.events = System::kEvents;
  ode.events_fall = true;
  ode.event_functions = [system](double t, const double* y, double* g) {
    State<double, n> state;
    State<double, System::kEvents> value;
    for (int i = 0; i < n; ++i) state[i] = y[i];
    system.events(t, state, value);
    for (int i = 0; i < System::kEvents; ++i) g[i] = value[i];
  };
  return ode;
}

/// How such a run went, in our own words.
template <class S>
void note_end(const SundialsRun& run, RimRunEnd<S>& end) {
  end.outcome = run.outcome;
  end.end_s = run.end_s;
  end.statistics = {static_cast<int>(run.steps), static_cast<int>(run.failed),
                    static_cast<int>(run.evaluations)};
  // In the order of the systems' events. The last is that of sliding; rolling's would be its slip,
  // which without a limit of friction never comes.
  constexpr Outcome kEnds[] = {Outcome::flat, Outcome::rim_switch, Outcome::lift_off,
                               Outcome::inconsistent_contact};
  if (run.event < 0 || run.event >= 4) return;
  end.outcome = kEnds[run.event];
  end.events.push_back({run.end_s, std::string(name(end.outcome))});
}

/// One phase without change of regime by SUNDIALS, up to its first event.
template <class System, class DualSystem>
RimRecord run_sundials(const RimJob& job, const System& system, const DualSystem& duals,
                       double tolerance) {
  constexpr int n = System::kStates;
  RimRecord record;
  const State<double, 10> start = rim_state(job.model.body, job.input);
  State<double, n> y;
  for (int i = 0; i < n; ++i) y[i] = start[i];
  if (const auto outside = outside_at_start(system, 0.0, y)) {
    record.end.outcome = *outside;
    record.end.events.push_back({0.0, std::string(name(*outside))});
    return record;
  }
  const Eigen::VectorXd y0 = Eigen::Map<const Eigen::VectorXd>(y.v, n);
  StepControl<n> control = rim_control<n>(job.model.body, job.options(tolerance, 1.0));
  if constexpr (n == 10) resolve_stick(job.input.eps_v, control);
  SundialsOptions options = sundials_options(job.method, control.rtol, control.atol, n);
  // Friction that sets in softly makes equations stiff.
  if (job.method == Method::arkode && job.input.eps_v > 0.0)
    options.method = SundialsMethod::arkode_dirk;
  const SundialsRun run = integrate_sundials(rim_ode(system, duals), 0.0, y0, job.t_s, options);
  for (Eigen::Index row = 0; row < run.states.rows(); ++row) {
    for (int i = 0; i < n; ++i) y[i] = run.states(row, i);
    record.rows.push_back(row_of(job.columns, system, job.t_s[static_cast<std::size_t>(row)], y));
  }
  note_end(run, record.end);
  return record;
}

template <template <class> class Friction>
RimRecord run_sliding_by(const RimJob& job, double tolerance) {
  using Jacobian = Dual<16>;
  Sliding<double, Friction, LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction,
          PivotingFriction, ContourFriction, FloorSlope>
      system;
  Sliding<Jacobian, Friction, LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction,
          PivotingFriction, ContourFriction, FloorSlope>
      duals;
  place(job.model, job.input, system);
  place(job.model, job.input, duals);
  if constexpr (Friction<double>::kActive) {
    system.friction = job.friction();
    duals.friction = {Jacobian(job.input.friction), Jacobian(job.input.eps_v)};
  }
  return run_sundials(job, system, duals, tolerance);
}

RimRecord run_rolling_by(const RimJob& job, double tolerance) {
  Rolling<double, LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction, PivotingFriction,
          ContourFriction, FloorSlope>
      system;
  Rolling<Dual<8>, LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction, PivotingFriction,
          ContourFriction, FloorSlope>
      duals;
  place(job.model, job.input, system);
  place(job.model, job.input, duals);
  return run_sundials(job, system, duals, tolerance);
}

RimRecord run_job(const RimJob& job, double tolerance, double stick) {
  const data::ModelSettings& terms = job.model.terms;
  const RimRunOptions options = job.options(tolerance, stick);
  const bool own = job.method == Method::dop853 || job.method == Method::radau;
  if (job.law == "rolling") {
    if (!own) return run_rolling_by(job, tolerance);
    return with_terms(terms, job.model.sloped, [&](auto list) {
      return run_phases(job, NoSlip<double>{}, 0.0, Regime::rolling, options, list);
    });
  }
  if (job.law == "smooth") {
    if (!own) return run_sliding_by<NoFriction>(job, tolerance);
    return with_few_terms(terms, job.model.sloped, [&](auto list) {
      return run_phases(job, NoFriction<double>{}, 0.0, Regime::sliding, options, list);
    });
  }
  if (!own) return run_sliding_by<Coulomb>(job, tolerance);
  const double limit = job.input.eps_v > 0.0 ? 0.0 : job.input.friction;
  return with_few_terms(terms, job.model.sloped, [&](auto list) {
    return run_phases(job, job.friction(), limit, Regime::sliding, options, list);
  });
}

Choice choose(const RimJob& job, const std::string& asked, double tolerance) {
  const bool exact = job.law == "sliding" && job.input.eps_v == 0.0;
  if (asked == "auto") {
    if (exact) return {Method::dop853, "dop853", "exact Coulomb law: regimes change at events"};
    const double steps =
        job.law == "sliding" ? explicit_steps(job.model, job.friction(), job.t_s.back()) : 0.0;
    if (asks_for_implicit_steps(job.model, steps, job.input.theta, job.input.w2,
                                job.options(tolerance, 1.0)))
      return {
          Method::radau, "radau",
          fmt::format("stiff friction: an explicit method would take about {:.0e} steps", steps)};
    return {Method::dop853, "dop853",
            job.input.eps_v > 0.0
                ? fmt::format("friction that is not stiff: about {:.0e} explicit steps", steps)
                : "no friction law that could be stiff, smooth between events"};
  }
  if (asked == "taylor")
    throw NotOffered(
        "run.integrator = \"taylor\" needs polynomial equations; contact models take auto, dop853, "
        "cvode-adams, cvode-bdf, arkode or, with regularised friction, radau");
  if (asked == "radau") {
    if (job.input.eps_v > 0.0) return {Method::radau, asked, "asked for"};
    throw NotOffered(
        "run.integrator = \"radau\" is for friction that sets in softly (model.friction above 0, "
        "with model.slip_regularisation_m_s); other contact models take auto, dop853, cvode-adams, "
        "cvode-bdf or arkode");
  }
  const Choice choice = choose_integrator(asked);
  if (choice.method != Method::dop853 && (exact || job.impact))
    throw NotOffered(fmt::format(
        "run.integrator = \"{}\" cannot change regimes at events; the exact Coulomb law and rim "
        "impacts take auto or dop853",
        asked));
  return choice;
}

RimJob rim_job(const data::Scene& scene, const std::string& law) {
  RimJob job;
  job.law = law;
  const std::optional<Eigen::Vector2d> slope = floor_slope(scene);
  job.model = {rim_body(scene), scene.model, slope.has_value()};
  const RimStart start = rim_start(scene, job.model.body);
  job.input = {start.theta_rad,
               start.phi_rad,
               start.psi_rad,
               start.w1_rad_s,
               start.w2_rad_s,
               start.w3_rad_s,
               start.x_m,
               start.y_m,
               start.vx_m_s,
               start.vy_m_s,
               loss_values(scene.model),
               0.0,
               0.0};
  if (slope) job.input.losses.rise = {slope->x(), slope->y()};
  if (law == "sliding") {
    if (!scene.model.friction)
      throw InputError(
          "model.friction is missing: the sliding model needs the Coulomb coefficient");
    job.input.friction = *scene.model.friction;
    if (!(job.input.friction >= 0.0) || !std::isfinite(job.input.friction))
      throw InputError(fmt::format("model.friction = {} must be 0 or greater", job.input.friction));
    if (job.input.friction == 0.0)
      job.law = "smooth";
    else
      job.input.eps_v = scene.model.slip_regularisation_m_s.value_or(0.0);
  }
  if (scene.run.rim_switch != "end" && scene.run.rim_switch != "impact")
    throw InputError(
        fmt::format("run.rim_switch = \"{}\" must be end or impact", scene.run.rim_switch));
  job.impact = scene.run.rim_switch == "impact";
  job.columns = {central_inertia(*scene.body).mass_known,
                 job.law == "sliding" && job.input.eps_v == 0.0};
  job.t_s = output_times_s(scene.run);
  return job;
}

/// Whether a run ends earlier than another because its body goes another way: not a little earlier,
/// as an event a little earlier makes it, and not because its integration gave up.
bool ends_otherwise(const RimRunEnd<double>& earlier, double later_s) {
  constexpr double kLittle = 0.01;
  return !broke_off(earlier.outcome) && earlier.end_s < (1.0 - kLittle) * later_s;
}

/// Largest differences of path and axis between a run and its repetition; the run ends where they
/// part.
void estimate_error(const RimRecord& a, const RimRecord& b, Trajectory& run) {
  constexpr int kPhi = 1, kTheta = 2, kX = 7, kY = 8;
  const std::size_t common = std::min(a.rows.size(), b.rows.size());
  Eigen::VectorXd apart_rad(run.values.rows());
  for (std::size_t n = 0; n < common; ++n) {
    const auto &p = a.rows[n], &q = b.rows[n];
    apart_rad[static_cast<Eigen::Index>(n)] =
        std::hypot(p[kTheta] - q[kTheta], std::sin(p[kTheta]) * (p[kPhi] - q[kPhi]));
  }
  const bool parts = ends_otherwise(b.end, a.end.end_s);
  apart_rad.tail(apart_rad.size() - static_cast<Eigen::Index>(common))
      .setConstant(parts ? std::numeric_limits<double>::infinity() : 0.0);
  end_where_unknown(apart_rad, run);
  if (parts || ends_otherwise(a.end, b.end.end_s)) {
    run.outcome = Outcome::diverged;
    run.end_s = std::min(run.end_s, b.end.end_s);
    std::erase_if(run.events, [&](const Event& e) { return e.t_s >= run.end_s; });
  }
  const auto known = static_cast<std::size_t>(run.values.rows());
  for (std::size_t n = 0; n < std::min(common, known); ++n) {
    const auto &p = a.rows[n], &q = b.rows[n];
    run.error_estimate_m = std::max(run.error_estimate_m, std::hypot(p[kX] - q[kX], p[kY] - q[kY]));
  }
}

}  // namespace

Trajectory simulate_rim(const data::Scene& scene, const std::string& law) {
  RimJob job = rim_job(scene, law);
  const Choice choice = choose(job, scene.run.integrator, scene.run.tolerance);
  job.method = choice.method;
  const double tolerance = scene.run.tolerance;
  RimRecord record = run_job(job, tolerance, 1.0);
  // The second run: finer, or coarser where finer is below rounding; and with another threshold of
  // sticking, so that its influence shows as well.
  constexpr double kFinest = 1e-12, kOtherStick = 3.0;
  const RimRecord other =
      run_job(job, tolerance > kFinest ? 0.01 * tolerance : 10.0 * tolerance, kOtherStick);

  Trajectory run;
  run.model = law;
  run.integrator = choice.name;
  run.integrator_reason = choice.reason;
  run.columns = job.columns.names();
  run.values.resize(static_cast<Eigen::Index>(record.rows.size()),
                    static_cast<Eigen::Index>(run.columns.size()));
  for (std::size_t n = 0; n < record.rows.size(); ++n)
    run.values.row(static_cast<Eigen::Index>(n)) = Eigen::Map<const Eigen::RowVectorXd>(
        record.rows[n].data(), static_cast<Eigen::Index>(run.columns.size()));
  run.events = std::move(record.end.events);
  run.outcome = record.end.outcome;
  run.end_s = std::min(record.end.end_s, job.t_s.back());
  run.statistics = record.end.statistics;
  estimate_error(record, other, run);
  return run;
}

}  // namespace trochoid::model
