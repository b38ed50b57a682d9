#include "engine/evaluate/memory_peak.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

namespace engine::evaluate {
namespace {

constexpr std::size_t much = std::size_t{64} << 20;

/// Takes memory and gives it back; the sum keeps it from being optimised away.
unsigned take(std::size_t bytes) {
  std::vector<unsigned char> taken(bytes, 1);
  unsigned sum = 0;
  for (std::size_t i = 0; i < taken.size(); i += 4096) sum += taken[i];
  return sum;
}

class MemoryPeakTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists("/proc/self/clear_refs")) GTEST_SKIP() << "this system does not tell";
  }
};

TEST_F(MemoryPeakTest, SeesWhatWasTakenAndGivenBack) {
  MemoryPeak memory;
  ASSERT_GT(take(much), 0u);
  memory.note();
  EXPECT_GT(memory.bytes(), much / 2);
}

TEST_F(MemoryPeakTest, CountsNothingThatIsForgotten) {
  MemoryPeak memory;
  memory.note();
  ASSERT_GT(take(much), 0u);
  memory.forget();
  memory.note();
  EXPECT_LT(memory.bytes(), much / 2);
}

TEST_F(MemoryPeakTest, KnowsNothingBeforeItIsAsked) { EXPECT_EQ(MemoryPeak().bytes(), 0u); }

}  // namespace
}  // namespace engine::evaluate
