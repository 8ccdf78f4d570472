#include <cmath>
#include <limits>

#include "files_for_tests.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::data {
namespace {

Fit full_fit() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Fit fit;
  fit.model = "top";
  fit.converged = true;
  fit.outcome = FitOutcome::converged;
  fit.reason = "chi2 stopped falling";
  fit.start_path = "integral_matching";
  fit.parameters = {
      {"a_1_s2", 195.7, 0.1 + 0.2, "1/s^2", ParameterStatus::free, true, ""},
      {"I_over_Is", 5.0, kInfinity, "1", ParameterStatus::derived, false, "only b is seen"},
      {"mass_kg", 0.06, 0.0, "kg", ParameterStatus::fixed, true, ""},
      {"l_m", std::nan(""), 1e-5, "m", ParameterStatus::prior, true, ""}};
  fit.covariance_names = {"a_1_s2", "b_1_s"};
  fit.covariance = (Eigen::Matrix2d() << 1e-3, 1e-5, 1e-5, 1.0 / 3.0).finished();
  fit.chi2 = 1234.5;
  fit.dof = 1313;
  fit.noise_scale = 1.02;
  fit.aicc = -10.5;
  fit.bic = 3.25;
  fit.whiteness_p = 0.3;
  fit.correlation_time_s = 0.01;
  fit.rank = 2;
  fit.condition = 1e7;
  fit.null_vectors = {{{{"I_kg_m2", 0.8}, {"Is_kg_m2", -0.6}}, "only their ratio"}};
  fit.broken_degeneracies = {{"tilt", {"l_m", "a_1_s2"}, "without the tilt"}};
  fit.integration_error_sigma = 1e-3;
  fit.time_origin_s = 0.5;
  fit.arcs = {{0, 1, 0.5, 2.5, 200}};
  fit.comparison = {{"top", 1.0, 2.0, 3.0, 0.5, 1.1, 6, true, "why"}};
  fit.recommendation = "top suffices";
  fit.profiles = {
      {"a_1_s2", ProfileVerdict::one_sided, 0.0, 2.5, {1.0, 2.0, 3.0}, {0.5, 0.0, 7.0}}};
  fit.bootstrap = {200, 1, 0.25, {{"a_1_s2", 0.5, 1.5, 2.5}}};
  fit.warnings = {"scale not given"};
  fit.inputs = {{"top.track.csv", std::string(64, 'b')}};
  fit.versions = {{"trochoid", "0.1.0"}};
  fit.seed = 18446744073709551615u;
  fit.scene_toml = "[model]\nname = \"top\"\n";
  return fit;
}

TEST(FitFile, KeepsEverythingThroughAFile) {
  const TestFolder folder;
  const Fit fit = full_fit();
  write_fit(fit, folder / "a.json");
  const Fit read = read_fit(folder / "a.json");
  ASSERT_EQ(read.parameters.size(), 4u);
  EXPECT_EQ(read.parameters[0].sigma, 0.1 + 0.2);
  EXPECT_TRUE(std::isinf(read.parameters[1].sigma));
  EXPECT_FALSE(read.parameters[1].identifiable);
  EXPECT_EQ(read.parameters[1].status, ParameterStatus::derived);
  EXPECT_TRUE(std::isnan(read.parameters[3].value));
  EXPECT_EQ(read.covariance, fit.covariance);
  EXPECT_EQ(read.null_vectors.at(0).components, fit.null_vectors[0].components);
  EXPECT_EQ(read.broken_degeneracies.at(0).parameters, fit.broken_degeneracies[0].parameters);
  EXPECT_EQ(read.seed, fit.seed);
  EXPECT_EQ(read.scene_toml, fit.scene_toml);
  ASSERT_NE(read.find("mass_kg"), nullptr);
  EXPECT_EQ(read.find("nothing"), nullptr);
  // Whatever the reader lost would be missing from a second writing.
  write_fit(read, folder / "b.json");
  EXPECT_EQ(content(folder / "a.json"), content(folder / "b.json"));
}

TEST(FitFile, ListsParametersByNameValueSigmaUnitAndStatus) {
  const TestFolder folder;
  write_fit(full_fit(), folder / "a.json");
  const std::string text = content(folder / "a.json");
  for (const char* part : {"\"trochoid_fit\": 1", "\"parameters\": [", "\"name\": \"a_1_s2\"",
                           "\"value\": 195.7", "\"unit\": \"1/s^2\"", "\"status\": \"free\"",
                           "\"sigma\": \"Infinity\"", "\"value\": null"})
    EXPECT_NE(text.find(part), std::string::npos) << part;
}

TEST(FitFile, IsWrittenEvenIfAFileNameIsNoUtf8) {
  const TestFolder folder;
  Fit fit = full_fit();
  fit.reason = "from \xff\xfe.csv";
  write_fit(fit, folder / "a.json");
  EXPECT_EQ(read_fit(folder / "a.json").outcome, FitOutcome::converged);
}

TEST(FitFile, WithACovarianceThatDoesNotFitItsNamesIsRefused) {
  const TestFolder folder;
  Fit fit = full_fit();
  fit.covariance_names.pop_back();
  EXPECT_NE(refusal([&] { write_fit(fit, folder / "a.json"); }).find("covariance"),
            std::string::npos);
  EXPECT_EQ(folder.entries(), 0);
}

struct RefusedFit {
  const char* name;
  std::string text;
  const char* reason;
};
class FitRefusal : public testing::TestWithParam<RefusedFit> {};

TEST_P(FitRefusal, NamesFileAndReason) {
  const TestFolder folder;
  const auto path = folder.write("bad.json", GetParam().text);
  const std::string message = refusal([&] { static_cast<void>(read_fit(path)); });
  EXPECT_EQ(message.rfind(path.string(), 0), 0u) << message;
  EXPECT_NE(message.find(GetParam().reason), std::string::npos) << message;
}

const std::string kBegin = R"({"trochoid_fit": 1, "model": "top", "outcome": "converged", )";
INSTANTIATE_TEST_SUITE_P(
    Files, FitRefusal,
    testing::Values(
        RefusedFit{"Empty", "", "empty"}, RefusedFit{"List", "[1]", "JSON object"},
        RefusedFit{"Truncated", "{\"model\":\n \"top\"", ":2: not JSON"},
        RefusedFit{"NoVersion", "{}", "trochoid_fit"},
        RefusedFit{"FutureVersion", R"({"trochoid_fit": 2})", "version 2"},
        RefusedFit{"NoParameters", kBegin + "\"dof\": 1}", "\"parameters\" is missing"},
        RefusedFit{"ParametersNoList", kBegin + R"("parameters": {}})", "must be a list"},
        RefusedFit{"NamelessParameter", kBegin + R"("parameters": [{"value": 1}]})", "no name"},
        RefusedFit{"ValuelessParameter",
                   kBegin + R"("parameters": [{"name": "a", "value": 1}, {"name": "b"}]})",
                   "\"parameters\"[1] has no \"value\""},
        RefusedFit{"WordValue", kBegin + R"("parameters": [{"name": "a", "value": "x"}]})",
                   "\"parameters\"[0]: \"value\" must be a number"},
        RefusedFit{"OddStatus", kBegin + R"("parameters": [{"name": "a", "status": "x"}]})",
                   "\"status\" must be free, fixed, derived or prior"},
        RefusedFit{"OddVerdict", kBegin + R"("parameters": [], "verdict": "x"})",
                   "\"verdict\" must be good, good_correlated, weak"},
        RefusedFit{"OddOutcome",
                   R"({"trochoid_fit": 1, "model": "top", "outcome": "x", "parameters": []})",
                   "\"outcome\" must be converged, no_convergence"},
        RefusedFit{
            "RaggedCovariance",
            kBegin +
                R"("parameters": [], "covariance_names": ["a","b"], "covariance": [[1,2],[3]]})",
            "square"},
        RefusedFit{"HugeWhole", kBegin + R"("parameters": [], "dof": 99999999999})",
                   "whole number"},
        RefusedFit{"NegativeSeed", kBegin + R"("parameters": [], "seed": -1})", ">= 0"},
        RefusedFit{"HugeNumber", kBegin + R"("parameters": [], "chi2": 1e999})", "out of range"},
        RefusedFit{"BrokenUtf8", "{\"model\": \"\xff\"}", "not JSON"},
        RefusedFit{"DeepNesting", std::string(100000, '['), "not JSON"}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace trochoid::data
