// The digests of all files below a folder, in a file beside it.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "engine/core/result.h"

namespace server::scenes {

using engine::Result;

/// Digests by path, relative to the folder.
using DigestList = std::map<std::string, std::string>;

/// Those of all regular files below the folder; follows no link.
///   errors  those of InputFile and file_error()
[[nodiscard]] Result<DigestList> digests_below(const std::filesystem::path& folder);

/// A line "XXH3 (path) = digest" for each, which `xxhsum --check` takes, too. A path holds no line break.
[[nodiscard]] std::string to_text(const DigestList& list);

/// What to_text() wrote into a file.
///   digest  of the file
///   where   what to call it in errors
///   errors  those of check_digest(); corrupt_data: it is no such list
[[nodiscard]] Result<DigestList> read_digest_list(const std::filesystem::path& file, const std::string& digest,
                                                  const std::string& where);

}  // namespace server::scenes
