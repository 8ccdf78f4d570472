#include "link/chroma_site.hpp"

#include <algorithm>
#include <cmath>

namespace trochoid::tracking {
namespace {

// How far what the colours show lies off what the luma does, in some frames together.
struct Shift {
  Eigen::Array2d information = Eigen::Array2d::Zero(), right = Eigen::Array2d::Zero();

  void add(const PoseMeasurement& pose) {
    information += pose.colour_information;
    right += pose.colour_information * pose.colour_off_px;
  }
  [[nodiscard]] bool tells(int axis) const {
    constexpr double kSd_px = 0.05;
    return information[axis] > 1.0 / (kSd_px * kSd_px);
  }
  [[nodiscard]] double off_px(int axis) const { return right[axis] / information[axis]; }
};

// The same with samples at the site that the background has.
Shift seen_with(const Background& background, const BodyFinder& finder,
                const std::vector<Glimpse>& glimpses, const std::vector<std::size_t>& which) {
  std::vector<std::optional<Sighting>> seen(which.size());
  on_all_cores(background, finder, which.size(), [&](Measuring& measure, std::size_t k) {
    const std::size_t i = which[k];
    seen[k] = measure(*glimpses[i].frame, *glimpses[i].seen, Beside{glimpses[i - 1].pose(), 1});
  });
  Shift shift;
  for (const auto& again : seen)
    if (again && again->pose) shift.add(*again->pose);
  return shift;
}

}  // namespace

std::optional<Eigen::Vector2d> find_chroma_site(const Background& background,
                                                const BodyFinder& finder,
                                                const std::vector<Glimpse>& glimpses) {
  constexpr std::size_t kLooks = 16;
  constexpr double kNoticeable_px = 0.08, kAside_px = 0.5;
  Shift amid;
  std::vector<std::size_t> told;
  for (std::size_t i = 1; i < glimpses.size(); ++i) {
    if (!glimpses[i].posed() || !glimpses[i - 1].posed()) continue;
    const PoseMeasurement& pose = *glimpses[i].seen->pose;
    if (pose.colour_information.minCoeff() <= 0.0) continue;
    amid.add(pose);
    told.push_back(i);
  }
  if (!amid.tells(0) || !amid.tells(1)) return std::nullopt;
  std::vector<std::size_t> which;
  const std::size_t looks = std::min(kLooks, told.size());
  for (std::size_t k = 0; k < looks; ++k) which.push_back(told[k * told.size() / looks]);
  Shift now = amid;
  Eigen::Vector2d site_px = Eigen::Vector2d::Zero();
  const int farther = std::abs(amid.off_px(0)) > std::abs(amid.off_px(1)) ? 0 : 1;
  for (const int axis : {farther, 1 - farther}) {
    if (std::abs(now.off_px(axis)) < kNoticeable_px) continue;
    Eigen::Vector2d tried_px = site_px;
    tried_px[axis] = -std::copysign(kAside_px, now.off_px(axis));
    const Shift aside = seen_with(background.sited_at(tried_px), finder, glimpses, which);
    if (aside.information.minCoeff() <= 0.0 ||
        std::abs(aside.off_px(axis)) > std::abs(now.off_px(axis)))
      continue;
    site_px = tried_px;
    now = aside;
  }
  return site_px;
}

}  // namespace trochoid::tracking
