#include "proto/error_code.h"

#include <gtest/gtest.h>

#include <set>

namespace proto {
namespace {

TEST(ErrorCode, EveryCodeHasANameOfItsOwn) {
  std::set<std::string_view> names;
  for (int code = 0; code <= int(engine::ErrorCode::quota_exceeded); ++code)
    names.insert(name_of(engine::ErrorCode(code)));
  EXPECT_EQ(names.size(), std::size_t(engine::ErrorCode::quota_exceeded) + 1);
  EXPECT_EQ(name_of(engine::ErrorCode::no_space), "no_space");
  EXPECT_EQ(name_of(engine::ErrorCode::internal), "internal");
}

}  // namespace
}  // namespace proto
