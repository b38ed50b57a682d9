#include "server/service/token.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/server/http/test_server.h"
#include "tests/support/data.h"

namespace server::service {
namespace {

namespace fs = std::filesystem;
using engine::ErrorCode;

class TokenFile : public testing::Test {
 protected:
  engine::Result<std::string> read(const std::string& text, fs::perms permissions = fs::perms::owner_read) {
    std::ofstream(folder.path() / "token", std::ios::binary) << text;
    fs::permissions(folder.path() / "token", permissions | fs::perms::owner_write);
    warning.clear();
    return read_token(folder.path() / "token", warning);
  }

  support::TempDir folder;
  std::string warning;
};

TEST_F(TokenFile, HoldsOneWord) {
  EXPECT_EQ(read("  s3cret\r\n").value(), "s3cret");
  for (const std::string& text :
       {std::string(), std::string(" \n"), std::string("two words"), std::string("line\nline"),
        std::string("caf\xc3\xa9"), std::string("a\0b", 3), std::string(5000, 'a')}) {
    const auto token = read(text);
    ASSERT_FALSE(token) << text;
    EXPECT_EQ(token.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(token.error().where, (folder.path() / "token").string());
  }
  EXPECT_EQ(read_token(folder.path() / "none", warning).error().code, ErrorCode::not_found);
}

TEST_F(TokenFile, IsNobodyElsesBusiness) {
  ASSERT_TRUE(read("s3cret"));
  EXPECT_EQ(warning, "");
  ASSERT_TRUE(read("s3cret", fs::perms::others_read));
  EXPECT_NE(warning.find("chmod 600"), std::string::npos);
  EXPECT_EQ(warning.find("s3cret"), std::string::npos);
}

TEST(IsLoopback, KnowsTheMachineItself) {
  for (const char* host : {"localhost", "127.0.0.1", "127.9.9.9", "::1", "[::1]"})
    EXPECT_TRUE(is_loopback(host)) << host;
  for (const char* host : {"0.0.0.0", "::", "192.168.1.2", "example.org", ""}) EXPECT_FALSE(is_loopback(host)) << host;
}

}  // namespace
}  // namespace server::service
