// One connection to a PostgreSQL server, by libpq. Only this room includes this header.
#pragma once

#include <concepts>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/jobs/job.h"
#include "engine/jobs/store_rules.h"

struct pg_conn;
struct pg_result;

namespace engine::jobs {

/// Where a database is and how it is entered.
struct PostgresAddress {
  std::map<std::string, std::string> settings;  ///< As libpq names them. What is absent libpq finds out itself.
  std::string shown;  ///< For people: "postgresql://user@host:5432/database", without the password.
};
/// Takes "postgresql://user:password@host:port/database?setting=value" apart.
///   errors  invalid_argument: it is none. The message has nothing of the text, for a part of that is the password
[[nodiscard]] Result<PostgresAddress> parse_postgres_address(const std::string& text);

/// The connection has ended, or there was none. What the transaction in work had changed is gone, unless it was just
/// being committed: nobody knows that then.
struct ConnectionLost : StoreFailure {
  using StoreFailure::StoreFailure;
};
/// Another session held for too long what was waited for.
struct LockTimeout : StoreFailure {
  using StoreFailure::StoreFailure;
};

/// A value of a statement, in the server's binary format. Texts must outlive it.
class PostgresValue {
 public:
  PostgresValue(std::nullopt_t) {}
  PostgresValue(std::int64_t number);
  PostgresValue(bool truth) : bytes_(std::string(1, truth ? '\1' : '\0')) {}
  PostgresValue(const char*) = delete;  // it would become a bool
  PostgresValue(std::string_view text) : text_(text) {}
  PostgresValue(const std::string& text) : text_(text) {}
  PostgresValue(Time time) : PostgresValue(std::int64_t(time.time_since_epoch().count())) {}
  template <class T>
  PostgresValue(const std::optional<T>& value) : PostgresValue(value ? PostgresValue(*value) : std::nullopt) {}

  /// Nothing: NULL.
  [[nodiscard]] std::optional<std::string_view> bytes() const;

 private:
  std::optional<std::string> bytes_;
  std::optional<std::string_view> text_;
};

/// What a statement gives.
class PostgresRows {
 public:
  /// result  of libpq, owned from now on; may be null
  explicit PostgresRows(pg_result* result) : result_(result) {}
  [[nodiscard]] pg_result* get() const { return result_.get(); }
  [[nodiscard]] bool is_fine() const;  ///< Whether there is a result, and it tells of no error.
  [[nodiscard]] int size() const;
  [[nodiscard]] bool is_null(int row, int column) const;
  [[nodiscard]] std::int64_t integer(int row, int column) const;  ///< Of a BIGINT.
  [[nodiscard]] bool truth(int row, int column) const;
  [[nodiscard]] std::string text(int row, int column) const;  ///< Of TEXT or BYTEA.

 private:
  struct Clear {
    void operator()(pg_result* result) const;
  };
  std::unique_ptr<pg_result, Clear> result_;
};

/// For one thread at a time. What fails throws StoreFailure; its message is fit for strangers, and has neither a
/// password nor an address.
class PostgresConnection {
 public:
  explicit PostgresConnection(PostgresAddress address) : address_(std::move(address)) {}

  /// Enters, unless it is there. A dead link is noticed within half a minute, by either side.
  void open();
  void close() { handle_.reset(); }
  [[nodiscard]] bool is_open() const;
  /// Carries a statement out, prepared once for each text. Its values are $1, $2, ...
  template <std::convertible_to<PostgresValue>... Values>
  PostgresRows run(const std::string& sql, const Values&... values) {
    return run_with(sql, {PostgresValue(values)...});
  }
  /// Statements without values, one after the other.
  void execute(const std::string& sql);

  /// Number of the server's process behind this connection.
  [[nodiscard]] int process() const;
  [[nodiscard]] int socket() const;
  /// Reads what has come, without waiting. Whether a notification has, other than from this process of the server.
  bool take_notifications(int except_process);

  [[nodiscard]] const PostgresAddress& address() const { return address_; }

 private:
  struct Finish {
    void operator()(pg_conn* connection) const;
  };
  PostgresRows run_with(const std::string& sql, const std::vector<PostgresValue>& values);
  void prepare(const std::string& sql);
  /// Throws what a failed result tells.
  [[noreturn]] void fail_with(const pg_result* result);
  [[nodiscard]] std::string reason() const;

  PostgresAddress address_;
  std::unique_ptr<pg_conn, Finish> handle_;
  std::map<std::string, std::string> prepared_;  ///< Names of statements, by their text.
};

}  // namespace engine::jobs
