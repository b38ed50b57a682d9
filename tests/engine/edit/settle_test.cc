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

std::vector<Drag> shifted(const std::vector<DVec3>& sources, DVec3 way) {
  std::vector<Drag> drags;
  for (const DVec3& source : sources) drags.push_back({source, source + way, 0});
  return drags;
}

/// The motion that handles with these targets ask for.
std::optional<RigidMotion> settled_by(std::vector<Drag> drags) {
  const auto targets = settled(drags, false, stand);
  if (!targets) return std::nullopt;
  for (std::size_t k = 0; k < drags.size(); ++k) drags[k].target = (*targets)[k];
  return deform::nearest_motion(drags, 0, false);
}

TEST(Settled, SetsAPartDownThatItsHandleLiftsBySlipOrSinks) {
  for (const double miss : {0.04, -0.04}) {
    const auto motion = settled_by(shifted({{0.1, 0.4, 0}}, {1, miss, 0.2}));
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
  EXPECT_FALSE(settled(shifted({{0.1, 0.4, 0}}, {1, 0.01, 0}), false, [](const RigidMotion&) { return std::nullopt; }));
}

/// Three handles of a thing of 0.4, off by a hundredth of their way: it leans by a degree and a half.
std::vector<Drag> leaning() {
  std::vector<Drag> drags = shifted({{-0.2, 0.4, 0}, {0.2, 0.4, 0}, {0, 0.4, 0.2}}, {1, 0, 0});
  drags[0].target.y += 0.01, drags[2].target.y -= 0.01;
  return drags;
}

TEST(Settled, StandsAsUprightAsItStood) {
  const RigidMotion asked = deform::nearest_motion(leaning(), 0, false);
  ASSERT_LT(glm::dot(asked.turn * up, up), std::cos(0.02));
  const auto motion = settled_by(leaning());
  ASSERT_TRUE(motion);
  EXPECT_NEAR(glm::dot(motion->turn * up, up), 1, 1e-12);
  EXPECT_NEAR((*motion)({0.3, 0.05, 0.2}).y, 0.05, 1e-12);
  // The middle of its handles is what they say best: it moves by no more than the height that they miss.
  EXPECT_NEAR((*motion)(asked.centre).x, asked(asked.centre).x, 1e-12);
  EXPECT_NEAR((*motion)(asked.centre).z, asked(asked.centre).z, 1e-12);
}

TEST(Settled, StandsOnTheFloorByTwoHandlesOneAboveTheOther) {
  // Two handles say nothing of a turn about their row: what is carried out need not be upright, but stands.
  std::vector<Drag> drags = shifted({{-0.1, 0.1, 0}, {0.1, 0.3, 0}}, {1, 0, 0});
  const DQuat around = glm::angleAxis(0.4, up);
  for (Drag& drag : drags) drag.target = DVec3(1, 0.012, 0) + around * drag.source;
  const auto motion = settled_by(drags);
  ASSERT_TRUE(motion);
  EXPECT_NEAR((*motion)({0, 0.05, 0}).y, 0.05, 1e-6);
}

TEST(Settled, SetsDownWhatCannotBeRighted) {
  // Righted, it would be off by more than a slip; as it leans, it is not.
  std::vector<Drag> drags = shifted({{-1, 0.4, 0}, {1, 0.4, 0}, {0, 0.4, 1}}, {1, 0.02, 0});
  const RigidMotion lean{.centre = {0, 0.4, 0}, .turn = glm::angleAxis(0.1, DVec3(0, 0, 1)), .shift = {1, 0.02, 0}};
  for (Drag& drag : drags) drag.target = lean(drag.source);
  const auto motion = settled_by(drags);
  ASSERT_TRUE(motion);
  EXPECT_LT(glm::dot(motion->turn * up, up), std::cos(0.09));
  EXPECT_NEAR((*motion)({0, 0.05, 0}).y, 0.05, 1e-12);
}

TEST(Settled, LeavesATurnThatAHandleAsksFor) {
  std::vector<Drag> drags = leaning();
  drags[0].turn = DQuat(1, 0, 0, 0);
  const RigidMotion asked = deform::nearest_motion(drags, 0, false);
  const auto motion = settled_by(drags);
  ASSERT_TRUE(motion);
  EXPECT_NEAR(std::abs(glm::dot(motion->turn, asked.turn)), 1, 1e-12);
}

TEST(Settled, LeavesASmallThingAsItIsLaidDownFarAway) {
  std::vector<Drag> drags = shifted({{-0.01, 0.05, 0}, {0.01, 0.05, 0}, {0, 0.05, 0.01}}, DVec3(0.0));
  const RigidMotion laid{.centre = {0, 0.05, 0}, .turn = glm::angleAxis(1.57, DVec3(0, 0, 1)), .shift = {1, 0.02, 0}};
  for (Drag& drag : drags) drag.target = laid(drag.source);
  const auto motion = settled_by(drags);
  ASSERT_TRUE(motion);
  EXPECT_NEAR(std::abs(glm::dot(motion->turn, laid.turn)), 1, 1e-12);
}

TEST(Settled, LeavesUprightnessToHandlesWhereTwoPlanesAreStoodOn) {
  const DVec3 aside = glm::normalize(DVec3(0.2, 1, 0));
  const auto drags = leaning();
  const auto targets = settled(drags, false, [&](const RigidMotion& motion) -> std::optional<select::Footings> {
    const DVec3 foot(0, 0.05, 0);
    return select::Footings{{up, foot, 0.05}, {aside, motion(foot), 0.06}};
  });
  ASSERT_TRUE(targets);
  for (std::size_t k = 0; k < drags.size(); ++k)
    EXPECT_NEAR(glm::distance((*targets)[k], drags[k].target - 0.01 * aside), 0, 1e-12) << k;
}

TEST(Settled, LeavesAPartWithAnAnchor) {
  std::vector<Drag> drags = shifted({{0, 0.4, 0}}, {0.5, 0.02, 0});
  EXPECT_TRUE(settled(drags, false, stand));
  drags.push_back({{-9, 0, 0}, {-9, 0, 0}, 0, true});
  EXPECT_FALSE(settled(drags, false, stand));
}

}  // namespace
}  // namespace engine::edit
