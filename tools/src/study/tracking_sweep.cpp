#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <random>

#include "commands.hpp"
#include "common/outputs.hpp"
#include "common/progress.hpp"
#include "common/validators.hpp"
#include "draw/plot.hpp"
#include "draw/render_picture.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/tracking/outline_fit.hpp"

namespace trochoid::tools {
namespace {

namespace fs = std::filesystem;

struct SweepOptions {
  int draws = 16;
  std::uint64_t seed = 1;
  fs::path output = "tracking_sweep.csv", plot;
};

// One made picture: what is varied, about a dark disc of 60 px on a plain grey floor.
struct SweepCase {
  double size_px = 60.0, tilt_deg = 45.0, noise_levels = 2.0, blur_px = 0.6, floor = 0.35;
  double texture = 0.0;
  bool shadow = false;
};

struct Point {
  std::string factor;
  double value = 0.0;
  SweepCase made;
};

std::vector<Point> points() {
  std::vector<Point> all;
  const auto vary = [&](const char* factor, const std::vector<double>& values,
                        const std::function<void(SweepCase&, double)>& set) {
    for (const double value : values) {
      all.push_back({factor, value, {}});
      set(all.back().made, value);
    }
  };
  vary("noise_levels", {0.5, 1, 2, 4, 8}, [](SweepCase& c, double v) { c.noise_levels = v; });
  vary("blur_px", {0.3, 0.6, 1.0, 1.6}, [](SweepCase& c, double v) { c.blur_px = v; });
  vary("floor", {0.09, 0.15, 0.35, 0.8}, [](SweepCase& c, double v) { c.floor = v; });
  vary("size_px", {16, 30, 60, 120}, [](SweepCase& c, double v) { c.size_px = v; });
  vary("tilt_deg", {15, 30, 45, 60, 75}, [](SweepCase& c, double v) { c.tilt_deg = v; });
  vary("texture", {0.05, 0.15}, [](SweepCase& c, double v) { c.texture = v; });
  vary("shadow", {1}, [](SweepCase& c, double) { c.shadow = true; });
  return all;
}

// Straight from above, with any number of pixels for the same view.
struct Overhead {
  int side_px;
  double px_per_m;
  [[nodiscard]] data::Camera camera(int finer) const {
    constexpr double kHeight_m = 0.8;
    return data::Camera::overhead(finer * side_px, finer * side_px, finer * px_per_m, kHeight_m);
  }
};

// A camera whose lens blurs before its pixels average: what lies within a pixel is rendered as
// kFine x kFine of them. The mean of blurred pixels would be an edge of straight pieces.
class Lens {
 public:
  Lens(const data::Body& body, const Overhead& view, const RenderStyle& style)
      : blur_px_(kFine * style.blur_px),
        fine_(body, view.camera(kFine), style),
        sensor_(body, view.camera(1), sharp(style)) {}

  /// Linear light on the pixels.
  [[nodiscard]] cv::Mat light(const std::vector<data::Pose<>>& poses) const {
    cv::Mat blurred, pixels;
    cv::GaussianBlur(fine_.light(poses), blurred, {}, blur_px_, blur_px_, cv::BORDER_REPLICATE);
    cv::resize(blurred, pixels, {}, 1.0 / kFine, 1.0 / kFine, cv::INTER_AREA);
    return pixels;
  }
  /// Luma before noise and rounding.
  [[nodiscard]] cv::Mat levels(const data::Pose<>& pose) const {
    cv::Mat luma;
    cv::cvtColor(sensor_.levels(light({pose})), luma, cv::COLOR_BGR2GRAY);
    return luma;
  }
  [[nodiscard]] cv::Mat picture(const std::vector<data::Pose<>>& poses, std::int64_t draw) const {
    cv::Mat luma;
    cv::cvtColor(sensor_.picture(light(poses), draw), luma, cv::COLOR_BGR2GRAY);
    return luma;
  }

 private:
  static constexpr int kFine = 3;
  static RenderStyle sharp(RenderStyle style) {
    style.blur_px = 0.0;
    return style;
  }
  double blur_px_;
  PictureRenderer fine_, sensor_;
};

// A case with everything that does not change from draw to draw.
class Studio {
 public:
  Studio(const SweepCase& made, std::uint64_t seed)
      : case_(made),
        seed_(seed),
        body_(disc()),
        view_{side(), made.size_px / (2.0 * kRadius_m)},
        camera_(view_.camera(1)),
        lens_(body_, view_, style(seed)),
        fitter_(body_, {data::SupportKind::floor, {}}, camera_) {
    plate_ = lens_.picture({}, 0);
    cv::medianBlur(plate_, plate_, made.texture > 0.0 ? 1 : 5);
  }

  [[nodiscard]] data::Pose<> pose(double x_px, double y_px) const {
    data::Pose<> pose;
    pose.theta_rad = data::radians(case_.tilt_deg);
    pose.phi_rad = 0.6;
    const double scale = case_.size_px / (2.0 * kRadius_m);
    pose.centre_m = {x_px / scale, y_px / scale,
                     data::height_on_floor_m(pose.theta_rad, kRadius_m, body_.half_thickness_m())};
    return pose;
  }

  /// Error of the CoM [px] and its square over the stated covariance, or nothing.
  struct Error {
    Eigen::Vector2d px;
    double normalised;
  };
  [[nodiscard]] std::optional<Error> measure(std::int64_t draw, std::mt19937_64& random) const {
    std::uniform_real_distribution<double> within(-1.0, 1.0);
    std::normal_distribution<double> normal;
    const double tilted = within(random), turned = within(random);
    const data::Pose<> truth = pose(tilted, turned);
    const cv::Mat luma = lens_.picture({truth}, draw);
    constexpr double kMissed_px = 0.5, kMissed_rad = 0.01;  // of a prediction
    const double px_m = 2.0 * kRadius_m / case_.size_px;
    data::Pose<> predicted = truth;
    predicted.centre_m.x() += kMissed_px * px_m * normal(random);
    predicted.centre_m.y() += kMissed_px * px_m * normal(random);
    predicted.theta_rad += kMissed_rad * normal(random);
    predicted.phi_rad += kMissed_rad * normal(random);
    const auto seen = fitter_.measure(
        {.luma = luma, .background = plate_, .detection = {}, .predicted = predicted});
    if (!seen) return std::nullopt;
    const Eigen::Vector2d off = seen->centre_px - camera_.image_from_table<double>(truth.centre_m);
    return Error{off, 0.5 * off.dot(seen->covariance_px2.inverse() * off)};
  }

  /// Cramer-Rao bound of one coordinate of the CoM [px], mean of both, every pixel of the picture
  /// used: pose on the floor, brightness of floor, face and wall, where the lamp is and how much
  /// light comes from everywhere, and the blur are unknown, the radius known to kRadiusSd_px, as to
  /// the fit. The transfer curve and that surfaces are plain and matt are known.
  [[nodiscard]] double bound_px() const {
    constexpr double kStep_px = 0.25, kRadiusSd_px = 0.1;
    std::vector<cv::Mat> slopes = pose_slopes(kStep_px);
    const std::size_t radius = slopes.size();
    for (cv::Mat& slope : look_slopes(kStep_px)) slopes.push_back(std::move(slope));
    const auto n = static_cast<Eigen::Index>(slopes.size());
    Eigen::MatrixXd information(n, n);
    for (Eigen::Index i = 0; i < n; ++i)
      for (Eigen::Index j = 0; j < n; ++j)
        information(i, j) =
            slopes[static_cast<std::size_t>(i)].dot(slopes[static_cast<std::size_t>(j)]) /
            luma_variance();
    const auto at = static_cast<Eigen::Index>(radius);
    information(at, at) += kStep_px * kStep_px / (kRadiusSd_px * kRadiusSd_px);
    // The steps of what a picture may say nothing of, such as a lamp over a floor, are small.
    constexpr double kLeast = 1e-9;
    information.diagonal().array() += kLeast;
    const Eigen::MatrixXd covariance = information.inverse();
    return kStep_px * std::sqrt(0.5 * (covariance(0, 0) + covariance(1, 1)));
  }

 private:
  static constexpr double kRadius_m = 0.03, kThickness_m = 0.004;

  [[nodiscard]] int side() const { return static_cast<int>(2.0 * case_.size_px) + 60; }
  [[nodiscard]] static data::Body disc() {
    data::Body body;
    body.radius_m = kRadius_m;
    body.thickness_m = kThickness_m;
    return body;
  }
  [[nodiscard]] RenderStyle style(std::uint64_t seed) const {
    RenderStyle style;
    style.floor.setConstant(static_cast<float>(case_.floor));
    style.body.setConstant(0.05F);
    style.texture = case_.texture;
    style.gloss = 0.0;
    style.shadow = case_.shadow;
    style.blur_px = case_.blur_px;
    style.noise_levels = case_.noise_levels;
    style.samples = 6;
    style.times = 1;
    style.seed = seed;
    return style;
  }
  /// Change of the luma by a quarter of a pixel in x and y, by turning the rim as far.
  [[nodiscard]] std::vector<cv::Mat> pose_slopes(double step_px) const {
    const double px_m = 2.0 * kRadius_m / case_.size_px, turn = 2.0 * step_px / case_.size_px;
    const auto slope = [&](const std::function<void(data::Pose<>&, double)>& move) {
      std::array<cv::Mat, 2> ends;
      for (const double sign : {-1.0, 1.0}) {
        data::Pose<> moved = pose(0.13, -0.21);
        move(moved, sign);
        moved.centre_m.z() =
            data::height_on_floor_m(moved.theta_rad, kRadius_m, body_.half_thickness_m());
        ends[sign > 0.0 ? 1 : 0] = lens_.levels(moved);
      }
      return cv::Mat(0.5 * (ends[1] - ends[0]));
    };
    return {slope([&](auto& p, double s) { p.centre_m.x() += s * step_px * px_m; }),
            slope([&](auto& p, double s) { p.centre_m.y() += s * step_px * px_m; }),
            slope([&](auto& p, double s) { p.theta_rad += s * turn; }),
            slope([&](auto& p, double s) { p.phi_rad += s * turn; })};
  }
  /// Change of the luma by the radius [step_px], then by small changes of how the scene looks.
  [[nodiscard]] std::vector<cv::Mat> look_slopes(double step_px) const {
    const data::Pose<> still = pose(0.13, -0.21);
    // A mark that covers the face gives it a brightness of its own.
    data::Body faced = body_;
    faced.marks.push_back({.distance_m = 0.0, .size_m = 2.0 * kRadius_m});
    RenderStyle plain = style(seed_);
    plain.mark = plain.body;
    const auto seen = [&](const data::Body& body, const RenderStyle& look) {
      return Lens(body, view_, look).levels(still);
    };
    const cv::Mat usual = seen(faced, plain);
    data::Body larger = faced;
    larger.radius_m += step_px * 2.0 * kRadius_m / case_.size_px;
    std::vector<cv::Mat> slopes{seen(larger, plain) - usual};
    const auto vary = [&](const std::function<void(RenderStyle&)>& change) {
      RenderStyle changed = plain;
      change(changed);
      slopes.push_back(seen(faced, changed) - usual);
    };
    vary([](RenderStyle& s) { s.floor *= 1.02F; });
    vary([](RenderStyle& s) { s.mark *= 1.05F; });
    vary([](RenderStyle& s) { s.body *= 1.05F; });
    vary([](RenderStyle& s) { s.ambient += 0.03; });
    vary([](RenderStyle& s) { s.light.x() += 0.05; });
    vary([](RenderStyle& s) { s.light.y() += 0.05; });
    vary([](RenderStyle& s) { s.blur_px *= 1.05; });
    return slopes;
  }
  /// Three noisy, rounded channels make one rounded luma.
  [[nodiscard]] double luma_variance() const {
    constexpr double kRounding = 1.0 / 12.0,
                     kShares = 0.299 * 0.299 + 0.587 * 0.587 + 0.114 * 0.114;
    return kShares * (case_.noise_levels * case_.noise_levels + kRounding) + kRounding;
  }

  SweepCase case_;
  std::uint64_t seed_;
  data::Body body_;
  Overhead view_;
  data::Camera camera_;
  Lens lens_;
  tracking::OutlineFitter fitter_;
  cv::Mat plate_;
};

struct SweepRow {
  double found = 0.0, bias_px = 0.0, sd_px = 0.0, bound_px = 0.0, normalised = 0.0;
  [[nodiscard]] double efficiency() const { return bound_px / sd_px; }
};

SweepRow measure(const Point& point, const SweepOptions& options) {
  const Studio studio(point.made, options.seed);
  std::mt19937_64 random(options.seed);
  SweepRow row;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero(), squares = Eigen::Vector2d::Zero();
  for (int draw = 0; draw < options.draws; ++draw) {
    const auto error = studio.measure(draw + 1, random);
    if (!error) continue;
    row.found += 1.0;
    sum += error->px;
    squares += error->px.cwiseAbs2();
    row.normalised += error->normalised;
  }
  if (row.found < 3.0) return row;
  const Eigen::Vector2d mean = sum / row.found;
  const Eigen::Vector2d variance = (squares - row.found * mean.cwiseAbs2()) / (row.found - 1.0);
  row.bias_px = mean.norm();
  row.sd_px = std::sqrt(variance.mean());
  row.bound_px = studio.bound_px();
  row.normalised /= row.found;
  return row;
}

void draw(const data::Table& table, const std::vector<Point>& all, const fs::path& path) {
  std::vector<Axes> panels;
  for (const char* factor : {"noise_levels", "blur_px", "size_px", "tilt_deg"}) {
    std::vector<double> x, sd, bound;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all[i].factor != factor) continue;
      const auto row = static_cast<Eigen::Index>(i);
      x.push_back(all[i].value);
      sd.push_back(table.values(row, 4));
      bound.push_back(table.values(row, 5));
    }
    const auto vector = [](const std::vector<double>& v) {
      return Eigen::VectorXd(
          Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size())));
    };
    Axes axes;
    axes.title = axes.x_label = factor;
    axes.y_label = "sd of the centre [px]";
    axes.log_y = true;
    axes.log_x = std::string(factor) != "tilt_deg";
    Series measured, limit;
    measured.label = "measured";
    measured.x = limit.x = vector(x);
    measured.y = vector(sd);
    limit.label = "Cramer-Rao bound";
    limit.y = vector(bound);
    limit.dashed = true;
    axes.series = {measured, limit};
    panels.push_back(std::move(axes));
  }
  write_plot(panels, path);
}

void run(const SweepOptions& options) {
  check_outputs({options.output, options.plot}, {});
  if (!options.plot.empty()) check_plot_name(options.plot);
  const std::vector<Point> all = points();
  data::Table table;
  table.header = {{"trochoid study tracking-sweep", ""},
                  {"made by", "trochoid " TROCHOID_VERSION},
                  {"draws", fmt::format("{} per row, seed {}", options.draws, options.seed)},
                  {"base", "disc of 60 px, tilt 45 deg, noise 2 levels, blur 0.6 px, floor 0.35"}};
  std::string names;
  for (const Point& p : all)
    names += fmt::format("{}{}={:g}", names.empty() ? "" : " ", p.factor, p.value);
  table.header.emplace_back("rows", names);
  table.columns = {"row",   "value",    "found",      "bias_px",
                   "sd_px", "bound_px", "efficiency", "normalised"};
  table.values.resize(static_cast<Eigen::Index>(all.size()), 8);
  fmt::print("{:<14} {:>7} {:>6} {:>8} {:>8} {:>9} {:>10} {:>10}\n", "factor", "value", "found",
             "bias_px", "sd_px", "bound_px", "efficiency", "normalised");
  Progress progress("sweep", "points");
  for (std::size_t i = 0; i < all.size(); ++i) {
    const SweepRow row = measure(all[i], options);
    table.values.row(static_cast<Eigen::Index>(i)) << static_cast<double>(i), all[i].value,
        row.found, row.bias_px, row.sd_px, row.bound_px, row.efficiency(), row.normalised;
    fmt::print("{:<14} {:>7g} {:>3.0f}/{:<2} {:>8.4f} {:>8.4f} {:>9.4f} {:>10.2f} {:>10.2f}\n",
               all[i].factor, all[i].value, row.found, options.draws, row.bias_px, row.sd_px,
               row.bound_px, row.efficiency(), row.normalised);
    progress.update(static_cast<std::int64_t>(i + 1), static_cast<std::int64_t>(all.size()));
  }
  data::write_table(table, options.output);
  if (!options.plot.empty()) draw(table, all, options.plot);
}

}  // namespace

void add_study_tracking_sweep(CLI::App& study) {
  auto options = std::make_shared<SweepOptions>();
  CLI::App* command = study.add_subcommand(
      "tracking-sweep",
      "Error of the measured centre against noise, blur, contrast, size and tilt, beside the "
      "Cramer-Rao bound");
  command->add_option("--draws", options->draws, "Pictures per row of the table [16]")
      ->check(whole_number_within(3, 10000));
  command->add_option("--seed", options->seed, "Seed of pictures and starts [1]")->check(seed());
  command->add_option("-o,--output", options->output, "Table to write (CSV) [tracking_sweep.csv]");
  command->add_option("--plot", options->plot, "Plot to write (.svg, .png)");
  command->footer("Example: trochoid study tracking-sweep");
  command->callback([options] { run(*options); });
}

}  // namespace trochoid::tools
