// What of the shared store is its own: leases, several who have it open, servers that go away.
#include "engine/jobs/postgres_store.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <map>
#include <mutex>
#include <semaphore>
#include <thread>
#include <vector>

#include "engine/jobs/worker.h"
#include "tests/engine/jobs/jobs_support.h"
#include "tests/engine/jobs/postgres_support.h"
#include "tests/support/child.h"
#include "tests/support/unix_link.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using support::Child;
using support::PostgresServer;
using support::ServerStop;

constexpr std::size_t many = 100'000;

/// A database in which nothing runs out before its time comes.
class PostgresStoreTest : public testing::Test {
 protected:
  void SetUp() override {
    REQUIRE_POSTGRES();
    database.emplace();
    clock = database->own_clock();
    advance(0ms);
  }
  void advance(std::chrono::milliseconds time) {
    now += time;
    database->set_time(now);
  }
  [[nodiscard]] PostgresOptions options() const {
    PostgresOptions chosen = database->options();
    chosen.now = clock;
    return chosen;
  }
  [[nodiscard]] std::unique_ptr<PostgresStore> open() const { return value(PostgresStore::open(options())); }
  static std::string submit(Store& store, const std::string& lane = "a") {
    return value(store.submit({.lane = lane, .payload = "{}"}, many)).job.id;
  }

  std::optional<TestDatabase> database;
  std::string clock;
  Time now{1000h};
};

/// Waits for what has to come.
template <class Condition>
void wait_until(Condition condition, const char* what) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) throw std::runtime_error(std::string("never: ") + what);
    std::this_thread::sleep_for(1ms);
  }
}

TEST_F(PostgresStoreTest, AClaimPassesOnWhenItsLeaseRunsOut) {
  const auto first = open(), second = open();
  const std::string id = submit(*first);
  EXPECT_EQ(value(first->claim())->claim_number, 1);
  value(first->apply(id, {.event = Event::report, .claim = 1, .place = "interval 1"}));
  advance(30s);
  EXPECT_FALSE(value(second->claim())) << "it lasts to its last moment";
  advance(1ms);
  const auto taken = value(second->claim());
  ASSERT_TRUE(taken);
  EXPECT_EQ(taken->claim_number, 2);
  EXPECT_EQ(taken->deaths, 1) << "nobody knows better";
  EXPECT_EQ(taken->died_at, "interval 1");
  EXPECT_EQ(code_of(first->renew(id, 1)), ErrorCode::conflict);
  EXPECT_EQ(code_of(first->apply(id, {.event = Event::succeed, .claim = 1})), ErrorCode::conflict);
  value(second->apply(id, {.event = Event::succeed, .claim = 2, .result = "of the second"}));
  EXPECT_EQ(value(first->find(id)).result, "of the second");
}

TEST_F(PostgresStoreTest, AClaimThatIsRenewedLasts) {
  const auto first = open(), second = open();
  const std::string id = submit(*first);
  (void)value(first->claim());
  for (int i = 0; i < 5; ++i) {
    advance(29s);
    EXPECT_EQ(value(first->renew(id, 1)), JobState::running);
  }
  EXPECT_FALSE(value(second->claim()));
  advance(31s);
  EXPECT_EQ(value(first->renew(id, 1)), JobState::running) << "nobody has come for it";
  EXPECT_FALSE(value(second->claim()));
}

TEST_F(PostgresStoreTest, AJobWhoseHoldersDieAtOnePlaceIsGivenUpAndACancelledOneEnds) {
  const auto store = open();
  const std::string id = submit(*store, "a"), cancelled = submit(*store, "b");
  for (int death = 1; death <= 3; ++death) {
    ASSERT_EQ(value(store->claim())->id, id);
    if (death == 1) {
      ASSERT_EQ(value(store->claim())->id, cancelled);
      EXPECT_EQ(value(store->apply(cancelled, {.event = Event::cancel})).state, JobState::cancel_requested);
    }
    advance(31s);
  }
  EXPECT_FALSE(value(store->claim()));
  EXPECT_EQ(value(store->find(id)).state, JobState::failed);
  EXPECT_EQ(value(store->find(id)).deaths, 3);
  EXPECT_EQ(value(store->find(cancelled)).state, JobState::cancelled);
}

TEST_F(PostgresStoreTest, NoTwoGetTheSameJobAndNoLaneIsWorkedOnTwice) {
  constexpr int processes = 4, lanes = 20, jobs = 120;
  {
    const auto store = open();
    for (int i = 0; i < jobs; ++i) submit(*store, std::to_string(i % lanes));
  }
  database->run("UPDATE test_clock SET now = 0");
  database->run(
      "CREATE OR REPLACE FUNCTION test_now() RETURNS bigint VOLATILE LANGUAGE sql AS "
      "$$SELECT floor(extract(epoch FROM clock_timestamp()) * 1000000)::bigint$$");
  PostgresOptions of_children = options();
  of_children.lease = 24h * 365'000;  // microseconds: no more than a few minutes
  const auto work = [&](const Child& self) {
    self.listen();  // until all are there
    const auto store = value(PostgresStore::open(of_children));
    while (const auto job = value(store->claim()))
      value(store->apply(job->id, {.event = Event::succeed, .claim = job->claim_number}));
  };
  std::vector<std::unique_ptr<Child>> children;
  for (int i = 0; i < processes; ++i) children.push_back(std::make_unique<Child>(work));
  for (const auto& child : children) child->tell('g');
  for (const auto& child : children) EXPECT_TRUE(child->ended_well());
  const auto store = open();
  std::map<std::string, Job> last;  // by lane
  std::size_t done = 0;
  auto all = value(store->list({.limit = many}));
  for (auto job = all.rbegin(); job != all.rend(); ++job, ++done) {
    EXPECT_EQ(job->state, JobState::succeeded);
    EXPECT_EQ(job->claim_number, 1) << job->id << " was given away more than once";
    if (const auto before = last.find(job->lane); before != last.end()) {
      EXPECT_GE(*job->started, *before->second.ended) << job->id << " ran beside " << before->second.id;
    }
    last[job->lane] = *job;
  }
  EXPECT_EQ(done, std::size_t(jobs));
}

/// A worker over a queue of its own.
struct Process {
  Process(const PostgresOptions& options, const fs::path& folder, JobFunction function)
      : store(value(PostgresStore::open(options))),
        queue(open_queue(*store, folder)),
        worker(*queue, std::move(function), {.progress_period = 0ms, .retry_period = 5ms, .poll_period = 20ms}) {}
  std::unique_ptr<PostgresStore> store;
  std::unique_ptr<Queue> queue;
  Worker worker;
};

TEST_F(PostgresStoreTest, AHolderThatIsFrozenBeyondItsLeaseWritesNothingWhenItWakes) {
  const support::TempDir dir;
  const Child frozen([&](const Child& self) {
    int refused = 0;
    std::binary_semaphore began{0};
    Process process(options(), dir.path(), [&](JobContext& context) -> Result<JobResult> {
      began.release();
      self.say('h');
      self.listen();
      refused += code_of(context.confirm_claim()) == ErrorCode::cancelled ? 1 : 0;
      refused += code_of(context.save_checkpoint(1, "late")) == ErrorCode::cancelled ? 1 : 0;
      context.publish_progress("late");
      context.enter("late");
      return JobResult{.text = "late"};
    });
    value(process.queue->submit({.lane = "a", .payload = "{}"}));
    began.acquire();
    process.worker.drain(patience);
    if (refused != 2) throw std::runtime_error("what came late was not refused");
  });
  ASSERT_EQ(frozen.hear(), 'h');
  frozen.signal(SIGSTOP);
  advance(31s);
  const auto store = open();
  const auto job = value(store->claim());
  ASSERT_TRUE(job);
  EXPECT_EQ(job->claim_number, 2);
  value(store->apply(job->id, {.event = Event::report, .claim = 2, .progress = "of the second"}));
  frozen.signal(SIGCONT);
  frozen.tell('g');
  EXPECT_TRUE(frozen.ended_well());
  const Job after = value(store->find(job->id));
  EXPECT_EQ(after.progress, "of the second");
  EXPECT_EQ(after.state, JobState::running);
  EXPECT_TRUE(after.claimed);
  EXPECT_EQ(after.finished_intervals, 0);
  EXPECT_FALSE(fs::exists(dir.path() / "jobs" / job->id)) << "no checkpoint";
}

TEST_F(PostgresStoreTest, WhatAKilledProcessHeldGoesOnAtItsCheckpoint) {
  const support::TempDir dir;
  const Child killed([&](const Child& self) {
    Process process(options(), dir.path(), [&](JobContext& context) -> Result<JobResult> {
      value(context.save_checkpoint(1, "one"));
      self.say('h');
      self.listen();
      return JobResult{};
    });
    value(process.queue->submit({.lane = "a", .payload = "{}"}));
    self.listen();
  });
  ASSERT_EQ(killed.hear(), 'h');
  killed.kill();
  EXPECT_FALSE(killed.ended_well());
  std::string went_on_from;
  Process other(options(), dir.path(), [&](JobContext& context) -> Result<JobResult> {
    went_on_from = value(context.load_checkpoint());
    return JobResult{.text = "two"};
  });
  EXPECT_EQ(value(other.queue->find("e000001")).claim_number, 1) << "its claim lasts";
  advance(31s);
  EXPECT_EQ(wait_for_end(*other.queue, "e000001").result, "two") << "an idle worker looks by itself";
  EXPECT_EQ(went_on_from, "one");
}

TEST_F(PostgresStoreTest, AWorkerKeepsItsClaimWhateverItsJobDoes) {
  const support::TempDir dir;
  std::binary_semaphore arrived{0}, gate{0};
  PostgresOptions of_worker = options();
  of_worker.lease = 60ms;  // of a clock that stands still: it is renewed every 20 ms
  Process process(of_worker, dir.path(), [&](JobContext&) -> Result<JobResult> {
    arrived.release();
    gate.acquire();
    return JobResult{};
  });
  const std::string id = value(process.queue->submit({.lane = "a", .payload = "{}"})).job.id;
  arrived.acquire();
  const auto other = open();
  const auto lasts_until = [&](Time time) {
    return database->run("SELECT lease_until FROM splatdrag.jobs") == std::to_string(time.time_since_epoch().count());
  };
  for (int i = 0; i < 5; ++i) {
    advance(50ms);
    wait_until([&] { return lasts_until(now + 60ms); }, "a claim that is renewed");
    EXPECT_FALSE(value(other->claim()));
  }
  gate.release();
  EXPECT_EQ(wait_for_end(*process.queue, id).claim_number, 1);
}

TEST_F(PostgresStoreTest, AWorkerHeedsWhatIsAskedOfAnother) {
  const support::TempDir dir;
  std::binary_semaphore arrived{0};
  PostgresOptions of_worker = options();
  of_worker.lease = 60ms;
  Process process(of_worker, dir.path(), [&](JobContext& context) -> Result<JobResult> {
    if (context.finished_intervals() == 0) value(context.save_checkpoint(1, "one"));
    arrived.release();
    wait_until([&] { return context.stop_requested() || context.cancel_token().stop_requested(); }, "a request");
    if (!context.stop_requested()) return fail(ErrorCode::cancelled, "cancelled");
    return JobResult{.text = "one", .stopped_early = true};
  });
  const auto other = open();
  const std::string stopped = submit(*other, "a");
  arrived.acquire();
  value(other->apply(stopped, {.event = Event::stop}));
  EXPECT_EQ(wait_for_end(*process.queue, stopped).result, "one");
  const std::string cancelled = submit(*other, "b");
  arrived.acquire();
  value(other->apply(cancelled, {.event = Event::cancel}));
  EXPECT_EQ(wait_for_end(*process.queue, cancelled).state, JobState::cancelled);
}

TEST_F(PostgresStoreTest, TellsOfWhatOthersDoButNotOfWhatItDoesItself) {
  const auto store = open(), other = open();
  std::atomic<int> news = 0;
  store->watch([&] { ++news; });
  wait_until([&] { return news == 1; }, "that it listens");
  submit(*store);
  submit(*other);
  wait_until([&] { return news == 2; }, "news of another");
  (void)value(other->claim());
  value(other->apply("e000001", {.event = Event::report, .claim = 1}));
  wait_until([&] { return news == 3; }, "more news; a claim is none");
  store->watch({});
  submit(*other);
  EXPECT_EQ(news, 3);
}

TEST_F(PostgresStoreTest, AnIdleWorkerFindsWhatNobodyHasToldItOf) {
  const support::TempDir dir;
  Process process(options(), dir.path(), [](JobContext&) { return JobResult{.text = "found"}; });
  database->run(
      "INSERT INTO splatdrag.jobs (number, lane, payload, expected, turn, state, created) "
      "VALUES (7, 'a', '', 0, 0, 'queued', 0)");
  wait_until([&] { return value(process.store->find("e000007")).state == JobState::succeeded; }, "its end");
}

// A server that goes away.

TEST_F(PostgresStoreTest, AServerThatIsRestartedInTheMiddleOfAJobLosesNothing) {
  const support::TempDir dir;
  PostgresServer& server = PostgresServer::shared();
  for (const ServerStop how : {ServerStop::fast, ServerStop::crash}) {
    std::binary_semaphore arrived{0}, gate{0};
    Process process(options(), dir.path(), [&](JobContext& context) -> Result<JobResult> {
      arrived.release();
      gate.acquire();
      value(context.save_checkpoint(1, "one"));
      value(context.confirm_claim());
      return JobResult{.text = value(context.load_checkpoint())};
    });
    const std::string id = value(process.queue->submit({.lane = "a", .payload = "{}"})).job.id;
    arrived.acquire();
    server.stop(how);
    const auto refused = process.queue->submit({.lane = "b", .payload = "{}"});
    EXPECT_EQ(code_of(refused), ErrorCode::unavailable);
    EXPECT_TRUE(refused.error().message.starts_with("the job store cannot be reached: ")) << refused.error().message;
    EXPECT_EQ(code_of(process.queue->find(id)), ErrorCode::unavailable);
    gate.release();
    wait_until([&] { return process.worker.trouble().has_value(); }, "that the worker meets it");
    EXPECT_EQ(process.worker.trouble()->code, ErrorCode::unavailable);
    server.start();
    // The first who ask may be refused as those before them were.
    wait_until([&] { return process.queue->find(id).has_value(); }, "that it is reached again");
    const Job done = wait_for_end(*process.queue, id);
    EXPECT_EQ(done.state, JobState::succeeded);
    EXPECT_EQ(done.result, "one");
    EXPECT_EQ(done.claim_number, 1);
    process.worker.drain(patience);
    EXPECT_FALSE(process.worker.trouble());
    EXPECT_EQ(value(process.store->list({.active_only = true})).size(), 0u) << "what was refused is not there";
  }
}

TEST_F(PostgresStoreTest, AWorkerThatEndsWhileTheServerIsAwayFailsNoJob) {
  const support::TempDir dir;
  PostgresServer& server = PostgresServer::shared();
  std::binary_semaphore arrived{0}, gate{0};
  std::optional<ErrorCode> told;
  {
    Process process(options(), dir.path(), [&](JobContext& context) -> Result<JobResult> {
      value(context.confirm_claim());
      arrived.release();
      gate.acquire();
      const auto saved = context.save_checkpoint(1, "one");
      told = code_of(saved);
      return propagate(saved);
    });
    value(process.queue->submit({.lane = "a", .payload = "{}"}));
    arrived.acquire();
    server.stop(ServerStop::crash);
    gate.release();
    wait_until([&] { return process.worker.trouble().has_value(); }, "that the worker meets it");
    process.worker.drain(patience);
  }
  EXPECT_EQ(told, ErrorCode::cancelled);
  server.start();
  advance(31s);
  Process other(options(), dir.path(), [](JobContext&) { return JobResult{.text = "done"}; });
  const Job job = wait_for_end(*other.queue, "e000001");
  EXPECT_EQ(job.result, "done");
  EXPECT_EQ(job.claim_number, 2);
}

TEST_F(PostgresStoreTest, AConnectionThatWasLostMeanwhileIsReplaced) {
  const auto store = open();
  const std::string id = submit(*store);
  const std::string end_all =
      "SELECT count(pg_terminate_backend(pid, 5000)) FROM pg_stat_activity WHERE application_name = 'splatdrag' AND "
      "datname = current_database()";
  for (int i = 0; i < 3; ++i) {
    EXPECT_NE(database->run(end_all), "0");
    const bool works = i == 0   ? store->find(id).has_value()
                       : i == 1 ? value(store->claim()).has_value()
                                : store->renew(id, 1).has_value();
    EXPECT_TRUE(works) << i;
  }
}

TEST_F(PostgresStoreTest, ACommitWhoseAnswerIsLostIsFoundOut) {
  const support::TempDir dir;
  const fs::path name = ".s.PGSQL.5432";
  const std::string address = options().address;
  const std::string before = "?host=";
  const fs::path server = address.substr(address.find(before) + before.size());
  support::UnixLink link(dir.path() / name, server / name);
  PostgresOptions through = options();
  through.address = address.substr(0, address.find(before)) + before + dir.path().string();
  const auto store = value(PostgresStore::open(through));
  int witnessed = 0;
  const auto witness = [&](const Job&) -> Result<void> {
    ++witnessed;
    return {};
  };
  link.cut_after("COMMIT");
  const auto submitted = value(store->submit({.lane = "a", .payload = "{}"}, many, witness));
  EXPECT_EQ(link.cuts(), 1);
  EXPECT_EQ(submitted.job.id, "e000001");
  EXPECT_EQ(witnessed, 1) << "it was not done again";
  link.cut_after("FOR UPDATE");
  EXPECT_EQ(value(store->claim())->claim_number, 1) << "what was lost before the end is done again";
  EXPECT_EQ(link.cuts(), 2);
  link.cut_after("COMMIT");
  EXPECT_EQ(value(store->apply("e000001", {.event = Event::finish_interval, .claim = 1, .interval = 1})).state,
            JobState::running);
  EXPECT_EQ(link.cuts(), 3);
  EXPECT_EQ(value(store->list({})).size(), 1u);
}

TEST_F(PostgresStoreTest, ACommitThatFailedWithItsConnectionIsNotSaidToBeDone) {
  const auto store = open();
  database->run(
      "CREATE FUNCTION die() RETURNS trigger LANGUAGE plpgsql AS "
      "$$BEGIN PERFORM pg_terminate_backend(pg_backend_pid()); PERFORM pg_sleep(10); RETURN NULL; END$$; "
      "CREATE CONSTRAINT TRIGGER die AFTER INSERT ON splatdrag.jobs DEFERRABLE INITIALLY DEFERRED "
      "FOR EACH ROW EXECUTE FUNCTION die()");
  int witnessed = 0;
  const auto refused = store->submit({.lane = "a", .payload = "{}"}, many, [&](const Job&) -> Result<void> {
    ++witnessed;
    return {};
  });
  EXPECT_EQ(code_of(refused), ErrorCode::unavailable);
  EXPECT_EQ(witnessed, 1) << "whoever has seen it takes it back; done again, it would have been seen twice";
  database->run("DROP TRIGGER die ON splatdrag.jobs");
  EXPECT_EQ(value(store->list({})).size(), 0u);
  EXPECT_EQ(submit(*store), "e000001");
}

// Who may have it open.

TEST_F(PostgresStoreTest, SeveralMakeTheTablesAtOnce) {
  std::vector<std::thread> openers;
  std::atomic<int> opened = 0;
  for (int i = 0; i < 6; ++i)
    openers.emplace_back([&] { opened += PostgresStore::open(options()).has_value() ? 1 : 0; });
  for (std::thread& opener : openers) opener.join();
  EXPECT_EQ(opened, 6);
  EXPECT_EQ(database->run("SELECT count(*) FROM splatdrag.store"), "1");
}

TEST_F(PostgresStoreTest, OneThatWantsToBeAloneIsAlone) {
  PostgresOptions alone = options();
  alone.alone = true;
  alone.busy_timeout = 10ms;
  auto store = value(PostgresStore::open(alone));
  for (const bool second_alone : {true, false}) {
    PostgresOptions second = alone;
    second.alone = second_alone;
    const auto refused = PostgresStore::open(second);
    ASSERT_EQ(code_of(refused), ErrorCode::unavailable);
    EXPECT_EQ(refused.error().message, "another process has this job store open: end it, or choose another database");
  }
  submit(*store);
  (void)value(store->claim());
  store.reset();
  const auto shared = value(PostgresStore::open(options()));
  EXPECT_TRUE(value(shared->find("e000001")).claimed) << "the other may be alive";
  EXPECT_EQ(code_of(PostgresStore::open(alone)), ErrorCode::unavailable);
}

TEST_F(PostgresStoreTest, WhoVisitsIsNotKeptOutAndKeepsNobodyOut) {
  PostgresOptions visits = options();
  visits.visits = true;
  EXPECT_EQ(code_of(PostgresStore::open(visits)), ErrorCode::not_found) << "no tables are made for a visitor";
  PostgresOptions alone = options();
  alone.alone = true;
  alone.holder = "host:1";
  const auto service = value(PostgresStore::open(alone));
  submit(*service);
  const Job claimed = *value(service->claim());
  const auto visitor = value(PostgresStore::open(visits));
  const Job seen = value(visitor->find(claimed.id));
  EXPECT_TRUE(seen.claimed);
  EXPECT_EQ(seen.holder, "host:1");
  ASSERT_TRUE(seen.lease_until);
  EXPECT_GT(*seen.lease_until, value(visitor->now()));
  value(service->apply(claimed.id, {.event = Event::fail, .claim = claimed.claim_number}));
  EXPECT_EQ(value(visitor->requeue(claimed.id, 0)).state, JobState::queued);
  EXPECT_EQ(value(service->claim())->id, claimed.id);
  visits.owner = "folder 2";
  database->run("UPDATE splatdrag.store SET owner = 'folder 1'");
  EXPECT_EQ(code_of(PostgresStore::open(visits)), ErrorCode::conflict);
}

TEST_F(PostgresStoreTest, NoLaneIsWorkedOnTwiceWhileJobsAreTakenUpAgain) {
  // Whoever requeues, submits and claims at the same time: a lane never has two that are held.
  const auto store = open();
  for (int i = 0; i < 3; ++i) submit(*store);
  std::atomic<int> together = 0, requeued = 0, ended = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 2; ++t)
    threads.emplace_back([&] {
      const auto worker = open();
      while (ended < 60) {
        const auto job = value(worker->claim());
        if (!job) continue;
        const auto active = value(worker->list({.active_only = true}));
        together += std::ranges::count_if(active, [](const Job& other) { return other.claimed; }) > 1 ? 1 : 0;
        value(worker->apply(job->id, {.event = Event::fail, .claim = job->claim_number}));
        ++ended;
      }
    });
  threads.emplace_back([&] {
    const auto visitor = open();
    while (ended < 60) {
      for (const Job& job : value(visitor->list({})))
        if (visitor->requeue(job.id, 0)) ++requeued;
      if (value(visitor->list({.active_only = true})).empty()) submit(*visitor);
    }
  });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(together, 0);
  EXPECT_GT(requeued, 0);
}

TEST_F(PostgresStoreTest, TablesOfTheVersionBeforeAreBroughtUpToDate) {
  {
    const auto store = open();
    submit(*store);
    (void)value(store->claim());
  }
  database->run(
      "ALTER TABLE splatdrag.jobs DROP COLUMN requester, DROP COLUMN worked, DROP COLUMN holder, DROP COLUMN "
      "claimed_at; DROP TABLE splatdrag.worked; UPDATE splatdrag.store SET schema_number = 1");
  PostgresOptions visits = options();
  visits.visits = true;
  EXPECT_EQ(code_of(PostgresStore::open(visits)), ErrorCode::unsupported) << "a visitor changes no tables";
  const Job job = value(open()->find("e000001"));
  EXPECT_TRUE(job.claimed);
  EXPECT_EQ(job.holder, "");
  EXPECT_FALSE(job.claimed_at);
  EXPECT_EQ(job.requester, "");
}

TEST_F(PostgresStoreTest, JobsOfAnotherOwnerAreLeftAlone) {
  PostgresOptions ours = options();
  ours.owner = "folder 1";
  ours.owner_for_people = "here:/srv/one";
  (void)value(PostgresStore::open(ours));
  ours.owner_for_people = "here:/srv/moved";
  submit(*value(PostgresStore::open(ours)));
  PostgresOptions others = options();
  others.owner = "folder 2";
  const auto refused = PostgresStore::open(others);
  ASSERT_EQ(code_of(refused), ErrorCode::conflict);
  EXPECT_NE(refused.error().message.find("(here:/srv/moved)"), std::string::npos) << refused.error().message;
  EXPECT_EQ(code_of(PostgresStore::move_away(others)), ErrorCode::conflict);
  EXPECT_EQ(value(value(PostgresStore::open(ours))->list({})).size(), 1u);
}

TEST_F(PostgresStoreTest, ADatabaseThatIsSetAsideIsKept) {
  EXPECT_EQ(value(PostgresStore::move_away(options())), "") << "there is nothing";
  {
    const auto store = open();
    submit(*store);
    PostgresOptions impatient = options();
    impatient.busy_timeout = 10ms;
    EXPECT_EQ(code_of(PostgresStore::move_away(impatient)), ErrorCode::unavailable) << "it is in use";
  }
  EXPECT_EQ(value(PostgresStore::move_away(options())), "splatdrag_damaged_1");
  EXPECT_EQ(value(open()->list({})).size(), 0u);
  EXPECT_EQ(value(PostgresStore::move_away(options())), "splatdrag_damaged_2");
  EXPECT_EQ(database->run("SELECT count(*) FROM splatdrag_damaged_1.jobs"), "1");
}

TEST_F(PostgresStoreTest, ADatabaseThatHasToHaveJobsAndHasNoneIsMissed) {
  PostgresOptions missed = options();
  missed.must_exist = true;
  const auto refused = PostgresStore::open(missed);
  ASSERT_EQ(code_of(refused), ErrorCode::corrupt_data);
  EXPECT_EQ(refused.error().message, "the database has no jobs, but there have been some");
  (void)open();
  EXPECT_TRUE(PostgresStore::open(missed)) << "now there is a store, if an empty one";
}

TEST_F(PostgresStoreTest, TablesOfANewerVersionAreLeftAlone) {
  auto store = open();
  database->run("UPDATE splatdrag.store SET schema_number = 99");
  const auto refused = PostgresStore::open(options());
  ASSERT_EQ(code_of(refused), ErrorCode::unsupported);
  EXPECT_TRUE(refused.error().message.starts_with("the job store was written by a newer version (99, known is 2)"))
      << refused.error().message;
  database->run("SELECT pg_terminate_backend(pid, 5000) FROM pg_stat_activity WHERE application_name = 'splatdrag'");
  EXPECT_EQ(code_of(store->list({})), ErrorCode::unsupported) << "of whoever was there before, too";
}

TEST_F(PostgresStoreTest, TablesThatAreNotOursAreNamed) {
  const auto store = open();
  database->run("ALTER TABLE splatdrag.jobs DROP COLUMN turn CASCADE");
  const auto damaged = store->submit({.lane = "a", .payload = "{}"}, many);
  ASSERT_EQ(code_of(damaged), ErrorCode::corrupt_data);
  EXPECT_TRUE(damaged.error().message.starts_with("the job store is damaged: ")) << damaged.error().message;
  database->run("DROP SCHEMA splatdrag CASCADE");
  EXPECT_EQ(code_of(store->list({})), ErrorCode::corrupt_data);
}

// What an operator sees.

Error error_of(const std::string& address) {
  const auto opened = PostgresStore::open({.address = address});
  if (opened) throw std::runtime_error("it opened");
  const Error& error = opened.error();
  for (const std::string* text : {&error.message, &error.where})
    EXPECT_EQ(text->find("secret"), std::string::npos) << *text;
  return error;
}

TEST(PostgresAddress, ThatCannotBeReadIsNotRepeated) {
  for (const char* address : {"", "jobs.db", "mysql://me:secret@host/jobs", "host=here password=secret",
                              "postgresql://me:secret%zz@host/jobs", "postgresql://me:se/secret@host/jobs",
                              "postgresql://me:1/secret@host/jobs", "postgresql://me:x@secret@host/jobs",
                              "postgresql://me:secret@host/jobs?color=blue", "postgresql://me:secret@host:port/jobs"}) {
    const Error error = error_of(address);
    EXPECT_EQ(error.code, ErrorCode::invalid_argument) << address;
    EXPECT_TRUE(error.message.starts_with("the address of the job store cannot be read: expected postgresql://user@"))
        << error.message;
    EXPECT_EQ(error.where, "");
  }
}

TEST(PostgresAddress, ThatLeadsNowhereIsNamedWithoutItsPassword) {
  const support::TempDir dir;
  const Error error = error_of("postgresql://me:secret@/jobs?host=" + dir.path().string());
  EXPECT_EQ(error.code, ErrorCode::unavailable);
  EXPECT_EQ(error.message, "the job store cannot be reached: No such file or directory");
  EXPECT_EQ(error.where, "postgresql://me@" + dir.path().string() + "/jobs");
  const Error refused = error_of("postgresql://me:secret@127.0.0.1:1/jobs");
  EXPECT_EQ(refused.message, "the job store cannot be reached: Connection refused");
  EXPECT_EQ(refused.where, "postgresql://me@127.0.0.1:1/jobs");
  const std::string no_name(70, 'x');  // longer than a name may be: nobody is asked
  EXPECT_EQ(error_of("postgresql://me:secret@" + no_name + "/jobs").message,
            "the job store cannot be reached: its host's name is not known");
}

TEST(PostgresAddress, WhoIsNotLetInIsToldSo) {
  REQUIRE_POSTGRES();
  PostgresServer server({.rules = "local all tests trust\nlocal all all scram-sha-256\n"});
  const std::string name = server.new_database();
  server.run(name, "CREATE ROLE visitor LOGIN PASSWORD 'right'; CREATE SCHEMA splatdrag AUTHORIZATION visitor");
  EXPECT_EQ(error_of(server.address(name, "visitor:secret")).message,
            "the job store cannot be reached: password authentication failed for user \"visitor\"");
  EXPECT_EQ(error_of(server.address(name, "visitor:password")).message,
            "the job store cannot be reached: (password) authentication failed for user \"visitor\"")
      << "a password that is a word of the message";
  EXPECT_EQ(error_of(server.address("nowhere")).message,
            "the job store cannot be reached: database \"nowhere\" does not exist");
  EXPECT_TRUE(PostgresStore::open({.address = server.address(name, "visitor:right")}))
      << "a schema of one's own will do";
  const std::string other = server.new_database();
  const Error no_rights = error_of(server.address(other, "visitor:right"));
  EXPECT_EQ(no_rights.code, ErrorCode::unavailable);
  EXPECT_TRUE(no_rights.message.starts_with("the job store cannot be used: permission denied")) << no_rights.message;
}

}  // namespace
}  // namespace engine::jobs
