#include "tests/support/postgres_server.h"

#include <fcntl.h>
#include <libpq-fe.h>
#include <pwd.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>

namespace support {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

const fs::path programs = SPLATDRAG_POSTGRES_PROGRAMS;  // empty: there are none
constexpr auto starts_within = 2min;

[[noreturn]] void give_up(const fs::path& log, const std::string& what) {
  throw std::runtime_error(what + ": " + (fs::exists(log) ? read_file(log) : ""));
}

}  // namespace

bool PostgresServer::is_installed() { return !programs.empty(); }

PostgresServer& PostgresServer::shared() {
  static PostgresServer server;
  return server;
}

PostgresServer::PostgresServer() : PostgresServer(Options()) {}

PostgresServer::PostgresServer(const Options& options) : options_(options) {
  fs::permissions(dir_.path(), fs::perms::all);  // of a folder that nobody knows of
  const pid_t made = launch({"initdb", "-D", data_, "--no-sync", "--no-instructions", "-U", "tests", "-E", "UTF8",
                             "--locale=C", "--wal-segsize=1", "-A", "trust"});
  int status = 0;
  if (::waitpid(made, &status, 0) != made || status != 0) give_up(dir_.path() / "log", "initdb failed");
  write_file(data_ / "pg_hba.conf", options_.rules);
  start();
}

PostgresServer::~PostgresServer() {
  if (process_ > 0) stop(ServerStop::crash);
}

pid_t PostgresServer::launch(const std::vector<std::string>& command) const {
  const std::string program = programs / command.front(), log = dir_.path() / "log";
  const passwd* const other = ::geteuid() == 0 ? ::getpwnam("postgres") : nullptr;
  std::vector<std::string> texts = command;
  std::vector<char*> arguments;
  for (std::string& text : texts) arguments.push_back(text.data());
  arguments.push_back(nullptr);
  const pid_t process = ::fork();
  if (process != 0) return process;
  if (other != nullptr && (::setgid(other->pw_gid) != 0 || ::setuid(other->pw_uid) != 0)) ::_exit(126);
  ::prctl(PR_SET_PDEATHSIG, SIGQUIT);  // it does not outlive a test that crashes
  const int file = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  ::dup2(file, STDOUT_FILENO);
  ::dup2(file, STDERR_FILENO);
  ::execv(program.c_str(), arguments.data());
  ::_exit(127);
}

void PostgresServer::start() {
  const std::string sync = options_.waits_for_disk ? "on" : "off";
  process_ = launch({"postgres", "-D", data_, "-k", dir_.path(), "-c", "listen_addresses=", "-c", "fsync=" + sync, "-c",
                     "shared_buffers=32MB", "-c", "max_connections=100"});
  const auto deadline = std::chrono::steady_clock::now() + starts_within;
  for (const std::string where = address("postgres"); PQping(where.c_str()) != PQPING_OK;) {
    if (std::chrono::steady_clock::now() > deadline || ::waitpid(process_, nullptr, WNOHANG) == process_)
      give_up(dir_.path() / "log", "the server does not start");
    std::this_thread::sleep_for(10ms);
  }
}

void PostgresServer::stop(ServerStop how) {
  ::kill(process_, how == ServerStop::crash ? SIGQUIT : SIGINT);
  ::waitpid(process_, nullptr, 0);
  process_ = 0;
}

std::string PostgresServer::new_database() {
  const std::string name = "test_" + std::to_string(++databases_);
  run("postgres", "CREATE DATABASE " + name);
  return name;
}

std::string PostgresServer::address(const std::string& database, const std::string& user) const {
  return "postgresql://" + user + "@/" + database + "?host=" + dir_.path().string();
}

std::string PostgresServer::run(const std::string& database, const std::string& sql) const {
  const std::unique_ptr<PGconn, decltype(&PQfinish)> connection(PQconnectdb(address(database).c_str()), PQfinish);
  PQsetNoticeProcessor(
      connection.get(), [](void*, const char*) {}, nullptr);
  const std::unique_ptr<PGresult, decltype(&PQclear)> result(PQexec(connection.get(), sql.c_str()), PQclear);
  const auto status = PQresultStatus(result.get());
  if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK)
    throw std::runtime_error(sql + ": " + PQerrorMessage(connection.get()));
  return PQntuples(result.get()) > 0 ? PQgetvalue(result.get(), 0, 0) : "";
}

}  // namespace support
