#include "engine/jobs/postgres_connection.h"

#include <libpq-fe.h>

#include <algorithm>
#include <array>
#include <utility>

namespace engine::jobs {
namespace {

constexpr int binary = 1;
constexpr std::size_t longest_text = 1'000'000'000;  // PostgreSQL takes a little more

/// Of a session: a client that stops in the middle of a transaction holds nobody up for long, a link that was cut is
/// noticed, and what was committed is on disk even where the server is set up otherwise.
constexpr const char* session = R"(
  SET client_min_messages = warning;
  SET idle_in_transaction_session_timeout = '15s';
  SET lock_timeout = '5s';
  SET statement_timeout = '60s';
  SET tcp_keepalives_idle = 10;
  SET tcp_keepalives_interval = 5;
  SET tcp_keepalives_count = 3;
  SET tcp_user_timeout = '25s';
  SELECT set_config('synchronous_commit', 'on', false) WHERE current_setting('synchronous_commit') = 'off';
)";

/// The same on this side. An address may say otherwise.
constexpr std::array<std::pair<const char*, const char*>, 6> link{{{"connect_timeout", "5"},
                                                                   {"keepalives_idle", "10"},
                                                                   {"keepalives_interval", "5"},
                                                                   {"keepalives_count", "3"},
                                                                   {"tcp_user_timeout", "25000"},
                                                                   {"application_name", "splatdrag"}}};

/// libpq's texts in one line, without the address: who is told of a failure need not know where the database is.
std::string in_one_line(std::string text) {
  if (text.starts_with("could not translate host name")) return "its host's name is not known";
  if (const auto failed = text.find(" failed: "); failed != std::string::npos) text.erase(0, failed + 9);
  for (const char* word : {"FATAL: ", "ERROR: "})
    if (text.starts_with(word)) text.erase(0, 7);
  text.erase(0, text.find_first_not_of(' '));
  if (const auto end = text.find('\n'); end != std::string::npos) text.resize(end);
  return text;
}

bool is_port_list(const std::string& text) { return text.find_first_not_of("0123456789,") == std::string::npos; }

}  // namespace

Result<PostgresAddress> parse_postgres_address(const std::string& text) {
  const auto none = [] {
    return fail(ErrorCode::invalid_argument,
                "the address of the job store cannot be read: expected postgresql://user@host:port/database, with what "
                "is neither letter nor digit of a user or a password as %40 or the like");
  };
  if (!text.starts_with("postgresql://") && !text.starts_with("postgres://")) return none();
  const std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)> options(PQconninfoParse(text.c_str(), nullptr),
                                                                             PQconninfoFree);
  if (!options) return none();
  PostgresAddress address;
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option)
    if (option->val != nullptr) address.settings[option->keyword] = option->val;
  const auto setting = [&](const char* name) {
    const auto found = address.settings.find(name);
    return found == address.settings.end() ? std::string() : found->second;
  };
  // A password with an "@" or a "/" in it has been cut, and its rest taken for something that is shown.
  for (const char* name : {"user", "host", "dbname"})
    if (setting(name).find('@') != std::string::npos) return none();
  if (!is_port_list(setting("port"))) return none();
  const std::string user = setting("user"), host = setting("host"), port = setting("port"), name = setting("dbname");
  address.shown =
      "postgresql://" + (user.empty() ? "" : user + "@") + host + (port.empty() ? "" : ":" + port) + "/" + name;
  return address;
}

PostgresValue::PostgresValue(std::int64_t number) {
  std::string bytes(sizeof number, '\0');
  auto rest = std::uint64_t(number);
  for (std::size_t i = bytes.size(); i-- > 0; rest >>= 8) bytes[i] = char(rest & 0xff);
  bytes_ = std::move(bytes);
}

std::optional<std::string_view> PostgresValue::bytes() const {
  if (bytes_) return std::string_view(*bytes_);
  return text_;
}

void PostgresRows::Clear::operator()(pg_result* result) const { PQclear(result); }

bool PostgresRows::is_fine() const {
  const ExecStatusType status = PQresultStatus(result_.get());
  return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK;
}

int PostgresRows::size() const { return PQntuples(result_.get()); }

bool PostgresRows::is_null(int row, int column) const { return PQgetisnull(result_.get(), row, column) != 0; }

std::int64_t PostgresRows::integer(int row, int column) const {
  std::uint64_t number = 0;
  for (const char byte : text(row, column)) number = number << 8 | std::uint8_t(byte);
  return std::int64_t(number);
}

bool PostgresRows::truth(int row, int column) const { return text(row, column) == std::string_view("\1"); }

std::string PostgresRows::text(int row, int column) const {
  return {PQgetvalue(result_.get(), row, column), std::size_t(PQgetlength(result_.get(), row, column))};
}

void PostgresConnection::Finish::operator()(pg_conn* connection) const { PQfinish(connection); }

bool PostgresConnection::is_open() const { return handle_ && PQstatus(handle_.get()) == CONNECTION_OK; }

void PostgresConnection::open() {
  if (is_open()) return;
  std::vector<const char*> names, values;
  const auto add = [&](const char* name, const char* value) {
    names.push_back(name);
    values.push_back(value);
  };
  for (const auto& [name, value] : link) add(name, value);
  for (const auto& [name, value] : address_.settings) add(name.c_str(), value.c_str());  // of two the later one counts
  add(nullptr, nullptr);
  prepared_.clear();
  handle_.reset(PQconnectdbParams(names.data(), values.data(), /*expand_dbname=*/0));
  if (!is_open()) {
    const std::string why = reason();
    handle_.reset();
    throw ConnectionLost({ErrorCode::unavailable, "the job store cannot be reached: " + why, {}});
  }
  PQsetNoticeProcessor(
      handle_.get(), [](void*, const char*) {}, nullptr);
  try {
    execute(session);
  } catch (...) {
    close();  // without its limits of time it would pass for open
    throw;
  }
}

std::string PostgresConnection::reason() const {
  std::string text = handle_ ? in_one_line(PQerrorMessage(handle_.get())) : "there is no memory for a connection";
  // No text of libpq or of the server has it today.
  const std::string_view instead = "(password)";
  if (const auto password = address_.settings.find("password");
      password != address_.settings.end() && !password->second.empty())
    for (std::size_t at = 0; (at = text.find(password->second, at)) != std::string::npos; at += instead.size())
      text.replace(at, password->second.size(), instead);  // which may hold the password itself: "pass", say
  return text;
}

void PostgresConnection::fail_with(const pg_result* result) {
  const char* const field = result == nullptr ? nullptr : PQresultErrorField(result, PG_DIAG_SQLSTATE);
  const std::string_view state = field == nullptr ? "" : field, kind = state.substr(0, 2);
  const std::string why = reason();
  // No state: it is libpq that speaks, not the server. 57P01 to 57P05: the server ends the session, or all of them.
  if (state.empty() || !is_open() || kind == "08" || state.starts_with("57P")) {
    close();
    throw ConnectionLost({ErrorCode::unavailable, "the connection to the job store was lost: " + why, {}});
  }
  if (state == "55P03") throw LockTimeout({ErrorCode::unavailable, "somebody else holds the job store", {}});
  if (state == "53100")
    throw StoreFailure(
        {ErrorCode::no_space, "the job store cannot grow, its disk is full: free some space and try again", {}});
  // Tables, columns or schemas that are not there, and pages that make no sense.
  if (state == "42P01" || state == "42703" || state == "3F000" || state == "XX001" || state == "XX002")
    throw StoreFailure({ErrorCode::corrupt_data, "the job store is damaged: " + why, {}});
  // Memory, rights, a standby, time: all of them somebody else's to mend.
  if (kind == "53" || kind == "57" || kind == "25" || state == "42501")
    throw StoreFailure({ErrorCode::unavailable, "the job store cannot be used: " + why, {}});
  throw StoreFailure({ErrorCode::internal, "job store: " + why, {}});
}

void PostgresConnection::execute(const std::string& sql) {
  const PostgresRows result(PQexec(handle_.get(), sql.c_str()));
  if (!result.is_fine()) fail_with(result.get());
}

void PostgresConnection::prepare(const std::string& sql) {
  const std::string name = "s" + std::to_string(prepared_.size());
  const PostgresRows result(PQprepare(handle_.get(), name.c_str(), sql.c_str(), 0, nullptr));
  if (!result.is_fine()) fail_with(result.get());
  prepared_.emplace(sql, name);
}

PostgresRows PostgresConnection::run_with(const std::string& sql, const std::vector<PostgresValue>& values) {
  if (!prepared_.contains(sql)) prepare(sql);
  std::vector<const char*> bytes;
  std::vector<int> lengths;
  const std::vector<int> formats(values.size(), binary);
  for (const PostgresValue& value : values) {
    const auto known = value.bytes();
    if (known && known->size() > longest_text)
      throw StoreFailure({ErrorCode::too_large, "the text is longer than the job store takes (1 GB)", {}});
    bytes.push_back(!known ? nullptr : known->empty() ? "" : known->data());
    lengths.push_back(known ? int(known->size()) : 0);
  }
  PostgresRows rows(PQexecPrepared(handle_.get(), prepared_.at(sql).c_str(), int(values.size()), bytes.data(),
                                   lengths.data(), formats.data(), binary));
  if (!rows.is_fine()) fail_with(rows.get());
  return rows;
}

int PostgresConnection::process() const { return PQbackendPID(handle_.get()); }

int PostgresConnection::socket() const { return PQsocket(handle_.get()); }

bool PostgresConnection::take_notifications(int except_process) {
  if (PQconsumeInput(handle_.get()) == 0) {
    const std::string why = reason();
    close();
    throw ConnectionLost({ErrorCode::unavailable, "the connection to the job store was lost: " + why, {}});
  }
  bool taken = false;
  while (const std::unique_ptr<PGnotify, decltype(&PQfreemem)> note{PQnotifies(handle_.get()), PQfreemem})
    taken = taken || note->be_pid != except_process;
  return taken;
}

}  // namespace engine::jobs
