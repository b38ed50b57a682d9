// Who may use the service: the tokens in a file, and hosts that need none.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "server/http/token.h"

namespace server::service {

/// The tokens in a file. One that holds a single word holds the one token of the service, which may do everything
/// (http::only_token()). Any other has a line for each token, of words with white space between them:
///
///     # name      scopes      secret       quotas
///     viewer      read        3f9a0c51...
///     pipeline    edit        77ab12e0...  edits=4 bytes=2GB seconds=3600
///     prometheus  admin       c0ffee42...
///
/// Scopes are those of http::Scope, with commas between several. Quotas are those of http::Quotas; each is a whole
/// number above 0, that of bytes with a unit if it has one (kB, MB, GB, TB, or KiB, MiB, GiB, TiB). Empty lines count
/// for nothing, nor does what follows a word that begins with '#', so that no secret does.
///   warning  set if other users of the machine may read the file
///   errors   not_found, unavailable; invalid_argument: there is no token, or a line is none, or it has the name or the
///            secret of another (`where` is "FILE:LINE"). No message says what stands in the file: words change places
[[nodiscard]] engine::Result<std::vector<http::Token>> read_tokens(const std::filesystem::path& file,
                                                                   std::string& warning);

/// Whether only programs on this machine can reach a server bound to this host.
[[nodiscard]] bool is_loopback(const std::string& host);

}  // namespace server::service
