#include "engine/repair/witnesses.h"

#include <gtest/gtest.h>

#include <array>
#include <span>

#include "tests/engine/edit/block.h"
#include "tests/engine/edit/samples.h"

namespace engine::repair {
namespace {

using edit::add_gaussian, edit::arc_of_cameras, edit::floor_color;

/// An opaque screen at z = 0, one unit wide, which three cameras at z = -3 and beside that look at.
scene::GaussianCloud screen() {
  scene::GaussianCloud cloud;
  for (int i = -10; i <= 10; ++i)
    for (int j = -10; j <= 10; ++j)
      add_gaussian(cloud, {0.05f * float(i), 0.05f * float(j), 0}, {0.04f, 0.04f, 0.005f}, 4, floor_color);
  return cloud;
}

TEST(Witnesses, SawWhatIsInFrontOfAScreenAndOnIt) {
  const Witnesses witnesses(screen(), arc_of_cameras(3, 64));
  EXPECT_TRUE(witnesses.saw({0, 0, -0.5}));
  EXPECT_TRUE(witnesses.saw({0.1, 0.1, 0}));
}

TEST(Witnesses, DidNotSeeWhatIsBehindTheScreenFromAllOfThem) {
  const Witnesses witnesses(screen(), arc_of_cameras(3, 64));
  EXPECT_FALSE(witnesses.saw({0, 0, 0.1}));
  EXPECT_TRUE(witnesses.saw({0, 0, 2})) << "far behind it, where those at the sides look past it";
}

TEST(Witnesses, OneAloneIsBelievedButBesideAnEdge) {
  const auto cameras = arc_of_cameras(3, 64);
  const auto one = std::span(cameras).subspan(1, 1);  // in front of the screen
  EXPECT_TRUE(Witnesses(screen(), one).saw({0, 0, -0.5}));
  // Far behind the screen, which ends at 0.55 or so; a pixel is 0.045 wide where the screen is.
  int beside = 0;
  for (double x = 0.5; x < 0.7; x += 0.005) {
    const DVec3 behind(x * 1.3333, 0, 1);
    const bool alone = Witnesses(screen(), one).saw(behind);
    const std::array twice{cameras[1], cameras[1]};
    const bool together = Witnesses(screen(), twice).saw(behind);
    EXPECT_LE(alone, together) << x;
    beside += together && !alone;
  }
  EXPECT_GE(beside, 5) << "a pixel's width";
  EXPECT_LE(beside, 15);
}

TEST(Witnesses, LookThroughWhereNothingIs) {
  const Witnesses witnesses({}, arc_of_cameras(2, 64));
  EXPECT_TRUE(witnesses.saw({0, 0, 1}));
}

TEST(Witnesses, SawNothingBehindThemOrBesideTheirPicturesOrWithoutAny) {
  const Witnesses witnesses(screen(), arc_of_cameras(2, 64));
  EXPECT_FALSE(witnesses.saw({0, 0, -10}));
  EXPECT_FALSE(witnesses.saw({0, 1e30, 0}));
  EXPECT_FALSE(Witnesses(screen(), {}).saw({0, 0, -0.5}));
}

}  // namespace
}  // namespace engine::repair
