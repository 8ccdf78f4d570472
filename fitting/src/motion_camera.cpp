#include "trochoid/fitting/motion_camera.hpp"

#include <fmt/core.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "choose/ladder.hpp"
#include "judge/widen.hpp"
#include "observe/camera_error.hpp"
#include "observe/camera_off.hpp"

namespace trochoid::fitting {
namespace {

// By how much a camera is off, in its likely deviations.
struct Deviations {
  Eigen::VectorXd off;
  Eigen::MatrixXd covariance;
};

Deviations deviations_in(const data::Fit& fit) {
  std::vector<int> places;
  for (std::size_t i = 0; i < fit.covariance_names.size(); ++i)
    if (is_camera_off(fit.covariance_names[i])) places.push_back(static_cast<int>(i));
  Deviations found{Eigen::VectorXd(std::ssize(places)), fit.covariance(places, places)};
  for (std::size_t k = 0; k < places.size(); ++k)
    found.off[static_cast<Eigen::Index>(k)] =
        fit.find(fit.covariance_names[static_cast<std::size_t>(places[k])])->value;
  return found;
}

// Where a fit ended; losses that it has not start as small as not to lead away from there.
std::map<std::string, double> start_at(const data::Fit& fit, const model::Predictor& predictor) {
  constexpr double kSmall = 0.03;  // of what ends a spin within seconds
  std::map<std::string, double> values;
  for (const model::ParameterInfo& info : predictor.parameters())
    if (info.logarithmic) values[info.name] = kSmall * info.value;
  for (const std::string& name : fit.covariance_names)
    if (!is_camera_off(name)) values[name] = fit.find(name)->value;
  return values;
}

std::vector<data::Track> all_measured_by(const data::Scene& scene,
                                         std::span<const data::Track> tracks,
                                         const data::Camera& camera, const data::Camera& other) {
  std::vector<data::Track> out(tracks.begin(), tracks.end());
  for (data::Track& track : out)
    for (data::TrackSample& sample : track.samples)
      sample = measured_by(scene, sample, camera, other);
  return out;
}

// A fit of the same motion with the camera free as well, which is `off` the one told.
data::Fit fit_with(std::span<const data::Track> tracks, const data::Fit& near, data::Scene scene,
                   const data::Camera& camera, const Eigen::VectorXd& off, FitOptions how) {
  const auto plain = model::make_predictor(scene);
  const auto free_camera = with_camera_off(*plain, -off, scene);
  how.camera = &camera;
  how.start = start_at(near, *plain);
  how.strategy = Strategy::single;
  const data::FitParameter* velocity = near.find("vx_m_s");
  how.rolls_at_first = velocity != nullptr && velocity->status == data::ParameterStatus::derived;
  how.profile = false;
  how.bootstrap = 0;
  return fit(tracks, *free_camera, scene, how);
}

// With all losses that act on nearly every body: one that is left out would bend the camera.
data::Scene with_usual_losses(data::Scene scene) {
  for (const Term& term : ladder_of(scene, false).terms)
    if (term.usual) term.switch_on(scene);
  return scene;
}

std::map<std::string, double> sigmas_of_state(const data::Fit& fit, const data::Scene& scene) {
  std::map<std::string, double> sigmas;
  const auto predictor = model::make_predictor(scene);
  for (const model::ParameterInfo& info : predictor->parameters())
    if (const data::FitParameter* found = fit.find(info.name);
        found != nullptr && info.role == model::ParameterInfo::Role::initial)
      sigmas[info.name] = found->sigma;
  return sigmas;
}

bool explains(const data::Fit& fit) {
  return fit.converged && fit.verdict != data::FitVerdict::doubtful;
}

}  // namespace

std::optional<MotionCamera> camera_by_motion(std::span<const data::Track> tracks,
                                             const data::Fit& given_fit, const data::Scene& given,
                                             const FitOptions& options) {
  constexpr int kRounds = 8;
  constexpr double kSettled = 0.3, kLikely = 4.0;  // standard deviations: left, and beforehand
  const data::Scene scene = with_usual_losses(scene_as_fitted(given));
  const auto told = uncertain_camera(scene);
  if (!told) return std::nullopt;
  MotionCamera now{*told, {tracks.begin(), tracks.end()}, {}};
  const auto by = told->likely_deviations();
  Eigen::VectorXd off = Eigen::VectorXd::Zero(by.cols());
  data::Fit motion = given_fit;
  for (int round = 0; round < kRounds; ++round) {
    motion = fit_with(now.tracks, motion, scene, now.camera, off, options);
    if (!explains(motion)) return std::nullopt;
    const Deviations found = deviations_in(motion);
    off += found.off;
    if (!(off.cwiseAbs().maxCoeff() < kLikely)) return std::nullopt;
    const Eigen::ArrayXd sigma = found.covariance.diagonal().array().sqrt();
    if ((found.off.array().abs() / sigma).maxCoeff() < kSettled) {
      now.sigmas = sigmas_of_state(motion, scene);
      now.camera.covariance =
          by * (found.covariance + found.off * found.off.transpose()) * by.transpose();
      return now;
    }
    now.camera = told->moved(by * off);  // as uncertain beforehand as the one told
    now.tracks = all_measured_by(scene, tracks, *told, now.camera);
  }
  return std::nullopt;
}

void allow_for_camera(const MotionCamera& camera, data::Fit& fit) {
  constexpr double kWorthWords = 1.3;
  double most = 1.0;
  std::string widest;
  for (data::FitParameter& parameter : fit.parameters) {
    const auto wide = camera.sigmas.find(parameter.name);
    if (wide == camera.sigmas.end() || parameter.status != data::ParameterStatus::free) continue;
    const double times = wide->second / parameter.sigma;
    if (!(times > 1.0) || !std::isfinite(times)) continue;
    widen(parameter, times, fit);
    if (times > most) most = times, widest = parameter.name;
  }
  if (most > kWorthWords)
    fit.warnings.push_back(fmt::format(
        "error bars of the state allow for losses that the camera, told by this motion, may stand "
        "in for, above all that of {}: {:.2g} times as wide",
        widest, most));
}

}  // namespace trochoid::fitting
