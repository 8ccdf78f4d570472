#include "link/linking.hpp"

#include "link/attitude_sequence.hpp"
#include "link/chroma_site.hpp"
#include "link/lying.hpp"
#include "link/neighbours.hpp"
#include "link/one_side.hpp"
#include "link/path_outliers.hpp"
#include "link/readings.hpp"
#include "link/second_look.hpp"
#include "link/shadows.hpp"
#include "link/spin_sequence.hpp"

namespace trochoid::tracking {

std::vector<std::optional<Sighting>> Linking::operator()(std::size_t settled, BodyPath& path,
                                                         std::vector<Glimpse>& glimpses) const {
  forget_what_the_path_jumps_to(glimpses);
  forget_weak_support_beside_gaps(glimpses);
  if (alone)
    if (const auto lamp = find_lamp(background, finder, glimpses)) path.lamp = lamp;
  // Only what is measured again is measured with it.
  if (!path.chroma_site_px && effort != Effort::quick)
    path.chroma_site_px = find_chroma_site(background, finder, glimpses);
  const Background lit =
      background.lit_by(path.lamp).sited_at(path.chroma_site_px.value_or(Eigen::Vector2d::Zero()));
  look_at_shadows(lit, finder, glimpses);
  const auto doubts = decide_attitudes(lit, finder, glimpses);
  mend_from_neighbours(lit, finder, glimpses);
  mend_from_one_side(lit, finder, glimpses);
  const ReadingDoubt reading = choose_readings(lit, finder, glimpses);
  if (reading.otherwise) mend_from_neighbours(lit, finder, glimpses);
  if (effort != Effort::quick) {
    measure_again(lit, finder, settled, glimpses);
    mend_from_neighbours(lit, finder, glimpses, true);
  }
  std::vector<std::optional<Sighting>> undoubted;
  for (const Glimpse& g : glimpses) undoubted.push_back(g.seen);
  doubt_attitudes(doubts, glimpses);
  measure_what_lies(lit, finder, glimpses);
  doubt_what_is_contradicted(finder, glimpses);
  doubt_what_leaves_the_path(glimpses);
  doubt_what_stands_alone(glimpses);
  forget_what_tells_nothing(glimpses);
  forget_spins_off_their_sequence(glimpses);
  place_other_readings(finder, settled, glimpses);
  for (std::size_t which = 0; which < path.readings.size(); ++which)
    path.readings[which].add(reading.tallies[which]);
  return undoubted;
}

}  // namespace trochoid::tracking
