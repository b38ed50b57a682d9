#include "server/edits/records.h"

#include <algorithm>
#include <array>
#include <system_error>
#include <utility>

#include "engine/core/atomic_file.h"
#include "engine/core/file_descriptor.h"
#include "engine/jobs/notes.h"
#include "engine/jobs/postgres_store.h"
#include "engine/jobs/sqlite_store.h"
#include "server/edits/records_database.h"
#include "server/edits/temporary_folder.h"

namespace server::edits {
namespace {

namespace fs = std::filesystem;
namespace jobs = engine::jobs;
using engine::ErrorCode;
using engine::propagate;

constexpr const char* store_name = "jobs.db";
constexpr std::array store_files{"jobs.db", "jobs.db-wal", "jobs.db-shm", "jobs.db-journal"};

/// The highest number of an edit that has made a version: with its number given away again, another edit would seem to
/// have its result already.
std::int64_t highest_edit(const scenes::SceneStore& scenes) {
  std::int64_t highest = 0;
  for (const scenes::SceneInfo& info : scenes.list())
    for (const scenes::VersionInfo& version : info.versions)
      highest = std::max(highest, jobs::number_of(version.edit).value_or(0));
  return highest;
}

/// What the records have to know, wherever they are.
struct Known {
  std::int64_t used_numbers = 0;
  bool must_exist = false;
  int max_deaths = 3;
  std::chrono::seconds lease = ServiceOptions().lease;
  Role role = Role::all;
};

///   store  as of ServiceOptions
Result<std::unique_ptr<jobs::Store>> open_store(const fs::path& folder, const std::string& store, const Known& known) {
  if (store.empty())
    return jobs::SqliteStore::open({.folder = folder,
                                    .used_numbers = known.used_numbers,
                                    .must_exist = known.must_exist,
                                    .max_deaths = known.max_deaths,
                                    .holder = this_process()});
  auto database = database_of(folder, store);
  if (!database) return propagate(database);
  database->alone = known.role == Role::all;
  database->lease = known.lease;
  database->used_numbers = known.used_numbers;
  database->must_exist = known.must_exist;
  database->max_deaths = known.max_deaths;
  database->holder = this_process();
  return jobs::PostgresStore::open(*database);
}

Result<OpenRecords> open_queue(Result<std::unique_ptr<jobs::Store>> opened, const jobs::QueueOptions& options) {
  if (!opened) return propagate(opened);
  auto queue = jobs::Queue::open(**opened, options);
  if (!queue) return propagate(queue);
  return OpenRecords{std::move(*opened), std::move(*queue)};
}

/// A name that nothing has: "jobs.db.damaged-1", "jobs.db.damaged-2", ...
fs::path free_name(const fs::path& file) {
  std::error_code ignored;
  for (int i = 1;; ++i)
    if (fs::path name = file.string() + ".damaged-" + std::to_string(i); !fs::exists(name, ignored)) return name;
}

/// What of check_records() needs no records.
void check_notes(const fs::path& folder, const jobs::Traces& traces, RecordsCheck& found) {
  for (const std::string& id : traces.notes)
    if (const auto note = jobs::read_note(jobs_folder(folder), id); !note)
      found.damaged.push_back({note.error().code, note.error().message, "edits/jobs/" + id});
}

/// What check_records() finds by opening a copy of the records and of the notes as a service would.
Result<void> check_copy(const fs::path& folder, const jobs::Traces& traces, RecordsCheck& found) {
  const auto copy = TemporaryFolder::make("splatdrag-check");
  if (!copy) return propagate(copy);
  const fs::path notes = jobs_folder(copy->path());
  std::error_code error;
  fs::create_directory(notes, error);
  for (const char* name : store_files)
    if (std::error_code absent; !error && fs::exists(folder / name, absent))
      fs::copy_file(folder / name, copy->path() / name, error);
  for (const std::string& id : traces.notes)
    if (!error) fs::copy_file(jobs_folder(folder) / (id + ".job"), notes / (id + ".job"), error);
  for (const std::string& id : traces.folders)
    if (!error) fs::create_directory(notes / id, error);
  if (error) return tl::make_unexpected(engine::file_error(error.value(), "write", copy->path()));
  const Known known{.must_exist = !traces.notes.empty(), .max_deaths = 0};
  const auto opened = open_queue(open_store(copy->path(), {}, known), {.folder = notes});
  if (!opened && opened.error().code != ErrorCode::corrupt_data && opened.error().code != ErrorCode::unsupported)
    return propagate(opened);
  if (!opened) {
    found.damaged.push_back({opened.error().code, opened.error().message, std::string("edits/") + store_name});
    return {};
  }
  for (const engine::Error& finding : opened->queue->findings())
    found.damaged.push_back({finding.code, finding.message, "edits/jobs/" + finding.where});
  return {};
}

}  // namespace

Result<OpenRecords> open_records(const scenes::SceneStore& scenes, const ServiceOptions& options) {
  const bool had_database = is_in_database(options.folder), in_file = options.store.empty();
  if (had_database && in_file)
    return engine::fail(ErrorCode::conflict,
                        "the records of this data folder's edits are in a database: give its address by --store, or "
                        "have them made again here from the notes beside the edits, by splatdrag admin rebuild",
                        options.folder / folder_id_name);
  const auto traces = jobs::find_traces(jobs_folder(options.folder));
  if (!traces) return propagate(traces);
  const std::int64_t highest = std::max(traces->highest_number, highest_edit(scenes));
  auto store = open_store(options.folder, options.store,
                          {.used_numbers = highest,
                           .must_exist = highest > 0,
                           .max_deaths = options.attempts,
                           .lease = options.lease,
                           .role = options.role});
  // Once the database knows this folder by its id, the folder has to keep it.
  if (std::error_code ignored; !store && !had_database && !in_file)
    fs::remove(options.folder / folder_id_name, ignored);
  auto opened = open_queue(std::move(store), {.folder = jobs_folder(options.folder),
                                              .max_queued = options.max_queued,
                                              .others_are_at_work = !scenes.is_alone(),
                                              .retention = options.retention});
  if (opened) return opened;
  if (opened.error().code == ErrorCode::corrupt_data)
    opened.error().message +=
        in_file ? "; put back a copy of it, or have it made again from the notes beside the edits, by splatdrag admin "
                  "rebuild"
                : "; check that it is the right one, or have them made in it again from the notes beside the edits, by "
                  "splatdrag admin rebuild --store";
  if (opened.error().code == ErrorCode::invalid_argument) opened.error().where = "--store";
  return opened;
}

Result<Rebuilt> rebuild_records(const scenes::SceneStore& scenes, const fs::path& folder, const std::string& store) {
  Rebuilt rebuilt;
  const bool had_database = is_in_database(folder);
  if (!store.empty()) {
    const auto database = database_of(folder, store);
    if (!database) return propagate(database);
    const auto schema = jobs::PostgresStore::move_away(*database);
    if (std::error_code ignored; !schema && !had_database) fs::remove(folder / folder_id_name, ignored);
    if (!schema) return propagate(schema);
    if (!schema->empty()) rebuilt.moved_away.push_back("the schema " + *schema);
  }
  std::vector<std::string> files(store_files.begin(), store_files.end());
  if (store.empty()) files.emplace_back(folder_id_name);
  for (const std::string& name : files) {
    std::error_code error;
    if (!fs::exists(folder / name, error)) continue;
    const fs::path aside = free_name(folder / name);
    fs::rename(folder / name, aside, error);
    if (error) return tl::make_unexpected(engine::file_error(error.value(), "move", folder / name));
    rebuilt.moved_away.push_back(aside.string());
  }
  const auto traces = jobs::find_traces(jobs_folder(folder));
  if (!traces) return propagate(traces);
  const Known known{.used_numbers = std::max(traces->highest_number, highest_edit(scenes))};
  const auto opened = open_queue(open_store(folder, store, known), {.folder = jobs_folder(folder)});
  if (!opened) return propagate(opened);
  rebuilt.findings = opened->queue->findings();
  return rebuilt;
}

Result<RecordsCheck> check_records(const fs::path& folder) {
  RecordsCheck found;
  const auto traces = jobs::find_traces(jobs_folder(folder));
  if (!traces) return propagate(traces);
  std::error_code error;
  for (const char* name : store_files) found.files += fs::exists(folder / name, error) ? 1 : 0;
  found.files += traces->notes.size();
  if (found.files == 0 && traces->folders.empty()) return found;
  if (traces->counter_is_damaged)
    found.damaged.push_back(
        {ErrorCode::corrupt_data, "the highest number of an edit cannot be read", "edits/jobs/last_number"});
  if (is_in_database(folder)) {
    found.in_database = true;
    check_notes(folder, *traces, found);
    return found;
  }
  if (auto checked = check_copy(folder, *traces, found); !checked) return propagate(checked);
  return found;
}

}  // namespace server::edits
