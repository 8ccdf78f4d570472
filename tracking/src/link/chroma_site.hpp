#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "link/glimpse.hpp"

namespace trochoid::tracking {

/// Where the samples of the colour planes lie [px], from the middle of the four pixels they belong
/// to: there, or half a pixel aside as most cameras write (to the left, some also up, unless the
/// recording is turned). No file tells reliably, but the edges of a body are in one place, in
/// colour and in luma. Nothing where too little is seen of it in colour.
/// @param glimpses measured with the samples taken to lie in the middle.
[[nodiscard]] std::optional<Eigen::Vector2d> find_chroma_site(const Background& background,
                                                              const BodyFinder& finder,
                                                              const std::vector<Glimpse>& glimpses);

}  // namespace trochoid::tracking
