#include "server/service/serve.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <map>
#include <memory>
#include <thread>
#include <utility>

#include "engine/core/memory_budget.h"
#include "engine/render/forward.h"
#include "proto/edit_request.h"
#include "server/http/log.h"
#include "server/http/metrics.h"
#include "server/models/models.h"
#include "server/service/readiness.h"
#include "server/service/scene_views.h"
#include "server/service/token.h"

namespace server::service {

using engine::ErrorCode;
using engine::propagate;
using engine::Result;

namespace {

proto::ServiceInfo service_info(const ServeOptions& options, const models::Models& models) {
  proto::ServiceInfo info;
  info.version = SPLATDRAG_VERSION;
  info.simd = options.simd;
  info.simd_available = engine::render::simd_targets();
  info.threads = options.threads_here;
  info.correctors = {{"none", true, ""}, {"scene", true, ""}, {"sd", models.no_sd().empty(), models.no_sd()}};
  info.perceptual = {{"msssim", true, ""}, {"lpips", models.no_lpips().empty(), models.no_lpips()}};
  info.loras = models.loras();
  for (const auto& format : engine::names<engine::io::SceneFormat>) info.read_formats.emplace_back(format.text);
  info.write_formats = info.read_formats;
  info.picture_formats = {"png", "jpeg", "exr"};
  for (const auto& preset : engine::names<proto::Preset>) info.presets.emplace_back(preset.text);
  info.limits = {.upload_bytes = options.http.dispatcher.max_upload_bytes,
                 .json_bytes = options.http.dispatcher.max_json_bytes,
                 .gaussians = options.scenes.read.max_gaussians,
                 .handles = options.edit_limits.handles,
                 .views = std::uint64_t(options.edit_limits.views),
                 .render_side = std::uint64_t(options.renders.max_side),
                 .image_side = std::uint64_t(options.edit_limits.image_side),
                 .queued_edits = options.edits.max_queued,
                 .scene_memory_bytes = options.scenes.memory_bytes,
                 .edit_memory_bytes = options.edits.memory_bytes,
                 .edit_seconds = std::uint64_t(std::ceil(options.edits.longest_seconds)),
                 .streams = options.http.dispatcher.max_streams,
                 .scenes = options.scenes.max_scenes,
                 .dataset_bytes = options.scenes.max_dataset_bytes};
  info.token_required = !options.access.tokens.empty();
  info.scene_root = !options.scenes.scene_root.empty();
  return info;
}

/// Of this process; 0 where the system does not tell.
double resident_bytes() {
  std::ifstream statm("/proc/self/statm");
  double total = 0, resident = 0;
  statm >> total >> resident;
  return resident * double(::sysconf(_SC_PAGESIZE));
}

void add_gauges(http::Metrics& metrics, scenes::SceneStore& scenes, edits::EditService& edits, RenderService& renders,
                const std::filesystem::path& data_dir) {
  metrics.add_gauge("process_resident_memory_bytes", "Resident memory of the process.", resident_bytes);
  metrics.add_gauge("splatdrag_scenes", "Scenes held.", [&] { return double(scenes.usage().scenes); });
  metrics.add_gauge("splatdrag_scenes_damaged", "Scenes on disk that cannot be used.",
                    [&] { return double(scenes.damaged().size()); });
  metrics.add_gauge("splatdrag_previews", "Previews in memory.", [&] { return double(scenes.usage().previews); });
  metrics.add_gauge("splatdrag_scene_memory_bytes", "Memory that scenes and previews take.",
                    [&] { return double(scenes.usage().memory_bytes); });
  metrics.add_gauge("splatdrag_scene_memory_budget_bytes", "Memory that scenes and previews may take.",
                    [&] { return double(scenes.usage().memory_budget); });
  metrics.add_gauge("splatdrag_renders_waiting", "Renders that wait for a thread.",
                    [&] { return double(renders.waiting()); });
  metrics.add_gauge("splatdrag_oldest_queued_edit_seconds", "Time that the edit has waited that waits longest.",
                    [&] { return edits.oldest_queued_seconds(); });
  const auto space = [data_dir] {
    std::error_code error;
    const auto found = std::filesystem::space(data_dir, error);
    return error ? std::filesystem::space_info{} : found;
  };
  metrics.add_gauge("splatdrag_disk_free_bytes", "Bytes of the data folder's file system that the service may use.",
                    [space] { return double(space().available); });
  metrics.add_gauge("splatdrag_disk_used_bytes", "Bytes of the data folder's file system that are used, by anybody.",
                    [space] { return double(space().capacity - space().free); });
  metrics.add_gauges("splatdrag_edits", "Edits on record, by state.", "state", [&] {
    std::map<std::string, double> values;
    for (const auto& [state, count] : edits.counts()) values[state] = double(count);
    return values;
  });
}

/// Reads the tokens again. Where that fails the old ones stay: a service that is set up wrong locks nobody in or out.
void reload_tokens(const std::filesystem::path& file, http::AccessGuard& guard, spdlog::logger& logger) {
  std::string warning;
  auto tokens = read_tokens(file, warning);
  if (!warning.empty()) http::log(logger, spdlog::level::warn, warning);
  if (!tokens) {
    http::log(logger, spdlog::level::err, "the old tokens stay: " + tokens.error().message,
              {{"where", tokens.error().where}});
    return;
  }
  // A file that is only half written, or was cut off, has one word as well: a name, which is no secret.
  if (tokens->size() == 1 && tokens->front().name == http::only_token_name && !guard.has_only_token()) {
    http::log(logger, spdlog::level::err,
              "the old tokens stay: the file has one word now, and had named tokens; restart the service to have one "
              "token that may do everything",
              {{"where", file.string()}});
    return;
  }
  const auto count = std::int64_t(tokens->size());
  guard.replace_tokens(std::move(*tokens));
  http::log(logger, spdlog::level::info, "tokens have been read again", {{"tokens", count}});
}

void reopen(http::AuditLog& audit, spdlog::logger& logger) {
  if (const auto reopened = audit.reopen(); !reopened)
    http::log(logger, spdlog::level::err, "the audit log goes on in the old file: " + reopened.error().message,
              {{"where", reopened.error().where}});
  else
    http::log(logger, spdlog::level::info, "the audit log has been opened again");
}

void observe_edit(http::Metrics& metrics, const std::vector<proto::StageSeconds>& timings) {
  double all = 0;
  for (const auto& [stage, seconds] : timings) {
    metrics.observe("splatdrag_edit_stage_seconds", "Time that a finished edit spent in a stage.", "stage", stage,
                    seconds);
    all += seconds;
  }
  metrics.observe("splatdrag_edit_seconds", "Time that a finished edit took, without its wait in the queue.", "", "",
                  all);
}

/// Connections take descriptors. Shells give a program fewer than the system lets it have; where that is still too few,
/// there are fewer connections: what files need is left to them.
void share_descriptors(std::size_t& connections, spdlog::logger& logger) {
  constexpr rlim_t files = 512, least_files = 128;  // of scenes and edits; a choice
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  const rlim_t wanted = 2 * rlim_t(connections) + files;  // a download has its file open besides
  if (limit.rlim_cur < wanted) {
    limit.rlim_cur = std::min(limit.rlim_max, wanted);
    if (::setrlimit(RLIMIT_NOFILE, &limit) != 0) ::getrlimit(RLIMIT_NOFILE, &limit);
  }
  const rlim_t there_are = std::max<rlim_t>(limit.rlim_cur, 2 * least_files) - least_files;
  if (connections <= there_are) return;
  connections = std::size_t(there_are);
  http::log(logger, spdlog::level::warn, "this process may open few files: --max-connections is lowered",
            {{"files", std::int64_t(limit.rlim_cur)}, {"connections", std::int64_t(connections)}});
}

/// Tells the parts what they have to know of the whole.
void share_out(ServeOptions& options, spdlog::logger& logger) {
  options.scenes.folder = options.data_dir / "scenes";
  options.scenes.program_release = SPLATDRAG_VERSION;
  options.scenes.preview_lifetime = std::chrono::seconds(options.preview_seconds);
  if (options.edits.role != edits::Role::all) options.scenes.sharing = scenes::Sharing::shared;
  options.edits.folder = options.data_dir / "edits";
  options.edits.lease = std::chrono::seconds(options.lease_seconds);
  options.edits.threads = options.threads;
  options.edits.logger = &logger;
  options.renders.threads = options.threads;
  options.renders.program = SPLATDRAG_VERSION;
}

}  // namespace

Result<void> check_tokens(ServeOptions& options, spdlog::logger& logger) {
  if (!options.token_file.empty()) {
    std::string warning;
    auto tokens = read_tokens(options.token_file, warning);
    if (!tokens) return propagate(tokens);
    if (!warning.empty()) http::log(logger, spdlog::level::warn, warning);
    options.access.tokens = std::move(*tokens);
  }
  if (options.access.tokens.empty() && !is_loopback(options.http.host)) {
    if (!options.insecure)
      return engine::fail(ErrorCode::invalid_argument,
                          "a service that other machines can reach needs a token: give --token-file, or --insecure to "
                          "let everybody in",
                          "--host");
    http::log(logger, spdlog::level::warn, "everybody who can reach this service may use it (--insecure)");
  }
  return {};
}

Result<void> check_role(const ServeOptions& options) {
  if (options.edits.role == edits::Role::all || !options.edits.store.empty()) return {};
  return engine::fail(ErrorCode::invalid_argument,
                      "fronts and workers find each other by a database: give its address by --store "
                      "postgresql://...; without one, a service does all by itself (--role all)",
                      "--role");
}

Result<void> serve(ServeOptions options, EndSignals& signals, spdlog::logger& logger, std::ostream& out) {
  share_out(options, logger);
  share_descriptors(options.http.lobby.max_connections, logger);
  engine::MemoryBudget work_memory(options.work_memory_bytes, "--work-memory");
  options.scenes.read.memory = &work_memory;
  options.renders.memory = &work_memory;
  options.edits.memory = &work_memory;
  auto scenes = scenes::SceneStore::open(options.scenes);
  if (!scenes && scenes.error().code == ErrorCode::conflict)  // another service has it
    return engine::fail(ErrorCode::unavailable, scenes.error().message, options.data_dir.string());
  if (!scenes) return propagate(scenes);
  for (const engine::Error& damage : (*scenes)->damaged())
    http::log(logger, spdlog::level::err, "a scene cannot be used: " + damage.message, {{"where", damage.where}});
  for (const engine::Error& damage : (*scenes)->recovered())
    http::log(logger, spdlog::level::warn, damage.message, {{"where", damage.where}});
  const models::Models models(options.model_dir, options.threads);
  for (const models::Finding& finding : models.findings())
    if (!options.model_dir.empty() && !finding.usable)
      http::log(logger, spdlog::level::warn, "a model cannot be used: " + finding.message, {{"model", finding.name}});
  options.edits.models = &models;
  http::Metrics metrics;
  options.edits.timed = [&metrics](const std::vector<proto::StageSeconds>& timings) { observe_edit(metrics, timings); };
  RenderService renders(options.renders);  // before edits are taken up, which give their thread a low priority
  edits::Selections selections(**scenes);
  options.edits.selections = &selections;
  auto edits = edits::EditService::open(**scenes, options.edits);
  if (!edits) return propagate(edits);
  (*scenes)->let_others_in();
  SceneViews views(**scenes);
  http::AccessGuard guard(options.access);
  add_gauges(metrics, **scenes, **edits, renders, options.data_dir);
  Readiness readiness(options.data_dir, [&] { return (*edits)->trouble(); });
  const auto trouble = [&] { return readiness.trouble(); };
  http::Router router = options.edits.role == edits::Role::worker
                            ? routes::worker_routes(metrics, trouble)
                            : routes::all_routes({**scenes, **edits, selections, options.edit_limits, renders, views,
                                                  guard, metrics, service_info(options, models), trouble});
  std::unique_ptr<http::AuditLog> audit;
  if (!options.audit_log.empty()) {
    auto opened = http::AuditLog::open(options.audit_log, logger);
    if (!opened) return propagate(opened);
    audit = std::move(*opened);
    metrics.add_gauge("splatdrag_audit_lines_lost", "Lines of the audit log that could not be written.",
                      [&audit] { return double(audit->lost()); });
    options.http.audit = audit.get();
  }
  auto server = http::HttpServer::start(options.http, std::move(router), guard, metrics, logger);
  if (!server) return propagate(server);
  out << "splatdrag " << SPLATDRAG_VERSION << " is listening on " << (*server)->url() << '\n' << std::flush;
  http::log(logger, spdlog::level::info, "listening",
            {{"url", (*server)->url()},
             {"version", std::string(SPLATDRAG_VERSION)},
             {"simd", options.simd},
             {"threads", std::int64_t{options.threads_here}},
             {"role", std::string(engine::name_of(options.edits.role))},
             {"data_dir", options.data_dir.string()}});
  std::string signal = signals.wait();
  for (; signal == "SIGHUP"; signal = signals.wait()) {
    if (!options.token_file.empty()) reload_tokens(options.token_file, guard, logger);
    if (audit != nullptr) reopen(*audit, logger);
  }
  http::log(logger, spdlog::level::info, "stopping", {{"signal", signal}});
  readiness.end();
  // Whoever sends requests here has time to hear of it; what is on its way, such as downloads, has it, too.
  std::this_thread::sleep_for(std::chrono::seconds(options.unready_seconds));
  (*server)->stop();
  (*edits)->drain(std::chrono::seconds(options.drain_seconds));
  http::log(logger, spdlog::level::info, "stopped");
  return {};
}

}  // namespace server::service
