#include "server/http/http_server.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <mutex>
#include <utility>

#include "server/http/answerer.h"
#include "server/http/listener.h"
#include "server/http/lobby.h"
#include "server/http/log.h"
#include "server/http/places.h"
#include "server/http/workers.h"

namespace server::http {

struct HttpServer::Impl {
  Impl(const ServerOptions& server_options, Router router, AccessGuard& access_guard, Metrics& server_metrics,
       spdlog::logger& server_logger)
      : options(server_options),
        guard(access_guard),
        metrics(server_metrics),
        logger(server_logger),
        dispatcher(std::move(router), guard, logger, options.dispatcher,
                   [this](int change) { metrics.add_stream(change); }),
        places([this](int change) { metrics.add_connection(change); }),
        workers(
            options.workers,
            [this] {
              return make_answerer({options.requests_per_connection, options.lobby.connection.idle_timeout, dispatcher,
                                    workers, metrics, logger, options.audit});
            },
            [this](std::unique_ptr<Visit> visit) { hand_on(std::move(visit)); },
            [this](int change) { metrics.add_waiting(change); }) {}

  [[nodiscard]] LobbyHooks hooks();
  void bring_in(std::unique_ptr<Visit> visit);
  void hand_on(std::unique_ptr<Visit> visit);
  void offer(Workers::Kind kind, std::unique_ptr<Visit> visit);
  void stop();

  const ServerOptions options;
  AccessGuard& guard;
  Metrics& metrics;
  spdlog::logger& logger;
  engine::FileDescriptor stopping;  ///< Becomes readable.
  int port = 0;
  Dispatcher dispatcher;
  std::once_flag stopped;
  Places places;
  std::unique_ptr<Lobby> lobby;
  Workers workers;  ///< Last: its threads use all of the above.
};

LobbyHooks HttpServer::Impl::hooks() {
  return {[this](std::unique_ptr<Visit> visit) { bring_in(std::move(visit)); },
          [this](Visit& visit, const Refusal& refusal) {
            // Nothing was read of it: the connection itself is refused.
            if (visit.requests == 0 && !visit.connection.head_has_begun()) metrics.count_refused_connection();
            refuse(visit, refusal, metrics, logger);
          },
          [this] { metrics.count_cut_connection(); },
          [this](const std::string& what) { log(logger, spdlog::level::err, "a connection is lost: " + what); }};
}

/// A visit from the lobby: what it waited for there has come.
void HttpServer::Impl::bring_in(std::unique_ptr<Visit> visit) {
  if (visit->next != Next::read_head) return offer(Workers::Kind::going_on, std::move(visit));
  visit->client = guard.address_of(visit->connection.client(), visit->head.header("x-forwarded-for"));
  visit->request_id = request_id_of(visit->head);
  const bool is_vital = dispatcher.is_vital(visit->head);
  offer(is_vital ? Workers::Kind::vital : Workers::Kind::request, std::move(visit));
}

/// A visit from a worker.
void HttpServer::Impl::hand_on(std::unique_ptr<Visit> visit) {
  if (visit->next == Next::end) return;
  if (visit->next == Next::begin_upload) return offer(Workers::Kind::upload, std::move(visit));
  lobby->take(std::move(visit));
}

void HttpServer::Impl::offer(Workers::Kind kind, std::unique_ptr<Visit> visit) {
  if (workers.offer(kind, visit)) return;
  metrics.count_refused_connection();
  refuse_request(*visit, {503, "unavailable", "too many requests wait already; try again soon", ""}, metrics, logger);
  visit->end_request();
  visit->next = Next::say_goodbye;
  lobby->take(std::move(visit));
}

void HttpServer::Impl::stop() {
  const std::uint64_t one = 1;
  while (::write(stopping.get(), &one, sizeof one) < 0 && errno == EINTR) continue;
  if (!places.empty_within(options.grace)) {
    log(logger, spdlog::level::warn, "cutting connections that outlasted the grace period");
    do {
      workers.cut();
      lobby->cut();
    } while (!places.empty_within(std::chrono::seconds(1)));
  }
  workers.close();
  lobby->end();
}

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

HttpServer::~HttpServer() { stop(); }

engine::Result<std::unique_ptr<HttpServer>> HttpServer::start(const ServerOptions& options, Router router,
                                                              AccessGuard& guard, Metrics& metrics,
                                                              spdlog::logger& logger) {
  auto impl = std::make_unique<Impl>(options, std::move(router), guard, metrics, logger);
  const auto socket = listen_on(options.host, options.port);
  if (!socket) return engine::propagate(socket);
  engine::FileDescriptor listening(*socket);
  impl->stopping = engine::FileDescriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (impl->stopping.get() < 0)
    return engine::fail(engine::ErrorCode::unavailable, "this process may open no more files");
  impl->port = bound_port(*socket);
  guard.bound_to(options.host, impl->port);
  LobbyOptions lobby = options.lobby;
  // Behind a proxy all connections come from it; whom it speaks for shows in their requests.
  if (guard.trusts_proxy()) lobby.max_connections_per_client = 0;
  auto opened = Lobby::open(std::move(listening), impl->stopping.get(), lobby, impl->places, impl->hooks());
  if (!opened) return engine::propagate(opened);
  impl->lobby = std::move(*opened);
  impl->lobby->start();
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

int HttpServer::port() const { return impl_->port; }

std::string HttpServer::url() const {
  const std::string& host = impl_->options.host;
  const bool bare_ipv6 = host.find(':') != std::string::npos && !host.starts_with('[');
  return "http://" + (bare_ipv6 ? "[" + host + "]" : host) + ":" + std::to_string(impl_->port);
}

void HttpServer::stop() {
  std::call_once(impl_->stopped, [this] { impl_->stop(); });
}

}  // namespace server::http
