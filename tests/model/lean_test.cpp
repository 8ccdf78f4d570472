#include <gtest/gtest.h>

#include "trochoid/model/counted.hpp"
#include "trochoid/model/rolling.hpp"
#include "trochoid/model/sliding.hpp"
#include "trochoid/model/top.hpp"

// What a scene leaves out must cost nothing. Operations are counted, so that no machine decides;
// the bounds are the counts of the formulas written out by hand, with a tenth to spare.
namespace trochoid::model {
namespace {

const RimBody kDisc{.m = 0.2, .A = 5e-5, .C = 1e-4, .R = 0.03, .h = 0.002};

template <template <class> class... Terms>
OperationCount rolling_with() {
  Rolling<Counted, Terms...> system{.body = kDisc, .losses = {}};
  const State<Counted, 8> y{{0.1, 1.0, 0.2, 0.3, 4.0, -10.0, 0.0, 0.0}};
  return operations_of(system, y);
}

template <template <class> class Friction, template <class> class... Terms>
OperationCount sliding_with() {
  Sliding<Counted, Friction, Terms...> system{.body = kDisc, .losses = {}, .friction = {}};
  const State<Counted, 10> y{{0.1, 1.0, 0.2, 0.3, 4.0, -10.0, 0.0, 0.0, 0.05, 0.02}};
  return operations_of(system, y);
}

TEST(LeanScene, RollingWithoutLossesTakesNoRootAndTwoDivisions) {
  const OperationCount bare = rolling_with<>();
  EXPECT_EQ(bare.functions, 4);  // sine and cosine of tilt and azimuth
  EXPECT_EQ(bare.quotients, 2);  // by sin(theta): dphi, and the node frame's rate
  EXPECT_LE(bare.total(), 73);
}

TEST(LeanScene, LinearAirAddsThreeCouplesAndNothingElse) {
  const long bare = rolling_with<>().total();
  const OperationCount air = rolling_with<LinearAir>();
  EXPECT_EQ(air.functions, 4);
  EXPECT_EQ(air.quotients, 2);
  EXPECT_LE(air.total() - bare, 23);
}

TEST(LeanScene, EveryTermThatIsLeftOutSavesItsShare) {
  const long full = rolling_with<LinearAir, QuadraticAir, AirForce, GapLayer, RollingFriction,
                                 PivotingFriction, ContourFriction>()
                        .total();
  const long air = rolling_with<LinearAir, QuadraticAir, AirForce, GapLayer>().total();
  const long couples = rolling_with<RollingFriction, PivotingFriction, ContourFriction>().total();
  const long bare = rolling_with<>().total();
  EXPECT_LT(bare, air);
  EXPECT_LT(bare, couples);
  EXPECT_LT(air, full);
  EXPECT_LT(couples, full);
  EXPECT_LE(2 * bare, full) << "the full list costs at least twice the bare one";
}

TEST(LeanScene, ASmoothFloorKnowsNoFriction) {
  const OperationCount smooth = sliding_with<NoFriction>(), rough = sliding_with<Coulomb>();
  EXPECT_EQ(smooth.functions + 1, rough.functions);  // the root of the slip speed
  EXPECT_LT(smooth.total(), rough.total());
}

TEST(LeanScene, TheTopTakesNeitherDivisionNorFunction) {
  const State<Counted, 5> y{{0.3, 0.1, 0.2, 0.5, 0.8}};
  const OperationCount bare = operations_of(Top<Counted>{20.0, 3.0, 5.0}, y);
  EXPECT_EQ(bare.quotients, 0);
  EXPECT_EQ(bare.functions, 0);
  EXPECT_LE(bare.total(), 13);  // eight products, four differences or sums, one sign
  const State<Counted, 7> with_drag{{0.3, 0.1, 3.0, 0.2, 0.5, 0.8, 5.0}};
  EXPECT_LT(2 * bare.total(),
            operations_of(TopWithDrag<Counted>{20.0, 0.1, 0.2}, with_drag).total());
}

}  // namespace
}  // namespace trochoid::model
