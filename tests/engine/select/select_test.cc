#include "engine/select/select.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

TEST(Select, ASphereHoldsWhatIsNearerThanItsRadius) {
  EXPECT_EQ(selected(line_of(6), {{Op::add, Sphere{{2, 0, 0}, 1}}}), (RowList{2})) << "1 is not nearer than 1";
  EXPECT_EQ(selected(line_of(6), {{Op::add, Sphere{{2, 0, 0}, 1.001}}}), (RowList{1, 2, 3}));
  EXPECT_EQ(selected(line_of(6), {{Op::add, Sphere{{1e30, 0, 0}, 1e30}}}), (RowList{})) << "its surface is at 0";
}

TEST(Select, ABoxHoldsItsFacesAndTurns) {
  const scene::GaussianCloud cloud = cloud_at({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.5f, 0.5f, 0}, {-1, 0, 0}});
  const Box lying{{0, 0, 0}, {2, 0.5, 0.5}};
  EXPECT_EQ(selected(cloud, {{Op::add, lying}}), (RowList{0, 4}));
  Box turned = lying;
  turned.rotation = {1, 0, 0, 1};  // a quarter turn about z, twice as long as it needs to be
  EXPECT_EQ(selected(cloud, {{Op::add, turned}}), (RowList{1}));
  turned.rotation = DQuat(std::cos(std::acos(-1.0) / 8), 0, 0, std::sin(std::acos(-1.0) / 8));  // an eighth
  EXPECT_EQ(selected(cloud, {{Op::add, turned}}), (RowList{3}));
}

TEST(Select, APlaneHoldsTheSideOfItsNormalAndItself) {
  EXPECT_EQ(selected(line_of(6), {{Op::add, Plane{{3, 7, 7}, {0.1, 0, 0}}}}), (RowList{3, 4, 5}));
  EXPECT_EQ(selected(line_of(6), {{Op::add, Plane{{3, 0, 0}, {-1e38, 0, 0}}}}), (RowList{0, 1, 2, 3}));
}

TEST(Select, RowsByNumber) {
  EXPECT_EQ(selected(line_of(6), {{Op::add, Rows{{{4, 6}, {0, 1}, {4, 5}}}}}), (RowList{0, 4, 5}));
}

TEST(Select, GoesThroughTheOperationsInOrder) {
  const Operation low{Op::add, Rows{{{0, 4}}}}, drop{Op::subtract, Rows{{{2, 3}}}};
  const Operation only{Op::intersect, Rows{{{1, 6}}}}, turn{Op::add, Invert{}};
  EXPECT_EQ(selected(line_of(6), {low, drop, only}), (RowList{1, 3}));
  EXPECT_EQ(selected(line_of(6), {drop, low, only}), (RowList{1, 2, 3})) << "there was nothing to drop";
  EXPECT_EQ(selected(line_of(6), {only, low}), (RowList{0, 1, 2, 3})) << "what nothing and something share is nothing";
  EXPECT_EQ(selected(line_of(6), {low, turn, drop}), (RowList{4, 5}));
  EXPECT_EQ(selected(line_of(6), {low, drop, turn}), (RowList{2, 4, 5}));
  EXPECT_EQ(selected(line_of(6), {turn, turn}), RowList{});
}

TEST(Select, ChangesWhatIsSelectedSoFar) {
  const Operation three{Op::add, Rows{{{3, 4}}}};
  EXPECT_EQ(selected(line_of(8), {three, {Op::add, Expand{2}}}), (RowList{1, 2, 3, 4, 5}));
  EXPECT_EQ(selected(line_of(8), {three, {Op::add, Expand{2}}, {Op::add, Shrink{1}}}), (RowList{2, 3, 4}));
  EXPECT_EQ(selected(line_of(8), {{Op::add, Shrink{1}}, three}), (RowList{3}));
  EXPECT_EQ(selected(line_of(40), {{Op::add, Rows{{{0, 2}, {20, 40}}}}, {Op::add, Largest{1}}}).size(), 20u);
}

TEST(Select, TellsCountBoundsAndCentre) {
  const scene::GaussianCloud cloud = cloud_at({{1, 5, 0}, {9, 9, 9}, {3, -5, 2}});
  const Selected found = select(cloud, {{Op::add, Rows{{{0, 1}, {2, 3}}}}}).value();
  EXPECT_EQ(found.rows, (RowSet{1, 0, 1}));
  EXPECT_EQ(found.count, 2u);
  EXPECT_EQ(found.bounds.low, Vec3(1, -5, 0));
  EXPECT_EQ(found.bounds.high, Vec3(3, 5, 2));
  EXPECT_EQ(found.centre, DVec3(2, 0, 1));
  EXPECT_TRUE(found.warnings.empty());
}

TEST(Select, WarnsOfNothing) {
  const Selected none = select(line_of(3), Selection{}).value();
  EXPECT_EQ(none.count, 0u);
  EXPECT_EQ(none.bounds.high, Vec3(0));
  EXPECT_EQ(none.warnings, (std::vector<Warning>{{"nothing is selected", "selection"}}));
  const Selected missed = select(line_of(3), {{Op::add, Rows{{{0, 1}}}}, {Op::subtract, Sphere{{9, 9, 9}, 1}}}).value();
  EXPECT_EQ(missed.count, 1u);
  EXPECT_EQ(missed.warnings, (std::vector<Warning>{{"the sphere names no Gaussian", "selection[1]"}}));
}

TEST(Select, OfAnEmptySceneIsEmpty) {
  const Selection all{{Op::add, Sphere{{0, 0, 0}, 1}},
                      {Op::add, Polygon{front_camera(), {{0, 0}, {9, 0}, {9, 9}}, Depth::visible}},
                      {Op::add, Grow{{{0, 0, 0}}, {}, {}}},
                      {Op::add, Masks{{{front_camera(), scene::Mask(100, 100)}}}},
                      {Op::add, Expand{1}},
                      {Op::add, Shrink{1}},
                      {Op::add, Largest{1}},
                      {Op::add, Invert{}}};
  EXPECT_TRUE(select({}, all).value().rows.empty());
}

TEST(Select, MasksTakeAlongWhatNoViewShowsButHangsTogether) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {-0.3f, 0, 2}, 20, 0.02f, {0.8f, 0.1f, 0.1f});      // shown
  add_sheet(cloud, {-0.3f, 0, 2.03f}, 16, 0.02f, {0.8f, 0.1f, 0.1f});  // right behind it
  add_sheet(cloud, {0.3f, 0, 2}, 20, 0.02f, {0.1f, 0.1f, 0.8f});       // shown, outside
  add_sheet(cloud, {0.3f, 0, 2.03f}, 16, 0.02f, {0.1f, 0.1f, 0.8f});   // right behind that
  scene::Mask left(100, 100);
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 50; ++x) left.at(x, y) = 1;
  RowList wanted(400 + 256);
  std::iota(wanted.begin(), wanted.end(), std::size_t{0});
  EXPECT_EQ(selected(cloud, {{Op::add, Masks{{{front_camera(), left}}}}}), wanted);
}

TEST(Select, MasksLeaveAWallThatShinesThroughTheThing) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 2}, 20, 0.02f, {0.8f, 0.1f, 0.1f});  // pixels 40 to 60
  for (float& logit : cloud.opacity_logit) logit = 0;          // several on top of each other leave a tenth
  add_sheet(cloud, {0, 0, 2.8f}, 60, 0.02f, {0.7f, 0.7f, 0.6f});
  scene::Mask mask(100, 100);
  for (int y = 40; y < 60; ++y)
    for (int x = 40; x < 60; ++x) mask.at(x, y) = 1;
  RowList thing(400);
  std::iota(thing.begin(), thing.end(), std::size_t{0});
  EXPECT_EQ(selected(cloud, {{Op::add, Masks{{{front_camera(), mask}}}}}), thing);
}

TEST(Select, MasksTakeWhatLiesBehindGlassWhereThereIsNothingElse) {
  scene::GaussianCloud cloud;
  add_at(cloud, {0, 0, 1}, 2.2f, -1.0f);  // wide, far beyond the mask: a tenth of the light gets through
  add_sheet(cloud, {0, 0, 2}, 10, 0.02f, {0.8f, 0.1f, 0.1f});
  scene::Mask mask(100, 100);
  for (int y = 43; y < 57; ++y)
    for (int x = 43; x < 57; ++x) mask.at(x, y) = 1;
  const RowList found = selected(cloud, {{Op::add, Masks{{{front_camera(), mask}}}}});
  EXPECT_GT(found.size(), 80u);
  EXPECT_NE(found.front(), 0u) << "not the glass";
}

TEST(Select, MasksThatReachALittleTooFarEndWhereTheThingDoes) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {-0.2f, 0, 2}, 20, 0.02f, {0.8f, 0.1f, 0.1f});  // pixels 30 to 50
  add_sheet(cloud, {0.2f, 0, 2}, 20, 0.02f, {0.1f, 0.1f, 0.8f});   // pixels 50 to 70
  scene::Mask too_wide(100, 100);
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 52; ++x) too_wide.at(x, y) = 1;
  RowList red(400);
  std::iota(red.begin(), red.end(), std::size_t{0});
  EXPECT_EQ(selected(cloud, {{Op::add, Masks{{{front_camera(), too_wide}}}}}), red);
}

TEST(Select, RefusesAnInvalidListAndABrokenScene) {
  const auto refused = select(line_of(3), {{Op::add, Sphere{{0, 0, 0}, -1}}});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "selection[0].sphere.radius");
  scene::GaussianCloud broken = line_of(3);
  broken.mean.y[1] = std::numeric_limits<float>::quiet_NaN();
  const auto poisoned = select(broken, {{Op::add, Sphere{{0, 0, 0}, 1}}});
  ASSERT_FALSE(poisoned);
  EXPECT_EQ(poisoned.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(poisoned.error().where, "[1].y");
}

/// A cloud before front_camera(), and one of each operation.
scene::GaussianCloud random_cloud(std::size_t n) {
  scene::GaussianCloud cloud;
  Rng rng(3);
  for (std::size_t i = 0; i < n; ++i)
    add_at(cloud, {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(2, 4)}, rng.uniform(-3, 5), rng.uniform(-5, -3),
           {rng.uniform(), rng.uniform(), rng.uniform()});
  return cloud;
}
Selection one_of_each() {
  scene::Mask mask(100, 100);
  for (int y = 20; y < 50; ++y)
    for (int x = 20; x < 70; ++x) mask.at(x, y) = 1;
  return {{Op::add, Sphere{{0, 0, 3}, 0.5}},
          {Op::add, Box{{0.5, 0, 3}, {1, 0.2, 1}, {1, 0.2, 0, 0}}},
          {Op::add, Polygon{front_camera(), {{10, 10}, {60, 20}, {30, 70}}, Depth::visible}},
          {Op::subtract, Stroke{front_camera(), {{10, 60}, {60, 10}}, 5, Depth::through}},
          {Op::add, Grow{{{0.2, 0.2, 2.5}}, {{-0.5, 0, 3}}, {}}},
          {Op::add, Masks{{{front_camera(), mask}}}},
          {Op::intersect, Plane{{0, 0, 2.2}, {0, 0, 1}}},
          {Op::add, Expand{0.05}},
          {Op::add, Shrink{0.02}},
          {Op::add, Largest{3}},
          {Op::subtract, Rows{{{5, 50}}}}};
}

TEST(Select, GivesTheSameBytesForAnyNumberOfThreads) {
  const scene::GaussianCloud cloud = random_cloud(6000);
  Selected one, four;
  WorkArena(1).run([&] { one = select(cloud, one_of_each()).value(); });
  WorkArena(4).run([&] { four = select(cloud, one_of_each()).value(); });
  EXPECT_GT(one.count, 100u);
  EXPECT_LT(one.count, 5900u);
  EXPECT_EQ(one.rows, four.rows);
  EXPECT_EQ(one.centre, four.centre);
  EXPECT_EQ(one.undecided, four.undecided);
}

TEST(Select, GivesTheSameWhateverWasSelectedBefore) {
  const scene::GaussianCloud cloud = random_cloud(6000);
  Selector kept(cloud);
  for (int clicks = 1; clicks < 9; ++clicks) {
    Grow grow{{{0.2, 0.2, 2.5}}, {}, {}};
    for (int i = 1; i < clicks; ++i) grow.outside.emplace_back(0.2 - 0.1 * i, 0.2, 2.6);
    grow.inside.emplace_back(0.25, 0.2, 2.5 + 0.05 * clicks);
    const Selection selection{{Op::add, grow}};
    const Selected found = kept.select(selection).value();
    EXPECT_EQ(found.rows, select(cloud, selection).value().rows) << clicks;
    EXPECT_GT(found.count, 0u);
  }
}

TEST(Select, AWholeThatHasMostOfASceneIsNotCutWhereHalfOfTheRowsEnd) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 40, 0.5f, {0.6f, 0.4f, 0.2f});
  const auto table = std::uint32_t(cloud.size());
  // A bar six long, of more rows than its surroundings have: half of all lie within 1.7 of its middle.
  for (int along = -10; along < 10; ++along)
    add_sheet(cloud, {0.3f * float(along) + 0.15f, 0, 1}, 15, 0.02f, {0.5f, 0.05f, 0.05f});
  Grow bar{{{0.14, 0, 1}}, {}, {}};
  bar.whole = true;
  Selector selector(cloud);
  const auto found = selector.select({{Op::add, bar}});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_EQ(found->count, cloud.size() - table);
  EXPECT_EQ(std::accumulate(found->rows.begin(), found->rows.begin() + table, 0), 0) << "nothing of the table";
  // What is kept of it makes no difference, nor does another question in between.
  bar.wider = -1;
  ASSERT_TRUE(selector.select({{Op::add, bar}}));
  bar.wider = 0;
  EXPECT_EQ(selector.select({{Op::add, bar}})->rows, found->rows);
  EXPECT_EQ(select(cloud, {{Op::add, bar}})->rows, found->rows);
}

/// A red bar six long and 0.3 wide above a table, along x.
struct BarAboveTable {
  scene::GaussianCloud cloud;
  std::size_t table = 0;  ///< Rows of it, which come first.

  BarAboveTable() {
    add_sheet(cloud, {0, 0, 0}, 40, 0.5f, {0.6f, 0.4f, 0.2f});
    table = cloud.size();
    for (int along = -10; along < 10; ++along)
      add_sheet(cloud, {0.3f * float(along) + 0.15f, 0, 1}, 15, 0.02f, {0.5f, 0.05f, 0.05f});
  }
  [[nodiscard]] std::size_t bar() const { return cloud.size() - table; }
  [[nodiscard]] Selected selected(std::vector<DVec3> inside, std::vector<DVec3> outside, bool whole,
                                  int wider = 0) const {
    auto found = select(cloud, {{Op::add, Grow{std::move(inside), std::move(outside), {}, whole, wider}}});
    if (!found) return ADD_FAILURE() << found.error().message, Selected();
    EXPECT_EQ(std::accumulate(found->rows.begin(), found->rows.begin() + std::ptrdiff_t(table), 0), 0)
        << "of the table";
    return *std::move(found);
  }
  [[nodiscard]] std::size_t taken(std::vector<DVec3> inside, std::vector<DVec3> outside, bool whole) const {
    return selected(std::move(inside), std::move(outside), whole).count;
  }
};

constexpr DVec3 on_bar(-2.0, 0, 1), beside_it(-1.7, 0.05, 1), on_table(-2.0, 3, 0), far_end(2.5, 0, 1);

TEST(Select, FurtherClicksTakeNothingFromTheWholeThatTheFirstOneMeans) {
  const BarAboveTable scene;
  ASSERT_EQ(scene.taken({on_bar}, {}, true), scene.bar());
  EXPECT_EQ(scene.taken({on_bar, beside_it}, {}, true), scene.bar()) << "by what they span it would be a piece";
  EXPECT_EQ(scene.taken({on_bar, beside_it}, {on_table}, true), scene.bar());
  EXPECT_EQ(scene.taken({on_bar}, {on_table}, true), scene.bar());
  EXPECT_LT(scene.taken({on_bar, beside_it}, {far_end}, true), scene.bar() * 3 / 4) << "unless they are on it";
}

TEST(Select, WhereTheWholeOfTheFirstClickIsKeptBordersAreCountedFromIt) {
  const BarAboveTable scene;
  for (int wider = -2; wider <= 0; ++wider) {
    const Selected first = scene.selected({on_bar}, {}, true, wider),
                   both = scene.selected({on_bar, beside_it}, {on_table}, true, wider);
    ASSERT_TRUE(first.border && both.border);
    EXPECT_EQ(both.border->wider, first.border->wider) << wider;
    EXPECT_EQ(both.border->more, first.border->more) << wider;
    EXPECT_EQ(both.border->less, first.border->less) << wider;
    for (std::size_t row = 0; row < first.rows.size(); ++row) ASSERT_GE(both.rows[row], first.rows[row]) << wider;
  }
  EXPECT_LT(scene.selected({on_bar, beside_it}, {}, true, -1).count, scene.bar()) << "less is less";
}

TEST(Select, AReachKeepsTheWholeOfTheFirstClickOut) {
  const BarAboveTable scene;
  const auto within = select(scene.cloud, {{Op::add, Grow{{on_bar, beside_it}, {}, 1.0, true, 0}}});
  ASSERT_TRUE(within) << within.error().message;
  EXPECT_LT(within->count, scene.bar() / 2);
}

TEST(Select, SaysWhenPointsInsideAloneTakeMostOfAScene) {
  const BarAboveTable scene;  // 4,500 rows of bar, 1,600 of table
  const Selected most = scene.selected({on_bar}, {}, true);
  ASSERT_EQ(most.warnings.size(), 1u);
  EXPECT_EQ(most.warnings[0].where, "selection[0].grow");
  EXPECT_EQ(most.warnings[0].message,
            "most of the scene is selected: a point outside, on what is not meant, takes less");
  EXPECT_TRUE(scene.selected({on_bar}, {on_table}, true).warnings.empty()) << "who clicked outside knows";
  EXPECT_TRUE(scene.selected({on_bar, beside_it}, {}, false).warnings.empty()) << "less than half";
  const auto rest = select(scene.cloud, {{Op::add, Grow{{on_bar}, {}, {}, true, 0}}, {Op::add, Invert{}}});
  ASSERT_TRUE(rest) << rest.error().message;
  EXPECT_TRUE(rest->warnings.empty()) << "what is meant is what is left";
}

TEST(Select, ClicksThatDoNotMeanTheWholeTakeWhatTheySpan) {
  const BarAboveTable scene;
  EXPECT_LT(scene.taken({on_bar, beside_it}, {}, false), scene.bar() / 2);
}

}  // namespace
}  // namespace engine::select
