// How a data folder is known to the database that keeps its records.
#pragma once

#include <filesystem>
#include <string>

#include "engine/jobs/postgres_store.h"

namespace server::edits {

inline constexpr const char* folder_id_name = "folder_id";  ///< The file, in <data-dir>/edits.

/// Whether the records of this folder's edits are in a database.
///   folder  <data-dir>/edits
[[nodiscard]] bool is_in_database(const std::filesystem::path& folder);

/// How this process is called in claims: "HOST:NUMBER".
[[nodiscard]] std::string this_process();

/// How to open the database of this folder. Gives the folder its id, if it has none.
///   errors  corrupt_data: the id is damaged; no_space, unavailable
[[nodiscard]] engine::Result<engine::jobs::PostgresOptions> database_of(const std::filesystem::path& folder,
                                                                        const std::string& address);

}  // namespace server::edits
