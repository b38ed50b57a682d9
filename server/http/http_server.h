// The HTTP server: listens, guards, answers. One thread per connection, of a bounded set; every wait has an end.
#pragma once

#include <spdlog/logger.h>

#include <chrono>
#include <cstddef>
#include <memory>
#include <string>

#include "engine/core/result.h"
#include "server/http/access_guard.h"
#include "server/http/connection.h"
#include "server/http/dispatcher.h"
#include "server/http/metrics.h"
#include "server/http/router.h"

namespace server::http {

/// Where the server listens and how much it serves at a time.
struct ServerOptions {
  std::string host = "127.0.0.1";
  int port = 8080;                         ///< TCP port; 0: any that is free.
  std::size_t threads = 64;                ///< Connections served at a time.
  std::size_t max_waiting = 128;           ///< Connections that may wait for a thread; more are turned away with 503.
  int max_requests = 1000;                 ///< Requests on one connection; then it ends.
  std::chrono::milliseconds grace{5'000};  ///< Time that answers under way get when the server stops.
  ConnectionLimits connection = {};
  DispatcherOptions dispatcher = {};
};

class HttpServer {
 public:
  /// Binds, listens and serves, from now on.
  ///   guard, metrics, logger  outlive the server; `guard` is told what the server is bound to
  ///   errors  invalid_argument: no such host; unavailable: the port is taken (by any other program, this one included)
  ///           or not permitted (`where` is "--host" or "--port")
  [[nodiscard]] static engine::Result<std::unique_ptr<HttpServer>> start(const ServerOptions& options, Router router,
                                                                         AccessGuard& guard, Metrics& metrics,
                                                                         spdlog::logger& logger);
  ~HttpServer();

  [[nodiscard]] int port() const;
  /// "http://127.0.0.1:8080"
  [[nodiscard]] std::string url() const;
  /// Takes no more connections, ends streams, lets answers under way finish for `grace`, then cuts connections and
  /// waits for their handlers. Idempotent.
  void stop();

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace server::http
