#include "server/edits/operation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
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

/// Fails at its second call, as long as it is broken.
class Brittle final : public engine::optim::PerceptualLoss {
 public:
  engine::Result<double> evaluate(const engine::scene::Image& rendered, const engine::scene::Image&,
                                  engine::scene::Image& v_rendered) override {
    if (++calls == 2 && broken) return engine::fail(ErrorCode::unavailable, "there is no model");
    v_rendered = engine::scene::Image(rendered.width, rendered.height, rendered.channels, 0.0f);
    return 0.0;
  }
  std::atomic<bool> broken = true;
  std::atomic<int> calls = 0;
};

class RequeueTest : public ServiceTest {
 protected:
  void SetUp() override {
    service.reset();
    service = value(EditService::open(
        *store, {.folder = dir.path() / "edits", .pictured_views = 1, .threads = 1, .perceptual = &brittle}));
  }
  void TearDown() override { service.reset(); }
  static proto::EditRequest request_of(const std::string& scene, int version = 0) {
    proto::EditRequest request = move_ball(scene, 3);
    request.version = version;
    if (version > 0) request.handles[0].source = {0.5, 0, 0}, request.handles[0].target = proto::Point{0.9, 0, 0};
    request.params.iterations = 1;
    return request;
  }
  /// Once its first interval is finished.
  std::string failed(int version = 0) {
    brittle.broken = true;
    brittle.calls = 0;
    std::string id = submit(request_of(scene, version));
    const auto status = wait_for_end(*service, id);
    EXPECT_EQ(status.state, "failed");
    EXPECT_EQ(status.finished_intervals.size(), 1u);
    brittle.broken = false;
    return id;
  }
  proto::EditStatus done(const std::string& id) {
    auto status = wait_for_end(*service, id);
    EXPECT_EQ(status.state, "succeeded");
    EXPECT_EQ(status.finished_intervals.size(), 3u);
    return status;
  }
  static bool began_anew(const proto::EditStatus& status) {
    return std::ranges::any_of(status.warnings,
                               [](const auto& warning) { return warning.find("began anew") != std::string::npos; });
  }
  Brittle brittle;
};

TEST_F(RequeueTest, OfAServiceWantsAFailedEditOfAVersionThatIsThere) {
  EXPECT_EQ(code_of(service->requeue("e000001")), ErrorCode::not_found);
  brittle.broken = false;
  const std::string good = submit(request_of(scene));
  ASSERT_EQ(done(good).result_version, 1);
  EXPECT_EQ(code_of(service->requeue(good)), ErrorCode::conflict) << "it has succeeded";

  const std::string id = failed(1);
  value(service->remove_version(scene, "1"));
  auto refused = service->requeue(id);
  ASSERT_EQ(code_of(refused), ErrorCode::not_found);
  EXPECT_EQ(refused.error().where, "version");
  value(service->remove_scene(scene));
  refused = service->requeue(id);
  ASSERT_EQ(code_of(refused), ErrorCode::not_found);
  EXPECT_EQ(refused.error().where, "scene");
  EXPECT_EQ(value(service->find(id)).state, "failed");
}

TEST_F(RequeueTest, GoesOnFromTheCheckpointUnlessTheSceneIsAnother) {
  const std::string same = failed();
  const int before = brittle.calls;
  (void)value(service->requeue(same));
  EXPECT_FALSE(began_anew(done(same)));
  const int went_on = brittle.calls - before;

  const std::string other = failed();
  (void)value(store->patch(scene, {.name = {}, .up = engine::DVec3(1, 0, 0)}));
  brittle.calls = 0;
  (void)value(service->requeue(other));
  const auto anew = done(other);
  EXPECT_TRUE(began_anew(anew));
  EXPECT_EQ(brittle.calls, went_on + 1) << "all three intervals";
  const auto fresh = done(submit(request_of(scene)));
  EXPECT_EQ(version_bytes(*store, scene, *anew.result_version), version_bytes(*store, scene, *fresh.result_version));
}

}  // namespace
}  // namespace server::edits
