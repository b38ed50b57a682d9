#include "server/service/readiness.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "tests/support/data.h"

namespace server::service {
namespace {

using engine::Error;
using engine::ErrorCode;

TEST(Readiness, SaysWhatKeepsTheServiceFromWorking) {
  const support::TempDir temp;
  std::optional<Error> others;
  Readiness ready(temp.path(), [&] { return others; });
  EXPECT_FALSE(ready.trouble());
  others = Error{ErrorCode::corrupt_data, "the job store is damaged", ""};
  EXPECT_EQ(ready.trouble()->message, others->message);
  others.reset();
  ready.end();
  EXPECT_EQ(ready.trouble()->code, ErrorCode::unavailable);
}

TEST(Readiness, IsNotGivenOnAFullDisk) {
  const support::TempDir temp;
  const Readiness full(
      temp.path(), [] { return std::nullopt; }, std::numeric_limits<std::uint64_t>::max());
  ASSERT_TRUE(full.trouble());
  EXPECT_EQ(full.trouble()->code, ErrorCode::no_space);
  EXPECT_NE(full.trouble()->message.find("full"), std::string::npos);
  EXPECT_EQ(full.trouble()->message.find(temp.path().string()), std::string::npos);
  const Readiness gone(temp.path() / "gone", [] { return std::nullopt; });
  EXPECT_EQ(gone.trouble()->code, ErrorCode::unavailable);
}

}  // namespace
}  // namespace server::service
