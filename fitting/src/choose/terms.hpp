#pragma once
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "choose/ladder.hpp"
#include "choose/rung.hpp"

// Which terms of a ladder stand together, and which act where nothing is known yet.
namespace trochoid::fitting {

/// A rung with these terms, not fitted yet; of what [fit] says it has what concerns its parameters.
[[nodiscard]] Rung rung_with(const Ladder& ladder, const Terms& terms);

/// Parameters of any of a ladder's rungs.
[[nodiscard]] std::set<std::string> parameters_of_any(const Ladder& ladder);

/// Parameters that a rung has and one with fewer terms has not.
[[nodiscard]] std::set<std::string> parameters_without(const Ladder& ladder, const Terms& terms,
                                                       const Terms& fewer);

/// Parameters of the losses among these terms, not of the law that they come with.
[[nodiscard]] std::set<std::string> parameters_of_losses(const Ladder& ladder, const Terms& terms);

/// Whether [fit] may call one of these parameters so; a group's name covers its components.
[[nodiscard]] bool names_one_of(const std::set<std::string>& parameters, const std::string& name);

/// Whether [fit] fixes or bounds one of these parameters or has a prior on it.
[[nodiscard]] bool says_something_of(const data::FitSettings& fit,
                                     const std::set<std::string>& parameters);

/// Index of the term that is a floor without friction, if the ladder has it.
[[nodiscard]] std::optional<int> smooth_term(const Ladder& ladder);

/// Index of the term that is a floor off level, if the ladder has it.
[[nodiscard]] std::optional<int> slope_term(const Ladder& ladder);

/// Whether a term stands for something beside these.
[[nodiscard]] bool means_something(const Ladder& ladder, const Terms& terms, int index);

/// Whether one of these terms may be left out: the last resort stays, and what another is a
/// property of.
[[nodiscard]] bool may_go(const Ladder& ladder, const Terms& terms, int index);

/// The losses that act on nearly every body of this kind.
[[nodiscard]] Terms usual_losses(const Ladder& ladder);

/// The other laws by which losses of a set may go as well: air's couple grows with the speed or its
/// square, a top's drag is air's or its pivot's, and mostly it is some of each.
[[nodiscard]] Terms other_laws(const Ladder& ladder, const Terms& terms);

/// All sets of these terms and usual losses that are not among them, at least one; a key as in
/// all_sets(). Empty where there are none.
[[nodiscard]] std::map<int, Terms> with_usual_losses(const Ladder& ladder, const Terms& terms);

/// The terms and the last resort; empty where there is none.
[[nodiscard]] Terms with_last_resort(const Ladder& ladder, Terms terms);

/// The last resort together with the usual losses: a body that slides without any may not even stay
/// on the floor as long as the track. Empty where there is no last resort.
[[nodiscard]] Terms all_that_usually_acts(const Ladder& ladder, Terms terms);

/// The terms with one more; the last resort is not added.
[[nodiscard]] std::vector<Terms> with_one_more(const Ladder& ladder, const Terms& terms);

/// All sets of terms, beside the last resort among `known`, that mean something; with a slope and
/// without where that is known. A key has a bit for each term: what is part of another set has a
/// part of its bits.
[[nodiscard]] std::map<int, Terms> all_sets(const Ladder& ladder, const Terms& known);

/// How a set of terms differs from a known one.
struct Difference {
  std::size_t added = 0, removed = 0;
  [[nodiscard]] bool larger() const { return added == 1 && removed == 0; }
  [[nodiscard]] bool exchanged() const { return added == 1 && removed == 1; }
};
[[nodiscard]] Difference difference(const Terms& terms, const Terms& known);

}  // namespace trochoid::fitting
