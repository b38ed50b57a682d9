// Selecting on the demo scene, with the clicks of a person, against the rows that are the thing's. The constants of
// growing were chosen on captured cases, and on the ball, the mug, the apple on a book and the pot; the apple on the
// table is for tests alone.
#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "tests/engine/select/clicks.h"
#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

constexpr std::size_t pot = 3, apple_on_books = 8, apple_on_table = 9, mug = 10, ball = 11;

const procedural::DemoScene& demo() {
  static const procedural::DemoScene scene = procedural::make_demo_scene({.gaussians = 100'000, .views = 5});
  return scene;
}

/// What is left to wish for after two clicks inside, four outside, and so many to correct it.
Agreement after_clicks(std::size_t object, const scene::Camera& camera, int corrections) {
  Grow grow = clicks_on(demo(), object, camera, 4);
  Selector selector(demo().cloud);
  RowSet rows = selector.select({{Op::add, grow}}).value().rows;
  for (int i = 0; i < corrections && correct(demo(), object, camera, rows, grow); ++i)
    rows = selector.select({{Op::add, grow}}).value().rows;
  return agreement(demo(), object, rows);
}

void expect_taken(std::size_t object, const std::string& name, int corrections, double recall, double precision) {
  ASSERT_EQ(demo().object_names[object], name);
  for (const scene::Camera& camera : demo().cameras) {
    const Agreement found = after_clicks(object, camera, corrections);
    EXPECT_GT(found.recall, recall) << camera.name;
    EXPECT_GT(found.precision, precision) << camera.name;
  }
}

TEST(GrowOnTheDemoScene, TakesTheBall) { expect_taken(ball, "ball", 0, 0.98, 0.99); }
TEST(GrowOnTheDemoScene, TakesTheMugWithCorrections) { expect_taken(mug, "mug", 2, 0.95, 0.95); }
TEST(GrowOnTheDemoScene, TakesAnAppleOffABook) { expect_taken(apple_on_books, "apple", 0, 0.98, 0.98); }
TEST(GrowOnTheDemoScene, TakesAnAppleItWasNotMadeFor) { expect_taken(apple_on_table, "apple", 0, 0.97, 0.96); }
TEST(GrowOnTheDemoScene, TakesThePotWithCorrections) { expect_taken(pot, "pot", 10, 0.85, 0.75); }

/// A click in the middle of what a camera shows of the thing.
Grow one_click(std::size_t object, const scene::Camera& camera) {
  Grow grow{{clicks_on(demo(), object, camera, 0).inside.at(0)}, {}, {}};
  grow.whole = true;
  return grow;
}

TEST(GrowOnTheDemoScene, TakesTheWholeOfAThingByOneClick) {
  for (const auto& [object, recall] : {std::pair{ball, 0.95}, {apple_on_table, 0.95}, {mug, 0.84}})
    for (const scene::Camera& camera : demo().cameras) {
      const Agreement found =
          agreement(demo(), object, select(demo().cloud, {{Op::add, one_click(object, camera)}}).value().rows);
      EXPECT_GT(found.recall, recall) << demo().object_names[object] << ", " << camera.name;
      EXPECT_GT(found.precision, 0.93) << demo().object_names[object] << ", " << camera.name;
    }
}

TEST(GrowOnTheDemoScene, TakesMoreOrLessOfAThingByBorders) {
  Selector selector(demo().cloud);
  Grow grow = one_click(ball, demo().cameras[0]);
  std::vector<std::size_t> counts;
  for (grow.wider = -3; grow.wider <= 1; ++grow.wider) {
    const Selected found = selector.select({{Op::add, grow}}).value();
    EXPECT_TRUE(found.warnings.empty()) << grow.wider << ": " << found.warnings.at(0).message;
    EXPECT_EQ(found.border->wider, grow.wider);
    EXPECT_TRUE(found.border->more) << grow.wider;
    counts.push_back(found.count);
  }
  for (std::size_t i = 0; i + 1 < counts.size(); ++i) EXPECT_LT(1.1 * double(counts[i]), double(counts[i + 1])) << i;
  grow.wider = 64;
  const Selected all = selector.select({{Op::add, grow}}).value();
  ASSERT_EQ(all.warnings.size(), 1u);
  EXPECT_EQ(all.warnings[0].where, "selection[0].grow.wider");
  EXPECT_EQ(all.warnings[0].message.find("there is no border farther out than wider = "), 0u);
  EXPECT_EQ(all.border, (WholeBorder{all.border->wider, false, true}));
  grow.wider = all.border->wider;
  EXPECT_TRUE(selector.select({{Op::add, grow}}).value().warnings.empty());
  EXPECT_EQ(selector.select({{Op::add, {Sphere{{0, 0, 0}, 1}}}}).value().border, std::nullopt);
}

TEST(MasksOfTheDemoScene, AreLiftedToTheirThings) {
  for (const std::size_t object : {ball, mug, apple_on_table}) {
    Masks masks;
    for (const scene::Camera& camera : demo().cameras)
      masks.views.push_back({camera, pixels_of(demo(), object, camera)});
    const Agreement found = agreement(demo(), object, select(demo().cloud, {{Op::add, masks}}).value().rows);
    EXPECT_GT(found.recall, 0.95) << demo().object_names[object];
    EXPECT_GT(found.precision, 0.95) << demo().object_names[object];
  }
}

TEST(PolygonsOnTheDemoScene, TakeTheVisibleSideOfTheBallAndNothingBehind) {
  const scene::Camera& camera = demo().cameras[0];
  const scene::Rect box = scene::bounding_box(pixels_of(demo(), ball, camera));
  const DVec2 middle(0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1)), half(0.3 * box.width(), 0.3 * box.height());
  Polygon polygon{camera,
                  {middle - half, middle + DVec2(half.x, -half.y), middle + half, middle + DVec2(-half.x, half.y)},
                  Depth::visible};
  const Agreement visible = agreement(demo(), ball, select(demo().cloud, {{Op::add, polygon}}).value().rows);
  EXPECT_EQ(visible.precision, 1.0);
  EXPECT_GT(visible.recall, 0.1);
  polygon.depth = Depth::through;
  const Agreement through = agreement(demo(), ball, select(demo().cloud, {{Op::add, polygon}}).value().rows);
  EXPECT_LT(through.precision, 0.9) << "what lies behind it, too";
  EXPECT_GT(through.recall, visible.recall);
}

TEST(GrowOnTheDemoScene, GivesTheSameBytesForAnyNumberOfThreads) {
  const Grow grow = clicks_on(demo(), mug, demo().cameras[0], 3);
  RowSet one, four;
  WorkArena(1).run([&] { one = select(demo().cloud, {{Op::add, grow}}).value().rows; });
  WorkArena(4).run([&] { four = select(demo().cloud, {{Op::add, grow}}).value().rows; });
  EXPECT_EQ(one, four);
}

TEST(GrowOnALargeScene, TakesThingsThoughMostRowsAreNoNodes) {
  const procedural::DemoScene large = procedural::make_demo_scene({.gaussians = 1'000'000, .views = 5});
  ASSERT_GT(large.cloud.size(), 9 * max_nodes);
  Selector selector(large.cloud);
  for (const std::size_t object : {apple_on_table, mug, ball})
    for (const bool whole : {false, true}) {
      Grow grow = clicks_on(large, object, large.cameras[0], 4);
      grow.whole = whole;
      const Agreement found = agreement(large, object, selector.select({{Op::add, grow}}).value().rows);
      EXPECT_GT(found.recall, 0.98) << large.object_names[object] << whole;
      EXPECT_GT(found.precision, 0.96) << large.object_names[object] << whole;
    }
}

}  // namespace
}  // namespace engine::select
