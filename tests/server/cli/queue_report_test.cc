#include "server/cli/queue_report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace server::cli {
namespace {

using nlohmann::json;

edits::QueueLook look() {
  edits::EditAtHand runs{.id = "e000003", .scene = "s000001", .state = "running", .token = "studio"};
  runs.age = 400, runs.expected = 90, runs.worked = 12.3456, runs.finished_intervals = 2;
  runs.deaths = 1, runs.died_at = "interval 2, optimise";
  runs.claim = edits::EditAtHand::Claim{.worker = "host:77", .number = 4, .since = 12, .lease_left = 21};
  edits::EditAtHand waits{.id = "e000004", .scene = "s000002", .state = "queued", .token = ""};
  waits.place = 1, waits.age = 3 * 3600;
  edits::EditAtHand failed{.id = "e000001", .scene = "s000001", .state = "failed", .token = "studio"};
  failed.age = 4 * 24 * 3600, failed.error = "the disk\x1b[31m is full";
  return {{runs, waits, failed}, std::nullopt};
}

TEST(QueueReport, IsATableForPeople) {
  EXPECT_EQ(queue_table(look()),
            "EDIT     SCENE    STATE    PLACE  AGE    TAKES  WORKED  INTERVALS  DEATHS                    TOKEN   "
            "WORKER   ERROR\n"
            "e000003  s000001  running  -      7 min  90 s   12 s    2          1 (interval 2, optimise)  studio  "
            "host:77  -\n"
            "e000004  s000002  queued   1      3 h    -      0 s     0          0                         -       -   "
            "     -\n"
            "e000001  s000001  failed   -      4 d    -      0 s     0          0                         studio  -   "
            "     the disk [31m is full\n");
  EXPECT_EQ(workers_table(look()),
            "WORKER   EDIT     SCENE    SINCE  LEASE  CLAIM  INTERVALS  DEATHS\n"
            "host:77  e000003  s000001  12 s   21 s   4      2          1\n");
  EXPECT_EQ(queue_table({}), "no edit waits or runs\n");
  EXPECT_EQ(workers_table({}), "no worker has an edit\n");
}

TEST(QueueReport, SaysWhenNobodyIsThereAnyMore) {
  edits::QueueLook left = look();
  left.in_use = false;
  EXPECT_NE(workers_table(left).find("no service is at work here"), std::string::npos);
  EXPECT_NE(queue_table(left).find("no service is at work here"), std::string::npos);
  left.in_use = true;
  EXPECT_EQ(workers_table(left).find("no service"), std::string::npos);
  left.edits[0].claim->lease_left = -3;
  EXPECT_NE(workers_table(left).find("over"), std::string::npos);
  left.edits[0].claim->lease_left.reset();
  EXPECT_NE(workers_table(left).find("12 s   -"), std::string::npos);
}

TEST(QueueReport, IsJsonForPrograms) {
  const json queue = json::parse(queue_json(look()));
  EXPECT_TRUE(queue["in_use"].is_null());
  const json& runs = queue["edits"][0];
  EXPECT_EQ(runs["id"], "e000003");
  EXPECT_EQ(runs["worked_seconds"], 12.346);
  EXPECT_EQ(runs["deaths"], 1);
  EXPECT_EQ(runs["claim"], json::parse(R"({"worker":"host:77","number":4,"since_seconds":12.0,"lease_seconds":21.0})"));
  EXPECT_TRUE(runs["place"].is_null());
  EXPECT_EQ(queue["edits"][1]["place"], 1);
  EXPECT_TRUE(queue["edits"][1]["token"].is_null());
  EXPECT_TRUE(queue["edits"][1]["claim"].is_null());
  const json workers = json::parse(workers_json(look()));
  ASSERT_EQ(workers["workers"].size(), 1u);
  EXPECT_EQ(workers["workers"][0]["worker"], "host:77");
  EXPECT_EQ(workers["workers"][0]["edit"], "e000003");
}

TEST(ShortTime, HasOneUnit) {
  EXPECT_EQ(short_time(0.4), "0 s");
  EXPECT_EQ(short_time(119), "119 s");
  EXPECT_EQ(short_time(121), "2 min");
  EXPECT_EQ(short_time(7300), "2 h");
  EXPECT_EQ(short_time(200'000), "2 d");
}

}  // namespace
}  // namespace server::cli
