#pragma once
#include <string>

#include "trochoid/data/track.hpp"

namespace trochoid::data {

/// Checks one sample and, if there is one, its order after the previous; `place` begins the
/// message.
void check_sample(const TrackSample& sample, const TrackSample* previous, const std::string& place);

}  // namespace trochoid::data
