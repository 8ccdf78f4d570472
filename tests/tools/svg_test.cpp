#include "draw/svg.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <regex>
#include <set>
#include <string>

namespace trochoid::tools {
namespace {

/// The numbers that stand along both axes.
std::vector<std::string> numbers_on(const std::string& svg) {
  static const std::regex number("text-anchor=\"(middle|end)\">(-?[0-9.e+-]+)</text>");
  std::vector<std::string> numbers;
  for (std::sregex_iterator at(svg.begin(), svg.end(), number), end; at != end; ++at)
    numbers.push_back((*at)[2]);
  return numbers;
}

std::string axes_of(const Range& x, const Range& y, SvgPlot::Scale scale) {
  return SvgPlot("axes", x, y, {"x", "y"}, scale).text();
}

// A disc on a pin stays where it is, and the mean of its places is off by their last digit: the
// ticks between the two had no end, nor had the report.
TEST(Svg, PlacesThatDifferByRoundingAloneAreDrawnAsOne) {
  const Range x{100.0, std::nextafter(100.0, 101.0)}, y{300.0, std::nextafter(300.0, 301.0)};
  for (const auto scale : {SvgPlot::Scale::equal, SvgPlot::Scale::linear}) {
    const std::size_t numbers = numbers_on(axes_of(x, y, scale)).size();
    EXPECT_GE(numbers, 4u);
    EXPECT_LE(numbers, 20u);
  }
}

TEST(Svg, NumbersOfAShortAxisFarFromZeroDiffer) {
  const std::vector<std::string> numbers =
      numbers_on(axes_of({1234.5, 1234.51}, {-0.002, 0.003}, SvgPlot::Scale::linear));
  EXPECT_EQ(std::set<std::string>(numbers.begin(), numbers.end()).size(), numbers.size());
}

}  // namespace
}  // namespace trochoid::tools
