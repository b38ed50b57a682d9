#include "engine/jobs/postgres_store.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <span>
#include <thread>
#include <type_traits>
#include <utility>

#include "engine/jobs/postgres_connection.h"
#include "engine/jobs/postgres_listener.h"
#include "engine/jobs/postgres_schema.h"
#include "engine/jobs/store_rules.h"

namespace engine::jobs {
namespace {

using std::chrono::steady_clock;
using namespace std::chrono_literals;

/// After a server could not be reached nobody tries for so long: many who ask at once would each wait for their turn.
constexpr auto between_attempts = 500ms;
/// So long somebody waits for a server that has gone away while it committed, to learn whether it did. A choice: what a
/// restart takes.
constexpr auto told_within = 10s;

/// The connection was lost while it committed, and nobody could be asked afterwards, or nothing was committed.
struct CommitLost : ConnectionLost {
  using ConnectionLost::ConnectionLost;
};

/// Of jobs that have not ended: nobody holds it, and none of its lane comes before it. Jobs of a lane become visible in
/// the order of their numbers (see submit()).
constexpr const char* can_run =
    "ended IS NULL AND NOT claimed AND NOT EXISTS (SELECT 1 FROM splatdrag.jobs AS older WHERE older.ended IS NULL "
    "AND older.lane = jobs.lane AND older.number < jobs.number)";
/// One that runs although nobody holds it was interrupted, and has not made way.
constexpr const char* in_turn = "ORDER BY (state = 'running') DESC, turn, number LIMIT 1";

/// Held by a claim that nobody has renewed in time.
std::string ran_out(const PostgresOptions& options) {
  return "ended IS NULL AND claimed AND lease_until < " + options.now;
}

/// What read() reads, and another column behind it. A list has no long texts.
std::string select(const PostgresOptions& options, bool whole, const std::string& more = {}) {
  const std::string payload = whole ? "payload" : "''::bytea", result = whole ? "result" : "''::bytea";
  return "SELECT number, lane, " + payload +
         ", idempotency_key, state, claimed, stopped_early, finished_intervals, progress, " + result +
         ", error_code, error_message, error_where, created, started, ended, place, died_at, deaths, expected, "
         "claim_number, requester, worked, holder, claimed_at, CASE WHEN claimed THEN lease_until END, " +
         options.now + more + " FROM splatdrag.jobs ";
}
constexpr int columns_of_job = 27;

std::optional<Time> time_at(const PostgresRows& rows, int row, int column) {
  if (rows.is_null(row, column)) return std::nullopt;
  return Time(std::chrono::milliseconds(rows.integer(row, column)));
}

[[noreturn]] void corrupt(const std::string& what) {
  throw StoreFailure({ErrorCode::corrupt_data, "the job store is damaged (" + what + ")", {}});
}

struct Found {
  Job job;
  Time now{};  ///< By the server's clock.
};

Found read(const PostgresRows& rows, int row) {
  Job job;
  job.id = id_of(rows.integer(row, 0));
  job.lane = rows.text(row, 1);
  job.payload = rows.text(row, 2);
  job.idempotency_key = rows.text(row, 3);
  const auto state = parse_state(rows.text(row, 4));
  if (!state) corrupt("job " + job.id + " is in state \"" + rows.text(row, 4) + "\"");
  job.state = *state;
  job.claimed = rows.truth(row, 5);
  job.stopped_early = rows.truth(row, 6);
  job.finished_intervals = int(rows.integer(row, 7));
  job.progress = rows.text(row, 8);
  job.result = rows.text(row, 9);
  if (!rows.is_null(row, 10)) {
    const auto code = parse_code(rows.text(row, 10));
    if (!code) corrupt("job " + job.id + " has error code \"" + rows.text(row, 10) + "\"");
    job.error = Error{*code, rows.text(row, 11), rows.text(row, 12)};
  }
  job.created = time_at(rows, row, 13).value_or(Time{});
  job.started = time_at(rows, row, 14);
  job.ended = time_at(rows, row, 15);
  job.place = rows.text(row, 16);
  job.died_at = rows.text(row, 17);
  job.deaths = int(rows.integer(row, 18));
  job.expected = std::chrono::milliseconds(rows.integer(row, 19));
  job.claim_number = rows.integer(row, 20);
  job.requester = rows.text(row, 21);
  job.worked = std::chrono::milliseconds(rows.integer(row, 22));
  job.holder = rows.text(row, 23);
  job.claimed_at = time_at(rows, row, 24);
  job.lease_until = time_at(rows, row, 25);
  return {std::move(job), time_at(rows, row, 26).value_or(Time{})};
}

std::vector<std::string> ids(const PostgresRows& rows) {
  std::vector<std::string> found;
  for (int row = 0; row < rows.size(); ++row) found.push_back(id_of(rows.integer(row, 0)));
  return found;
}

std::optional<std::string_view> key_of(const std::string& idempotency_key) {
  return idempotency_key.empty() ? std::nullopt : std::optional<std::string_view>(idempotency_key);
}

}  // namespace

struct PostgresStore::Impl {
  Impl(PostgresOptions given, PostgresAddress found)
      : options(std::move(given)), address(std::move(found)), work(address), pulse(address) {}

  // What follows is called with `mutex` held.

  /// Has the connection there. Errors of all that follow are also those of join() and check_is_ours().
  void enter() {
    if (work.is_open()) return;
    if (failed && steady_clock::now() < failed->second) throw ConnectionLost(failed->first);
    try {
      join(work, options);
      check_is_ours(work, options);
      process = work.process();
      failed.reset();
    } catch (const StoreFailure& failure) {
      work.close();
      failed.emplace(failure.error, steady_clock::now() + between_attempts);
      throw;
    }
  }

  /// A transaction. Where the connection turns out to be lost before the end it is done once more over a new one: of
  /// what the first did there is nothing then.
  template <class Body>
  auto transact(Body body) -> Result<decltype(body())> {
    return guarded([&] {
      const std::lock_guard lock(mutex);
      const auto once = [&] {
        enter();
        change.clear();
        has_news = false;
        PostgresTransaction transaction(work);
        if constexpr (std::is_void_v<decltype(body())>) {
          body();
          commit(transaction);
        } else {
          auto result = body();
          commit(transaction);
          return result;
        }
      };
      return again_if_lost(once);
    });
  }
  /// The same for what only reads.
  template <class Body>
  auto look(Body body) -> Result<decltype(body())> {
    return guarded([&] {
      const std::lock_guard lock(mutex);
      return again_if_lost([&] {
        enter();
        return body();
      });
    });
  }
  template <class Once>
  static auto again_if_lost(Once once) {
    try {
      return once();
    } catch (const CommitLost&) {
      throw;
    } catch (const ConnectionLost&) {
      return once();
    }
  }

  void commit(PostgresTransaction& transaction) {
    try {
      transaction.commit();
    } catch (const ConnectionLost& lost) {
      if (!was_committed()) throw CommitLost(lost.error);
    }
    if (has_news) tell();
  }
  /// Asks over a new connection what became of `change`.
  bool was_committed() {
    if (change.empty()) return true;  // there was nothing to do
    for (const auto end = steady_clock::now() + told_within; steady_clock::now() < end;
         std::this_thread::sleep_for(100ms)) {
      try {
        enter();
        const auto status = work.run("SELECT pg_xact_status($1::text::xid8)", change).text(0, 0);
        if (status != "in progress") return status == "committed";
      } catch (const StoreFailure&) {
        work.close();  // there is no server yet, or it still takes us for our own successor
      }
    }
    return false;
  }
  /// Wakes those who wait, here and elsewhere. In a transaction of its own: one that notifies commits alone, and
  /// nothing is lost where this is.
  void tell() {
    try {
      work.execute(std::string("BEGIN; SET LOCAL synchronous_commit = off; NOTIFY ") + news_channel + "; COMMIT");
    } catch (const StoreFailure&) {
      work.close();
    }
  }

  std::optional<Job> find_where(const std::string& where, const PostgresValue& value) {
    const auto rows = work.run(select(options, true) + where, value);
    if (rows.size() == 0) return std::nullopt;
    Job job = read(rows, 0).job;
    find_places({&job, 1});
    return job;
  }
  Job find(const std::string& id) {
    auto job = find_where("WHERE number = $1", known_number(id));
    if (!job) no_such_job(id);
    return std::move(*job);
  }
  /// For a change: nobody else can make one before the end of the transaction.
  Found find_to_change(const std::string& id) {
    const auto rows = work.run(select(options, true) + "WHERE number = $1 FOR UPDATE", known_number(id));
    if (rows.size() == 0) no_such_job(id);
    return read(rows, 0);
  }
  std::vector<ActiveJob> active_jobs() {
    const auto rows =
        work.run("SELECT number, lane, state = 'queued', turn FROM splatdrag.jobs WHERE ended IS NULL ORDER BY number");
    std::vector<ActiveJob> active;
    for (int row = 0; row < rows.size(); ++row)
      active.push_back({rows.integer(row, 0), rows.text(row, 1), rows.truth(row, 2), rows.integer(row, 3)});
    return active;
  }
  /// What read() leaves out.
  void find_places(std::span<Job> jobs) {
    give_places(jobs, [this] { return active_jobs(); });
  }

  /// Writes down all of a record that may change.
  ///   claims  its lease begins now
  void write(const Job& job, bool claims = false) {
    std::optional<std::string_view> code, message, where;
    if (job.error) {
      code = code_name(job.error->code);
      message = job.error->message;
      where = job.error->where;
    }
    const auto written = work.run(
        "UPDATE splatdrag.jobs SET turn = $2, state = $3, claimed = $4, stopped_early = $5, finished_intervals = $6, "
        "progress = $7, result = $8, error_code = $9, error_message = $10, error_where = $11, started = $12, "
        "ended = $13, place = $14, died_at = $15, deaths = $16, claim_number = greatest(claim_number, $17), "
        "worked = $20, holder = $21, claimed_at = $22, lease_until = CASE WHEN $18 THEN " +
            options.now + " + $19 ELSE lease_until END WHERE number = $1 RETURNING pg_current_xact_id()::text",
        known_number(job.id), turn_of(job), to_string(job.state), job.claimed, job.stopped_early,
        std::int64_t(job.finished_intervals), job.progress, job.result, code, message, where, job.started, job.ended,
        job.place, job.died_at, std::int64_t(job.deaths), job.claim_number, claims, std::int64_t(options.lease.count()),
        std::int64_t(job.worked.count()), job.holder, job.claimed_at);
    change = written.text(0, 0);
  }
  /// Notes for whom so much was worked. After the record is held: all come in this order.
  void count_worked(const std::string& requester, std::chrono::milliseconds worked, Time now) {
    if (worked.count() <= 0 || requester.empty()) return;
    work.run(
        "INSERT INTO splatdrag.worked AS old (requester, day, milliseconds) VALUES ($1, $2, $3) ON CONFLICT "
        "(requester, day) DO UPDATE SET milliseconds = old.milliseconds + excluded.milliseconds",
        requester, day_of(now), std::int64_t(worked.count()));
  }
  Usage usage(const std::string& requester) {
    const auto rows = work.run("SELECT count(*), coalesce(sum(greatest(expected - worked, 0)), 0)::bigint, " +
                                   options.now + " FROM splatdrag.jobs WHERE ended IS NULL AND requester = $1",
                               requester);
    Usage usage{.active = std::size_t(rows.integer(0, 0)), .expected = std::chrono::milliseconds(rows.integer(0, 1))};
    const auto worked = work.run("SELECT milliseconds FROM splatdrag.worked WHERE requester = $1 AND day = $2",
                                 requester, day_of(Time(std::chrono::milliseconds(rows.integer(0, 2)))));
    if (worked.size() > 0) usage.worked_today = std::chrono::milliseconds(worked.integer(0, 0));
    return usage;
  }

  void check_quota(const NewJob& job) {
    if (has_limit(job.quota)) jobs::check_quota(usage(job.requester), job);
  }

  /// The one that claim() gives out, for a change, and whether a claim has run out.
  PostgresRows find_next() {
    return work.run(
        select(options, true, ", EXISTS (SELECT 1 FROM splatdrag.jobs AS held WHERE " + ran_out(options) + ")") +
        "WHERE " + can_run + " " + in_turn + " FOR UPDATE OF jobs SKIP LOCKED");
  }
  void insert(const Job& job) {
    const auto inserted = work.run(
        "INSERT INTO splatdrag.jobs AS old (number, lane, payload, idempotency_key, expected, turn, state, created, "
        "requester) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9) ON CONFLICT (number) DO UPDATE SET lane = $2, "
        "payload = $3, idempotency_key = $4, expected = $5, created = $8, requester = $9 "
        "RETURNING pg_current_xact_id()::text",
        known_number(job.id), job.lane, job.payload, key_of(job.idempotency_key), std::int64_t(job.expected.count()),
        turn_of(job), to_string(job.state), job.created, job.requester);
    change = inserted.text(0, 0);
    work.run("UPDATE splatdrag.store SET last_number = greatest(last_number, $1)", known_number(job.id));
  }
  ///   returns  the ids of what is gone
  std::vector<std::string> erase(const std::string& where, const PostgresValue& value) {
    const auto erased =
        work.run("DELETE FROM splatdrag.jobs WHERE " + where + " RETURNING number, pg_current_xact_id()::text", value);
    if (erased.size() == 0) return {};
    change = erased.text(0, 1);
    has_news = true;
    return ids(erased);
  }
  void check_room_for_one(std::size_t max_queued) {
    const auto rows = work.run("SELECT count(*) FROM splatdrag.jobs WHERE ended IS NULL AND state = 'queued'");
    jobs::check_room(std::size_t(rows.integer(0, 0)), max_queued);
  }

  /// The holder of these is no more, or its claim has run out.
  void abandon_where(const std::string& where) {
    const auto rows = work.run(select(options, true) + "WHERE " + where + " ORDER BY number FOR UPDATE SKIP LOCKED");
    for (int row = 0; row < rows.size(); ++row) {
      const auto [job, now] = read(rows, row);
      const auto changed = transition(job, {.event = Event::abandon, .max_deaths = options.max_deaths}, now);
      if (!changed) throw StoreFailure(changed.error());
      write(*changed);
      has_news = true;
    }
  }

  const PostgresOptions options;
  const PostgresAddress address;
  std::mutex mutex;  ///< Guards what follows.
  PostgresConnection work;
  std::string change;     ///< Number of the transaction in work, once it has changed something.
  bool has_news = false;  ///< The transaction in work has done what others may wait for.
  std::optional<std::pair<Error, steady_clock::time_point>> failed;  ///< Why there is no server, and until when.
  std::atomic<int> process = 0;                                      ///< The server's, of `work`. Not guarded.

  std::mutex pulse_mutex;  ///< Guards `pulse`: who renews a claim waits for nobody.
  PostgresConnection pulse;

  std::mutex listener_mutex;  ///< Guards `listener`.
  std::optional<PostgresListener> listener;
};

PostgresStore::PostgresStore(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PostgresStore::~PostgresStore() = default;

Result<std::unique_ptr<PostgresStore>> PostgresStore::open(const PostgresOptions& options) {
  const auto address = parse_postgres_address(options.address);
  if (!address) return propagate(address);
  auto impl = std::make_unique<Impl>(options, *address);
  auto opened = guarded([&] {
    join(impl->work, options);
    if (options.visits) return check_is_ours(impl->work, options);
    PostgresTransaction transaction(impl->work);
    bring_up_to_date(impl->work, options);
    if (options.alone) impl->abandon_where("ended IS NULL AND claimed");
    transaction.commit();
    impl->process = impl->work.process();
  });
  if (!opened) return fail(opened.error().code, opened.error().message, address->shown);
  return std::unique_ptr<PostgresStore>(new PostgresStore(std::move(impl)));
}

Result<std::string> PostgresStore::move_away(const PostgresOptions& options) {
  const auto address = parse_postgres_address(options.address);
  if (!address) return propagate(address);
  PostgresOptions by_itself = options;
  by_itself.alone = true;
  auto moved = guarded([&] {
    PostgresConnection connection(*address);
    join(connection, by_itself);
    PostgresTransaction transaction(connection);
    std::string name = move_tables_away(connection, by_itself);
    transaction.commit();
    return name;
  });
  if (!moved) return fail(moved.error().code, moved.error().message, address->shown);
  return moved;
}

Result<Submission> PostgresStore::submit(const NewJob& job, std::size_t max_queued, const Witness& witness) {
  return impl_->transact([&]() -> Submission {
    // Whoever holds this row commits before the next one counts on: no two look for the same key or the last free place
    // at once, and of a lane no job is seen before the one that it has to wait for.
    const auto last = impl_->work.run("SELECT last_number, " + impl_->options.now + " FROM splatdrag.store FOR UPDATE");
    if (!job.idempotency_key.empty())
      if (auto earlier = impl_->find_where("WHERE idempotency_key = $1", job.idempotency_key))
        return same_submission(std::move(*earlier), job);
    impl_->check_room_for_one(max_queued);
    impl_->check_quota(job);
    Job accepted;
    accepted.id = id_of(last.integer(0, 0) + 1);
    accepted.lane = job.lane;
    accepted.payload = job.payload;
    accepted.idempotency_key = job.idempotency_key;
    accepted.expected = job.expected;
    accepted.requester = job.requester;
    accepted.created = time_at(last, 0, 1).value_or(Time{});
    impl_->insert(accepted);
    impl_->has_news = true;
    accepted = impl_->find(accepted.id);
    if (const auto witnessed = witness(accepted); !witnessed) throw StoreFailure(witnessed.error());
    return {.job = std::move(accepted), .created = true};
  });
}

Result<void> PostgresStore::check_room(std::size_t max_queued) {
  return impl_->look([&] { impl_->check_room_for_one(max_queued); });
}

Result<void> PostgresStore::check_quota(const NewJob& job) {
  return impl_->look([&] { impl_->check_quota(job); });
}

Result<Usage> PostgresStore::usage(const std::string& requester) {
  return impl_->look([&] { return impl_->usage(requester); });
}

Result<Job> PostgresStore::requeue(const std::string& id, int finished_intervals, const Witness& witness) {
  return impl_->transact([&] {
    impl_->work.run(
        "SELECT 1::bigint FROM splatdrag.store FOR UPDATE");  // as in submit(): none joins the lane meanwhile
    const auto [job, now] = impl_->find_to_change(id);
    const auto younger = ids(
        impl_->work.run("SELECT number FROM splatdrag.jobs WHERE ended IS NULL AND lane = $1 AND number > $2 LIMIT 1",
                        job.lane, known_number(id)));
    check_is_last_of_lane(job, younger);
    auto changed = transition(job, {.event = Event::requeue, .interval = finished_intervals}, now);
    if (!changed) throw StoreFailure(changed.error());
    impl_->write(*changed);
    impl_->has_news = true;
    impl_->find_places({&*changed, 1});
    if (const auto witnessed = witness(*changed); !witnessed) throw StoreFailure(witnessed.error());
    return std::move(*changed);
  });
}

Result<Time> PostgresStore::now() {
  return impl_->look(
      [&] { return Time(std::chrono::milliseconds(impl_->work.run("SELECT " + impl_->options.now).integer(0, 0))); });
}

Result<void> PostgresStore::restore(const Job& job) {
  return impl_->transact([&] {
    impl_->work.run("SELECT 1::bigint FROM splatdrag.store FOR UPDATE");  // as in submit()
    if (!job.idempotency_key.empty())
      check_owner_of_key(impl_->find_where("WHERE idempotency_key = $1", job.idempotency_key), job);
    Job restored = job;
    restored.claimed = false;
    impl_->insert(restored);
    impl_->write(restored);
    impl_->has_news = true;
  });
}

Result<Job> PostgresStore::find(const std::string& id) {
  return impl_->look([&] { return impl_->find(id); });
}

Result<std::optional<Job>> PostgresStore::find_key(const std::string& idempotency_key) {
  return impl_->look([&] { return impl_->find_where("WHERE idempotency_key = $1", idempotency_key); });
}

Result<std::vector<Job>> PostgresStore::list(const Filter& filter) {
  return impl_->look([&] {
    const auto rows = impl_->work.run(
        select(impl_->options, false) +
            "WHERE ($1::bytea IS NULL OR lane = $1) AND (NOT $2 OR ended IS NULL) ORDER BY number DESC LIMIT $3",
        filter.lane, filter.active_only, std::int64_t(filter.limit));
    std::vector<Job> jobs;
    for (int row = 0; row < rows.size(); ++row) jobs.push_back(read(rows, row).job);
    impl_->find_places(jobs);
    return jobs;
  });
}

Result<std::optional<Job>> PostgresStore::claim() {
  return impl_->transact([&]() -> std::optional<Job> {
    auto rows = impl_->find_next();
    // The usual case costs one question: is there a job, and no claim that has run out?
    if (rows.size() == 0 || rows.truth(0, columns_of_job)) {
      impl_->abandon_where(ran_out(impl_->options));
      rows = impl_->find_next();
    }
    if (rows.size() == 0) return std::nullopt;
    const auto [next, now] = read(rows, 0);
    auto claimed = transition(next, {.event = Event::claim, .holder = impl_->options.holder}, now);
    if (!claimed) throw StoreFailure(claimed.error());
    impl_->write(*claimed, /*claims=*/true);
    return std::move(*claimed);
  });
}

std::optional<std::chrono::milliseconds> PostgresStore::lease() const { return impl_->options.lease; }

Result<JobState> PostgresStore::renew(const std::string& id, std::int64_t claim) {
  return guarded([&] {
    const std::lock_guard lock(impl_->pulse_mutex);
    PostgresConnection& pulse = impl_->pulse;
    return Impl::again_if_lost([&] {
      if (!pulse.is_open()) {
        pulse.open();
        pulse.execute("SET synchronous_commit = off");  // a lease that a crash makes shorter does no harm
      }
      const std::int64_t number = known_number(id);
      const auto renewed = pulse.run("UPDATE splatdrag.jobs SET lease_until = " + impl_->options.now +
                                         " + $3 WHERE number = $1 AND claimed AND claim_number = $2 RETURNING state",
                                     number, claim, std::int64_t(impl_->options.lease.count()));
      const auto state = renewed.size() == 0 ? std::nullopt : parse_state(renewed.text(0, 0));
      if (state) return *state;
      const auto rows = pulse.run(select(impl_->options, false) + "WHERE number = $1", number);
      if (rows.size() == 0) no_such_job(id);
      const Job job = read(rows, 0).job;
      if (const auto holds = check_claim(job, claim); !holds) throw StoreFailure(holds.error());
      return job.state;
    });
  });
}

Result<bool> PostgresStore::should_make_way(const std::string& id, std::chrono::milliseconds left) {
  return impl_->look([&] {
    const Job running = impl_->find(id);
    if (running.state != JobState::running) return false;
    // Only the next one counts: a shorter one behind it would not get the worker.
    const auto rows = impl_->work.run(
        std::string("SELECT 1::bigint FROM (SELECT state, expected, turn FROM splatdrag.jobs WHERE ") + can_run + " " +
            in_turn + ") AS next WHERE (state = 'stop_requested' OR expected BETWEEN 1 AND $1) AND turn < $2",
        std::int64_t(left.count() / 2), turn_of(running));
    return rows.size() > 0;
  });
}

Result<Job> PostgresStore::apply(const std::string& id, const Change& change) {
  return impl_->transact([&] {
    const auto [job, now] = impl_->find_to_change(id);
    auto changed = transition(job, change, now);
    if (!changed) throw StoreFailure(changed.error());
    impl_->write(*changed, change.event == Event::claim);
    impl_->count_worked(changed->requester, changed->worked - job.worked, now);
    impl_->has_news = true;
    impl_->find_places({&*changed, 1});
    return std::move(*changed);
  });
}

Result<void> PostgresStore::remove(const std::string& id) {
  return impl_->transact([&] {
    check_has_ended(impl_->find_to_change(id).job);
    impl_->erase("number = $1", known_number(id));
  });
}

Result<std::vector<std::string>> PostgresStore::expire(const Retention& retention) {
  return impl_->transact([&] {
    const std::chrono::milliseconds age = retention.max_age;
    auto expired =
        impl_->erase("ended IS NOT NULL AND ended < " + impl_->options.now + " - $1", std::int64_t(age.count()));
    const auto too_many = impl_->erase(
        "ended IS NOT NULL AND (ended, number) <= (SELECT ended, number FROM splatdrag.jobs WHERE ended IS NOT NULL "
        "ORDER BY ended DESC, number DESC OFFSET $1 LIMIT 1)",
        std::int64_t(retention.max_count));
    expired.insert(expired.end(), too_many.begin(), too_many.end());
    impl_->work.run("DELETE FROM splatdrag.worked WHERE day < " + impl_->options.now + " / 86400000 - $1", days_kept);
    std::ranges::sort(expired);
    return expired;
  });
}

void PostgresStore::watch(std::function<void()> news) {
  const std::lock_guard lock(impl_->listener_mutex);
  impl_->listener.reset();
  if (news) impl_->listener.emplace(impl_->address, impl_->process, std::move(news));
}

}  // namespace engine::jobs
