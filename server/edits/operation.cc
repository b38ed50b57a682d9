#include "server/edits/operation.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include "engine/jobs/postgres_store.h"
#include "engine/jobs/queue.h"
#include "engine/jobs/sqlite_snapshot.h"
#include "engine/jobs/sqlite_store.h"
#include "server/edits/records.h"
#include "server/edits/records_database.h"
#include "server/edits/scene_hold.h"
#include "server/edits/temporary_folder.h"

namespace server::edits {
namespace {

namespace fs = std::filesystem;
namespace jobs = engine::jobs;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;

double seconds_of(std::chrono::milliseconds time) { return std::chrono::duration<double>(time).count(); }

EditAtHand at_hand(const jobs::Job& job, jobs::Time now) {
  EditAtHand edit{.id = job.id, .scene = job.lane, .state = std::string(to_string(job.state)), .token = job.requester};
  edit.place = job.queue_position;
  edit.age = seconds_of(now - job.created);
  if (job.expected.count() > 0) edit.expected = seconds_of(job.expected);
  edit.worked = seconds_of(job.worked);
  edit.finished_intervals = job.finished_intervals;
  edit.deaths = job.deaths;
  edit.died_at = job.died_at;
  if (job.claimed) {
    edit.claim = EditAtHand::Claim{.worker = job.holder, .number = job.claim_number};
    if (job.claimed_at) edit.claim->since = seconds_of(now - *job.claimed_at);
    if (job.lease_until) edit.claim->lease_left = seconds_of(*job.lease_until - now);
  }
  if (job.error) edit.error = job.error->message;
  return edit;
}

/// Whether the records are where whoever asks takes them to be.
Result<void> check_place(const fs::path& folder, const std::string& store) {
  if (store.empty() && is_in_database(folder))
    return fail(ErrorCode::conflict,
                "the records of this data folder's edits are in a database: give its address by --store",
                folder.string());
  if (!store.empty() && !is_in_database(folder))
    return fail(ErrorCode::not_found, "no service has kept the records of this data folder in a database",
                folder.string());
  std::error_code ignored;
  if (store.empty() && !fs::exists(folder / "jobs.db", ignored))
    return fail(ErrorCode::not_found, "the data folder has no records of edits: no service has used it yet",
                folder.string());
  return {};
}

Result<std::unique_ptr<jobs::Store>> visit_database(const fs::path& folder, const std::string& store) {
  auto database = database_of(folder, store);
  if (!database) return propagate(database);
  database->visits = true;
  auto opened = jobs::PostgresStore::open(*database);
  if (!opened) return propagate(opened);
  return std::move(*opened);
}

Result<std::unique_ptr<jobs::Store>> visit_file(const fs::path& folder) {
  auto opened = jobs::SqliteStore::open({.folder = folder, .must_exist = true, .visits = true});
  if (!opened) return propagate(opened);
  return std::move(*opened);
}

Result<std::vector<EditAtHand>> listed(jobs::Store& store, bool with_failed) {
  const auto now = store.now();
  if (!now) return propagate(now);
  auto found = store.list({.active_only = !with_failed, .limit = all_jobs});
  if (!found) return propagate(found);
  std::erase_if(*found,
                [](const jobs::Job& job) { return is_final(job.state) && job.state != jobs::JobState::failed; });
  // Those in work, those that wait, those that have failed.
  const auto rank = [](const jobs::Job& job) {
    return job.state == jobs::JobState::failed ? 2 : job.queue_position > 0 ? 1 : 0;
  };
  std::ranges::stable_sort(*found, {}, [&](const jobs::Job& job) { return std::pair(rank(job), job.queue_position); });
  std::vector<EditAtHand> edits;
  for (const jobs::Job& job : *found) edits.push_back(at_hand(job, *now));
  return edits;
}

}  // namespace

Result<QueueLook> look_at_queue(const fs::path& folder, const std::string& store, bool with_failed) {
  if (auto there = check_place(folder, store); !there) return propagate(there);
  if (!store.empty()) {
    const auto visited = visit_database(folder, store);
    if (!visited) return propagate(visited);
    auto edits = listed(**visited, with_failed);
    if (!edits) return propagate(edits);
    return QueueLook{std::move(*edits), std::nullopt};
  }
  const auto copy = TemporaryFolder::make("splatdrag-look");
  if (!copy) return propagate(copy);
  const std::optional<bool> in_use = jobs::is_sqlite_store_in_use(folder);
  if (auto copied = jobs::copy_sqlite_store(folder, copy->path()); !copied) return propagate(copied);
  const auto visited = visit_file(copy->path());
  if (!visited && visited.error().code == ErrorCode::corrupt_data)
    return fail(ErrorCode::corrupt_data, visited.error().message, (folder / "jobs.db").string());
  if (!visited) return propagate(visited);
  auto edits = listed(**visited, with_failed);
  if (!edits) return propagate(edits);
  return QueueLook{std::move(*edits), in_use};
}

Result<EditAtHand> requeue_edit(const fs::path& folder, const std::string& store, const std::string& id) {
  if (auto there = check_place(folder, store); !there) return propagate(there);
  if (store.empty() && jobs::is_sqlite_store_in_use(folder).value_or(true))
    return fail(ErrorCode::unavailable,
                "a service has the records open, or may have: ask it, by POST /v1/edits/" + id +
                    "/requeue with a token of scope admin, or stop it first",
                folder.string());
  const auto visited = store.empty() ? visit_file(folder) : visit_database(folder, store);
  if (!visited) return propagate(visited);
  const auto queue = jobs::Queue::open(**visited, {.folder = jobs_folder(folder), .others_are_at_work = true});
  if (!queue) return propagate(queue);
  const auto failed = (*queue)->find(id);
  if (!failed) return propagate(failed);
  std::optional<engine::FileLock> hold;  // as EditService::requeue() has it
  if (!store.empty()) {
    auto held = hold_scene(folder, failed->lane, engine::LockKind::shared);
    if (!held) return propagate(held);
    hold = std::move(*held);
  }
  const auto job = (*queue)->requeue(id);
  if (!job) return propagate(job);
  const auto now = (*visited)->now();
  if (!now) return propagate(now);
  return at_hand(*job, *now);
}

}  // namespace server::edits
