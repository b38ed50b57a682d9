#include "engine/edit/settle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <vector>

#include "engine/deform/attach.h"

namespace engine::edit {
namespace {

using deform::Drag;
using deform::RigidMotion;

const DVec3 up(0, 1, 0);

/// On a floor, y up, which its lowest point was 0.05 above: what stands there, with any motion.
std::optional<select::Footings> stand(const RigidMotion& motion) {
  const DVec3 foot(0, 0.05, 0), arrived = motion(foot);
  return select::Footings{{up, foot, foot.y}, {up, arrived, arrived.y}};
}

std::vector<Drag> shifted(std::vector<DVec3> sources, DVec3 way) {
  std::vector<Drag> drags;
  for (const DVec3& source : sources) drags.push_back({source, source + way, 0});
  return drags;
}

std::optional<RigidMotion> settled_by(const std::vector<Drag>& drags) {
  return settled(deform::nearest_motion(drags, 0, false), drags, stand);
}

TEST(Settled, SetsAPartDownThatItsHandleLiftsBySlipOrSinks) {
  for (const double miss : {0.04, -0.04}) {
    const DVec3 way(1, miss, 0.2);
    const auto motion = settled_by(shifted({{0.1, 0.4, 0}}, way));
    ASSERT_TRUE(motion) << miss;
    EXPECT_NEAR(glm::distance((*motion)({0.1, 0.4, 0}), DVec3(1.1, 0.4, 0.2)), 0, 1e-12) << miss;
    EXPECT_EQ(motion->turn, DQuat(1, 0, 0, 0));
  }
}

TEST(Settled, LeavesWhatIsMeant) {
  const auto is_left = [](DVec3 way) { return !settled_by(shifted({{0.1, 0.4, 0}}, way)); };
  EXPECT_TRUE(is_left({1, 0.06, 0})) << "a twentieth of the way is no slip";
  EXPECT_TRUE(is_left({0, 0.5, 0}));
  EXPECT_TRUE(is_left({1, 0.0009, 0})) << "exact handles stay exact";
  EXPECT_TRUE(is_left({0, 0, 0}));
}

TEST(Settled, StandsAsUprightAsItStood) {
  // Three handles of a thing of 0.4, off by a hundredth of their way: it would lean by a degree and a half.
  std::vector<Drag> drags = shifted({{-0.2, 0.4, 0}, {0.2, 0.4, 0}, {0, 0.4, 0.2}}, {1, 0, 0});
  drags[0].target.y += 0.01, drags[2].target.y -= 0.01;
  const RigidMotion asked = deform::nearest_motion(drags, 0, false);
  ASSERT_LT(glm::dot(asked.turn * up, up), std::cos(0.02));
  const auto motion = settled_by(drags);
  ASSERT_TRUE(motion);
  EXPECT_NEAR(glm::dot(motion->turn * up, up), 1, 1e-12);
  EXPECT_NEAR((*motion)({0.3, 0.05, 0.2}).y, 0.05, 1e-12);
  // The middle of its handles is what they say best: it moves by no more than the height that they miss.
  EXPECT_NEAR((*motion)(asked.centre).x, asked(asked.centre).x, 1e-12);
  EXPECT_NEAR((*motion)(asked.centre).z, asked(asked.centre).z, 1e-12);
}

TEST(Settled, LeavesATurnThatAHandleAsksFor) {
  std::vector<Drag> drags = shifted({{0, 0.4, 0}, {0.3, 0.4, 0}}, {1, 0.02, 0});
  const DQuat lean = glm::angleAxis(0.02, DVec3(1, 0, 0));
  drags[0].turn = lean;
  RigidMotion asked{.centre = drags[0].source, .turn = lean, .shift = DVec3(1, 0.02, 0)};
  const auto motion = settled(asked, drags, stand);
  ASSERT_TRUE(motion);
  EXPECT_EQ(motion->turn, lean);
  EXPECT_NEAR((*motion)({0, 0.05, 0}).y, 0.05, 1e-12);
}

TEST(Settled, LeavesTheTurnOfWhatRolls) {
  const double rolled = 1;
  std::vector<Drag> drags = shifted({{-0.2, 0.3, 0}, {0.2, 0.3, 0}, {0, 0.5, 0.2}}, DVec3(0.0));
  const RigidMotion roll{
      .centre = {0, 0.3, 0}, .turn = glm::angleAxis(-rolled, DVec3(0, 0, 1)), .shift = {0.3, 0.01, 0}};
  for (Drag& drag : drags) drag.target = roll(drag.source);
  const auto motion = settled(roll, drags, [&](const RigidMotion& with) -> std::optional<select::Footings> {
    const DVec3 foot(0, 0.05, 0), arrived = with.centre + with.shift - DVec3(0, 0.25, 0);
    return select::Footings{{up, foot, foot.y}, {up, arrived, arrived.y}};
  });
  ASSERT_TRUE(motion);
  EXPECT_NEAR(std::abs(glm::dot(motion->turn, roll.turn)), 1, 1e-12);
  EXPECT_NEAR(motion->shift.y, 0, 1e-12);
}

TEST(Settled, TakesNoAnchorFarFromItsPlace) {
  std::vector<Drag> drags = shifted({{0, 0.4, 0}}, {0.5, 0.03, 0});
  drags.push_back({{-2, 0, 0}, {-2, 0, 0}, 0, true});
  RigidMotion asked{.centre = {-2, 0, 0}, .turn = glm::angleAxis(0.1, DVec3(0, 1, 0))};
  drags[0].target = asked(drags[0].source);
  EXPECT_FALSE(settled(asked, drags, stand));
}

}  // namespace
}  // namespace engine::edit
