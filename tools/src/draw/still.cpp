#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "draw/canvas.hpp"
#include "draw/encoded_file.hpp"
#include "draw/overlay.hpp"
#include "draw/overlay_drawing.hpp"
#include "draw/residual_strip.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tools {
namespace {

constexpr int kStillWidthPx = 1280;
constexpr double kMostEnlargedStill = 6.0;  // beyond that a pixel of the recording is a tile

struct Box {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = Eigen::Vector2d::Constant(-1e9);
  void add(const Eigen::Vector2d& point) {
    if (!point.allFinite()) return;
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
};

struct Moment {
  std::int64_t frame = 0;
  double t_s = 0.0;
};

// First and last sample of each object: where the body's outline is drawn.
std::vector<Moment> ends_of(const ObjectPaths& paths) {
  if (paths.observed.empty()) return {};
  const ObservedPoint &first = paths.observed.front(), &last = paths.observed.back();
  return {{first.frame, first.t_s}, {last.frame, last.t_s}};
}

// The part of the frame that holds every path and the body at its ends, with a margin, not narrower
// than 3:1 or taller than 1:1.5, so that a straight path does not make a ribbon, and wide enough
// for the words.
cv::Rect cutting_of(const OverlayContent& content, cv::Size frame) {
  Box box;
  for (const ObjectPaths& paths : content.objects()) {
    for (const ObservedPoint& point : paths.observed) box.add(point.px);
    for (const PredictedLine& line : paths.predicted)
      for (const Eigen::Vector2d& px : line.px)
        if (px.x() >= 0 && px.y() >= 0 && px.x() < frame.width && px.y() < frame.height)
          box.add(px);
    for (const Moment& moment : ends_of(paths))
      for (const data::WireCurve& curve :
           content.wireframe_at(paths.object, moment.frame, moment.t_s))
        for (const Eigen::Vector2d& px : curve.image_px) box.add(px);
  }
  Eigen::Vector2d size = box.high - box.low;
  const Eigen::Vector2d centre = 0.5 * (box.low + box.high);
  size = (1.25 * size.array() + 24.0).matrix();
  size.x() = std::max({size.x(), size.y() / 1.5, kStillWidthPx / kMostEnlargedStill});
  size.y() = std::max(size.y(), size.x() / 3.0);
  const cv::Rect wanted(cvFloor(centre.x() - 0.5 * size.x()), cvFloor(centre.y() - 0.5 * size.y()),
                        cvCeil(size.x()), cvCeil(size.y()));
  const cv::Rect inside = wanted & cv::Rect({0, 0}, frame);
  return inside.width >= 8 && inside.height >= 8 ? inside : cv::Rect({0, 0}, frame);
}

// The frame the path starts on, or the nearest one the recording still has.
cv::Mat first_tracked_frame(const OverlayInput& input, const OverlayOptions& options,
                            tracking::VideoInfo& info) {
  const auto video = open_recording(input, options);
  info = video->info();
  std::int64_t wanted = std::numeric_limits<std::int64_t>::max();
  for (const data::Track& track : input.tracks.tracks)
    if (!track.samples.empty())
      wanted = std::min(wanted, std::max<std::int64_t>(0, track.samples.front().frame));
  cv::Mat picture;
  while (const auto frame = video->next()) {
    picture = frame->bgr;
    if (frame->index >= wanted) break;
  }
  return picture;
}

void draw_paths(cv::Mat& picture, const OverlayContent& content, const Enlargement& view) {
  for (const ObjectPaths& paths : content.objects()) {
    const Stroke body = content.has_prediction() ? predicted_stroke(1) : observed_stroke();
    Ink ink(picture.size());
    for (const Moment& moment : ends_of(paths))
      add_wireframe(ink, content.wireframe_at(paths.object, moment.frame, moment.t_s), view, body);
    ink.lay_on(picture, body);
    ink.clear();
    const Stroke dots{.colour = palette::observed, .width_px = 1, .halo_px = 1, .halo_alpha = 0.8};
    for (const ObservedPoint& point : paths.observed) ink.dot(view(point.px), 3.6, dots, 1.0);
    ink.lay_on(picture, dots);
    ink.clear();
    // Narrower than the dots and without a halo, so that both stay visible where they agree.
    const Stroke line_stroke{.colour = palette::predicted, .width_px = 2, .halo_px = 0};
    for (const PredictedLine& line : paths.predicted)
      ink.polyline(thinned(line.px, view, 0.7), line_stroke, 1.0);
    ink.lay_on(picture, line_stroke);
  }
}

void name_ends(cv::Mat& picture, const OverlayContent& content, const Enlargement& view,
               double text_px) {
  for (const ObjectPaths& paths : content.objects()) {
    if (paths.observed.empty()) continue;
    const Stroke stroke{.colour = palette::white, .width_px = 2, .halo_px = 1};
    Ink ink(picture.size());
    for (const bool last : {false, true}) {
      const ObservedPoint& point = last ? paths.observed.back() : paths.observed.front();
      const Eigen::Vector2d at = view(point.px);
      ink.ring(at, 0.6 * text_px, stroke, 1.0);
      draw_text_with_halo(picture, fmt::format("{} {:.3f} s", last ? "end" : "start", point.t_s),
                          {at.x() + text_px, at.y() - 0.8 * text_px}, 0.9 * text_px,
                          palette::white);
    }
    ink.lay_on(picture, stroke);
  }
}

std::string figures(const OverlayContent& content, const ObjectPaths& paths) {
  std::string words = fmt::format("{} samples, {:.3f} s", paths.observed.size(),
                                  paths.observed.back().t_s - paths.observed.front().t_s);
  if (content.objects().size() > 1) words = fmt::format("object {}: {}", paths.object, words);
  if (paths.residuals.empty()) return words + "; no fit";
  const double rms_mm = rms_m(paths.residuals) * 1000.0;
  words += fmt::format("; residuals {:.3g} mm", rms_mm);
  if (content.scale_px_per_m())
    words += fmt::format(" = {:.3g} px", rms_mm * 1e-3 * *content.scale_px_per_m());
  words += " rms per axis";
  return words;
}

}  // namespace

void write_still(const OverlayInput& input, const OverlayOptions& options,
                 const std::filesystem::path& path) {
  tracking::VideoInfo info;
  const cv::Mat frame = first_tracked_frame(input, options, info);
  const OverlayContent content(input, frame.cols, frame.rows);
  content.check_pictures(frame.cols, frame.rows, input.video.string());
  Enlargement view{cutting_of(content, frame.size()), 1.0};
  view.factor =
      std::min(kMostEnlargedStill, static_cast<double>(kStillWidthPx) / view.cutting.width);
  cv::Mat picture = view.picture(frame);
  const double text_px = std::clamp(picture.cols / 80.0, 9.0, 16.0);
  draw_paths(picture, content, view);
  name_ends(picture, content, view, text_px);
  draw_scale_bar(picture, content.scale_px_per_m(), view.factor, text_px);
  const std::string name = input.video.filename().string();
  const bool beside =
      legend_fits_beside(name, content, picture.cols - 2.0 * 1.2 * text_px, text_px);
  const int lines = (beside ? 1 : 2) + static_cast<int>(content.objects().size());
  const int caption = static_cast<int>(2.0 * text_px * lines + text_px);
  cv::Mat page(picture.rows + caption + (picture.rows + caption) % 2, picture.cols, CV_8UC3,
               cv::Scalar(34, 34, 34));
  picture.copyTo(page.rowRange(0, picture.rows));
  double base = picture.rows + 1.9 * text_px;
  draw_text(page, name, {1.2 * text_px, base}, text_px, palette::white);
  if (!beside) base += 2.0 * text_px;
  draw_legend(page, content, {page.cols - 1.2 * text_px, base}, text_px);
  for (const ObjectPaths& paths : content.objects()) {
    if (paths.observed.empty()) continue;
    base += 2.0 * text_px;
    draw_text(page, figures(content, paths), {1.2 * text_px, base}, text_px, palette::white);
  }
  write_picture(page, path);
}

void write_residual_picture(const OverlayInput& input, const std::filesystem::path& path) {
  constexpr int kWidthPx = 1400;
  constexpr double kTextPx = 16.0;
  if (!input.fit) return;
  const OverlayContent content(input, 1, 1);
  const ResidualStrip strip(content, content.first_s(), content.last_s(), kWidthPx, kTextPx);
  cv::Mat page(strip.height_px(), kWidthPx, CV_8UC3);
  strip.draw(page, std::numeric_limits<double>::quiet_NaN());
  write_picture(page, path);
}

}  // namespace trochoid::tools
