#pragma once
#include <array>
#include <limits>
#include <string_view>

#include "trochoid/data/angle.hpp"
#include "trochoid/data/scene.hpp"

/// The scene file's keys, stated once: the reader, the writer and the suggestions for misspelt keys
/// all walk these lists. A visitor is called as visit(key, member pointer, constraint).
namespace trochoid::data {

/// Admissible numbers; `words` completes "must be ...".
struct Range {
  double lower;
  double upper;
  bool lower_allowed;
  const char* words;
  [[nodiscard]] bool holds(double value) const {
    return (lower_allowed ? value >= lower : value > lower) && value <= upper;
  }
};
constexpr double kLargest = std::numeric_limits<double>::max();
constexpr Range kAny{-kLargest, kLargest, true, "a finite number"};
constexpr Range kPositive{0.0, kLargest, false, "greater than 0"};
constexpr Range kNonNegative{0.0, kLargest, true, "0 or greater"};
// A body of 45 m is one of 45 mm.
constexpr Range kSize{0.0, 10.0, false, "in metres, greater than 0 and at most 10"};
constexpr Range kSizeOrNone{0.0, 10.0, true, "in metres, 0 to 10"};
constexpr Range kTilt{0.0, kPi, true, "between 0 (lying flat) and pi"};
constexpr Range kSlope{-Support::kSteepest, Support::kSteepest, true,
                       "between -0.2 and 0.2, the floor's rise per length"};
constexpr Range kTolerance{1e-15, 0.1, true, "between 1e-15 (finer is below rounding) and 0.1"};
constexpr Range kObjects{1.0, TrackingSettings::kMostObjects, true, "a whole number in 1..64"};
constexpr Range kFrames{1.0, 1e15, true, "numbers of frames after the first, whole"};
static_assert(Support::kSteepest == 0.2, "as kSlope words it");
static_assert(TrackingSettings::kMostObjects == 64, "as kObjects words it");

/// A word out of a list; the index in the list is the value of an enum.
template <std::size_t N>
using Words = std::array<std::string_view, N>;
constexpr Words<3> kBodyKinds{"disc", "ring", "top"};
constexpr Words<2> kTransfers{"sRGB", "linear"};
constexpr Words<4> kSupportKinds{"floor", "flat", "pivot", "none"};
constexpr Words<9> kModels{"free",    "top",  "top-euler", "smooth", "rolling",
                           "sliding", "puck", "pivot",     "auto"};
constexpr Words<7> kIntegrators{"auto",        "dop853",    "taylor", "radau",
                                "cvode-adams", "cvode-bdf", "arkode"};
constexpr Words<2> kRimSwitches{"end", "impact"};

struct AnyText {};      ///< free text
struct TimeOrFrame {};  ///< "1.5" or 1.5 seconds, "f120" frames

template <class Visit>
void mark_keys(Visit&& visit) {
  visit("distance_m", &SpinMark::distance_m, kNonNegative);
  visit("size_m", &SpinMark::size_m, kPositive);
  visit("angle_rad", &SpinMark::angle_rad, kAny);
}

template <class Visit>
void body_keys(Visit&& visit) {
  visit("kind", &Body::kind, kBodyKinds);
  visit("radius_m", &Body::radius_m, kSize);
  visit("inner_radius_m", &Body::inner_radius_m, kSizeOrNone);
  visit("thickness_m", &Body::thickness_m, kSizeOrNone);
  visit("border_radius_m", &Body::border_radius_m, kSizeOrNone);
  visit("axle_radius_m", &Body::axle_radius_m, kSizeOrNone);
  visit("axle_above_m", &Body::axle_above_m, kSizeOrNone);
  visit("mass_kg", &Body::mass_kg, kPositive);
  visit("I_kg_m2", &Body::I_kg_m2, kPositive);
  visit("Is_kg_m2", &Body::Is_kg_m2, kPositive);
  visit("l_m", &Body::l_m, kPositive);
}

template <class Visit>
void support_keys(Visit&& visit) {
  visit("kind", &Support::kind, kSupportKinds);
  visit("pivot_m", &Support::pivot_m, kAny);
  visit("slope_x", &Support::slope_x, kSlope);
  visit("slope_y", &Support::slope_y, kSlope);
}

template <class Visit>
void camera_keys(Visit&& visit) {
  visit("file", &CameraSettings::file, AnyText{});
  visit("scale_px_per_m", &CameraSettings::scale_px_per_m, kPositive);
  visit("height_m", &CameraSettings::height_m, kPositive);
  visit("readout_s", &CameraSettings::readout_s, kNonNegative);
  visit("rows", &CameraSettings::rows, kPositive);
  visit("frame_rate_hz", &CameraSettings::frame_rate_hz, kPositive);
  visit("missing_frames", &CameraSettings::missing_frames, kFrames);
  visit("exposure_s", &CameraSettings::exposure_s, kNonNegative);
  visit("transfer", &CameraSettings::transfer, kTransfers);
}

template <class Visit>
void tracking_keys(Visit&& visit) {
  visit("objects", &TrackingSettings::objects, kObjects);
  visit("at_px", &TrackingSettings::at_px, kAny);
  visit("from", &TrackingSettings::from, TimeOrFrame{});
  visit("to", &TrackingSettings::to, TimeOrFrame{});
}

template <class Visit>
void model_keys(Visit&& visit) {
  using M = ModelSettings;
  visit("name", &M::name, kModels);
  visit("gravity_m_s2", &M::gravity_m_s2, kNonNegative);
  visit("air_linear_N_m_s", &M::air_linear_N_m_s, kNonNegative);
  visit("air_quadratic_N_m_s2", &M::air_quadratic_N_m_s2, kNonNegative);
  visit("air_force_N_s_m", &M::air_force_N_s_m, kNonNegative);
  visit("gap_viscosity_Pa_s", &M::gap_viscosity_Pa_s, kNonNegative);
  visit("friction", &M::friction, kNonNegative);
  visit("slip_regularisation_m_s", &M::slip_regularisation_m_s, kNonNegative);
  visit("contact_radius_m", &M::contact_radius_m, kSize);
  visit("rolling_friction_m", &M::rolling_friction_m, kNonNegative);
  visit("pivoting_friction_m", &M::pivoting_friction_m, kNonNegative);
  visit("contour_friction_m", &M::contour_friction_m, kNonNegative);
  visit("couple_regularisation_rad_s", &M::couple_regularisation_rad_s, kPositive);
  visit("drag_transverse_N_m_s", &M::drag_transverse_N_m_s, kNonNegative);
  visit("drag_spin_N_m_s", &M::drag_spin_N_m_s, kNonNegative);
  visit("drag_spin_dry_N_m", &M::drag_spin_dry_N_m, kNonNegative);
  visit("drag_spin_quadratic_N_m_s2", &M::drag_spin_quadratic_N_m_s2, kNonNegative);
  visit("spin_down_dry_rad_s2", &M::spin_down_dry_rad_s2, kNonNegative);
  visit("spin_down_weakening_s_rad", &M::spin_down_weakening_s_rad, kNonNegative);
  visit("spin_down_viscous_1_s", &M::spin_down_viscous_1_s, kNonNegative);
  visit("spin_down_quadratic_1_rad", &M::spin_down_quadratic_1_rad, kNonNegative);
  visit("spin_down_imbalance_sin_rad_s2", &M::spin_down_imbalance_sin_rad_s2, kAny);
  visit("spin_down_imbalance_cos_rad_s2", &M::spin_down_imbalance_cos_rad_s2, kAny);
}

template <class Visit>
void start_keys(Visit&& visit) {
  using S = StartSettings;
  visit("theta_rad", &S::theta_rad, kTilt);
  visit("phi_rad", &S::phi_rad, kAny);
  visit("psi_rad", &S::psi_rad, kAny);
  visit("w1_rad_s", &S::w1_rad_s, kAny);
  visit("w2_rad_s", &S::w2_rad_s, kAny);
  visit("w3_rad_s", &S::w3_rad_s, kAny);
  visit("dtheta_rad_s", &S::dtheta_rad_s, kAny);
  visit("dphi_rad_s", &S::dphi_rad_s, kAny);
  visit("dpsi_rad_s", &S::dpsi_rad_s, kAny);
  visit("omega_s_rad_s", &S::omega_s_rad_s, kAny);
  visit("x_m", &S::x_m, kAny);
  visit("y_m", &S::y_m, kAny);
  visit("vx_m_s", &S::vx_m_s, kAny);
  visit("vy_m_s", &S::vy_m_s, kAny);
  visit("w_body_rad_s", &S::w_body_rad_s, kAny);
  visit("moments_kg_m2", &S::moments_kg_m2, kPositive);
}

template <class Visit>
void run_keys(Visit&& visit) {
  visit("until_s", &RunSettings::until_s, kPositive);
  visit("rate_hz", &RunSettings::rate_hz, kPositive);
  visit("tolerance", &RunSettings::tolerance, kTolerance);
  visit("integrator", &RunSettings::integrator, kIntegrators);
  visit("rim_switch", &RunSettings::rim_switch, kRimSwitches);
}

template <class Visit>
void fit_keys(Visit&& visit) {
  visit("free", &FitSettings::free, AnyText{});
  visit("prior", &FitSettings::prior, kAny);
  visit("fixed", &FitSettings::fixed, kAny);
  visit("bounds", &FitSettings::bounds, kAny);
  visit("free_pivot", &FitSettings::free_pivot, AnyText{});
  visit("free_scale", &FitSettings::free_scale, AnyText{});
}

}  // namespace trochoid::data
