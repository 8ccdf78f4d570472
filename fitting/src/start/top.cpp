#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "observe/smoothing.hpp"
#include "start/starts.hpp"
#include "trochoid/data/integral.hpp"

namespace trochoid::fitting {
namespace {

struct TopState {
  double a = 0.0, b = 0.0, l = 0.0;
  Eigen::Vector3d k = Eigen::Vector3d::UnitZ();  // axis
  Eigen::Vector3d L = Eigen::Vector3d::Zero();   // angular momentum / I
};

Start start_of(const TopState& top, const Eigen::Vector2d& pivot_m, const char* path) {
  const Eigen::Vector3d k = top.k.normalized();
  const double theta = std::atan2(std::hypot(k.x(), k.y()), k.z());
  const double phi = std::atan2(k.x(), -k.y());
  const double sin2 = std::max(1.0 - k.z() * k.z(), 1e-12);
  Start start{path, {}};
  start.values = {{"a_1_s2", top.a},
                  {"b_1_s", top.b},
                  {"l_m", top.l},
                  {"theta_rad", theta},
                  {"phi_rad", phi},
                  {"dtheta_rad_s", top.L.x() * std::cos(phi) + top.L.y() * std::sin(phi)},
                  {"dphi_rad_s", (top.L.z() - top.b * k.z()) / sin2},
                  {"pivot_x_m", pivot_m.x()},
                  {"pivot_y_m", pivot_m.y()}};
  return start;
}

// Everything about the window that does not depend on l.
struct Window {
  std::vector<double> t_s;
  Eigen::VectorXd x, y;  // measured, relative to the pivot
  Eigen::VectorXd r2;    // smoothed squared distance
  Eigen::VectorXd h;     // smoothed x y' - y x'
  Eigen::MatrixXd smooth, velocity;
  Eigen::VectorXd int_x, int_y;
  double r_max = 0.0;
};

Window window_of(const ArcData& arc, const SmoothCurve& curve, const Eigen::Vector2d& pivot_m) {
  Window w;
  w.t_s = arc.t_s;
  Eigen::MatrixXd xy = arc.positions_m();
  xy.rowwise() -= pivot_m.transpose();
  w.x = xy.col(0);
  w.y = xy.col(1);
  w.smooth = curve.value;
  w.smooth.rowwise() -= pivot_m.transpose();
  w.velocity = curve.first;
  w.r2 = w.smooth.rowwise().squaredNorm();
  w.h = w.smooth.col(0).cwiseProduct(w.velocity.col(1)) -
        w.smooth.col(1).cwiseProduct(w.velocity.col(0));
  w.int_x = data::running_integral(w.t_s, w.x);
  w.int_y = data::running_integral(w.t_s, w.y);
  w.r_max = std::sqrt(w.r2.maxCoeff());
  return w;
}

struct Match {
  double cost = 0.0;
  TopState top;
};

// (k_z, a, b) and (-k_z, -a, -b) give the same xy; weight pulls down, so a > 0 is the one.
void make_weight_pull_down(TopState& top) {
  if (top.a >= 0.0) return;
  top.a = -top.a;
  top.b = -top.b;
  top.k.z() = -top.k.z();
  top.L.head<2>() = -top.L.head<2>();
}

// The linear problem for one l and given heights Z above the pivot.
Match match(const Window& w, double l, const Eigen::VectorXd& z) {
  const Eigen::Index n = w.x.size();
  const Eigen::VectorXd int_z = data::running_integral(w.t_s, z);
  const Eigen::VectorXd jx = data::running_integral(w.t_s, z.cwiseProduct(w.int_x));
  const Eigen::VectorXd jy = data::running_integral(w.t_s, z.cwiseProduct(w.int_y));
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Vector6 right = Vector6::Zero();
  double squares = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {  // unknowns X0 Y0 Lz Lx0 Ly0 a/l
    Vector6 rx, ry;
    rx << 1.0, 0.0, -w.int_y[i], 0.0, int_z[i], jx[i];
    ry << 0.0, 1.0, w.int_x[i], -int_z[i], 0.0, jy[i];
    normal.noalias() += rx * rx.transpose() + ry * ry.transpose();
    right.noalias() += rx * w.x[i] + ry * w.y[i];
    squares += w.x[i] * w.x[i] + w.y[i] * w.y[i];
  }
  const Vector6 scale = normal.diagonal().cwiseSqrt().cwiseMax(1e-300);
  normal = scale.cwiseInverse().asDiagonal() * normal * scale.cwiseInverse().asDiagonal();
  const Vector6 scaled_right = right.cwiseQuotient(scale);
  const Vector6 scaled = normal.ldlt().solve(scaled_right);
  const Vector6 p = scaled.cwiseQuotient(scale);
  Match result;
  result.cost = squares - scaled.dot(scaled_right);
  const double z0 =
      std::copysign(std::sqrt(std::max(l * l - p[0] * p[0] - p[1] * p[1], 1e-6 * l * l)), z[0]);
  result.top.l = l;
  result.top.a = p[5] * l;
  result.top.k = Eigen::Vector3d(p[0], p[1], z0) / l;
  result.top.k.normalize();
  result.top.L = {p[3], p[4], p[2]};
  result.top.b = result.top.L.dot(result.top.k);
  make_weight_pull_down(result.top);
  return result;
}

// Local minima of the scan over l, best first.
std::vector<Match> scan(const Window& w, const Eigen::VectorXd& sign) {
  constexpr int kSteps = 48;
  constexpr double kClosest = 2e-4, kFarthest = 12.0;  // (l - r_max)/r_max
  std::vector<Match> all;
  for (int i = 0; i < kSteps; ++i) {
    const double excess =
        kClosest * std::pow(kFarthest / kClosest, static_cast<double>(i) / (kSteps - 1));
    const double l = w.r_max * (1.0 + excess);
    all.push_back(match(w, l, sign.array() * (l * l - w.r2.array()).max(0.0).sqrt()));
  }
  std::vector<Match> minima;
  for (int i = 0; i < kSteps; ++i) {
    const bool low = (i == 0 || all[i].cost <= all[i - 1].cost) &&
                     (i + 1 == kSteps || all[i].cost < all[i + 1].cost);
    if (low && all[i].top.a > 0.0 && all[i].top.L.allFinite()) minima.push_back(all[i]);
  }
  std::sort(minima.begin(), minima.end(),
            [](const Match& p, const Match& q) { return p.cost < q.cost; });
  return minima;
}

// r^2 = l^2 - Z^2 with Z = (c0 - h)/(l b): a parabola in h, which also knows where Z changes sign.
struct Parabola {
  bool valid = false;
  double l = 0.0, b = 0.0, c0 = 0.0;
};

Parabola parabola(const Window& w) {
  const double centre = w.h.mean();
  const double spread = std::sqrt((w.h.array() - centre).square().mean());
  Parabola result;
  if (!(spread > 0.0)) return result;
  Eigen::MatrixXd basis(w.h.size(), 3);
  basis.col(0).setOnes();
  basis.col(1) = (w.h.array() - centre) / spread;
  basis.col(2) = basis.col(1).cwiseAbs2();
  const Eigen::Vector3d c = (basis.transpose() * basis).ldlt().solve(basis.transpose() * w.r2);
  if (!(c[2] < 0.0)) return result;
  const double vertex = -0.5 * c[1] / c[2];
  const double l2 = c[0] - c[2] * vertex * vertex;
  if (!(l2 > 0.0)) return result;
  result.l = std::sqrt(l2);
  result.c0 = centre + spread * vertex;
  const double slope = spread / std::sqrt(-c[2]);  // |l b|
  // The side that is up: Z = (c0 - h)/(l b) is positive most of the time.
  const double mostly = result.c0 - centre;
  result.b = (mostly >= 0.0 ? slope : -slope) / result.l;
  result.valid = true;
  return result;
}

// Signs of Z, the height above the pivot.
Eigen::VectorXd sides(const Window& w, const Parabola& p) {
  return ((p.c0 - w.h.array()) / p.b).unaryExpr([](double z) { return z < 0.0 ? -1.0 : 1.0; });
}

// a from energy: v^2/2 + a l Z = constant, v the speed of the CoM.
std::optional<TopState> from_parabola(const Window& w, const Parabola& p) {
  const Eigen::VectorXd z = (p.c0 - w.h.array()) / (p.l * p.b);
  const Eigen::VectorXd radial = w.smooth.col(0).cwiseProduct(w.velocity.col(0)) +
                                 w.smooth.col(1).cwiseProduct(w.velocity.col(1));
  // Z Z' = -r r'; near Z = 0 that says nothing, so such samples stay out.
  double sz = 0.0, se = 0.0, szz = 0.0, sze = 0.0;
  int n = 0;
  for (Eigen::Index i = 0; i < z.size(); ++i) {
    if (std::abs(z[i]) < 0.1 * p.l) continue;
    const double vz = -radial[i] / z[i];
    const double energy = 0.5 * (w.velocity.row(i).squaredNorm() + vz * vz);
    sz += z[i], se += energy, szz += z[i] * z[i], sze += z[i] * energy, ++n;
  }
  if (n < 8) return std::nullopt;
  const double variance = szz - sz * sz / n;
  const double slope = variance > 0.0 ? (sze - sz * se / n) / variance : 0.0;
  TopState top;
  top.l = p.l;
  top.b = p.b;
  top.a = -slope / p.l;
  if (std::abs(z[0]) < 1e-3 * p.l) return std::nullopt;
  top.k = Eigen::Vector3d(w.smooth(0, 0), w.smooth(0, 1), z[0]) / p.l;
  top.k.normalize();
  const Eigen::Vector3d k_rate(w.velocity(0, 0) / p.l, w.velocity(0, 1) / p.l,
                               -radial[0] / (z[0] * p.l));
  top.L = top.k.cross(k_rate) + top.b * top.k;
  make_weight_pull_down(top);
  return top;
}

}  // namespace

std::vector<Start> top_starts(const ArcData& arc, const Eigen::Vector2d& pivot_m) {
  std::vector<Start> starts;
  if (arc.t_s.size() < 12) return starts;
  const Window w = window_of(arc, smooth_auto(arc.t_s, arc.positions_m()), pivot_m);
  if (!(w.r_max > 0.0)) return starts;
  const auto add = [&](std::vector<Match> minima) {
    for (std::size_t i = 0; i < std::min<std::size_t>(2, minima.size()); ++i)
      starts.push_back(start_of(minima[i].top, pivot_m, "integral_matching"));
  };
  add(scan(w, Eigen::VectorXd::Ones(w.x.size())));
  const Parabola p = parabola(w);
  if (!p.valid) return starts;
  const Eigen::VectorXd sign = sides(w, p);
  if (sign.minCoeff() < 0.0) add(scan(w, sign));
  for (const double stretch : {1.0, 0.97, 1.03}) {
    const Match direct = match(w, stretch * p.l, stretch * (p.c0 - w.h.array()) / (p.l * p.b));
    if (direct.top.a > 0.0 && direct.top.L.allFinite())
      starts.push_back(start_of(direct.top, pivot_m, "integral_matching"));
  }
  if (const auto top = from_parabola(w, p))
    starts.push_back(start_of(*top, pivot_m, "integral_matching"));
  return starts;
}

namespace {

// What the best top about that pivot leaves of the window [m^2].
double left_about(const ArcData& arc, const SmoothCurve& curve, const Eigen::Vector2d& pivot_m) {
  const Window w = window_of(arc, curve, pivot_m);
  if (!(w.r_max > 0.0)) return std::numeric_limits<double>::infinity();
  double least = std::numeric_limits<double>::infinity();
  const auto look = [&](const Eigen::VectorXd& sign) {
    if (const std::vector<Match> minima = scan(w, sign); !minima.empty())
      least = std::min(least, minima.front().cost);
  };
  look(Eigen::VectorXd::Ones(w.x.size()));
  if (const Parabola p = parabola(w); p.valid)
    if (const Eigen::VectorXd sign = sides(w, p); sign.minCoeff() < 0.0) look(sign);
  return least;
}

// From a place to where a top explains most: steps to the four sides, halved where none is better.
std::pair<double, Eigen::Vector2d> moved_downhill(const ArcData& arc, const SmoothCurve& curve,
                                                  std::pair<double, Eigen::Vector2d> best,
                                                  double step_m) {
  constexpr int kMostSteps = 20;
  const double finest_m = step_m / 32.0;
  for (int i = 0; i < kMostSteps && step_m > finest_m; ++i) {
    const Eigen::Vector2d from = best.second;
    bool better = false;
    for (const Eigen::Vector2d& side : {Eigen::Vector2d(1.0, 0.0), Eigen::Vector2d(-1.0, 0.0),
                                        Eigen::Vector2d(0.0, 1.0), Eigen::Vector2d(0.0, -1.0)}) {
      const Eigen::Vector2d there = from + step_m * side;
      const double left = left_about(arc, curve, there);
      if (!(left < best.first)) continue;
      best = {left, there};
      better = true;
    }
    if (!better) step_m *= 0.5;
  }
  return best;
}

}  // namespace

std::vector<Eigen::Vector2d> pivot_guesses(const ArcData& given) {
  constexpr int kSamples = 75, kReach = 4;  // in steps of a quarter of the path's extent
  constexpr std::size_t kGuesses = 4;
  const auto count = static_cast<int>(given.t_s.size());
  const ArcData arc = given.slice(0, count, std::max(1, count / kSamples));
  const Eigen::MatrixX2d xy = arc.positions_m();
  const SmoothCurve curve = smooth_auto(arc.t_s, xy);
  const Eigen::Vector2d low = xy.colwise().minCoeff(), high = xy.colwise().maxCoeff();
  const Eigen::Vector2d mean = xy.colwise().mean();
  const double step_m = 0.25 * (high - low).maxCoeff();
  constexpr int kSide = 2 * kReach + 1;
  Eigen::MatrixXd left(kSide, kSide);
  const auto place = [&](int i, int k) -> Eigen::Vector2d {
    return mean + step_m * Eigen::Vector2d(i - kReach, k - kReach);
  };
  for (int i = 0; i < kSide; ++i)
    for (int k = 0; k < kSide; ++k) left(i, k) = left_about(arc, curve, place(i, k));
  std::vector<std::pair<double, Eigen::Vector2d>> valleys;
  for (int i = 0; i < kSide; ++i)
    for (int k = 0; k < kSide; ++k) {
      const int i0 = std::max(0, i - 1), k0 = std::max(0, k - 1);
      const double least =
          left.block(i0, k0, std::min(kSide, i + 2) - i0, std::min(kSide, k + 2) - k0).minCoeff();
      if (std::isfinite(left(i, k)) && left(i, k) <= least)
        valleys.emplace_back(left(i, k), place(i, k));
    }
  const auto by_left = [](const auto& a, const auto& b) { return a.first < b.first; };
  std::stable_sort(valleys.begin(), valleys.end(), by_left);
  valleys.resize(std::min(valleys.size(), kGuesses));
  for (auto& valley : valleys) valley = moved_downhill(arc, curve, valley, 0.5 * step_m);
  std::stable_sort(valleys.begin(), valleys.end(), by_left);
  std::vector<Eigen::Vector2d> guesses;
  for (const auto& [unexplained, pivot_m] : valleys) guesses.push_back(pivot_m);
  return guesses;
}

}  // namespace trochoid::fitting
