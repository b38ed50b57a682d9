// A look at the embedded store while another process holds it, as it does until it ends.
#pragma once

#include <filesystem>
#include <optional>

#include "engine/core/result.h"

namespace engine::jobs {

/// Copies the files of a store as they were at one moment: a store of its own, which SqliteStore::open() takes. Nothing
/// is locked, so whoever has the store open is not kept from writing meanwhile.
///   from, to  folders with "jobs.db" in them; `to` exists, and has none
///   errors    not_found: there is no store; busy: it was changed again and again while it was copied; those of
///             file_error()
/// In the process that has the store open it would end its lock (closing a file ends all locks of the process on it).
[[nodiscard]] Result<void> copy_sqlite_store(const std::filesystem::path& from, const std::filesystem::path& to);

/// Whether another process has the store of this folder open; nothing where that cannot be told.
[[nodiscard]] std::optional<bool> is_sqlite_store_in_use(const std::filesystem::path& folder);

}  // namespace engine::jobs
