#include "choose/rung.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "choose/held_back.hpp"
#include "common.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"
#include "trochoid/model/predictor.hpp"
#include "values_with.hpp"

// What a rung of the ladder takes over from the one above it.
namespace trochoid::fitting {
namespace {

data::Scene top_with_drag() {
  data::Scene scene = top();
  scene.model.drag_transverse_N_m_s = scene.model.drag_spin_N_m_s = 1e-6;
  return scene;
}

// A top that loses nothing.
data::Track track_of_a_top() {
  constexpr double kSigma_m = 3e-4;
  const std::map<std::string, double> truth{
      {"a_1_s2", 3.0}, {"b_1_s", 5.0}, {"l_m", 0.1}, {"theta_rad", 0.8}, {"dphi_rad_s", 0.3}};
  const auto predictor = model::make_predictor(top());
  const Eigen::VectorXd values = fitting::values_with(*predictor, truth);
  std::vector<double> t_s;
  for (int i = 0; i < 150; ++i) t_s.push_back(0.03 * i);
  model::PredictRequest request;
  request.t_s = t_s;
  const Eigen::VectorXd path = predictor->predict(values, request).values;
  std::mt19937_64 generator(2);
  std::normal_distribution<double> normal(0.0, kSigma_m);
  data::Track track;
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    data::TrackSample sample;
    sample.t_s = t_s[i];
    sample.centre_m = path.segment<2>(2 * static_cast<Eigen::Index>(i)) +
                      Eigen::Vector2d{normal(generator), normal(generator)};
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * kSigma_m * kSigma_m;
    track.samples.push_back(sample);
  }
  return track;
}

TEST(Rung, ThatLacksATermGoesOnFromTheSolutionOfTheOneAbove) {
  const data::Track track = track_of_a_top();
  Rung above, below, alone;
  above.scene = top_with_drag();
  below.scene = alone.scene = top();
  fit_rung(std::span(&track, 1), nullptr, nullptr, {}, above);
  ASSERT_TRUE(above.fitted) << above.reason;
  fit_neighbour(std::span(&track, 1), above, {}, below);
  ASSERT_TRUE(below.fitted) << below.reason;
  EXPECT_EQ(below.fit.start_path, "other_model") << "else it was searched for anew";
  EXPECT_EQ(below.parameters, above.parameters - 2);
  // What it lacks did not act: the same path, and less to pay for.
  EXPECT_LT(below.bic, above.bic);
  fit_rung(std::span(&track, 1), nullptr, nullptr, {}, alone);
  EXPECT_NEAR(below.fit.chi2, alone.fit.chi2, 0.01) << "the minimum is the same one";
  predict_held_back(std::span(&track, 1), {}, below);
  EXPECT_LT(below.held_back_rms_sigma, 2.0);
}

// A fit that explains nothing may hold that the spin is gone at once. What goes by another law then
// began without bounds, from where nothing can be predicted.
TEST(Rung, TakesOverADragThatLeavesNoSpin) {
  const data::Track track = track_of_a_top();
  Rung above, other;
  above.scene = top_with_drag();
  fit_rung(std::span(&track, 1), nullptr, nullptr, {}, above);
  ASSERT_TRUE(above.fitted) << above.reason;
  for (data::FitParameter& parameter : above.fit.parameters)
    if (parameter.name == "gamma3_1_s") parameter.value = 400.0;
  other.scene = top();
  other.scene.model.drag_spin_quadratic_N_m_s2 = 1e-6;
  fit_neighbour(std::span(&track, 1), above, {}, other);
  EXPECT_TRUE(other.fitted) << other.reason;
}

TEST(Rung, OfSeveralArcsIsSearchedForAnew) {
  data::Fit two;
  two.parameters.push_back({"friction", 0.2, 0.01, "", data::ParameterStatus::free, true, ""});
  two.arcs.resize(2);
  EXPECT_TRUE(values_of(two).empty());
  two.arcs.resize(1);
  EXPECT_EQ(values_of(two).at("friction"), 0.2);
}

// With Coulomb's law its search began ten times as far off, and led nowhere.
TEST(Rung, ThatExtendsOneWhoseFrictionSetsInGentlyMayHaveGentleFrictionToo) {
  const std::string folder = TROCHOID_SOURCE_DIR "/tests/independent/cases/gentle_friction";
  const data::Track track = data::read_track(folder + "/track.csv").tracks.front();
  Rung below, above;
  below.scene = data::read_scene(folder + "/scene.toml");
  below.scene.model.name = "sliding";
  below.scene.model.friction = 0.2;
  below.scene.model.air_linear_N_m_s = Eigen::Vector3d::Constant(1e-7);
  above.scene = below.scene;
  above.scene.model.air_force_N_s_m = 1e-4;
  below.scene.model.slip_regularisation_m_s = 4e-3;
  below.scene.fit.free.emplace_back("slip_regularisation_m_s");
  fit_from_values(std::span(&track, 1),
                  {{"theta_rad", 0.927},
                   {"phi_rad", -1.574},
                   {"w1_rad_s", -0.48},
                   {"w2_rad_s", -38.2},
                   {"w3_rad_s", -3.0},
                   {"x_m", -0.0470},
                   {"y_m", -0.0417},
                   {"vx_m_s", -0.002},
                   {"vy_m_s", -0.167},
                   {"friction", 0.136}},
                  {}, below);
  ASSERT_TRUE(below.fitted) << below.reason;
  EXPECT_FALSE(explains(below));
  fit_rung(std::span(&track, 1), &below, nullptr, {}, above, Reach::from_below);
  ASSERT_TRUE(above.fitted) << above.reason;
  EXPECT_TRUE(explains(above)) << above.fit.verdict_words;
  const data::FitParameter* gentle = above.fit.find("slip_regularisation_m_s");
  ASSERT_NE(gentle, nullptr);
  // The track was made with a quadratic couple of the air, for which a linear one stands here.
  EXPECT_NEAR(gentle->value, 0.004068, 0.05 * 0.004068);
}

// A disc of tests/independent that spins in place while it slides. The friction that sets in gently
// is dear to follow: the search for it had run out before it came near the path.
TEST(SlidingRung, FindsABodyThatSpinsInPlaceWhileItSlides) {
  const std::string folder = TROCHOID_SOURCE_DIR "/tests/independent/cases/spins_while_it_slides";
  const auto tracks = data::read_track(folder + "/track.csv").tracks;
  constexpr double kOrder_N_m_s = 2e-6, kOrder_m = 7e-5;  // seconds to a minute to a standstill
  Rung rung;
  rung.scene = data::read_scene(folder + "/scene.toml");
  rung.scene.model.name = "sliding";
  rung.scene.model.friction = 0.3;
  rung.scene.model.air_linear_N_m_s = Eigen::Vector3d::Constant(kOrder_N_m_s);
  rung.scene.model.rolling_friction_m = rung.scene.model.pivoting_friction_m = kOrder_m;
  fit_rung(tracks, nullptr, nullptr, {}, rung);
  EXPECT_TRUE(rung.fit.converged) << rung.fit.reason;
}

// The gentle law lets a body creep that rolls at first: the search for it led nowhere within a
// minute.
TEST(SlidingRung, OfABodyThatRollsAtFirstIsSearchedForByCoulombsLaw) {
  const std::string folder = TROCHOID_SOURCE_DIR "/tests/independent/cases/spins_while_it_slides";
  auto tracks = data::read_track(folder + "/track.csv").tracks;
  constexpr std::size_t kFew = 40;
  tracks.front().samples.resize(kFew);
  for (const bool rolls_first : {false, true}) {
    Rung rung;
    rung.scene = data::read_scene(folder + "/scene.toml");
    rung.scene.model.name = "sliding";
    rung.scene.model.friction = 0.3;
    rung.scene.model.rolling_friction_m = 7e-5;
    if (rolls_first) rung.first_part.values["theta_rad"] = 1.0;
    std::vector<std::string> lines;
    FitOptions logged;
    logged.log = [&](const std::string& line) { lines.push_back(line); };
    fit_rung(tracks, nullptr, nullptr, logged, rung);
    ASSERT_FALSE(lines.empty());
    EXPECT_EQ(lines.front().starts_with("Coulomb's law"), rolls_first) << lines.front();
    EXPECT_TRUE(rung.fit.converged) << rung.fit.reason;
  }
}

// A disc of tests/independent that rolls first and slides later.
class SlidesLater : public testing::Test {
 protected:
  SlidesLater() {
    rung_.scene = data::read_scene(folder_ + "/scene.toml");
    rung_.scene.model.name = "sliding";
    rung_.scene.model.friction = 0.3313;
    rung_.scene.model.rolling_friction_m = 1.27e-4;
    rung_.scene.model.contour_friction_m = 1.85e-5;
  }
  // From the fit of the same model whose centre begins as fast as that, so much beside its rolling.
  [[nodiscard]] Rung fitted(const data::Track& track, double slip_m_s) const {
    Rung below = rung_, rung = rung_;
    std::map<std::string, double> start = start_;
    start["vx_m_s"] += slip_m_s;
    fit_from_values(std::span(&track, 1), start, {}, below);
    EXPECT_TRUE(below.fit.converged) << below.reason;
    EXPECT_FALSE(below.rolls_at_first);
    fit_rung(std::span(&track, 1), &below, nullptr, {}, rung);
    EXPECT_TRUE(rung.fit.converged) << rung.reason;
    return rung;
  }

  const std::string folder_ = TROCHOID_SOURCE_DIR "/tests/independent/cases/slides_later";
  const std::map<std::string, double> start_{
      {"theta_rad", 1.2785}, {"phi_rad", -2.9611}, {"w1_rad_s", -0.959},
      {"w2_rad_s", -2.549},  {"w3_rad_s", 5.1303}, {"x_m", -0.02115},
      {"y_m", -0.09757},     {"vx_m_s", 0.2793},   {"vy_m_s", 0.0024}};
  Rung rung_;
};

// A slip that is over within a few samples came out anywhere, and all that goes with it.
TEST_F(SlidesLater, RollsFromTheBeginningWhereNothingSpeaksForASlip) {
  const Rung rung = fitted(data::read_track(folder_ + "/track.csv").tracks.front(), 0.0);
  EXPECT_TRUE(rung.rolls_at_first);
  EXPECT_EQ(rung.fit.find("vx_m_s")->status, data::ParameterStatus::derived);
}

// It was fitted with Coulomb's law, however softly friction sets in beside it.
TEST_F(SlidesLater, StaysAsTestedBesideOneThatRollsAtFirst) {
  const data::Track track = data::read_track(folder_ + "/track.csv").tracks.front();
  const Rung known = fitted(track, 0.0);
  Rung rung = rung_;
  rung.fit = known.fit;
  rung.fitted = rung.by_score_test = true;
  rung.bic = known.bic + 1.0;
  begin_as(std::span(&track, 1), known, {}, rung);
  EXPECT_TRUE(rung.by_score_test);
  EXPECT_FALSE(rung.rolls_at_first);
  EXPECT_EQ(rung.bic, known.bic + 1.0);
}

// It lasts for little more than a sample, and leaves the body a millimetre elsewhere.
TEST_F(SlidesLater, SlipsAtFirstWhereThatIsSeen) {
  constexpr double kSlip_m_s = -0.09;
  constexpr int kSamples = 40;
  data::Track track = data::read_track(folder_ + "/track.csv").tracks.front();
  track.samples.resize(kSamples);
  std::vector<double> t_s;
  for (const data::TrackSample& sample : track.samples) t_s.push_back(sample.t_s);
  std::map<std::string, double> truth = start_;
  truth["vx_m_s"] += kSlip_m_s;
  const auto predictor = model::make_predictor(rung_.scene);
  model::PredictRequest request;
  request.t_s = t_s;
  request.observables.push_back(model::Observable::theta_rad);
  request.observables.push_back(model::Observable::phi_rad);
  const Eigen::VectorXd path =
      predictor->predict(fitting::values_with(*predictor, truth), request).values;
  ASSERT_EQ(path.size(), static_cast<Eigen::Index>(4 * t_s.size()));
  std::mt19937_64 generator(3);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    const auto at = path.segment<4>(4 * static_cast<Eigen::Index>(i));
    data::TrackSample& sample = track.samples[i];
    const double sigma_m = std::sqrt(sample.covariance_m2(0, 0));
    sample.centre_m =
        at.head<2>() + sigma_m * Eigen::Vector2d{normal(generator), normal(generator)};
    sample.theta->value_rad = at[2] + sample.theta->sigma_rad * normal(generator);
    sample.phi->value_rad = at[3] + sample.phi->sigma_rad * normal(generator);
  }
  const Rung rung = fitted(track, kSlip_m_s);
  EXPECT_FALSE(rung.rolls_at_first);
  const data::FitParameter* speed = rung.fit.find("vx_m_s");
  EXPECT_NEAR(speed->value, start_.at("vx_m_s") + kSlip_m_s, 4.0 * speed->sigma);
}

// Rows of s08, between two skids and on: a disc that creeps at first, as softly as friction sets
// in.
data::Track creeping_first(const data::Table& reference) {
  constexpr Eigen::Index kFrom = 31, kTo = 79;
  constexpr double kSigma_m = 2e-5, kSigma_rad = 2e-3;
  std::mt19937_64 generator(5);
  std::normal_distribution<double> normal;
  data::Track track;
  for (Eigen::Index i = kFrom; i < kTo; ++i) {
    const auto at = [&](const char* name, double sigma) {
      return reference.column(name)[i] + sigma * normal(generator);
    };
    data::TrackSample& sample = track.samples.emplace_back();
    sample.t_s = reference.column("t")[i];
    sample.centre_m = {at("x", kSigma_m), at("y", kSigma_m)};
    sample.covariance_m2 = kSigma_m * kSigma_m * Eigen::Matrix2d::Identity();
    sample.theta = data::MeasuredAngle{at("theta", kSigma_rad), kSigma_rad};
    sample.phi = data::MeasuredAngle{at("phi", kSigma_rad), kSigma_rad};
  }
  return track;
}

// A slip that friction ends within a millisecond is not seen, and what goes with it was uncertain
// by whole turns a second.
TEST(SlidingRung, OfABodyThatCreepsAtFirstHasTheRatesItIsSeenWith) {
  const std::string file = TROCHOID_SOURCE_DIR "/data/reference/s08_slide_disc";
  const data::Table reference = data::read_table(file + ".csv");
  const data::Track track = creeping_first(reference);
  Rung rung;
  rung.scene = data::read_reference_case(file + ".json").scene;
  rung.scene.start = {};
  rung.scene.fit.free.emplace_back("slip_regularisation_m_s");
  std::map<std::string, double> truth;
  for (const auto& [name, column] : {std::pair{"theta_rad", "theta"},
                                     {"phi_rad", "phi"},
                                     {"w1_rad_s", "w1"},
                                     {"w2_rad_s", "w2"},
                                     {"w3_rad_s", "w3"},
                                     {"x_m", "x"},
                                     {"y_m", "y"},
                                     {"vx_m_s", "vx"},
                                     {"vy_m_s", "vy"}})
    truth[name] = reference.column(column)[31];
  Rung below = rung;
  fit_from_values(std::span(&track, 1), truth, {}, below);
  ASSERT_TRUE(below.fit.converged) << below.reason;
  rung = below;
  let_roll_at_first(std::span(&track, 1), {}, rung);
  ASSERT_TRUE(rung.fit.converged) << rung.reason;
  EXPECT_TRUE(rung.rolls_at_first);
  EXPECT_EQ(rung.fit.find("vx_m_s")->status, data::ParameterStatus::derived);
  for (const auto& [name, value] : truth) {
    const data::FitParameter* found = rung.fit.find(name);
    ASSERT_NE(found, nullptr) << name;
    const double off = std::remainder(found->value - value, 2.0 * std::numbers::pi);
    EXPECT_LT(std::abs(off), 4.0 * found->sigma) << name;
    if (name.ends_with("_s")) {
      EXPECT_LT(found->sigma, 0.3 * below.fit.find(name)->sigma) << name;
    }
  }
}

}  // namespace
}  // namespace trochoid::fitting
