#include "find/face_border.hpp"

#include <algorithm>
#include <cmath>

#include "find/stoppable_finder.hpp"

namespace trochoid::tracking {
namespace {

// The silhouette of a body as a search without a prediction wants it.
Detection detection_of(const Ellipse& rim) {
  const double reach_px = rim.semi_major_px();
  const auto whole = [](double v) { return static_cast<int>(std::floor(v)); };
  const int side_px = whole(2.0 * reach_px) + 2;
  return {.centre_px = rim.centre_px,
          .semi_major_px = reach_px,
          .semi_minor_px = rim.semi_minor_px(),
          .box = {whole(rim.centre_px.x() - reach_px), whole(rim.centre_px.y() - reach_px), side_px,
                  side_px}};
}

// How well a body is seen, from what it was taken for or from afar, whichever is better [px].
double support_px(const BodyFinder& finder, const Background& of_all, const DoubtfulLook& look) {
  const Plate background = of_all.plate_of(look.frame->luma);
  Look near{.frame = *look.frame, .background = background, .predicted = look.seen};
  Look afar{.frame = *look.frame, .background = background};
  afar.detection = detection_of(look.seen->rim);
  double best_px = 0.0;
  for (const Look& way : {near, afar})
    if (const auto seen = finder.find(way); seen && seen->pose)
      best_px = std::max(best_px, seen->visible_support_px());
  return best_px;
}

}  // namespace

std::optional<double> likely_border(const data::Body& body, const data::Support& support,
                                    const data::Camera& camera, const Background& background,
                                    const std::vector<DoubtfulLook>& looks,
                                    const std::function<void()>& checkpoint) {
  // Wider ones are not taken for the outline, narrower ones not told from it. Filmed bodies with a
  // border came to 1.4 to 5 times the support without, others with plain faces to 1.3.
  constexpr double kNarrowestPx = 3.0, kWidestPx = 14.0, kWidestShare = 0.3, kWider = 1.35;
  constexpr double kClearly = 1.4;
  double radius_px = 0.0;
  for (const DoubtfulLook& look : looks)
    radius_px = std::max(radius_px, look.seen->rim.semi_major_px());
  const auto support_with = [&](double share) {
    data::Body tried = body;
    tried.border_radius_m = share * body.radius_m;
    const auto finder =
        make_stoppable(make_cylinder_finder(tried, support, camera, 0.0), checkpoint);
    double sum_px = 0.0;
    for (const DoubtfulLook& look : looks) sum_px += support_px(*finder, background, look);
    return sum_px;
  };
  double most_px = kClearly * support_with(0.0);
  if (most_px == 0.0) return std::nullopt;
  std::optional<double> likely;
  const double widest_px =
      std::min(kWidestPx, kWidestShare * radius_px * (1.0 - body.inner_radius_m / body.radius_m));
  for (double wide_px = kNarrowestPx; wide_px < widest_px; wide_px *= kWider) {
    const double share = 1.0 - wide_px / radius_px;
    if (const double px = support_with(share); px > most_px) {
      most_px = px;
      likely = share;
    }
  }
  return likely;
}

}  // namespace trochoid::tracking
