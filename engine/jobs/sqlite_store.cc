#include "engine/jobs/sqlite_store.h"

#include <sqlite3.h>

#include <cstdint>
#include <exception>
#include <mutex>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include "engine/core/byte_writer.h"
#include "engine/core/checksum.h"
#include "engine/core/file_descriptor.h"
#include "engine/jobs/durable_file.h"
#include "engine/jobs/store_rules.h"

namespace engine::jobs {
namespace {

constexpr int schema_number = 6;  // of the tables below; user_version in the file
constexpr const char* schema = R"(
  CREATE TABLE jobs (
    number INTEGER PRIMARY KEY AUTOINCREMENT,  -- AUTOINCREMENT: a removed job's number is never given away again
    lane TEXT NOT NULL,
    payload TEXT NOT NULL,
    idempotency_key TEXT UNIQUE,
    state TEXT NOT NULL,
    claimed INTEGER NOT NULL,
    stopped_early INTEGER NOT NULL,
    finished_intervals INTEGER NOT NULL,
    progress TEXT NOT NULL,
    result TEXT NOT NULL,
    error_code TEXT,
    error_message TEXT,
    error_where TEXT,
    created INTEGER NOT NULL,  -- times: milliseconds since 1970
    started INTEGER,
    ended INTEGER
  ) STRICT;
  CREATE INDEX active ON jobs (lane, number) WHERE ended IS NULL;
  CREATE INDEX finished ON jobs (ended, number) WHERE ended IS NOT NULL;
  PRAGMA user_version = 1;
)";
/// From schema 1 to 2: new files take this way, too, so that there is only one.
constexpr const char* counts_deaths = R"(
  ALTER TABLE jobs ADD COLUMN place TEXT NOT NULL DEFAULT '';
  ALTER TABLE jobs ADD COLUMN died_at TEXT NOT NULL DEFAULT '';
  ALTER TABLE jobs ADD COLUMN deaths INTEGER NOT NULL DEFAULT 0;
  PRAGMA user_version = 2;
)";

/// From schema 2 to 3.
constexpr const char* adds_checksums = "ALTER TABLE jobs ADD COLUMN checksum INTEGER NOT NULL DEFAULT 0;";
/// From schema 3 to 4: how long jobs take, milliseconds.
constexpr const char* adds_expected = "ALTER TABLE jobs ADD COLUMN expected INTEGER NOT NULL DEFAULT 0;";
/// From schema 4 to 5.
constexpr const char* adds_claim_numbers = "ALTER TABLE jobs ADD COLUMN claim_number INTEGER NOT NULL DEFAULT 0;";

/// From schema 5 to 6: who asked for a job, who holds it, and what was worked for whom.
constexpr const char* adds_people = R"(
  ALTER TABLE jobs ADD COLUMN requester TEXT NOT NULL DEFAULT '';
  ALTER TABLE jobs ADD COLUMN worked INTEGER NOT NULL DEFAULT 0;  -- milliseconds
  ALTER TABLE jobs ADD COLUMN holder TEXT NOT NULL DEFAULT '';
  ALTER TABLE jobs ADD COLUMN claimed_at INTEGER;
  CREATE TABLE worked (
    requester TEXT NOT NULL,
    day INTEGER NOT NULL,  -- since 1970, UTC
    milliseconds INTEGER NOT NULL,
    PRIMARY KEY (requester, day)
  ) STRICT, WITHOUT ROWID;
)";

/// A row in the order of its checksum, which is the last of its columns. SQLite's own checks see damage to its pages
/// and indices, but not to what they hold.
std::string summed_columns(int schema_of_row = schema_number) {
  std::string columns =
      "number, lane, payload, idempotency_key, state, claimed, stopped_early, finished_intervals, progress, result, "
      "error_code, error_message, error_where, created, started, ended, place, died_at, deaths";
  if (schema_of_row > 3) columns += ", expected";
  if (schema_of_row > 4) columns += ", claim_number";
  if (schema_of_row > 5) columns += ", requester, worked, holder, claimed_at";
  return columns;
}

/// turn_of() in SQL.
///   job  the table, or another name of it
std::string turn_in_sql(const std::string& job) {
  return "(" + job + ".created + CASE " + job + ".state WHEN 'stop_requested' THEN 0 ELSE " + std::to_string(stretch) +
         " * max(" + job + ".expected - " + std::to_string(negligible.count()) + ", 0) END)";
}
/// Of jobs that have not ended: nobody holds it, and none of its lane comes before it.
constexpr const char* can_run =
    "ended IS NULL AND NOT claimed AND NOT EXISTS (SELECT 1 FROM jobs AS older WHERE older.ended IS NULL AND "
    "older.lane = jobs.lane AND older.number < jobs.number)";

/// Columns of the job that comes next, if one can run. One that runs although nobody holds it was interrupted, and has
/// not made way.
std::string next_in_sql(const std::string& columns) {
  return "SELECT " + columns + " FROM jobs WHERE " + can_run + " ORDER BY state = 'running' DESC, " +
         turn_in_sql("jobs") + ", number LIMIT 1";
}

/// What row_checksum(...) is in SQL: fnv1a() over the values, each with its type and length.
void row_checksum(sqlite3_context* context, int count, sqlite3_value** values) {
  ByteWriter all;
  for (const std::span<sqlite3_value*> rest(values, std::size_t(count)); sqlite3_value* const value : rest) {
    const int type = sqlite3_value_type(value);
    all.write(std::int32_t(type));
    if (type == SQLITE_INTEGER) {
      all.write(std::int64_t(sqlite3_value_int64(value)));
    } else if (type != SQLITE_NULL) {
      const auto* const bytes = static_cast<const std::byte*>(sqlite3_value_blob(value));
      const std::span text(bytes, std::size_t(sqlite3_value_bytes(value)));
      all.write(std::uint64_t(text.size()));
      all.write_all(text);
    }
  }
  sqlite3_result_int64(context, std::int64_t(fnv1a(all.bytes())));
}

std::string checksum_of_row(int schema_of_row = schema_number) {
  return "row_checksum(" + summed_columns(schema_of_row) + ")";
}

class Database {
 public:
  explicit Database(std::filesystem::path file) : file_(std::move(file)) {}
  ~Database() { sqlite3_close(handle_); }
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  void open(std::chrono::milliseconds busy_timeout) {
    // NOMUTEX: SqliteStore lets in one thread at a time, because a transaction is several calls.
    const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX;
    check(sqlite3_open_v2(file_.c_str(), &handle_, flags, nullptr));
    sqlite3_busy_timeout(handle_, int(busy_timeout.count()));
    check(sqlite3_create_function(handle_, "row_checksum", -1, SQLITE_UTF8 | SQLITE_DETERMINISTIC | SQLITE_INNOCUOUS,
                                  nullptr, row_checksum, nullptr, nullptr));
  }
  void execute(const char* sql) { check(sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr)); }
  void check(int code) const {
    if (code != SQLITE_OK && code != SQLITE_ROW && code != SQLITE_DONE) throw StoreFailure(error(code));
  }
  [[noreturn]] void corrupt(const std::string& what) const {
    throw StoreFailure({ErrorCode::corrupt_data, "the job store is damaged (" + what + ")", file_});
  }
  [[nodiscard]] sqlite3* handle() const { return handle_; }
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

 private:
  [[nodiscard]] Error error(int code) const {
    const std::string reason = sqlite3_errstr(code);
    // SQLite calls only ENOSPC a full disk; a quota or a limit on file size is one, too.
    if ((code & 0xff) == SQLITE_FULL || ((code & 0xff) == SQLITE_IOERR && means_no_space(last_errno())))
      return {ErrorCode::no_space, "the job store cannot grow, the disk is full: free some space and try again", file_};
    switch (code & 0xff) {
      case SQLITE_CORRUPT:
        return {ErrorCode::corrupt_data, "the job store is damaged", file_};
      case SQLITE_NOTADB:
        return {ErrorCode::corrupt_data, "the file is no job store", file_};
      case SQLITE_BUSY:
      case SQLITE_LOCKED:
        return {ErrorCode::unavailable, "another process uses this job store: end it, or choose another data folder",
                file_};
      case SQLITE_CANTOPEN:
      case SQLITE_READONLY:
      case SQLITE_PERM:
      case SQLITE_IOERR:
        return {ErrorCode::unavailable, "the job store cannot be read or written: " + reason, file_};
      case SQLITE_TOOBIG:
        return {ErrorCode::too_large, "the text is longer than the job store takes (1 GB)", {}};
      default:
        return {ErrorCode::internal, "job store: " + reason + ": " + sqlite3_errmsg(handle_), file_};
    }
  }

  /// The errno of the write-ahead log, to which all is written first. (sqlite3_system_errno() is gone after a
  /// rollback.)
  [[nodiscard]] int last_errno() const {
    int number = 0;
    sqlite3_file* log = nullptr;
    sqlite3_file_control(handle_, "main", SQLITE_FCNTL_JOURNAL_POINTER, static_cast<void*>(&log));
    if (log && log->pMethods) log->pMethods->xFileControl(log, SQLITE_FCNTL_LAST_ERRNO, &number);
    return number;
  }

  std::filesystem::path file_;
  sqlite3* handle_ = nullptr;
};

/// One statement with its parameters, which bind to ?1, ?2, ... Texts must outlive it.
class Statement {
 public:
  template <class... Values>
  explicit Statement(Database& database, std::string_view sql, const Values&... values) : database_(database) {
    sqlite3_stmt* prepared = nullptr;
    const int code = sqlite3_prepare_v2(database_.handle(), sql.data(), int(sql.size()), &prepared, nullptr);
    // Our statements are right for our tables: where they are not, the tables have become others.
    if (code == SQLITE_ERROR) database_.corrupt(sqlite3_errmsg(database_.handle()));
    database_.check(code);
    handle_.reset(prepared);
    (bind(values), ...);
  }

  /// Whether there is another row.
  bool step() {
    const int code = sqlite3_step(handle_.get());
    database_.check(code);
    return code == SQLITE_ROW;
  }
  void run() {
    while (step()) {
    }
  }
  [[nodiscard]] bool is_null(int column) const { return sqlite3_column_type(handle_.get(), column) == SQLITE_NULL; }
  [[nodiscard]] std::int64_t integer(int column) const { return sqlite3_column_int64(handle_.get(), column); }
  [[nodiscard]] std::string text(int column) const {
    const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(handle_.get(), column));
    return bytes ? std::string(bytes, std::size_t(sqlite3_column_bytes(handle_.get(), column))) : std::string();
  }

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  void bind(std::int64_t value) { database_.check(sqlite3_bind_int64(handle_.get(), ++bound_, value)); }
  void bind(std::string_view value) {
    database_.check(sqlite3_bind_text64(handle_.get(), ++bound_, value.data() ? value.data() : "", value.size(),
                                        SQLITE_STATIC, SQLITE_UTF8));
  }
  void bind(const std::string& value) { bind(std::string_view(value)); }
  void bind(Time value) { bind(std::int64_t(value.time_since_epoch().count())); }
  template <class T>
  void bind(const std::optional<T>& value) {
    if (value) {
      bind(*value);
    } else {
      database_.check(sqlite3_bind_null(handle_.get(), ++bound_));
    }
  }

  Database& database_;
  std::unique_ptr<sqlite3_stmt, Finalize> handle_;
  int bound_ = 0;
};

class Transaction {
 public:
  explicit Transaction(Database& database) : database_(database) { database_.execute("BEGIN IMMEDIATE"); }
  ~Transaction() {
    // A full disk may have rolled it back already.
    if (!sqlite3_get_autocommit(database_.handle()))
      sqlite3_exec(database_.handle(), "ROLLBACK", nullptr, nullptr, nullptr);
  }
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  void commit() { database_.execute("COMMIT"); }

 private:
  Database& database_;
};

/// What read() reads. A list has neither the long texts nor the row held against its checksum, which is over them, too.
std::string select(bool whole) {
  const std::string payload = whole ? "payload" : "''", result = whole ? "result" : "''";
  const std::string is_sound = whole ? "checksum IS " + checksum_of_row() : "1";
  return "SELECT number, lane, " + payload +
         ", idempotency_key, state, claimed, stopped_early, finished_intervals, progress, " + result +
         ", error_code, error_message, error_where, created, started, ended, place, died_at, deaths, expected, "
         "claim_number, requester, worked, holder, claimed_at, " +
         is_sound + " FROM jobs ";
}

std::optional<Time> time_at(const Statement& row, int column) {
  if (row.is_null(column)) return std::nullopt;
  return Time(std::chrono::milliseconds(row.integer(column)));
}

Job read(const Database& database, const Statement& row) {
  Job job;
  job.id = id_of(row.integer(0));
  if (row.integer(25) == 0) database.corrupt("the record of job " + job.id);
  job.lane = row.text(1);
  job.payload = row.text(2);
  job.idempotency_key = row.text(3);
  const auto state = parse_state(row.text(4));
  if (!state) database.corrupt("job " + job.id + " is in state \"" + row.text(4) + "\"");
  job.state = *state;
  job.claimed = row.integer(5) != 0;
  job.stopped_early = row.integer(6) != 0;
  job.finished_intervals = int(row.integer(7));
  job.progress = row.text(8);
  job.result = row.text(9);
  if (!row.is_null(10)) {
    const auto code = parse_code(row.text(10));
    if (!code) database.corrupt("job " + job.id + " has error code \"" + row.text(10) + "\"");
    job.error = Error{*code, row.text(11), row.text(12)};
  }
  job.created = time_at(row, 13).value_or(Time{});
  job.started = time_at(row, 14);
  job.ended = time_at(row, 15);
  job.place = row.text(16);
  job.died_at = row.text(17);
  job.deaths = int(row.integer(18));
  job.expected = std::chrono::milliseconds(row.integer(19));
  job.claim_number = row.integer(20);
  job.requester = row.text(21);
  job.worked = std::chrono::milliseconds(row.integer(22));
  job.holder = row.text(23);
  job.claimed_at = time_at(row, 24);
  return job;
}

std::vector<ActiveJob> active_jobs(Database& database) {
  std::vector<ActiveJob> active;
  Statement row(database, "SELECT number, lane, state, " + turn_in_sql("jobs") +
                              " FROM jobs WHERE ended IS NULL ORDER BY number");
  while (row.step())
    active.push_back({row.integer(0), row.text(1), row.text(2) == to_string(JobState::queued), row.integer(3)});
  return active;
}

/// What read() leaves out.
void find_places(Database& database, std::span<Job> jobs) {
  give_places(jobs, [&] { return active_jobs(database); });
}

Job find_in(Database& database, const std::string& id) {
  Statement row(database, select(true) + "WHERE number = ?1", known_number(id));
  if (!row.step()) no_such_job(id);
  Job job = read(database, row);
  find_places(database, {&job, 1});
  return job;
}

std::optional<Job> find_key_in(Database& database, const std::string& key) {
  Statement row(database, select(true) + "WHERE idempotency_key = ?1", key);
  if (!row.step()) return std::nullopt;
  Job job = read(database, row);
  find_places(database, {&job, 1});
  return job;
}

/// Notes in a row what it holds now.
void seal(Database& database, std::int64_t number) {
  Statement(database, "UPDATE jobs SET checksum = " + checksum_of_row() + " WHERE number = ?1", number).run();
}

/// Writes down all of a record that may change.
void write_in(Database& database, const Job& job) {
  std::optional<std::string_view> code, message, where;
  if (job.error) {
    code = code_name(job.error->code);
    message = job.error->message;
    where = job.error->where;
  }
  Statement(database,
            "UPDATE jobs SET state = ?2, claimed = ?3, stopped_early = ?4, finished_intervals = ?5, progress = ?6, "
            "result = ?7, error_code = ?8, error_message = ?9, error_where = ?10, started = ?11, ended = ?12, "
            "place = ?13, died_at = ?14, deaths = ?15, claim_number = max(claim_number, ?16), worked = ?17, "
            "holder = ?18, claimed_at = ?19 WHERE number = ?1",
            known_number(job.id), to_string(job.state), std::int64_t(job.claimed), std::int64_t(job.stopped_early),
            std::int64_t(job.finished_intervals), job.progress, job.result, code, message, where, job.started,
            job.ended, job.place, job.died_at, std::int64_t(job.deaths), job.claim_number,
            std::int64_t(job.worked.count()), job.holder, job.claimed_at)
      .run();
  seal(database, known_number(job.id));
}

Job apply_in(Database& database, const std::string& id, const Change& change, Time now) {
  const Job before = find_in(database, id);
  const auto changed = transition(before, change, now);
  if (!changed) throw StoreFailure(changed.error());
  write_in(database, *changed);
  if (const auto worked = changed->worked - before.worked; worked.count() > 0 && !changed->requester.empty())
    Statement(database,
              "INSERT INTO worked (requester, day, milliseconds) VALUES (?1, ?2, ?3) ON CONFLICT DO UPDATE SET "
              "milliseconds = milliseconds + excluded.milliseconds",
              changed->requester, day_of(now), std::int64_t(worked.count()))
        .run();
  return find_in(database, id);
}

Usage usage_in(Database& database, const std::string& requester, Time now) {
  Statement active(database,
                   "SELECT count(*), coalesce(sum(max(expected - worked, 0)), 0) FROM jobs WHERE ended IS NULL AND "
                   "requester = ?1",
                   requester);
  active.step();
  Usage usage{.active = std::size_t(active.integer(0)), .expected = std::chrono::milliseconds(active.integer(1))};
  Statement worked(database, "SELECT milliseconds FROM worked WHERE requester = ?1 AND day = ?2", requester,
                   day_of(now));
  if (worked.step()) usage.worked_today = std::chrono::milliseconds(worked.integer(0));
  return usage;
}

void check_quota_in(Database& database, const NewJob& job, Time now) {
  if (has_limit(job.quota)) jobs::check_quota(usage_in(database, job.requester, now), job);
}

/// First column of the first row.
std::string text_of(Database& database, std::string_view sql) {
  Statement row(database, sql);
  return row.step() ? row.text(0) : std::string();
}

void check_room_in(Database& database, std::size_t max_queued) {
  check_room(std::stoull(text_of(database, "SELECT count(*) FROM jobs WHERE ended IS NULL AND state = 'queued'")),
             max_queued);
}

std::vector<std::string> ids(Statement&& rows) {
  std::vector<std::string> found;
  while (rows.step()) found.push_back(id_of(rows.integer(0)));
  return found;
}

/// AUTOINCREMENT counts on from here.
void skip_numbers(Database& database, std::int64_t used) {
  if (text_of(database, "SELECT count(*) FROM sqlite_sequence WHERE name = 'jobs'") == "0")
    database.execute("INSERT INTO sqlite_sequence (name, seq) VALUES ('jobs', 0)");
  Statement(database, "UPDATE sqlite_sequence SET seq = max(seq, ?1) WHERE name = 'jobs'", used).run();
}

/// Names a row that does not have its checksum.
void check_rows(Database& database, int schema_of_rows = schema_number) {
  for (const std::string& id : ids(Statement(
           database, "SELECT number FROM jobs WHERE checksum IS NOT " + checksum_of_row(schema_of_rows) + " LIMIT 1")))
    database.corrupt("the record of job " + id);
}

/// Makes the tables, or those of an older version into ours.
void bring_up_to_date(Database& database, int found_schema) {
  if (found_schema == 0) {
    if (text_of(database, "SELECT count(*) FROM sqlite_schema") != "0")
      throw StoreFailure({ErrorCode::corrupt_data, "the file is no job store", database.file()});
    database.execute(schema);
  }
  // A damaged number of the schema would have columns added twice.
  const auto has = [&](const std::string& column) {
    return text_of(database, "SELECT count(*) FROM pragma_table_info('jobs') WHERE name = '" + column + "'") != "0";
  };
  if ((found_schema < 3 && has("checksum")) || (found_schema < 4 && has("expected")) ||
      (found_schema < 5 && has("claim_number")) || (found_schema < 6 && has("requester")))
    database.corrupt("the number of its schema");
  if (found_schema == schema_number) return;
  if (found_schema < 2) database.execute(counts_deaths);
  if (found_schema < 3) database.execute(adds_checksums);
  if (found_schema >= 3) check_rows(database, found_schema);  // before they are sealed anew
  if (found_schema < 4) database.execute(adds_expected);
  if (found_schema < 5) database.execute(adds_claim_numbers);
  database.execute(adds_people);
  database.execute(("PRAGMA user_version = " + std::to_string(schema_number)).c_str());
  Statement(database, "UPDATE jobs SET checksum = " + checksum_of_row()).run();
}

/// SQLite's own check, of indices, too, and ours of what the rows hold.
void check_all(Database& database) {
  if (const auto found = text_of(database, "PRAGMA integrity_check(1)"); found != "ok") database.corrupt(found);
  check_rows(database);
}

void prepare(Database& database, Time now, const SqliteOptions& options) {
  // EXCLUSIVE before the first access: the lock is then held until the process ends, and no shared memory is needed.
  database.execute("PRAGMA locking_mode = EXCLUSIVE; PRAGMA synchronous = FULL;");
  if (text_of(database, "PRAGMA journal_mode = WAL") != "wal")
    throw StoreFailure({ErrorCode::unavailable, "this file system cannot hold a job store: choose another data folder",
                        database.file()});
  Transaction transaction(database);
  const int found_schema = std::stoi(text_of(database, "PRAGMA user_version"));
  if (found_schema > schema_number)
    throw StoreFailure({ErrorCode::unsupported,
                        "the job store was written by a newer version (" + std::to_string(found_schema) +
                            ", known is " + std::to_string(schema_number) +
                            "): use that one, or choose another data folder",
                        database.file()});
  bring_up_to_date(database, found_schema);
  check_all(database);
  if (!options.visits)
    for (const std::string& id : ids(Statement(database, "SELECT number FROM jobs WHERE claimed ORDER BY number")))
      apply_in(database, id, {.event = Event::abandon, .max_deaths = options.max_deaths}, now);
  if (options.used_numbers > 0) skip_numbers(database, options.used_numbers);
  transaction.commit();
}

/// 0 for a file that is absent or cannot be looked at.
std::uintmax_t size_of(const std::filesystem::path& file) {
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  return error ? 0 : size;
}

}  // namespace

struct SqliteStore::Impl {
  Impl(std::filesystem::path file, std::string holds, std::function<Time()> clock)
      : database(std::move(file)), holder(std::move(holds)), now(std::move(clock)) {}

  /// One transaction, one thread at a time.
  template <class Body>
  auto transact(Body body) -> Result<decltype(body())> {
    return guarded([&] {
      const std::lock_guard lock(mutex);
      Transaction transaction(database);
      if constexpr (std::is_void_v<decltype(body())>) {
        body();
        transaction.commit();
      } else {
        auto result = body();
        transaction.commit();
        return result;
      }
    });
  }

  std::mutex mutex;  ///< Guards `database`: SQLite's connection is one thread's at a time.
  Database database;
  const std::string holder;
  std::function<Time()> now;
};

SqliteStore::SqliteStore(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SqliteStore::~SqliteStore() = default;

Result<std::unique_ptr<SqliteStore>> SqliteStore::open(const SqliteOptions& options) {
  if (auto made = create_folder(options.folder); !made) return propagate(made);
  return guarded([&] {
    auto impl = std::make_unique<Impl>(options.folder / "jobs.db", options.holder, options.now);
    if (options.must_exist && size_of(impl->database.file()) == 0)
      throw StoreFailure(
          {ErrorCode::corrupt_data, "the job store is gone, but there have been jobs", impl->database.file()});
    impl->database.open(options.busy_timeout);
    prepare(impl->database, impl->now(), options);
    return std::unique_ptr<SqliteStore>(new SqliteStore(std::move(impl)));
  });
}

Result<Submission> SqliteStore::submit(const NewJob& job, std::size_t max_queued, const Witness& witness) {
  return impl_->transact([&]() -> Submission {
    Database& database = impl_->database;
    std::optional<std::string_view> key;
    if (!job.idempotency_key.empty()) {
      key = job.idempotency_key;
      if (auto earlier = find_key_in(database, job.idempotency_key)) return same_submission(std::move(*earlier), job);
    }
    check_room_in(database, max_queued);
    const Time now = impl_->now();
    check_quota_in(database, job, now);
    Statement(database,
              "INSERT INTO jobs (lane, payload, idempotency_key, state, claimed, stopped_early, finished_intervals, "
              "progress, result, created, expected, requester) VALUES (?1, ?2, ?3, 'queued', 0, 0, 0, '', '', ?4, ?5, "
              "?6)",
              job.lane, job.payload, key, now, std::int64_t(job.expected.count()), job.requester)
        .run();
    seal(database, sqlite3_last_insert_rowid(database.handle()));
    Job accepted = find_in(database, id_of(sqlite3_last_insert_rowid(database.handle())));
    if (const auto witnessed = witness(accepted); !witnessed) throw StoreFailure(witnessed.error());
    return {.job = std::move(accepted), .created = true};
  });
}

Result<void> SqliteStore::check_room(std::size_t max_queued) {
  return guarded([&] {
    const std::lock_guard lock(impl_->mutex);
    check_room_in(impl_->database, max_queued);
  });
}

Result<void> SqliteStore::check_quota(const NewJob& job) {
  return guarded([&] {
    const std::lock_guard lock(impl_->mutex);
    check_quota_in(impl_->database, job, impl_->now());
  });
}

Result<Usage> SqliteStore::usage(const std::string& requester) {
  return guarded([&] {
    const std::lock_guard lock(impl_->mutex);
    return usage_in(impl_->database, requester, impl_->now());
  });
}

Result<Job> SqliteStore::requeue(const std::string& id, int finished_intervals, const Witness& witness) {
  return impl_->transact([&] {
    const Job job = find_in(impl_->database, id);
    const auto younger = ids(
        Statement(impl_->database, "SELECT number FROM jobs WHERE ended IS NULL AND lane = ?1 AND number > ?2 LIMIT 1",
                  job.lane, known_number(id)));
    check_is_last_of_lane(job, younger);
    Job requeued =
        apply_in(impl_->database, id, {.event = Event::requeue, .interval = finished_intervals}, impl_->now());
    if (const auto witnessed = witness(requeued); !witnessed) throw StoreFailure(witnessed.error());
    return requeued;
  });
}

Result<Time> SqliteStore::now() { return impl_->now(); }

Result<void> SqliteStore::restore(const Job& job) {
  return impl_->transact([&] {
    Database& database = impl_->database;
    std::optional<std::string_view> key;
    if (!job.idempotency_key.empty()) {
      key = job.idempotency_key;
      check_owner_of_key(find_key_in(database, job.idempotency_key), job);
    }
    const std::int64_t number = known_number(job.id);
    Statement(database,
              "INSERT OR IGNORE INTO jobs (number, lane, payload, state, claimed, stopped_early, finished_intervals, "
              "progress, result, created) VALUES (?1, ?2, ?3, 'queued', 0, 0, 0, '', '', ?4)",
              number, job.lane, job.payload, job.created)
        .run();
    Statement(database,
              "UPDATE jobs SET lane = ?2, payload = ?3, idempotency_key = ?4, created = ?5, expected = ?6, "
              "requester = ?7 WHERE number = ?1",
              number, job.lane, job.payload, key, job.created, std::int64_t(job.expected.count()), job.requester)
        .run();
    write_in(database, job);
  });
}

Result<Job> SqliteStore::find(const std::string& id) {
  return guarded([&] {
    const std::lock_guard lock(impl_->mutex);
    return find_in(impl_->database, id);
  });
}

Result<std::optional<Job>> SqliteStore::find_key(const std::string& idempotency_key) {
  return guarded([&] {
    const std::lock_guard lock(impl_->mutex);
    return find_key_in(impl_->database, idempotency_key);
  });
}

Result<std::vector<Job>> SqliteStore::list(const Filter& filter) {
  return guarded([&] {
    const std::lock_guard lock(impl_->mutex);
    std::optional<std::string_view> lane;
    if (filter.lane) lane = *filter.lane;
    Statement row(
        impl_->database,
        select(false) + "WHERE (?1 IS NULL OR lane = ?1) AND (NOT ?2 OR ended IS NULL) ORDER BY number DESC LIMIT ?3",
        lane, std::int64_t(filter.active_only), std::int64_t(filter.limit));
    std::vector<Job> jobs;
    while (row.step()) jobs.push_back(read(impl_->database, row));
    find_places(impl_->database, jobs);
    return jobs;
  });
}

Result<std::optional<Job>> SqliteStore::claim() {
  return impl_->transact([&]() -> std::optional<Job> {
    const auto found = ids(Statement(impl_->database, next_in_sql("number")));
    if (found.empty()) return std::nullopt;
    return apply_in(impl_->database, found.front(), {.event = Event::claim, .holder = impl_->holder}, impl_->now());
  });
}

Result<JobState> SqliteStore::renew(const std::string& id, std::int64_t claim) {
  return guarded([&] {
    const std::lock_guard lock(impl_->mutex);
    const Job job = find_in(impl_->database, id);
    if (auto holds = check_claim(job, claim); !holds) throw StoreFailure(holds.error());
    return job.state;
  });
}

Result<bool> SqliteStore::should_make_way(const std::string& id, std::chrono::milliseconds left) {
  return guarded([&] {
    const std::lock_guard lock(impl_->mutex);
    const Job running = find_in(impl_->database, id);
    if (running.state != JobState::running) return false;
    // Only the next one counts: a shorter one behind it would not get the worker.
    Statement row(impl_->database,
                  "SELECT 1 FROM (" + next_in_sql("state, expected, " + turn_in_sql("jobs") + " AS turn") +
                      ") WHERE (state = 'stop_requested' OR expected BETWEEN 1 AND ?1) AND turn < ?2",
                  std::int64_t(left.count() / 2), turn_of(running));
    return row.step();
  });
}

Result<Job> SqliteStore::apply(const std::string& id, const Change& change) {
  return impl_->transact([&] { return apply_in(impl_->database, id, change, impl_->now()); });
}

Result<void> SqliteStore::remove(const std::string& id) {
  return impl_->transact([&] {
    check_has_ended(find_in(impl_->database, id));
    Statement(impl_->database, "DELETE FROM jobs WHERE number = ?1", known_number(id)).run();
  });
}

Result<std::vector<std::string>> SqliteStore::expire(const Retention& retention) {
  return impl_->transact([&] {
    const Time now = impl_->now(), oldest = now - retention.max_age;
    Statement(impl_->database, "DELETE FROM worked WHERE day < ?1", day_of(now) - days_kept).run();
    return ids(
        Statement(impl_->database,
                  "DELETE FROM jobs WHERE ended IS NOT NULL AND (ended < ?1 OR number NOT IN (SELECT number FROM "
                  "jobs WHERE ended IS NOT NULL ORDER BY ended DESC, number DESC LIMIT ?2)) RETURNING number",
                  oldest, std::int64_t(retention.max_count)));
  });
}

}  // namespace engine::jobs
