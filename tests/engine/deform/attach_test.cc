#include "engine/deform/attach.h"

#include <gtest/gtest.h>

#include <numbers>
#include <vector>

namespace engine::deform {
namespace {

using How = Attachment::How;

const Contact nothing{1000, 0, 0, 0, 2}, stands_there{1000, 100, 5, 0.03, 2}, grows_there{1000, 100, 40, 0.2, 2},
    hangs_there{1000, 100, 40, 0.1, 2};

const std::vector<DVec3> corners{DVec3(0, 0, 0), DVec3(1, 0, 0), DVec3(0, 1, 0)};

template <class Motion>
std::vector<Drag> drags_of(const std::vector<DVec3>& points, Motion motion) {
  std::vector<Drag> drags;
  for (const DVec3& point : points) drags.push_back({point, motion(point)});
  return drags;
}

DVec3 turned(DVec3 point) { return glm::angleAxis(0.9, DVec3(0, 0, 1)) * point + DVec3(0.2, 0, 0); }
DVec3 grown(DVec3 point) { return 1.5 * point; }
DVec3 bent(DVec3 point) { return point + DVec3(0, 0, point.x * point.x + 0.5 * point.y); }

/// One handle, shifted.
std::vector<Drag> shifted(double way) {
  return drags_of({DVec3(0.0)}, [=](DVec3 p) { return p + DVec3(way, 0, 0); });
}

How how(const std::vector<Drag>& drags, const Contact& contact, Attach asked = Attach::automatic) {
  return attach(drags, 0, contact, asked).how;
}

TEST(Attach, ACupGoesAsItIsAndAnEarIsHeld) {
  const auto one = drags_of({DVec3(0.0)}, [](DVec3 p) { return p + DVec3(1, 0, 0); });
  EXPECT_EQ(how(one, nothing), How::one_piece);
  EXPECT_EQ(how(one, stands_there), How::one_piece);
  EXPECT_EQ(how(one, grows_there), How::held);
}

TEST(Attach, WhatHangsOnByLittleBendsWhereItIsNudgedAndGoesWhereItIsTaken) {
  EXPECT_EQ(how(shifted(0.3), hangs_there), How::held);
  EXPECT_EQ(how(shifted(0.8), hangs_there), How::one_piece);
  EXPECT_EQ(how(shifted(0.3), hangs_there, Attach::free), How::one_piece);
  EXPECT_EQ(how(shifted(0.3), stands_there), How::one_piece) << "a cup that is pushed";
  EXPECT_TRUE(attach(shifted(0.3), 0, hangs_there, Attach::automatic).grows_out);
  EXPECT_TRUE(attach(shifted(0.3), 0, hangs_there, Attach::held).grows_out)
      << "held by the same rows if it is asked for";
  Contact helmet = hangs_there;
  helmet.shown = 10'000;
  EXPECT_EQ(how(shifted(0.3), helmet), How::one_piece) << "a tip of it touches a hand";
  Contact shadowed = hangs_there;
  shadowed.goes_on = 10;
  EXPECT_EQ(how(shifted(0.3), shadowed), How::one_piece);
  auto turning = shifted(0.3);
  turning[0].turn = glm::angleAxis(0.5, DVec3(0, 0, 1));
  EXPECT_EQ(how(turning, hangs_there), How::one_piece) << "a doll that is turned on its quilt";
}

TEST(Attach, WhatTouchesByLittleIsHeldByAFirmBorderOnly) {
  const auto one = drags_of({DVec3(0.0)}, [](DVec3 p) { return p + DVec3(0.3, 0, 0); });
  Contact ball = grows_there;
  ball.shown = 10'000, ball.firmness = 0.13;
  EXPECT_EQ(how(one, ball), How::one_piece);
  ball.firmness = 0.19;
  EXPECT_EQ(how(one, ball), How::held) << "a fox's head on its neck";
  ball.shown = 1'000, ball.firmness = 0.13;
  EXPECT_EQ(how(one, ball), How::held);
}

TEST(Attach, WhatGoesFartherThanItIsLongIsTakenAway) {
  const auto one = drags_of({DVec3(0.0)}, [](DVec3 p) { return p + DVec3(2.5, 0, 0); });
  EXPECT_EQ(how(one, grows_there), How::one_piece);
  EXPECT_EQ(how(one, grows_there, Attach::held), How::held);
}

TEST(Attach, TheLooserItIsHeldTheSoonerItGoes) {
  Contact contact = grows_there;  // of size 2
  const auto longest_bend = [&](double firmness) {
    contact.firmness = firmness;
    double way = 0.01;
    while (way < 5 && how(shifted(way), contact) == How::held) way += 0.01;
    return way;
  };
  EXPECT_NEAR(longest_bend(0.075), 0.4, 0.02);
  EXPECT_NEAR(longest_bend(0.1), 0.72, 0.02);
  EXPECT_NEAR(longest_bend(0.119), longest_bend(0.121), 0.04) << "no step where it begins to grow out";
  EXPECT_NEAR(longest_bend(0.128), 1.08, 0.02) << "a lamp taken with some of the wall goes farther";
  EXPECT_NEAR(longest_bend(0.2), 2, 0.02);
  EXPECT_NEAR(longest_bend(0.9), 2, 0.02);
}

TEST(Attach, SaysWhatComesOffUnasked) {
  const auto comes_off = [](double way, const Contact& contact, Attach asked = Attach::automatic) {
    return attach(shifted(way), 0, contact, asked).comes_off;
  };
  EXPECT_TRUE(comes_off(2.5, grows_there));
  EXPECT_FALSE(comes_off(0.3, grows_there));
  EXPECT_FALSE(comes_off(2.5, grows_there, Attach::free));
  EXPECT_FALSE(comes_off(2.5, hangs_there)) << "a doll that is taken off its quilt";
  EXPECT_EQ(attach(shifted(2.5), 0, hangs_there, Attach::automatic).why.find("it hangs on"), 0u);
  EXPECT_FALSE(comes_off(2.5, stands_there));
}

TEST(Attach, ThreeHandlesThatTurnOutweighWhatTheBorderLooksLike) {
  EXPECT_EQ(how(drags_of(corners, turned), grows_there), How::one_piece);
  EXPECT_EQ(how(drags_of({corners[0], corners[1]}, turned), grows_there), How::held) << "two say less";
}

TEST(Attach, WhatBendsIsHeldWhereItStands) {
  EXPECT_EQ(how(drags_of(corners, bent), stands_there), How::held);
  EXPECT_EQ(how(drags_of(corners, bent), nothing), How::free);
  auto anchored = drags_of(corners, bent);
  anchored[0].anchor = true;
  EXPECT_EQ(how(anchored, stands_there), How::free) << "its anchors hold it";
}

TEST(Attach, AsAskedComesFirst) {
  const auto one = drags_of({DVec3(0.0)}, [](DVec3 p) { return p + DVec3(1, 0, 0); });
  EXPECT_EQ(how(one, stands_there, Attach::held), How::held);
  EXPECT_EQ(how(one, grows_there, Attach::free), How::one_piece);
  EXPECT_EQ(how(drags_of(corners, bent), grows_there, Attach::free), How::free);
  EXPECT_EQ(how(one, nothing, Attach::held), How::free) << "there is nothing to hold it";
}

TEST(MotionAsOnePiece, AllowsForHandsThatAreNotExact) {
  auto drags = drags_of(corners, turned);
  drags[1].target += DVec3(0.02, -0.01, 0.01);
  EXPECT_TRUE(motion_as_one_piece(drags, 0));
  drags[1].target += DVec3(0.3, 0, 0);
  EXPECT_FALSE(motion_as_one_piece(drags, 0));
}

TEST(MotionAsOnePiece, TakesHalfATurn) {
  const auto half = [](DVec3 p) { return DQuat(0, 0, 0, 1) * p + DVec3(0.3, 0, 0); };
  const auto motion = motion_as_one_piece(drags_of(corners, half), 0);
  ASSERT_TRUE(motion);
  EXPECT_LT(glm::distance((*motion)(DVec3(2, 3, 4)), half(DVec3(2, 3, 4))), 1e-9);
}

TEST(MotionAsOnePiece, OfHandlesThatAllStayIsOne) {
  EXPECT_TRUE(motion_as_one_piece(drags_of({DVec3(1e3, 0.1, 7), DVec3(0.3, 2, 1)}, [](DVec3 p) { return p; }), 0));
}

TEST(MotionAsOnePiece, GrowsWhereThreeHandlesDo) {
  const auto motion = motion_as_one_piece(drags_of(corners, grown), 0);
  ASSERT_TRUE(motion);
  EXPECT_NEAR(motion->scale, 1.5, 1e-9);
  EXPECT_FALSE(motion_as_one_piece(drags_of({corners[0], corners[1]}, grown), 0)) << "or are they to stretch it?";
  auto anchored = drags_of(corners, grown);
  anchored[0].anchor = true;
  EXPECT_FALSE(motion_as_one_piece(anchored, 0));
}

TEST(MotionAsOnePiece, OfOneHandleIsWhatItAsksFor) {
  Drag drag{DVec3(1, 0, 0), DVec3(1, 2, 0)};
  drag.turn = glm::angleAxis(0.5 * std::numbers::pi, DVec3(0, 0, 1));
  drag.scale = 2;
  const auto motion = motion_as_one_piece(std::vector<Drag>{drag}, 0);
  ASSERT_TRUE(motion);
  const DVec3 found = (*motion)(DVec3(2, 0, 0));
  EXPECT_NEAR(glm::distance(found, DVec3(1, 4, 0)), 0, 1e-12);
}

TEST(MotionAsOnePiece, TurnsNoHandleOtherwiseThanItAsksFor) {
  auto drags = drags_of(corners, turned);
  drags[0].turn = glm::angleAxis(0.9, DVec3(0, 0, 1));
  EXPECT_TRUE(motion_as_one_piece(drags, 0));
  drags[0].turn = glm::angleAxis(0.4, DVec3(0, 0, 1));
  EXPECT_FALSE(motion_as_one_piece(drags, 0));
}

TEST(Attach, LooksAtItsGroupAlone) {
  auto drags = drags_of(corners, turned);
  for (Drag other : drags_of(corners, bent)) other.group = 1, drags.push_back(other);
  EXPECT_EQ(attach(drags, 0, stands_there, Attach::automatic).how, How::one_piece);
  EXPECT_EQ(attach(drags, 1, stands_there, Attach::automatic).how, How::held);
}

}  // namespace
}  // namespace engine::deform
