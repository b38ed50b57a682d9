// The one folder outside the data folder that files may be opened in.
#pragma once

#include <filesystem>
#include <string>

#include "engine/core/file_descriptor.h"
#include "engine/core/result.h"

namespace server::scenes {

using engine::Result;

/// The file or folder that a user's path names, without links in it.
///   root    empty: nothing may be opened
///   path    relative to the root, or absolute and below it; no ".."
///   errors  invalid_argument: no root, or the path leads out of it, if only through a link; not_found. `where` is
///           "path".
[[nodiscard]] Result<std::filesystem::path> below_root(const std::filesystem::path& root, const std::string& path);

/// The file, open. Whoever may write below the root may put a link in a file's place after below_root() has looked:
/// what is opened here lies below the root when it is opened.
///   errors  those of below_root(); invalid_argument: it is no regular file; unavailable
[[nodiscard]] Result<engine::FileDescriptor> open_below_root(const std::filesystem::path& root,
                                                             const std::string& path);

/// Does a path, links followed, lie below the root?
[[nodiscard]] bool lies_below(const std::filesystem::path& root, const std::filesystem::path& path);

/// No link below the folder leads out of the root.
///   errors  invalid_argument: names the link; too_large: more than max_files entries
[[nodiscard]] Result<void> check_links(const std::filesystem::path& root, const std::filesystem::path& folder,
                                       std::size_t max_files);

}  // namespace server::scenes
