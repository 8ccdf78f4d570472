#include "common/calibrate_views.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <system_error>
#include <utility>

#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/tracking/frame_source.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

// A picture, or a video: that shows the board in hundreds of frames, so two per second are looked
// at, and of those found only the ones where it has moved.
void look_into(const fs::path& path, const tracking::BoardPattern& pattern, BoardViews& views) {
  constexpr double kEvery_s = 0.5, kMoved = 0.03;
  constexpr std::size_t kMost = 40;
  const auto source = tracking::open_video(path);
  views.held_alike(source->info().orientation, path.string());
  auto frame = source->next(), following = source->next();
  if (!following) return views.look(frame->luma, path.string(), pattern);
  double next_s = 0.0;
  const std::size_t first = views.found.size();
  for (; frame; frame = std::exchange(following, following ? source->next() : std::nullopt)) {
    if (frame->t_s < next_s) continue;
    next_s = frame->t_s + kEvery_s;
    const std::size_t before = views.found.size();
    views.look(frame->luma, fmt::format("{} frame {}", path.string(), frame->index), pattern);
    if (before == first || views.found.size() == before) continue;
    const auto &a = views.found[before - 1].image_px, &b = views.found[before].image_px;
    double moved = 0.0;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
      moved += (a[i] - b[i]).norm() / static_cast<double>(std::min(a.size(), b.size()));
    if (moved < kMoved * frame->luma.cols) views.found.pop_back(), views.pictures.pop_back();
    if (views.found.size() - first >= kMost) break;
  }
}

// Pictures and videos, those of folders and patterns one by one.
std::vector<fs::path> inputs_of(const std::vector<fs::path>& inputs) {
  std::vector<fs::path> files;
  for (const fs::path& input : inputs) {
    const std::vector<fs::path> some = fs::is_directory(input)
                                           ? tracking::pictures_in(input)
                                           : tracking::files_of_recording(input);
    files.insert(files.end(), some.begin(), some.end());
  }
  for (const fs::path& file : files)
    if (!fs::exists(file)) throw InputError(fmt::format("{}: no such file", file.string()));
  return files;
}

// What --floor names: a file, be it called otherwise among the inputs, or one of these by its name
// alone; as it is if neither, such as a picture of a video.
fs::path floor_among(const std::vector<fs::path>& files, const fs::path& floor) {
  std::error_code ignored;
  const auto among = [&](const auto& is_it) {
    const auto at = std::find_if(files.begin(), files.end(), is_it);
    return at == files.end() ? floor : *at;
  };
  if (fs::is_regular_file(floor, ignored))
    return among([&](const fs::path& file) { return fs::equivalent(file, floor, ignored); });
  return among([&](const fs::path& file) { return file.filename() == floor; });
}

// The same picture under two names tells nothing twice.
std::vector<fs::path> each_once(const std::vector<fs::path>& files) {
  std::vector<fs::path> chosen;
  std::map<std::string, fs::path> by_checksum;
  for (const fs::path& file : files) {
    const auto [same, fresh] = by_checksum.emplace(data::sha256_of_file(file), file);
    if (fresh)
      chosen.push_back(file);
    else
      note(fmt::format("{}: is the same picture as {} and counts once", file.string(),
                       same->second.string()));
  }
  return chosen;
}

std::string told(const tracking::LeftOut& out, const std::string& name) {
  const std::size_t corners = out.corners_px.size();
  if (corners > 0)
    return fmt::format("{}: {} contradict{} the rest and {} left out, at ({:.0f}, {:.0f}) px{}",
                       name, corners == 1 ? "a corner" : fmt::format("{} corners", corners),
                       corners == 1 ? "s" : "", corners == 1 ? "is" : "are", out.corners_px[0].x(),
                       out.corners_px[0].y(), corners > 1 ? " and more" : "");
  return fmt::format(
      "{}: contradicts the other pictures{} and is left out; is it the same board, flat and sharp?",
      name, std::isfinite(out.rms_px) ? fmt::format(" (rms {:.2f} px)", out.rms_px) : "");
}

}  // namespace

void BoardViews::held_alike(int one, const std::string& name) {
  if (orientation.value_or(one) != one)
    throw InputError(
        fmt::format("{}: the camera was held another way than for the pictures before it (Exif "
                    "orientation {} after {}); take them alike, or remove what they say of it",
                    name, one, *orientation));
  orientation = one;
}

void BoardViews::look(const cv::Mat& luma, const std::string& name,
                      const tracking::BoardPattern& pattern) {
  if (looked_at++ == 0) size = luma.size();
  if (luma.size() != size)
    throw InputError(
        fmt::format("{} is {} x {}, the pictures before it {} x {}; one camera has "
                    "one size",
                    name, luma.cols, luma.rows, size.width, size.height));
  if (auto view = tracking::find_board(luma, pattern, name)) {
    found.push_back(std::move(*view));
    pictures.push_back(luma);
  } else if (other_board.empty() && !pattern.marker_m) {
    const auto seen = tracking::chessboard_in(luma, pattern);
    if (seen && *seen != cv::Size(pattern.columns, pattern.rows))
      other_board =
          fmt::format("the board in {} has {}x{} inner corners", name, seen->width, seen->height);
  }
}

std::vector<fs::path> board_files(const std::vector<fs::path>& inputs, const std::string& floor) {
  std::vector<fs::path> files = inputs_of(inputs);
  const fs::path shown = floor_among(files, floor);
  std::error_code ignored;
  const auto at = std::find(files.begin(), files.end(), shown);
  if (at != files.end())
    std::rotate(files.begin(), at, at + 1);
  else if (fs::is_regular_file(shown, ignored))
    files.insert(files.begin(), shown);
  return files;
}

BoardViews look_at_inputs(const std::vector<fs::path>& inputs, const std::string& floor,
                          const tracking::BoardPattern& pattern) {
  BoardViews views;
  Progress progress("calibrate", "files");
  std::vector<fs::path> files = each_once(board_files(inputs, floor));
  views.floor = floor_among(files, floor).string();
  views.first = files.front().string();
  // The boards say what size pictures have.
  if (files.front() == views.floor) std::rotate(files.begin(), files.begin() + 1, files.end());
  for (std::size_t i = 0; i < files.size(); ++i) {
    look_into(files[i], pattern, views);
    progress.update(static_cast<std::int64_t>(i + 1), static_cast<std::int64_t>(files.size()));
  }
  if (views.found.size() < 3) {
    const bool in_all = static_cast<int>(views.found.size()) == views.looked_at;
    throw InputError(fmt::format(
        "the board ({}x{} of {:g} mm) is whole in {} of {} pictures; three are needed{}",
        pattern.columns, pattern.rows, 1e3 * pattern.square_m, views.found.size(), views.looked_at,
        in_all                       ? ", tilted in different directions"
        : !views.other_board.empty() ? "; " + views.other_board
        : pattern.marker_m           ? ". Is --pattern the number of squares?"
                                     : ". Is --pattern the number of inner corners?"));
  }
  return views;
}

void set_aside(const tracking::Calibration& result, BoardViews& views) {
  for (const tracking::LeftOut& out : result.left_out) {
    tracking::BoardView& view = views.found[out.view];
    note(told(out, view.name));
    for (const Eigen::Vector2d& corner : out.corners_px) {
      const auto at = std::find(view.image_px.begin(), view.image_px.end(), corner);
      view.board_m.erase(view.board_m.begin() + (at - view.image_px.begin()));
      view.image_px.erase(at);
    }
  }
}

bool is_left_out(const tracking::Calibration& result, std::size_t view) {
  return std::any_of(result.left_out.begin(), result.left_out.end(), [view](const auto& out) {
    return out.view == view && out.corners_px.empty();
  });
}

std::size_t floor_view(const std::string& floor, const BoardViews& views) {
  if (floor.empty()) {
    if (views.found.front().name.starts_with(views.first)) return 0;
    throw InputError(fmt::format(
        "{}: the board is not seen whole in this, the first picture, which is taken for "
        "that of the floor; name another with --floor",
        views.first));
  }
  for (std::size_t i = 0; i < views.found.size(); ++i)
    if (views.found[i].name == views.floor) return i;
  std::error_code ignored;
  throw InputError(
      fmt::format("--floor {}: {}", floor,
                  fs::exists(views.floor, ignored)
                      ? "the board is not seen whole in it"
                      : "no such picture; give a file, or the name of one among the pictures"));
}

}  // namespace trochoid::tools
