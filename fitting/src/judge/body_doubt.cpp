#include "judge/body_doubt.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>

#include "observe/decompositions.hpp"
#include "observe/observed.hpp"
#include "problem/linearise.hpp"
#include "start/strategy.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

/// A quantity of the scene that is not a parameter of any fit.
struct BodyQuantity {
  const char* name;
  std::function<void(data::Scene&, double value)> set;
};

const std::array<BodyQuantity, 7>& body_quantities() {
  static const std::array<BodyQuantity, 7> all{
      {{"mass_kg", [](data::Scene& s, double v) { s.body->mass_kg = v; }},
       {"radius_m", [](data::Scene& s, double v) { s.body->radius_m = v; }},
       {"inner_radius_m", [](data::Scene& s, double v) { s.body->inner_radius_m = v; }},
       {"thickness_m", [](data::Scene& s, double v) { s.body->thickness_m = v; }},
       {"I_kg_m2", [](data::Scene& s, double v) { s.body->I_kg_m2 = v; }},
       {"Is_kg_m2", [](data::Scene& s, double v) { s.body->Is_kg_m2 = v; }},
       {"gravity_m_s2", [](data::Scene& s, double v) { s.model.gravity_m_s2 = v; }}}};
  return all;
}

}  // namespace

void take_priors_for_given(data::Scene& scene) {
  scale_by_radius(scene);
  for (const BodyQuantity& given : body_quantities())
    if (const auto prior = scene.fit.prior.find(given.name);
        prior != scene.fit.prior.end() && scene.body)
      given.set(scene, prior->second.value);
}

namespace {

// Residuals with a given quantity off by some standard deviations of its prior; empty if there is
// no such body, or the model has no prediction for it.
class MovedResiduals {
 public:
  MovedResiduals(const Problem& problem, const Eigen::VectorXd& u, const data::Scene& scene,
                 const BodyQuantity& given, const data::Prior& prior, double frame_time_s)
      : problem_(problem),
        u_(u),
        scene_(scene),
        given_(given),
        prior_(prior),
        frame_time_s_(frame_time_s) {}

  [[nodiscard]] Eigen::VectorXd by(double deviations) const {
    data::Scene scene = scene_;
    scene.model.name = problem_.predictor->model_name();
    given_.set(scene, prior_.value + deviations * prior_.sigma);
    try {
      const auto plain = model::make_predictor(scene);
      const auto wrapped = observed(*plain, scene, frame_time_s_);
      const Problem other = for_predictor(problem_, wrapped ? *wrapped : *plain);
      Eigen::VectorXd residuals;
      if (other.free.size() == problem_.free.size() && all_residuals(other, u_, residuals))
        return residuals;
    } catch (const InputError&) {  // a ring that is wider than its disc, say
    }
    return {};
  }

  // Derivative of the residuals by the deviation. A track may see the thousandth part of a prior's:
  // the step moves the residuals by about their noise, where they are straight and well above the
  // integration error. One-sided where the other side has no body.
  [[nodiscard]] Eigen::VectorXd derivative(const Eigen::VectorXd& here) const {
    constexpr double kFirst = 1e-2, kLeast = 1e-6;
    double first = kFirst;
    Eigen::VectorXd there = by(first);
    if (there.size() == 0) there = by(first = -kFirst);
    if (there.size() == 0) return {};
    const double moved = (there - here).norm(), noise = std::sqrt(static_cast<double>(here.size()));
    const double step = std::clamp(kFirst * noise / std::max(moved, 1e-300), kLeast, 1.0);
    const Eigen::VectorXd up = by(step), down = by(-step);
    if (up.size() > 0 && down.size() > 0) return (up - down) / (2.0 * step);
    if (up.size() > 0) return (up - here) / step;
    if (down.size() > 0) return (here - down) / step;
    return (there - here) / first;
  }

 private:
  const Problem& problem_;
  const Eigen::VectorXd& u_;
  const data::Scene& scene_;
  const BodyQuantity& given_;
  const data::Prior& prior_;
  double frame_time_s_;
};

// How the fitted values follow a change of the residuals, to first order.
Eigen::VectorXd follow(const Linearised& all, const Eigen::VectorXd& change) {
  Eigen::VectorXd right = Eigen::VectorXd::Zero(all.residuals.size());  // priors do not move
  right.head(change.size()) = change;
  const Eigen::VectorXd size = all.jacobian.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = all.jacobian * size.cwiseInverse().asDiagonal();
  return -NearestLeastSquares(scaled).solve(right).cwiseQuotient(size);
}

}  // namespace

std::vector<Doubt> body_doubts(const Problem& problem, const Eigen::VectorXd& u,
                               const data::Scene& scene, double frame_time_s) {
  std::vector<Doubt> doubts;
  std::optional<Linearised> all;
  for (const BodyQuantity& given : body_quantities()) {
    const auto prior = scene.fit.prior.find(given.name);
    if (prior == scene.fit.prior.end() || !scene.body ||
        (prior->first == "radius_m" && metres_by_radius(scene)) ||
        problem.predictor->index_of(given.name) >= 0)
      continue;
    if (!all) all = linearise(problem, u);
    const Eigen::Index rows = problem.rows();
    const Eigen::VectorXd by_given =
        MovedResiduals(problem, u, scene, given, prior->second, frame_time_s)
            .derivative(all->residuals.head(rows));
    if (by_given.size() == 0) continue;
    doubts.push_back({given.name, follow(*all, by_given)});
  }
  return doubts;
}

namespace {

// Of one arc, whose spin is its own.
Doubt unseen_spin(const Problem& problem, const Eigen::VectorXd& u, int arc, Linearised& all) {
  const model::Predictor& predictor = *problem.predictor;
  const int spin = predictor.index_of("w3_rad_s"), radius = predictor.index_of("contact_radius_m");
  const Eigen::VectorXd values = problem.values(arc, u);
  const auto fitted = [&](const FreeParameter& p) { return p.index == spin && p.arc == arc; };
  if (std::any_of(problem.free.begin(), problem.free.end(), fitted) || values[spin] != 0.0)
    return {};
  Problem turning = problem;
  turning.base[arc][spin] =
      std::hypot(values[predictor.index_of("vx_m_s")], values[predictor.index_of("vy_m_s")]) /
      values[radius];
  Eigen::VectorXd there;
  if (!all_residuals(turning, u, there)) return {};
  if (all.residuals.size() == 0) all = linearise(problem, u);
  const Eigen::VectorXd change = there - all.residuals.head(there.size());
  const Eigen::VectorXd shift = follow(all, change);
  // What the path has of it that no other value could have made: how much of such a spin there is,
  // and how well that is known, one time as much being as likely as not beforehand.
  const Eigen::VectorXd own = change + all.jacobian.topRows(there.size()) * shift;
  const double seen = own.squaredNorm();
  const double share = std::max(0.0, -own.dot(all.residuals.head(there.size()))) / (1.0 + seen);
  return {"w3_rad_s", std::sqrt(1.0 / (1.0 + seen) + share * share) * shift};
}

}  // namespace

std::vector<Doubt> unseen_spins(const Problem& problem, const Eigen::VectorXd& u,
                                const data::Scene& scene) {
  std::vector<Doubt> doubts;
  if (problem.predictor->model_name() != "puck" || scene.fit.fixed.contains("w3_rad_s"))
    return doubts;
  Linearised all;  // once, and only where it is needed
  for (int arc = 0; arc < static_cast<int>(problem.arcs.size()); ++arc)
    if (Doubt doubt = unseen_spin(problem, u, arc, all); doubt.shift.size() > 0)
      doubts.push_back(std::move(doubt));
  return doubts;
}

double friction_of_rise(const Problem& problem, const Eigen::VectorXd& u, const data::Scene& scene,
                        double rise, double frame_time_s) {
  const model::Predictor& predictor = *problem.predictor;
  const auto friction =
      std::find_if(problem.free.begin(), problem.free.end(), [&](const FreeParameter& free) {
        return predictor.parameters()[free.index].name == "friction";
      });
  if (predictor.model_name() != "puck" || predictor.index_of(kSlopeX) >= 0 ||
      friction == problem.free.end())
    return 0.0;
  static const std::array<BodyQuantity, 2> kAxes{
      {{kSlopeX, [](data::Scene& s, double v) { s.support.slope_x = v; }},
       {kSlopeY, [](data::Scene& s, double v) { s.support.slope_y = v; }}}};
  const Linearised all = linearise(problem, u);
  const auto rows = problem.rows();
  Eigen::Vector2d shifts = Eigen::Vector2d::Zero();
  Eigen::MatrixXd own = Eigen::MatrixXd::Zero(rows, 2);  // what no other value could have made
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::VectorXd change =
        MovedResiduals(problem, u, scene, kAxes.at(axis), {0.0, rise}, frame_time_s)
            .derivative(all.residuals.head(rows));
    if (change.size() == 0) return 0.0;
    const Eigen::VectorXd shift = follow(all, change);
    shifts[axis] = shift[std::distance(problem.free.begin(), friction)];
    own.col(axis) = change + all.jacobian.topRows(rows) * shift;
  }
  const Eigen::Matrix2d known = Eigen::Matrix2d::Identity() + own.transpose() * own;
  return std::sqrt(shifts.dot(SymmetricEquations(known).solve(shifts)));
}

std::vector<std::string> idle_priors(const Problem& problem, const data::Scene& scene) {
  std::vector<std::string> idle;
  const auto& infos = problem.predictor->parameters();
  const auto arcs = static_cast<int>(problem.arcs.size());
  const auto of_one_arc = [&](const std::string& name, const model::ParameterInfo& info) {
    for (int arc = 0; arc < arcs; ++arc)
      if (name == fmt::format("{}@{}", info.name, arc))
        return info.role == model::ParameterInfo::Role::initial;
    return false;
  };
  for (const auto& [name, prior] : scene.fit.prior) {
    const bool of_body =
        std::any_of(body_quantities().begin(), body_quantities().end(),
                    [&name = name](const BodyQuantity& given) { return name == given.name; });
    const bool of_model =
        std::any_of(infos.begin(), infos.end(), [&, &name = name](const auto& info) {
          return means(name, info.name) || of_one_arc(name, info);
        });
    if (!of_body && !of_model && name != "frame_rate_hz") idle.push_back(name);
  }
  return idle;
}

}  // namespace trochoid::fitting
