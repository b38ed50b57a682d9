// Edits whose records are in a database: the same service, and what keeps a database and a data folder together.
#include <gtest/gtest.h>

#include <filesystem>
#include <future>
#include <optional>
#include <string>
#include <thread>

#include "server/edits/operation.h"
#include "server/edits/records.h"
#include "tests/engine/jobs/postgres_support.h"
#include "tests/server/edits/service_support.h"

namespace server::edits {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using support::PostgresServer;

class DatabaseTest : public testing::Test {
 protected:
  void SetUp() override {
    REQUIRE_POSTGRES();
    database.emplace();
    store = database->options().address;
    scene = add_ball(*scenes, dir.path());
  }
  Result<std::unique_ptr<EditService>> open(const std::string& address) {
    return EditService::open(*scenes, {.folder = edits, .store = address, .pictured_views = 2, .threads = 1});
  }
  std::size_t versions() { return value(scenes->find(scene)).versions.size(); }
  std::string finished_edit(const std::string& address) {
    const auto service = value(open(address));
    const std::string id = value(service->submit(move_ball(scene), "")).status.id;
    EXPECT_EQ(wait_for_end(*service, id).state, "succeeded");
    return id;
  }

  /// Fails with these words where it goes on being so.
  template <class Condition>
  static void wait_while(Condition is_so, const char* failure) {
    const auto deadline = std::chrono::steady_clock::now() + patience;
    while (is_so()) {
      ASSERT_LT(std::chrono::steady_clock::now(), deadline) << failure;
      std::this_thread::sleep_for(1ms);
    }
  }

  support::TempDir dir;
  fs::path edits = dir.path() / "edits";
  std::unique_ptr<scenes::SceneStore> scenes = open_scenes(dir.path());
  std::optional<engine::jobs::TestDatabase> database;
  std::string store, scene;
};

TEST_F(DatabaseTest, KeepsEditsAsAFileDoes) {
  const std::string id = finished_edit(store);
  EXPECT_FALSE(fs::exists(edits / "jobs.db"));
  const auto service = value(open(store));
  EXPECT_EQ(value(service->find(id)).state, "succeeded");
  EXPECT_EQ(versions(), 2u);
  const auto again = value(service->submit(move_ball(scene), "key"));
  EXPECT_FALSE(value(service->submit(move_ball(scene), "key")).created);
  EXPECT_EQ(wait_for_end(*service, again.status.id).state, "succeeded");
}

TEST_F(DatabaseTest, AnEditThatAnotherHasTakenOverPublishesNothing) {
  const auto service = value(open(store));
  // The moment before its version would be made.
  database->run(
      "CREATE FUNCTION take_over() RETURNS trigger LANGUAGE plpgsql AS "
      "$$BEGIN NEW.claim_number := OLD.claim_number + 1; RETURN NEW; END$$; "
      "CREATE TRIGGER take_over BEFORE UPDATE ON splatdrag.jobs FOR EACH ROW "
      "WHEN (NEW.place = 'interval 2, publish' AND OLD.place <> NEW.place) EXECUTE FUNCTION take_over()");
  const std::string id = value(service->submit(move_ball(scene), "")).status.id;
  ASSERT_NO_FATAL_FAILURE(wait_while([&] { return database->run("SELECT claim_number FROM splatdrag.jobs") != "2"; },
                                     "it did not come to publish"));
  service->drain(patience);
  EXPECT_EQ(versions(), 1u);
  const auto status = value(service->find(id));
  EXPECT_EQ(status.state, "running") << "it is the other's";
  EXPECT_EQ(database->run("SELECT claimed FROM splatdrag.jobs"), "t");
}

TEST_F(DatabaseTest, AnEditThatAnotherTakesOverAfterItHasAskedPublishesNothingEither) {
  auto service = value(open(store));
  // It is told that it still holds the edit, and is halted right then for longer than its claim lasts.
  database->run(
      "CREATE FUNCTION take_over() RETURNS trigger LANGUAGE plpgsql AS "
      "$$BEGIN NEW.claim_number := OLD.claim_number + 1; RETURN NEW; END$$; "
      "CREATE TRIGGER take_over BEFORE UPDATE OF lease_until ON splatdrag.jobs FOR EACH ROW "
      "WHEN (OLD.place = 'interval 2, publish' AND NEW.claim_number = OLD.claim_number AND OLD.claim_number = 1 "
      "AND NEW.lease_until <> OLD.lease_until) EXECUTE FUNCTION take_over()");
  const std::string id = value(service->submit(move_ball(scene), "")).status.id;
  ASSERT_NO_FATAL_FAILURE(
      wait_while([&] { return scenes->made_versions().empty(); }, "it did not come to make its version"));
  service->drain(patience);
  EXPECT_EQ(versions(), 1u);
  EXPECT_EQ(value(service->find(id)).state, "running") << "it is the other's";
  service.reset();
  service = value(open(store));
  EXPECT_EQ(wait_for_end(*service, id).state, "succeeded");
  EXPECT_EQ(versions(), 2u);
  EXPECT_TRUE(scenes->made_versions().empty()) << "what the halted one had made is dropped";
}

TEST_F(DatabaseTest, AFolderThatTheDatabaseKnowsKeepsItsId) {
  fs::create_directories(edits);
  fs::create_symlink("nowhere", edits / "jobs");  // no folder can be made there
  ASSERT_FALSE(open(store));
  fs::remove(edits / "jobs");
  EXPECT_TRUE(open(store)) << "with another id it were another's";
}

TEST_F(DatabaseTest, NothingIsTakenUpAgainFromOutsideWhileASceneIsChanged) {
  const std::string id = finished_edit(store);
  const auto service = value(open(store));
  std::future<Result<EditAtHand>> requeued;
  value(service->while_idle(scene, [&]() -> Result<void> {
    requeued = std::async(std::launch::async, [&] { return requeue_edit(edits, store, id); });
    EXPECT_EQ(requeued.wait_for(500ms), std::future_status::timeout) << "it waits for the end of this";
    return {};
  }));
  EXPECT_EQ(code_of(requeued.get()), ErrorCode::conflict) << "it has succeeded";
}

/// Several processes over one folder and one database: here, as many stores of scenes and services.
class RolesTest : public DatabaseTest {
 protected:
  struct Process {
    std::unique_ptr<scenes::SceneStore> scenes;
    std::unique_ptr<EditService> service;
  };
  void SetUp() override {
    DatabaseTest::SetUp();
    if (IsSkipped()) return;
    scenes.reset();
    front = start(Role::front);
  }
  [[nodiscard]] Process start(Role role) const {
    Process process;
    process.scenes = value(scenes::SceneStore::open(
        {.folder = dir.path() / "scenes", .sharing = scenes::Sharing::shared, .scene_root = {}}));
    process.service = value(EditService::open(
        *process.scenes,
        {.role = role, .folder = edits, .store = store, .lease = 60s, .pictured_views = 2, .threads = 1}));
    process.scenes->let_others_in();
    return process;
  }
  std::string submit(const proto::EditRequest& request) { return value(front.service->submit(request, "")).status.id; }
  Process front;
};

TEST_F(RolesTest, AFrontAnswersForWhatWorkersDo) {
  const std::string id = submit(move_ball(scene));
  EXPECT_EQ(value(front.service->find(id)).state, "queued") << "nobody works yet";
  const Process one = start(Role::worker), other = start(Role::front);
  EXPECT_EQ(wait_for_end(*front.service, id).state, "succeeded");
  EXPECT_EQ(value(front.service->find(id)).result_version, 1);
  for (const Process* process : {static_cast<const Process*>(&front), &one, &other}) {
    EXPECT_EQ(value(process->scenes->find(scene)).versions.size(), 2u);
    EXPECT_EQ(version_bytes(*process->scenes, scene, 1), version_bytes(*front.scenes, scene, 1));
    EXPECT_FALSE(process->service->trouble());
  }
  value(other.service->remove_version(scene, "1"));
  EXPECT_EQ(value(front.service->find(id)).state, "succeeded");
  EXPECT_EQ(value(front.scenes->find(scene)).versions.size(), 1u) << "it does not come back";
}

TEST_F(RolesTest, WhatIsAskedAtAFrontReachesTheWorker) {
  const Process worker = start(Role::worker);
  const std::string stopped = submit(move_ball_for_long(scene));
  wait_for_interval(*front.service, stopped);
  value(front.service->stop(stopped));
  EXPECT_TRUE(wait_for_end(*front.service, stopped).stopped_early);
  const std::string cancelled = submit(move_ball_for_long(scene));
  wait_for_interval(*front.service, cancelled);
  value(front.service->cancel(cancelled));
  EXPECT_EQ(wait_for_end(*front.service, cancelled).state, "cancelled");
  EXPECT_EQ(value(front.scenes->find(scene)).versions.size(), 2u) << "that of the stopped one";
}

TEST_F(RolesTest, AWorkerThatIsDrainedHandsItsEditOnAtACheckpoint) {
  Process leaves = start(Role::worker);
  const std::string id = submit(move_ball_slowly(scene));
  wait_for_interval(*front.service, id);
  leaves.service->drain(patience);
  const auto left = value(front.service->find(id));
  ASSERT_EQ(left.state, "running");
  EXPECT_EQ(database->run("SELECT claimed::text || deaths FROM splatdrag.jobs"), "false0");
  const Process stays = start(Role::worker);  // the lease is a minute
  const auto end = wait_for_end(*front.service, id);
  EXPECT_EQ(end.state, "succeeded");
  EXPECT_GE(left.finished_intervals.size(), 1u);
  EXPECT_EQ(database->run("SELECT claim_number::text || ' ' || deaths FROM splatdrag.jobs"), "2 0");

  const std::string undisturbed = submit(move_ball_slowly(scene));
  EXPECT_EQ(wait_for_end(*front.service, undisturbed).state, "succeeded");
  EXPECT_EQ(version_bytes(*front.scenes, scene, 1), version_bytes(*front.scenes, scene, 2));
}

TEST_F(RolesTest, NobodyTakesAnEditFromOneThatIsAtWork) {
  const Process worker = start(Role::worker);
  const std::string id = submit(move_ball_slowly(scene));
  wait_for_interval(*front.service, id);
  const Process later = start(Role::worker), front_of_later = start(Role::front);
  EXPECT_EQ(wait_for_end(*front.service, id).state, "succeeded");
  EXPECT_EQ(database->run("SELECT claim_number::text || ' ' || deaths FROM splatdrag.jobs"), "1 0");
}

TEST_F(RolesTest, NoAcceptedEditLosesItsSceneToAnotherFront) {
  const Process other = start(Role::front);
  const std::string id = submit(move_ball(scene));
  EXPECT_EQ(code_of(other.service->remove_scene(scene)), ErrorCode::conflict);
  value(other.service->cancel(id));
  value(other.service->remove_scene(scene));
  EXPECT_EQ(code_of(front.service->submit(move_ball(scene), "")), ErrorCode::not_found);
}

TEST_F(RolesTest, WhoWantsToBeAloneIsKeptOut) {
  const support::TempDir copy;
  fs::create_directories(copy.path() / "edits");
  fs::copy_file(edits / "folder_id", copy.path() / "edits/folder_id");
  const auto scenes_there = open_scenes(copy.path());
  EXPECT_EQ(code_of(EditService::open(*scenes_there, {.folder = copy.path() / "edits", .store = store})),
            ErrorCode::unavailable);
}

TEST_F(DatabaseTest, BelongsToOneDataFolder) {
  finished_edit(store);
  const support::TempDir elsewhere;
  const auto other = open_scenes(elsewhere.path());
  const auto refused = EditService::open(*other, {.folder = elsewhere.path() / "edits", .store = store});
  ASSERT_EQ(code_of(refused), ErrorCode::conflict);
  EXPECT_NE(refused.error().message.find(":" + dir.path().string() + ")"), std::string::npos)
      << refused.error().message;
  EXPECT_FALSE(fs::exists(elsewhere.path() / "edits/folder_id")) << "it is free to have another";
  EXPECT_TRUE(EditService::open(*other, {.folder = elsewhere.path() / "edits"}));
}

TEST_F(DatabaseTest, ServesOneAtATime) {
  const auto service = value(open(store));
  const support::TempDir copy;
  fs::create_directories(copy.path() / "edits");
  fs::copy_file(edits / "folder_id", copy.path() / "edits/folder_id");  // it seems to be the same folder
  const auto scenes_there = open_scenes(copy.path());
  EXPECT_EQ(code_of(EditService::open(*scenes_there, {.folder = copy.path() / "edits", .store = store})),
            ErrorCode::unavailable);
}

TEST_F(DatabaseTest, RecordsMoveFromAFileToADatabaseAndBackWhenToldTo) {
  const std::string id = finished_edit("");
  const auto refused = open(store);
  ASSERT_EQ(code_of(refused), ErrorCode::corrupt_data) << "a wrong name is no reason to begin anew";
  EXPECT_NE(refused.error().message.find("splatdrag admin rebuild --store"), std::string::npos)
      << refused.error().message;
  ASSERT_TRUE(open("")) << "and nothing has changed";

  const Rebuilt there = value(rebuild_records(*scenes, edits, store));
  EXPECT_FALSE(fs::exists(edits / "jobs.db"));
  EXPECT_EQ(there.findings.size(), 1u);
  EXPECT_EQ(value(value(open(store))->find(id)).state, "succeeded");
  const auto without = open("");
  ASSERT_EQ(code_of(without), ErrorCode::conflict);
  EXPECT_NE(without.error().message.find("--store"), std::string::npos);
  EXPECT_TRUE(value(check_records(edits)).in_database);

  database->run("DROP SCHEMA splatdrag CASCADE");
  EXPECT_EQ(code_of(open(store)), ErrorCode::corrupt_data) << "lost, which somebody should hear of";
  value(rebuild_records(*scenes, edits, store));
  EXPECT_EQ(value(rebuild_records(*scenes, edits, store)).moved_away,
            std::vector<std::string>{"the schema splatdrag_damaged_1"});
  EXPECT_EQ(finished_edit(store), "e000002") << "no number is given away twice";

  value(rebuild_records(*scenes, edits));
  const auto back = value(open(""));
  EXPECT_EQ(value(back->find("e000002")).state, "succeeded");
  EXPECT_EQ(value(back->list({})).size(), 2u);
}

TEST_F(DatabaseTest, ADamagedNameOfTheFolderIsNamed) {
  finished_edit(store);
  support::write_file(edits / "folder_id", "x");
  const auto refused = open(store);
  ASSERT_EQ(code_of(refused), ErrorCode::corrupt_data);
  EXPECT_EQ(refused.error().where, (edits / "folder_id").string());
}

TEST_F(DatabaseTest, ADamagedNoteIsFoundWhereRecordsAreElsewhere) {
  const std::string id = finished_edit(store);
  EXPECT_TRUE(value(check_records(edits)).damaged.empty());
  support::write_file(edits / "jobs" / (id + ".job"), "x");
  ASSERT_EQ(value(check_records(edits)).damaged.size(), 1u);
  EXPECT_EQ(value(check_records(edits)).damaged[0].where, "edits/jobs/" + id);
}

TEST_F(DatabaseTest, AnAddressThatCannotBeReadIsTheOptions) {
  const auto refused = open("postgres:me:secret");
  ASSERT_EQ(code_of(refused), ErrorCode::invalid_argument);
  EXPECT_EQ(refused.error().where, "--store");
  EXPECT_EQ(refused.error().message.find("secret"), std::string::npos);
  EXPECT_TRUE(open("")) << "nothing has been decided by it";
}

}  // namespace
}  // namespace server::edits
