#include "engine/select/neighbourhood.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "tests/engine/select/clicks.h"
#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

/// Rows that growing takes; "where message" of the refusal otherwise.
RowList grown(const scene::GaussianCloud& cloud, const Grow& grow) { return selected(cloud, {{Op::add, grow}}); }
std::string refusal(const scene::GaussianCloud& cloud, const Grow& grow) {
  const auto found = select(cloud, {{Op::add, grow}});
  return found ? "fine" : found.error().where;
}

RowList numbers(std::size_t from, std::size_t to) {
  RowList out;
  for (std::size_t row = from; row < to; ++row) out.push_back(row);
  return out;
}

/// Two sheets of 20 x 20 in one plane, side by side: rows 0 to 399 around (-1, 0, 0), red, and 400 to 799 around
/// (1, 0, 0), of the other colour.
scene::GaussianCloud two_colors(Vec3 other) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {-1, 0, 0}, 20, 0.1f, {0.8f, 0.1f, 0.1f});
  add_sheet(cloud, {1, 0, 0}, 20, 0.1f, other);
  return cloud;
}

TEST(Grow, StopsWhereTheColorChanges) {
  const scene::GaussianCloud cloud = two_colors({0.1f, 0.1f, 0.8f});
  EXPECT_EQ(grown(cloud, {{{-1.2, 0, 0}}, {{0.3, 0, 0}}, {}}), numbers(0, 400)) << "the border is at 0, not halfway";
  EXPECT_EQ(grown(cloud, {{{0.3, 0.1, 0}}, {{-1.2, 0, 0}}, {}}), numbers(400, 800));
}

TEST(Grow, GoesHalfwayWhereNothingChanges) {
  const RowList rows = grown(two_colors({0.8f, 0.1f, 0.1f}), {{{-1, 0, 0}}, {{1, 0, 0}}, {}});
  EXPECT_GT(rows.size(), 350u);
  EXPECT_LT(rows.size(), 450u);
}

TEST(Grow, StopsAtAnEdge) {
  // A sheet, and another one of the same colour that rises from its rim.
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 20, 0.1f, Vec3(0.5f));
  add_sheet(cloud, {0, 0, 0}, 20, 0.1f, Vec3(0.5f));
  for (std::size_t row = 400; row < 800; ++row) {
    const Vec3 flat = cloud.mean.get(row);
    cloud.mean.set(row, {1.0f, flat.y, flat.x + 1});  // turned about y
    cloud.rotation.set(row, {1, 0, 1, 0});            // with its normal, by a quarter turn
  }
  EXPECT_EQ(grown(cloud, {{{-0.5, 0, 0}}, {{1.0, 0, 0.4}}, {}}), numbers(0, 400));
}

TEST(Grow, TakesAThingThatStandsAloneWithoutOutsidePoints) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 20, 0.1f, Vec3(0.5f));
  add_sheet(cloud, {4, 0, 0}, 30, 0.1f, Vec3(0.5f));
  EXPECT_EQ(grown(cloud, {{{-0.5, 0, 0}, {0.5, 0, 0}}, {}, {}}), numbers(0, 400));
}

TEST(Grow, DoesNotTakeWhatLiesAtTheReach) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 60, 0.1f, Vec3(0.5f));
  const RowList rows = grown(cloud, {{{0, 0, 0}}, {}, 2.0});
  EXPECT_FALSE(rows.empty());
  for (const std::size_t row : rows) EXPECT_LT(glm::length(cloud.mean.get(row)), 1.9f);
}

TEST(Grow, TakesSeveralPiecesThatAreClickedOn) {
  scene::GaussianCloud cloud;
  for (const float x : {0.0f, 2.0f, 4.0f}) add_sheet(cloud, {x, 0, 0}, 10, 0.1f, Vec3(0.5f));
  EXPECT_EQ(grown(cloud, {{{0, 0, 0}, {2, 0, 0}}, {}, {}}), numbers(0, 200));
  EXPECT_EQ(grown(cloud, {{{0, 0, 0}}, {{4, 0, 0}}, {}}), numbers(0, 100));
}

TEST(Grow, ClicksAtOnePlaceSayNothingOfHowLargeAThingIs) {
  const scene::GaussianCloud cloud = two_colors({0.1f, 0.1f, 0.8f});
  const DVec3 click(-1.2, 0.3, 0);
  EXPECT_EQ(grown(cloud, {{click, click}, {}, 5.0}), grown(cloud, {{click}, {}, 5.0}));
}

TEST(Grow, TakesAllWhereNothingElseIs) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 20, 0.1f, Vec3(0.5f));
  EXPECT_EQ(grown(cloud, {{{-0.2, 0, 0}, {0.2, 0, 0}}, {}, 20.0}), numbers(0, 400));
}

TEST(Grow, StandsRowsAtOnePlaceAndFewRows) {
  scene::GaussianCloud same;
  for (int i = 0; i < 50; ++i) add_at(same, {1, 2, 3});
  EXPECT_FALSE(grown(same, {{{1, 2, 3}}, {}, {}}).empty());
  EXPECT_EQ(grown(line_of(1), {{{0, 0, 0}}, {}, {}}), (RowList{0}));
  EXPECT_EQ(grown(line_of(2), {{{0, 0, 0}}, {{1, 0, 0}}, {}}), (RowList{0}));
  EXPECT_EQ(grown(line_of(1), {{{0, 0, 0}}, {{1e-300, 0, 0}}, 1e-300}), (RowList{0}));
}

TEST(Grow, StandsPlacesFarAway) {
  scene::GaussianCloud cloud = line_of(20);
  cloud.mean.x[19] = 1.05e38f;
  EXPECT_EQ(grown(cloud, {{{9.9e37, 0, 0}}, {{9e37, 0, 0}}, 1e37}), (RowList{19}));
  EXPECT_EQ(grown(cloud, {{{1e30, 0, 0}}, {}, 1e35}).empty(), false) << "a click into nothing is on what is nearest";
}

TEST(Grow, NamesThePointThatCannotBe) {
  const scene::GaussianCloud cloud = two_colors({0, 0, 1});
  EXPECT_EQ(refusal(cloud, {{{0, 50, 0}}, {}, 1.0}), "selection[0].grow.inside[0]") << "nothing is there";
  EXPECT_EQ(refusal(cloud, {{{-1, 0, 0}, {1, 0, 0}}, {}, 0.5}), "selection[0].grow.inside[1]") << "beyond the reach";
  EXPECT_EQ(refusal(cloud, {{{-1, 0, 0}, {1e30, 0, 0}}, {}, 0.5}), "selection[0].grow.inside[1]");
  EXPECT_EQ(refusal(cloud, {{{-1, 0, 0}}, {{1e30, -1e30, 0}}, {}}), "fine");
  EXPECT_EQ(refusal(cloud, {{{-1, 0, 0.5}}, {{-1, 0, 0}}, {}}), "selection[0].grow.inside[0]")
      << "all rows around it are nearer to the outside point";
}

TEST(SurroundingsOf, AreThoseOfThePoints) {
  const Array3 mean = line_of(9).mean;
  const auto reach = [&](const Grow& grow) { return surroundings_of(mean, grow).reach; };
  EXPECT_EQ(reach({{{0, 0, 0}}, {}, 0.7}), 0.7);
  EXPECT_EQ(reach({{{0, 0, 0}, {1, 0, 0}}, {}, {}}), 4.0);
  EXPECT_NEAR(reach({{{0, 0, 0}, {1.1, 0, 0}}, {}, {}}), 4 * std::sqrt(2.0), 1e-12) << "the next step";
  EXPECT_EQ(reach({{{0, 0, 0}, {0.5, 0, 0}}, {{9, 0, 0}, {0, 1, 0}}, {}}), 4.0) << "the nearer outside point";
  EXPECT_EQ(reach({{{0, 0, 0}}, {}, {}}), 1.0) << "a quarter of 4: half of the rows are nearer";
}

TEST(SurroundingsOf, StayWhileAUserClicksOn) {
  const Array3 mean = line_of(9).mean;
  Grow grow{{{0, 0, 0}, {0.9, 0, 0}}, {{0, 1, 0}}, {}};
  const Surroundings first = surroundings_of(mean, grow);
  grow.inside.push_back({0, 0.5, 0});
  grow.outside.push_back({0.99, 0, 0});
  EXPECT_EQ(surroundings_of(mean, grow), first);
}

TEST(Grow, TakesABallFromTwoClicks) {
  // Of the demo scene, coarse. The slow tests have more.
  const procedural::DemoScene demo = procedural::make_demo_scene({.gaussians = 12'000, .views = 3});
  const std::size_t ball = demo.object_names.size() - 1;
  ASSERT_EQ(demo.object_names[ball], "ball");
  const Grow clicks = clicks_on(demo, ball, demo.cameras[0], 4);
  ASSERT_EQ(clicks.inside.size(), 2u);
  const Agreement found = agreement(demo, ball, select(demo.cloud, {{Op::add, clicks}}).value().rows);
  EXPECT_GT(found.recall, 0.93);
  EXPECT_GT(found.precision, 0.99);
}

/// A click, and how it is meant.
Grow meant(DVec3 click, bool whole, int wider) {
  Grow grow;
  grow.inside = {click}, grow.whole = whole, grow.wider = wider;
  return grow;
}

TEST(Grow, AnOutsideClickOnWhatIsTakenTakesNoMore) {
  const procedural::DemoScene demo = procedural::make_demo_scene({.gaussians = 6'000, .views = 3});
  Selector selector(demo.cloud);
  std::size_t asked = 0, more = 0, less = 0;
  for (std::size_t object = 0; object < demo.object_names.size(); ++object) {
    const DVec3 inside = clicks_on(demo, object, demo.cameras[0], 0).inside.at(0);
    for (Grow clicks : {meant(inside, false, 0), meant(inside, true, 0), meant(inside, true, 1)}) {
      const RowList rows = rows_of(selector.select({{Op::add, clicks}}).value().rows);
      for (std::size_t k = 0; k < rows.size(); k += rows.size() / 3 + 1) {
        clicks.outside = {DVec3(demo.cloud.mean.get(rows[k]))};
        const auto found = selector.select({{Op::add, clicks}});
        if (!found) continue;  // nearer to the inside point than that point itself
        const RowList then = rows_of(found->rows);
        ++asked, more += then.size() > rows.size(), less += then.size() < rows.size();
        clicks.outside.push_back(DVec3(demo.cloud.mean.get(rows.back())));
        if (const auto twice = selector.select({{Op::add, clicks}})) more += rows_of(twice->rows).size() > rows.size();
      }
    }
  }
  EXPECT_GT(asked, 80u);
  EXPECT_EQ(more, 0u);
  EXPECT_GT(less, asked / 2);
}

TEST(Grow, AnOutsideClickOnWhatTwoClicksHaveTakenTakesNoMore) {
  const procedural::DemoScene demo = procedural::make_demo_scene({.gaussians = 6'000, .views = 3});
  Selector selector(demo.cloud);
  std::size_t asked = 0, more = 0;
  for (std::size_t object = 0; object < demo.object_names.size(); ++object)
    for (Grow clicks : {meant(clicks_on(demo, object, demo.cameras[0], 0).inside.at(0), false, 0),
                        meant(clicks_on(demo, object, demo.cameras[0], 0).inside.at(0), true, 0)}) {
      const RowList by_one = rows_of(selector.select({{Op::add, clicks}}).value().rows);
      clicks.inside.emplace_back(demo.cloud.mean.get(by_one[by_one.size() / 2]));
      const auto by_two = selector.select({{Op::add, clicks}});
      if (!by_two) continue;  // too far from each other
      const RowList rows = rows_of(by_two->rows);
      for (std::size_t k = 0; k < rows.size(); k += rows.size() / 5 + 1) {
        clicks.outside = {DVec3(demo.cloud.mean.get(rows[k]))};
        const auto found = selector.select({{Op::add, clicks}});
        if (!found) continue;  // nearer to an inside point than that point itself
        ++asked, more += rows_of(found->rows).size() > rows.size();
      }
    }
  EXPECT_GT(asked, 80u);
  EXPECT_EQ(more, 0u);
}

TEST(Settle, GivesEachRowToTheSideThatItHangsTogetherWith) {
  scene::GaussianCloud cloud = two_colors({0.1f, 0.1f, 0.8f});
  add_sheet(cloud, {0, 0, 50}, 5, 0.1f, {0.8f, 0.1f, 0.1f});  // joined to nothing
  std::vector<Given> of_row(cloud.size(), Given::no);
  for (std::size_t row = 0; row < 800; ++row)
    if (cloud.mean.x[row] < -1.8f)
      of_row[row] = Given::inside;
    else if (cloud.mean.x[row] > 1.8f)
      of_row[row] = Given::outside;
  const Neighbourhood around(cloud, {{0, 0, 0}, 100.0});
  const std::vector<std::uint32_t> rows = around.settle(of_row);
  EXPECT_EQ(RowList(rows.begin(), rows.end()), numbers(0, 400));
}

TEST(Settle, LeavesWhatIsGiven) {
  const scene::GaussianCloud cloud = line_of(6);
  const Neighbourhood around(cloud, {{0, 0, 0}, 100.0});
  const std::vector<Given> of_row{Given::outside, Given::inside,  Given::outside,
                                  Given::outside, Given::outside, Given::outside};
  EXPECT_EQ(around.settle(of_row), (std::vector<std::uint32_t>{1}));
}

TEST(Settle, TakesWhatIsInclinedToUnlessItIsNearlyAllOutside) {
  const scene::GaussianCloud cloud = line_of(11);  // between its ends a walk ends at either by how near it is
  const Neighbourhood around(cloud, {{5, 0, 0}, 100.0});
  std::vector<Given> of_row(11, Given::no);
  of_row.front() = Given::inside, of_row.back() = Given::outside;
  const std::vector<std::uint32_t> rather = around.settle(of_row);
  const std::vector<std::uint32_t> inclined = around.settle(of_row, std::vector<std::uint8_t>(11, 1));
  EXPECT_TRUE(std::ranges::includes(inclined, rather));
  EXPECT_GE(inclined.size(), rather.size() + 2);
  EXPECT_LT(inclined.back(), 10u) << "what is given stays";
  EXPECT_EQ(around.settle(of_row, std::vector<std::uint8_t>(11, 0)), rather);
}

/// A red and a blue sheet of 2,500 rows each, of which a fifth are nodes.
struct ThinnedSheets {
  static constexpr std::size_t nodes = 1000, rows = 5000;
  scene::GaussianCloud cloud;
  Neighbourhood around;

  ThinnedSheets() : cloud(sheets()), around(cloud, {{-1.2, 0, 0}, 100.0}, nodes) {}

  static scene::GaussianCloud sheets() {
    scene::GaussianCloud out;
    add_sheet(out, {-1, 0, 0}, 50, 0.04f, {0.8f, 0.1f, 0.1f});
    add_sheet(out, {1, 0, 0}, 50, 0.04f, {0.1f, 0.1f, 0.8f});
    return out;
  }
  /// How many of the red rows these are, less those that are not red.
  [[nodiscard]] static long red(std::span<const std::uint32_t> found) {
    const auto blue = std::ranges::count_if(found, [](std::uint32_t row) { return row >= rows / 2; });
    return long(found.size()) - 2 * blue;
  }
};

TEST(GrowAmongThinnedRows, HasNoMoreNodesThanItMayAndLooksAtAll) {
  const ThinnedSheets scene;
  EXPECT_EQ(scene.around.nodes(), ThinnedSheets::nodes);
  EXPECT_EQ(scene.around.size(), ThinnedSheets::rows);
}

TEST(GrowAmongThinnedRows, TakesRowsThatAreNoNodesAlong) {
  const ThinnedSheets scene;
  const Grown found = scene.around.grow(scene.cloud, {{{-1.2, 0, 0}}, {{0.9, 0, 0}}, 100.0}).value();
  EXPECT_GT(ThinnedSheets::red(found.rows), 2400) << "but for a few at the border";
  EXPECT_TRUE(std::ranges::is_sorted(found.rows));
}

TEST(GrowAmongThinnedRows, IsTheSameForAnyNumberOfThreads) {
  const auto found = [] {
    const ThinnedSheets scene;
    return scene.around.grow(scene.cloud, {{{-1.2, 0, 0}}, {{0.9, 0, 0}}, 100.0}).value().rows;
  };
  std::vector<std::uint32_t> one, four;
  WorkArena(1).run([&] { one = found(); });
  WorkArena(4).run([&] { four = found(); });
  EXPECT_EQ(one, four);
}

TEST(GrowAmongThinnedRows, BeyondKeepsJustWhatWasThereWhereNoBorderIsWanted) {
  const ThinnedSheets scene;
  const Grow click{{{-1.2, 0, 0}}, {{0.9, 0, 0}}, 100.0};
  std::vector<std::uint32_t> rows;
  for (std::uint32_t row = 0; row < ThinnedSheets::rows / 2; row += 2) rows.push_back(row);  // every other red one
  EXPECT_EQ(scene.around.grow_beyond(scene.cloud, click, rows, 0).value().rows, rows);
}

TEST(GrowAmongThinnedRows, AClickOnWhatWasTakenLeavesAPartOfItAndNothingElse) {
  const ThinnedSheets scene;
  std::vector<std::uint32_t> all(ThinnedSheets::rows);
  std::iota(all.begin(), all.end(), 0u);
  std::erase_if(all, [](std::uint32_t row) { return row % 10 == 0; });
  const auto left = scene.around.left_of(scene.cloud, {{{-1.2, 0, 0}}, {{0.9, 0, 0}}, 100.0}, all).value();
  EXPECT_GT(ThinnedSheets::red(left), 2000) << "of 2,250";
  EXPECT_TRUE(std::ranges::includes(all, left));
}

TEST(GrowAmongThinnedRows, LeavesOutWhatNoNodeIsNear) {
  scene::GaussianCloud cloud = ThinnedSheets::sheets();
  add_at(cloud, {-1.2f, 0, 3});  // floats before the middle of the red sheet: no node, at a distance of some 50 rows
  const Neighbourhood around(cloud, {{-1.2, 0, 0}, 100.0}, 100);
  const Grown found = around.grow(cloud, {{{-1.2, 0, 0}}, {{0.9, 0, 0}}, 100.0}).value();
  EXPECT_GT(found.rows.size(), 2000u);
  EXPECT_FALSE(std::ranges::binary_search(found.rows, std::uint32_t(ThinnedSheets::rows)));
}

TEST(SettleAmongThinnedRows, LeavesWhatIsGivenAndTakesTheOthersWithTheirNodes) {
  const ThinnedSheets scene;
  std::vector<Given> given(ThinnedSheets::rows, Given::no);
  for (std::uint32_t row = 0; row < ThinnedSheets::rows; row += 3)
    given[row] = row % 2 == 0 ? (row < ThinnedSheets::rows / 2 ? Given::inside : Given::outside) : Given::no;
  given[1] = Given::outside, given[ThinnedSheets::rows - 2] = Given::inside;  // against all around, and nodes or not
  const std::vector<std::uint32_t> rows = scene.around.settle(given);
  EXPECT_GT(ThinnedSheets::red(rows), 2400);
  for (std::uint32_t row = 0; row < ThinnedSheets::rows; ++row) {
    const bool is_inside = std::ranges::binary_search(rows, row);
    EXPECT_TRUE(given[row] == Given::no || is_inside == (given[row] == Given::inside)) << row;
  }
}

TEST(Grow, TakesAllOfARaggedSheetWhereNothingElseIs) {
  scene::GaussianCloud cloud;
  Rng rng(5);
  for (int row = 0; row < 30'000; ++row) {
    const float x = rng.uniform(-1, 1), y = rng.uniform(-1, 1);
    add_at(cloud, {x, y, 0}, 4, -5);
  }
  EXPECT_EQ(grown(cloud, {{{0.2, 0.1, 0}}, {}, 20.0}).size(), cloud.size()) << "all is as near to the click";
}

TEST(SurroundingsOfClicks, OfTwoClicksAtNearlyOnePlaceAreThoseOfOne) {
  const scene::GaussianCloud cloud = line_of(101);
  const Surroundings one = surroundings_of(cloud.mean, {{{50, 0, 0}}, {}, {}});
  EXPECT_EQ(surroundings_of(cloud.mean, {{{50, 0, 0}, {50.001, 0, 0}}, {}, {}}), one);
  EXPECT_EQ(surroundings_of(cloud.mean, {{{50, 0, 0}}, {{50.5, 0, 0}}, {}}), one);
  EXPECT_GT(surroundings_of(cloud.mean, {{{50, 0, 0}, {60, 0, 0}}, {}, {}}).reach, one.reach);
}

TEST(SurroundingsOfRows, HoldNearlyAllOfThemAndALittleMore) {
  const scene::GaussianCloud cloud = line_of(101);
  std::vector<std::uint8_t> rows(101, 0);
  for (std::size_t row = 0; row < 51; ++row) rows[row] = 1;
  const auto around = surroundings_of(cloud.mean, rows);
  ASSERT_TRUE(around);
  EXPECT_EQ(around->middle, DVec3(25, 0, 0));
  EXPECT_GT(around->reach, 1.4 * 24);
  EXPECT_LT(around->reach, 2.2 * 25);
}

TEST(SurroundingsOfRows, AreNoneOfNoRowAndOfASinglePlace) {
  const scene::GaussianCloud cloud = cloud_at({{1, 2, 3}, {1, 2, 3}});
  EXPECT_FALSE(surroundings_of(cloud.mean, std::vector<std::uint8_t>{0, 0}));
  EXPECT_FALSE(surroundings_of(cloud.mean, std::vector<std::uint8_t>{1, 1}));
}

}  // namespace
}  // namespace engine::select
