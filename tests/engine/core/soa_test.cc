#include "engine/core/soa.h"

#include <gtest/gtest.h>

namespace engine {
namespace {

TEST(Array3, IsInterleavedWhollyOrByRows) {
  Array3 points;
  for (const float x : {1.0f, 4.0f, 7.0f}) points.push_back({x, x + 1, x + 2});
  EXPECT_EQ(interleaved(points), (std::vector<float>{1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(interleaved(points, std::vector<std::uint32_t>{2, 0}), (std::vector<float>{7, 8, 9, 1, 2, 3}));
}

}  // namespace
}  // namespace engine
