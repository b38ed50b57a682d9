#include "engine/jobs/postgres_schema.h"

#include <array>
#include <cstdint>
#include <exception>

namespace engine::jobs {
namespace {

/// From each version of the tables to the next; the first makes them. Texts of jobs may be any bytes, which TEXT may
/// not. Times are milliseconds since 1970.
constexpr std::array steps = {R"(
  CREATE TABLE splatdrag.store (
    only_row BOOLEAN PRIMARY KEY DEFAULT true CHECK (only_row),
    schema_number BIGINT NOT NULL DEFAULT 1,
    owner BYTEA NOT NULL DEFAULT '',
    owner_for_people BYTEA NOT NULL DEFAULT '',
    last_number BIGINT NOT NULL DEFAULT 0  -- of a job; whoever counts on from it holds the row until the job is there
  );
  INSERT INTO splatdrag.store DEFAULT VALUES;
  CREATE TABLE splatdrag.jobs (
    number BIGINT PRIMARY KEY,
    lane BYTEA NOT NULL,
    payload BYTEA NOT NULL,
    idempotency_key BYTEA UNIQUE,
    expected BIGINT NOT NULL,
    turn BIGINT NOT NULL,  -- as the program reckons it from the other columns, each time it writes the row
    state TEXT NOT NULL,
    claimed BOOLEAN NOT NULL DEFAULT false,
    claim_number BIGINT NOT NULL DEFAULT 0,
    lease_until BIGINT NOT NULL DEFAULT 0,  -- of the claim, if it is claimed
    stopped_early BOOLEAN NOT NULL DEFAULT false,
    finished_intervals BIGINT NOT NULL DEFAULT 0,
    progress BYTEA NOT NULL DEFAULT '',
    place BYTEA NOT NULL DEFAULT '',
    died_at BYTEA NOT NULL DEFAULT '',
    deaths BIGINT NOT NULL DEFAULT 0,
    result BYTEA NOT NULL DEFAULT '',
    error_code TEXT,
    error_message BYTEA,
    error_where BYTEA,
    created BIGINT NOT NULL,
    started BIGINT,
    ended BIGINT
  );
  CREATE INDEX active ON splatdrag.jobs (lane, number) WHERE ended IS NULL;
  CREATE INDEX next ON splatdrag.jobs ((state = 'running') DESC, turn, number) WHERE ended IS NULL AND NOT claimed;
  CREATE INDEX held ON splatdrag.jobs (lease_until) WHERE ended IS NULL AND claimed;
  CREATE INDEX ended ON splatdrag.jobs (ended DESC, number DESC) WHERE ended IS NOT NULL;
)",
                              R"(
  ALTER TABLE splatdrag.jobs
    ADD COLUMN requester BYTEA NOT NULL DEFAULT '',
    ADD COLUMN worked BIGINT NOT NULL DEFAULT 0,
    ADD COLUMN holder BYTEA NOT NULL DEFAULT '',
    ADD COLUMN claimed_at BIGINT;
  CREATE TABLE splatdrag.worked (
    requester BYTEA NOT NULL,
    day BIGINT NOT NULL,  -- since 1970, UTC
    milliseconds BIGINT NOT NULL,
    PRIMARY KEY (requester, day)
  );
)"};
constexpr auto schema_number = std::int64_t(steps.size());

// Locks of these numbers are agreed upon by all that use the store; databases have numbers of their own.
constexpr const char* of_users = "1936744548";   // of whoever has it open: shared, or alone
constexpr const char* of_makers = "1936744549";  // of whoever makes or changes the tables

bool is_there(PostgresConnection& connection, const std::string& test) {
  return connection.run("SELECT " + test + " IS NOT NULL").truth(0, 0);
}

bool has_tables(PostgresConnection& connection) { return is_there(connection, "to_regclass('splatdrag.store')"); }

void check_version(PostgresConnection& connection) {
  const auto found = connection.run("SELECT schema_number FROM splatdrag.store").integer(0, 0);
  if (found > schema_number)
    throw StoreFailure({ErrorCode::unsupported,
                        "the job store was written by a newer version (" + std::to_string(found) + ", known is " +
                            std::to_string(schema_number) + "): use that one, or choose another database",
                        {}});
}

void check_owner(PostgresConnection& connection, const PostgresOptions& options) {
  const auto row = connection.run("SELECT owner, owner_for_people FROM splatdrag.store");
  if (row.text(0, 0).empty() || row.text(0, 0) == options.owner) return;
  throw StoreFailure({ErrorCode::conflict,
                      "the job store belongs to somebody else (" + row.text(0, 1) +
                          "), whose jobs would be mixed up with these: choose another database",
                      {}});
}

}  // namespace

PostgresTransaction::~PostgresTransaction() {
  if (!is_open_ || !connection_.is_open()) return;
  try {
    connection_.execute("ROLLBACK");
  } catch (const std::exception&) {
    connection_.close();  // which undoes it, too
  }
}

void PostgresTransaction::commit() {
  is_open_ = false;
  connection_.execute("COMMIT");
}

void join(PostgresConnection& connection, const PostgresOptions& options) {
  connection.open();
  if (options.visits) return;
  const std::string usual = connection.run("SHOW lock_timeout").text(0, 0);
  connection.execute("SET lock_timeout = " + std::to_string(options.busy_timeout.count()));
  try {
    connection.execute(std::string("SELECT pg_advisory_lock") + (options.alone ? "(" : "_shared(") + of_users + ")");
  } catch (const LockTimeout&) {
    throw StoreFailure(
        {ErrorCode::unavailable, "another process has this job store open: end it, or choose another database", {}});
  }
  connection.execute("SET lock_timeout = '" + usual + "'");
}

void bring_up_to_date(PostgresConnection& connection, const PostgresOptions& options) {
  connection.execute(std::string("SELECT pg_advisory_xact_lock(") + of_makers + ")");
  if (!has_tables(connection)) {
    if (options.must_exist)
      throw StoreFailure({ErrorCode::corrupt_data, "the database has no jobs, but there have been some", {}});
    // Who may not make a schema may have been given one.
    if (!is_there(connection, "to_regnamespace('splatdrag')")) connection.execute("CREATE SCHEMA splatdrag");
    connection.execute(steps.front());
  }
  check_version(connection);
  for (auto made = connection.run("SELECT schema_number FROM splatdrag.store").integer(0, 0); made < schema_number;)
    connection.execute(steps[std::size_t(made++)]);
  connection.run("UPDATE splatdrag.store SET schema_number = $1", schema_number);
  check_owner(connection, options);
  connection.run(
      "UPDATE splatdrag.store SET owner = $1, owner_for_people = $2, last_number = greatest(last_number, $3)",
      options.owner, options.owner_for_people, options.used_numbers);
}

void check_is_ours(PostgresConnection& connection, const PostgresOptions& options) {
  if (options.visits) {
    if (!has_tables(connection))
      throw StoreFailure({ErrorCode::not_found, "the database has no jobs: no service has used it yet", {}});
    if (connection.run("SELECT schema_number FROM splatdrag.store").integer(0, 0) < schema_number)
      throw StoreFailure(
          {ErrorCode::unsupported, "the job store was written by an older version: start a service of this one", {}});
  }
  check_version(connection);
  check_owner(connection, options);
}

std::string move_tables_away(PostgresConnection& connection, const PostgresOptions& options) {
  if (!has_tables(connection)) return {};
  check_owner(connection, options);
  for (int i = 1;; ++i) {
    const std::string name = "splatdrag_damaged_" + std::to_string(i);
    if (is_there(connection, "to_regnamespace('" + name + "')")) continue;
    connection.execute("ALTER SCHEMA splatdrag RENAME TO " + name);
    return name;
  }
}

}  // namespace engine::jobs
