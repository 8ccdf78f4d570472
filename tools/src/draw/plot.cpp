#include "draw/plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "common/child_process.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

// Okabe and Ito's palette without yellow, which is faint on white.
constexpr std::array<const char*, 7> kColours{"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                              "#E69F00", "#56B4E9", "#000000"};
constexpr std::array<int, 5> kMarks{5, 7, 9, 13, 11};  // gnuplot's filled ones
constexpr int kWidth_px = 900, kPanelHeight_px = 420, kSquareHeight_px = 760;

/// A string of gnuplot's. Quotes end it, backslashes escape, backquotes would run a command.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\' || c == '`' || byte < 0x20)
      result += fmt::format("\\{:03o}", byte);
    else
      result += c;
  }
  return result + '"';
}

int columns_of(std::size_t panels) {
  return panels > 3 ? 2 : 1;
}

std::string terminal(const std::filesystem::path& path, const std::vector<Axes>& panels) {
  const int columns = columns_of(panels.size());
  int height = 0;
  for (const Axes& axes : panels) height += axes.equal ? kSquareHeight_px : kPanelHeight_px;
  height = (height + columns - 1) / columns;
  const int width = kWidth_px * (columns + 1) / 2;
  if (path.extension() == ".svg")
    return fmt::format("svg size {},{} dynamic background rgb 'white' font 'sans-serif,14'", width,
                       height);
  check_plot_name(path);
  return fmt::format("pngcairo size {},{} font 'sans,11'", width, height);
}

/// Least and largest value of all series; of NaN alone, the other way round.
Eigen::Vector2d extent(const Axes& axes, Eigen::VectorXd Series::*values) {
  Eigen::Vector2d range(INFINITY, -INFINITY);
  for (const Series& series : axes.series)
    for (const double value : series.*values)
      if (std::isfinite(value)) range = {std::min(range.x(), value), std::max(range.y(), value)};
  return range;
}

/// With equal units a path that hardly has a width would leave its numbers no room.
std::string range_of(const Eigen::Vector2d& its, const Eigen::Vector2d& other) {
  constexpr double kLeast = 0.25;
  const double width = its.y() - its.x(), least = kLeast * (other.y() - other.x());
  if (!(width < least)) return "[*:*]";
  const double middle = 0.5 * (its.x() + its.y());
  return fmt::format("[{}:{}]", middle - 0.5 * least, middle + 0.5 * least);
}

void add_settings(const Axes& axes, std::back_insert_iterator<std::string> out) {
  fmt::format_to(out,
                 "set title {} noenhanced\nset xlabel {} noenhanced\nset ylabel {} noenhanced\n",
                 quoted(axes.title), quoted(axes.x_label), quoted(axes.y_label));
  fmt::format_to(out, "{}set logscale x\n{}set logscale y\n", axes.log_x ? "" : "un",
                 axes.log_y ? "" : "un");
  fmt::format_to(out, "set format x '{0}'\nset format y '{1}'\n", axes.log_x ? "10^{%T}" : "%g",
                 axes.log_y ? "10^{%T}" : "%g");
  // One legend entry says nothing that the title does not.
  fmt::format_to(out, "set size {}\nset key {}\n", axes.equal ? "ratio -1" : "noratio",
                 axes.series.size() > 1 ? "on" : "off");
  std::string x_range = "[*:*]", y_range = x_range;
  if (axes.equal) {
    const Eigen::Vector2d x = extent(axes, &Series::x), y = extent(axes, &Series::y);
    x_range = range_of(x, y);
    y_range = range_of(y, x);
  }
  if (axes.y_range) y_range = fmt::format("[{}:{}]", axes.y_range->x(), axes.y_range->y());
  fmt::format_to(out, "set xrange {}\nset yrange {}\n", x_range, y_range);
}

void add_data(const Axes& axes, std::size_t panel, std::back_insert_iterator<std::string> out) {
  for (std::size_t i = 0; i < axes.series.size(); ++i) {
    const Series& series = axes.series[i];
    fmt::format_to(out, "$data{}_{} << EOD\n", panel, i);
    for (Eigen::Index k = 0; k < series.x.size(); ++k) {
      if (std::isfinite(series.x[k]) && std::isfinite(series.y[k]))
        fmt::format_to(out, "{:.7g} {:.7g}\n", series.x[k], series.y[k]);
      else
        fmt::format_to(out, "\n");
    }
    fmt::format_to(out, "EOD\n");
  }
}

void add_panel(const Axes& axes, std::size_t panel, std::back_insert_iterator<std::string> out) {
  add_settings(axes, out);
  fmt::format_to(out, "plot ");
  for (std::size_t i = 0; i < axes.series.size(); ++i) {
    const Series& series = axes.series[i];
    const std::size_t colour = series.colour < 0 ? i : static_cast<std::size_t>(series.colour);
    const std::string style = series.points
                                  ? fmt::format("points pt {} ps 0.9", kMarks[i % kMarks.size()])
                                  : fmt::format("lines lw 1.6 dt {}", series.dashed ? 2 : 1);
    fmt::format_to(out, "{}$data{}_{} using 1:2 with {} lc rgb '{}' title {} noenhanced",
                   i == 0 ? "" : ", ", panel, i, style, kColours[colour % kColours.size()],
                   quoted(series.label));
  }
  fmt::format_to(out, "\n");
}

std::string script(const std::vector<Axes>& panels, const std::filesystem::path& target,
                   const std::filesystem::path& output) {
  std::string text;
  const auto out = std::back_inserter(text);
  fmt::format_to(out, "set encoding utf8\nset terminal {}\nset output {}\n",
                 terminal(target, panels), quoted(output.string()));
  fmt::format_to(out,
                 "set grid lc rgb '#cccccc'\nset key outside right top\nset border 3\n"
                 "set xtics nomirror\nset ytics nomirror\n");
  for (std::size_t p = 0; p < panels.size(); ++p) add_data(panels[p], p, out);
  const auto columns = static_cast<std::size_t>(columns_of(panels.size()));
  if (panels.size() > 1)
    fmt::format_to(out, "set multiplot layout {},{}\n", (panels.size() + columns - 1) / columns,
                   columns);
  for (std::size_t p = 0; p < panels.size(); ++p) add_panel(panels[p], p, out);
  return text;
}

}  // namespace

Series with_gaps_at_turns(const Series& angle_rad) {
  std::vector<double> x, y;
  for (Eigen::Index i = 0; i < angle_rad.y.size(); ++i) {
    if (i > 0 && std::abs(angle_rad.y[i] - angle_rad.y[i - 1]) > data::kPi) {
      x.push_back(angle_rad.x[i]);
      y.push_back(NAN);
    }
    x.push_back(angle_rad.x[i]);
    y.push_back(angle_rad.y[i]);
  }
  const auto size = static_cast<Eigen::Index>(x.size());
  Series series = angle_rad;
  series.x = Eigen::Map<const Eigen::VectorXd>(x.data(), size);
  series.y = Eigen::Map<const Eigen::VectorXd>(y.data(), size);
  return series;
}

void check_plot_name(const std::filesystem::path& path) {
  if (path.extension() != ".svg" && path.extension() != ".png")
    throw InputError(fmt::format("{}: a plot is written as .svg or .png", path.string()));
}

void write_plot(const std::vector<Axes>& panels, const std::filesystem::path& path) {
  data::PendingFile pending(path);
  const data::PendingFile commands(path.string() + ".gnuplot");
  data::write_text(script(panels, path, pending.path()), commands.path());
  // Absolute: a name that begins with a dash would be an option.
  const ChildRun gnuplot =
      run_child({"gnuplot", std::filesystem::absolute(commands.path()).string()});
  if (!gnuplot.started)
    throw InputError(fmt::format("{}: gnuplot {}; install the package gnuplot-nox", path.string(),
                                 last_line(gnuplot.error_output)));
  if (gnuplot.exit_status == 0 && std::filesystem::exists(pending.path())) return pending.commit();
  const std::string why = last_line(gnuplot.error_output);
  throw InputError(fmt::format("{}: gnuplot did not draw the plot: {}", path.string(),
                               why.empty() ? "it does not say why; is the disk full?" : why));
}

}  // namespace trochoid::tools
