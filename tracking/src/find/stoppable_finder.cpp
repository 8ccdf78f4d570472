#include "find/stoppable_finder.hpp"

#include <utility>

namespace trochoid::tracking {
namespace {

class StoppableFinder final : public BodyFinder {
 public:
  StoppableFinder(const BodyFinder& finder, std::function<void()> checkpoint)
      : finder_(finder), checkpoint_(std::move(checkpoint)) {
    if (const BodyFinder* lying = finder.lying())
      lying_ = std::make_unique<StoppableFinder>(*lying, checkpoint_);
  }
  StoppableFinder(std::unique_ptr<BodyFinder> finder, std::function<void()> checkpoint)
      : StoppableFinder(*finder, std::move(checkpoint)) {
    owned_ = std::move(finder);
  }

  [[nodiscard]] std::optional<Sighting> find(const Look& look) const override {
    checkpoint_();
    return finder_.find(look);
  }
  void place(Sighting& guess) const override { finder_.place(guess); }
  [[nodiscard]] std::optional<data::Pose<>> mirror_image(const data::Pose<>& pose) const override {
    return finder_.mirror_image(pose);
  }
  [[nodiscard]] OtherReadings other_readings(const data::Pose<>& pose) const override {
    return finder_.other_readings(pose);
  }
  [[nodiscard]] std::optional<FloorDarkening> floor_around(
      const Frame& frame, const Plate& background, const data::Pose<>& pose) const override {
    checkpoint_();
    return finder_.floor_around(frame, background, pose);
  }
  [[nodiscard]] const BodyFinder* lying() const override { return lying_.get(); }
  [[nodiscard]] double expected_major_px(const Eigen::Vector2d& at_px) const override {
    return finder_.expected_major_px(at_px);
  }
  [[nodiscard]] double reach_px(const Sighting& seen) const override {
    return finder_.reach_px(seen);
  }
  [[nodiscard]] bool faces_look_alike() const override { return finder_.faces_look_alike(); }
  [[nodiscard]] double mark_rad() const override { return finder_.mark_rad(); }

 private:
  std::unique_ptr<BodyFinder> owned_;
  const BodyFinder& finder_;
  std::function<void()> checkpoint_;
  std::unique_ptr<StoppableFinder> lying_;
};

}  // namespace

std::unique_ptr<BodyFinder> make_stoppable(std::unique_ptr<BodyFinder> finder,
                                           std::function<void()> checkpoint) {
  if (!checkpoint) return finder;
  return std::make_unique<StoppableFinder>(std::move(finder), std::move(checkpoint));
}

}  // namespace trochoid::tracking
