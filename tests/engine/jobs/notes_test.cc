#include "engine/jobs/notes.h"

#include <gtest/gtest.h>

#include "tests/engine/jobs/jobs_support.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;

Job full_job() {
  Job job;
  job.id = "e000012";
  job.lane = "s000001", job.payload = std::string("any\0 bytes", 10), job.idempotency_key = "key";
  job.state = JobState::failed;
  job.stopped_early = true;
  job.finished_intervals = 3;
  job.progress = "half", job.result = "none";
  job.error = Error{ErrorCode::too_large, "it is too large", "params.views"};
  job.created = Time(std::chrono::milliseconds(5));
  job.ended = Time(std::chrono::milliseconds(7));
  job.expected = std::chrono::milliseconds(90);
  job.requester = "studio";
  return job;
}

TEST(Note, ComesBackAsItWasWritten) {
  const Job read = value(decode_note(encode_note(full_job())));
  EXPECT_EQ(encode_note(read), encode_note(full_job()));
  EXPECT_EQ(read.payload, full_job().payload);
  EXPECT_EQ(read.state, JobState::failed);
  EXPECT_EQ(read.error->where, "params.views");
  EXPECT_FALSE(read.started);
  EXPECT_EQ(read.ended, full_job().ended);
  EXPECT_EQ(read.expected, full_job().expected);
  EXPECT_EQ(read.requester, "studio");
}

TEST(Note, KnowsItselfByEveryBitAndEveryCut) {
  const std::string whole = encode_note(full_job());
  for (std::size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    std::string damaged = whole;
    damaged[bit / 8] = char(damaged[bit / 8] ^ 1 << bit % 8);
    ASSERT_EQ(code_of(decode_note(damaged)), ErrorCode::corrupt_data) << bit;
  }
  for (std::size_t size = 0; size < whole.size(); ++size)
    ASSERT_EQ(code_of(decode_note(whole.substr(0, size))), ErrorCode::corrupt_data) << size;
}

/// A queue over a store that can be lost.
class NotesTest : public testing::Test {
 protected:
  std::string submit(const std::string& payload, const std::string& key = "") {
    return value(queue->submit({.lane = "a", .payload = payload, .idempotency_key = key})).job.id;
  }
  void close() {
    queue.reset();
    store.reset();
  }
  void open() {
    close();
    const auto traces = value(find_traces(jobs));
    store = value(SqliteStore::open({.folder = dir.path(), .used_numbers = traces.highest_number}));
    queue = open_queue(*store, dir.path());
  }
  void lose_store() {
    close();
    for (const char* name : {"jobs.db", "jobs.db-wal"}) fs::remove(dir.path() / name);
    open();
  }

  support::TempDir dir;
  fs::path jobs = dir.path() / "jobs";
  std::unique_ptr<SqliteStore> store = open_store(dir.path());
  std::unique_ptr<Queue> queue = open_queue(*store, dir.path());
};

TEST_F(NotesTest, BringBackAStoreThatWasLost) {
  const std::string waits = submit("waits", "key 1"), runs = submit("runs"), ended = submit("ended"),
                    cancelled = submit("cancelled"), removed = submit("removed");
  fs::create_directories(jobs / runs);
  support::write_file(jobs / runs / "checkpoint-2", "two");
  value(queue->cancel(cancelled));
  value(queue->cancel(removed));
  value(queue->remove(removed));
  Job done = value(store->find(ended));
  done.state = JobState::succeeded;
  done.result = "of value";
  value(store->restore(done));  // as if a worker had done it
  open();
  lose_store();
  EXPECT_EQ(queue->findings().size(), 4u);
  EXPECT_EQ(value(queue->find(waits)).payload, "waits");
  EXPECT_EQ(value(queue->find(waits)).state, JobState::queued);
  EXPECT_EQ(value(queue->find(runs)).finished_intervals, 2);
  EXPECT_EQ(value(queue->find(ended)).state, JobState::succeeded);
  EXPECT_EQ(value(queue->find(ended)).result, "of value");
  EXPECT_EQ(value(queue->find(cancelled)).state, JobState::cancelled);
  EXPECT_EQ(code_of(queue->find(removed)), ErrorCode::not_found);
  EXPECT_EQ(value(queue->submit({.lane = "a", .payload = "waits", .idempotency_key = "key 1"})).job.id, waits);
  EXPECT_EQ(submit("next"), "e000006") << "no number is given away twice";
  open();
  EXPECT_TRUE(queue->findings().empty()) << queue->findings()[0].message;
}

TEST_F(NotesTest, SpeakOfAJobThatIsTakenUpAgain) {
  const std::string id = submit("x");
  ASSERT_EQ(value(store->claim())->id, id);
  Job failed = value(store->apply(id, {.event = Event::fail, .claim = 1, .error = {ErrorCode::no_space, "full", ""}}));
  value(write_note(jobs, failed));
  fs::create_directories(jobs / id);
  support::write_file(jobs / id / "checkpoint-2", "two");
  const auto revision = queue->revision();
  EXPECT_EQ(value(queue->requeue(id)).finished_intervals, 2);
  EXPECT_NE(queue->revision(), revision);
  open();
  EXPECT_EQ(value(queue->find(id)).state, JobState::queued) << "its note says nothing else";
  lose_store();
  EXPECT_EQ(value(queue->find(id)).state, JobState::queued);
  EXPECT_EQ(value(queue->find(id)).finished_intervals, 2);

  EXPECT_EQ(code_of(queue->requeue(id)), ErrorCode::conflict);
  EXPECT_EQ(code_of(queue->requeue("e000099")), ErrorCode::not_found);
}

TEST_F(NotesTest, ARefusedRequeueChangesNoNote) {
  const std::string id = submit("x");
  ASSERT_EQ(value(store->claim())->id, id);
  value(write_note(jobs, value(store->apply(id, {.event = Event::fail, .claim = 1}))));
  submit("younger");
  EXPECT_EQ(code_of(queue->requeue(id)), ErrorCode::conflict);
  EXPECT_EQ(value(read_note(jobs, id)).state, JobState::failed);
}

TEST_F(NotesTest, NobodyHoldsAClaimAgainThatWasLostWithTheStore) {
  const std::string id = submit("x");
  for (std::int64_t claim = 1; claim <= 2; ++claim) {
    ASSERT_EQ(value(store->claim())->claim_number, claim);
    value(store->apply(id, {.event = Event::release, .claim = claim}));
  }
  lose_store();
  const auto claimed = value(store->claim());
  EXPECT_GT(claimed->claim_number, 2);
  EXPECT_EQ(code_of(store->apply(id, {.event = Event::succeed, .claim = 1})), ErrorCode::conflict);
}

TEST_F(NotesTest, AreLeftAloneWhileOthersAreAtWork) {
  const std::string id = submit("x");
  queue.reset();
  fs::remove(jobs / (id + ".job"));
  queue = value(Queue::open(*store, {.folder = jobs, .others_are_at_work = true}));
  EXPECT_FALSE(fs::exists(jobs / (id + ".job"))) << "another process is just writing it, say";
}

TEST_F(NotesTest, KeepTheNumberOfARemovedJob) {
  for (int i = 0; i < 3; ++i) submit("x");
  for (const char* id : {"e000003", "e000001", "e000002"}) {
    value(queue->cancel(id));
    value(queue->remove(id));
  }
  lose_store();
  EXPECT_EQ(submit("next"), "e000004");
}

TEST_F(NotesTest, FindWhatALogThatWasCutHasLost) {
  const std::string kept = submit("kept");
  const auto size = fs::file_size(dir.path() / "jobs.db-wal");
  const std::string lost = submit("lost", "key");
  // As a crash leaves it: the log is not folded into the file.
  const support::TempDir crashed;
  fs::copy(dir.path(), crashed.path(), fs::copy_options::recursive);
  std::string log = support::read_file(crashed.path() / "jobs.db-wal");
  log[size + 40] = char(log[size + 40] ^ 1);
  support::write_file(crashed.path() / "jobs.db-wal", log);
  const auto other_store = open_store(crashed.path());
  EXPECT_EQ(code_of(other_store->find(lost)), ErrorCode::not_found) << "SQLite says nothing of it";
  const auto other = open_queue(*other_store, crashed.path());
  ASSERT_EQ(other->findings().size(), 1u);
  EXPECT_EQ(other->findings()[0].where, lost);
  EXPECT_EQ(value(other->find(lost)).payload, "lost");
  EXPECT_EQ(value(other->find(kept)).payload, "kept");
}

TEST_F(NotesTest, AFolderThatNobodyKnowsIsLeftAlone) {
  fs::create_directories(jobs / "e000009");
  support::write_file(jobs / "e000009" / "picture.jpg", "x");
  open();
  ASSERT_EQ(queue->findings().size(), 1u);
  EXPECT_EQ(queue->findings()[0].where, "e000009");
  EXPECT_TRUE(fs::exists(jobs / "e000009" / "picture.jpg"));
  EXPECT_EQ(submit("next"), "e000010");
}

TEST_F(NotesTest, AStoreThatHasToBeThereIsMissed) {
  submit("x");
  close();
  for (const bool empty : {false, true}) {
    fs::remove(dir.path() / "jobs.db-wal");
    fs::remove(dir.path() / "jobs.db");
    if (empty) support::write_file(dir.path() / "jobs.db", "");
    const auto opened = SqliteStore::open({.folder = dir.path(), .must_exist = true});
    ASSERT_EQ(code_of(opened), ErrorCode::corrupt_data);
    EXPECT_EQ(opened.error().where, (dir.path() / "jobs.db").string());
    EXPECT_EQ(fs::exists(dir.path() / "jobs.db"), empty) << "nothing was made in its place";
  }
}

TEST_F(NotesTest, ARemovalThatWasCutShortIsFinished) {
  const std::string id = submit("x");
  value(queue->cancel(id));
  fs::create_directories(jobs / id);
  value(mark_removed(jobs, id));
  open();
  EXPECT_TRUE(queue->findings().empty());
  EXPECT_EQ(code_of(queue->find(id)), ErrorCode::not_found);
  EXPECT_FALSE(fs::exists(jobs / id) || fs::exists(jobs / (id + ".removed")));
}

TEST_F(NotesTest, AJobWithoutNoteGetsOne) {  // of an earlier release
  const std::string id = submit("x");
  fs::remove(jobs / (id + ".job"));
  open();
  EXPECT_EQ(value(read_note(jobs, id)).payload, "x");
}

TEST_F(NotesTest, ADamagedNoteIsWrittenAnewFromTheRecord) {
  const std::string id = submit("x");
  support::write_file(jobs / (id + ".job"), "");
  open();
  ASSERT_EQ(queue->findings().size(), 1u);
  EXPECT_EQ(value(read_note(jobs, id)).payload, "x");
}

TEST_F(NotesTest, NoNoteIsLeftOfAJobThatWasRefused) {
  const support::FullDisk full(10);
  EXPECT_EQ(code_of(queue->submit({.lane = "a", .payload = std::string(100'000, 'x')})), ErrorCode::no_space);
  EXPECT_TRUE(value(find_traces(jobs)).notes.empty());
}

}  // namespace
}  // namespace engine::jobs
