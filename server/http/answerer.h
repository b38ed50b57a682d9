// Answers the requests of visits: what a worker does.
#pragma once

#include <spdlog/logger.h>

#include <chrono>

#include "server/http/audit_log.h"
#include "server/http/dispatcher.h"
#include "server/http/metrics.h"
#include "server/http/visit.h"
#include "server/http/workers.h"

namespace server::http {

/// What answering takes. All of it outlives the answerers.
struct AnswererParts {
  int max_requests;                        ///< On one connection; then it ends.
  std::chrono::milliseconds idle_timeout;  ///< Between two of them; told to clients, which then send none that is lost.
  Dispatcher& dispatcher;
  Workers& workers;
  Metrics& metrics;
  spdlog::logger& logger;
  AuditLog* audit = nullptr;  ///< Null: there is none.
};

/// What one worker serves visits with. Whatever happens to a visit, its `next` says how it goes on.
[[nodiscard]] Workers::Serve make_answerer(const AnswererParts& parts);

/// Posts the answer to a request whose head could not be read, or to a connection that there is no room for, and
/// reports it.
void refuse(Visit& visit, const Refusal& refusal, Metrics& metrics, spdlog::logger& logger);
/// The same to a request whose head has been read: the visit says by which id and method it goes.
void refuse_request(Visit& visit, const Refusal& refusal, Metrics& metrics, spdlog::logger& logger);

}  // namespace server::http
