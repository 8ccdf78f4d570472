#pragma once
#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

namespace trochoid::tools {

/// Colours as style-sheet variables of the report with a fallback for a picture that stands alone.
namespace ink {
inline constexpr const char* observed = "var(--observed,#0072b2)";
inline constexpr const char* predicted = "var(--predicted,#d55e00)";
inline constexpr const char* x = "var(--x,#006e50)";
inline constexpr const char* y = "var(--y,#a0427f)";
inline constexpr const char* words = "var(--words,#1a1a1a)";
inline constexpr const char* faint = "var(--rule,#b8b8b8)";
inline constexpr const char* band = "var(--band,#dfe3e6)";
inline constexpr const char* paper = "var(--paper,#ffffff)";
}  // namespace ink

struct Range {
  double low = 0.0, high = 1.0;
  [[nodiscard]] double span() const { return high - low; }
  void include(double value);
  static Range empty();
};

struct AxisWords {
  std::string x, y;
};

/// One pair of axes as an SVG picture. Coordinates are data coordinates; what falls outside the
/// axes is clipped.
class SvgPlot {
 public:
  enum class Scale { linear, logarithmic, equal };  ///< equal: one unit is as long in x as in y
  SvgPlot(std::string id, Range x, Range y, AxisWords words, Scale scale, double width = 560.0,
          double height = 360.0);

  void line(std::span<const Eigen::Vector2d> points, const char* colour, double width,
            const std::string& dash = {});
  void dots(std::span<const Eigen::Vector2d> points, const char* colour, double radius);
  void bar(Range x, Range y, const char* colour);
  void words(const Eigen::Vector2d& at, const std::string& text, const char* colour);
  /// Key entry in the upper right corner; `line` or dot.
  void key(const std::string& text, const char* colour, bool line);
  /// An invisible dot that a script may move: <circle id="ID-cursor-NAME">.
  void cursor(const std::string& name, const char* colour);
  [[nodiscard]] std::string text() const;

 private:
  [[nodiscard]] double px_x(double x) const;
  [[nodiscard]] double px_y(double y) const;
  void axes(const AxisWords& words);

  std::string id_;
  Range x_, y_;
  Scale scale_;
  double width_, height_, left_ = 58.0, right_ = 14.0, top_ = 14.0, bottom_ = 42.0;
  std::string frame_, body_, keys_;
  int key_count_ = 0;
};

/// The same picture with the fallback colours alone, for a file of its own.
[[nodiscard]] std::string standalone(const std::string& svg);

/// Text with &, <, > and quotes escaped for HTML and SVG.
[[nodiscard]] std::string escaped(const std::string& text);

}  // namespace trochoid::tools
