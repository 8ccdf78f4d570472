#pragma once
#include <functional>
#include <optional>
#include <vector>

#include "find/body_finder.hpp"

namespace trochoid::tracking {

/// A frame and what a body was taken for in it.
struct DoubtfulLook {
  const Frame* frame;
  const Sighting* seen;  ///< with a pose
};

/// Whether a body whose outline is seen badly has a border on its faces that has been taken for it
/// (Body::border_radius_m): where that begins, about, as a share of the radius; nothing if no
/// border explains the pictures clearly better. Borders of several widths are tried on each look.
/// @param body without a border.
/// @param checkpoint called often, if given; what it throws is thrown on.
[[nodiscard]] std::optional<double> likely_border(const data::Body& body,
                                                  const data::Support& support,
                                                  const data::Camera& camera,
                                                  const Background& background,
                                                  const std::vector<DoubtfulLook>& looks,
                                                  const std::function<void()>& checkpoint);

}  // namespace trochoid::tracking
