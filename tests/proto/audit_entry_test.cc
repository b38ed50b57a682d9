#include "proto/audit_entry.h"

#include <gtest/gtest.h>

namespace proto {
namespace {

constexpr std::chrono::sys_time<std::chrono::milliseconds> time{std::chrono::milliseconds(1'700'000'000'123)};

TEST(AuditEntry, IsOneLineThatSaysWhoDidWhat) {
  AuditEntry entry{.time = time,
                   .request_id = "r1",
                   .token = "studio",
                   .address = "10.0.0.7",
                   .method = "DELETE",
                   .route = "/v1/scenes/{id}",
                   .about = {{"scene", "s000001"}},
                   .status = 204,
                   .refusal = ""};
  EXPECT_EQ(to_json(entry),
            R"({"time":"2023-11-14T22:13:20.123Z","request_id":"r1","token":"studio","address":"10.0.0.7",)"
            R"("method":"DELETE","route":"/v1/scenes/{id}","scene":"s000001","status":204})");
  entry.token.clear();
  entry.refusal = "unauthorized";
  entry.status = 401;
  EXPECT_TRUE(to_json(entry).ends_with(R"("status":401,"refused":"unauthorized"})"));
  EXPECT_NE(to_json(entry).find(R"("token":null)"), std::string::npos);
}

TEST(AuditEntry, BearsWhateverAPathNames) {
  AuditEntry entry;
  entry.about = {{"scene", "a\"b\n\xff"}, {"version", std::string(10'000, 'v')}};
  const std::string line = to_json(entry);
  EXPECT_EQ(line.find('\n'), std::string::npos);
  EXPECT_LT(line.size(), 400u);
  EXPECT_NE(line.find(R"(a\"b\n)"), std::string::npos) << line;
}

TEST(AuditEntry, TellsHowManyAreLacking) {
  EXPECT_EQ(lost_lines_json(time, 3), R"({"time":"2023-11-14T22:13:20.123Z","lost":3})");
}

}  // namespace
}  // namespace proto
