#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <opencv2/core.hpp>
#include <span>
#include <string>

namespace trochoid::tools {

/// The palette of Okabe and Ito (2008), told apart by the colour-blind; BGR as OpenCV wants it.
namespace palette {
inline const cv::Scalar black{0, 0, 0};
inline const cv::Scalar orange{0, 159, 230};
inline const cv::Scalar sky_blue{233, 180, 86};
inline const cv::Scalar yellow{66, 228, 240};
inline const cv::Scalar blue{178, 114, 0};
inline const cv::Scalar vermillion{0, 94, 213};
inline const cv::Scalar white{255, 255, 255};
inline const cv::Scalar observed = sky_blue;
inline const cv::Scalar predicted = orange;
// Green and purple of the same palette, darkened to be read as thin strokes on paper.
inline const cv::Scalar residual_x{80, 110, 0};
inline const cv::Scalar residual_y{127, 66, 160};
}  // namespace palette

/// How a stroke is laid on the picture. A halo keeps it readable on any background.
struct Stroke {
  cv::Scalar colour = palette::white;
  int width_px = 1;
  int halo_px = 1;  ///< dark rim on each side, 0 = none
  double halo_alpha = 0.55;
};

/// Strokes are collected as coverage, the darkest of overlapping ones counts, and laid on the
/// picture at once: a path that crosses itself a hundred times stays as transparent as one that
/// does not. Positions are in pixels of the picture, pixel centres at integers; sub-pixel parts are
/// kept.
class Ink {
 public:
  explicit Ink(cv::Size size);
  void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const Stroke& stroke,
            double alpha);
  /// NaN points break the line.
  void polyline(std::span<const Eigen::Vector2d> points, const Stroke& stroke, double alpha);
  void dashes(std::span<const Eigen::Vector2d> points, const Stroke& stroke, double alpha,
              double dash_px, double gap_px);
  void dot(const Eigen::Vector2d& centre, double radius_px, const Stroke& stroke, double alpha);
  void ring(const Eigen::Vector2d& centre, double radius_px, const Stroke& stroke, double alpha);
  /// Lays everything collected on `picture` (CV_8UC3) in the stroke's colour.
  void lay_on(cv::Mat& picture, const Stroke& stroke) const;
  void clear();

 private:
  void touch(const Eigen::Vector2d& point, double reach_px);
  cv::Mat coverage_, halo_;
  cv::Rect touched_;
};

enum class Align { left, centre, right };

/// Anti-aliased text, `height_px` the height of a capital; `at` is the left, middle or right end of
/// the base line. The font is ASCII's: Latin letters lose their accents, the rest is shown as "?".
void draw_text(cv::Mat& picture, const std::string& text, const cv::Point2d& at, double height_px,
               const cv::Scalar& colour, Align align = Align::left);
/// The same over a dark halo, for text inside a picture.
void draw_text_with_halo(cv::Mat& picture, const std::string& text, const cv::Point2d& at,
                         double height_px, const cv::Scalar& colour, Align align = Align::left);
[[nodiscard]] double text_width_px(const std::string& text, double height_px);

}  // namespace trochoid::tools
