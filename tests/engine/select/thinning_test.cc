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
  const Thinned all = thin_out(numbers(5), 5), none = thin_out({}, 0);
  EXPECT_EQ(all.kept, numbers(5));
  EXPECT_TRUE(all.others.empty());
  EXPECT_TRUE(none.kept.empty() && none.others.empty());
}

TEST(ThinOut, KeepsSoManyOfThemAndGivesBackTheOthers) {
  Thinned thinned = thin_out(numbers(1000), 300);
  EXPECT_EQ(thinned.kept.size(), 300u);
  EXPECT_TRUE(std::ranges::is_sorted(thinned.kept));
  EXPECT_TRUE(std::ranges::is_sorted(thinned.others));
  thinned.others.insert(thinned.others.end(), thinned.kept.begin(), thinned.kept.end());
  std::ranges::sort(thinned.others);
  EXPECT_EQ(thinned.others, numbers(1000));
}

TEST(ThinOut, KeepsAboutTheSameShareWhereverRowsAreInTheFile) {
  const std::vector<std::uint32_t> kept = thin_out(numbers(100'000), 10'000).kept;
  for (std::uint32_t first = 0; first < 100'000; first += 10'000) {
    const auto there = std::ranges::count_if(kept, [&](auto row) { return row >= first && row < first + 10'000; });
    EXPECT_NEAR(double(there), 1000, 150) << "five standard deviations";
  }
}

TEST(ThinOut, KeepsOfFewerRowsAllThatItKeepsOfMore) {
  std::vector<std::uint32_t> of_many = thin_out(numbers(2000), 200).kept;
  const std::vector<std::uint32_t> of_few = thin_out(numbers(1000), 200).kept;
  std::erase_if(of_many, [](std::uint32_t row) { return row >= 1000; });
  EXPECT_GT(of_many.size(), 50u);
  EXPECT_TRUE(std::ranges::includes(of_few, of_many));
}

}  // namespace
}  // namespace engine::select
