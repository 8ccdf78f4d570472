#pragma once
#include <opencv2/core.hpp>

#include "decode/libav_handles.hpp"

namespace trochoid::tracking {

/// 8-bit full-range luma of a decoded picture. Planar YUV and gray are read as coded (limited range
/// stretched, deeper samples rounded to 8 bit); everything else goes through libswscale, whose
/// context is kept in `scaler`.
/// @throws InputError naming the pixel format if that cannot be done; the caller knows the file.
[[nodiscard]] cv::Mat luma_of(const AVFrame& picture, Scaler& scaler);

/// Colour differences at half the size, CV_8UC2 (Cb, Cr): as coded where that is 8-bit 4:2:0,
/// deeper samples rounded, finer ones averaged; empty for anything but such YUV with a luma plane.
[[nodiscard]] cv::Mat chroma_of(const AVFrame& picture);

/// The same picture in colour, CV_8UC3 in OpenCV's order. @throws InputError as luma_of does.
[[nodiscard]] cv::Mat bgr_of(const AVFrame& picture, Scaler& scaler);

}  // namespace trochoid::tracking
