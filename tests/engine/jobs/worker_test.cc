#include "engine/jobs/worker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <semaphore>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "engine/core/rng.h"
#include "engine/jobs/notes.h"
#include "tests/engine/jobs/jobs_support.h"
#include "tests/engine/jobs/store_kind.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

/// Passes when it is opened once for every passage; gives up when patience ends.
class Gate {
 public:
  void open() { semaphore_.release(); }
  void pass() {
    if (!semaphore_.try_acquire_for(patience)) throw std::runtime_error("the gate stayed shut");
  }

 private:
  std::counting_semaphore<> semaphore_{0};
};

/// A store between whose functions something happens, and whose claims have to be renewed often.
class Between final : public Store {
 public:
  explicit Between(Store& store) : store_(store) {}
  std::function<void(const Change&)> after_apply = [](const Change&) {};
  std::function<void()> before_requeue = [] {};
  bool loses_answer_to_requeue = false;
  std::function<std::optional<Error>()> instead_of_renew = [] { return std::nullopt; };

  using Store::requeue;
  using Store::submit;
  Result<Submission> submit(const NewJob& job, std::size_t max_queued, const Witness& witness) override {
    return store_.submit(job, max_queued, witness);
  }
  Result<void> check_room(std::size_t max_queued) override { return store_.check_room(max_queued); }
  Result<void> check_quota(const NewJob& job) override { return store_.check_quota(job); }
  Result<Usage> usage(const std::string& requester) override { return store_.usage(requester); }
  Result<Job> requeue(const std::string& id, int finished_intervals, const Witness& witness) override {
    before_requeue();
    auto job = store_.requeue(id, finished_intervals, witness);
    if (loses_answer_to_requeue) return fail(ErrorCode::unavailable, "the server has gone away");
    return job;
  }
  Result<Time> now() override { return store_.now(); }
  Result<void> restore(const Job& job) override { return store_.restore(job); }
  Result<Job> find(const std::string& id) override { return store_.find(id); }
  Result<std::optional<Job>> find_key(const std::string& key) override { return store_.find_key(key); }
  Result<std::vector<Job>> list(const Filter& filter) override { return store_.list(filter); }
  Result<std::optional<Job>> claim() override { return store_.claim(); }
  [[nodiscard]] std::optional<std::chrono::milliseconds> lease() const override { return 30ms; }
  Result<JobState> renew(const std::string& id, std::int64_t claim) override {
    if (auto error = instead_of_renew()) return tl::make_unexpected(std::move(*error));
    return store_.renew(id, claim);
  }
  Result<bool> should_make_way(const std::string& id, std::chrono::milliseconds left) override {
    return store_.should_make_way(id, left);
  }
  Result<Job> apply(const std::string& id, const Change& change) override {
    auto job = store_.apply(id, change);
    after_apply(change);
    return job;
  }
  Result<void> remove(const std::string& id) override { return store_.remove(id); }
  Result<std::vector<std::string>> expire(const Retention& retention) override { return store_.expire(retention); }
  void watch(std::function<void()> news) override { store_.watch(std::move(news)); }

 private:
  Store& store_;
};

tl::unexpected<Error> interrupted() { return fail(ErrorCode::cancelled, "interrupted"); }

class WorkerTest : public testing::TestWithParam<StoreKind> {
 protected:
  std::string submit(const std::string& payload = "", const std::string& lane = "a") {
    return value(queue->submit({.lane = lane, .payload = payload})).job.id;
  }
  void start(JobFunction function) {
    worker = std::make_unique<Worker>(*queue, std::move(function),
                                      WorkerOptions{.progress_period = 0ms, .retry_period = 5ms});
  }
  /// As after the end of the process: the worker leaves, the store and the queue are opened anew.
  void restart(JobFunction function) {
    worker.reset();
    queue.reset();
    store.reset();
    store = value(place->open({}));
    queue = open_queue(*store, dir.path());
    start(std::move(function));
  }
  [[nodiscard]] fs::path folder(const std::string& id) const { return dir.path() / "jobs" / id; }

  /// Three intervals; before each, it arrives at the gate, then passes or is cancelled.
  JobFunction three_intervals() {
    return [this](JobContext& context) -> Result<JobResult> {
      std::string done = context.finished_intervals() > 0 ? value(context.load_checkpoint()) : "";
      for (int u = context.finished_intervals() + 1; u <= 3; ++u) {
        if (context.stop_requested()) return JobResult{.text = done, .stopped_early = true};
        const std::stop_callback wake(context.cancel_token(), [this] { gate.open(); });
        arrived.open();
        gate.pass();
        if (context.cancel_token().stop_requested()) return interrupted();
        done += std::to_string(u);
        if (auto saved = context.save_checkpoint(u, done); !saved) return propagate(saved);
      }
      return JobResult{.text = done};
    };
  }

  support::TempDir dir;
  std::unique_ptr<StorePlace> place = GetParam().make_place(dir.path());
  std::unique_ptr<Store> store = value(place->open({}));
  std::unique_ptr<Queue> queue = open_queue(*store, dir.path());
  Gate gate, arrived;
  std::unique_ptr<Worker> worker;
};

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(WorkerTest);
INSTANTIATE_TEST_SUITE_P(Each, WorkerTest, testing::ValuesIn(store_kinds()));

/// Of stores whose files this process writes: its full disk is theirs.
class WorkerTestOnThisDisk : public WorkerTest {};
std::vector<StoreKind> kinds_on_this_disk() {
  std::vector<StoreKind> kinds = store_kinds();
  std::erase_if(kinds, [](const StoreKind& kind) { return kind.name != "Sqlite"; });
  return kinds;
}
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(WorkerTestOnThisDisk);
INSTANTIATE_TEST_SUITE_P(Each, WorkerTestOnThisDisk, testing::ValuesIn(kinds_on_this_disk()));

TEST_P(WorkerTest, DoesJobsInTheirOrder) {
  std::vector<std::string> order;
  for (const char* payload : {"one", "two", "three"}) submit(payload);
  start([&](JobContext& context) {
    order.push_back(context.payload());
    return JobResult{.text = context.payload() + " done"};
  });
  const Job last = wait_for_end(*queue, "e000003");
  EXPECT_EQ(last.state, JobState::succeeded);
  EXPECT_EQ(last.result, "three done");
  EXPECT_FALSE(last.stopped_early);
  EXPECT_EQ(order, (std::vector<std::string>{"one", "two", "three"}));
  const std::string late = submit("four");
  EXPECT_EQ(wait_for_end(*queue, late).result, "four done") << "a worker that waits must notice";
}

TEST_P(WorkerTest, LetsAShorterJobGoFirstAtACheckpointAndGoesOnFromThere) {
  std::vector<std::string> order;
  const std::string longest = value(queue->submit({.lane = "a", .payload = "long", .expected = 1h})).job.id;
  const auto function = [&](JobContext& context) -> Result<JobResult> {
    std::string done = context.finished_intervals() > 0 ? value(context.load_checkpoint()) : "";
    for (int u = context.finished_intervals() + 1; u <= (context.payload() == "long" ? 3 : 1); ++u) {
      if (context.payload() == "long" && u == 2 && order.size() == 1) {
        arrived.open();
        gate.pass();
      }
      order.push_back(context.payload() + " " + std::to_string(u));
      done += std::to_string(u);
      if (auto saved = context.save_checkpoint(u, done, 30min); !saved) return propagate(saved);
    }
    return JobResult{.text = done};
  };
  start(function);
  arrived.pass();
  const std::string of_lane = value(queue->submit({.lane = "a", .payload = "same lane", .expected = 1s})).job.id;
  const std::string shorter = value(queue->submit({.lane = "b", .payload = "short", .expected = 1s})).job.id;
  gate.open();
  EXPECT_EQ(wait_for_end(*queue, shorter).state, JobState::succeeded);
  EXPECT_EQ(wait_for_end(*queue, of_lane).state, JobState::succeeded);
  const Job done = value(queue->find(longest));
  EXPECT_EQ(done.state, JobState::succeeded);
  EXPECT_EQ(done.result, "123");
  EXPECT_EQ(done.deaths, 0);
  EXPECT_EQ(order, (std::vector<std::string>{"long 1", "long 2", "short 1", "long 3", "same lane 1"}));
}

TEST_P(WorkerTest, AJobThatMadeWayCanBeStoppedAndCancelled) {
  const std::string stopped = value(queue->submit({.lane = "a", .payload = "long", .expected = 1h})).job.id;
  const std::string cancelled = value(queue->submit({.lane = "b", .payload = "long", .expected = 2h})).job.id;
  std::string shorter;
  start([&](JobContext& context) -> Result<JobResult> {
    if (context.payload() == "short") {
      arrived.open();
      gate.pass();
      return JobResult{};
    }
    if (context.stop_requested()) return JobResult{.text = value(context.load_checkpoint()), .stopped_early = true};
    if (context.finished_intervals() > 0) return fail(ErrorCode::internal, "it was to be stopped");
    shorter = value(queue->submit({.lane = context.id(), .payload = "short", .expected = 1s})).job.id;
    if (auto saved = context.save_checkpoint(1, "one", 30min); !saved) return propagate(saved);
    return fail(ErrorCode::internal, "it did not make way");
  });
  arrived.pass();
  EXPECT_EQ(value(queue->find(stopped)).state, JobState::queued);
  EXPECT_EQ(value(queue->find(stopped)).finished_intervals, 1);
  EXPECT_EQ(value(queue->stop(stopped)).state, JobState::stop_requested);
  gate.open();
  EXPECT_EQ(wait_for_end(*queue, stopped).result, "one");
  EXPECT_TRUE(value(queue->find(stopped)).stopped_early);
  arrived.pass();
  EXPECT_EQ(value(queue->cancel(cancelled)).state, JobState::cancelled) << "nobody holds it";
  EXPECT_FALSE(fs::exists(folder(cancelled)));
  gate.open();
  EXPECT_EQ(wait_for_end(*queue, shorter).state, JobState::succeeded);
}

TEST_P(WorkerTest, RecordsTheErrorOfAJobAndGoesOn) {
  submit("bad");
  submit("good");
  start([](JobContext& context) -> Result<JobResult> {
    if (context.payload() == "bad") return fail(ErrorCode::unprocessable, "no Gaussians", "handles[0]");
    return JobResult{};
  });
  const Job bad = wait_for_end(*queue, "e000001");
  EXPECT_EQ(bad.state, JobState::failed);
  EXPECT_EQ(bad.error->code, ErrorCode::unprocessable);
  EXPECT_EQ(bad.error->where, "handles[0]");
  EXPECT_EQ(wait_for_end(*queue, "e000002").state, JobState::succeeded);
}

TEST_P(WorkerTest, AJobThatFailedGoesOnFromItsCheckpointOnceItIsTakenUpAgain) {
  const std::string id = submit();
  std::atomic<bool> broken = true;
  start([&](JobContext& context) -> Result<JobResult> {
    std::string done = context.finished_intervals() > 0 ? value(context.load_checkpoint()) : "";
    for (int u = context.finished_intervals() + 1; u <= 3; ++u) {
      if (u == 3 && broken) return fail(ErrorCode::unavailable, "there is no model");
      done += std::to_string(u);
      if (auto saved = context.save_checkpoint(u, done); !saved) return propagate(saved);
    }
    return JobResult{.text = done + (broken ? "" : " at last")};
  });
  EXPECT_EQ(wait_for_end(*queue, id).state, JobState::failed);
  EXPECT_TRUE(fs::exists(folder(id) / "checkpoint-2")) << "it may be wanted";
  broken = false;
  value(queue->requeue(id));
  EXPECT_EQ(wait_for_end(*queue, id).result, "123 at last");
  worker->drain(patience);
  EXPECT_TRUE(fs::is_empty(folder(id)));
}

TEST_P(WorkerTest, AJobThatFailedOfAFullDiskGivesItsCheckpointBack) {
  const std::string id = submit();
  std::atomic<bool> full = true;
  start([&](JobContext& context) -> Result<JobResult> {
    EXPECT_EQ(context.finished_intervals(), 0);
    if (auto saved = context.save_checkpoint(1, "one"); !saved) return propagate(saved);
    if (full) return fail(ErrorCode::no_space, "the disk is full");
    return JobResult{};
  });
  EXPECT_EQ(wait_for_end(*queue, id).state, JobState::failed);
  value(queue->expire());  // waits for the end of what the worker does about it
  EXPECT_TRUE(fs::is_empty(folder(id)));
  full = false;
  value(queue->requeue(id));
  EXPECT_EQ(wait_for_end(*queue, id).state, JobState::succeeded);
}

/// Jobs that other processes take up again or remove at whatever moment.
class RequeueTest : public WorkerTest {
 protected:
  void TearDown() override {
    worker.reset();
    queue.reset();
  }
  std::string failed() {
    const std::string id = submit();
    const auto claimed = value(store->claim());
    value(write_note(jobs, value(store->apply(id, {.event = Event::fail, .claim = claimed->claim_number}))));
    queue.reset();
    queue = open_queue(between, dir.path());
    return id;
  }
  JobState noted(const std::string& id) { return value(read_note(jobs, id)).state; }
  /// As in another process.
  void take_up_again(const std::string& id) {
    value(store->requeue(id, 0, [&](const Job& again) { return write_note(jobs, again); }));
  }
  const fs::path jobs = dir.path() / "jobs";
  Between between{*store};
};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(RequeueTest);
INSTANTIATE_TEST_SUITE_P(Each, RequeueTest, testing::ValuesIn(store_kinds()));

TEST_P(RequeueTest, OneWhoseAnswerIsLostStands) {
  const std::string id = failed();
  between.loses_answer_to_requeue = true;
  EXPECT_EQ(code_of(queue->requeue(id)), ErrorCode::unavailable);
  EXPECT_EQ(value(store->find(id)).state, JobState::queued);
  EXPECT_EQ(noted(id), JobState::queued) << "the next start would put the failure back";
}

TEST_P(RequeueTest, OfTwoAtOnceTheSecondUndoesNothing) {
  const std::string id = failed();
  between.before_requeue = [&] { take_up_again(id); };
  EXPECT_EQ(code_of(queue->requeue(id)), ErrorCode::conflict);
  EXPECT_EQ(noted(id), JobState::queued);
}

TEST_P(RequeueTest, BringsNothingBackThatIsRemovedMeanwhile) {
  const std::string id = failed();
  between.before_requeue = [&] {
    value(store->remove(id));
    remove_traces(jobs, id);
  };
  EXPECT_EQ(code_of(queue->requeue(id)), ErrorCode::not_found);
  EXPECT_FALSE(fs::exists(jobs / (id + ".job")));
}

TEST_P(RequeueTest, OutlivesTheNoteOfTheWorkerThatRecordsTheFailure) {
  const std::string id = submit();
  queue.reset();
  queue = open_queue(between, dir.path());
  bool first = true;
  between.after_apply = [&](const Change& change) {
    if (change.event == Event::fail && std::exchange(first, false)) take_up_again(id);
  };
  start([&](JobContext&) -> Result<JobResult> {
    if (first) return fail(ErrorCode::unavailable, "there is no model");
    arrived.open();
    gate.pass();
    return JobResult{};
  });
  arrived.pass();
  EXPECT_EQ(noted(id), JobState::queued);
  gate.open();
  EXPECT_EQ(wait_for_end(*queue, id).state, JobState::succeeded);
}

TEST_P(WorkerTest, CountsTheTimeOfWork) {
  const std::string id = value(queue->submit({.lane = "a", .payload = "", .requester = "studio"})).job.id;
  start([&](JobContext& context) -> Result<JobResult> {
    std::this_thread::sleep_for(30ms);
    context.publish_progress("some");
    std::this_thread::sleep_for(30ms);
    if (auto saved = context.save_checkpoint(1, "x"); !saved) return propagate(saved);
    std::this_thread::sleep_for(30ms);
    return JobResult{};
  });
  const Job done = wait_for_end(*queue, id);
  EXPECT_GE(done.worked, 88ms) << "each part may be cut to whole milliseconds";
  EXPECT_LE(done.worked, *done.ended - *done.claimed_at + 50ms);
  EXPECT_EQ(value(store->usage("studio")).worked_today, done.worked) << "unless it was midnight";
}

TEST_P(WorkerTest, TurnsAnExceptionIntoAnInternalError) {
  submit("known");
  submit("unknown");
  start([](JobContext& context) -> Result<JobResult> {
    if (context.payload() == "known") throw std::out_of_range("vector::at");
    throw 7;
  });
  const Job known = wait_for_end(*queue, "e000001");
  EXPECT_EQ(known.state, JobState::failed);
  EXPECT_EQ(known.error->code, ErrorCode::internal);
  EXPECT_NE(known.error->message.find("vector::at"), std::string::npos);
  EXPECT_EQ(wait_for_end(*queue, "e000002").error->code, ErrorCode::internal);
}

TEST_P(WorkerTest, CancelsAJobThatWaitsAtOnce) {
  const std::string first = submit();
  const std::string second = submit();
  start(three_intervals());
  EXPECT_EQ(value(queue->cancel(second)).state, JobState::cancelled);
  EXPECT_EQ(value(queue->cancel(second)).state, JobState::cancelled);
  for (int u = 0; u < 3; ++u) gate.open();
  EXPECT_EQ(wait_for_end(*queue, first).state, JobState::succeeded);
  EXPECT_FALSE(value(queue->find(second)).started);
  EXPECT_EQ(code_of(queue->cancel(first)), ErrorCode::conflict) << "its result stands";
}

TEST_P(WorkerTest, CancelsAJobThatRunsAndRemovesItsFiles) {
  const std::string id = submit();
  start(three_intervals());
  gate.open();
  wait_for_interval(*queue, id, 1);
  EXPECT_TRUE(fs::exists(folder(id)));
  EXPECT_EQ(code_of(queue->remove(id)), ErrorCode::conflict);
  const JobState state = value(queue->cancel(id)).state;
  EXPECT_EQ(state, JobState::cancel_requested);
  EXPECT_EQ(wait_for_end(*queue, id).state, JobState::cancelled);
  worker.reset();
  EXPECT_FALSE(fs::exists(folder(id)));
}

TEST_P(WorkerTest, DropsWhatAJobReturnsAfterACancel) {
  const std::string id = submit();
  Gate began;
  start([&](JobContext&) {
    began.open();
    gate.pass();
    return JobResult{.text = "too late"};
  });
  began.pass();
  value(queue->cancel(id));
  gate.open();
  const Job job = wait_for_end(*queue, id);
  EXPECT_EQ(job.state, JobState::cancelled);
  EXPECT_EQ(job.result, "");
}

TEST_P(WorkerTest, StopsAfterAnIntervalAndKeepsIt) {
  const std::string id = submit();
  start(three_intervals());
  wait_for(*queue, id, [](const Job& job) { return job.state == JobState::running; });
  EXPECT_EQ(code_of(queue->stop(id)), ErrorCode::conflict) << "there is nothing to keep";
  gate.open();
  wait_for_interval(*queue, id, 1);
  EXPECT_EQ(value(queue->stop(id)).state, JobState::stop_requested);
  EXPECT_EQ(value(queue->stop(id)).state, JobState::stop_requested);
  gate.open();
  const Job job = wait_for_end(*queue, id);
  EXPECT_EQ(job.state, JobState::succeeded);
  EXPECT_TRUE(job.stopped_early);
  EXPECT_TRUE(job.result == "1" || job.result == "12") << job.result;
  EXPECT_EQ(job.result.size(), std::size_t(job.finished_intervals));
  worker.reset();
  EXPECT_TRUE(fs::is_empty(folder(id))) << "the checkpoint has served its purpose";
}

TEST_P(WorkerTest, ShowsProgressAtOnce) {
  const std::string id = submit();
  Gate published;
  start([&](JobContext& context) {
    context.publish_progress("half");
    published.open();
    gate.pass();
    context.publish_progress("all");
    return JobResult{};
  });
  published.pass();
  EXPECT_EQ(value(queue->find(id)).progress, "half");
  EXPECT_EQ(value(queue->list())[0].progress, "half");
  const auto seen = queue->revision();
  gate.open();
  EXPECT_NE(queue->wait_for_change(seen, patience), seen);
  wait_for_end(*queue, id);
  EXPECT_EQ(value(store->find(id)).progress, "all") << "the last word is on disk";
}

TEST_P(WorkerTest, NotesOnDiskWhatItIsAboutToDo) {
  const std::string id = submit();
  Gate entered;
  start([&](JobContext& context) {
    context.publish_progress("half");
    context.enter("interval 1, correct");
    entered.open();
    gate.pass();
    return JobResult{};
  });
  entered.pass();
  const Job job = value(store->find(id));
  EXPECT_EQ(job.place, "interval 1, correct");
  EXPECT_EQ(job.progress, "half") << "written along with it";
  gate.open();
  wait_for_end(*queue, id);
}

TEST_P(WorkerTest, WritesProgressToDiskOnlySoOften) {
  const std::string id = submit();
  Gate published;
  worker = std::make_unique<Worker>(
      *queue,
      [&](JobContext& context) {
        for (int i = 0; i < 1000; ++i) context.publish_progress(std::to_string(i));
        published.open();
        gate.pass();
        return JobResult{};
      },
      WorkerOptions{.progress_period = 1h});
  published.pass();
  EXPECT_EQ(value(queue->find(id)).progress, "999");
  EXPECT_EQ(value(store->find(id)).progress, "");
  gate.open();
  wait_for_end(*queue, id);
}

TEST_P(WorkerTest, WaitsNoLongerThanAsked) {
  const auto seen = queue->revision();
  EXPECT_EQ(queue->wait_for_change(seen, 1ms), seen);
  submit();
  EXPECT_NE(queue->wait_for_change(seen, patience), seen);
}

TEST_P(WorkerTest, MakesNothingMoreOfAJobThatAnotherHasTakenOver) {
  for (const bool asks : {true, false}) {
    SCOPED_TRACE(asks ? "asks before it goes on" : "does not ask");
    const std::string id = submit();
    ErrorCode told{};
    start([&, asks](JobContext& context) -> Result<JobResult> {
      value(context.confirm_claim());
      arrived.open();
      gate.pass();
      if (!asks) return JobResult{.text = "late"};
      EXPECT_EQ(code_of(context.confirm_claim()), ErrorCode::cancelled);
      EXPECT_TRUE(context.cancel_token().stop_requested());
      const auto saved = context.save_checkpoint(1, "late");
      told = code_of(saved);
      return propagate(saved);
    });
    arrived.pass();
    // Somebody else takes the job for abandoned, and claims it.
    Job record = value(store->find(id));
    record.claimed = false;
    value(store->restore(record));
    ASSERT_EQ(value(store->claim())->id, id);
    gate.open();
    worker->drain(patience);
    if (asks) {
      EXPECT_EQ(told, ErrorCode::cancelled);
    }
    const Job job = value(store->find(id));
    EXPECT_EQ(job.state, JobState::running);
    EXPECT_EQ(job.claim_number, 2);
    EXPECT_TRUE(job.claimed) << "by the other";
    EXPECT_FALSE(fs::exists(folder(id))) << "not even a checkpoint";
    EXPECT_FALSE(worker->trouble());
    value(store->apply(id, {.event = Event::succeed, .claim = 2, .result = "of the other"}));
    EXPECT_EQ(value(queue->find(id)).result, "of the other");
  }
}

TEST_P(WorkerTest, DrainsAtTheEndOfAnIntervalAndGoesOnAfterARestart) {
  const std::string id = submit();
  const std::string next = submit();
  start(three_intervals());
  gate.open();
  for (int u = 1; u <= 2; ++u) arrived.pass();
  const auto seen = queue->revision();  // the worker changes nothing while it waits: the next change is the drain's
  std::thread drain([&] { worker->drain(patience); });
  EXPECT_NE(queue->wait_for_change(seen, patience), seen);
  gate.open();  // the running interval may end
  drain.join();
  const Job left = value(queue->find(id));
  EXPECT_EQ(left.state, JobState::running);
  EXPECT_FALSE(left.claimed);
  EXPECT_EQ(left.finished_intervals, 2);
  EXPECT_EQ(value(queue->find(next)).state, JobState::queued);

  for (int u = 0; u < 4; ++u) gate.open();  // one for the third interval, three for the next job
  restart(three_intervals());
  EXPECT_EQ(wait_for_end(*queue, id).result, "123");
  EXPECT_EQ(wait_for_end(*queue, next).result, "123");
}

TEST_P(WorkerTest, TellsAJobThatGoesOnWhatItHadPublished) {
  submit();
  std::vector<std::string> earlier;
  const JobFunction publishing = [&](JobContext& context) -> Result<JobResult> {
    earlier.push_back(context.earlier_progress());
    context.publish_progress("half way");
    if (auto saved = context.save_checkpoint(context.finished_intervals() + 1, ""); !saved) return propagate(saved);
    if (context.finished_intervals() > 1) return JobResult{};
    const std::stop_callback wake(context.cancel_token(), [this] { gate.open(); });
    arrived.open();
    gate.pass();
    return interrupted();
  };
  start(publishing);
  arrived.pass();
  worker->drain(0s);
  restart(publishing);
  wait_for_end(*queue, "e000001");
  EXPECT_EQ(earlier, (std::vector<std::string>{"", "half way"}));
}

TEST_P(WorkerTest, InterruptsAJobThatTakesLongerThanTheGrace) {
  const std::string id = submit();
  start(three_intervals());
  gate.open();
  wait_for_interval(*queue, id, 1);
  worker->drain(1ms);
  EXPECT_EQ(value(queue->find(id)).state, JobState::running);
  EXPECT_EQ(value(queue->find(id)).finished_intervals, 1);
  EXPECT_EQ(value(queue->cancel(id)).state, JobState::cancelled) << "nobody is at work on it";
  EXPECT_FALSE(fs::exists(folder(id)));
}

TEST_P(WorkerTest, DrainsAnIdleWorkerWithoutDelay) {
  start(three_intervals());
  const auto begin = std::chrono::steady_clock::now();
  worker->drain(patience);
  worker->drain(patience);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 10s);
  submit();
  EXPECT_EQ(value(queue->find("e000001")).state, JobState::queued);
}

TEST_P(WorkerTest, EndsAStoppedJobAfterARestartFromItsCheckpoint) {
  const std::string id = submit();
  start(three_intervals());
  gate.open();
  wait_for_interval(*queue, id, 1);
  // The request reaches the record, then the process dies before the job can react.
  value(store->apply(id, {.event = Event::stop}));
  restart(three_intervals());
  const Job job = wait_for_end(*queue, id);
  EXPECT_EQ(job.state, JobState::succeeded);
  EXPECT_TRUE(job.stopped_early);
  EXPECT_EQ(job.result, "1");
}

TEST_P(WorkerTest, KeepsFilesThatNobodyKnowsWhenItOpens) {
  const std::string id = submit();
  start(three_intervals());
  gate.open();
  wait_for_interval(*queue, id, 1);
  for (const char* name : {"e000099", "notes"}) fs::create_directories(folder(name));
  restart(three_intervals());
  EXPECT_TRUE(fs::exists(folder(id)));
  EXPECT_TRUE(fs::exists(folder("e000099"))) << "the store may have lost it: nobody removes it but a person";
  EXPECT_TRUE(fs::exists(folder("notes"))) << "no job's name: none of our business";
}

TEST_P(WorkerTest, RemovesARecordWithItsFiles) {
  const std::string id = submit();
  start(three_intervals());
  for (int u = 0; u < 3; ++u) gate.open();
  wait_for_end(*queue, id);
  value(queue->remove(id));
  EXPECT_FALSE(fs::exists(folder(id)));
  EXPECT_EQ(code_of(queue->find(id)), ErrorCode::not_found);
}

// The record says that a job has ended before its worker has put away what is beside it.
TEST_P(WorkerTest, NothingIsLeftOfAJobThatIsRemovedTheMomentItEnds) {
  start([](JobContext& context) -> Result<JobResult> {
    if (auto saved = context.save_checkpoint(1, "x"); !saved) return propagate(saved);
    return JobResult{};
  });
  for (int i = 0; i < 40; ++i) {
    const std::string id = submit();
    const auto deadline = std::chrono::steady_clock::now() + patience;
    while (value(queue->find(id)).state != JobState::succeeded && std::chrono::steady_clock::now() < deadline)
      std::this_thread::yield();
    value(queue->remove(id));
    queue->wait_for_change(queue->revision(), 1ms);
    for (const auto& left : fs::directory_iterator(dir.path() / "jobs"))
      EXPECT_FALSE(left.path().filename().string().starts_with(id)) << left.path();
  }
}

TEST_P(WorkerTest, NothingIsLeftOfAJobThatAnotherProcessRemovesTheMomentItEnds) {
  Between between(*store);
  between.after_apply = [&](const Change& change) {
    if (change.event == Event::succeed) (void)store->remove("e000001");
  };
  queue = open_queue(between, dir.path());
  const std::string id = submit();
  start([](JobContext& context) -> Result<JobResult> {
    value(context.save_checkpoint(1, "one"));
    return JobResult{};
  });
  wait_for(*queue, submit("next", "b"), [](const Job& job) { return is_final(job.state); });
  EXPECT_FALSE(fs::exists(folder(id)));
  EXPECT_FALSE(fs::exists(dir.path() / "jobs" / (id + ".job"))) << "it would be taken for lost";
  worker.reset();
  queue.reset();
}

TEST_P(WorkerTest, TellsOfEachJobOnceItsEndIsRecorded) {
  std::vector<std::string> told;
  WorkerOptions options;
  options.ended = [&](const Job& job) {
    EXPECT_EQ(value(store->find(job.id)).state, job.state);
    told.push_back(job.result + std::string(to_string(job.state)));
  };
  for (const char* payload : {"well", "badly"}) submit(payload);
  worker = std::make_unique<Worker>(
      *queue,
      [](JobContext& context) -> Result<JobResult> {
        if (context.payload() == "badly") return fail(ErrorCode::not_found, "no");
        return JobResult{.text = "done, "};
      },
      options);
  wait_for_end(*queue, "e000002");
  worker.reset();
  EXPECT_EQ(told, (std::vector<std::string>{"done, succeeded", "failed"}));
}

TEST_P(WorkerTest, AClaimThatCanBeKeptAgainIsNoTroubleAnyMore) {
  Between between(*store);
  std::atomic<int> refusals = 0;
  between.instead_of_renew = [&]() -> std::optional<Error> {
    if (++refusals > 3) return std::nullopt;
    return Error{ErrorCode::no_space, "the disk of the store is full", {}};
  };
  queue = open_queue(between, dir.path());
  submit();
  start([this](JobContext&) -> Result<JobResult> {
    gate.pass();
    return JobResult{};
  });
  const auto deadline = std::chrono::steady_clock::now() + patience;
  const auto wait_until = [&](auto condition) {
    while (!condition() && std::chrono::steady_clock::now() < deadline) std::this_thread::sleep_for(100us);
    return condition();
  };
  EXPECT_TRUE(wait_until([&] { return worker->trouble() || refusals > 3; }));
  EXPECT_TRUE(wait_until([&] { return refusals > 3 && !worker->trouble(); })) << worker->trouble()->message;
  gate.open();
  worker.reset();
  queue.reset();
}

TEST_P(WorkerTest, ExpiresEndedJobsAsItWorks) {
  queue = value(Queue::open(*store, {.folder = dir.path() / "jobs", .retention = {.max_count = 1}}));
  for (int i = 0; i < 3; ++i) submit();
  start([](JobContext& context) -> Result<JobResult> {
    if (auto saved = context.save_checkpoint(1, "x"); !saved) return propagate(saved);
    return JobResult{};
  });
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (value(queue->list()).size() > 1 && std::chrono::steady_clock::now() < deadline)
    queue->wait_for_change(queue->revision(), 10ms);
  EXPECT_EQ(value(queue->list())[0].id, "e000003");
  worker.reset();
  EXPECT_FALSE(fs::exists(folder("e000001")));
}

TEST_P(WorkerTest, RemovesWhatAKilledRunLeftHalfWritten) {
  const std::string id = submit();
  fs::create_directories(folder(id));
  support::write_file(folder(id) / ".splatdrag-1-0.tmp", "half a checkpoint");
  support::write_file(folder(id) / "picture.jpg", "x");
  start([&](JobContext&) -> Result<JobResult> {
    EXPECT_FALSE(fs::exists(folder(id) / ".splatdrag-1-0.tmp"));
    EXPECT_TRUE(fs::exists(folder(id) / "picture.jpg"));
    return JobResult{};
  });
  EXPECT_EQ(wait_for_end(*queue, id).state, JobState::succeeded);
}

TEST_P(WorkerTest, NeverOverwritesACheckpointByAWrongNumber) {
  const std::string id = submit();
  start([](JobContext& context) -> Result<JobResult> {
    if (auto saved = context.save_checkpoint(2, "right"); !saved) return propagate(saved);
    EXPECT_EQ(code_of(context.save_checkpoint(2, "wrong")), ErrorCode::invalid_argument);
    return JobResult{.text = value(context.load_checkpoint())};
  });
  EXPECT_EQ(wait_for_end(*queue, id).result, "right");
}

TEST_P(WorkerTestOnThisDisk, FailsTheJobOnAFullDiskAndHarmsNothingElse) {
  const std::string id = submit();
  const std::string next = submit();
  std::optional<FullDisk> full;
  start([&](JobContext& context) -> Result<JobResult> {
    if (context.id() == next) return JobResult{.text = "fine"};
    if (auto saved = context.save_checkpoint(1, "small"); !saved) return propagate(saved);
    full.emplace(fs::file_size(dir.path() / "jobs.db-wal"));
    if (auto saved = context.save_checkpoint(2, std::string(1'000'000, 'x')); !saved) return propagate(saved);
    return JobResult{};
  });
  // Not even the failure can be recorded now; the worker says so and tries again.
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!worker->trouble() && std::chrono::steady_clock::now() < deadline) std::this_thread::sleep_for(1ms);
  ASSERT_TRUE(worker->trouble());
  EXPECT_EQ(worker->trouble()->code, ErrorCode::no_space);
  full.reset();
  const Job job = wait_for_end(*queue, id);
  EXPECT_EQ(job.state, JobState::failed);
  EXPECT_EQ(job.error->code, ErrorCode::no_space);
  EXPECT_EQ(job.finished_intervals, 1);
  EXPECT_FALSE(fs::exists(folder(id))) << "its files may be what took the last bytes";
  EXPECT_EQ(wait_for_end(*queue, next).result, "fine");
  worker->drain(patience);
  EXPECT_FALSE(worker->trouble());
}

TEST_P(WorkerTest, KeepsALaneInSequenceAmongSeveralWorkers) {
  std::mutex mutex;
  std::set<std::string> busy_lanes;
  std::map<std::string, std::vector<std::string>> order;
  std::size_t at_once = 0;
  std::map<std::string, Gate> began;
  for (const char* lane : {"a", "b"}) began[lane];
  const JobFunction function = [&](JobContext& context) {
    const std::string& lane = context.payload();
    {
      const std::lock_guard lock(mutex);
      EXPECT_TRUE(busy_lanes.insert(lane).second) << "two jobs of lane " << lane << " run at once";
      at_once = std::max(at_once, busy_lanes.size());
      order[lane].push_back(context.id());
    }
    if (context.id() == "e000001" || context.id() == "e000002") {  // the first of each lane wait for each other
      began.at(lane).open();
      began.at(lane == "a" ? "b" : "a").pass();
    }
    std::this_thread::sleep_for(1ms);
    const std::lock_guard lock(mutex);
    busy_lanes.erase(lane);
    return JobResult{};
  };
  for (int i = 0; i < 8; ++i) submit(i % 3 == 0 ? "a" : "b", i % 3 == 0 ? "a" : "b");
  {
    Worker first(*queue, function), second(*queue, function);
    for (const Job& job : value(queue->list())) wait_for_end(*queue, job.id);
  }
  EXPECT_EQ(at_once, 2u);
  for (const auto& [lane, ids] : order) EXPECT_TRUE(std::is_sorted(ids.begin(), ids.end())) << lane;
}

TEST_P(WorkerTest, BearsManyHandsAtOnce) {
  constexpr int threads = 4, rounds = 12;
  const JobFunction function = [](JobContext& context) -> Result<JobResult> {
    for (int u = context.finished_intervals() + 1; u <= 2; ++u) {
      if (context.cancel_token().stop_requested()) return interrupted();
      if (context.stop_requested()) return JobResult{.text = "early", .stopped_early = true};
      context.publish_progress(std::to_string(u));
      if (auto saved = context.save_checkpoint(u, context.id()); !saved) return propagate(saved);
    }
    return JobResult{.text = "whole"};
  };
  start(function);
  Worker second(*queue, function, {.progress_period = 0ms});
  std::atomic<bool> watching = true;
  std::thread watcher([&] {
    for (auto seen = queue->revision(); watching; seen = queue->wait_for_change(seen, 1s))
      for (const Job& job : value(queue->list())) EXPECT_EQ(is_final(job.state), job.ended.has_value()) << job.id;
  });
  std::vector<std::thread> hands;
  for (int t = 0; t < threads; ++t)
    hands.emplace_back([&, t] {
      Rng rng(1, std::uint64_t(t));
      for (int i = 0; i < rounds; ++i) {
        const std::string id = submit("", std::to_string(rng.below(3)));
        if (rng.below(2) == 0) queue->wait_for_change(queue->revision(), std::chrono::milliseconds(rng.below(4)));
        switch (rng.below(4)) {
          case 0:
            (void)queue->cancel(id);
            break;
          case 1:
            (void)queue->stop(id);
            break;
          case 2:
            (void)queue->remove(id);
            break;
          default:
            (void)queue->find(id);
        }
      }
    });
  for (std::thread& hand : hands) hand.join();
  for (const Job& job : value(queue->list())) {
    const Job end = wait_for_end(*queue, job.id);
    EXPECT_NE(end.state, JobState::failed) << end.error->message;
    EXPECT_EQ(end.result, end.state == JobState::cancelled ? "" : end.stopped_early ? "early" : "whole") << end.id;
  }
  watching = false;
  watcher.join();
}

}  // namespace
}  // namespace engine::jobs
