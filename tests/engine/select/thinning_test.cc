#include "engine/select/thinning.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

namespace engine::select {
namespace {

std::vector<std::uint32_t> numbers(std::uint32_t n) {
  std::vector<std::uint32_t> out(n);
  std::iota(out.begin(), out.end(), 0u);
  return out;
}

TEST(ThinOut, KeepsAllWhereThereIsRoom) {
  std::vector<std::uint32_t> rows = numbers(5), none;
  EXPECT_TRUE(thin_out(rows, 5).empty());
  EXPECT_EQ(rows, numbers(5));
  EXPECT_TRUE(thin_out(none, 0).empty());
}

TEST(ThinOut, KeepsSoManyOfThemAndGivesBackTheOthers) {
  std::vector<std::uint32_t> rows = numbers(1000);
  std::vector<std::uint32_t> others = thin_out(rows, 300);
  EXPECT_EQ(rows.size(), 300u);
  EXPECT_TRUE(std::ranges::is_sorted(rows));
  EXPECT_TRUE(std::ranges::is_sorted(others));
  others.insert(others.end(), rows.begin(), rows.end());
  std::ranges::sort(others);
  EXPECT_EQ(others, numbers(1000));
}

TEST(ThinOut, KeepsAboutTheSameShareOfEachPlace) {
  std::vector<std::uint32_t> rows = numbers(100'000);
  static_cast<void>(thin_out(rows, 10'000));
  for (std::uint32_t first = 0; first < 100'000; first += 10'000) {
    const auto of_place = std::ranges::count_if(rows, [&](auto row) { return row >= first && row < first + 10'000; });
    EXPECT_NEAR(double(of_place), 1000, 150) << "five standard deviations";
  }
}

TEST(ThinOut, KeepsOfFewerRowsAllThatItKeepsOfMore) {
  std::vector<std::uint32_t> all = numbers(2000), half = numbers(1000);
  static_cast<void>(thin_out(all, 200));
  static_cast<void>(thin_out(half, 200));
  std::erase_if(all, [](std::uint32_t row) { return row >= 1000; });
  EXPECT_FALSE(all.empty());
  EXPECT_TRUE(std::ranges::includes(half, all));
}

}  // namespace
}  // namespace engine::select
