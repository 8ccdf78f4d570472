#pragma once
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "trochoid/data/scene.hpp"

namespace trochoid::fitting {

/// Something a model may contain or not.
struct Term {
  std::string name;  ///< as in a sentence: "pivoting friction"
  std::function<void(data::Scene&)> switch_on;
  std::map<std::string, double> start;  ///< starting values of its parameters
  bool last_resort = false;  ///< costly: tried only where nothing else explains the track
  /// Acts on nearly every body: tried with the last resort where that fails, and preferred.
  bool usual = false;
  /// A floor without any friction instead of the law: no rolling at all. A last resort of its own.
  bool smooth = false;
  /// A floor that is not level is not tried among others: only where the floor explains nothing
  /// level, or leaves what is not noise.
  bool slope = false;
  std::optional<int> of = {};  ///< index of the term it is a property of: only beside that one
  /// Index of the usual term that is the same loss by another law.
  std::optional<int> other_law_of = {};
};

/// A scene's possible models: the plainest one and the terms it may take on.
struct Ladder {
  std::string law;  ///< name of the plainest model
  data::Scene plain;
  std::vector<Term> terms;
  std::vector<std::string> left_out;  ///< why a term that belongs here is not tried
};

/// A set of a ladder's terms, by their indices.
using Terms = std::set<int>;

/// @param spin_seen  whether the tracks have a spin angle; a puck may turn without showing it.
/// @throws InputError if the scene lacks what its law needs.
[[nodiscard]] Ladder ladder_of(const data::Scene& scene, bool spin_seen);

}  // namespace trochoid::fitting
