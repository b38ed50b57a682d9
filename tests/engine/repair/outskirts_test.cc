#include "engine/repair/outskirts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rows.h"
#include "engine/correct/scene_corrector.h"
#include "engine/edit/edit.h"
#include "tests/engine/edit/backed.h"
#include "tests/engine/edit/interrupted.h"

namespace engine::repair {
namespace {

using edit::BackedThing;
using Rows = std::vector<std::uint32_t>;

Outskirts of(const BackedThing& scene, std::span<const std::uint32_t> part, std::span<const scene::Camera> cameras) {
  auto found = outskirts_of(scene.cloud, part, cameras, [](double) { return Result<void>(); });
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

TEST(Outskirts, WhatIsSeenThroughTheOutlineIsAroundIt) {
  BackedThing scene;
  const auto sheet = std::uint32_t(scene.cloud.size());  // of the wall, and much larger than the thing
  edit::add_gaussian(scene.cloud, {0, 0, 0.39f}, {0.9f, 0.9f, 0.01f}, -2, {0.8f, 0.8f, 0.75f});
  const Outskirts found = of(scene);
  const auto is_through = [&](std::uint32_t row) { return std::ranges::binary_search(found.through, row); };
  const auto is_clear = [&](std::uint32_t row) { return std::ranges::binary_search(found.clear, row); };
  for (const std::uint32_t row : found.through) {
    const Vec3 mean = scene.cloud.mean.get(row);
    EXPECT_LT(std::max(std::abs(mean.x), std::abs(mean.y)), 0.8f) << row;
    EXPECT_FALSE(is_clear(row)) << row;
  }
  for (std::uint32_t row = 0; row < scene.cloud.size(); ++row) {
    const Vec3 mean = scene.cloud.mean.get(row);
    // Just beside the thing, whose cameras look at it from 26 degrees on either side; and far from it.
    if (mean.z > 0.3f && std::abs(std::abs(mean.x) - 0.4f) < 0.03f && std::abs(mean.y) < 0.2f && row != sheet) {
      EXPECT_TRUE(is_through(row)) << row;
    }
    if (mean.z > 0.3f && std::abs(std::abs(mean.y) - 0.7f) < 0.05f && std::abs(mean.x) < 0.5f) {
      EXPECT_TRUE(is_clear(row)) << row;
    }
  }
  EXPECT_FALSE(is_through(sheet) || is_clear(sheet));
  for (const std::uint32_t row : scene.thing) EXPECT_FALSE(is_through(row) || is_clear(row)) << row;
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

/// A thing with lines of hairs beside it, seen by 42 cameras, and nothing of it in the wall.
struct Hairs {
  int lines = 0, per_line = 0;
  float extent = 0, logit = 0;
};
BackedThing with(const Hairs& hairs) {
  BackedThing scene;
  for (std::size_t k = 0; scene.cameras.size() < 42; ++k) scene.cameras.push_back(scene::Camera(scene.cameras[k]));
  for (const std::uint32_t row : scene.in_wall) scene.cloud.opacity_logit[row] = -9;
  for (int line = 0; line < hairs.lines; ++line)
    for (int i = 0; i < hairs.per_line; ++i) {
      const Vec3 mean{-0.8f + 1.6f / float(hairs.per_line) * float(i), -0.55f - 0.08f * float(line), 0};
      edit::add_gaussian(scene.cloud, mean, {hairs.extent, 0.02f, hairs.extent}, hairs.logit, {0.9f, 0.2f, 0.1f});
      scene.thing.push_back(std::uint32_t(scene.cloud.size() - 1));
    }
  return scene;
}

TEST(Outskirts, AFringeOfHairsThatAreSeenIsNotBuried) {
  // Each below a pixel in any picture, together more than a tenth of the thing.
  EXPECT_TRUE(of(with({.lines = 4, .per_line = 134, .extent = 0.004f, .logit = -2.2f})).buried.empty());
}

TEST(Outskirts, HairsTooFineForAnyPictureAreNotJudged) {
  EXPECT_TRUE(of(with({.lines = 8, .per_line = 1000, .extent = 0.001f, .logit = -4.5f})).buried.empty());
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
  const auto found = outskirts_of(scene.cloud, scene.thing, scene.cameras, [&](double part) -> Result<void> {
    EXPECT_DOUBLE_EQ(part, double(looks + 1) / double(scene.cameras.size()));
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
  EXPECT_EQ(one.through, many.through);
  EXPECT_EQ(one.clear, many.clear);
}

/// What an edit made of the thing.
struct Seen {
  Rows removed;
  std::size_t crumbs = 0;
  bool has_haze = false;  ///< A new row is as large as those in the wall.
  std::string warning;    ///< That says what of the part goes with it, or does not arrive.
};

Seen after(const BackedThing& scene, bool repaired = true) {
  correct::SceneCorrector corrector;
  const auto outcome =
      edit::run(scene.cloud, scene.cameras, scene.request, {.corrector = repaired ? &corrector : nullptr});
  if (!outcome) {
    ADD_FAILURE() << outcome.error().message << " at " << outcome.error().where;
    return {};
  }
  Seen seen{outcome->overlay.removed, outcome->report.crumbs, false, {}};
  const auto& log_scale = outcome->overlay.rows.log_scale;
  for (std::size_t row = 0; row < log_scale.size(); ++row) seen.has_haze |= log_scale.get(row).x > -2.0f;
  for (const std::string& warning : outcome->report.warnings)
    if (warning.starts_with("what nobody sees")) seen.warning = warning;
  return seen;
}

/// Neither backing nor buried rows were found.
void expect_untouched(const BackedThing& scene) { EXPECT_EQ(after(scene).warning, ""); }

/// They were.
void expect_warning(const Seen& seen, const std::string& backing, const std::string& buried) {
  EXPECT_EQ(seen.warning, "what nobody sees of the part by itself goes: " + backing +
                              " Gaussians of its colour behind it, and " + buried +
                              " of its own that lie in what stays; crumbs \"keep\" keeps them");
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
    EXPECT_FALSE(seen.has_haze) << "what was in the wall does not arrive";
    EXPECT_TRUE(std::ranges::includes(seen.removed, scene.in_wall));
    expect_warning(seen, "1", "2");
  }
}

TEST(Outskirts, AreTheSameAfterAnInterruption) { edit::expect_same_after_an_interruption(BackedThing()); }

TEST(Outskirts, OfWhatIsRemovedGoToo) {
  BackedThing scene;
  scene.request.mode = edit::Mode::remove;
  scene.request.handles[0].target.reset();
  const Seen seen = after(scene);
  EXPECT_TRUE(std::ranges::binary_search(seen.removed, scene.backing));
  EXPECT_TRUE(std::ranges::includes(seen.removed, scene.in_wall));
  expect_warning(seen, "1", "0");
}

TEST(Outskirts, ThatAreHealedGoForThatReason) {
  BackedThing scene;
  scene.request.healed = {scene.backing};
  expect_warning(after(scene), "0", "2");
}

TEST(Outskirts, GoBesideCrumbsThatAreTakenAway) {
  BackedThing scene;
  const auto crumb = std::uint32_t(scene.cloud.size());
  edit::add_gaussian(scene.cloud, {0.33f, 0.33f, 0}, {0.03f, 0.03f, 0.01f}, 0, {0.5f, 0.9f, 0.1f});
  scene.request.crumbs = edit::Crumbs::remove;
  const Seen seen = after(scene);
  EXPECT_TRUE(std::ranges::binary_search(seen.removed, scene.backing));
  EXPECT_EQ(std::ranges::binary_search(seen.removed, crumb), seen.crumbs == 1);
  expect_warning(seen, "1", "2");
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
  scene.request.region->size.z = 0.3;
  expect_warning(after(scene), "1", "0");
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

TEST(Outskirts, OfAGroupAtRestStayAndSoDoesWhatRestsBehindTheOther) {
  BackedThing scene;
  const auto first = std::uint32_t(scene.cloud.size());
  edit::add_gaussian(scene.cloud, {-1.2f, 0, 0}, {0.1f, 0.1f, 0.1f}, 4, {0.1f, 0.8f, 0.1f});
  scene.request.selected->push_back(first);
  scene.request.handles = {{DVec3(0.0), DVec3(0.0), 0.3, 0}, {DVec3(-1.2, 0, 0), DVec3(-1.2, 0.6, 0), 0.2, 1}};
  expect_untouched(scene);

  BackedThing resting;  // what backs it is selected, and its own group, which does not move
  resting.request.selected->push_back(resting.backing);
  resting.request.handles = {{DVec3(0, 0, -0.5), DVec3(0.8, 0, -0.5), 0.3, 0},
                             {DVec3(0.05, 0, 0.65), DVec3(0.05, 0, 0.65), 0.2, 1}};
  const Seen seen = after(resting);
  EXPECT_FALSE(std::ranges::binary_search(seen.removed, resting.backing));
}

}  // namespace
}  // namespace engine::repair
