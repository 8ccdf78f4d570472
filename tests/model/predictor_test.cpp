#include "trochoid/model/predictor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "trochoid/data/io.hpp"

// What every model's predictor promises, whatever its equations.
namespace trochoid::model {
namespace {

constexpr const char* kDiscLines =
    "[body]\nradius_m = 0.04\nthickness_m = 0.004\nmass_kg = 0.1\n"
    "[start]\ntheta_rad = 0.9\nw2_rad_s = 20\nw3_rad_s = 5\nx_m = 0.3\ny_m = -0.1\n";
constexpr const char* kPuck =
    "[body]\nradius_m = 0.04\nmass_kg = 0.1\n[support]\nkind = 'flat'\n"
    "[start]\nvx_m_s = 0.8\nw3_rad_s = 5\nx_m = 0.3\ny_m = -0.1\n";
constexpr const char* kPinned =
    "[body]\nradius_m = 0.04\n[support]\npivot_m = [0, 0, 0]\n[start]\nw3_rad_s = 30\n";
constexpr const char* kTop =
    "[body]\nkind = 'top'\nmass_kg = 0.1\nI_kg_m2 = 1e-4\nIs_kg_m2 = 1.5e-4\nl_m = 0.03\n"
    "[start]\ntheta_rad = 0.6\nomega_s_rad_s = 60\n";

struct BadScene {
  const char* model;
  const char* scene;
  const char* terms;
};

class EveryPredictor : public testing::TestWithParam<BadScene> {
 protected:
  EveryPredictor()
      : predictor_(
            make_predictor(data::parse_scene(std::string(GetParam().scene) + "[model]\nname = '" +
                                                 GetParam().model + "'\n" + GetParam().terms,
                                             "scene"))),
        values_(static_cast<Eigen::Index>(predictor_->parameters().size())) {
    for (Eigen::Index i = 0; i < values_.size(); ++i)
      values_[i] = predictor_->parameters()[static_cast<std::size_t>(i)].value;
  }
  [[nodiscard]] Prediction at(const std::vector<double>& t_s, int max_steps = 0) const {
    PredictRequest request;
    request.t_s = t_s;
    request.start_s = kStart_s;
    request.max_steps = max_steps;
    request.observables.push_back(Observable::psi_rad);
    return predictor_->predict(values_, request);
  }

  static constexpr double kStart_s = 0.25;
  std::unique_ptr<Predictor> predictor_;
  Eigen::VectorXd values_;
};

TEST_P(EveryPredictor, GivesTheStartThoughNothingElseIsAskedFor) {
  const Prediction alone = at({kStart_s}), among = at({kStart_s, kStart_s + 0.1});
  ASSERT_EQ(alone.outcome, Outcome::reached_end);
  EXPECT_TRUE(alone.values.allFinite()) << alone.values.transpose();
  EXPECT_EQ(alone.values, among.values.head(3));
}

TEST_P(EveryPredictor, HasNumbersAtTheEndsOfTheRangesOfItsParameters) {
  const std::vector<double> t_s{kStart_s, kStart_s + 0.1, kStart_s + 0.2};
  PredictRequest request;
  request.t_s = t_s;
  request.start_s = kStart_s;
  for (int i = 0; i < values_.size(); ++i) request.derivatives.push_back(i);
  for (std::size_t i = 0; i < predictor_->parameters().size(); ++i) {
    const ParameterInfo& info = predictor_->parameters()[i];
    for (const double end : {info.lower, info.upper}) {
      if (!std::isfinite(end)) continue;
      Eigen::VectorXd values = values_;
      values[static_cast<Eigen::Index>(i)] = end;
      const Prediction run = predictor_->predict(values, request);
      if (run.outcome != Outcome::reached_end) continue;
      EXPECT_TRUE(run.values.allFinite()) << info.name << " = " << end;
      EXPECT_TRUE(run.jacobian.allFinite()) << info.name << " = " << end;
    }
  }
}

TEST_P(EveryPredictor, KeepsToTheLimitOfSteps) {
  EXPECT_EQ(at({kStart_s + 2.0}, 3).outcome, Outcome::step_limit);
}

INSTANTIATE_TEST_SUITE_P(Models, EveryPredictor,
                         testing::Values(BadScene{"top", kTop, ""}, BadScene{"top-euler", kTop, ""},
                                         BadScene{"smooth", kDiscLines, ""},
                                         BadScene{"rolling", kDiscLines, ""},
                                         BadScene{"sliding", kDiscLines, "friction = 0.2\n"},
                                         BadScene{"puck", kPuck, "friction = 0.02\n"},
                                         BadScene{"pivot", kPinned, "spin_down_dry_rad_s2 = 2\n"}),
                         [](const auto& instance) {
                           std::string name = instance.param.model;
                           std::erase(name, '-');
                           return name;
                         });

}  // namespace
}  // namespace trochoid::model
