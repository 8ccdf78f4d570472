#include "find/contrast.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace trochoid::tracking {
namespace {

struct Levels {
  double picture, background;
};

bool holds(const cv::Mat& image, const Eigen::Vector2d& p) {
  return p.x() >= 1.0 && p.y() >= 1.0 && p.x() < image.cols - 2.0 && p.y() < image.rows - 2.0;
}

/// Mean of the pixel and its four neighbours, of one interleaved plane.
double mean_at(const cv::Mat& image, const Eigen::Vector2d& p, int plane) {
  const int x = static_cast<int>(std::lround(p.x())), y = static_cast<int>(std::lround(p.y()));
  const int step = image.channels();
  const std::uint8_t* here = image.ptr(y) + step * x + plane;
  return 0.2 * (here[0] + here[-step] + here[step] + *(image.ptr(y - 1) + step * x + plane) +
                *(image.ptr(y + 1) + step * x + plane));
}

std::optional<Levels> levels_at(const cv::Mat& image, const cv::Mat& background,
                                const Eigen::Vector2d& p, int plane) {
  if (!holds(image, p)) return std::nullopt;
  return Levels{mean_at(image, p, plane), mean_at(background, p, plane)};
}

/// One plane of the picture, the background's, and what a difference between them must exceed.
struct PlanePair {
  const cv::Mat& picture;
  const cv::Mat& background;
  int plane;
  double threshold;
  bool half;  ///< of half the size

  [[nodiscard]] Eigen::Vector2d place(const Eigen::Vector2d& p) const {
    return half ? Eigen::Vector2d(0.5 * p - Eigen::Vector2d::Constant(0.25)) : p;
  }
  [[nodiscard]] bool covered(const Eigen::Vector2d& p) const {
    const auto here = levels_at(picture, background, place(p), plane);
    return here && std::abs(here->picture - here->background) > threshold;
  }
  /// A step that the background has as well belongs to the scene.
  [[nodiscard]] bool steps(const Border& border) const {
    const Eigen::Vector2d gap = std::max(border.gap_px, half ? 2.5 : 0.0) * border.normal_px;
    const auto in = levels_at(picture, background, place(border.at_px - gap), plane);
    const auto out = levels_at(picture, background, place(border.at_px + gap), plane);
    if (!in || !out) return false;
    const double step = in->picture - out->picture;
    const double own = step - (in->background - out->background);
    return std::abs(own) > threshold && std::abs(step) > threshold;
  }
};

FaceColours colours_at(const Frame& frame, const std::vector<Eigen::Vector2d>& face_px) {
  constexpr std::uint8_t kGrey = 128;
  FaceColours face;
  for (const Eigen::Vector2d& p : face_px) {
    const Eigen::Vector2d half = 0.5 * p - Eigen::Vector2d::Constant(0.25);
    const bool coloured = !frame.chroma.empty();
    if (face.count == FaceColours::kMost || !holds(frame.luma, p) ||
        (coloured && !holds(frame.chroma, half)))
      continue;
    const auto level = [](double mean) { return static_cast<std::uint8_t>(std::lround(mean)); };
    face.at[static_cast<std::size_t>(face.count++)] = {
        level(mean_at(frame.luma, p, 0)), coloured ? level(mean_at(frame.chroma, half, 0)) : kGrey,
        coloured ? level(mean_at(frame.chroma, half, 1)) : kGrey};
  }
  return face;
}

}  // namespace

Contrast measure_contrast(const Frame& frame, const Plate& background,
                          const std::vector<Eigen::Vector2d>& face_px,
                          const std::vector<Border>& outline) {
  // Means over five pixels differ by less than this unless something is there; codecs leave a floor
  // that the noise of single pixels does not show.
  std::vector<PlanePair> planes{
      {frame.luma, background.luma, 0, 4.0 + 1.5 * background.noise_levels, false}};
  if (!frame.chroma.empty() && !background.chroma.empty())
    for (const int plane : {0, 1})
      planes.push_back({frame.chroma, background.chroma, plane,
                        4.0 + 1.5 * background.chroma_noise_levels, true});
  Contrast contrast;
  int covered = 0, stepped = 0;
  for (const Eigen::Vector2d& p : face_px)
    covered += std::any_of(planes.begin(), planes.end(),
                           [&](const PlanePair& plane) { return plane.covered(p); });
  for (const Border& border : outline)
    stepped += std::any_of(planes.begin(), planes.end(),
                           [&](const PlanePair& plane) { return plane.steps(border); });
  if (!face_px.empty()) contrast.face = covered / static_cast<double>(face_px.size());
  if (!outline.empty()) contrast.outline = stepped / static_cast<double>(outline.size());
  contrast.colours = colours_at(frame, face_px);
  return contrast;
}

}  // namespace trochoid::tracking
