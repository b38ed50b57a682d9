// Names of files and scenes: strangers give them; here they are made fit for folders and messages.
#pragma once

#include <cstdint>
#include <string>

#include "engine/core/result.h"

namespace server::scenes {

using engine::Result;

/// The base name of a file as a stranger calls it, fit for a folder and for messages; "upload" where nothing is left.
[[nodiscard]] std::string safe_file_name(const std::string& filename);

/// A scene's name.
///   errors  invalid_argument: empty, longer than 200 bytes, or with control characters (`where` is "name")
[[nodiscard]] Result<std::string> checked_name(const std::string& name);

/// The name that the user gave, else that of the file without its extension. Errors as checked_name().
[[nodiscard]] Result<std::string> name_for(const std::string& given_name, const std::string& file_name);

/// 16 random hexadecimal digits: tells things of one name apart that belong to different folders or processes.
[[nodiscard]] std::string random_nonce();
[[nodiscard]] std::uint64_t random_number();

}  // namespace server::scenes
