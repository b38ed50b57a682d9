#include "server/edits/edit_service.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "engine/core/fair_semaphore.h"
#include "engine/core/file_lock.h"
#include "engine/edit/handles.h"
#include "engine/edit/preview.h"
#include "engine/edit/workload.h"
#include "engine/jobs/worker.h"
#include "proto/edit_record.h"
#include "proto/time_text.h"
#include "server/edits/admission.h"
#include "server/edits/convert.h"
#include "server/edits/convert_selection.h"
#include "server/edits/edit_job.h"
#include "server/edits/estimate.h"
#include "server/edits/interval_pictures.h"
#include "server/edits/named_locks.h"
#include "server/edits/records.h"
#include "server/edits/results.h"
#include "server/edits/scene_hold.h"
#include "server/edits/speed_log.h"
#include "server/edits/status.h"
#include "server/scenes/disk/public_errors.h"

namespace server::edits {
namespace {

namespace edit = engine::edit;
namespace jobs = engine::jobs;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using std::chrono::steady_clock;

/// An edit that takes so many times what one may be estimated to take has outlived its time. A choice: estimates are
/// mostly within a factor of one and a half.
constexpr double outlived = 2;
/// So long an edit waits for others to be measured: as long as for memory. A choice.
constexpr auto measured_within = std::chrono::seconds(10);

double seconds_since(steady_clock::time_point start) {
  return std::chrono::duration<double>(steady_clock::now() - start).count();
}

/// The answer about a job, in the words of those who ask about edits.
Result<jobs::Job> about_edit(Result<jobs::Job> job, const std::string& id) {
  if (job) return job;
  if (job.error().code == ErrorCode::not_found)
    job.error().message = "there is no edit \"" + id + "\"; ended ones are removed after a while";
  if (job.error().where == id) job.error().where = "edit";
  return job;
}

/// The answer to a job, in the words of those who ask for edits.
template <class T>
Result<T> in_terms_of_edits(Result<T> result) {
  if (!result && result.error().where == "active") result.error().where = "edits";
  if (!result && result.error().where == "worked_per_day") result.error().where = "seconds";
  return result;
}

/// The request with the scene and version it is about always there: what a job's payload says.
Result<proto::EditRequest> canonical(proto::EditRequest request) {
  if (!request.scene)
    return fail(ErrorCode::invalid_argument, "say which scene to edit: its id, such as \"s000001\"", "scene");
  if (!request.version) request.version = 0;
  return request;
}

/// A request that can be carried out, with what was found out on the way.
struct Checked {
  edit::Request request;
  scenes::LoadedVersion version;
  edit::PreviewOutcome preview;
  std::vector<std::string> selection_warnings;

  [[nodiscard]] proto::EditRequest resolved_for(const proto::EditRequest& asked) const {
    edit::Params params = request.params;
    params.intervals = preview.intervals;
    return resolved(asked, params, request.handles);
  }
  [[nodiscard]] std::vector<proto::HandleCount> handles() const {
    std::vector<proto::HandleCount> counts;
    for (const std::size_t count : preview.counts) counts.push_back({count});
    return counts;
  }
  [[nodiscard]] std::vector<std::string> warnings(const proto::EditRequest& asked) const {
    std::vector<std::string> all = selection_warnings;
    all.insert(all.end(), preview.warnings.begin(), preview.warnings.end());
    for (std::string& warning : warnings_about(asked)) all.push_back(std::move(warning));
    return all;
  }
};

/// Carries the selection of a request out, if it has one, and hands its rows over.
///   returns  warnings
Result<std::vector<std::string>> select_rows(Selections& selections, const proto::EditRequest& asked,
                                             const scenes::LoadedVersion& version, edit::Request& request) {
  if (!asked.selection) return std::vector<std::string>();
  const auto resolved_selection = selections.resolve(*asked.scene, *asked.selection);
  if (!resolved_selection) return propagate(resolved_selection);
  const auto made = selections.make(version, *resolved_selection);
  if (!made) return propagate(made);
  const auto views = selections.cameras_about(*asked.scene, (*made)->asked);
  if (!views) return propagate(views);
  return hand_over((*made)->selected, *views,
                   [&](const auto& cameras) { return selections.shown_shares(version, **made, cameras); }, request);
}

/// The same for what is to be healed.
Result<std::vector<std::string>> heal_rows(Selections& selections, const proto::EditRequest& asked,
                                           const scenes::LoadedVersion& version, edit::Request& request) {
  if (!asked.heal) return std::vector<std::string>();
  const auto resolved_selection = selections.resolve(*asked.scene, *asked.heal);
  if (!resolved_selection) return tl::make_unexpected(about_healing(resolved_selection.error()));
  const auto made = selections.make(version, *resolved_selection);
  if (!made) return tl::make_unexpected(about_healing(made.error()));
  return hand_over_healed((*made)->selected, request);
}

Result<Checked> check(scenes::SceneStore& scenes, Selections& selections, const models::Models* models,
                      const proto::EditRequest& asked) {
  auto request = to_engine(asked);
  if (!request) return propagate(request);
  if (auto all = available(asked, request->params, models); !all) return propagate(all);
  if (!asked.selection)  // else the request is whole only once that has been carried out
    if (const auto valid = edit::validate(*request); !valid) return propagate(valid);
  auto version = scenes.load(*asked.scene, std::to_string(*asked.version));
  if (!version) return propagate(version);
  auto warnings = select_rows(selections, asked, *version, *request);
  if (!warnings) return propagate(warnings);
  const auto healing = heal_rows(selections, asked, *version, *request);
  if (!healing) return propagate(healing);
  warnings->insert(warnings->end(), healing->begin(), healing->end());
  auto preview = asked.selection ? selections.preview(*version, *request) : edit::preview(version->cloud, *request);
  if (!preview) return propagate(preview);
  return Checked{std::move(*request), std::move(*version), std::move(*preview), std::move(*warnings)};
}

struct Admitted {
  Checked checked;
  JobWorkload work;
  double seconds = 0;  ///< estimated_seconds()
};

std::chrono::milliseconds in_milliseconds(double seconds) {
  constexpr double most = 1e9;  // thirty years: what has no limit must have a number
  return std::chrono::milliseconds(std::int64_t(1000 * std::clamp(seconds, 0.001, most)));
}

}  // namespace

struct EditService::Impl {
  Impl(scenes::SceneStore& store, ServiceOptions given)
      : scenes(store),
        options(std::move(given)),
        own_selections(store),
        selections(options.selections != nullptr ? *options.selections : own_selections),
        arena(options.threads, engine::Priority::low),
        speeds(edit::measured_slowness) {}

  Result<void> open() {
    auto opened = open_records(scenes, options);
    if (!opened) return propagate(opened);
    records = std::move(opened->records);
    queue = std::move(opened->queue);
    for (const engine::Error& finding : queue->findings())
      if (options.logger != nullptr) options.logger->log(spdlog::level::warn, finding.message);
    settle_results(scenes, *queue);
    if (options.role == Role::front) return {};
    const Workshop workshop{.scenes = scenes,
                            .arena = arena,
                            .logger = options.logger,
                            .pictured_views = options.pictured_views,
                            .perceptual = options.perceptual,
                            .timed = options.timed,
                            .outlived_seconds = outlived * options.longest_seconds,
                            .models = options.models,
                            .settle_results = [this] { settle_results(scenes, *queue); }};
    jobs::WorkerOptions working;
    working.ended = [this](const jobs::Job& job) {
      (void)settled(job);  // where that cannot be now, it is when somebody asks for the edit
      if (job.state != jobs::JobState::succeeded) drop_results(scenes, job.id, job.claim_number);
    };
    worker.emplace(
        *queue, [workshop](jobs::JobContext& context) { return carry_out(context, workshop); }, working);
    return {};
  }

  /// The record as others see it: an edit has succeeded once its version is one of its scene.
  jobs::Job settled(jobs::Job job) {
    if (take_in_result(scenes, job)) return job;
    job.state = jobs::JobState::running;
    job.ended.reset();
    return job;
  }
  Result<proto::EditStatus> shown(const Result<jobs::Job>& job) {
    return job.map([this](const jobs::Job& known) { return status_of(settled(known)); });
  }

  /// Keeps an edit that is accepted and a change of its scene apart, in all processes.
  struct Hold {
    NamedLocks::Lock here;
    std::optional<engine::FileLock> among_processes;
  };
  Result<Hold> hold(const std::string& scene, engine::LockKind kind) {
    const bool alone = kind == engine::LockKind::alone;
    auto here = alone ? scenes_in_use.lock(scene) : scenes_in_use.lock_shared(scene);
    if (options.store.empty()) return Hold{std::move(here), std::nullopt};  // no other process changes the records
    auto lock = hold_scene(options.folder, scene, kind);
    if (!lock) return tl::make_unexpected(scenes::without_folder(lock.error(), options.folder));
    return Hold{std::move(here), std::move(*lock)};
  }

  /// A request that can be carried out here, and what will be: errors as submit().
  Result<Admitted> admitted(const proto::EditRequest& asked) {
    auto checked = check(scenes, selections, options.models, asked);
    if (!checked) return propagate(checked);
    const auto dataset = scenes.dataset(*asked.scene);
    if (!dataset) return propagate(dataset);
    Admitted out{std::move(*checked), {}};
    const auto cameras = cameras_of(dataset->get());
    const auto& [request, version, preview, warnings] = out.checked;
    const bool corrected = uses_corrector(request.params);
    const models::Costs costs = costs_of(asked, request.params, options.models);
    out.work = memory_workload_of(version.cloud, request, preview, cameras, corrected, options.pictured_views);
    add_models(out.work, costs);
    // Before frames are rendered to see how long they take.
    if (auto fits = admit(out.work, request.params, cameras, options.memory_bytes); !fits) return propagate(fits);
    const auto info = scenes.find(*asked.scene);
    if (!info) return propagate(info);
    edit::Request request_there = request;
    if (info->up) request_there.up = *info->up;
    {
      // One at a time: they would slow each other down. And counted, for nobody else counts what this thread renders.
      const auto alone = measuring.acquire();
      if (!alone) return propagate(alone);
      const auto share = engine::take_from(options.memory, measuring_bytes(out.work), "scene");
      if (!share) return propagate(share);
      out.work = workload_of(version.cloud, request_there, preview, cameras, corrected, options.pictured_views,
                             *asked.scene, speeds);
      add_models(out.work, costs);
    }
    out.seconds = estimated_seconds(out.work);
    if (auto fits = admit_time(out.work, request.params, cameras, options.longest_seconds); !fits)
      return propagate(fits);
    return out;
  }

  /// The edit of an idempotency key, if the key is known; an error if it came with another request.
  Result<std::optional<jobs::Job>> earlier(const std::string& key, const jobs::NewJob& job) {
    if (key.empty()) return std::nullopt;
    auto known = queue->find_key(key);
    if (known && *known && ((*known)->payload != job.payload || (*known)->lane != job.lane))
      return fail(ErrorCode::unprocessable,
                  "this idempotency key came with another request before, edit " + (*known)->id +
                      ": use a new key for a new request",
                  "Idempotency-Key");
    return known;
  }

  scenes::SceneStore& scenes;
  const ServiceOptions options;
  Selections own_selections;
  Selections& selections;
  engine::WorkArena arena;
  NamedLocks scenes_in_use;  ///< By scene: shared while an edit of it is accepted, alone in while_idle().
  engine::FairSemaphore measuring{{.patience = measured_within}, "edits"};  ///< Of whoever uses `speeds`.
  SpeedLog speeds;
  std::unique_ptr<jobs::Store> records;
  std::unique_ptr<jobs::Queue> queue;
  std::optional<jobs::Worker> worker;  ///< Of whoever is no front. Last: it uses all of the above until it ends.
};

EditService::EditService(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EditService::~EditService() = default;

Result<std::unique_ptr<EditService>> EditService::open(scenes::SceneStore& scenes, const ServiceOptions& options) {
  auto impl = std::make_unique<Impl>(scenes, options);
  if (auto opened = impl->open(); !opened) return propagate(opened);
  return std::unique_ptr<EditService>(new EditService(std::move(impl)));
}

Result<EditService::Submission> EditService::submit(const proto::EditRequest& request,
                                                    const std::string& idempotency_key, const Requester& requester) {
  const auto asked = canonical(request);
  if (!asked) return propagate(asked);
  jobs::NewJob job{.lane = *asked->scene,
                   .payload = proto::to_json(*asked),
                   .idempotency_key = idempotency_key,
                   .requester = requester.name,
                   .quota = requester.quota};
  const auto earlier = impl_->earlier(idempotency_key, job);
  if (!earlier) return propagate(earlier);
  if (*earlier) return Submission{status_of(impl_->settled(**earlier)), false};
  // Before any work is done for a request that there is no place for.
  if (auto room = impl_->queue->check_room(); !room) return propagate(room);
  if (auto room = in_terms_of_edits(impl_->queue->check_quota(job)); !room) return propagate(room);
  const auto hold = impl_->hold(*asked->scene, engine::LockKind::shared);
  if (!hold) return propagate(hold);
  const auto admitted = impl_->admitted(*asked);
  if (!admitted) return propagate(admitted);
  if (auto fits = admit_slow(admitted->work, asked->allow_slow); !fits) return propagate(fits);
  job.expected = in_milliseconds(admitted->seconds);
  const auto submission = in_terms_of_edits(impl_->queue->submit(job));
  if (!submission) return propagate(submission);
  return Submission{status_of(impl_->settled(submission->job)), submission->created};
}

Result<proto::EditEstimate> EditService::estimate(const proto::EditRequest& request) {
  const auto asked = canonical(request);
  if (!asked) return propagate(asked);
  const auto admitted = impl_->admitted(*asked);
  if (!admitted) return propagate(admitted);
  const Checked& checked = admitted->checked;
  const JobWorkload& work = admitted->work;

  proto::EditEstimate estimate;
  estimate.handles = checked.handles();
  estimate.views = work.edit.views;
  estimate.intervals = work.edit.intervals;
  estimate.parts = to_parts(checked.preview.parts);
  estimate.seconds = std::round(100 * admitted->seconds) / 100;
  estimate.memory_bytes = estimated_bytes(work);
  estimate.request = checked.resolved_for(*asked);
  estimate.warnings = checked.warnings(*asked);
  if (const auto slow = admit_slow(work, asked->allow_slow); !slow) estimate.warnings.push_back(slow.error().message);
  return estimate;
}

Result<proto::Preview> EditService::preview(const proto::EditRequest& request) {
  const auto start = steady_clock::now();
  const auto asked = canonical(request);
  if (!asked) return propagate(asked);
  const auto checked = check(impl_->scenes, impl_->selections, impl_->options.models, *asked);
  if (!checked) return propagate(checked);
  const edit::PreviewOutcome& outcome = checked->preview;
  const auto added = impl_->scenes.add_preview(*asked->scene, *asked->version, outcome.overlay);
  if (!added) return propagate(added);

  proto::Preview preview;
  preview.scene = *asked->scene;
  preview.version = added->version;
  preview.parent = *asked->version;
  preview.expires = proto::rfc3339(added->expires);
  preview.handles = checked->handles();
  for (const engine::DVec3& p : outcome.positions) preview.positions.push_back({p.x, p.y, p.z});
  preview.intervals = outcome.intervals;
  preview.parts = to_parts(outcome.parts);
  const std::size_t input = checked->version.cloud.size();
  const std::size_t removed = outcome.overlay.removed.size(), copies = outcome.overlay.added();
  preview.gaussians = {input, input - removed + copies, removed, copies, outcome.changeable, outcome.crumbs, 0};
  preview.warnings = checked->warnings(*asked);
  preview.seconds = seconds_since(start);
  return preview;
}

Result<proto::EditStatus> EditService::find(const std::string& id) {
  return impl_->shown(about_edit(impl_->queue->find(id), id));
}

Result<std::vector<proto::EditStatus>> EditService::list(const Filter& filter) {
  const auto found =
      impl_->queue->list({.lane = filter.scene, .active_only = filter.active_only, .limit = filter.limit});
  if (!found) return propagate(found);
  std::vector<proto::EditStatus> edits;
  for (const jobs::Job& listed : *found) {
    const auto job = impl_->queue->find(listed.id);                  // a list has no payloads
    if (!job && job.error().code == ErrorCode::not_found) continue;  // removed meanwhile
    if (!job) return propagate(job);
    edits.push_back(status_of(impl_->settled(*job)));
  }
  return edits;
}

Result<proto::EditStatus> EditService::stop(const std::string& id) {
  return impl_->shown(about_edit(impl_->queue->stop(id), id));
}

Result<proto::EditStatus> EditService::cancel(const std::string& id) {
  return impl_->shown(about_edit(impl_->queue->cancel(id), id));
}

Result<void> EditService::remove(const std::string& id) {
  const auto job = about_edit(impl_->queue->find(id), id);
  if (!job) return propagate(job);
  if (auto taken = take_in_result(impl_->scenes, *job); !taken) return taken;  // its result stays, without the record
  auto removed = impl_->queue->remove(id);
  if (!removed && removed.error().where == id) removed.error().where = "edit";
  return removed;
}

Result<proto::EditStatus> EditService::requeue(const std::string& id) {
  const auto job = about_edit(impl_->queue->find(id), id);
  if (!job) return propagate(job);
  const auto hold = impl_->hold(job->lane, engine::LockKind::shared);
  if (!hold) return propagate(hold);
  if (const auto scene = impl_->scenes.find(job->lane); !scene) return propagate(scene);
  if (const auto request = proto::parse_edit_request(job->payload); request && request->version)
    if (const auto version = impl_->scenes.find_version(job->lane, std::to_string(*request->version)); !version)
      return propagate(version);
  return impl_->shown(about_edit(impl_->queue->requeue(id), id));
}

Result<std::string> EditService::interval_picture(const std::string& id, int interval, int view,
                                                  const std::string& stage) {
  const auto status = find(id);
  if (!status) return propagate(status);
  const auto& finished = status->finished_intervals;
  const auto of_interval =
      std::find_if(finished.begin(), finished.end(), [&](const auto& known) { return known.interval == interval; });
  if (of_interval == finished.end())
    return fail(ErrorCode::not_found,
                id + " has no finished interval " + std::to_string(interval) + "; finished so far: " +
                    (finished.empty() ? "none" : "1 to " + std::to_string(finished.back().interval)),
                "interval");
  const auto& renders = of_interval->renders;
  if (view < 0 || std::size_t(view) >= renders.size())
    return fail(ErrorCode::not_found,
                "interval " + std::to_string(interval) + " of " + id + " has pictures of " +
                    std::to_string(renders.size()) + " views, counted from 0",
                "render");
  const auto& stages = renders[std::size_t(view)].stages;
  if (std::find(stages.begin(), stages.end(), stage) == stages.end()) {
    std::string names;
    for (const std::string& name : stages) names += (names.empty() ? "" : ", ") + name;
    return fail(ErrorCode::not_found, "there is no picture of this stage; there are: " + names, "stage");
  }
  const std::string name = picture_name(interval, std::size_t(view), stage);
  auto bytes = read_picture(jobs_folder(impl_->options.folder) / id / name);
  if (!bytes && bytes.error().code == ErrorCode::corrupt_data)
    return fail(ErrorCode::corrupt_data, bytes.error().message, "edits/jobs/" + id + "/" + name);
  if (!bytes) return fail(bytes.error().code, "the picture is gone: " + bytes.error().message, id);
  return bytes;
}

Result<void> EditService::while_idle(const std::string& scene, const std::function<Result<void>()>& change) {
  const auto hold = impl_->hold(scene, engine::LockKind::alone);
  if (!hold) return propagate(hold);
  const auto active = impl_->queue->list({.lane = scene, .active_only = true, .limit = 1});
  if (!active) return propagate(active);
  if (!active->empty())
    return fail(ErrorCode::conflict,
                active->front().id + ", an edit of this scene, is " + std::string(to_string(active->front().state)) +
                    ": cancel it, or wait for its end",
                scene);
  return change();
}

Result<void> EditService::remove_scene(const std::string& scene) {
  return while_idle(scene, [&] { return impl_->scenes.remove(scene); });
}

Result<void> EditService::remove_version(const std::string& scene, const std::string& version) {
  const auto hold = impl_->hold(scene, engine::LockKind::alone);
  if (!hold) return propagate(hold);
  const auto active = impl_->queue->list({.lane = scene, .active_only = true, .limit = all_jobs});
  if (!active) return propagate(active);
  for (const jobs::Job& listed : *active) {
    const auto job = impl_->queue->find(listed.id);  // a list has no payloads
    if (!job && job.error().code == ErrorCode::not_found) continue;
    if (!job) return propagate(job);
    const auto request = proto::parse_edit_request(job->payload);
    if (!jobs::is_final(job->state) && request && std::to_string(request->version.value_or(0)) == version)
      return fail(ErrorCode::conflict,
                  job->id + ", an edit of this version, is " + std::string(to_string(job->state)) +
                      ": cancel it, or wait for its end",
                  "version");
  }
  return impl_->scenes.remove_version(scene, version);
}

std::uint64_t EditService::version() const { return impl_->queue->revision(); }

std::uint64_t EditService::wait_for_change(std::uint64_t seen, std::chrono::milliseconds timeout) const {
  return impl_->queue->wait_for_change(seen, timeout);
}

std::optional<double> EditService::seconds_until_room() {
  const auto active = impl_->queue->list({.active_only = true, .limit = all_jobs});
  if (!active) return std::nullopt;
  std::optional<double> least;
  for (const jobs::Job& job : *active) {
    if (!job.claimed) continue;
    const auto record = proto::parse_edit_record(job.progress);
    if (record && record->eta_seconds) least = std::min(least.value_or(*record->eta_seconds), *record->eta_seconds);
  }
  return least;
}

std::optional<engine::Error> EditService::trouble() const {
  std::optional<engine::Error> trouble;
  if (impl_->worker) {
    trouble = impl_->worker->trouble();
  } else if (const auto room = impl_->queue->check_room(); !room && room.error().code != ErrorCode::busy) {
    trouble = room.error();
  }
  if (trouble) trouble = scenes::without_folder(std::move(*trouble), impl_->options.folder);
  return trouble;
}

std::map<std::string, std::size_t> EditService::counts() {
  std::map<std::string, std::size_t> counts;
  for (int state = 0; state < jobs::state_count; ++state) counts[std::string(to_string(jobs::JobState(state)))] = 0;
  const auto found = impl_->queue->list({.limit = all_jobs});
  if (!found) return counts;
  for (const jobs::Job& job : *found) ++counts[std::string(to_string(job.state))];
  return counts;
}

double EditService::oldest_queued_seconds() {
  const auto found = impl_->queue->list({.active_only = true, .limit = all_jobs});
  double oldest = 0;
  if (!found) return oldest;
  const auto now = std::chrono::system_clock::now();
  for (const jobs::Job& job : *found)
    if (job.state == jobs::JobState::queued && !job.started)  // one that made way has been begun
      oldest = std::max(oldest, std::chrono::duration<double>(now - job.created).count());
  return oldest;
}

void EditService::drain(std::chrono::milliseconds grace) {
  if (impl_->worker) impl_->worker->drain(grace);
}

}  // namespace server::edits
