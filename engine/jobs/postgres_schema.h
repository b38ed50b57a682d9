// The tables of the shared store, and who may use them. Only this room includes this header.
#pragma once

#include <string>

#include "engine/jobs/postgres_connection.h"
#include "engine/jobs/postgres_store.h"

namespace engine::jobs {

/// A transaction; undone at the end of the scope unless committed.
class PostgresTransaction {
 public:
  explicit PostgresTransaction(PostgresConnection& connection) : connection_(connection) {
    connection_.execute("BEGIN");
  }
  ~PostgresTransaction();
  PostgresTransaction(const PostgresTransaction&) = delete;
  PostgresTransaction& operator=(const PostgresTransaction&) = delete;
  void commit();

 private:
  PostgresConnection& connection_;
  bool is_open_ = true;
};

/// Enters, and keeps out of the store whom `options.alone`, or another's, keeps out, for as long as the connection is
/// there. Errors, thrown, are those of PostgresStore::open().
void join(PostgresConnection& connection, const PostgresOptions& options);
/// Makes the tables, or brings them up to date, and leaves the owner's name. In a transaction, after join().
void bring_up_to_date(PostgresConnection& connection, const PostgresOptions& options);
/// Throws where the tables are a later version's or another owner's. After join().
void check_is_ours(PostgresConnection& connection, const PostgresOptions& options);
/// What PostgresStore::move_away() does. In a transaction, after join().
[[nodiscard]] std::string move_tables_away(PostgresConnection& connection, const PostgresOptions& options);

}  // namespace engine::jobs
