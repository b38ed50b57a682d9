#include "engine/jobs/sqlite_store.h"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <optional>

#include "tests/engine/jobs/jobs_support.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr std::size_t many = 1000;

class SqliteStoreTest : public testing::Test {
 protected:
  std::string submit(const std::string& lane = "a", const std::string& payload = "{}",
                     std::chrono::milliseconds expected = 0ms) {
    return value(store->submit({.lane = lane, .payload = payload, .expected = expected}, many)).job.id;
  }
  /// From here on the store's clock is set by `now`.
  void use_own_clock() {
    store.reset();
    store = value(SqliteStore::open({.folder = dir.path(), .now = [this] { return now; }}));
  }
  std::string claim() {
    const auto job = value(store->claim());
    return job ? job->id : "";
  }
  /// Claims and ends the oldest.
  std::string end_one() {
    const std::string id = claim();
    value(store->apply(id, {.event = Event::succeed}));
    return id;
  }
  void reopen() {
    store.reset();
    store = open_store(dir.path());
  }
  void execute(const std::string& sql) {
    store.reset();
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  support::TempDir dir;
  fs::path file = dir.path() / "jobs.db";
  std::unique_ptr<SqliteStore> store = open_store(dir.path());
  Time now{1000h};
};

TEST_F(SqliteStoreTest, KeepsEveryFieldAcrossARestart) {
  const std::string bytes("a\0'\"\xff\n", 6);
  const auto submitted =
      value(store->submit({.lane = bytes, .payload = bytes, .idempotency_key = "key", .expected = 1234ms}, many));
  EXPECT_TRUE(submitted.created);
  const std::string id = submitted.job.id;
  EXPECT_EQ(id, "e000001");
  EXPECT_EQ(claim(), id);
  value(store->apply(id, {.event = Event::finish_interval, .progress = bytes, .interval = 3}));
  const Job before =
      value(store->apply(id, {.event = Event::fail, .error = {ErrorCode::no_space, "the disk is full", "scene.ply"}}));
  reopen();
  const Job after = value(store->find(id));
  EXPECT_EQ(after.lane, bytes);
  EXPECT_EQ(after.payload, bytes);
  EXPECT_EQ(after.idempotency_key, "key");
  EXPECT_EQ(after.expected, 1234ms);
  EXPECT_EQ(after.state, JobState::failed);
  EXPECT_EQ(after.finished_intervals, 3);
  EXPECT_EQ(after.progress, bytes);
  ASSERT_TRUE(after.error);
  EXPECT_EQ(after.error->code, ErrorCode::no_space);
  EXPECT_EQ(after.error->message, "the disk is full");
  EXPECT_EQ(after.error->where, "scene.ply");
  EXPECT_EQ(after.created, before.created);
  EXPECT_EQ(after.started, before.started);
  EXPECT_EQ(after.ended, before.ended);
  EXPECT_LE(after.created, *after.ended);
}

TEST_F(SqliteStoreTest, KeepsAResult) {
  const std::string id = submit();
  claim();
  value(store->apply(id, {.event = Event::succeed, .result = "{\"version\": 2}", .stopped_early = true}));
  reopen();
  EXPECT_EQ(value(store->find(id)).result, "{\"version\": 2}");
  EXPECT_TRUE(value(store->find(id)).stopped_early);
}

TEST_F(SqliteStoreTest, AnswersARepeatedSubmissionWithTheSameJob) {
  const NewJob job{.lane = "a", .payload = "{}", .idempotency_key = "k"};
  const std::string id = value(store->submit(job, 1)).job.id;
  const auto again = value(store->submit(job, 1));  // the queue is full by now, but nothing new is asked for
  EXPECT_FALSE(again.created);
  EXPECT_EQ(again.job.id, id);
  reopen();
  EXPECT_EQ(end_one(), id);
  EXPECT_EQ(value(store->submit(job, 1)).job.state, JobState::succeeded);
  EXPECT_EQ(code_of(store->submit({.lane = "a", .payload = "{ }", .idempotency_key = "k"}, 1)),
            ErrorCode::unprocessable);
  EXPECT_EQ(code_of(store->submit({.lane = "b", .payload = "{}", .idempotency_key = "k"}, 1)),
            ErrorCode::unprocessable);
  EXPECT_EQ(value(store->list({})).size(), 1u);
}

TEST_F(SqliteStoreTest, FindsAJobByItsKey) {
  const std::string id = value(store->submit({.lane = "a", .payload = "x", .idempotency_key = "k"}, many)).job.id;
  submit();  // one without a key
  ASSERT_TRUE(value(store->find_key("k")));
  EXPECT_EQ(value(store->find_key("k"))->id, id);
  EXPECT_EQ(value(store->find_key("k"))->payload, "x");
  EXPECT_EQ(value(store->find_key("K")), std::nullopt);
  EXPECT_EQ(value(store->find_key("")), std::nullopt) << "no key is no key";
  claim();
  value(store->apply(id, {.event = Event::succeed}));
  value(store->remove(id));
  EXPECT_EQ(value(store->find_key("k")), std::nullopt) << "forgotten with its job";
}

TEST_F(SqliteStoreTest, LeavesOutNumbersThatAreKnownElsewhere) {
  const auto reopen_after = [&](std::int64_t used) {
    store.reset();
    store = value(SqliteStore::open({.folder = dir.path(), .used_numbers = used}));
  };
  reopen_after(41);
  EXPECT_EQ(submit(), "e000042");
  reopen_after(7);
  EXPECT_EQ(submit(), "e000043") << "never back";
}

TEST_F(SqliteStoreTest, RefusesMoreThanMayWaitAndNamesTheLimit) {
  for (int i = 0; i < 3; ++i) value(store->submit({.lane = "a", .payload = ""}, 3));
  const auto refused = store->submit({.lane = "a", .payload = ""}, 3);
  ASSERT_EQ(code_of(refused), ErrorCode::busy);
  EXPECT_EQ(refused.error().where, "max_queued");
  EXPECT_NE(refused.error().message.find("(max_queued) is 3"), std::string::npos) << refused.error().message;
  EXPECT_EQ(store->check_room(3).error().message, refused.error().message);
  claim();
  EXPECT_TRUE(store->check_room(3)) << "one that runs does not wait";
  EXPECT_TRUE(store->submit({.lane = "a", .payload = ""}, 3));
}

TEST_F(SqliteStoreTest, TellsWhoIsNext) {
  for (int i = 0; i < 3; ++i) submit();
  EXPECT_EQ(value(store->find("e000003")).queue_position, 3);
  claim();
  EXPECT_EQ(value(store->find("e000001")).queue_position, 0);
  EXPECT_EQ(value(store->find("e000003")).queue_position, 2);
  value(store->apply("e000002", {.event = Event::cancel}));
  EXPECT_EQ(value(store->find("e000003")).queue_position, 1);
}

TEST_F(SqliteStoreTest, GivesOutOneJobOfALaneAtATimeAndTheOldestFirst) {
  for (const char* lane : {"a", "a", "b", "a"}) submit(lane);
  EXPECT_EQ(claim(), "e000001");
  EXPECT_EQ(claim(), "e000003");
  EXPECT_EQ(claim(), "");
  value(store->apply("e000001", {.event = Event::release}));
  EXPECT_EQ(claim(), "e000001") << "one that was interrupted goes on before its lane does";
  value(store->apply("e000001", {.event = Event::succeed}));
  EXPECT_EQ(claim(), "e000002");
}

TEST_F(SqliteStoreTest, LetsShorterJobsGoFirstForAWhile) {
  use_own_clock();
  const std::string longest = submit("a", "", 1h), middle = submit("b", "", 10min);
  now += stretch * 50min - 1ms;
  const std::string before = submit("c", "", 10min);
  now += 2ms;
  const std::string after = submit("d", "", 10min);
  EXPECT_EQ(value(store->find(longest)).queue_position, 3);
  EXPECT_EQ(value(store->find(after)).queue_position, 4);
  EXPECT_EQ(claim(), middle);
  EXPECT_EQ(claim(), before) << "it was handed in while the long one still let others go first";
  EXPECT_EQ(claim(), longest) << "its turn comes, whatever follows";
  EXPECT_EQ(claim(), after);
}

TEST_F(SqliteStoreTest, KeepsALaneInOrderWhateverItsJobsTake) {
  const std::string longest = submit("a", "", 1h), of_lane = submit("a", "", 1s), other = submit("b", "", 10min);
  EXPECT_EQ(value(store->find(other)).queue_position, 1);
  EXPECT_EQ(value(store->find(longest)).queue_position, 2);
  EXPECT_EQ(value(store->find(of_lane)).queue_position, 3) << "it is short, but comes after the long one";
  EXPECT_EQ(claim(), other);
  EXPECT_EQ(claim(), longest);
  EXPECT_EQ(claim(), "");
}

TEST_F(SqliteStoreTest, SaysWhenAJobShouldMakeWay) {
  use_own_clock();
  const std::string longest = submit("a", "", 1h);
  EXPECT_EQ(claim(), longest);
  EXPECT_FALSE(value(store->should_make_way(longest, 1h))) << "nobody waits";
  submit("a", "", 1s);
  EXPECT_FALSE(value(store->should_make_way(longest, 1h))) << "one of its lane has to wait for it";
  const std::string unknown = submit("b"), shorter = submit("c", "", 10min);
  EXPECT_FALSE(value(store->should_make_way(longest, 1h))) << "nobody knows how long the next one takes";
  value(store->apply(unknown, {.event = Event::cancel}));
  EXPECT_TRUE(value(store->should_make_way(longest, 20min)));
  EXPECT_FALSE(value(store->should_make_way(longest, 19min))) << "what is left of it is nearly as short";
  value(store->apply(longest, {.event = Event::finish_interval, .interval = 1}));
  value(store->apply(longest, {.event = Event::stop}));
  EXPECT_FALSE(value(store->should_make_way(longest, 1h))) << "it is about to end";
  value(store->apply(shorter, {.event = Event::cancel}));
  now += stretch * 1h;
  submit("d", "", 1s);
  EXPECT_FALSE(value(store->should_make_way(longest, 1h))) << "it has let others go first for long enough";
}

TEST_F(SqliteStoreTest, MakesWayOnlyForTheJobThatWouldComeNext) {
  use_own_clock();
  const std::string long_one = submit("a", "", 1h);
  now += stretch * 50min;
  const std::string held = submit("b", "", 1h);
  value(store->apply(long_one, {.event = Event::claim}));
  value(store->apply(held, {.event = Event::claim}));
  value(store->apply(long_one, {.event = Event::finish_interval, .interval = 1}));
  value(store->apply(long_one, {.event = Event::make_way}));
  now += stretch * 5min;
  const std::string shorter = submit("c", "", 6min);
  EXPECT_FALSE(value(store->should_make_way(held, 1h))) << "the worker would go to the long one, not to the short one";
  value(store->apply(long_one, {.event = Event::stop}));
  EXPECT_TRUE(value(store->should_make_way(held, 1h))) << "it is only to end";
  value(store->apply(long_one, {.event = Event::cancel}));
  EXPECT_TRUE(value(store->should_make_way(held, 1h)));
  EXPECT_EQ(claim(), shorter);
}

TEST_F(SqliteStoreTest, AJobThatWasInterruptedGoesOnBeforeThoseThatWait) {
  use_own_clock();
  const std::string longest = submit("a", "", 1h);
  EXPECT_EQ(claim(), longest);
  submit("b", "", 1s);
  const std::string made_way = submit("c", "", 10min);
  value(store->apply(made_way, {.event = Event::claim}));
  value(store->apply(made_way, {.event = Event::make_way}));
  reopen();
  EXPECT_EQ(claim(), longest) << "the death of the process makes no way";
  EXPECT_EQ(claim(), "e000002");
  EXPECT_EQ(claim(), made_way) << "one that has made way waits like the others";
}

TEST_F(SqliteStoreTest, ReleasesWhatADeadProcessHeld) {
  for (const char* lane : {"a", "b", "c", "d"}) submit(lane);
  for (int i = 0; i < 3; ++i) claim();
  for (const char* id : {"e000001", "e000002", "e000003"})
    value(store->apply(id, {.event = Event::finish_interval, .interval = 2}));
  value(store->apply("e000002", {.event = Event::stop}));
  value(store->apply("e000003", {.event = Event::cancel}));
  reopen();
  EXPECT_EQ(value(store->find("e000001")).state, JobState::running);
  EXPECT_EQ(value(store->find("e000002")).state, JobState::stop_requested);
  EXPECT_EQ(value(store->find("e000003")).state, JobState::cancelled);
  EXPECT_EQ(value(store->find("e000004")).state, JobState::queued);
  EXPECT_EQ(claim(), "e000001");
  EXPECT_EQ(value(store->find("e000001")).finished_intervals, 2);
}

TEST_F(SqliteStoreTest, ListsTheYoungestFirst) {
  for (const char* lane : {"a", "b", "a"}) submit(lane, "long payload");
  end_one();
  const auto ids = [&](const Filter& filter) {
    std::string text;
    for (const Job& job : value(store->list(filter))) text += job.id.back();
    return text;
  };
  EXPECT_EQ(ids({}), "321");
  EXPECT_EQ(ids({.limit = 2}), "32");
  EXPECT_EQ(ids({.lane = "a"}), "31");
  EXPECT_EQ(ids({.lane = "a", .active_only = true}), "3");
  EXPECT_EQ(ids({.lane = "none"}), "");
  EXPECT_EQ(value(store->list({}))[0].payload, "") << "a list carries no payloads";
}

TEST_F(SqliteStoreTest, RemovesOnlyWhatHasEndedAndNeverReusesAnId) {
  const std::string id = submit();
  EXPECT_EQ(code_of(store->remove(id)), ErrorCode::conflict);
  end_one();
  value(store->remove(id));
  EXPECT_EQ(code_of(store->find(id)), ErrorCode::not_found);
  EXPECT_EQ(code_of(store->remove(id)), ErrorCode::not_found);
  EXPECT_EQ(code_of(store->apply(id, {.event = Event::cancel})), ErrorCode::not_found);
  reopen();
  EXPECT_EQ(submit(), "e000002");
}

TEST_F(SqliteStoreTest, FindsNothingUnderATextThatIsNoId) {
  submit();
  for (const char* id : {"", "1", "e1", "e0000001", "e000001 ", "e000001' OR 1", "e999999999999999999999"})
    EXPECT_EQ(code_of(store->find(id)), ErrorCode::not_found) << id;
}

TEST_F(SqliteStoreTest, ForgetsWhatIsOldOrTooMuch) {
  use_own_clock();
  for (int i = 0; i < 6; ++i) submit();
  for (int i = 0; i < 4; ++i) {
    end_one();
    now += 1h;
  }
  // Ended at 1000, 1001, 1002 and 1003 h; it is 1004 h.
  EXPECT_EQ(value(store->expire({.max_age = 4h, .max_count = 4})), std::vector<std::string>{});
  EXPECT_EQ(value(store->expire({.max_age = 3h, .max_count = 4})), std::vector<std::string>{"e000001"});
  EXPECT_EQ(value(store->expire({.max_age = 3h, .max_count = 1})), (std::vector<std::string>{"e000002", "e000003"}));
  EXPECT_EQ(value(store->expire({.max_age = 0h, .max_count = 0})), std::vector<std::string>{"e000004"});
  EXPECT_EQ(value(store->list({})).size(), 2u) << "what has not ended is kept";
}

TEST_F(SqliteStoreTest, IsHeldByOneAtATime) {
  const auto second = SqliteStore::open({.folder = dir.path(), .busy_timeout = 10ms});
  ASSERT_EQ(code_of(second), ErrorCode::unavailable);
  EXPECT_EQ(second.error().where, file.string());
  submit();
  reopen();
}

TEST_F(SqliteStoreTest, SurvivesAFullDisk) {
  submit();
  {
    const FullDisk full(fs::file_size(dir.path() / "jobs.db-wal"));
    const auto refused = store->submit({.lane = "a", .payload = std::string(100'000, 'x')}, many);
    ASSERT_EQ(code_of(refused), ErrorCode::no_space);
    EXPECT_EQ(refused.error().where, file.string());
    EXPECT_EQ(code_of(store->claim()), ErrorCode::no_space);
    EXPECT_EQ(value(store->find("e000001")).state, JobState::queued) << "reading needs no space";
    EXPECT_EQ(value(store->list({})).size(), 1u);
  }
  EXPECT_EQ(submit(), "e000002") << "what was refused has left no trace";
  EXPECT_EQ(claim(), "e000001");
  reopen();
  EXPECT_EQ(value(store->list({})).size(), 2u);
}

TEST_F(SqliteStoreTest, RefusesAFileThatIsNoJobStore) {
  store.reset();
  support::write_file(file, std::string(8192, 'x'));
  const auto garbage = SqliteStore::open({.folder = dir.path()});
  ASSERT_EQ(code_of(garbage), ErrorCode::corrupt_data);
  EXPECT_EQ(garbage.error().where, file.string());
  fs::remove(file);
  execute("CREATE TABLE recipes (name TEXT)");
  EXPECT_EQ(code_of(SqliteStore::open({.folder = dir.path()})), ErrorCode::corrupt_data);
}

TEST_F(SqliteStoreTest, CountsHowOftenInARowAProcessDiedAtTheSamePlace) {
  const std::string id = submit();
  for (int death = 1; death <= 3; ++death) {
    EXPECT_EQ(claim(), id);
    value(store->apply(id, {.event = Event::report, .place = "interval 1, correct"}));
    reopen();  // as after a kill: the claim is still there
    const Job job = value(store->find(id));
    EXPECT_EQ(job.deaths, death);
    EXPECT_EQ(job.died_at, "interval 1, correct");
    EXPECT_EQ(job.state, death < 3 ? JobState::running : JobState::failed);
  }
  EXPECT_EQ(claim(), "") << "it is not resumed any more";
  EXPECT_EQ(value(store->find(id)).error->where, id);
  EXPECT_EQ(submit(), "e000002");
  EXPECT_EQ(claim(), "e000002") << "its lane goes on";
}

TEST_F(SqliteStoreTest, ReadsAFileOfTheVersionBefore) {
  submit();
  claim();
  value(store->apply("e000001", {.event = Event::finish_interval, .progress = "half", .interval = 2}));
  execute(
      "ALTER TABLE jobs DROP COLUMN place; ALTER TABLE jobs DROP COLUMN died_at; ALTER TABLE jobs DROP COLUMN deaths; "
      "ALTER TABLE jobs DROP COLUMN checksum; ALTER TABLE jobs DROP COLUMN expected; "
      "PRAGMA user_version = 1");
  store = open_store(dir.path());
  const Job job = value(store->find("e000001"));
  EXPECT_EQ(job.finished_intervals, 2);
  EXPECT_EQ(job.progress, "half");
  EXPECT_EQ(job.deaths, 1) << "the process that held it is gone";
  EXPECT_EQ(claim(), "e000001");
  reopen();
  EXPECT_EQ(value(store->find("e000001")).deaths, 2);
}

TEST_F(SqliteStoreTest, RefusesAFileOfANewerVersion) {
  execute("PRAGMA user_version = 5");
  EXPECT_EQ(code_of(SqliteStore::open({.folder = dir.path()})), ErrorCode::unsupported);
}

TEST_F(SqliteStoreTest, NamesARecordThatMakesNoSense) {
  submit();
  execute("UPDATE jobs SET lane = 'b'");  // nothing that SQLite would mind
  const auto opened = SqliteStore::open({.folder = dir.path()});
  ASSERT_EQ(code_of(opened), ErrorCode::corrupt_data);
  EXPECT_NE(opened.error().message.find("e000001"), std::string::npos) << opened.error().message;
}

TEST_F(SqliteStoreTest, NamesDamageWhereverItIs) {
  for (int i = 0; i < 80; ++i) submit();
  store.reset();
  const std::string whole = support::read_file(file);
  int noticed = 0;
  const auto try_with = [&](const std::string& bytes) {
    support::write_file(file, bytes);
    const auto opened = SqliteStore::open({.folder = dir.path()});
    const auto listed = opened ? (*opened)->list({}) : propagate(opened);
    if (listed) return;  // it hit a payload, or space that is not used
    ++noticed;
    EXPECT_EQ(listed.error().code, ErrorCode::corrupt_data) << listed.error().message;
    EXPECT_EQ(listed.error().where, file.string());
  };
  for (std::size_t at = 100; at + 64 < whole.size(); at += 480) {
    SCOPED_TRACE(at);
    std::string damaged = whole;
    damaged.replace(at, 64, 64, '\xa5');
    try_with(damaged);
  }
  EXPECT_GT(noticed, 5);
  noticed = 0;
  for (std::size_t size = 4096; size < whole.size(); size += 4096) try_with(whole.substr(0, size));
  EXPECT_EQ(noticed, int(whole.size() / 4096 - 1)) << "a file that was cut is always noticed";
}

}  // namespace
}  // namespace engine::jobs
