// Edits as a service: checked and accepted at once, carried out one after the other, durable at every interval. Short
// ones go first between the intervals of long ones (docs/adr/0028-every-edit-has-its-turn.md).
#pragma once

#include <spdlog/logger.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/memory_budget.h"
#include "engine/core/names.h"
#include "engine/core/parallel.h"
#include "engine/core/result.h"
#include "engine/jobs/queue.h"
#include "engine/optim/perceptual.h"
#include "proto/edit_request.h"
#include "proto/edit_status.h"
#include "server/edits/selections.h"
#include "server/models/models.h"
#include "server/scenes/scene_store.h"

namespace server::edits {

using engine::Result;

/// What of the service a process is.
enum class Role {
  all,    ///< All of it, alone.
  front,  ///< Answers requests, and carries no edits out. There may be others of either kind over one data folder.
  worker  ///< Carries edits out.
};
constexpr auto names_of(Role) {
  using engine::Name;
  return std::array{Name{Role::all, "all"}, Name{Role::front, "front"}, Name{Role::worker, "worker"}};
}

struct ServiceOptions {
  Role role = Role::all;           ///< Others than `all` need a store in a database, and a shared store of scenes.
  std::filesystem::path folder;    ///< <data-dir>/edits: job records and what running edits need.
  std::string store = {};          ///< Database with the records (PostgresOptions::address); empty: a file here.
  std::chrono::seconds lease{30};  ///< How long a claim of an edit lasts there that is not renewed.
  std::size_t max_queued = 32;
  engine::jobs::Retention retention = {};
  int pictured_views = 4;  ///< Of each interval, for its intermediate renders.
  int attempts = 3;        ///< An edit has failed once the service died so often at the same place of it; 0: never.
  std::uint64_t memory_bytes = 0;  ///< What one edit may be estimated to take; 0: any amount.
  /// What one edit may be estimated to take; 0: any time. One that has worked for twice as long ends with what it has
  /// (see Workshop). A choice: a night.
  double longest_seconds = 12 * 3600;
  int threads = 0;                   ///< 0: as many as the machine has cores.
  spdlog::logger* logger = nullptr;  ///< Is told what becomes of edits; outlives the service. Null: nobody is.
  /// Is told how long an edit took that has made its version: by stages, in seconds. Called by the worker's thread;
  /// those of an edit that was resumed are of all its runs. Empty: nobody is.
  std::function<void(const std::vector<proto::StageSeconds>&)> timed = {};
  /// Lends what looking at a scene takes before an edit of it is accepted; outlives the service. Null: nobody counts
  /// it.
  engine::MemoryBudget* memory = nullptr;
  /// The loss inside masks of edits that name no network; outlives the service. Null: the engine's own.
  engine::optim::PerceptualLoss* perceptual = nullptr;
  /// Where previews find what their selection selects; outlives the service. Null: it keeps its own.
  Selections* selections = nullptr;
  const models::Models* models = nullptr;  ///< Outlives the service. Null: there are none.
};

/// Safe to call from any thread.
class EditService {
 public:
  /// Takes up what was left unfinished: where other processes are at work already, once they have been silent for a
  /// lease.
  ///   scenes  outlives the service
  ///   errors  corrupt_data: the records of edits are damaged or lost (the message says how to go on); conflict: they
  ///           are kept elsewhere, or are another data folder's; unavailable, no_space; those of PostgresStore::open()
  [[nodiscard]] static Result<std::unique_ptr<EditService>> open(scenes::SceneStore& scenes,
                                                                 const ServiceOptions& options);
  ~EditService();

  /// Who asks for an edit.
  struct Requester {
    std::string name = {};  ///< As whoever lets them in calls them; empty: nobody says.
    engine::jobs::Quota quota = {};
  };
  struct Submission {
    proto::EditStatus status;
    bool created = true;  ///< false: the idempotency key had been used for this very request.
  };
  /// Accepts an edit: on disk when this returns. The scene, its version and every field are checked first, and each
  /// handle is held against the scene; a selection is carried out.
  ///   errors  invalid_argument, not_found (`where` "scene", "version"; a view of a selection), unprocessable (a handle
  ///           without Gaussians, an empty selection; a key used for another request), unsupported (a model that is not
  ///           there), busy (the queue is full: looked at first), quota_exceeded (the requester's; `where` is "edits"
  ///           or "seconds"), unavailable (others are being measured for too long); those of admit(), admit_time(),
  ///           admit_slow() and MemoryBudget::take()
  [[nodiscard]] Result<Submission> submit(const proto::EditRequest& request, const std::string& idempotency_key,
                                          const Requester& requester);
  [[nodiscard]] Result<Submission> submit(const proto::EditRequest& request, const std::string& idempotency_key) {
    return submit(request, idempotency_key, Requester());
  }
  /// What submit() would do, and what it would cost. Errors as submit(), but for busy and quota_exceeded, since it
  /// takes no place in the queue, and those of admit_slow(), which become a warning.
  [[nodiscard]] Result<proto::EditEstimate> estimate(const proto::EditRequest& request);
  /// The deformation alone, at once. Errors as submit().
  [[nodiscard]] Result<proto::Preview> preview(const proto::EditRequest& request);

  [[nodiscard]] Result<proto::EditStatus> find(const std::string& id);
  struct Filter {
    std::optional<std::string> scene = {};
    bool active_only = false;
    std::size_t limit = 100;
  };
  /// Youngest first.
  [[nodiscard]] Result<std::vector<proto::EditStatus>> list(const Filter& filter);
  [[nodiscard]] Result<proto::EditStatus> stop(const std::string& id);
  [[nodiscard]] Result<proto::EditStatus> cancel(const std::string& id);
  [[nodiscard]] Result<void> remove(const std::string& id);
  /// Has an edit that failed taken up again, from its last checkpoint if that is still there.
  ///   errors  conflict: it has not failed, or a later edit of its scene has yet to end; not_found: the edit, or its
  ///           scene
  [[nodiscard]] Result<proto::EditStatus> requeue(const std::string& id);
  /// A picture of a finished interval: JPEG bytes.
  ///   stage   "before", "deformed", "corrected", "optimised"
  ///   errors  not_found: no such interval, view or stage (the message lists those there are)
  [[nodiscard]] Result<std::string> interval_picture(const std::string& id, int interval, int view,
                                                     const std::string& stage);
  /// Makes a change to a scene that no edit of it may see half-way: none waits or runs while `change` is at work.
  ///   errors  conflict: names the edit; those of `change`
  [[nodiscard]] Result<void> while_idle(const std::string& scene, const std::function<Result<void>()>& change);
  /// Removes a scene, unless an edit of it waits or runs. Errors as while_idle().
  [[nodiscard]] Result<void> remove_scene(const std::string& scene);

  /// Deletes a version of a scene, unless an edit of it waits or runs, or one that has yet to end has made it.
  ///   errors  conflict: names the edit; those of SceneStore::remove_version()
  [[nodiscard]] Result<void> remove_version(const std::string& scene, const std::string& version);

  /// Counts changes of any edit; wait_for_change() returns when it is not `seen` any more, or after `timeout`.
  [[nodiscard]] std::uint64_t version() const;
  std::uint64_t wait_for_change(std::uint64_t seen, std::chrono::milliseconds timeout) const;

  /// Seconds until a full queue has room again: what is left of the running edit, as far as it knows.
  [[nodiscard]] std::optional<double> seconds_until_room();

  /// What keeps edits from being carried out, if anything does; names no folder of this machine.
  [[nodiscard]] std::optional<engine::Error> trouble() const;
  /// How many edits are in each state, by its name.
  [[nodiscard]] std::map<std::string, std::size_t> counts();
  /// Since the edit was accepted that has waited longest to be begun; 0 where none waits.
  [[nodiscard]] double oldest_queued_seconds();
  /// Takes no more edits up; the running one ends at its next interval, or when `grace` is over, and goes on after the
  /// next start.
  void drain(std::chrono::milliseconds grace);

 private:
  struct Impl;
  explicit EditService(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace server::edits
