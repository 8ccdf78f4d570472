#pragma once
#include <cstddef>
#include <vector>

#include "edges/colour_window.hpp"
#include "edges/edge_fit.hpp"
#include "geometry/exposure.hpp"
#include "geometry/outline_samples.hpp"

namespace trochoid::tracking {

/// What the colour planes show of the silhouette about one of its samples.
struct ColourEdge {
  std::size_t sample;             ///< of the outline
  data::PoseMotion::Step motion;  ///< how far it moves along its normal per unit of each parameter
  double blur_px;                 ///< of the edge in the planes
  ProfileEdge edge;
};

/// An outline in the middle of the exposure, every few pixels, and what it does meanwhile.
struct ExposedOutline {
  const std::vector<OutlineSample>& middle;
  const Moments& moments;               ///< empty: it hardly moves
  const data::PoseMotion::Step& smear;  ///< the body's motion from end to end; empty: not known
};

/// The silhouette in the colour planes, pixel by pixel as they are coded: how much of each the body
/// covers while the shutter is open tells how far its outline is off. A surface has one colour, so
/// levels are common to the whole outline but for what the light makes of them (a few harmonics of
/// the direction, and the wall beside the face), and single stretches need not find their own. The
/// ends of an outline that turns while the shutter is open leave every normal, but what they cover
/// is seen like the rest.
/// @param blur_px of an edge of the luma picture.
/// @param reach_px largest offset believed.
/// @param every one row of so many is looked at.
/// @returns stretches with an edge, one after the other along the rim, then along the bore; none if
///          too little is seen to tell two colours, or the outline is empty.
[[nodiscard]] std::vector<ColourEdge> find_colour_edges(const ColourWindow& colour,
                                                        const ExposedOutline& outline,
                                                        double blur_px, double reach_px,
                                                        int every = 1);

}  // namespace trochoid::tracking
