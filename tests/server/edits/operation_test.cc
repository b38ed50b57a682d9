#include "server/edits/operation.h"

#include <gtest/gtest.h>

#include <fstream>

#include "engine/jobs/notes.h"
#include "engine/jobs/queue.h"
#include "engine/jobs/sqlite_store.h"
#include "server/edits/records_database.h"
#include "tests/server/edits/service_support.h"

namespace server::edits {
namespace {

namespace fs = std::filesystem;
namespace jobs = engine::jobs;
using engine::ErrorCode;
using namespace std::chrono_literals;

/// Records as a service leaves them that was killed: an edit in work, one that waits, one that has failed.
class OperationTest : public testing::Test {
 protected:
  OperationTest() {
    const auto store = value(jobs::SqliteStore::open({.folder = edits, .holder = "host:1"}));
    const auto queue = value(jobs::Queue::open(*store, {.folder = edits / "jobs"}));
    const auto submit = [&](const std::string& scene) {
      (void)value(queue->submit({.lane = scene, .payload = "x", .expected = 90s, .requester = "studio"}));
    };
    submit("s000001");
    (void)value(store->claim());
    value(store->apply("e000001", {.event = jobs::Event::finish_interval, .claim = 1, .interval = 2, .worked = 5s}));
    fs::create_directories(edits / "jobs/e000001");
    std::ofstream(edits / "jobs/e000001/checkpoint-2") << "two";
    value(jobs::write_note(edits / "jobs",
                           value(store->apply("e000001", {.event = jobs::Event::fail,
                                                          .claim = 1,
                                                          .error = {ErrorCode::no_space, "the disk is full", ""}}))));
    submit("s000002");
    (void)value(store->claim());
    submit("s000002");
  }

  support::TempDir dir;
  const fs::path edits = dir.path() / "edits";
};

TEST_F(OperationTest, LooksAtWhatIsInWorkAndWhatWaits) {
  const QueueLook look = value(look_at_queue(edits, "", false));
  EXPECT_EQ(look.in_use, false);
  ASSERT_EQ(look.edits.size(), 2u);
  const EditAtHand &runs = look.edits[0], &waits = look.edits[1];
  EXPECT_EQ(runs.id, "e000002");
  EXPECT_EQ(runs.state, "running");
  EXPECT_EQ(runs.token, "studio");
  ASSERT_TRUE(runs.claim);
  EXPECT_EQ(runs.claim->worker, "host:1");
  EXPECT_EQ(runs.claim->number, 1);
  EXPECT_TRUE(runs.claim->since);
  EXPECT_FALSE(runs.claim->lease_left) << "claims of a file do not end";
  EXPECT_EQ(runs.deaths, 0) << "a look is no death";
  EXPECT_EQ(waits.id, "e000003");
  EXPECT_EQ(waits.place, 1);
  EXPECT_EQ(waits.expected, 90.0);
  EXPECT_GE(waits.age, 0.0);
  EXPECT_FALSE(waits.claim);

  const QueueLook with_failed = value(look_at_queue(edits, "", true));
  ASSERT_EQ(with_failed.edits.size(), 3u);
  EXPECT_EQ(with_failed.edits[2].id, "e000001");
  EXPECT_EQ(with_failed.edits[2].error, "the disk is full");
  EXPECT_EQ(with_failed.edits[2].worked, 5.0);
}

TEST_F(OperationTest, TakesUpAgainWhatHasFailed) {
  const EditAtHand edit = value(requeue_edit(edits, "", "e000001"));
  EXPECT_EQ(edit.state, "queued");
  EXPECT_EQ(edit.finished_intervals, 2);
  EXPECT_EQ(value(look_at_queue(edits, "", false)).edits.size(), 3u);
  EXPECT_EQ(value(jobs::read_note(edits / "jobs", "e000001")).state, jobs::JobState::queued);
  EXPECT_EQ(code_of(requeue_edit(edits, "", "e000001")), ErrorCode::conflict) << "it waits";
  EXPECT_EQ(code_of(requeue_edit(edits, "", "e000009")), ErrorCode::not_found);
  const auto store = value(jobs::SqliteStore::open({.folder = edits, .visits = true}));
  EXPECT_TRUE(value(store->find("e000002")).claimed) << "nobody's claim has ended by that";
}

TEST_F(OperationTest, SaysWhereTheRecordsAre) {
  EXPECT_EQ(code_of(look_at_queue(dir.path() / "none", "", false)), ErrorCode::not_found);
  EXPECT_EQ(code_of(look_at_queue(edits, "postgresql://nobody@/none", false)), ErrorCode::not_found);
  std::ofstream(edits / folder_id_name) << std::string(32, '0');
  EXPECT_EQ(code_of(look_at_queue(edits, "", false)), ErrorCode::conflict);
  EXPECT_EQ(code_of(requeue_edit(edits, "", "e000001")), ErrorCode::conflict);
}

class RequeueTest : public ServiceTest {};

TEST_F(RequeueTest, OfAServiceWantsAFailedEditOfASceneThatIsThere) {
  EXPECT_EQ(code_of(service->requeue("e000001")), ErrorCode::not_found);
  const std::string id = submit(move_ball(scene));
  wait_for_end(*service, id);
  EXPECT_EQ(code_of(service->requeue(id)), ErrorCode::conflict) << "it has succeeded";
}

}  // namespace
}  // namespace server::edits
