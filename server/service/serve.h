// The service as a whole: the parts, wired up, from the start until a signal comes.
#pragma once

#include <spdlog/logger.h>

#include <filesystem>
#include <ostream>
#include <string>

#include "engine/core/result.h"
#include "server/edits/edit_service.h"
#include "server/http/access_guard.h"
#include "server/http/http_server.h"
#include "server/scenes/scene_store.h"
#include "server/service/end_signals.h"
#include "server/service/render_service.h"
#include "server/service/routes/all_routes.h"

namespace server::service {

/// What the service is started with. Folders, versions and loggers of the parts are set by serve().
struct ServeOptions {
  std::filesystem::path data_dir;    ///< Exists. Scenes and edits get a folder of their own in it.
  std::filesystem::path token_file;  ///< As read_tokens() takes it. Empty: no token is needed.
  std::filesystem::path audit_log;   ///< Where it is written (http::AuditLog). Empty: nowhere.
  bool insecure = false;             ///< Lets other machines in without a token.
  int drain_seconds = 30;            ///< Time that a running edit gets to finish its interval.
  int unready_seconds = 0;           ///< Time between a signal to end and the end of taking requests.
  std::filesystem::path model_dir;   ///< Of pre-trained networks (server/models/models.h). Empty: there are none.
  int lease_seconds = 30;            ///< Of edits whose records are in a database.
  int preview_seconds = 600;         ///< Life of a preview that nobody looks at.
  http::ServerOptions http;
  http::AccessOptions access;
  scenes::StoreOptions scenes;
  edits::ServiceOptions edits;
  routes::EditLimits edit_limits;
  RenderServiceOptions renders;
  /// Bytes that pictures, uploads and what is read of them may take at a time beside scenes and edits; 0: no limit.
  std::uint64_t work_memory_bytes = 0;
  int threads = 0;       ///< Threads of edits and renders; 0: one per core.
  int threads_here = 0;  ///< `threads` on this machine, as /v1/info says it.
  std::string simd;      ///< Instruction set in use, as /v1/info says it.
};

/// Reads the tokens into options.access. Writes warnings to the log.
///   errors  those of read_tokens(); invalid_argument: a host that others can reach, no token, and not `insecure`
[[nodiscard]] engine::Result<void> check_tokens(ServeOptions& options, spdlog::logger& logger);

/// Whether the process can be what it is to be.
///   errors  invalid_argument: a front or a worker without a database
[[nodiscard]] engine::Result<void> check_role(const ServeOptions& options);

/// Serves until a signal comes, then lets what runs come to its end.
///   out     gets the line that says where the service listens
///   errors  unavailable: another service has the data folder; those of the parts
[[nodiscard]] engine::Result<void> serve(ServeOptions options, EndSignals& signals, spdlog::logger& logger,
                                         std::ostream& out);

}  // namespace server::service
