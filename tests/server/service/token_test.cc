#include "server/service/token.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "tests/server/http/test_server.h"
#include "tests/support/data.h"

namespace server::service {
namespace {

namespace fs = std::filesystem;
using engine::ErrorCode;

class TokenFile : public testing::Test {
 protected:
  engine::Result<std::vector<http::Token>> read(const std::string& text,
                                                fs::perms permissions = fs::perms::owner_read) {
    std::ofstream(file, std::ios::binary) << text;
    fs::permissions(file, permissions | fs::perms::owner_write);
    warning.clear();
    return read_tokens(file, warning);
  }
  /// "LINE: message", of a file that is refused.
  std::string refused(const std::string& text) {
    const auto tokens = read(text);
    if (tokens) return "taken";
    EXPECT_EQ(tokens.error().code, ErrorCode::invalid_argument);
    const std::string& where = tokens.error().where;
    EXPECT_TRUE(where.starts_with(file.string())) << where;
    EXPECT_EQ((where + tokens.error().message).find("s3cr"), std::string::npos) << where << tokens.error().message;
    return where.substr(std::min(file.string().size() + 1, where.size())) + ": " + tokens.error().message;
  }

  support::TempDir folder;
  const fs::path file = folder.path() / "tokens";
  std::string warning;
};

TEST_F(TokenFile, OfOneWordHoldsTheTokenThatMayDoAll) {
  for (const std::string& text : {std::string("  s3cret\r\n"), std::string("#s3cret"), std::string(4096, 'a')}) {
    const auto tokens = read(text).value();
    ASSERT_EQ(tokens.size(), 1u);
    EXPECT_EQ(tokens[0].name, "default");
    EXPECT_TRUE(tokens[0].read && tokens[0].edit && tokens[0].admin);
  }
  EXPECT_EQ(read("  s3cret\r\n").value()[0].secret, "s3cret");
  for (const std::string& text :
       {std::string(), std::string(" \n"), std::string("caf\xc3\xa9"), std::string("a\0b", 3), std::string(5000, 'a'),
        std::string(100'000, 'a'), std::string("# two\n# lines"), std::string("#")}) {
    const auto tokens = read(text);
    ASSERT_FALSE(tokens) << text;
    EXPECT_EQ(tokens.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(tokens.error().where, file.string());
  }
  EXPECT_EQ(read_tokens(folder.path() / "none", warning).error().code, ErrorCode::not_found);
}

TEST_F(TokenFile, HoldsALineForEachToken) {
  const auto tokens = read(
                          "# who       what        secret\r\n"
                          "viewer      read        s3cr-1   # f\xc3\xbcr die T\xc3\xbcr\r\n"
                          "\n"
                          "  studio.1\tread,edit  s3cr-2\n"
                          "#gone       read        s3cr-3\n"
                          "ops         edit,admin  s3cr-4")
                          .value();
  ASSERT_EQ(tokens.size(), 3u);
  EXPECT_EQ(tokens[0].name, "viewer");
  EXPECT_EQ(tokens[0].secret, "s3cr-1");
  EXPECT_TRUE(tokens[0].may(http::Scope::read));
  EXPECT_FALSE(tokens[0].may(http::Scope::edit) || tokens[0].may(http::Scope::admin));
  EXPECT_EQ(tokens[1].name, "studio.1");
  EXPECT_TRUE(tokens[1].may(http::Scope::edit) && tokens[1].may(http::Scope::read));
  EXPECT_FALSE(tokens[1].may(http::Scope::admin));
  EXPECT_TRUE(tokens[2].may(http::Scope::edit) && tokens[2].may(http::Scope::admin));
  EXPECT_TRUE(tokens[2].may(http::Scope::read)) << "who edits also sees";
}

TEST_F(TokenFile, MayGiveATokenQuotas) {
  const auto tokens = read(
                          "a edit 1 edits=4 bytes=2GB seconds=3600 # a day\n"
                          "b edit 2 bytes=512MiB\n"
                          "c edit 3 bytes=17\n")
                          .value();
  EXPECT_EQ(tokens[0].quotas.edits, 4u);
  EXPECT_EQ(tokens[0].quotas.bytes, 2'000'000'000u);
  EXPECT_EQ(tokens[0].quotas.seconds, 3600u);
  EXPECT_EQ(tokens[1].quotas.bytes, 512u << 20);
  EXPECT_FALSE(tokens[1].quotas.edits || tokens[1].quotas.seconds);
  EXPECT_EQ(tokens[2].quotas.bytes, 17u);
}

TEST_F(TokenFile, NamesTheLineThatIsWrongAndNoSecret) {
  const std::string good = "# a comment\nviewer read s3cr-1\n";
  EXPECT_EQ(refused(good + "s3cr-2\n"), "3: expected three words: a name, its scopes, and the secret");
  EXPECT_EQ(refused(good + "other read s3cr-2 edit\n"),
            "3: quotas are such as edits=4, bytes=2GB and seconds=3600, each once (what follows the secret)");
  for (const char* quota :
       {"edits=", "edits", "edits=0", "edits=-1", "edits=1.5", "edits=4x", "bytes=2gb", "bytes=GB",
        "bytes=99999999999TB", "seconds=1h", "seconds=99999999999", "secrets=1", "=", "edits=1 edits=1"})
    EXPECT_TRUE(refused(std::string("other edit s3cr-2 ") + quota).starts_with("1: quotas are")) << quota;
  EXPECT_EQ(refused("other read #s3cr\n"), "1: expected three words: a name, its scopes, and the secret");
  EXPECT_EQ(refused(good + "\nother s3cr-2 read"),
            "4: scopes are read, edit and admin, with commas between several (the second word)");
  for (const char* scopes : {"", ",read", "read,", "read,,edit", "READ", "write"})
    EXPECT_NE(refused(std::string("other ") + scopes + " s3cr-2\n"), "taken") << scopes;
  EXPECT_TRUE(refused(good + "s3cr/2 read other\n").starts_with("3: a name has up to 64 letters"));
  EXPECT_TRUE(refused(std::string(65, 'n') + " read s3cr").starts_with("1: a name has"));
  EXPECT_TRUE(refused("other read s3cr\xc3\xa9").starts_with("1: a secret is"));
  EXPECT_TRUE(refused("other read s3cr" + std::string(4096, 'a')).starts_with("1: a secret is"));
  EXPECT_EQ(refused(good + "viewer edit s3cr-2\n"), "3: it has the name of line 2");
  EXPECT_EQ(refused(good + "other edit s3cr-1\n"), "3: it has the secret of line 2");
  EXPECT_EQ(refused("default read s3cr"), "1: the name is that of the token of a file of one word: choose another");
  std::string many;
  for (int i = 0; i < 257; ++i) many += "n" + std::to_string(i) + " read s3cr" + std::to_string(i) + "\n";
  EXPECT_EQ(refused(many), "257: there may be 256 tokens");
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
