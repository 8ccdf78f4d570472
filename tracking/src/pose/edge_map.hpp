#pragma once
#include <array>
#include <opencv2/core.hpp>

namespace trochoid::tracking {

/// Where a picture has sharp edges, by direction, on a coarse grid of cells: how much its logarithm
/// changes per pixel, so that an edge in the shadow counts like one in the light, and the soft rim
/// of the shadow itself hardly at all, or where colours change. Edges the background plate has too
/// do not count.
class EdgeMap {
 public:
  static constexpr int kDirections = 8;  ///< of the normal, modulo a half turn

  /// @param window part of the picture to look at, inside it; at least 3 x 3.
  /// @param plate of the same size as the picture, or empty.
  EdgeMap(const cv::Mat& luma, const cv::Mat& plate, const cv::Rect& window, int cell_px);
  /// Adds the edges of the colours, which shadows hardly have.
  /// @param chroma CV_8UC2 of half the size; @param plate likewise, or empty.
  void add_colours(const cv::Mat& chroma, const cv::Mat& plate);

  [[nodiscard]] int cell_px() const { return cell_px_; }
  [[nodiscard]] const cv::Rect& window() const { return window_; }
  /// Strength 0..1 of the edges with a normal in this direction, one value per cell (CV_32FC1).
  [[nodiscard]] const cv::Mat& strength(int direction) const {
    return strength_[static_cast<size_t>(direction)];
  }
  [[nodiscard]] static int direction_of(double normal_x, double normal_y);

 private:
  void spread();

  cv::Rect window_;
  int cell_px_;
  std::array<cv::Mat, kDirections> own_, strength_;  ///< of the cells alone; spread
};

}  // namespace trochoid::tracking
