#include "engine/repair/outskirts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rows.h"
#include "engine/correct/scene_corrector.h"
#include "engine/edit/edit.h"
#include "tests/engine/edit/backed.h"

namespace engine::repair {
namespace {

using edit::BackedThing;
using Rows = std::vector<std::uint32_t>;

Outskirts of(const BackedThing& scene) { return outskirts_of(scene.cloud, scene.thing, scene.cameras); }

TEST(Outskirts, AreWhatBacksAThingAndWhatOfItIsBuriedInTheWall) {
  const BackedThing scene;
  const Outskirts found = of(scene);
  EXPECT_EQ(found.backing, Rows{scene.backing}) << "and nothing of the wall, nor what is on its front";
  EXPECT_EQ(found.buried, scene.in_wall);
}

TEST(Outskirts, AreNotWhatNobodyWouldSee) {
  BackedThing scene(-5);
  for (const std::uint32_t row : scene.in_wall) scene.cloud.opacity_logit[row] = -5;
  const Outskirts found = of(scene);
  EXPECT_TRUE(found.backing.empty());
  EXPECT_TRUE(found.buried.empty());
}

TEST(Outskirts, WhatOnePictureShowsIsNotBuried) {
  BackedThing scene;
  scene.cameras.push_back(scene::look_at(DVec3(0, 0, 4), DVec3(0, 0, 0.4), DVec3(0, -1, 0), 0.6, 96, 96));
  scene.cameras.back().name = "behind";
  EXPECT_TRUE(of(scene).buried.empty()) << "it is seen from behind the wall";
}

TEST(Outskirts, AWallThatIsSeenThroughAThingIsAWall) {
  BackedThing scene;
  std::vector<std::uint8_t> is_kept(scene.cloud.size(), 1);
  is_kept[scene.backing] = 0;
  scene.cloud = scene::select(scene.cloud, is_kept);
  EXPECT_TRUE(of(scene).backing.empty()) << "its colour is that of the wall around";
}

TEST(Outskirts, OfNothingOrFromNowhereThereAreNone) {
  const BackedThing scene;
  for (const Outskirts& found :
       {outskirts_of(scene.cloud, {}, scene.cameras), outskirts_of(scene.cloud, scene.thing, {})}) {
    EXPECT_TRUE(found.backing.empty());
    EXPECT_TRUE(found.buried.empty());
  }
}

TEST(Outskirts, AreTheSameForAnyNumberOfThreads) {
  const BackedThing scene;
  Outskirts one, many;
  WorkArena(1).run([&] { one = of(scene); });
  WorkArena(3).run([&] { many = of(scene); });
  EXPECT_EQ(one.backing, many.backing);
  EXPECT_EQ(one.buried, many.buried);
}

/// Rows of the input that are not in the outcome, and whether any new row is as large as those in the wall.
struct Seen {
  Rows removed;
  std::size_t crumbs = 0;
  bool has_haze = false;
};

Seen after(const BackedThing& scene, bool repaired = true) {
  correct::SceneCorrector corrector;
  const auto outcome =
      edit::run(scene.cloud, scene.cameras, scene.request, {.corrector = repaired ? &corrector : nullptr});
  if (!outcome) {
    ADD_FAILURE() << outcome.error().message << " at " << outcome.error().where;
    return {};
  }
  Seen seen{outcome->overlay.removed, outcome->report.crumbs, false};
  const auto& log_scale = outcome->overlay.rows.log_scale;
  for (std::size_t row = 0; row < log_scale.size(); ++row) seen.has_haze |= log_scale.get(row).x > -2.0f;
  return seen;
}

TEST(Outskirts, GoWithTheThing) {
  const BackedThing scene;
  const Seen seen = after(scene);
  EXPECT_TRUE(std::ranges::binary_search(seen.removed, scene.backing));
  EXPECT_FALSE(std::ranges::binary_search(seen.removed, scene.sticker)) << "it is seen, and was not selected";
  EXPECT_TRUE(std::ranges::includes(seen.removed, scene.thing));
  EXPECT_EQ(seen.crumbs, 1u);
  EXPECT_FALSE(seen.has_haze) << "what was in the wall does not arrive";
}

TEST(Outskirts, StayWhereTheRequestOrTheDeformationAloneSaysSo) {
  BackedThing scene;
  const Seen deformed = after(scene, false);
  EXPECT_EQ(deformed.removed, scene.thing) << "as a preview shows it";
  EXPECT_TRUE(deformed.has_haze);
  scene.request.crumbs = edit::Crumbs::keep;
  const Seen kept = after(scene);
  EXPECT_EQ(kept.crumbs, 0u);
  EXPECT_TRUE(kept.has_haze);
  scene.request.crumbs = edit::Crumbs::move;
  scene.request.handles[0].target = scene.request.handles[0].source;
  const Seen still = after(scene);
  EXPECT_TRUE(still.removed.empty()) << "a drag of no length changes nothing";
}

TEST(Outskirts, OutsideOfTheRegionStay) {
  BackedThing scene;
  scene.request.region = edit::Region{DVec3(0, 0, 0), DVec3(2, 2, 0.1)};
  EXPECT_EQ(after(scene).crumbs, 0u);
}

TEST(Outskirts, OfWhatIsHeldAreItsInside) {
  BackedThing scene;
  scene.request.attach = deform::Attach::held;
  EXPECT_EQ(after(scene).crumbs, 0u);
}

}  // namespace
}  // namespace engine::repair
