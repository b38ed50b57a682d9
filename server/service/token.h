// Who may use the service: the token in a file, and hosts that need none.
#pragma once

#include <filesystem>
#include <string>

#include "engine/core/result.h"

namespace server::service {

/// The token in a file: its text without the white space around it.
///   warning  set if other users of the machine may read the file
///   errors   not_found, unavailable; invalid_argument: the file is empty, or what it holds is no token
[[nodiscard]] engine::Result<std::string> read_token(const std::filesystem::path& file, std::string& warning);

/// Whether only programs on this machine can reach a server bound to this host.
[[nodiscard]] bool is_loopback(const std::string& host);

}  // namespace server::service
