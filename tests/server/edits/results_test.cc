// What becomes of what edits have made, wherever their workers were killed or halted.
#include "server/edits/results.h"

#include <gtest/gtest.h>

#include "engine/jobs/sqlite_store.h"
#include "tests/server/edits/service_support.h"
#include "tests/server/scenes/store_support.h"

namespace server::edits {
namespace {

namespace jobs = engine::jobs;
using jobs::Event;

class ResultsTest : public testing::Test {
 protected:
  /// An edit that a worker has claimed, and what it has made.
  struct Edit {
    std::string id;
    std::int64_t claim = 0;
    scenes::MadeVersion made;
  };
  Edit begin() {
    (void)value(queue->submit({.lane = scene, .payload = "{}"}));
    const auto job = value(store->claim());
    Edit edit{job->id, job->claim_number, {}};
    edit.made = make(edit);
    return edit;
  }
  scenes::MadeVersion make(const Edit& edit) {
    return value(scenes->make_version(scene, 0, edit.id, edit.claim, engine::scene::no_change(*base)));
  }
  void succeed(const Edit& edit) {
    value(store->apply(edit.id, {.event = Event::succeed, .claim = edit.claim, .result = to_text(edit.made)}));
  }
  std::size_t versions() { return value(scenes->find(scene)).versions.size(); }

  support::TempDir dir;
  std::unique_ptr<scenes::SceneStore> scenes = open_scenes(dir.path());
  std::unique_ptr<jobs::SqliteStore> store = jobs::open_store(dir.path() / "edits");
  std::unique_ptr<jobs::Queue> queue = jobs::open_queue(*store, dir.path() / "edits");
  std::string scene = add_ball(*scenes, dir.path());
  std::shared_ptr<const engine::scene::GaussianCloud> base = value(scenes->load(scene, "0")).cloud.base;
};

TEST_F(ResultsTest, TheRecordDecidesWhetherThereIsAVersion) {
  const Edit edit = begin();
  value(take_in_result(*scenes, value(store->find(edit.id))));
  settle_results(*scenes, *queue);
  EXPECT_EQ(versions(), 1u);
  EXPECT_EQ(scenes->made_versions().size(), 1u) << "its worker is about to say so";
  succeed(edit);  // and is killed at once
  settle_results(*scenes, *queue);
  EXPECT_EQ(versions(), 2u);
  EXPECT_TRUE(scenes->made_versions().empty());
  value(take_in_result(*scenes, value(store->find(edit.id))));
  EXPECT_EQ(versions(), 2u);
}

TEST_F(ResultsTest, WhatWasMadeUnderAnEarlierClaimIsDropped) {
  const Edit halted = begin();
  value(store->apply(halted.id, {.event = Event::release, .claim = halted.claim}));
  Edit next{halted.id, value(store->claim())->claim_number, {}};
  next.made = make(next);
  settle_results(*scenes, *queue);
  EXPECT_EQ(scenes->made_versions(), std::vector<std::string>{next.made.file});
  (void)make(halted);  // it wakes
  EXPECT_FALSE(store->apply(halted.id, {.event = Event::succeed, .claim = halted.claim}));
  succeed(next);
  settle_results(*scenes, *queue);
  EXPECT_EQ(versions(), 2u);
  EXPECT_TRUE(scenes->made_versions().empty());
}

TEST_F(ResultsTest, WhatACancelledOrForgottenEditHasMadeIsDropped) {
  const Edit cancelled = begin();
  value(queue->cancel(cancelled.id));
  value(store->apply(cancelled.id,
                     {.event = Event::succeed, .claim = cancelled.claim, .result = to_text(cancelled.made)}));
  const Edit forgotten{"e000077", 1, {}};
  (void)make(forgotten);
  settle_results(*scenes, *queue);
  EXPECT_EQ(versions(), 1u);
  EXPECT_TRUE(scenes->made_versions().empty());
}

TEST_F(ResultsTest, WhatAnEditMakesThatIsTakenUpAgainOutlivesTheEndBefore) {
  const Edit failed = begin();
  value(store->apply(failed.id, {.event = Event::fail, .claim = failed.claim}));
  value(queue->requeue(failed.id));
  Edit next{failed.id, value(store->claim())->claim_number, {}};
  next.made = make(next);
  drop_results(*scenes, failed.id, failed.claim);  // its worker comes to that late
  EXPECT_EQ(scenes->made_versions(), std::vector<std::string>{next.made.file});
}

TEST_F(ResultsTest, VersionsOfEditsThatFollowEachOtherAreInTheirOrder) {
  const Edit first = begin();
  succeed(first);  // and is killed at once
  settle_results(*scenes, *queue);
  const Edit second = begin();
  EXPECT_EQ(second.made.version.version, 2);
  succeed(second);
  value(take_in_result(*scenes, value(store->find(second.id))));
  EXPECT_EQ(value(scenes->find_version(scene, "2")).edit, second.id);
}

TEST_F(ResultsTest, WhatAnotherWorkerIsJustWritingIsLeftAlone) {
  (void)begin();
  const auto half = dir.path() / "scenes/.made/.splatdrag-7-0.tmp";
  support::write_file(half, "half a version");
  settle_results(*scenes, *queue);
  EXPECT_TRUE(std::filesystem::exists(half));
  scenes.reset();
  scenes = open_scenes(dir.path());
  EXPECT_FALSE(std::filesystem::exists(half)) << "nobody is at work: it was killed";
}

TEST_F(ResultsTest, AnEditHasSucceededOnceItsVersionIsThere) {
  const Edit edit = begin();
  succeed(edit);
  queue.reset();
  store.reset();
  const auto in_the_way = dir.path() / "scenes" / scene / "versions";
  support::write_file(in_the_way, "no folder");
  const auto service = open_service(*scenes, dir.path());
  const auto seen = value(service->find(edit.id));
  EXPECT_EQ(seen.state, "running");
  EXPECT_FALSE(seen.ended);
  EXPECT_FALSE(service->remove(edit.id)) << "what it has made would be lost";
  std::filesystem::remove(in_the_way);
  EXPECT_EQ(value(service->find(edit.id)).state, "succeeded");
  EXPECT_EQ(versions(), 2u);
}

TEST_F(ResultsTest, TheResultOfAnEditWhoseSceneIsGoneIsDropped) {
  const Edit edit = begin();
  succeed(edit);
  value(scenes->remove(scene));
  value(take_in_result(*scenes, value(store->find(edit.id))));
  settle_results(*scenes, *queue);
  EXPECT_TRUE(scenes->made_versions().empty());
}

}  // namespace
}  // namespace server::edits
