// kill -9 at any moment: no accepted job is lost, and results are those of a run that nobody disturbed.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <set>
#include <stdexcept>
#include <string>
#include <thread>

#include "engine/core/rng.h"
#include "engine/jobs/worker.h"
#include "tests/engine/jobs/jobs_support.h"
#include "tests/engine/jobs/store_kind.h"
#include "tests/support/child.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;

constexpr int kills = 20;
constexpr int id_length = 7;
constexpr int intervals_of_short_jobs = 3;

/// One interval of the job: depends on all that came before it.
std::uint64_t next_state(std::uint64_t state, int interval) {
  Rng rng(state, std::uint64_t(interval));
  return (std::uint64_t(rng.next()) << 32) | rng.next();
}

std::string undisturbed(int intervals) {
  std::uint64_t state = 1;
  for (int u = 1; u <= intervals; ++u) state = next_state(state, u);
  return std::to_string(state);
}

/// The payload is the number of intervals.
///   self  says 'i' for each of them that is saved, of jobs that are not short
Result<JobResult> count_intervals(JobContext& context, const support::Child& self) {
  const int intervals = std::stoi(context.payload());
  std::uint64_t state = 1;
  if (context.finished_intervals() > 0) {
    const auto checkpoint = context.load_checkpoint();
    if (!checkpoint) return propagate(checkpoint);
    state = std::stoull(*checkpoint);
  }
  for (int u = context.finished_intervals() + 1; u <= intervals; ++u) {
    state = next_state(state, u);
    std::this_thread::sleep_for(std::chrono::milliseconds(4));
    context.publish_progress(std::to_string(u));
    if (auto saved = context.save_checkpoint(u, std::to_string(state)); !saved) return propagate(saved);
    if (intervals > intervals_of_short_jobs) self.say('i');
  }
  return JobResult{.text = std::to_string(state)};
}

/// The process that is killed: accepts one job more, tells its id, works until all is done.
void serve(StorePlace& place, const fs::path& folder, int round, int accepted, const support::Child& self) {
  // The one before may still be dying; its lock goes with it.
  const auto store = value(place.open({.max_deaths = 0}));
  const auto queue = open_queue(*store, folder);
  Worker worker(*queue, [&](JobContext& context) { return count_intervals(context, self); },
                {.progress_period = std::chrono::milliseconds(5)});
  const std::string id = value(queue->submit({.lane = "b",
                                              .payload = std::to_string(intervals_of_short_jobs),
                                              .idempotency_key = "round " + std::to_string(round)}))
                             .job.id;
  if (::write(accepted, id.data(), id_length) != id_length) throw std::runtime_error("its id is not told");
  for (const Job& job : value(queue->list()))
    if (wait_for_end(*queue, job.id).state != JobState::succeeded)
      throw std::runtime_error(job.id + " did not succeed");
}

class Kill : public testing::TestWithParam<StoreKind> {};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(Kill);
INSTANTIATE_TEST_SUITE_P(Each, Kill, testing::ValuesIn(store_kinds()));

TEST_P(Kill, LosesNoAcceptedJobAndChangesNoResult) {
  const support::TempDir dir;
  const auto place = GetParam().make_place(dir.path());
  const auto reopened = [&] { return value(place->open({.max_deaths = 0})); };
  constexpr int intervals = 600;  // at 4 ms each: more than all rounds together give it
  std::string long_job;
  {
    const auto store = reopened();
    long_job =
        value(open_queue(*store, dir.path())->submit({.lane = "a", .payload = std::to_string(intervals)})).job.id;
  }
  int accepted[2];
  ASSERT_EQ(::pipe2(accepted, O_CLOEXEC), 0);
  Rng rng(20);
  int killed = 0, finished_before = 0, resumed_rounds = 0;
  std::set<std::string> promises;
  for (int round = 0; round <= kills; ++round) {
    SCOPED_TRACE(round);
    const support::Child child(
        [&](const support::Child& self) { serve(*place, dir.path(), round, accepted[1], self); });
    if (round < kills) {
      // At any moment; in each other round once the long job has made some way, which a busy machine takes its time
      // for.
      const bool has_made_way = round % 2 == 1;
      if (has_made_way) {
        EXPECT_EQ(child.hear(), 'i');
      }
      std::this_thread::sleep_for(std::chrono::microseconds(rng.below(has_made_way ? 50'000 : 150'000)));
      child.kill();
    }
    const int status = child.end();
    if (round < kills && WIFSIGNALED(status)) {
      ++killed;
    } else {
      ASSERT_TRUE(WIFEXITED(status));
      ASSERT_EQ(WEXITSTATUS(status), 0);
    }
    // What the record calls finished is on disk, and it never goes back.
    const auto store = reopened();
    const Job job = value(store->find(long_job));
    EXPECT_GE(job.finished_intervals, finished_before);
    if (job.finished_intervals > finished_before && finished_before > 0) ++resumed_rounds;
    finished_before = job.finished_intervals;
    if (job.finished_intervals > 0 && !is_final(job.state)) {
      EXPECT_TRUE(
          fs::exists(dir.path() / "jobs" / long_job / ("checkpoint-" + std::to_string(job.finished_intervals))));
    }
  }
  ::close(accepted[1]);
  for (char id[id_length]; ::read(accepted[0], id, id_length) == id_length;) promises.emplace(id, id_length);
  ::close(accepted[0]);

  const auto store = reopened();
  const Job job = value(store->find(long_job));
  EXPECT_EQ(job.state, JobState::succeeded);
  EXPECT_EQ(job.result, undisturbed(intervals));
  for (const std::string& id : promises) {
    const auto kept = store->find(id);
    ASSERT_TRUE(kept) << "accepted, then lost";
    EXPECT_EQ(kept->state, JobState::succeeded) << id;
    EXPECT_EQ(kept->result, undisturbed(intervals_of_short_jobs)) << id;
  }
  EXPECT_FALSE(promises.empty());
  EXPECT_GE(killed, kills - 2) << "the job was over before it could be disturbed";
  EXPECT_GE(resumed_rounds, kills / 2 - 1) << "hardly a round got far enough to matter";
}

}  // namespace
}  // namespace engine::jobs
