// The HTTP server: listens, guards, answers. Connections wait without a thread; requests are answered by a bounded set
// of them. Every wait has an end.
#pragma once

#include <spdlog/logger.h>

#include <chrono>
#include <memory>
#include <string>

#include "engine/core/result.h"
#include "server/http/access_guard.h"
#include "server/http/audit_log.h"
#include "server/http/dispatcher.h"
#include "server/http/lobby.h"
#include "server/http/metrics.h"
#include "server/http/router.h"
#include "server/http/workers.h"

namespace server::http {

/// Where the server listens and how much it serves at a time.
struct ServerOptions {
  std::string host = "127.0.0.1";
  int port = 8080;                         ///< TCP port; 0: any that is free.
  int requests_per_connection = 1000;      ///< Then it ends.
  std::chrono::milliseconds grace{5'000};  ///< Time that answers under way get when the server stops.
  LobbyOptions lobby = {};
  WorkerLimits workers = {};
  DispatcherOptions dispatcher = {};
  AuditLog* audit = nullptr;  ///< Outlives the server. Null: there is none.
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
  /// Takes no more connections, ends streams, lets answers under way finish for `grace`, those of requests that wait
  /// included, then cuts connections and waits for their handlers. Idempotent.
  void stop();

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace server::http
