// The socket a server listens on.
#pragma once

#include <string>

#include "engine/core/result.h"

namespace server::http {

/// A listening socket, non-blocking. Its port is free at once after a restart, but never shared with a running program.
///   port     0: any that is free
///   returns  the descriptor, which the caller closes
///   errors   as HttpServer::start()
[[nodiscard]] engine::Result<int> listen_on(const std::string& host, int port);

/// The port a socket is bound to.
[[nodiscard]] int bound_port(int socket);

}  // namespace server::http
