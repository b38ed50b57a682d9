// What the tests of the shared store have in common.
#pragma once

#include <string>

#include "engine/jobs/postgres_store.h"
#include "tests/support/postgres_server.h"

namespace engine::jobs {

/// A new database on a server of the tests'.
class TestDatabase {
 public:
  explicit TestDatabase(support::PostgresServer& server = support::PostgresServer::shared())
      : server_(server), name_(server.new_database()) {}

  [[nodiscard]] PostgresOptions options() const {
    return {.address = server_.address(name_), .busy_timeout = std::chrono::milliseconds(5000)};
  }
  /// The time of stores, in SQL, that set_time() sets from now on.
  std::string own_clock() {
    run("CREATE TABLE IF NOT EXISTS test_clock (now bigint)");
    run("CREATE OR REPLACE FUNCTION test_now() RETURNS bigint STABLE LANGUAGE sql AS 'SELECT now FROM "
        "public.test_clock'");
    return "public.test_now()";
  }
  void set_time(Time now) {
    run("DELETE FROM test_clock; INSERT INTO test_clock VALUES (" + std::to_string(now.time_since_epoch().count()) +
        ")");
  }
  std::string run(const std::string& sql) const { return server_.run(name_, sql); }
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  support::PostgresServer& server_;
  std::string name_;
};

}  // namespace engine::jobs
