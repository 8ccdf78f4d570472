#include "starter.hpp"

#include "trochoid/model/inertia.hpp"

namespace trochoid::fitting {
namespace {

Starter top_starter(const model::Predictor& predictor, bool free_pivot) {
  const int px = predictor.index_of("pivot_x_m"), py = predictor.index_of("pivot_y_m");
  const Eigen::Vector2d known(px >= 0 ? predictor.parameters()[px].value : 0.0,
                              py >= 0 ? predictor.parameters()[py].value : 0.0);
  return [=](const ArcData& window) {
    if (!free_pivot) return top_starts(window, known);
    std::vector<Start> all;
    for (const Eigen::Vector2d& pivot : pivot_guesses(window))
      for (Start& start : top_starts(window, pivot)) all.push_back(std::move(start));
    return all;
  };
}

Starter rim_starter(const data::Scene& scene) {
  data::Body body = *scene.body;
  const model::CentralInertia inertia = model::central_inertia(body);
  const RimShape shape{body.radius_m,
                       body.half_thickness_m(),
                       inertia.transverse_kg_m2 / inertia.mass_kg,
                       inertia.axial_kg_m2 / inertia.mass_kg,
                       scene.model.gravity_m_s2,
                       scene.model.name == "sliding"};
  return [shape](const ArcData& window) { return rim_starts(window, shape); };
}

}  // namespace

Starter starter_for(const model::Predictor& predictor, const data::Scene& scene) {
  const std::string& model = predictor.model_name();
  if (model.starts_with("top")) return top_starter(predictor, scene.fit.free_pivot);
  if ((model == "rolling" || model == "sliding" || model == "smooth") && scene.body)
    return rim_starter(scene);
  if (model == "puck") {
    const double gravity_m_s2 = scene.model.gravity_m_s2;
    return [=](const ArcData& window) { return puck_starts(window, gravity_m_s2); };
  }
  if (model == "pivot") return pivot_starts;
  return [](const ArcData&) { return std::vector<Start>{}; };
}

// Easier relatives of a sliding body, see Quest: the exact Coulomb law, and a sharply regularised
// one, make a rough cost and stiff equations.
std::vector<std::unique_ptr<model::Predictor>> relatives_of(data::Scene scene) {
  constexpr double kGentle_m_s = 1e-3;
  std::vector<std::unique_ptr<model::Predictor>> relatives;
  if (scene.model.name != "sliding") return relatives;
  scene.model.name = "rolling";
  relatives.push_back(model::make_predictor(scene));
  if (scene.model.slip_regularisation_m_s.value_or(0.0) < 0.7 * kGentle_m_s) {
    scene.model.name = "sliding";
    scene.model.slip_regularisation_m_s = kGentle_m_s;
    relatives.push_back(model::make_predictor(scene));
  }
  return relatives;
}

}  // namespace trochoid::fitting
