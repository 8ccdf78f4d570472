#include "judge/tracks_apart.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "judge/adequacy.hpp"
#include "judge/draft.hpp"
#include "trochoid/data/error.hpp"

namespace trochoid::fitting {
namespace {

// The scene as that of one track alone: what [fit] says of another's state is not for it.
data::Scene scene_of_track(const data::Scene& scene, std::size_t track) {
  data::Scene alone = scene;
  const std::string own = fmt::format("@{}", track);
  for (const auto& [name, prior] : scene.fit.prior) {
    const std::size_t at = name.find('@');
    if (at == std::string::npos) continue;
    alone.fit.prior.erase(name);
    if (name.substr(at) == own) alone.fit.prior.insert_or_assign(name.substr(0, at), prior);
  }
  return alone;
}

// Their numbers, as in "track 2" and "tracks 2, 3".
std::string with_numbers(const std::vector<std::size_t>& tracks) {
  return fmt::format("track{} {}", tracks.size() > 1 ? "s" : "", fmt::join(tracks, ", "));
}

std::optional<data::Fit> fit_alone(const data::Track& track, const data::Scene& scene,
                                   const FitOptions& options) {
  try {
    return fit_one_of_several(std::span(&track, 1), scene, options, Bars::by_curvature);
  } catch (const Error&) {  // too short for the model's parameters, or for a start
    return std::nullopt;
  }
}

// What each of the tracks says of a parameter that they share.
struct Opinions {
  std::string name;
  std::vector<std::size_t> tracks;
  std::vector<double> values, sigmas;
  double apart = 0.0;  // standard deviations, of the two of them that differ most

  void add(std::size_t track, double value, double sigma) {
    for (std::size_t i = 0; i < values.size(); ++i)
      apart = std::max(apart, std::abs(value - values[i]) / std::hypot(sigma, sigmas[i]));
    tracks.push_back(track), values.push_back(value), sigmas.push_back(sigma);
  }
  [[nodiscard]] std::string words() const {
    constexpr std::size_t kMost = 6;
    std::string list;
    for (std::size_t i = 0; i < std::min(kMost, values.size()); ++i)
      list += fmt::format("{}{:.4g} ± {:.2g} (track {})", i == 0 ? "" : ", ", values[i], sigmas[i],
                          tracks[i] + 1);
    if (values.size() > kMost) list += fmt::format(" and {} more", values.size() - kMost);
    return name + " = " + list;
  }
};

Opinions opinions_of(const std::string& name, std::span<const std::optional<data::Fit>> fits) {
  Opinions all{.name = name, .tracks = {}, .values = {}, .sigmas = {}};
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (!fits[i] || !says_explained(*fits[i])) continue;
    const data::FitParameter* one = fits[i]->find(name);
    if (one != nullptr && one->status == data::ParameterStatus::free && one->sigma > 0.0 &&
        std::isfinite(one->sigma))
      all.add(i, one->value, one->sigma);
  }
  return all;
}

// Of which they differ most; the name is empty where they hardly do in any.
Opinions widest(const data::Fit& together, std::span<const std::optional<data::Fit>> fits) {
  constexpr double kDiffer = 4.0;
  Opinions found;
  for (const std::string& name : together.covariance_names) {
    const bool own = name.find('@') != std::string::npos || together.find(name + "@1") != nullptr;
    if (own) continue;
    Opinions one = opinions_of(name, fits);
    if (one.apart > std::max(kDiffer, found.apart)) found = std::move(one);
  }
  return found;
}

}  // namespace

std::optional<TracksApart> tracks_apart(std::span<const data::Track> tracks,
                                        const data::Scene& scene, const FitOptions& options,
                                        const data::Fit& together) {
  if (tracks.size() < 2 || together.model == "puck" ||
      together.verdict == data::FitVerdict::no_feature)
    return {};
  FitOptions plain = options;
  plain.profile = false;
  plain.bootstrap = 0;
  std::vector<std::optional<data::Fit>> fits;
  std::vector<std::size_t> explained, featureless, others;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    fits.push_back(fit_alone(tracks[i], scene_of_track(scene, i), plain));
    const bool follows = fits.back() && says_explained(*fits.back());
    const bool shows = !fits.back() || fits.back()->verdict != data::FitVerdict::no_feature;
    (follows ? explained : shows ? others : featureless).push_back(i + 1);
  }
  if (explained.empty()) return {};
  const Opinions most = widest(together, fits);
  const bool differ = !most.name.empty();
  const std::string asks = "ask for different values of what they share, above all " + most.words();
  if (!others.empty() || !featureless.empty()) {
    std::string words = "by itself the model explains " + with_numbers(explained);
    if (!others.empty()) words += fmt::format(", but not {}", fmt::join(others, ", "));
    if (!featureless.empty()) words += "; nothing asks for it in " + with_numbers(featureless);
    if (differ) words += "; those that it explains " + asks;
    return TracksApart{differ && others.empty(), words};
  }
  if (!differ)
    return TracksApart{false,
                       "the model explains each of the tracks by itself, and they agree in what "
                       "they share: there may be a better minimum for all of them together"};
  return TracksApart{true, "the model explains each of the tracks by itself: they " + asks +
                               "; was it the same body on the same floor, at the same scale and "
                               "frame rate?"};
}

void tell_tracks_apart(const TracksApart& apart, data::Fit& fit) {
  fit.verdict_words += "; " + apart.words;
  if (!fit.converged) fit.reason = fit.verdict_words;
}

}  // namespace trochoid::fitting
