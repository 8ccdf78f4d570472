#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "judge/statistics.hpp"
#include "problem/problem.hpp"
#include "start/strategy.hpp"

// How windows grow, and what the data determine and what not, on a model whose answer is known.
namespace trochoid::fitting {
namespace {

// x = left + right, y = slope t: of the first two only the sum is seen.
class Sum : public model::Predictor {
 public:
  [[nodiscard]] const std::string& model_name() const override { return name_; }
  [[nodiscard]] const std::vector<model::ParameterInfo>& parameters() const override {
    return infos_;
  }
  [[nodiscard]] model::Prediction predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                          const model::PredictRequest& request) const override {
    model::Prediction out;
    const auto rows = static_cast<Eigen::Index>(2 * request.t_s.size());
    out.values.resize(rows);
    out.jacobian.setZero(rows, static_cast<Eigen::Index>(request.derivatives.size()));
    for (std::size_t i = 0; i < request.t_s.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(2 * i);
      out.values[row] = values[0] + values[1];
      out.values[row + 1] = values[2] * request.t_s[i];
      for (std::size_t c = 0; c < request.derivatives.size(); ++c) {
        const bool slope = request.derivatives[c] == 2;
        const auto column = static_cast<Eigen::Index>(c);
        out.jacobian(row, column) = slope ? 0.0 : 1.0;
        out.jacobian(row + 1, column) = slope ? request.t_s[i] : 0.0;
      }
    }
    return out;
  }

 private:
  std::string name_ = "sum";
  std::vector<model::ParameterInfo> infos_{parameter("left_m", "m"), parameter("right_m", "m"),
                                           parameter("slope_m_s", "m/s")};
  static model::ParameterInfo parameter(const char* name, const char* unit) {
    return {name, unit, model::ParameterInfo::Role::dynamics, -INFINITY, INFINITY, false, 0.0,
            true, ""};
  }
};

constexpr double kScatter_m = 1e-3, kRow_s = 0.1;
constexpr int kSumRows = 20;

Problem problem_of(const Sum& sum, int samples = kSumRows) {
  data::Track track;
  for (int i = 0; i < samples; ++i) {
    data::TrackSample sample;
    sample.t_s = kRow_s * i;
    const double noise = i % 2 == 0 ? kScatter_m : -kScatter_m;
    sample.centre_m = Eigen::Vector2d(1.0 + noise, 0.5 * sample.t_s - noise);
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * kScatter_m * kScatter_m;
    track.samples.push_back(sample);
  }
  return make_problem(sum, {make_arc(track, 0, samples, {}, false)}, {});
}

TEST(Identifiable, IsWhatTheDataSeeAndNotTheTermsOfASum) {
  const Sum sum;
  const Uncertainty error = uncertainty(problem_of(sum), Eigen::Vector3d(0.4, 0.6, 0.5));
  EXPECT_THAT(error.identifiable, testing::ElementsAre(false, false, true));
  EXPECT_EQ(error.rank, 2);
  ASSERT_EQ(error.null_vectors.size(), 1U);
  const auto& unseen = error.null_vectors.front().components;
  EXPECT_NEAR(unseen.at("left_m"), -unseen.at("right_m"), 1e-9) << "one up, the other down";
  EXPECT_NEAR(unseen.at("slope_m_s"), 0.0, 1e-9);
  EXPECT_THAT(error.null_vectors.front().words, testing::HasSubstr("left_m"));
  EXPECT_THAT(error.null_vectors.front().words, testing::HasSubstr("do not see the direction"));
}

TEST(Identifiable, IsATermOnceTheOtherIsKnownBeforehand) {
  constexpr double kKnown_m = 0.01;
  const Sum sum;
  Problem problem = problem_of(sum);
  problem.free[0].prior = data::Prior{0.4, kKnown_m};
  const Uncertainty error = uncertainty(problem, Eigen::Vector3d(0.4, 0.6, 0.5));
  EXPECT_THAT(error.identifiable, testing::Each(true));
  EXPECT_EQ(error.rank, 3);
  EXPECT_NEAR(std::sqrt(error.covariance(0, 0)), kKnown_m, 1e-3 * kKnown_m);
  EXPECT_GT(std::sqrt(error.covariance(1, 1)), 0.99 * kKnown_m);
}

// They show in no residual.
TEST(Widened, DoesNotSayWhatOffsetsOfAWholeRecordDo) {
  const Eigen::Vector3d at(0.4, 0.6, 0.5);
  const Sum sum;
  Problem problem = problem_of(sum);
  const Uncertainty apart = uncertainty(problem, at);
  problem.arcs[0].filmed = true;
  const Uncertainty common = uncertainty(problem, at);
  EXPECT_GT(common.covariance(2, 2), 3.0 * apart.covariance(2, 2));  // 1 + 3 n / 16 of a line
  EXPECT_LT(common.covariance(2, 2), 6.0 * apart.covariance(2, 2));
  EXPECT_DOUBLE_EQ(common.widened, apart.widened);
}

// A sample far off pulls the line towards itself until the others miss it as well.
TEST(Windows, LeaveASampleOutThatAloneIsFarOff) {
  constexpr int kWrong = 9, kMany = 60;
  const Sum sum;
  Problem problem = problem_of(sum, kMany);
  for (Reading& reading : problem.arcs[0].readings)
    if (reading.sample == kWrong) reading.value.x() += 100.0 * kScatter_m;
  const Found found = grow(problem, {"given", {{"slope_m_s", 0.4}}}, 24);
  EXPECT_TRUE(found.passed) << found.reduced_chi2;
  EXPECT_THAT(found.strays_s, testing::ElementsAre(kRow_s * kWrong));
  // Where every sample is right none is left out.
  const Found all = grow(problem_of(sum, kMany), {"given", {{"slope_m_s", 0.4}}}, 24);
  EXPECT_TRUE(all.passed) << all.reduced_chi2;
  EXPECT_THAT(all.strays_s, testing::IsEmpty());
}

// No line goes the way of a zigzag.
TEST(Windows, AStartWhosePathLeavesTheTracksIsCountedAsDeparted) {
  const Sum sum;
  Problem problem = problem_of(sum, 100);
  for (Reading& reading : problem.arcs[0].readings)
    reading.value.y() += 0.1 * std::abs(reading.sample % 20 - 10);
  problem.shortfalls = std::make_shared<Shortfalls>();
  EXPECT_FALSE(grow(problem, {"given", {{"slope_m_s", 0.4}}}, 24).solution.usable);
  EXPECT_EQ(problem.shortfalls->departed, 1);
}

}  // namespace
}  // namespace trochoid::fitting
