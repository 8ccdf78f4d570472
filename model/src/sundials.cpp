#include "trochoid/model/sundials.hpp"

#include <arkode/arkode_arkstep.h>
#include <arkode/arkode_butcher_dirk.h>
#include <arkode/arkode_erkstep.h>
#include <cvodes/cvodes.h>
#include <fmt/format.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <cmath>
#include <memory>
#include <sundials/sundials_context.hpp>
#include <vector>

#include "trochoid/data/error.hpp"

namespace trochoid::model {
namespace {

// --- SUNDIALS' objects, owned ------------------------------------------------------------------

struct FreeVector {
  void operator()(N_Vector v) const { N_VDestroy(v); }
};
using Vector = std::unique_ptr<std::remove_pointer_t<N_Vector>, FreeVector>;
struct FreeMatrix {
  void operator()(SUNMatrix m) const { SUNMatDestroy(m); }
};
using Matrix = std::unique_ptr<std::remove_pointer_t<SUNMatrix>, FreeMatrix>;
struct FreeLinearSolver {
  void operator()(SUNLinearSolver s) const { SUNLinSolFree(s); }
};
using LinearSolver = std::unique_ptr<std::remove_pointer_t<SUNLinearSolver>, FreeLinearSolver>;
struct FreeNonlinearSolver {
  void operator()(SUNNonlinearSolver s) const { SUNNonlinSolFree(s); }
};
using NonlinearSolver =
    std::unique_ptr<std::remove_pointer_t<SUNNonlinearSolver>, FreeNonlinearSolver>;

Vector make_vector(const Eigen::VectorXd& values, SUNContext context) {
  Vector v(N_VNew_Serial(values.size(), context));
  Eigen::Map<Eigen::VectorXd>(N_VGetArrayPointer(v.get()), values.size()) = values;
  return v;
}

// --- callbacks: SUNDIALS is C, so what is thrown in one ends the program -------------------------

constexpr int kRecoverable = 1;  // "try a shorter step"

bool all_finite(const double* values, int count) {
  for (int i = 0; i < count; ++i)
    if (!std::isfinite(values[i])) return false;
  return true;
}

int call_derivative(double t, N_Vector y, N_Vector dy, void* user) noexcept {
  const Ode& ode = *static_cast<const Ode*>(user);
  ode.derivative(t, N_VGetArrayPointer(y), N_VGetArrayPointer(dy));
  return all_finite(N_VGetArrayPointer(dy), ode.states) ? 0 : kRecoverable;
}

int call_jacobian(double t, N_Vector y, N_Vector, SUNMatrix jacobian, void* user, N_Vector,
                  N_Vector, N_Vector) noexcept {
  const Ode& ode = *static_cast<const Ode*>(user);
  ode.jacobian(t, N_VGetArrayPointer(y), SUNDenseMatrix_Data(jacobian));
  return all_finite(SUNDenseMatrix_Data(jacobian), ode.states * ode.states) ? 0 : kRecoverable;
}

int call_events(double t, N_Vector y, double* g, void* user) noexcept {
  static_cast<const Ode*>(user)->event_functions(t, N_VGetArrayPointer(y), g);
  return 0;
}

int call_sensitivities(int parameters, double t, N_Vector y, N_Vector, N_Vector* s, N_Vector* ds,
                       void* user, N_Vector, N_Vector) noexcept {
  const Ode& ode = *static_cast<const Ode*>(user);
  Eigen::MatrixXd from(ode.states, parameters), rate(ode.states, parameters);
  for (int p = 0; p < parameters; ++p)
    from.col(p) = Eigen::Map<const Eigen::VectorXd>(N_VGetArrayPointer(s[p]), ode.states);
  ode.sensitivities.derivative(t, N_VGetArrayPointer(y), from.data(), rate.data());
  for (int p = 0; p < parameters; ++p)
    Eigen::Map<Eigen::VectorXd>(N_VGetArrayPointer(ds[p]), ode.states) = rate.col(p);
  return rate.allFinite() ? 0 : kRecoverable;
}

void keep_quiet(int, const char*, const char*, char*, void*) {}  // outcomes say it instead

// --- one stepper of SUNDIALS ---------------------------------------------------------------------

/// What the three packages do under different names.
class Stepper {
 public:
  virtual ~Stepper() = default;
  /// Advances to t_limit_s; @returns SUNDIALS' flag.
  virtual int advance(double t_limit_s, N_Vector y, double& t_s) = 0;
  virtual void root_signs(int* signs) = 0;
  /// dy/dp where advance() ended, states x parameters by column; nothing if none are carried.
  virtual void sensitivities(Eigen::Ref<Eigen::RowVectorXd>) {}
  virtual void count(SundialsRun& run) = 0;
  virtual std::string flag_name(int flag) const = 0;
};

void require(int flag, const char* call) {
  if (flag < 0) throw NumericalError(fmt::format("SUNDIALS: {} failed with flag {}", call, flag));
}

void* made(void* memory, const char* call) {
  if (memory == nullptr) throw NumericalError(fmt::format("SUNDIALS: {} made nothing", call));
  return memory;
}

template <void (*free)(void**)>
struct FreedBy {
  void operator()(void* memory) const { free(&memory); }
};
template <void (*free)(void**)>
using Memory = std::unique_ptr<void, FreedBy<free>>;

std::string named(char* name) {
  std::string words(name);
  std::free(name);  // SUNDIALS hands out malloc'ed text
  return words;
}

std::vector<int> falling(int events) {
  return std::vector<int>(static_cast<std::size_t>(events), -1);
}

class Cvode : public Stepper {
 public:
  Cvode(const Ode& ode, double start_s, const Vector& y, const Vector& atol,
        const SundialsOptions& options, SUNContext context)
      : interpolate_(options.interpolate) {
    const bool stiff = options.method == SundialsMethod::cvode_bdf;
    memory_.reset(made(CVodeCreate(stiff ? CV_BDF : CV_ADAMS, context), "CVodeCreate"));
    CVodeSetErrHandlerFn(memory_.get(), keep_quiet, nullptr);
    require(CVodeInit(memory_.get(), call_derivative, start_s, y.get()), "CVodeInit");
    require(CVodeSVtolerances(memory_.get(), options.rtol, atol.get()), "CVodeSVtolerances");
    CVodeSetUserData(memory_.get(), const_cast<Ode*>(&ode));  // NOLINT: C interface, never written
    CVodeSetMaxNumSteps(memory_.get(), options.max_steps);
    if (stiff)
      use_newton(ode, y, context);
    else
      use_fixed_point(y, context);
    if (ode.events > 0) {
      require(CVodeRootInit(memory_.get(), ode.events, call_events), "CVodeRootInit");
      if (ode.events_fall) CVodeSetRootDirection(memory_.get(), falling(ode.events).data());
    }
    if (ode.sensitivities.start.cols() > 0) carry_sensitivities(ode, atol, options, context);
  }

  int advance(double t_limit_s, N_Vector y, double& t_s) override {
    if (!interpolate_) CVodeSetStopTime(memory_.get(), t_limit_s);
    return CVode(memory_.get(), t_limit_s, y, &t_s, CV_NORMAL);
  }
  void root_signs(int* signs) override { CVodeGetRootInfo(memory_.get(), signs); }
  void sensitivities(Eigen::Ref<Eigen::RowVectorXd> row) override {
    if (carried_.empty()) return;
    double t_s = 0.0;
    std::vector<N_Vector> raw = pointers(carried_);
    require(CVodeGetSens(memory_.get(), &t_s, raw.data()), "CVodeGetSens");
    const Eigen::Index states = row.size() / static_cast<Eigen::Index>(raw.size());
    for (std::size_t p = 0; p < raw.size(); ++p)
      row.segment(static_cast<Eigen::Index>(p) * states, states) =
          Eigen::Map<const Eigen::RowVectorXd>(N_VGetArrayPointer(raw[p]), states);
  }
  void count(SundialsRun& run) override {
    CVodeGetNumSteps(memory_.get(), &run.steps);
    CVodeGetNumRhsEvals(memory_.get(), &run.evaluations);
    CVodeGetNumErrTestFails(memory_.get(), &run.failed);
  }
  std::string flag_name(int flag) const override { return named(CVodeGetReturnFlagName(flag)); }

 private:
  void use_newton(const Ode& ode, const Vector& y, SUNContext context) {
    matrix_.reset(SUNDenseMatrix(ode.states, ode.states, context));
    linear_.reset(SUNLinSol_Dense(y.get(), matrix_.get(), context));
    require(CVodeSetLinearSolver(memory_.get(), linear_.get(), matrix_.get()),
            "CVodeSetLinearSolver");
    if (ode.jacobian) require(CVodeSetJacFn(memory_.get(), call_jacobian), "CVodeSetJacFn");
  }
  void use_fixed_point(const Vector& y, SUNContext context) {
    nonlinear_.reset(SUNNonlinSol_FixedPoint(y.get(), 0, context));
    require(CVodeSetNonlinearSolver(memory_.get(), nonlinear_.get()), "CVodeSetNonlinearSolver");
  }

  /// Staggered: the states' step is accepted first, then all sensitivities with its Jacobian.
  void carry_sensitivities(const Ode& ode, const Vector& atol, const SundialsOptions& options,
                           SUNContext context) {
    const auto count = static_cast<int>(ode.sensitivities.start.cols());
    std::vector<Vector> tolerances;
    for (int p = 0; p < count; ++p) {
      carried_.push_back(make_vector(ode.sensitivities.start.col(p), context));
      tolerances.emplace_back(N_VClone(atol.get()));
      N_VScale(1.0, atol.get(), tolerances.back().get());
    }
    require(CVodeSensInit(memory_.get(), count, CV_STAGGERED, call_sensitivities,
                          pointers(carried_).data()),
            "CVodeSensInit");
    require(CVodeSensSVtolerances(memory_.get(), options.rtol, pointers(tolerances).data()),
            "CVodeSensSVtolerances");
    require(CVodeSetSensErrCon(memory_.get(), SUNTRUE), "CVodeSetSensErrCon");
  }
  static std::vector<N_Vector> pointers(const std::vector<Vector>& vectors) {
    std::vector<N_Vector> raw;
    for (const Vector& v : vectors) raw.push_back(v.get());
    return raw;
  }

  bool interpolate_;
  Matrix matrix_;
  LinearSolver linear_;
  NonlinearSolver nonlinear_;
  std::vector<Vector> carried_;
  Memory<CVodeFree> memory_;  ///< last: it goes before what it uses
};

class Erk : public Stepper {
 public:
  Erk(const Ode& ode, double start_s, const Vector& y, const Vector& atol,
      const SundialsOptions& options, SUNContext context)
      : interpolate_(options.interpolate) {
    memory_.reset(made(ERKStepCreate(call_derivative, start_s, y.get(), context), "ERKStepCreate"));
    ERKStepSetErrHandlerFn(memory_.get(), keep_quiet, nullptr);
    require(ERKStepSVtolerances(memory_.get(), options.rtol, atol.get()), "ERKStepSVtolerances");
    require(ERKStepSetTableNum(memory_.get(), ARKODE_FEHLBERG_13_7_8), "ERKStepSetTableNum");
    ERKStepSetUserData(memory_.get(), const_cast<Ode*>(&ode));  // NOLINT: as above
    ERKStepSetMaxNumSteps(memory_.get(), options.max_steps);
    if (ode.events > 0) {
      require(ERKStepRootInit(memory_.get(), ode.events, call_events), "ERKStepRootInit");
      if (ode.events_fall) ERKStepSetRootDirection(memory_.get(), falling(ode.events).data());
    }
  }

  // Stepping exactly to each output keeps order 8; interpolating would be of order 5 at most.
  int advance(double t_limit_s, N_Vector y, double& t_s) override {
    if (!interpolate_) ERKStepSetStopTime(memory_.get(), t_limit_s);
    return ERKStepEvolve(memory_.get(), t_limit_s, y, &t_s, ARK_NORMAL);
  }
  void root_signs(int* signs) override { ERKStepGetRootInfo(memory_.get(), signs); }
  void count(SundialsRun& run) override {
    ERKStepGetNumSteps(memory_.get(), &run.steps);
    ERKStepGetNumRhsEvals(memory_.get(), &run.evaluations);
    ERKStepGetNumErrTestFails(memory_.get(), &run.failed);
  }
  std::string flag_name(int flag) const override { return named(ERKStepGetReturnFlagName(flag)); }

 private:
  bool interpolate_;
  Memory<ERKStepFree> memory_;  ///< last: it goes before what it uses
};

class Dirk : public Stepper {
 public:
  Dirk(const Ode& ode, double start_s, const Vector& y, const Vector& atol,
       const SundialsOptions& options, SUNContext context)
      : interpolate_(options.interpolate) {
    memory_.reset(
        made(ARKStepCreate(nullptr, call_derivative, start_s, y.get(), context), "ARKStepCreate"));
    ARKStepSetErrHandlerFn(memory_.get(), keep_quiet, nullptr);
    require(ARKStepSVtolerances(memory_.get(), options.rtol, atol.get()), "ARKStepSVtolerances");
    require(ARKStepSetTableNum(memory_.get(), ARKODE_ESDIRK547L2SA_7_4_5, ARKODE_ERK_NONE),
            "ARKStepSetTableNum");
    ARKStepSetUserData(memory_.get(), const_cast<Ode*>(&ode));  // NOLINT: as above
    ARKStepSetMaxNumSteps(memory_.get(), options.max_steps);
    matrix_.reset(SUNDenseMatrix(ode.states, ode.states, context));
    linear_.reset(SUNLinSol_Dense(y.get(), matrix_.get(), context));
    require(ARKStepSetLinearSolver(memory_.get(), linear_.get(), matrix_.get()),
            "ARKStepSetLinearSolver");
    if (ode.jacobian) require(ARKStepSetJacFn(memory_.get(), call_jacobian), "ARKStepSetJacFn");
    if (ode.events > 0) {
      require(ARKStepRootInit(memory_.get(), ode.events, call_events), "ARKStepRootInit");
      if (ode.events_fall) ARKStepSetRootDirection(memory_.get(), falling(ode.events).data());
    }
  }

  int advance(double t_limit_s, N_Vector y, double& t_s) override {
    if (!interpolate_) ARKStepSetStopTime(memory_.get(), t_limit_s);
    return ARKStepEvolve(memory_.get(), t_limit_s, y, &t_s, ARK_NORMAL);
  }
  void root_signs(int* signs) override { ARKStepGetRootInfo(memory_.get(), signs); }
  void count(SundialsRun& run) override {
    long explicit_evaluations = 0;
    ARKStepGetNumSteps(memory_.get(), &run.steps);
    ARKStepGetNumRhsEvals(memory_.get(), &explicit_evaluations, &run.evaluations);
    ARKStepGetNumErrTestFails(memory_.get(), &run.failed);
  }
  std::string flag_name(int flag) const override { return named(ARKStepGetReturnFlagName(flag)); }

 private:
  bool interpolate_;
  Matrix matrix_;
  LinearSolver linear_;
  Memory<ARKStepFree> memory_;  ///< last: it goes before what it uses
};

std::unique_ptr<Stepper> make_stepper(const Ode& ode, double start_s, const Vector& y,
                                      const Vector& atol, const SundialsOptions& options,
                                      SUNContext context) {
  switch (options.method) {
    case SundialsMethod::arkode_erk:
      return std::make_unique<Erk>(ode, start_s, y, atol, options, context);
    case SundialsMethod::arkode_dirk:
      return std::make_unique<Dirk>(ode, start_s, y, atol, options, context);
    default:
      return std::make_unique<Cvode>(ode, start_s, y, atol, options, context);
  }
}

void check_call(const Ode& ode, double start_s, const Eigen::VectorXd& y0,
                std::span<const double> t_s, const SundialsOptions& options) {
  if (y0.size() != ode.states || options.atol.size() != ode.states)
    throw InputError(
        fmt::format("integrate_sundials: {} states, but {} initial values and {} "
                    "absolute tolerances; all must be equal",
                    ode.states, y0.size(), options.atol.size()));
  const Eigen::MatrixXd& start = ode.sensitivities.start;
  if (start.cols() > 0 &&
      (start.rows() != ode.states || options.method != SundialsMethod::cvode_bdf))
    throw InputError(
        fmt::format("integrate_sundials: sensitivities of {} states with {} rows; they must agree, "
                    "and cvode_bdf alone carries them",
                    ode.states, start.rows()));
  for (std::size_t i = 0; i < t_s.size(); ++i)
    if (!(t_s[i] >= (i == 0 ? start_s : t_s[i - 1])))
      throw InputError(fmt::format("integrate_sundials: t_s[{}] = {} must not precede {}", i,
                                   t_s[i], i == 0 ? start_s : t_s[i - 1]));
}

constexpr int kRootFlag = 2;      // CV_ROOT_RETURN and ARK_ROOT_RETURN
constexpr int kTooMuchWork = -1;  // CV_TOO_MUCH_WORK and ARK_TOO_MUCH_WORK
static_assert(kRootFlag == CV_ROOT_RETURN && kRootFlag == ARK_ROOT_RETURN);
static_assert(kTooMuchWork == CV_TOO_MUCH_WORK && kTooMuchWork == ARK_TOO_MUCH_WORK);

int first_event(Stepper& stepper, int events) {
  std::vector<int> signs(static_cast<std::size_t>(events), 0);
  stepper.root_signs(signs.data());
  for (int i = 0; i < events; ++i)
    if (signs[static_cast<std::size_t>(i)] != 0) return i;
  return -1;
}

}  // namespace

SundialsRun integrate_sundials(const Ode& ode, double start_s, const Eigen::VectorXd& y0,
                               std::span<const double> t_s, const SundialsOptions& options) {
  check_call(ode, start_s, y0, t_s, options);
  sundials::Context context;
  const Vector y = make_vector(y0, context);
  const Vector atol = make_vector(options.atol, context);
  const auto stepper = make_stepper(ode, start_s, y, atol, options, context);
  const Eigen::Map<const Eigen::VectorXd> state(N_VGetArrayPointer(y.get()), ode.states);

  SundialsRun run;
  run.states.resize(static_cast<Eigen::Index>(t_s.size()), ode.states);
  const Eigen::MatrixXd& start = ode.sensitivities.start;
  run.sensitivities.resize(run.states.rows(), start.size());
  Eigen::RowVectorXd carried = start.reshaped().transpose();
  run.end_s = start_s;
  Eigen::Index rows = 0;
  for (const double t : t_s) {
    if (t > run.end_s) {
      const int flag = stepper->advance(t, y.get(), run.end_s);
      if (flag == kRootFlag) run.event = first_event(*stepper, ode.events);
      if (flag < 0) {
        run.outcome = flag == kTooMuchWork ? Outcome::step_limit : Outcome::tolerance_not_reachable;
        run.message = stepper->flag_name(flag);
      }
      if (flag < 0 || (flag == kRootFlag && run.end_s < t)) break;
    }
    run.states.row(rows) = state.transpose();
    if (run.end_s > start_s) stepper->sensitivities(carried);
    run.sensitivities.row(rows++) = carried;
    if (run.event >= 0) break;  // right at a time asked for
  }
  run.states.conservativeResize(rows, Eigen::NoChange);
  run.sensitivities.conservativeResize(rows, Eigen::NoChange);
  run.end_state = state;
  stepper->count(run);
  return run;
}

}  // namespace trochoid::model
