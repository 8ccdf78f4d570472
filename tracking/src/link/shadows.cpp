#include "link/shadows.hpp"

#include <algorithm>
#include <cstddef>

namespace trochoid::tracking {

std::optional<Lamp> find_lamp(const Background& background, const BodyFinder& finder,
                              const std::vector<Glimpse>& glimpses) {
  constexpr std::size_t kLooks = 32;
  constexpr double kLeast = 0.05;  // explained of what is dark around the body
  std::vector<const Glimpse*> seen;
  for (const Glimpse& g : glimpses)
    if (g.posed() && finder.mirror_image(g.pose())) seen.push_back(&g);
  const std::size_t count = std::min(kLooks, seen.size());
  const std::vector<Eigen::Vector2d>& places = lamp_places();
  using Shadow = FloorDarkening::Shadow;
  std::vector<std::vector<Shadow>> shadows(count, std::vector<Shadow>(places.size()));
  on_all_cores(background, finder, count, [&](Measuring& measure, std::size_t i) {
    const Glimpse& g = *seen[i * seen.size() / count];
    for (const data::Pose<>& pose : {g.pose(), *finder.mirror_image(g.pose())})
      if (const auto floor = measure.floor_around(*g.frame, *g.seen, pose))
        for (std::size_t k = 0; k < places.size(); ++k)
          if (const Shadow shadow = floor->shadow_of(places[k]);
              shadow.explained > shadows[i][k].explained)
            shadows[i][k] = shadow;
  });
  std::optional<Lamp> best;
  double most = kLeast * static_cast<double>(count);
  for (std::size_t k = 0; k < places.size(); ++k) {
    double explained = 0.0, part = 0.0;
    for (const auto& of_frame : shadows) {
      explained += of_frame[k].explained;
      part += of_frame[k].explained * of_frame[k].part;
    }
    if (explained > most) most = explained, best = Lamp{places[k], part / explained};
  }
  return best;
}

void look_at_shadows(const Background& background, const BodyFinder& finder,
                     std::vector<Glimpse>& glimpses) {
  if (!background.lamp()) return;
  on_all_cores(background, finder, glimpses.size(), [&](Measuring& measure, std::size_t i) {
    Glimpse& g = glimpses[i];
    if (g.posed()) g.seen->shadow = measure.shadow(*g.frame, *g.seen, g.pose());
  });
}

}  // namespace trochoid::tracking
