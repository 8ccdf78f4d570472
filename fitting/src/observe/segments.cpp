#include "observe/segments.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "observe/angles.hpp"
#include "observe/smoothing.hpp"

namespace trochoid::fitting {
namespace {

constexpr int kShortest = 8;  // samples of a piece; a cubic in the plane takes four

// Positions with their times and where they came from.
struct Path {
  std::vector<double> t_s;
  Eigen::MatrixX2d xy;
  std::vector<int> sample;
  double sigma_m = 0.0;
  [[nodiscard]] int size() const { return static_cast<int>(t_s.size()); }
};

Path path_of(const data::Track& track, SampleRange range) {
  Path path;
  std::vector<double> sigmas;
  for (int i = range.first; i < range.second; ++i) {
    const data::TrackSample& sample = track.samples[i];
    if (!sample.has_metres()) continue;
    path.t_s.push_back(sample.t_s);
    path.sample.push_back(i);
    if (sample.has_covariance()) sigmas.push_back(std::sqrt(0.5 * sample.covariance_m2.trace()));
  }
  path.xy.resize(path.size(), 2);
  for (int i = 0; i < path.size(); ++i)
    path.xy.row(i) = track.samples[path.sample[i]].centre_m.transpose();
  if (path.size() >= 3)
    path.sigma_m =
        std::max(noise_about_smooth_curve(path.t_s, path.xy), median_or_zero(std::move(sigmas)));
  return path;
}

// Normal equations of a polynomial of degree Degree in (t - t0)/scale, grown sample by sample.
template <int Degree>
class Polynomial {
  using Square = Eigen::Matrix<double, Degree + 1, Degree + 1>;
  using Column = Eigen::Matrix<double, Degree + 1, 1>;

 public:
  Polynomial(double t0, double scale) : t0_(t0), scale_(scale) {}
  void add(double t, const Eigen::RowVector2d& xy) {
    const double u = (t - t0_) / scale_;
    Column basis;
    basis[0] = 1.0;
    for (int k = 1; k <= Degree; ++k) basis[k] = basis[k - 1] * u;
    normal_.noalias() += basis * basis.transpose();
    right_.noalias() += basis * xy;
    squares_ += xy.squaredNorm();
  }
  void solve() {
    // Powers of a short piece's small times differ by decades; columns of unit length do not.
    inverse_size_ = normal_.diagonal().cwiseSqrt().cwiseMax(1e-150).cwiseInverse();
    cholesky_.compute(inverse_size_.asDiagonal() * normal_ * inverse_size_.asDiagonal());
    coefficients_ =
        inverse_size_.asDiagonal() * cholesky_.solve(inverse_size_.asDiagonal() * right_);
  }
  [[nodiscard]] Eigen::RowVector2d value(double t) const {
    Eigen::RowVector2d sum = coefficients_.row(Degree);
    for (int k = Degree - 1; k >= 0; --k) sum = sum * ((t - t0_) / scale_) + coefficients_.row(k);
    return sum;
  }
  [[nodiscard]] double residual() const {
    return std::max(0.0, squares_ - coefficients_.cwiseProduct(right_).sum());
  }
  [[nodiscard]] Eigen::RowVector2d derivative(int k) const {
    return coefficients_.row(k) * (k == 2 ? 2.0 : 1.0) / std::pow(scale_, k);
  }
  [[nodiscard]] double sigma_of_derivative(int k) const {
    const Column unit = Column::Unit(k);
    return inverse_size_[k] * std::sqrt(unit.dot(cholesky_.solve(unit))) * (k == 2 ? 2.0 : 1.0) /
           std::pow(scale_, k);
  }

 private:
  Column inverse_size_;
  double t0_, scale_, squares_ = 0.0;
  Square normal_ = Square::Zero();
  Eigen::Matrix<double, Degree + 1, 2> right_ = Eigen::Matrix<double, Degree + 1, 2>::Zero();
  Eigen::Matrix<double, Degree + 1, 2> coefficients_;
  Eigen::LDLT<Square> cholesky_;
};

constexpr int kBeside = 4;  // samples on either side that a glitch is judged by

// How far a sample lies from the parabola of its neighbours, over what this leaves of them at most
// or their noise. One of the neighbours may be passed over.
double standing_out(const Path& path, int at, int passed_over) {
  const int first = std::max(0, at - kBeside), last = std::min(path.size(), at + kBeside + 1);
  Polynomial<2> parabola(path.t_s[at], path.t_s[last - 1] - path.t_s[first]);
  const Eigen::RowVector2d origin = path.xy.row(at);
  const auto counts = [&](int i) { return i != at && i != passed_over; };
  for (int i = first; i < last; ++i)
    if (counts(i)) parabola.add(path.t_s[i], path.xy.row(i) - origin);
  parabola.solve();
  double most_m = path.sigma_m;
  for (int i = first; i < last; ++i)
    if (counts(i))
      most_m = std::max(most_m, (path.xy.row(i) - origin - parabola.value(path.t_s[i])).norm());
  return parabola.value(path.t_s[at]).norm() / most_m;
}

// A tracker's slip, of one sample or two near each other; where the body was struck its neighbours
// are on no parabola.
bool is_glitch(const Path& path, int at) {
  constexpr int kOnEitherSide = 2;
  // Nearer ones are not worth a cut (cheapest_cuts); a kink's own corner comes to 5.
  constexpr double kFar = 10.0;
  if (at < kOnEitherSide || at + kOnEitherSide >= path.size()) return false;
  for (int other = at - kBeside; other <= at + kBeside; ++other)  // at itself: none passed over
    if (standing_out(path, at, other) > kFar) return true;
  return false;
}

// Beside a glitch a cut would pay.
Path without_glitches(const Path& path) {
  std::vector<int> kept;
  Path clean;
  for (int i = 0; i < path.size(); ++i) {
    if (is_glitch(path, i)) continue;
    kept.push_back(i);
    clean.t_s.push_back(path.t_s[i]);
    clean.sample.push_back(path.sample[i]);
  }
  clean.xy = path.xy(kept, Eigen::all);
  clean.sigma_m = path.sigma_m;
  return clean;
}

// Cuts 0 = c0 < c1 < ... = n of the cheapest division into pieces, at every stride-th sample.
std::vector<int> cheapest_cuts(const Path& path, int stride) {
  const int n = path.size();
  // Three times what BIC asks for a piece's nine numbers: a tracker's errors hang together.
  const double price = 3.0 * 9.0 * std::log(static_cast<double>(n));
  const double unit = 1.0 / (path.sigma_m * path.sigma_m);
  std::vector<double> best(n + 1, std::numeric_limits<double>::infinity());
  std::vector<int> from(n + 1, 0);
  best[0] = 0.0;
  for (int first = 0; first + kShortest <= n; ++first) {
    if (!std::isfinite(best[first])) continue;
    const Eigen::RowVector2d origin = path.xy.row(first);
    Polynomial<3> cubic(path.t_s[first], std::max(path.t_s[n - 1] - path.t_s[first], 1e-9));
    for (int i = first; i < n; ++i) {
      cubic.add(path.t_s[i], path.xy.row(i) - origin);
      const int last = i + 1;
      if (last - first < kShortest || (last % stride != 0 && last != n)) continue;
      if (last != n && n - last < kShortest) continue;
      cubic.solve();
      const double cost = best[first] + price + unit * cubic.residual();
      if (cost < best[last]) {
        best[last] = cost;
        from[last] = first;
      }
    }
  }
  std::vector<int> cuts;
  for (int at = n; at > 0; at = from[at]) cuts.push_back(at);
  cuts.push_back(0);
  std::reverse(cuts.begin(), cuts.end());
  return cuts;
}

template <int Degree>
double residual_of(const Path& path, int first, int last) {
  Polynomial<Degree> one(path.t_s[first], std::max(path.t_s[last - 1] - path.t_s[first], 1e-9));
  for (int i = first; i < last; ++i) one.add(path.t_s[i], path.xy.row(i) - path.xy.row(first));
  one.solve();
  return one.residual();
}

// Friction that changes with the spin bends a path more than a cubic does, but nowhere suddenly:
// where one polynomial of nearly as many numbers explains both pieces beside a cut as well, there
// was no impact. A kink it cannot follow.
void join_smooth(const Path& path, std::vector<int>& cuts) {
  constexpr int kDegree = 6;
  const double unit = 1.0 / (path.sigma_m * path.sigma_m);
  const double price = std::log(static_cast<double>(path.size()));
  for (std::size_t c = 1; c + 1 < cuts.size();) {
    const int first = cuts[c - 1], last = cuts[c + 1];
    const double apart =
        unit * (residual_of<3>(path, first, cuts[c]) + residual_of<3>(path, cuts[c], last));
    // By BIC the three numbers it lacks beside two cubics and a cut would be worth three times as
    // much; a tracker's errors hang together, and a weak impact must not drown in them.
    if (unit * residual_of<kDegree>(path, first, last) < apart + price)
      cuts.erase(cuts.begin() + static_cast<std::ptrdiff_t>(c));
    else
      ++c;
  }
}

// Moves each cut by up to a stride to where the two neighbouring pieces fit best.
void refine(const Path& path, std::vector<int>& cuts, int stride) {
  for (std::size_t c = 1; c + 1 < cuts.size(); ++c) {
    const int low = std::max(cuts[c - 1] + kShortest, cuts[c] - stride);
    const int high = std::min(cuts[c + 1] - kShortest, cuts[c] + stride);
    double least = std::numeric_limits<double>::infinity();
    int best = cuts[c];
    for (int at = low; at <= high; ++at) {
      const double total =
          residual_of<3>(path, cuts[c - 1], at) + residual_of<3>(path, at, cuts[c + 1]);
      if (total < least) least = total, best = at;
    }
    cuts[c] = best;
  }
}

// Moving, and not speeding up.
bool slides_freely(const Path& path, int first, int last) {
  constexpr double kFarEnough = 15.0;  // sigma; below, the piece says nothing about friction
  constexpr double kSure = 6.0;        // sigma of the acceleration, correlated errors included
  const Eigen::RowVector2d way = path.xy.row(last - 1) - path.xy.row(first);
  if (way.norm() < kFarEnough * path.sigma_m) return false;
  Polynomial<2> parabola(path.t_s[first], path.t_s[last - 1] - path.t_s[first]);
  for (int i = first; i < last; ++i) parabola.add(path.t_s[i], path.xy.row(i) - path.xy.row(first));
  parabola.solve();
  const double along = parabola.derivative(2).dot(way.normalized());
  const double sigma = path.sigma_m * parabola.sigma_of_derivative(2);
  return along < kSure * sigma;
}

}  // namespace

std::vector<SampleRange> sliding_ranges(const data::Track& track, SampleRange range) {
  const Path path = without_glitches(path_of(track, range));
  std::vector<SampleRange> ranges;
  if (path.size() < kShortest) return ranges;
  constexpr int kMostCandidates = 400;
  const int stride = std::max(1, path.size() / kMostCandidates);
  std::vector<int> cuts = cheapest_cuts(path, stride);
  if (stride > 1) refine(path, cuts, stride);
  join_smooth(path, cuts);
  for (std::size_t c = 0; c + 1 < cuts.size(); ++c) {
    const int first = cuts[c] + (c > 0 ? 1 : 0);
    const int last = cuts[c + 1] - (c + 2 < cuts.size() ? 1 : 0);
    if (last - first < kShortest - 2 || !slides_freely(path, first, last)) continue;
    ranges.emplace_back(path.sample[first], path.sample[last - 1] + 1);
  }
  return ranges;
}

int released_at(const data::Track& track, SampleRange range) {
  constexpr int kHalfWidth = 4;  // samples a speed is taken from
  constexpr std::size_t kHeld = 5;
  constexpr double kStill = 0.05, kFast = 0.5;  // of the greatest speed
  // A hand lets go, or pushes, soon; a pendulum let go takes ten times as long to get fast as it
  // was still.
  constexpr double kSuddenly = 3.0;
  std::vector<double> t_s, psi;
  std::vector<int> sample;
  for (int i = range.first; i < range.second; ++i) {
    const data::TrackSample& one = track.samples[i];
    if (!one.psi) continue;
    psi.push_back(one.psi->value_rad);
    t_s.push_back(one.t_s);
    sample.push_back(i);
  }
  if (psi.size() < 4 * kHeld) return range.first;
  psi = continued_along_rate(t_s, psi);
  const Eigen::Map<const Eigen::VectorXd> angle(psi.data(), static_cast<Eigen::Index>(psi.size()));
  const Eigen::VectorXd speed = smooth(t_s, angle, kHalfWidth).first.col(0).cwiseAbs();
  const double greatest = speed.maxCoeff();
  std::size_t i = 0;
  while (i < sample.size() && speed[i] < kStill * greatest) ++i;
  if (i < kHeld) return range.first;
  const double still_s = t_s[i] - t_s[0];
  while (i < sample.size() && speed[i] < kFast * greatest) ++i;
  if (t_s[i] - t_s[0] > (1.0 + kSuddenly) * still_s) return range.first;
  while (i + 1 < sample.size() &&
         speed[i] <
             speed.segment(i + 1, std::min<Eigen::Index>(2 * kHalfWidth, speed.size() - i - 1))
                 .maxCoeff())
    ++i;
  return sample[std::min(i + kHalfWidth, sample.size() - 1)];
}

}  // namespace trochoid::fitting
