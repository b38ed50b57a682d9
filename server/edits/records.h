// The records of edits on disk: opened, made again from the notes beside the edits, or only looked at.
//
//     <data-dir>/edits/jobs.db       the records, or
//                      folder_id     by which a database knows whose records it has
//                      jobs/         a note and a folder for each edit (engine/jobs/notes.h)
//
// What edits read and make lies in the data folder, too: a service may carry out only those of its own folder. So a
// database belongs to one folder, and a folder keeps its records in one place. One service has them open alone, or the
// fronts and workers of one do together (Role).
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "engine/jobs/queue.h"
#include "server/edits/edit_service.h"
#include "server/scenes/scene_store.h"

namespace server::edits {

[[nodiscard]] inline std::filesystem::path jobs_folder(const std::filesystem::path& edits) { return edits / "jobs"; }

/// Jobs in a list that is to have them all: more than are ever kept.
constexpr std::size_t all_jobs = 1'000'000;

struct OpenRecords {
  std::unique_ptr<engine::jobs::Store> records;
  std::unique_ptr<engine::jobs::Queue> queue;  ///< Of `records`.
};
/// Where others are at work already (SceneStore::is_alone()), notes and records are not held against each other. Ids go
/// on above all that a record, a note, a folder or a version of a scene tells of.
///   errors  corrupt_data: the records are damaged, or absent although there have been edits; the message says how to
///           go on. conflict: the database is another folder's, or this folder's records are in one and it is not
///           given. Those of jobs::Store, PostgresStore::open() and Queue::open().
[[nodiscard]] Result<OpenRecords> open_records(const scenes::SceneStore& scenes, const ServiceOptions& options);

struct Rebuilt {
  std::vector<std::string> moved_away;  ///< Where what was there is now: files, or a schema of the database.
  std::vector<engine::Error> findings;  ///< What Queue::open() put back, and what it could not.
};
/// Moves the records away and makes them again from the notes. For an edit whose note is lost there will be no record;
/// its folder stays. Where they were kept elsewhere before, that place has them no more.
///   folder  <data-dir>/edits
///   store   as of ServiceOptions
///   errors  unavailable, no_space; conflict: the database is another folder's; those of PostgresStore::open()
[[nodiscard]] Result<Rebuilt> rebuild_records(const scenes::SceneStore& scenes, const std::filesystem::path& folder,
                                              const std::string& store = {});

struct RecordsCheck {
  std::vector<engine::Error> damaged;  ///< `where` is the file's path inside the data folder.
  std::size_t files = 0;               ///< Looked at.
  bool in_database = false;            ///< The records are elsewhere, and were not looked at.
};
/// Holds records and notes against their checksums and each other, on a copy: nothing is changed. Nobody else may have
/// the folder open. Of records in a database only the notes are looked at.
///   folder  <data-dir>/edits; need not exist
///   errors  unavailable, no_space
[[nodiscard]] Result<RecordsCheck> check_records(const std::filesystem::path& folder);

}  // namespace server::edits
