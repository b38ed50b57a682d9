// A PostgreSQL server of a test program's own: on a socket in a temporary folder, reached by nobody else.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/data.h"

namespace support {

/// How a server comes to its end.
enum class ServerStop {
  fast,   ///< Ends its sessions and closes its files.
  crash,  ///< At once; the next start finds out what was committed.
};

/// Runs as the user that PostgreSQL's package makes where this is root, as whom it does not run. What it commits
/// survives its own crash, but no power cut: it waits for no disk unless told to.
class PostgresServer {
 public:
  struct Options {
    std::string rules = "local all all trust\n";  ///< pg_hba.conf
    bool waits_for_disk = false;
  };
  /// Whether this machine has the programs.
  static bool is_installed();
  /// The one that the tests of this program share; ends with it.
  static PostgresServer& shared();

  PostgresServer();
  explicit PostgresServer(const Options& options);
  ~PostgresServer();
  PostgresServer(const PostgresServer&) = delete;
  PostgresServer& operator=(const PostgresServer&) = delete;

  void start();
  void stop(ServerStop how);
  [[nodiscard]] std::string new_database();
  ///   user  with a password, if one is wanted: "somebody:secret"
  [[nodiscard]] std::string address(const std::string& database, const std::string& user = "tests") const;
  /// Carries statements out; the first column of the first row of the last one, if there is one.
  std::string run(const std::string& database, const std::string& sql) const;

 private:
  [[nodiscard]] pid_t launch(const std::vector<std::string>& command) const;

  TempDir dir_;
  std::filesystem::path data_ = dir_.path() / "data";
  Options options_;
  pid_t process_ = 0;
  int databases_ = 0;
};

}  // namespace support

/// Skips the test where there is no server to be had. In CI (CI is set) that is a failure.
#define REQUIRE_POSTGRES()                                                               \
  do {                                                                                   \
    if (!support::PostgresServer::is_installed()) {                                      \
      if (std::getenv("CI") != nullptr) FAIL() << "PostgreSQL's server is absent in CI"; \
      GTEST_SKIP() << "PostgreSQL's server is not on this machine (postgresql-15)";      \
    }                                                                                    \
  } while (false)
