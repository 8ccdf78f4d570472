#pragma once
#include <string>

#include "trochoid/data/fit.hpp"

namespace trochoid::fitting {

/// Makes the error bar of one parameter that many times as wide, in the covariance as well.
/// @param times  >= 1.
void widen(data::FitParameter& parameter, double times, data::Fit& fit);

}  // namespace trochoid::fitting
