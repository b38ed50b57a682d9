#include "engine/repair/relight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/correct/scene_corrector.h"
#include "engine/edit/edit.h"
#include "engine/scene/base_color.h"
#include "tests/engine/edit/drags.h"
#include "tests/engine/repair/shadowed_block.h"

namespace engine::repair {
namespace {

/// The row of the floor next to a place.
std::uint32_t floor_row_at(const ShadowedBlock& scene, DVec3 place) {
  std::uint32_t best = 0;
  for (std::uint32_t row = 0; row < scene.block.floor_rows; ++row)
    if (glm::distance(DVec3(scene.block.cloud.mean.get(row)), place) <
        glm::distance(DVec3(scene.block.cloud.mean.get(best)), place))
      best = row;
  return best;
}

float light_of(const Relit& relit, std::uint32_t row) {
  const auto found = std::ranges::lower_bound(relit.rows, row);
  if (found == relit.rows.end() || *found != row) return 1;
  const Vec3 light = relit.light[std::size_t(found - relit.rows.begin())];
  return (light.x + light.y + light.z) / 3;
}

TEST(RelitRows, AreBrighterWhereTheShadowWas) {
  const ShadowedBlock scene(beside_block);
  const Relit relit = relit_rows(scene.block.cloud, scene.part, scene.shadow(), {});
  EXPECT_NEAR(light_of(relit, floor_row_at(scene, {0.42, 0, 0})), 1 / 0.6f, 0.15f);
  EXPECT_EQ(light_of(relit, floor_row_at(scene, {-0.42, 0, 0})), 1);
  EXPECT_LT(relit.rows.back(), scene.block.floor_rows) << "nothing of the part";
}

TEST(RelitRows, AreDarkerWhereThePartTakesItsShadow) {
  const ShadowedBlock scene(beside_block);
  const DVec3 shift(-0.9, 0, 0.3);
  const auto back = [&](DVec3 point) { return point - shift; };
  const Relit relit = relit_rows(scene.block.cloud, scene.part, scene.shadow(), back);
  EXPECT_NEAR(light_of(relit, floor_row_at(scene, DVec3(0.42, 0, 0) + shift)), 0.6f, 0.06f);
  EXPECT_NEAR(light_of(relit, floor_row_at(scene, {0.42, 0, 0})), 1 / 0.6f, 0.15f);
}

TEST(RelitRows, AreNoneWhereAPartThatIsLiftedArrives) {
  const ShadowedBlock scene(beside_block);
  const DVec3 shift(-0.9, -0.4, 0.3);
  const Relit relit =
      relit_rows(scene.block.cloud, scene.part, scene.shadow(), [&](DVec3 point) { return point - shift; });
  for (const Vec3 light : relit.light) EXPECT_GE(std::min({light.x, light.y, light.z}), 1);
}

TEST(RelitRows, OfAShadowThatIsNoneAreNone) {
  const ShadowedBlock scene([](float, float) { return 1.0f; });
  EXPECT_TRUE(relit_rows(scene.block.cloud, scene.part, scene.shadow(), {}).rows.empty());
}

TEST(Relight, GivesRowsThatStayTheColorsOfTheNewLight) {
  ShadowedBlock scene(beside_block);
  scene.block.cloud.sh_row(7)[1] = 0.25f;
  WorkingScene working = edit::begun(scene.block.cloud, scene.block.request);
  const std::uint32_t held = scene.part.front();
  EXPECT_EQ(relight(working, {{7, held}, {Vec3(2, 1, 0.5f), Vec3(2)}}), 1u) << "what is held stays";
  EXPECT_TRUE(working.check());
  EXPECT_EQ(working.role()[7], working::Role::relit);
  EXPECT_EQ(working.role()[held], working::Role::held);
  EXPECT_EQ(working.member_rows().front(), 7u) << "the optimisation may change it";
  const Vec3 before = scene::base_color(scene.block.cloud, 7), now = scene::base_color(working.cloud(), 7);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(now[c], before[c] * Vec3(2, 1, 0.5f)[c], 1e-6f) << c;
  EXPECT_EQ(working.cloud().sh_row(7)[1], 0.5f) << "what depends on the side is as much brighter";
  EXPECT_EQ(working.cloud().opacity_logit[7], scene.block.cloud.opacity_logit[7]);
  working.give_up(7);
  EXPECT_EQ(working.role()[7], working::Role::original) << "it may be in the way of what is completed";
}

TEST(RelitRows, AreNotThoseThatAreTooLargeOrTooFaint) {
  ShadowedBlock scene(beside_block);
  const Shadow shadow = scene.shadow();
  const std::uint32_t large = floor_row_at(scene, {0.42, 0, 0}), faint = floor_row_at(scene, {0.35, 0, 0.1});
  scene.block.cloud.log_scale.set(large, Vec3(800, 1, 1));  // its extent is no double
  scene.block.cloud.opacity_logit[faint] = -9;
  const Relit relit = relit_rows(scene.block.cloud, scene.part, shadow, {});
  ASSERT_FALSE(relit.rows.empty());
  EXPECT_EQ(light_of(relit, large), 1);
  EXPECT_EQ(light_of(relit, faint), 1);
  for (const Vec3 light : relit.light) EXPECT_TRUE(std::isfinite(light.x + light.y + light.z));
}

/// The block taken away by an edit.
edit::Outcome taken_away(const ShadowedBlock& scene, const edit::Request& request) {
  correct::SceneCorrector corrector;
  auto outcome = edit::run(scene.block.cloud, scene.block.cameras, request, {.corrector = &corrector});
  if (!outcome) ADD_FAILURE() << outcome.error().message << " at " << outcome.error().where;
  return outcome ? std::move(*outcome) : edit::Outcome{};
}
edit::Request removal_of(const ShadowedBlock& scene) {
  edit::Request request = scene.block.request;
  request.selected = scene.part;
  request.region.reset();
  request.mode = edit::Mode::remove;
  request.handles[0].target.reset();
  return request;
}

TEST(Relight, TakesTheShadowOfWhatIsRemovedAway) {
  const ShadowedBlock scene(beside_block);
  edit::Request request = removal_of(scene);
  const std::uint32_t row = floor_row_at(scene, {0.42, 0, 0});
  const edit::Outcome outcome = taken_away(scene, request);
  EXPECT_GT(outcome.report.relit, 10u);
  const auto changed = std::ranges::lower_bound(outcome.overlay.changed, row);
  ASSERT_TRUE(changed != outcome.overlay.changed.end() && *changed == row);
  const std::size_t entry = std::size_t(changed - outcome.overlay.changed.begin());
  EXPECT_NEAR(scene::base_color(outcome.overlay.rows, entry).z, edit::floor_color.z, 0.08f);
}

TEST(Relight, LeavesTheShadowWhereItIsAskedTo) {
  const ShadowedBlock scene(beside_block);
  edit::Request request = removal_of(scene);
  request.shadow = edit::ShadowOfPart::keep;
  const edit::Outcome outcome = taken_away(scene, request);
  EXPECT_EQ(outcome.report.relit, 0u);
  EXPECT_FALSE(std::ranges::binary_search(outcome.overlay.changed, floor_row_at(scene, {0.42, 0, 0})));
}

TEST(Relight, IsOfOnePartThatArrivesAtOnce) {
  const ShadowedBlock scene(beside_block);
  edit::Request request = removal_of(scene);
  request.mode = edit::Mode::move;
  request.handles[0].target = scene.block.middle + DVec3(-0.9, 0, 0);
  request.params.interpolation = edit::Interpolation::arap;
  EXPECT_GT(taken_away(scene, request).report.relit, 10u);
  request.params.intervals = 2;
  EXPECT_EQ(taken_away(scene, request).report.relit, 0u) << "it would be where nothing is yet";
}

TEST(Relight, ChangesNothingOutsideOfTheRegionNorWhatIsHealed) {
  const ShadowedBlock scene(beside_block);
  const std::uint32_t near = floor_row_at(scene, {0.35, 0, 0}), far = floor_row_at(scene, {0.52, 0, 0});
  edit::Request request = removal_of(scene);
  request.healed = {near};
  request.region = edit::Region{scene.block.middle, DVec3(0.9)};  // up to 0.45 on every side
  const edit::Outcome outcome = taken_away(scene, request);
  EXPECT_GT(outcome.report.relit, 0u);
  EXPECT_FALSE(std::ranges::binary_search(outcome.overlay.changed, far));
  EXPECT_TRUE(std::ranges::binary_search(outcome.overlay.removed, near)) << "it was healed";
}

TEST(Relight, IsTheSameForAnyNumberOfThreads) {
  const ShadowedBlock scene(beside_block);
  const auto relit = [&] { return relit_rows(scene.block.cloud, scene.part, scene.shadow(), {}); };
  Relit one, many;
  WorkArena(1).run([&] { one = relit(); });
  WorkArena(3).run([&] { many = relit(); });
  EXPECT_EQ(one.rows, many.rows);
  EXPECT_EQ(one.light, many.light);
}

}  // namespace
}  // namespace engine::repair
