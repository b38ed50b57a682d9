#include "engine/select/spread.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/core/rng.h"
#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

/// A cloud of random means, some of them at the same place, and a random half of it.
struct RandomHalf {
  scene::GaussianCloud cloud;
  RowSet selected;
};
RandomHalf random_half(std::uint64_t seed) {
  RandomHalf out;
  Rng rng(seed);
  for (int i = 0; i < 400; ++i) {
    const bool again = i > 0 && rng.below(10) == 0;
    add_at(out.cloud, again ? out.cloud.mean.get(std::size_t(i) - 1)
                            : Vec3(rng.uniform(), rng.uniform(), rng.uniform()) + Vec3(1000, 0, 0));
    out.selected.push_back(out.cloud.mean.x.back() < 1000.5f);
  }
  return out;
}

bool is_within(const scene::GaussianCloud& cloud, std::size_t row, const RowSet& others, std::uint8_t value,
               double distance) {
  for (std::size_t other = 0; other < others.size(); ++other)
    if (others[other] == value && glm::distance(DVec3(cloud.mean.get(row)), DVec3(cloud.mean.get(other))) <= distance)
      return true;
  return false;
}

TEST(Expanded, TakesRowsWithinTheDistance) {
  const auto [cloud, selected] = random_half(1);
  const RowSet found = expanded(cloud.mean, selected, 0.11);
  std::size_t more = 0;
  for (std::size_t row = 0; row < cloud.size(); ++row) {
    EXPECT_EQ(found[row] != 0, selected[row] != 0 || is_within(cloud, row, selected, 1, 0.11)) << row;
    more += found[row] != selected[row];
  }
  EXPECT_GT(more, 5u);
}

TEST(Shrunk, DropsRowsWithinTheDistance) {
  const auto [cloud, selected] = random_half(2);
  const RowSet found = shrunk(cloud.mean, selected, 0.11);
  std::size_t fewer = 0;
  for (std::size_t row = 0; row < cloud.size(); ++row) {
    EXPECT_EQ(found[row] != 0, selected[row] != 0 && !is_within(cloud, row, selected, 0, 0.11)) << row;
    fewer += found[row] != selected[row];
  }
  EXPECT_GT(fewer, 5u);
}

TEST(ExpandedAndShrunk, HoldTheirEndsAndChangeNothingOfAllOrNone) {
  const scene::GaussianCloud cloud = line_of(6);
  EXPECT_EQ(expanded(cloud.mean, {0, 0, 1, 0, 0, 0}, 1), (RowSet{0, 1, 1, 1, 0, 0})) << "1 is within 1";
  EXPECT_EQ(shrunk(cloud.mean, {1, 1, 1, 1, 0, 0}, 1), (RowSet{1, 1, 1, 0, 0, 0}));
  for (const std::uint8_t value : {0, 1}) {
    const RowSet same(6, value);
    EXPECT_EQ(expanded(cloud.mean, same, 1e38), same);
    EXPECT_EQ(shrunk(cloud.mean, same, 1e38), same);
  }
  EXPECT_EQ(expanded(cloud.mean, {0, 0, 1, 0, 0, 0}, 1e38), RowSet(6, 1));
  EXPECT_EQ(expanded({}, {}, 1), RowSet());
}

TEST(ExpandedAndShrunk, StandMeansAtTheEndOfFloat) {
  const scene::GaussianCloud cloud = cloud_at({{0, 0, 0}, {3e38f, 0, 0}, {-3e38f, 3e38f, 0}, {0.5f, 0, 0}});
  EXPECT_EQ(expanded(cloud.mean, {1, 0, 0, 0}, 1), (RowSet{1, 0, 0, 1}));
  EXPECT_EQ(shrunk(cloud.mean, {1, 1, 1, 0}, 1), (RowSet{0, 1, 1, 0}));
}

TEST(LargestPieces, DropCrumbs) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 10, 0.1f, Vec3(0.5f));    // rows 0 to 99
  add_at(cloud, {0, 0, 0.5f});                          // 100: floats above it
  add_sheet(cloud, {0.9f, 3, 0}, 5, 0.1f, Vec3(0.5f));  // 101 to 125
  add_sheet(cloud, {5, 3, 0}, 5, 0.1f, Vec3(0.5f));     // 126 to 150
  const auto kept = [&](std::size_t n) { return rows_of(largest_pieces(cloud.mean, RowSet(cloud.size(), 1), n)); };
  EXPECT_EQ(kept(1).size(), 100u);
  EXPECT_EQ(kept(1).back(), 99u);
  EXPECT_EQ(kept(2).size(), 125u);
  EXPECT_EQ(kept(2).back(), 125u) << "of equally large ones the first";
  EXPECT_EQ(kept(3).size(), 150u);
  EXPECT_EQ(kept(1000).size(), cloud.size());
}

TEST(LargestPieces, GoByWhatIsSelected) {
  scene::GaussianCloud cloud;
  add_sheet(cloud, {0, 0, 0}, 12, 0.1f, Vec3(0.5f));
  RowSet selected(cloud.size(), 1);
  for (std::size_t row = 0; row < cloud.size(); ++row)
    if (row % 12 >= 3 && row % 12 < 9) selected[row] = 0;  // six columns
  selected[0] = 0;
  const RowSet found = largest_pieces(cloud.mean, selected, 1);
  for (std::size_t row = 0; row < cloud.size(); ++row) EXPECT_EQ(found[row] != 0, row % 12 >= 9) << row;
}

TEST(LargestPieces, OfFewRowsAreThese) {
  const scene::GaussianCloud cloud = line_of(3);
  EXPECT_EQ(largest_pieces(cloud.mean, {0, 0, 0}, 1), (RowSet{0, 0, 0}));
  EXPECT_EQ(largest_pieces(cloud.mean, {0, 1, 0}, 1), (RowSet{0, 1, 0}));
  const scene::GaussianCloud same = cloud_at({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}});
  EXPECT_EQ(largest_pieces(same.mean, {1, 1, 1}, 1), (RowSet{1, 1, 1})) << "all at one place";
}

}  // namespace
}  // namespace engine::select
