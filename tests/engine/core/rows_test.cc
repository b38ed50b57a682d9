#include "engine/core/rows.h"

#include <gtest/gtest.h>

namespace engine {
namespace {

using RowList = std::vector<std::uint32_t>;

TEST(Rows, AreThoseWhoseValueIsWanted) {
  const std::vector<float> values{0.5f, -1, 2, 0, 3};
  EXPECT_EQ(rows_where(values, [](float value) { return value > 0; }), (RowList{0, 2, 4}));
  EXPECT_EQ(rows_where(std::vector<float>{}, [](float) { return true; }), RowList{});
}

TEST(Rows, AreMarkedByAnyByteButZero) {
  EXPECT_EQ(marked_rows(std::vector<std::uint8_t>{0, 1, 0, 255}), (RowList{1, 3}));
}

}  // namespace
}  // namespace engine
