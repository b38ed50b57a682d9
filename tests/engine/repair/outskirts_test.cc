#include "engine/repair/outskirts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rows.h"
#include "engine/correct/scene_corrector.h"
#include "engine/edit/checkpoint.h"
#include "engine/edit/edit.h"
#include "tests/engine/edit/backed.h"

namespace engine::repair {
namespace {

using edit::BackedThing;
using Rows = std::vector<std::uint32_t>;

Outskirts of(const BackedThing& scene, std::span<const std::uint32_t> part, std::span<const scene::Camera> cameras) {
  auto found = outskirts_of(scene.cloud, part, cameras, [] { return Result<void>(); });
  EXPECT_TRUE(found);
  return found ? std::move(*found) : Outskirts{};
}
Outskirts of(const BackedThing& scene) { return of(scene, scene.thing, scene.cameras); }

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
  const std::vector<scene::Camera> away{scene::look_at(DVec3(0, 0, -3), DVec3(0, 0, -9), DVec3(0, -1, 0), 0.6, 96, 96)};
  for (const Outskirts& found :
       {of(scene, {}, scene.cameras), of(scene, scene.thing, {}), of(scene, scene.thing, away)}) {
    EXPECT_TRUE(found.backing.empty());
    EXPECT_TRUE(found.buried.empty());
  }
}

TEST(Outskirts, AFringeOfHairsThatAreSeenIsNotBuried) {
  BackedThing scene;
  scene.cloud.opacity_logit[scene.in_wall[0]] = scene.cloud.opacity_logit[scene.in_wall[1]] = -9;
  for (int i = 0; i < 536; ++i) {  // each below a pixel in any picture, together more than a tenth of the thing
    const Vec3 mean{-0.8f + 0.012f * float(i % 134), -0.55f - 0.08f * float(i / 134), 0};
    edit::add_gaussian(scene.cloud, mean, {0.004f, 0.02f, 0.004f}, -2.2f, {0.9f, 0.2f, 0.1f});
    scene.thing.push_back(std::uint32_t(scene.cloud.size() - 1));
  }
  EXPECT_TRUE(of(scene).buried.empty());
}

TEST(Outskirts, FarFromTheOriginAreTheSame) {
  BackedThing scene;
  const DVec3 shift(1e4, -2e4, 1e4);
  for (std::size_t row = 0; row < scene.cloud.size(); ++row)
    scene.cloud.mean.set(row, Vec3(DVec3(scene.cloud.mean.get(row)) + shift));
  for (scene::Camera& camera : scene.cameras) camera.translation -= camera.rotation * shift;
  const Outskirts found = of(scene);
  EXPECT_EQ(found.backing, Rows{scene.backing});
  EXPECT_EQ(found.buried, scene.in_wall);
}

TEST(Outskirts, ALookThatIsStoppedIsAnError) {
  const BackedThing scene;
  int looks = 0;
  const auto found = outskirts_of(scene.cloud, scene.thing, scene.cameras, [&]() -> Result<void> {
    if (++looks == 2) return fail(ErrorCode::cancelled, "stopped");
    return {};
  });
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, ErrorCode::cancelled);
  EXPECT_EQ(looks, 2);
}

TEST(Outskirts, AreTheSameForAnyNumberOfThreads) {
  const BackedThing scene;
  Outskirts one, many;
  WorkArena(1).run([&] { one = of(scene); });
  WorkArena(3).run([&] { many = of(scene); });
  EXPECT_EQ(one.backing, many.backing);
  EXPECT_EQ(one.buried, many.buried);
}

/// What an edit made of the thing.
struct Seen {
  Rows removed;
  std::size_t crumbs = 0;
  bool has_haze = false;  ///< A new row is as large as those in the wall.
  bool says_so = false;   ///< That something does not arrive.
};

Seen after(const BackedThing& scene, bool repaired = true) {
  correct::SceneCorrector corrector;
  const auto outcome =
      edit::run(scene.cloud, scene.cameras, scene.request, {.corrector = repaired ? &corrector : nullptr});
  if (!outcome) {
    ADD_FAILURE() << outcome.error().message << " at " << outcome.error().where;
    return {};
  }
  Seen seen{outcome->overlay.removed, outcome->report.crumbs};
  const auto& log_scale = outcome->overlay.rows.log_scale;
  for (std::size_t row = 0; row < log_scale.size(); ++row) seen.has_haze |= log_scale.get(row).x > -2.0f;
  for (const std::string& warning : outcome->report.warnings)
    seen.says_so |= warning.starts_with("2 Gaussians of the part do not arrive");
  return seen;
}

/// Neither backing nor buried rows were looked for.
void expect_untouched(const BackedThing& scene, bool repaired = true) {
  const Seen seen = after(scene, repaired);
  EXPECT_EQ(seen.crumbs, 0u);
  EXPECT_FALSE(seen.says_so);
}

TEST(Outskirts, GoWithTheThing) {
  BackedThing scene;
  for (const int intervals : {1, 2}) {
    SCOPED_TRACE(intervals);
    scene.request.params.intervals = intervals;
    const Seen seen = after(scene);
    EXPECT_TRUE(std::ranges::binary_search(seen.removed, scene.backing));
    EXPECT_FALSE(std::ranges::binary_search(seen.removed, scene.sticker)) << "it is seen, and was not selected";
    EXPECT_TRUE(std::ranges::includes(seen.removed, scene.thing));
    EXPECT_EQ(seen.crumbs, 1u);
    EXPECT_FALSE(seen.has_haze) << "what was in the wall does not arrive";
    EXPECT_TRUE(seen.says_so);
  }
}

TEST(Outskirts, AreTheSameAfterAnInterruption) {
  BackedThing scene;
  scene.request.params.intervals = 2;
  correct::SceneCorrector corrector;
  std::string checkpoint;
  edit::Observer observer;
  observer.interval_done = [&](const edit::IntervalDone& done) {
    EXPECT_TRUE(done.state.scene.check());
    if (done.interval == 1) checkpoint = edit::encode(done.state);
    return Result<void>{};
  };
  const auto whole = edit::run(scene.cloud, scene.cameras, scene.request, {.corrector = &corrector}, observer);
  ASSERT_TRUE(whole);
  auto state = edit::decode(checkpoint, scene.cloud, scene.request);
  ASSERT_TRUE(state);
  const auto resumed =
      edit::run(scene.cloud, scene.cameras, scene.request, {.corrector = &corrector}, {}, std::move(*state));
  ASSERT_TRUE(resumed);
  EXPECT_EQ(whole->overlay, resumed->overlay);
  EXPECT_EQ(whole->report.crumbs, resumed->report.crumbs);
  EXPECT_EQ(whole->report.warnings, resumed->report.warnings);
}

TEST(Outskirts, OfWhatIsRemovedGoToo) {
  BackedThing scene;
  scene.request.mode = edit::Mode::remove;
  scene.request.handles[0].target.reset();
  const Seen seen = after(scene);
  EXPECT_TRUE(std::ranges::binary_search(seen.removed, scene.backing));
  EXPECT_EQ(seen.crumbs, 1u);
  EXPECT_FALSE(seen.says_so) << "nothing arrives anyway";
}

TEST(Outskirts, ThatAreHealedAreNoCrumbs) {
  BackedThing scene;
  scene.request.healed = {scene.backing};
  EXPECT_EQ(after(scene).crumbs, 0u);
}

TEST(Outskirts, StayWhereTheRequestOrTheDeformationAloneSaysSo) {
  BackedThing scene;
  const Seen deformed = after(scene, false);
  EXPECT_EQ(deformed.removed, scene.thing) << "as a preview shows it";
  EXPECT_TRUE(deformed.has_haze);
  scene.request.params.iterations = 0;
  const Seen unrepaired = after(scene);
  EXPECT_EQ(unrepaired.removed, scene.thing);
  EXPECT_TRUE(unrepaired.has_haze);
  scene.request.params.iterations = 10;
  scene.request.crumbs = edit::Crumbs::keep;
  EXPECT_TRUE(after(scene).has_haze);
  expect_untouched(scene);
  scene.request.crumbs = edit::Crumbs::move;
  scene.request.handles[0].target = scene.request.handles[0].source;
  EXPECT_TRUE(after(scene).removed.empty()) << "a drag of no length changes nothing";
}

TEST(Outskirts, OutsideOfTheRegionStay) {
  BackedThing scene;
  scene.request.region = edit::Region{DVec3(0, 0, 0), DVec3(2, 2, 0.1)};
  expect_untouched(scene);
}

TEST(Outskirts, OfWhatIsHeldAnchoredOrNoBodyAreItsInside) {
  BackedThing held;
  held.request.attach = deform::Attach::held;
  expect_untouched(held);
  BackedThing anchored;
  anchored.request.attach = deform::Attach::free;
  anchored.request.handles.push_back({DVec3(-0.3, 0, 0), std::nullopt, 0.1, 0});
  expect_untouched(anchored);
  BackedThing paper;
  paper.request.params.interpolation = edit::Interpolation::paper;
  expect_untouched(paper);
}

TEST(Outskirts, OfAGroupAtRestStay) {
  BackedThing scene;
  const auto first = std::uint32_t(scene.cloud.size());
  edit::add_gaussian(scene.cloud, {-1.2f, 0, 0}, {0.1f, 0.1f, 0.1f}, 4, {0.1f, 0.8f, 0.1f});
  scene.request.selected->push_back(first);
  scene.request.handles = {{DVec3(0.0), DVec3(0.0), 0.3, 0}, {DVec3(-1.2, 0, 0), DVec3(-1.2, 0.6, 0), 0.2, 1}};
  const Seen seen = after(scene);
  EXPECT_EQ(seen.crumbs, 0u);
  EXPECT_FALSE(std::ranges::binary_search(seen.removed, scene.backing));
}

}  // namespace
}  // namespace engine::repair
