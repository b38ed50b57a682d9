// What every store of job records does, whichever kind a program of tests is about.
#include "engine/jobs/store.h"

#include <gtest/gtest.h>

#include <optional>

#include "tests/engine/jobs/jobs_support.h"
#include "tests/engine/jobs/store_kind.h"

namespace engine::jobs {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t many = 1000;

class StoreTest : public testing::TestWithParam<StoreKind> {
 protected:
  std::string submit(const std::string& lane = "a", const std::string& payload = "{}",
                     std::chrono::milliseconds expected = 0ms) {
    return value(store->submit({.lane = lane, .payload = payload, .expected = expected}, many)).job.id;
  }
  std::string claim() {
    const auto job = value(store->claim());
    return job ? job->id : "";
  }
  /// In the name of whoever holds the job.
  Result<Job> apply(const std::string& id, Change change) {
    if (const auto job = store->find(id)) change.claim = job->claim_number;
    return store->apply(id, change);
  }
  /// Claims and ends the oldest.
  std::string end_one() {
    const std::string id = claim();
    value(apply(id, {.event = Event::succeed}));
    return id;
  }
  void reopen(const StoreSetup& setup = {}) {
    store.reset();
    store = value(place->open(setup));
  }
  /// From here on the store's clock is set by advance().
  void use_own_clock() {
    reopen({.own_clock = true});
    advance(0ms);
  }
  void advance(std::chrono::milliseconds time) {
    now += time;
    place->set_time(now);
  }

  support::TempDir dir;
  std::unique_ptr<StorePlace> place = GetParam().make_place(dir.path());
  std::unique_ptr<Store> store = value(place->open({}));
  Time now{1000h};
};

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(StoreTest);
INSTANTIATE_TEST_SUITE_P(Each, StoreTest, testing::ValuesIn(store_kinds()));

TEST_P(StoreTest, KeepsEveryFieldAcrossARestart) {
  const std::string bytes("a\0'\"\xff\n", 6);
  const auto submitted = value(store->submit(
      {.lane = bytes, .payload = bytes, .idempotency_key = "key", .expected = 1234ms, .requester = bytes}, many));
  EXPECT_TRUE(submitted.created);
  const std::string id = submitted.job.id;
  EXPECT_EQ(id, "e000001");
  EXPECT_EQ(claim(), id);
  value(apply(id, {.event = Event::finish_interval, .progress = bytes, .interval = 3, .worked = 90ms}));
  const Job before =
      value(apply(id, {.event = Event::fail, .error = {ErrorCode::no_space, "the disk is full", "scene.ply"}}));
  reopen();
  const Job after = value(store->find(id));
  EXPECT_EQ(after.lane, bytes);
  EXPECT_EQ(after.payload, bytes);
  EXPECT_EQ(after.idempotency_key, "key");
  EXPECT_EQ(after.expected, 1234ms);
  EXPECT_EQ(after.requester, bytes);
  EXPECT_EQ(after.worked, 90ms);
  EXPECT_EQ(after.holder, "here:1");
  EXPECT_EQ(after.claimed_at, before.claimed_at);
  EXPECT_TRUE(after.claimed_at);
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

TEST_P(StoreTest, KeepsAResult) {
  const std::string id = submit();
  claim();
  value(apply(id, {.event = Event::succeed, .result = "{\"version\": 2}", .stopped_early = true}));
  reopen();
  EXPECT_EQ(value(store->find(id)).result, "{\"version\": 2}");
  EXPECT_TRUE(value(store->find(id)).stopped_early);
}

TEST_P(StoreTest, AnswersARepeatedSubmissionWithTheSameJob) {
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

TEST_P(StoreTest, FindsAJobByItsKey) {
  const std::string id = value(store->submit({.lane = "a", .payload = "x", .idempotency_key = "k"}, many)).job.id;
  submit();  // one without a key
  ASSERT_TRUE(value(store->find_key("k")));
  EXPECT_EQ(value(store->find_key("k"))->id, id);
  EXPECT_EQ(value(store->find_key("k"))->payload, "x");
  EXPECT_EQ(value(store->find_key("K")), std::nullopt);
  EXPECT_EQ(value(store->find_key("")), std::nullopt) << "no key is no key";
  claim();
  value(apply(id, {.event = Event::succeed}));
  value(store->remove(id));
  EXPECT_EQ(value(store->find_key("k")), std::nullopt) << "forgotten with its job";
}

TEST_P(StoreTest, LeavesOutNumbersThatAreKnownElsewhere) {
  reopen({.used_numbers = 41});
  EXPECT_EQ(submit(), "e000042");
  reopen({.used_numbers = 7});
  EXPECT_EQ(submit(), "e000043") << "never back";
}

TEST_P(StoreTest, RefusesMoreThanMayWaitAndNamesTheLimit) {
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

TEST_P(StoreTest, TellsWhoIsNext) {
  for (int i = 0; i < 3; ++i) submit();
  EXPECT_EQ(value(store->find("e000003")).queue_position, 3);
  claim();
  EXPECT_EQ(value(store->find("e000001")).queue_position, 0);
  EXPECT_EQ(value(store->find("e000003")).queue_position, 2);
  value(apply("e000002", {.event = Event::cancel}));
  EXPECT_EQ(value(store->find("e000003")).queue_position, 1);
}

TEST_P(StoreTest, GivesOutOneJobOfALaneAtATimeAndTheOldestFirst) {
  for (const char* lane : {"a", "a", "b", "a"}) submit(lane);
  EXPECT_EQ(claim(), "e000001");
  EXPECT_EQ(claim(), "e000003");
  EXPECT_EQ(claim(), "");
  value(apply("e000001", {.event = Event::release}));
  EXPECT_EQ(claim(), "e000001") << "one that was interrupted goes on before its lane does";
  value(apply("e000001", {.event = Event::succeed}));
  EXPECT_EQ(claim(), "e000002");
}

TEST_P(StoreTest, LetsShorterJobsGoFirstForAWhile) {
  use_own_clock();
  const std::string longest = submit("a", "", 1h), middle = submit("b", "", 10min);
  advance(stretch * 50min - 1ms);
  const std::string before = submit("c", "", 10min);
  advance(2ms);
  const std::string after = submit("d", "", 10min);
  EXPECT_EQ(value(store->find(longest)).queue_position, 3);
  EXPECT_EQ(value(store->find(after)).queue_position, 4);
  EXPECT_EQ(claim(), middle);
  EXPECT_EQ(claim(), before) << "it was handed in while the long one still let others go first";
  EXPECT_EQ(claim(), longest) << "its turn comes, whatever follows";
  EXPECT_EQ(claim(), after);
}

TEST_P(StoreTest, KeepsALaneInOrderWhateverItsJobsTake) {
  const std::string longest = submit("a", "", 1h), of_lane = submit("a", "", 1s), other = submit("b", "", 10min);
  EXPECT_EQ(value(store->find(other)).queue_position, 1);
  EXPECT_EQ(value(store->find(longest)).queue_position, 2);
  EXPECT_EQ(value(store->find(of_lane)).queue_position, 3) << "it is short, but comes after the long one";
  EXPECT_EQ(claim(), other);
  EXPECT_EQ(claim(), longest);
  EXPECT_EQ(claim(), "");
}

TEST_P(StoreTest, SaysWhenAJobShouldMakeWay) {
  use_own_clock();
  const std::string longest = submit("a", "", 1h);
  EXPECT_EQ(claim(), longest);
  EXPECT_FALSE(value(store->should_make_way(longest, 1h))) << "nobody waits";
  submit("a", "", 1s);
  EXPECT_FALSE(value(store->should_make_way(longest, 1h))) << "one of its lane has to wait for it";
  const std::string unknown = submit("b"), shorter = submit("c", "", 10min);
  EXPECT_FALSE(value(store->should_make_way(longest, 1h))) << "nobody knows how long the next one takes";
  value(apply(unknown, {.event = Event::cancel}));
  EXPECT_TRUE(value(store->should_make_way(longest, 20min)));
  EXPECT_FALSE(value(store->should_make_way(longest, 19min))) << "what is left of it is nearly as short";
  value(apply(longest, {.event = Event::finish_interval, .interval = 1}));
  value(apply(longest, {.event = Event::stop}));
  EXPECT_FALSE(value(store->should_make_way(longest, 1h))) << "it is about to end";
  value(apply(shorter, {.event = Event::cancel}));
  advance(stretch * 1h);
  submit("d", "", 1s);
  EXPECT_FALSE(value(store->should_make_way(longest, 1h))) << "it has let others go first for long enough";
}

TEST_P(StoreTest, MakesWayOnlyForTheJobThatWouldComeNext) {
  use_own_clock();
  const std::string long_one = submit("a", "", 1h);
  advance(stretch * 50min);
  const std::string held = submit("b", "", 1h);
  value(apply(long_one, {.event = Event::claim}));
  value(apply(held, {.event = Event::claim}));
  value(apply(long_one, {.event = Event::finish_interval, .interval = 1}));
  value(apply(long_one, {.event = Event::make_way}));
  advance(stretch * 5min);
  const std::string shorter = submit("c", "", 6min);
  EXPECT_FALSE(value(store->should_make_way(held, 1h))) << "the worker would go to the long one, not to the short one";
  value(apply(long_one, {.event = Event::stop}));
  EXPECT_TRUE(value(store->should_make_way(held, 1h))) << "it is only to end";
  value(apply(long_one, {.event = Event::cancel}));
  EXPECT_TRUE(value(store->should_make_way(held, 1h)));
  EXPECT_EQ(claim(), shorter);
}

TEST_P(StoreTest, AJobThatWasInterruptedGoesOnBeforeThoseThatWait) {
  use_own_clock();
  const std::string longest = submit("a", "", 1h);
  EXPECT_EQ(claim(), longest);
  submit("b", "", 1s);
  const std::string made_way = submit("c", "", 10min);
  value(apply(made_way, {.event = Event::claim}));
  value(apply(made_way, {.event = Event::make_way}));
  reopen();
  EXPECT_EQ(claim(), longest) << "the death of the process makes no way";
  EXPECT_EQ(claim(), "e000002");
  EXPECT_EQ(claim(), made_way) << "one that has made way waits like the others";
}

TEST_P(StoreTest, ReleasesWhatADeadProcessHeld) {
  for (const char* lane : {"a", "b", "c", "d"}) submit(lane);
  for (int i = 0; i < 3; ++i) claim();
  for (const char* id : {"e000001", "e000002", "e000003"})
    value(apply(id, {.event = Event::finish_interval, .interval = 2}));
  value(apply("e000002", {.event = Event::stop}));
  value(apply("e000003", {.event = Event::cancel}));
  reopen();
  EXPECT_EQ(value(store->find("e000001")).state, JobState::running);
  EXPECT_EQ(value(store->find("e000002")).state, JobState::stop_requested);
  EXPECT_EQ(value(store->find("e000003")).state, JobState::cancelled);
  EXPECT_EQ(value(store->find("e000004")).state, JobState::queued);
  EXPECT_EQ(claim(), "e000001");
  EXPECT_EQ(value(store->find("e000001")).finished_intervals, 2);
}

TEST_P(StoreTest, ListsTheYoungestFirst) {
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

TEST_P(StoreTest, RemovesOnlyWhatHasEndedAndNeverReusesAnId) {
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

TEST_P(StoreTest, FindsNothingUnderATextThatIsNoId) {
  submit();
  for (const char* id : {"", "1", "e1", "e0000001", "e000001 ", "e000001' OR 1", "e999999999999999999999"})
    EXPECT_EQ(code_of(store->find(id)), ErrorCode::not_found) << id;
}

TEST_P(StoreTest, ForgetsWhatIsOldOrTooMuch) {
  use_own_clock();
  for (int i = 0; i < 6; ++i) submit();
  for (int i = 0; i < 4; ++i) {
    end_one();
    advance(1h);
  }
  // Ended at 1000, 1001, 1002 and 1003 h; it is 1004 h.
  EXPECT_EQ(value(store->expire({.max_age = 4h, .max_count = 4})), std::vector<std::string>{});
  EXPECT_EQ(value(store->expire({.max_age = 3h, .max_count = 4})), std::vector<std::string>{"e000001"});
  EXPECT_EQ(value(store->expire({.max_age = 3h, .max_count = 1})), (std::vector<std::string>{"e000002", "e000003"}));
  EXPECT_EQ(value(store->expire({.max_age = 0h, .max_count = 0})), std::vector<std::string>{"e000004"});
  EXPECT_EQ(value(store->list({})).size(), 2u) << "what has not ended is kept";
}

TEST_P(StoreTest, CountsHowOftenInARowAProcessDiedAtTheSamePlace) {
  const std::string id = submit();
  for (int death = 1; death <= 3; ++death) {
    EXPECT_EQ(claim(), id);
    value(apply(id, {.event = Event::report, .place = "interval 1, correct"}));
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

TEST_P(StoreTest, NumbersClaimsAndRefusesWhatComesUnderAnEarlierOne) {
  const std::string id = submit();
  EXPECT_EQ(value(store->claim())->claim_number, 1);
  value(store->apply(id, {.event = Event::report, .claim = 1, .progress = "by the first"}));
  value(store->apply(id, {.event = Event::release, .claim = 1}));
  for (const Event event : {Event::report, Event::succeed})
    EXPECT_EQ(code_of(store->apply(id, {.event = event, .claim = 1})), ErrorCode::conflict) << "nobody holds it";
  EXPECT_EQ(value(store->claim())->claim_number, 2);
  for (int event = 0; event < event_count; ++event) {
    if (Event(event) == Event::stop || Event(event) == Event::cancel || Event(event) == Event::abandon) continue;
    const auto refused = store->apply(id, {.event = Event(event), .claim = 1, .progress = "late", .interval = 1});
    ASSERT_EQ(code_of(refused), ErrorCode::conflict) << event;
    EXPECT_EQ(refused.error().where, id);
  }
  EXPECT_NE(store->apply(id, {.event = Event::report, .claim = 1}).error().message.find("has been taken over"),
            std::string::npos);
  const Job job = value(store->find(id));
  EXPECT_EQ(job.progress, "by the first");
  EXPECT_EQ(job.finished_intervals, 0);
  EXPECT_EQ(job.state, JobState::running);
  reopen();
  EXPECT_EQ(value(store->claim())->claim_number, 3) << "never the same one twice";
}

TEST_P(StoreTest, RenewsAClaimAndTellsWhatOthersHaveAskedFor) {
  const std::string id = submit();
  EXPECT_EQ(code_of(store->renew(id, 0)), ErrorCode::conflict) << "nobody holds it";
  EXPECT_EQ(code_of(store->renew("e000009", 1)), ErrorCode::not_found);
  claim();
  EXPECT_EQ(value(store->renew(id, 1)), JobState::running);
  EXPECT_EQ(code_of(store->renew(id, 2)), ErrorCode::conflict);
  value(apply(id, {.event = Event::finish_interval, .interval = 1}));
  value(store->apply(id, {.event = Event::stop}));
  EXPECT_EQ(value(store->renew(id, 1)), JobState::stop_requested);
  value(store->apply(id, {.event = Event::cancel}));
  EXPECT_EQ(value(store->renew(id, 1)), JobState::cancel_requested);
  value(apply(id, {.event = Event::succeed}));
  EXPECT_EQ(code_of(store->renew(id, 1)), ErrorCode::conflict) << "it is over";
}

TEST_P(StoreTest, ARecordThatIsPutBackEndsItsClaim) {
  const std::string id = submit();
  const Job before = value(store->find(id));
  claim();
  value(store->restore(before));
  EXPECT_EQ(code_of(store->apply(id, {.event = Event::succeed, .claim = 1})), ErrorCode::conflict);
  EXPECT_EQ(value(store->claim())->claim_number, 2);
  Job lost = before;
  lost.id = "e000041";
  lost.idempotency_key = "k";
  value(store->restore(lost));
  EXPECT_EQ(value(store->find_key("k"))->id, "e000041");
  EXPECT_EQ(submit(), "e000042");
  lost.id = "e000007";
  EXPECT_EQ(code_of(store->restore(lost)), ErrorCode::conflict) << "another has its key";
  EXPECT_EQ(code_of(store->find("e000007")), ErrorCode::not_found);
}

TEST_P(StoreTest, TakesUpAgainWhatHasFailedAndNothingElse) {
  const std::string first = submit(), second = submit("b");
  EXPECT_EQ(code_of(store->requeue(first, 0)), ErrorCode::conflict) << "it has not failed";
  EXPECT_EQ(code_of(store->requeue("e000099", 0)), ErrorCode::not_found);
  EXPECT_EQ(claim(), first);
  value(apply(first, {.event = Event::finish_interval, .interval = 2}));
  value(apply(first, {.event = Event::fail, .error = {ErrorCode::no_space, "the disk is full", ""}}));
  const std::string younger = submit();
  const auto refused = store->requeue(first, 2);
  ASSERT_EQ(code_of(refused), ErrorCode::conflict) << "what came later in its lane may just be run";
  EXPECT_NE(refused.error().message.find(younger), std::string::npos) << refused.error().message;
  value(store->apply(younger, {.event = Event::cancel}));
  const Job again = value(store->requeue(first, 2));
  EXPECT_EQ(again.state, JobState::queued);
  EXPECT_EQ(again.queue_position, 1);
  reopen();
  EXPECT_EQ(value(store->find(first)).finished_intervals, 2);
  EXPECT_FALSE(value(store->find(first)).error);
  EXPECT_EQ(claim(), first) << "it is the oldest";
  EXPECT_EQ(claim(), second);
}

TEST_P(StoreTest, AJobWhoseWitnessRefusesIsNotTakenUpAgain) {
  const std::string id = submit();
  EXPECT_EQ(claim(), id);
  value(apply(id, {.event = Event::fail, .error = {ErrorCode::internal, "oh", ""}}));
  const auto refused = store->requeue(id, 0, [](const Job& again) -> Result<void> {
    EXPECT_EQ(again.state, JobState::queued);
    return fail(ErrorCode::no_space, "no note can be written");
  });
  EXPECT_EQ(code_of(refused), ErrorCode::no_space);
  EXPECT_EQ(value(store->find(id)).state, JobState::failed);
}

TEST_P(StoreTest, CountsWhatIsUsedOfAQuotaAndRefusesMore) {
  use_own_clock();
  const NewJob asked{.lane = "a",
                     .payload = "",
                     .expected = 40s,
                     .requester = "studio",
                     .quota = {.active = 2, .worked_per_day = 100s}};
  const auto submit_asked = [&] { return store->submit(asked, many); };
  const std::string first = value(submit_asked()).job.id;
  value(submit_asked());
  value(store->submit({.lane = "a", .payload = "", .requester = "others"}, many));
  EXPECT_EQ(value(store->usage("studio")).active, 2u);
  EXPECT_EQ(value(store->usage("studio")).expected, 80s);
  auto refused = submit_asked();
  ASSERT_EQ(code_of(refused), ErrorCode::quota_exceeded);
  EXPECT_EQ(refused.error().where, "active");
  EXPECT_EQ(code_of(store->check_quota(asked)), ErrorCode::quota_exceeded);

  EXPECT_EQ(claim(), first);
  value(apply(first, {.event = Event::report, .worked = 30s}));
  EXPECT_EQ(value(store->usage("studio")).expected, 50s) << "what is left of both";
  value(apply(first, {.event = Event::succeed, .worked = 25s}));
  value(store->remove(first));
  const Usage used = value(store->usage("studio"));
  EXPECT_EQ(used.active, 1u);
  EXPECT_EQ(used.expected, 40s);
  EXPECT_EQ(used.worked_today, 55s) << "a record that is removed does not undo the work";
  refused = submit_asked();
  ASSERT_EQ(code_of(refused), ErrorCode::quota_exceeded);
  EXPECT_EQ(refused.error().where, "worked_per_day");
  EXPECT_NE(refused.error().message.find("55 s are used"), std::string::npos) << refused.error().message;
  NewJob small = asked;
  small.expected = 5s;
  value(store->check_quota(small));
  NewJob never = asked;
  never.expected = 101s;
  refused = store->submit(never, many);
  ASSERT_EQ(code_of(refused), ErrorCode::too_large) << "on no day";
  EXPECT_EQ(refused.error().where, "worked_per_day");

  reopen({.own_clock = true});
  EXPECT_EQ(value(store->usage("studio")).worked_today, 55s);
  advance(24h);
  EXPECT_EQ(value(store->usage("studio")).worked_today, 0s) << "a new day";
  value(submit_asked());
  EXPECT_EQ(value(store->usage("others")).worked_today, 0s);
}

TEST_P(StoreTest, CountsNoQuotaWhereNobodyIsNamed) {
  const std::string id = submit();
  claim();
  value(apply(id, {.event = Event::succeed, .worked = 25s}));
  EXPECT_EQ(value(store->usage("")).worked_today, 0s);
  EXPECT_EQ(value(store->find(id)).worked, 25s);
}

TEST_P(StoreTest, WhoVisitsLeavesClaimsAsTheyAre) {
  const std::string id = submit();
  claim();
  reopen({.visits = true});
  const Job job = value(store->find(id));
  EXPECT_TRUE(job.claimed);
  EXPECT_EQ(job.deaths, 0);
  EXPECT_EQ(job.holder, "here:1");
  EXPECT_GE(value(store->now()), *job.claimed_at);
  reopen();
  EXPECT_FALSE(value(store->find(id)).claimed);
}

TEST_P(StoreTest, AJobThatItsWitnessRefusesDoesNotExist) {
  const auto refused = store->submit({.lane = "a", .payload = "x", .idempotency_key = "k"}, many,
                                     [](const Job&) { return fail(ErrorCode::no_space, "no room for a note"); });
  EXPECT_EQ(code_of(refused), ErrorCode::no_space);
  EXPECT_EQ(value(store->list({})).size(), 0u);
  EXPECT_EQ(value(store->find_key("k")), std::nullopt);
  EXPECT_EQ(submit(), "e000001");
}

}  // namespace
}  // namespace engine::jobs
