#include <gtest/gtest.h>

#include <limits>

#include "common/comparison_table.hpp"
#include "report/parts.hpp"

namespace trochoid::tools {
namespace {

TEST(ValueWords, ShowTheErrorToItsSecondDigitHoweverSmall) {
  EXPECT_EQ(value_words(0.12345, 0.0021), "0.1235 ± 0.0021");
  EXPECT_EQ(value_words(1.2344e-5, 2.1e-7), "(1.234 ± 0.021) × 10^-5");
  EXPECT_EQ(value_words(0.0, 0.002), "0.0000 ± 0.0020");
  // A path without noise, of a simulation.
  EXPECT_EQ(value_words(0.098, 8.9e-14), "0.098 ± 8.9e-14");
  EXPECT_EQ(value_words(3.0, 1e-16), "3 ± 1.0e-16");
  EXPECT_EQ(value_words(9.80665, 0.0), "9.80665");
}

TEST(ValueWords, AValueWithoutUnitHasNoOtherDigitBehindIt) {
  EXPECT_EQ(unit_words("1"), "");
  EXPECT_EQ(unit_words("1/s"), "1/s");
}

TEST(ComparisonTable, ColumnsStandApartHoweverLargeTheNumbers) {
  std::vector<data::ModelScore> models(2);
  models[0].model = models[1].model = "puck";
  models[0].aicc = 12345678901.25;
  models[0].bic = 123456789012.25;
  models[0].held_back_rms_sigma = 123456.75;
  models[0].parameters = 7;
  models[0].recommended = true;
  models[1].bic = std::numeric_limits<double>::quiet_NaN();
  models[1].reason = "no spin is seen";
  EXPECT_EQ(
      comparison_table(models),
      "        AICc         BIC      held back  parameters   model\n"
      "* 12345678901.25 123456789012.25 1.23e+05 sigma           7   puck\n"
      "           -           -              -           -   puck: not fitted: no spin is seen\n");
  EXPECT_EQ(comparison_table({}), "");
}

}  // namespace
}  // namespace trochoid::tools
