#include "engine/jobs/job.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace engine::jobs {
namespace {

constexpr Time noon{std::chrono::hours(12)};

Job job_in(JobState state, bool claimed, int finished_intervals) {
  Job job;
  job.id = "e000007";
  job.state = state;
  job.claimed = claimed;
  job.finished_intervals = finished_intervals;
  return job;
}

Result<Job> after_event(const Job& job, Event event) {
  Change change{.event = event,
                .claim = job.claim_number,
                .interval = job.finished_intervals + 1,
                .result = "text",
                .stopped_early = true};
  change.error = {ErrorCode::unprocessable, "why", "where"};
  return transition(job, change, noon);
}

/// One line of the table that the states' documentation amounts to: "-" is a conflict.
struct Line {
  JobState state;
  bool claimed;
  int finished_intervals;
  /// claim report finish_interval stop cancel succeed fail release make_way abandon requeue
  std::array<std::string, event_count> next;
};

const std::string no = "-", wait = "queued", run = "running", stopping = "stop_requested", leaving = "cancel_requested",
                  good = "succeeded", bad = "failed", gone = "cancelled";

const std::vector<Line>& table() {
  using enum JobState;
  static const std::vector<Line> lines = {
      {queued, false, 0, {run, no, no, no, gone, no, no, no, no, no, no}},
      {queued, false, 2, {run, no, no, stopping, gone, no, no, no, no, no, no}},
      {running, true, 0, {no, run, run, no, leaving, good, bad, run, wait, run, no}},
      {running, true, 2, {no, run, run, stopping, leaving, good, bad, run, wait, run, no}},
      {running, false, 0, {run, no, no, no, gone, no, no, no, no, no, no}},
      {running, false, 2, {run, no, no, stopping, gone, no, no, no, no, no, no}},
      {stop_requested,
       true,
       2,
       {no, stopping, stopping, stopping, leaving, good, bad, stopping, stopping, stopping, no}},
      {stop_requested, false, 2, {stopping, no, no, stopping, gone, no, no, no, no, no, no}},
      {cancel_requested, true, 0, {no, leaving, leaving, no, leaving, gone, gone, gone, gone, gone, no}},
      {cancel_requested, true, 2, {no, leaving, leaving, no, leaving, gone, gone, gone, gone, gone, no}},
      {succeeded, false, 2, {no, no, no, no, no, no, no, no, no, no, no}},
      {failed, false, 2, {no, no, no, no, no, no, no, no, no, no, wait}},
      {cancelled, false, 0, {no, no, no, no, gone, no, no, no, no, no, no}},
  };
  return lines;
}

TEST(JobStates, FollowTheTable) {
  for (const Line& line : table())
    for (int e = 0; e < event_count; ++e) {
      const Job before = job_in(line.state, line.claimed, line.finished_intervals);
      const auto result = after_event(before, Event(e));
      EXPECT_EQ(result ? std::string(to_string(result->state)) : no, line.next[std::size_t(e)])
          << to_string(line.state) << (line.claimed ? ", claimed" : "") << ", intervals " << line.finished_intervals
          << ", event " << e;
      if (result) continue;
      EXPECT_EQ(result.error().code, ErrorCode::conflict);
      EXPECT_EQ(result.error().where, "e000007");
    }
}

TEST(JobStates, AreAllInTheTable) {
  std::map<JobState, int> lines;
  for (const Line& line : table()) ++lines[line.state];
  EXPECT_EQ(lines.size(), std::size_t(state_count));
}

TEST(JobStates, EndWithATimeAndWithoutAWorker) {
  for (const Line& line : table())
    for (int e = 0; e < event_count; ++e) {
      const Job before = job_in(line.state, line.claimed, line.finished_intervals);
      const auto result = after_event(before, Event(e));
      if (!result || is_final(before.state)) continue;
      EXPECT_EQ(result->ended.has_value(), is_final(result->state));
      if (is_final(result->state)) {
        EXPECT_FALSE(result->claimed);
      }
      EXPECT_EQ(!result->result.empty() || result->stopped_early, result->state == JobState::succeeded);
      EXPECT_EQ(result->error.has_value(), result->state == JobState::failed);
    }
}

TEST(JobStates, OneThatFailedIsTakenUpAgainAsIfNothingHadHappened) {
  Job job = job_in(JobState::failed, false, 3);
  job.error = Error{ErrorCode::no_space, "the disk is full", ""};
  job.progress = "so far";
  job.ended = noon, job.started = Time(std::chrono::hours(3));
  job.deaths = 3, job.died_at = "interval 4", job.place = "interval 4", job.claim_number = 5;
  job.worked = std::chrono::minutes(7);
  const auto again = transition(job, {.event = Event::requeue, .interval = 2}, noon);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->state, JobState::queued);
  EXPECT_EQ(again->finished_intervals, 2) << "what there is a checkpoint of";
  EXPECT_FALSE(again->error || again->ended);
  EXPECT_EQ(again->deaths, 0);
  EXPECT_EQ(again->died_at + again->place, "");
  EXPECT_EQ(again->claim_number, 5) << "whoever held it before still does not hold it";
  EXPECT_EQ(again->started, job.started);
  EXPECT_EQ(again->worked, job.worked);
  EXPECT_EQ(again->progress, job.progress);
  EXPECT_EQ(transition(job, {.event = Event::requeue, .interval = 0}, noon)->progress, "")
      << "what begins anew has taken no time yet";
}

TEST(JobClaims, SayWhoAndSinceWhen) {
  Job job = *transition(job_in(JobState::queued, false, 0), {.event = Event::claim, .holder = "host:7"}, noon);
  EXPECT_EQ(job.holder, "host:7");
  EXPECT_EQ(job.claimed_at, noon);
  const auto later = noon + std::chrono::hours(1);
  job = *transition(job, {.event = Event::release, .claim = 1, .worked = std::chrono::minutes(59)}, later);
  job = *transition(job, {.event = Event::claim, .holder = "other:8"}, later);
  job = *transition(job, {.event = Event::fail, .claim = 2, .worked = std::chrono::minutes(1)}, later);
  EXPECT_EQ(job.holder, "other:8") << "it stays when the claim is over";
  EXPECT_EQ(job.claimed_at, later);
  EXPECT_EQ(job.worked, std::chrono::hours(1)) << "of all claims";
}

TEST(JobStates, CancellingAgainChangesNothing) {
  Job job = job_in(JobState::cancelled, false, 1);
  job.ended = Time(std::chrono::hours(3));
  const auto again = after_event(job, Event::cancel);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->ended, job.ended);
}

Job by_its_worker(const Job& job, Change change) {
  change.claim = job.claim_number;
  return *transition(job, change, noon);
}

/// The job after an attempt that comes as far as `places` and dies there.
Job after_death(Job job, const std::vector<std::string>& places, int max_deaths = 3) {
  job = *transition(std::move(job), {.event = Event::claim}, noon);
  for (const std::string& place : places) job = by_its_worker(job, {.event = Event::report, .place = place});
  return *transition(std::move(job), {.event = Event::abandon, .max_deaths = max_deaths}, noon);
}

TEST(JobDeaths, ThreeAtOnePlaceAreEnough) {
  Job job = job_in(JobState::queued, false, 0);
  for (int death = 1; death <= 2; ++death) {
    job = after_death(std::move(job), {"load", "interval 1, correct"});
    EXPECT_EQ(job.state, JobState::running);
    EXPECT_FALSE(job.claimed) << "it is taken up again";
    EXPECT_EQ(job.deaths, death);
  }
  job = after_death(std::move(job), {"load", "interval 1, correct"});
  EXPECT_EQ(job.state, JobState::failed);
  EXPECT_FALSE(job.claimed);
  EXPECT_EQ(job.ended, noon);
  ASSERT_TRUE(job.error);
  EXPECT_EQ(job.error->where, "e000007");
  EXPECT_NE(job.error->message.find("ended 3 times in a row while it was at this job (interval 1, correct)"),
            std::string::npos)
      << job.error->message;
}

TEST(JobDeaths, OneIsSaidInTheSingular) {
  const Job job = after_death(job_in(JobState::queued, false, 0), {"load"}, 1);
  ASSERT_TRUE(job.error);
  EXPECT_TRUE(job.error->message.starts_with("the service ended while it was at this job (load)"))
      << job.error->message;
}

TEST(JobDeaths, CountOnlyInARowAtTheSamePlace) {
  Job job = job_in(JobState::queued, false, 0);
  for (int round = 0; round < 5; ++round) {
    job = after_death(std::move(job), {"load"});
    job = after_death(std::move(job), {"load"});
    job = after_death(std::move(job), {"load", "interval 1, correct"});
    EXPECT_EQ(job.deaths, 1);
    EXPECT_EQ(job.state, JobState::running);
  }
}

TEST(JobDeaths, AreForgottenWithAFinishedInterval) {
  Job job = after_death(after_death(job_in(JobState::queued, false, 0), {"work"}), {"work"});
  job = *transition(std::move(job), {.event = Event::claim}, noon);
  job = by_its_worker(job, {.event = Event::report, .place = "work"});
  job = by_its_worker(job, {.event = Event::finish_interval, .interval = 1});
  job = *transition(std::move(job), {.event = Event::abandon, .max_deaths = 3}, noon);
  EXPECT_EQ(job.state, JobState::running);
  EXPECT_EQ(job.deaths, 1);
}

TEST(JobDeaths, BeforeTheFirstPlaceCountToo) {
  Job job = job_in(JobState::queued, false, 0);
  for (int death = 0; death < 3; ++death) job = after_death(std::move(job), {});
  EXPECT_EQ(job.state, JobState::failed);
}

TEST(JobDeaths, AShutdownIsNone) {
  Job job = after_death(after_death(job_in(JobState::queued, false, 0), {"work"}), {"work"});
  for (int i = 0; i < 5; ++i) {
    job = *transition(std::move(job), {.event = Event::claim}, noon);
    job = by_its_worker(job, {.event = Event::report, .place = "work"});
    job = by_its_worker(job, {.event = Event::release});
  }
  EXPECT_EQ(job.state, JobState::running);
  EXPECT_EQ(job.deaths, 2);
}

TEST(JobDeaths, DoNoHarmWhereNobodyCountsOrTheJobIsCancelled) {
  Job job = job_in(JobState::queued, false, 0);
  for (int death = 0; death < 50; ++death) job = after_death(std::move(job), {"work"}, /*max_deaths=*/0);
  EXPECT_EQ(job.state, JobState::running);
  job = *transition(std::move(job), {.event = Event::claim}, noon);
  job = *transition(std::move(job), {.event = Event::cancel}, noon);
  job = *transition(std::move(job), {.event = Event::abandon, .max_deaths = 3}, noon);
  EXPECT_EQ(job.state, JobState::cancelled);
  EXPECT_FALSE(job.error);
}

TEST(JobStates, KeepTheTimeOfTheFirstStart) {
  Job job = job_in(JobState::running, false, 1);
  job.started = Time(std::chrono::hours(3));
  EXPECT_EQ(after_event(job, Event::claim)->started, job.started);
  EXPECT_EQ(after_event(job_in(JobState::queued, false, 0), Event::claim)->started, noon);
}

TEST(JobTurns, AreLaterTheLongerAJobTakesButNoLaterThanThat) {
  using namespace std::chrono_literals;
  Job job = job_in(JobState::queued, false, 0);
  job.created = noon;
  EXPECT_EQ(turn_of(job), noon) << "nobody knows how long it takes";
  job.expected = negligible;
  EXPECT_EQ(turn_of(job), noon) << "nobody minds";
  job.expected += 1h;
  EXPECT_EQ(turn_of(job), noon + stretch * 1h);
  job.state = JobState::running;
  EXPECT_EQ(turn_of(job), noon + stretch * 1h) << "it does not move up by having begun";
  job.state = JobState::stop_requested;
  EXPECT_EQ(turn_of(job), noon) << "what it has only has to be kept";
}

TEST(JobStates, RefuseIntervalsThatDoNotCountUp) {
  const Job job = job_in(JobState::running, true, 2);
  for (const int interval : {-1, 0, 2}) {
    const auto result = transition(job, {.event = Event::finish_interval, .interval = interval}, noon);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::invalid_argument);
  }
  EXPECT_EQ(transition(job, {.event = Event::finish_interval, .interval = 5}, noon)->finished_intervals, 5);
}

TEST(JobClaims, AreCountedAndToldApart) {
  Job job = job_in(JobState::queued, false, 0);
  EXPECT_EQ(check_claim(job, 0).error().code, ErrorCode::conflict) << "nobody holds it";
  job = *transition(std::move(job), {.event = Event::claim}, noon);
  EXPECT_EQ(job.claim_number, 1);
  EXPECT_TRUE(check_claim(job, 1));
  job = *transition(std::move(job), {.event = Event::abandon}, noon);
  EXPECT_FALSE(check_claim(job, 1));
  job = *transition(std::move(job), {.event = Event::claim}, noon);
  EXPECT_TRUE(check_claim(job, 2));
  EXPECT_EQ(transition(job, {.event = Event::succeed, .claim = 1}, noon).error().message,
            "e000007 has been taken over (claim 2 came after claim 1): nothing that was made of it under the old claim "
            "counts");
  EXPECT_EQ(transition(job, {.event = Event::stop}, noon).error().code, ErrorCode::conflict) << "no interval yet";
  EXPECT_EQ(transition(job, {.event = Event::cancel}, noon)->state, JobState::cancel_requested) << "anybody may";
}

TEST(JobStates, SayWhatToDoInstead) {
  EXPECT_EQ(after_event(job_in(JobState::running, true, 0), Event::stop).error().message,
            "e000007 has no finished interval to keep yet: wait for the first one, or cancel");
  EXPECT_EQ(after_event(job_in(JobState::failed, false, 0), Event::cancel).error().message,
            "e000007 is failed: it has already ended and stays as it is");
}

TEST(JobStates, HaveNamesThatAreReadBack) {
  for (int s = 0; s < state_count; ++s) EXPECT_EQ(parse_state(to_string(JobState(s))), JobState(s));
  EXPECT_FALSE(parse_state("Queued"));
  EXPECT_FALSE(parse_state(""));
}

TEST(JobIds, CountInSixDigitsOrMore) {
  for (const auto& [number, id] : {std::pair{1L, "e000001"}, {999'999L, "e999999"}, {1'000'000L, "e1000000"}}) {
    EXPECT_EQ(id_of(number), id);
    EXPECT_EQ(number_of(id), number);
  }
  for (const char* text : {"", "e", "e1", "e0000001", "E000001", "e00001x", "e-00001", "e99999999999999999999", "../x"})
    EXPECT_FALSE(number_of(text)) << text;
}

}  // namespace
}  // namespace engine::jobs
