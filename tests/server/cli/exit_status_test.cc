#include "server/cli/exit_status.h"

#include <gtest/gtest.h>

#include <set>

namespace server::cli {
namespace {

using engine::ErrorCode;

TEST(ExitStatus, DiffersForEveryErrorCodeAndIsInTheHelp) {
  std::set<int> seen;
  for (int code = 0; code <= int(ErrorCode::quota_exceeded); ++code) {
    const int status = exit_status(ErrorCode(code));
    EXPECT_GT(status, 0);
    EXPECT_LT(status, 126) << "from 126 on the shell has meanings of its own";
    EXPECT_TRUE(seen.insert(status).second) << status;
    EXPECT_NE(exit_status_help().find(" " + std::to_string(status) + "  "), std::string::npos) << status;
  }
  EXPECT_EQ(exit_status(ErrorCode::invalid_argument), 2);
}

TEST(ErrorLine, HoldsMessageAndPlaceOnOneLine) {
  EXPECT_EQ(error_line({ErrorCode::internal, "no such thing", "a.ply:header"}), "error: no such thing (a.ply:header)");
  EXPECT_EQ(error_line({ErrorCode::internal, "no such thing", ""}), "error: no such thing");
  EXPECT_EQ(error_line({ErrorCode::internal, "no\nsuch\x1b[31m", "x\ry"}), "error: no such [31m (x y)");
}

}  // namespace
}  // namespace server::cli
