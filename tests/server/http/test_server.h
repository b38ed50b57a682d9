// A server on a free port, with routes that show what it passes on.
#pragma once

#include <filesystem>
#include <memory>
#include <sstream>
#include <string>

#include "server/http/http_server.h"
#include "server/http/log.h"
#include "tests/server/http/raw_client.h"

namespace server::http {

/// A text that several threads may write to a stream of, and one read.
class LogText {
 public:
  explicit LogText(LogFormat format = LogFormat::json) : logger_(*make_logger(out_, "debug", format)) {}
  [[nodiscard]] spdlog::logger& logger() { return *logger_; }
  /// Only while no server logs.
  [[nodiscard]] std::string text() const { return out_.str(); }

 private:
  std::ostringstream out_;
  std::shared_ptr<spdlog::logger> logger_;
};

struct TestServer {
  explicit TestServer(Router routes, ServerOptions options = {}, AccessOptions access_options = {});

  [[nodiscard]] int port() const { return server->port(); }

  LogText log;
  AccessGuard guard;
  Metrics metrics;
  std::unique_ptr<HttpServer> server;
};

/// Options for tests that wait for a limit.
[[nodiscard]] ServerOptions impatient();

/// Routes: GET and POST /echo (what the handler sees), POST /json, POST /upload, GET /file, GET /events, GET /bug, ...
[[nodiscard]] Router sample_routes(const std::filesystem::path& folder);

}  // namespace server::http
