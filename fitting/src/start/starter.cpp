#include "start/starter.hpp"

#include <algorithm>

#include "trochoid/model/inertia.hpp"

namespace trochoid::fitting {
namespace {

Starter top_starter(const model::Predictor& predictor, bool free_pivot) {
  const int px = predictor.index_of("pivot_x_m"), py = predictor.index_of("pivot_y_m");
  const Eigen::Vector2d known(px >= 0 ? predictor.parameters()[px].value : 0.0,
                              py >= 0 ? predictor.parameters()[py].value : 0.0);
  return [=](const ArcData& window) {
    if (!free_pivot) {
      std::vector<Start> starts = top_starts(window, known);
      for (Start& start : fast_top_starts(window, known)) starts.push_back(std::move(start));
      return starts;
    }
    std::vector<Start> all;
    for (const Eigen::Vector2d& pivot : pivot_guesses(window))
      for (Start& start : top_starts(window, pivot)) all.push_back(std::move(start));
    return all;
  };
}

bool is_rim(const std::string& model) {
  return model == "rolling" || model == "sliding" || model == "smooth";
}

model::RimBody of_unit_mass(const data::Scene& scene) {
  const data::Body& body = *scene.body;
  const model::CentralInertia inertia = model::central_inertia(body);
  return {.A = inertia.transverse_kg_m2 / inertia.mass_kg,
          .C = inertia.axial_kg_m2 / inertia.mass_kg,
          .R = body.radius_m,
          .h = body.half_thickness_m(),
          .g = scene.model.gravity_m_s2};
}

}  // namespace

Starter starter_for(const model::Predictor& predictor, const data::Scene& scene) {
  const std::string& model = predictor.model_name();
  if (model.starts_with("top")) return top_starter(predictor, scene.fit.free_pivot);
  if (is_rim(model) && scene.body)
    return [body = of_unit_mass(scene), slides = model == "sliding"](const ArcData& window) {
      return rim_starts(window, body, slides);
    };
  if (model == "puck") {
    const double gravity_m_s2 = scene.model.gravity_m_s2;
    return [=](const ArcData& window) { return puck_starts(window, gravity_m_s2); };
  }
  if (model == "pivot") {
    const bool unbalanced = predictor.index_of("spin_down_imbalance_sin_rad_s2") >= 0 ||
                            predictor.index_of("spin_down_imbalance_cos_rad_s2") >= 0;
    return [=](const ArcData& window) { return pivot_starts(window, unbalanced); };
  }
  return [](const ArcData&) { return std::vector<Start>{}; };
}

Lookalikes lookalikes_for(const model::Predictor& predictor, const data::Scene& scene) {
  const std::string& model = predictor.model_name();
  const bool rolls = model == "rolling" || model == "sliding";
  if (!rolls || !scene.body) return {};
  return
      [body = of_unit_mass(scene)](const Start& known) { return leaning_otherwise(body, known); };
}

// A sharply regularised law makes stiff equations, and the gentle law's minimum lies far from its
// own: each bridge takes a third of the regularisation. The exact law needs no such way.
std::vector<OwnedRelative> relatives_of(data::Scene scene) {
  constexpr double kGentle_m_s = 1e-3, kSharpEnough_m_s = 1e-4, kStep = 0.33;
  std::vector<OwnedRelative> relatives;
  if (scene.model.name != "sliding") return relatives;
  const double given_m_s = scene.model.slip_regularisation_m_s.value_or(0.0);
  scene.model.name = "rolling";
  relatives.push_back({model::make_predictor(scene), {}});
  const auto& asked = scene.fit.free;
  const bool soft_as_it_may_be =
      given_m_s > 0.0 && std::find(asked.begin(), asked.end(), kSlipScale) != asked.end();
  if (given_m_s == 0.0 || soft_as_it_may_be || given_m_s >= 0.7 * kGentle_m_s) return relatives;
  scene.model.name = "sliding";
  const auto softened = [&](double by_m_s) {
    scene.model.slip_regularisation_m_s = by_m_s;
    return model::make_predictor(scene);
  };
  relatives.push_back({softened(kGentle_m_s), {}});
  const double last_m_s = std::max(given_m_s / (0.7 * kStep), kSharpEnough_m_s);
  for (double by_m_s = kStep * kGentle_m_s; by_m_s >= last_m_s; by_m_s *= kStep)
    relatives.back().bridges.push_back(softened(by_m_s));
  return relatives;
}

}  // namespace trochoid::fitting
