#pragma once
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// Doubts sightings whose centre is off its path, much farther than such paths usually bend and
/// than their covariance allows for: neither the frames before nor those after nor those on both
/// sides lead there (an impact contradicts only some of them). The covariance of such a sighting
/// then holds the place on the path as well; what was seen is not moved.
void doubt_what_leaves_the_path(std::vector<Glimpse>& glimpses);

/// Doubts up to three frames (usual_frames) between gaps or jumps of the path that are far, for the
/// body's size, from the line between the frames on either side: nothing near confirms them, and
/// while the body is hidden, what hides it can pass for it. Their covariance then holds the place
/// on that line.
void doubt_what_stands_alone(std::vector<Glimpse>& glimpses);

/// Forgets sightings beside gaps, up to the first one with about the usual support: while the body
/// is hidden, what hides it is seen a little like it, for as long as it stays.
void forget_weak_support_beside_gaps(std::vector<Glimpse>& glimpses);

/// Forgets sightings that hardly tell where the body is, for its size.
void forget_what_tells_nothing(std::vector<Glimpse>& glimpses);

/// Forgets runs of up to twelve frames (usual_frames) in which little of the body is seen compared
/// with the rest of the recording and which the path jumps to or from, farther than it leads: while
/// the body is hidden, what hides it can pass for it.
void forget_what_the_path_jumps_to(std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
