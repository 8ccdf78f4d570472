#include <gtest/gtest.h>

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

}  // namespace
}  // namespace trochoid::tools
