#include "evidence.hpp"

#include <cmath>
#include <optional>

namespace trochoid::tracking {
namespace {

struct Levels {
  double picture, background;
};

/// Mean of the pixel and its four neighbours.
std::optional<Levels> levels_at(const cv::Mat& luma, const cv::Mat& background,
                                const Eigen::Vector2d& p) {
  if (!(p.x() >= 1.0 && p.y() >= 1.0 && p.x() < luma.cols - 2.0 && p.y() < luma.rows - 2.0))
    return std::nullopt;
  const int x = static_cast<int>(std::lround(p.x())), y = static_cast<int>(std::lround(p.y()));
  const auto mean = [&](const cv::Mat& image) {
    const std::uint8_t* row = image.ptr(y) + x;
    return 0.2 * (row[0] + row[-1] + row[1] + *(image.ptr(y - 1) + x) + *(image.ptr(y + 1) + x));
  };
  return Levels{mean(luma), mean(background)};
}

}  // namespace

Evidence weigh(const cv::Mat& luma, const cv::Mat& background, double noise_levels,
               const std::vector<Eigen::Vector2d>& face_px, const std::vector<Border>& outline) {
  // Means over five pixels differ by less than this unless something is there; codecs leave a floor
  // that the noise of single pixels does not show.
  const double threshold = 4.0 + 1.5 * noise_levels;
  Evidence evidence;
  int covered = 0, stepped = 0;
  for (const Eigen::Vector2d& p : face_px)
    if (const auto here = levels_at(luma, background, p))
      covered += std::abs(here->picture - here->background) > threshold;
  for (const Border& border : outline) {
    const auto in = levels_at(luma, background, border.at_px - border.gap_px * border.normal_px);
    const auto out = levels_at(luma, background, border.at_px + border.gap_px * border.normal_px);
    if (!in || !out) continue;
    // A step that the background has as well belongs to the scene.
    const double step = in->picture - out->picture;
    const double own = step - (in->background - out->background);
    stepped += std::abs(own) > threshold && std::abs(step) > threshold;
  }
  if (!face_px.empty()) evidence.cover = covered / static_cast<double>(face_px.size());
  if (!outline.empty()) evidence.edges = stepped / static_cast<double>(outline.size());
  return evidence;
}

}  // namespace trochoid::tracking
