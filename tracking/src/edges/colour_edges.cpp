#include "edges/colour_edges.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "edges/normal_table.hpp"
#include "geometry/contour.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tracking {
namespace {

using Edge = data::OutlinePoint::Edge;

// A level by the direction of the outline's normal.
constexpr int kHarmonics = 5;
using Harmonics = Eigen::Matrix<double, kHarmonics, 1>;

Harmonics harmonics_of(const Eigen::Vector2d& normal) {
  const double c = normal.x(), s = normal.y();
  return {1.0, c, s, c * c - s * s, 2.0 * c * s};
}

// The borders of the silhouette at one moment.
struct MomentOutline {
  // @param blur2_px2 of a border at rest, @param smear the body's motion from end to end of the
  // exposure, or empty, @param part of it that the moment stands for.
  MomentOutline(const std::vector<OutlineSample>& outline, double blur2_px2,
                const data::PoseMotion::Step& smear, double part)
      : borders{Contour(outline, Contour::Of::rim), Contour(outline, Contour::Of::bore)},
        faces{Contour(outline, Contour::Of::near_rim), Contour(outline, Contour::Of::near_bore)} {
    for (std::size_t which = 0; which < borders.size(); ++which)
      for (std::size_t k = 0; k < borders[which].size(); ++k) {
        const OutlineSample& sample = borders[which][k];
        const double swept_px = smear.size() > 0 ? sample.motion.dot(smear) * part : 0.0;
        samples[which].push_back({1.0 / std::sqrt(blur2_px2 + swept_px * swept_px / 12.0),
                                  sample.edge != Edge::upper_rim &&
                                      sample.edge != Edge::upper_bore && !faces[which].empty(),
                                  sample.motion});
      }
  }
  struct Sample {
    double per_blur;  // 1 / px
    bool shows_wall;
    OutlineSample::Motion motion;
  };
  std::array<Contour, 2> borders;
  std::array<Contour, 2> faces;                // those of the near face beside them
  std::array<std::vector<Sample>, 2> samples;  // of the borders
};

// Pixels of the colour planes are means of coded pixels of luma, two wide, and coders blur them as
// much again (x264 at quality 11 to 23, by how steep edges are): so many equal parts, towards the
// inside and the outside of a border.
constexpr std::array<double, 4> kTapsPx{-1.5, -0.5, 0.5, 1.5};
using Taps = Eigen::Array<double, kTapsPx.size(), 1>;

// How much of each part of a pixel the body covers, and by how much more if the border were 1 px
// farther out or a parameter of the motion larger by one.
struct Cover {
  Taps covered = Taps::Zero(), density = Taps::Zero();
  Taps wall = Taps::Zero();  // of what is covered
  Eigen::Array<double, kTapsPx.size(), data::PoseMotion::kMost> change =
      Eigen::Array<double, kTapsPx.size(), data::PoseMotion::kMost>::Zero();
};

// A pixel of the colour planes near one border.
struct Pixel {
  double value = 0.0;                   // colour, from what has none
  double covered = 0.0, density = 0.0;  // as a share of the body's colour
  double wall = 0.0;                    // likewise, of its wall
  data::PoseMotion::Step change{};

  // So far from the border that it shows a level.
  [[nodiscard]] bool is_clear() const {
    constexpr double kShare = 0.02;
    return covered < kShare || covered > 1.0 - kShare;
  }
  [[nodiscard]] EdgeSide side() const { return covered > 0.5 ? kInside : kOutside; }
};

// What the levels are found by: of a pixel that is clear of the border.
struct ClearPixel {
  double value, covered, wall;
};

// The same before it is known how body and surroundings mix.
struct RawPixel {
  double value, luma;
  std::size_t stretch;
  Cover cover;
};

// Pixels about one sample of a border.
struct ColourStretch {
  std::size_t sample;
  Harmonics harmonics;
  std::size_t first = 0, end = 0;                         // its pixels
  std::array<std::size_t, 2> first_clear{}, end_clear{};  // those of either side that are clear
  double shade = 1.0;  // luma of the surroundings here over that of all around
  const ColourMixing* mixing = nullptr;
  std::array<double, 2> levels{};   // by those of the whole outline
  double wall = 0.0;                // by how much its wall differs from the face
  std::array<double, 2> uneven2{};  // variance about these
};

class ColourFit {
 public:
  ColourFit(const ColourWindow& colour, const ExposedOutline& outline, double blur_px, int every);
  [[nodiscard]] std::vector<ColourEdge> edges(double reach_px);

 private:
  // Where a pixel is about the middle outline.
  struct Nearest {
    std::size_t border;
    Contour::Place place;
  };

  void collect(const ColourWindow& colour, double blur_px, int every, std::vector<RawPixel>& raw);
  [[nodiscard]] std::optional<Nearest> nearest(const Eigen::Vector2d& at_px, double far_px) const;
  [[nodiscard]] Cover cover_at(const Eigen::Vector2d& at_px, const Nearest& nearest) const;
  void add_moment(const MomentOutline& moment, const Eigen::Vector2d& at_px, const Nearest& nearest,
                  Cover& cover) const;
  void find_shades(const std::vector<RawPixel>& raw, double ground_luma);
  [[nodiscard]] double longest_sweep_px() const;

  template <class Use>
  void over_neighbours(std::size_t reach, const Use& use);
  void mix(const ColourWindow& colour, const std::vector<RawPixel>& raw);

  void gather_clear();
  template <class AnyPixel>
  [[nodiscard]] static double off_level(const ColourStretch& stretch, const AnyPixel& pixel);
  void fit_levels(EdgeSide side);
  bool find_noise(EdgeSide side);
  bool find_levels();
  void find_unevenness();
  [[nodiscard]] std::optional<ColourEdge> edge_of(const ColourStretch& stretch) const;

  const std::vector<OutlineSample>& outline_;
  const data::PoseMotion::Step& smear_;
  double part_;  // of the exposure, that a moment stands for
  double blur2_px2_;
  MomentOutline middle_;
  std::vector<MomentOutline> moments_;
  double body_;  // colour of the body, about
  std::vector<ColourStretch> stretches_;
  std::vector<Pixel> pixels_;                     // stretch by stretch
  std::array<std::vector<ClearPixel>, 2> clear_;  // likewise, of either side
  std::array<double, 2> noise_{};                 // sd of a pixel
};

ColourFit::ColourFit(const ColourWindow& colour, const ExposedOutline& outline, double blur_px,
                     int every)
    : outline_(outline.middle),
      smear_(outline.smear),
      part_(1.0 / std::max<double>(1.0, static_cast<double>(outline.moments.size()))),
      blur2_px2_(blur_px * blur_px),
      middle_(outline.middle, blur2_px2_, smear_, part_),
      body_(colour.body) {
  moments_.reserve(outline.moments.size());
  for (const auto& moment : outline.moments)
    moments_.emplace_back(moment, blur2_px2_, smear_, part_);
  // A quarter of a megabyte: kept, not had and given back with every look at a picture.
  thread_local std::vector<RawPixel> raw;
  collect(colour, blur_px, every, raw);
  find_shades(raw, colour.ground_luma);
  mix(colour, raw);
}

double ColourFit::longest_sweep_px() const {
  double longest = 0.0;
  if (moments_.empty()) return longest;
  for (const OutlineSample& sample : outline_)
    longest = std::max(longest, std::abs(sample.motion.dot(smear_)));
  return longest;
}

void ColourFit::collect(const ColourWindow& colour, double blur_px, int every,
                        std::vector<RawPixel>& raw) {
  // What turns fast shows no level near its ends: farther in and out it does.
  constexpr double kPerSweep = 0.3;
  const double sweep_px = longest_sweep_px();
  const double level_px = 2.5 + 5.0 * blur_px + kPerSweep * sweep_px;
  for (const Contour& border : middle_.borders)
    for (std::size_t k = 0; k < border.size(); ++k)
      stretches_.push_back({border.sample_of(k), harmonics_of(border[k].normal_px)});
  raw.clear();
  for (int y = 0; y < colour.planes.rows; y += every)
    for (int x = 0; x < colour.planes.cols; ++x) {
      const Eigen::Vector2d at_px = colour.place_of(x, y);
      const auto at = nearest(at_px, level_px + 0.5 * sweep_px);
      if (!at) continue;
      const Cover cover = cover_at(at_px, *at);
      constexpr double kNoEdge = 0.02;
      if (std::abs(at->place.off_px) > level_px && cover.density.sum() < kNoEdge) continue;
      const std::size_t first = at->border == 0 ? 0 : middle_.borders[0].size();
      raw.push_back({static_cast<double>(colour.planes.at<float>(y, x)) - colour.neutral,
                     static_cast<double>(colour.luma.at<float>(y, x)), first + at->place.at,
                     cover});
    }
}

std::optional<ColourFit::Nearest> ColourFit::nearest(const Eigen::Vector2d& at_px,
                                                     double far_px) const {
  constexpr double kAsidePx = 2.0;  // farther, there is a gap in the border
  std::optional<Nearest> best;
  for (std::size_t k = 0; k < middle_.borders.size(); ++k) {
    const Contour& border = middle_.borders[k];
    if (border.empty() || !border.may_be_within(far_px, at_px)) continue;
    const Contour::Place place = border.nearest(at_px);
    if (!best || std::abs(place.off_px) < std::abs(best->place.off_px)) best = Nearest{k, place};
  }
  if (best && (std::abs(best->place.off_px) > far_px || best->place.aside_px > kAsidePx))
    return std::nullopt;
  return best;
}

Cover ColourFit::cover_at(const Eigen::Vector2d& at_px, const Nearest& nearest) const {
  Cover cover;
  if (moments_.empty()) add_moment(middle_, at_px, nearest, cover);
  for (const MomentOutline& moment : moments_) add_moment(moment, at_px, nearest, cover);
  return cover;
}

// Adds what one part of the exposure says. A border that is not there then hides nothing.
void ColourFit::add_moment(const MomentOutline& moment, const Eigen::Vector2d& at_px,
                           const Nearest& nearest, Cover& cover) const {
  const NormalTable& table = NormalTable::instance();
  const Contour& own = moment.borders[nearest.border];
  const Contour& other = moment.borders[1 - nearest.border];
  const auto outside = [&](double off_px, double per_blur) {
    return table.at(static_cast<float>(off_px * per_blur));
  };
  double part = part_;
  if (!other.empty())
    part *= 1.0 - static_cast<double>(
                      outside(other.nearest(at_px).off_px, 1.0 / std::sqrt(blur2_px2_)).share);
  if (own.empty()) {
    cover.covered += part;
    return;
  }
  const Contour::Place place = &moment == &middle_ ? nearest.place : own.nearest(at_px);
  const MomentOutline::Sample& sample = moment.samples[nearest.border][place.at];
  const double face_px =
      sample.shows_wall ? moment.faces[nearest.border].nearest(at_px).off_px : 0.0;
  Taps density;
  for (std::size_t k = 0; k < kTapsPx.size(); ++k) {
    const auto tap = static_cast<Eigen::Index>(k);
    const NormalTable::Step step = outside(place.off_px + kTapsPx[k], sample.per_blur);
    const double covered = 1.0 - static_cast<double>(step.share);
    density[tap] = part * sample.per_blur * static_cast<double>(step.density);
    cover.covered[tap] += part * covered;
    if (!sample.shows_wall) continue;
    const double of_face =
        1.0 - static_cast<double>(outside(face_px + kTapsPx[k], sample.per_blur).share);
    cover.wall[tap] += part * std::max(0.0, covered - of_face);
  }
  cover.density += density;
  for (Eigen::Index i = 0; i < sample.motion.size(); ++i)
    cover.change.col(i) += density * sample.motion[i];
}

// From what the surroundings of a stretch and its neighbours look like.
void ColourFit::find_shades(const std::vector<RawPixel>& raw, double ground_luma) {
  constexpr double kUncovered = 0.02, kDarkest = 0.2, kBrightest = 2.0;
  constexpr std::size_t kReach = 2;
  std::vector<double> sums(stretches_.size(), 0.0), counts(stretches_.size(), 0.0);
  for (const RawPixel& pixel : raw) {
    if (pixel.cover.covered.maxCoeff() > kUncovered) continue;
    sums[pixel.stretch] += pixel.luma;
    counts[pixel.stretch] += 1.0;
  }
  over_neighbours(kReach, [&](std::size_t k, const std::vector<std::size_t>& near) {
    double sum = 0.0, count = 0.0;
    for (const std::size_t j : near) sum += sums[j], count += counts[j];
    if (count > 0.0)
      stretches_[k].shade =
          std::clamp(sum / (count * std::max(1.0, ground_luma)), kDarkest, kBrightest);
  });
}

// Calls `use` with each stretch and those within reach of it along its border.
template <class Use>
void ColourFit::over_neighbours(std::size_t reach, const Use& use) {
  std::vector<std::size_t> near;
  std::size_t first = 0;
  for (const Contour& border : middle_.borders) {
    const std::size_t n = border.size();
    for (std::size_t k = 0; k < n; ++k) {
      near.clear();
      for (std::size_t j = 0; j < std::min(n, 2 * reach + 1); ++j)
        near.push_back(first + (k + n + j - std::min(n, reach)) % n);
      use(first + k, near);
    }
    first += n;
  }
}

// From what is covered to what is shown, and from the rows of the picture to stretches.
void ColourFit::mix(const ColourWindow& colour, const std::vector<RawPixel>& raw) {
  for (const RawPixel& pixel : raw) ++stretches_[pixel.stretch].end;
  std::size_t first = 0;
  for (ColourStretch& stretch : stretches_) {
    first += stretch.end;
    stretch.first = stretch.end = first - stretch.end;
    stretch.mixing = &colour.mixing_in(stretch.shade);
  }
  pixels_.resize(raw.size());
  const Eigen::Index parameters = outline_.front().motion.size();
  for (const RawPixel& from : raw) {
    ColourStretch& stretch = stretches_[from.stretch];
    Pixel& pixel = pixels_[stretch.end++];
    pixel.value = from.value;
    pixel.change = data::PoseMotion::Step::Zero(parameters);
    for (Eigen::Index k = 0; k < from.cover.covered.size(); ++k) {
      const double covered = from.cover.covered[k];
      const double slope = stretch.mixing->slope(covered) / kTapsPx.size();
      const double shown = stretch.mixing->shown(covered) / kTapsPx.size();
      pixel.covered += shown;
      if (from.cover.wall[k] > 0.0) pixel.wall += shown * from.cover.wall[k] / covered;
      pixel.density += slope * from.cover.density[k];
      for (Eigen::Index i = 0; i < parameters; ++i)
        pixel.change[i] += slope * from.cover.change(k, i);
    }
  }
}

// They are gone over a dozen times.
void ColourFit::gather_clear() {
  for (ColourStretch& stretch : stretches_) {
    for (const EdgeSide side : {kInside, kOutside}) stretch.first_clear[side] = clear_[side].size();
    for (std::size_t i = stretch.first; i < stretch.end; ++i)
      if (const Pixel& pixel = pixels_[i]; pixel.is_clear())
        clear_[pixel.side()].push_back({pixel.value, pixel.covered, pixel.wall});
    for (const EdgeSide side : {kInside, kOutside}) stretch.end_clear[side] = clear_[side].size();
  }
}

template <class AnyPixel>
double ColourFit::off_level(const ColourStretch& stretch, const AnyPixel& pixel) {
  return pixel.value - pixel.covered * stretch.levels[kInside] - pixel.wall * stretch.wall -
         (1.0 - pixel.covered) * stretch.levels[kOutside];
}

// Robustly and beside the border only: on it, where that lies is asked.
void ColourFit::fit_levels(EdgeSide side) {
  constexpr double kTukey = 4.685;
  constexpr double kWallShare = 0.1;  // of the colour, by which the wall may differ here and there
  constexpr int kWall = kHarmonics, kWallHarmonics = 3, kUnknowns = kHarmonics + kWallHarmonics;
  using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
  Eigen::Matrix<double, kUnknowns, kUnknowns> normal =
      1e-6 * Eigen::Matrix<double, kUnknowns, kUnknowns>::Identity();
  for (int k = kWall; k < kUnknowns; ++k) normal(k, k) = 1.0 / std::pow(kWallShare * body_, 2);
  Unknowns right = Unknowns::Zero();
  for (const ColourStretch& stretch : stretches_) {
    // Sums over them, and with the share of the wall.
    double once = 0.0, with_wall = 0.0, with_walls = 0.0, value = 0.0, value_with_wall = 0.0;
    for (std::size_t i = stretch.first_clear[side]; i < stretch.end_clear[side]; ++i) {
      const ClearPixel& pixel = clear_[side][i];
      const double t = off_level(stretch, pixel) / (kTukey * noise_[side]);
      if (std::abs(t) >= 1.0) continue;
      const double weight = std::pow((1.0 - t * t) / noise_[side], 2);
      once += weight, value += weight * pixel.value;
      if (side == kOutside) continue;
      with_wall += weight * pixel.wall, with_walls += weight * pixel.wall * pixel.wall;
      value_with_wall += weight * pixel.value * pixel.wall;
    }
    if (once == 0.0) continue;
    const Harmonics own = (side == kOutside ? stretch.shade : 1.0) * stretch.harmonics;
    if (with_wall != 0.0) {
      // Of what a pixel shows of the face, and of its wall.
      Eigen::Matrix<double, kUnknowns, 2> columns = Eigen::Matrix<double, kUnknowns, 2>::Zero();
      columns.col(0).head<kHarmonics>() = own;
      columns.col(1).tail<kWallHarmonics>() = stretch.harmonics.head<kWallHarmonics>();
      const Eigen::Matrix2d weights{{once, with_wall}, {with_wall, with_walls}};
      normal.noalias() += columns * weights * columns.transpose();
      right += columns * Eigen::Vector2d(value, value_with_wall);
    } else {  // no wall is seen there
      normal.topLeftCorner<kHarmonics, kHarmonics>().noalias() += (once * own) * own.transpose();
      right.head<kHarmonics>() += value * own;
    }
  }
  const Unknowns found = normal.ldlt().solve(right);
  for (ColourStretch& stretch : stretches_) {
    stretch.levels[side] =
        (side == kOutside ? stretch.shade : 1.0) * stretch.harmonics.dot(found.head<kHarmonics>());
    if (side == kInside)
      stretch.wall = stretch.harmonics.head<kWallHarmonics>().dot(found.tail<kWallHarmonics>());
  }
}

// False if hardly any pixel shows the level.
bool ColourFit::find_noise(EdgeSide side) {
  constexpr std::size_t kFewest = 2 * kHarmonics;
  constexpr double kLeastNoise = 0.3;
  std::vector<double> off;
  off.reserve(clear_[side].size());
  for (const ColourStretch& stretch : stretches_)
    for (std::size_t i = stretch.first_clear[side]; i < stretch.end_clear[side]; ++i)
      off.push_back(std::abs(off_level(stretch, clear_[side][i])));
  if (off.size() < kFewest) return false;
  noise_[side] =
      std::max(kLeastNoise, data::kSdOverMedianDistance * data::upper_median(std::move(off)));
  return std::isfinite(noise_[side]);
}

bool ColourFit::find_levels() {
  constexpr int kRounds = 4;
  constexpr double kNotYetKnown = 1e3;
  noise_.fill(kNotYetKnown);
  for (int round = 0; round < kRounds; ++round)
    for (const EdgeSide side : {kInside, kOutside}) {
      fit_levels(side);
      if (!find_noise(side)) return false;
    }
  return true;
}

// By how much the levels of stretches differ from those of the whole outline beyond the noise of
// their pixels, as neighbours show: beside a shadow they do, elsewhere hardly.
void ColourFit::find_unevenness() {
  constexpr std::size_t kReach = 4;  // to either side
  for (const EdgeSide side : {kInside, kOutside}) {
    std::vector<double> beyond2(stretches_.size(), 0.0), counted(stretches_.size(), 0.0);
    for (std::size_t k = 0; k < stretches_.size(); ++k) {
      double sum = 0.0, count = 0.0;
      for (std::size_t i = stretches_[k].first_clear[side]; i < stretches_[k].end_clear[side]; ++i)
        sum += off_level(stretches_[k], clear_[side][i]), count += 1.0;
      if (count == 0.0) continue;
      beyond2[k] = std::pow(sum / count, 2) - std::pow(noise_[side], 2) / count;
      counted[k] = 1.0;
    }
    over_neighbours(kReach, [&](std::size_t k, const std::vector<std::size_t>& near) {
      double sum = 0.0, count = 0.0;
      for (const std::size_t j : near) sum += beyond2[j], count += counted[j];
      stretches_[k].uneven2[side] = std::max(0.0, sum) / std::max(1.0, count);
    });
  }
}

// The offset that explains the pixels of a stretch best, with levels that differ from those of the
// whole outline as its neighbours' do; none if nothing there depends on it.
std::optional<ColourEdge> ColourFit::edge_of(const ColourStretch& stretch) const {
  const OutlineSample& sample = outline_[stretch.sample];
  const double inner = stretch.levels[kInside], outer = stretch.levels[kOutside];
  // Of the offset and of the levels inside and outside.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double sum = 0.0, square = 0.0, left = 0.0;
  data::PoseMotion::Step motion = data::PoseMotion::Step::Zero(sample.motion.size());
  for (std::size_t i = stretch.first; i < stretch.end; ++i) {
    const Pixel& p = pixels_[i];
    const double wall_share = p.covered > 0.0 ? p.wall / p.covered : 0.0;
    const double contrast = inner + wall_share * stretch.wall - outer;
    const double slope = contrast * p.density, off = off_level(stretch, p);
    const double usual2 = p.covered * std::pow(noise_[kInside], 2) +
                          (1.0 - p.covered) * std::pow(noise_[kOutside], 2);
    const double uneven2 =
        p.covered * stretch.uneven2[kInside] + (1.0 - p.covered) * stretch.uneven2[kOutside];
    sum += p.value, square += p.value * p.value, left += off * off;
    // What a border half a pixel off leaves is no outlier, nor what other levels do.
    constexpr double kTukey = 4.685, kOffPx = 0.5;
    const double t2 =
        off * off / (kTukey * kTukey * (usual2 + uneven2 + std::pow(kOffPx * slope, 2)));
    if (t2 >= 1.0) continue;
    const double weight = std::pow(1.0 - t2, 2) / usual2;
    const Eigen::Vector3d row(slope, p.covered, 1.0 - p.covered);
    normal += weight * row * row.transpose();
    right += weight * off * row;
    motion += weight * slope * contrast * p.change;
  }
  const double information = normal(0, 0);
  constexpr double kLeast = 1e-9, kLeastUneven2 = 1e-4;
  if (!(information > kLeast)) return std::nullopt;
  for (const EdgeSide side : {kInside, kOutside})
    normal(1 + side, 1 + side) += 1.0 / std::max(kLeastUneven2, stretch.uneven2[side]);
  const Eigen::Matrix3d covariance = normal.inverse();
  const Eigen::Vector3d found = covariance * right;
  ColourEdge out{
      stretch.sample, motion / information, std::sqrt(blur2_px2_ + kHalfSizeBlur2Px2), {}};
  ProfileEdge& e = out.edge;
  e.offset_px = found[0];
  e.noise_variance_px2 = 1.0 / information;
  e.shading_variance_px2 = std::max(0.0, covariance(0, 0) - 1.0 / information);
  constexpr double kUsualUnevenness = 0.1, kLeastGainNoise2 = 0.1;
  e.unevenness = kUsualUnevenness;
  e.contrast = outer + found[1 + kOutside] - inner - found[1 + kInside];
  e.mean_level = 0.5 * (outer + inner);
  e.lines = std::max(1, static_cast<int>(std::lround(sample.arc_px)));
  const auto count = static_cast<double>(stretch.end - stretch.first);
  const double noise2 = 0.5 * (std::pow(noise_[kInside], 2) + std::pow(noise_[kOutside], 2));
  const double without = std::max(0.0, square - sum * sum / count);
  const double with = std::max(0.0, left - right.dot(found) * noise2);
  e.gain = 0.5 * count / e.lines *
           std::log((without + count * kLeastGainNoise2) / (with + count * kLeastGainNoise2));
  return out;
}

std::vector<ColourEdge> ColourFit::edges(double reach_px) {
  constexpr std::size_t kFewest = 8 * kHarmonics;
  std::vector<ColourEdge> found;
  if (pixels_.size() < kFewest) return found;
  gather_clear();
  if (!find_levels()) return found;
  find_unevenness();
  for (const ColourStretch& stretch : stretches_)
    if (auto edge = edge_of(stretch); edge && std::abs(edge->edge.offset_px) < reach_px)
      found.push_back(std::move(*edge));
  return found;
}

}  // namespace

std::vector<ColourEdge> find_colour_edges(const ColourWindow& colour, const ExposedOutline& outline,
                                          double blur_px, double reach_px, int every) {
  if (outline.middle.empty()) return {};
  return ColourFit(colour, outline, blur_px, every).edges(reach_px);
}

}  // namespace trochoid::tracking
