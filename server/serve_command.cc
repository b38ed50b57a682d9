#include "server/serve_command.h"

#include <signal.h>
#include <spdlog/logger.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <utility>

#include "engine/edit/request.h"
#include "engine/render/forward.h"
#include "proto/camera.h"
#include "proto/edit_request.h"
#include "server/commands.h"
#include "server/compute.h"
#include "server/edits/edit_service.h"
#include "server/folders.h"
#include "server/http/http_server.h"
#include "server/http/log.h"
#include "server/render_service.h"
#include "server/routes/all_routes.h"
#include "server/scene_views.h"
#include "server/scenes/scene_store.h"

namespace server {

using engine::ErrorCode;
using engine::propagate;

namespace {

struct ServeOptions {
  std::filesystem::path data_dir, token_file;
  bool insecure = false;
  int drain_seconds = 30;
  int preview_seconds = 600;
  std::string log_level = "info", log_format = "json";
  http::ServerOptions http;
  http::GateOptions gate;
  scenes::StoreOptions scenes;
  edits::ServiceOptions edits;
  routes::EditLimits edit_limits;
  RenderServiceOptions renders;
  ComputeOptions compute;
};

/// Blocks the signals that end the service, in this thread and those it starts from now on, until one is waited for.
class EndSignals {
 public:
  EndSignals() {
    sigemptyset(&signals_);
    for (const int number : {SIGINT, SIGTERM}) sigaddset(&signals_, number);
    pthread_sigmask(SIG_BLOCK, &signals_, &before_);
  }
  ~EndSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  EndSignals(const EndSignals&) = delete;
  EndSignals& operator=(const EndSignals&) = delete;

  /// Afterwards a second signal ends the program at once: nothing is lost by it but time.
  std::string wait() {
    int number = 0;
    while (sigwait(&signals_, &number) != 0) continue;
    pthread_sigmask(SIG_UNBLOCK, &signals_, nullptr);
    return number == SIGINT ? "SIGINT" : "SIGTERM";
  }

 private:
  sigset_t signals_{}, before_{};
};

proto::ServiceInfo service_info(const ServeOptions& options, const Machine& machine) {
  proto::ServiceInfo info;
  info.version = SPLATDRAG_VERSION;
  info.simd = machine.simd;
  info.simd_available = engine::render::simd_targets();
  info.threads = machine.threads;
  info.correctors = {
      {"none", true, ""}, {"scene", true, ""}, {"sd", false, "this version cannot load a diffusion model yet"}};
  info.perceptual = {{"msssim", true, ""}, {"lpips", false, "this version has no network to compare pictures with"}};
  info.read_formats = {"ply", "compressed_ply", "splat", "spz"};
  info.write_formats = {"ply", "splat", "spz"};
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
                 .streams = options.http.dispatcher.max_streams,
                 .scenes = options.scenes.max_scenes,
                 .dataset_bytes = options.scenes.max_dataset_bytes};
  info.token_required = !options.gate.token.empty();
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

void add_gauges(http::Metrics& metrics, scenes::SceneStore& scenes, edits::EditService& edits, RenderService& renders) {
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
  metrics.add_gauges("splatdrag_edits", "Edits on record, by state.", "state", [&] {
    std::map<std::string, double> values;
    for (const auto& [state, count] : edits.counts()) values[state] = double(count);
    return values;
  });
}

Result<void> check_token(ServeOptions& options, spdlog::logger& logger) {
  if (!options.token_file.empty()) {
    std::string warning;
    auto token = read_token(options.token_file, warning);
    if (!token) return propagate(token);
    if (!warning.empty()) http::log(logger, spdlog::level::warn, warning);
    options.gate.token = std::move(*token);
  }
  if (options.gate.token.empty() && !is_loopback(options.http.host)) {
    if (!options.insecure)
      return engine::fail(ErrorCode::invalid_argument,
                          "a service that other machines can reach needs a token: give --token-file, or --insecure to "
                          "let everybody in",
                          "--host");
    http::log(logger, spdlog::level::warn, "everybody who can reach this service may use it (--insecure)");
  }
  return {};
}

/// Serves until a signal comes.
Result<void> serve(const ServeOptions& options, const Machine& machine, EndSignals& signals, spdlog::logger& logger,
                   Terminal& terminal) {
  auto scenes = scenes::SceneStore::open(options.scenes);
  if (!scenes && scenes.error().code == ErrorCode::conflict)  // another service has it
    return engine::fail(ErrorCode::unavailable, scenes.error().message, options.data_dir.string());
  if (!scenes) return propagate(scenes);
  for (const engine::Error& damage : (*scenes)->damaged())
    http::log(logger, spdlog::level::err, "a scene cannot be used: " + damage.message, {{"where", damage.where}});
  auto edits = edits::EditService::open(**scenes, options.edits);
  if (!edits) return propagate(edits);
  RenderService renders(options.renders);
  SceneViews views(**scenes, renders);
  http::Gate gate(options.gate);
  http::Metrics metrics;
  add_gauges(metrics, **scenes, **edits, renders);
  http::Router router = routes::all_routes(
      {**scenes, **edits, options.edit_limits, renders, views, gate, metrics, service_info(options, machine)});
  auto server = http::HttpServer::start(options.http, std::move(router), gate, metrics, logger);
  if (!server) return propagate(server);
  terminal.out << "splatdrag " << SPLATDRAG_VERSION << " is listening on " << (*server)->url() << std::endl;
  http::log(logger, spdlog::level::info, "listening",
            {{"url", (*server)->url()},
             {"version", std::string(SPLATDRAG_VERSION)},
             {"simd", machine.simd},
             {"threads", std::int64_t{machine.threads}},
             {"data_dir", options.data_dir.string()}});
  const std::string signal = signals.wait();
  http::log(logger, spdlog::level::info, "stopping", {{"signal", signal}});
  (*server)->stop();
  (*edits)->drain(std::chrono::seconds(options.drain_seconds));
  http::log(logger, spdlog::level::info, "stopped");
  return {};
}

Result<void> run(const ServeOptions& given, Terminal& terminal) {
  EndSignals signals;  // before any thread is started
  ServeOptions options = given;
  const auto format = options.log_format == "text" ? http::LogFormat::text : http::LogFormat::json;
  const auto logger = http::make_logger(terminal.err, options.log_level, format);
  if (!logger) return propagate(logger);
  if (const auto checked = check_token(options, **logger); !checked) return checked;
  Machine machine;
  const auto computing = compute(options.compute, [&](const Machine& here) -> Result<void> {
    machine = here;
    return {};
  });
  if (!computing) return computing;
  options.scenes.folder = options.data_dir / "scenes";
  options.scenes.program_version = SPLATDRAG_VERSION;
  options.scenes.preview_lifetime = std::chrono::seconds(options.preview_seconds);
  options.edits.folder = options.data_dir / "edits";
  options.edits.threads = options.compute.threads;
  options.edits.logger = logger->get();
  options.renders.threads = options.compute.threads;
  options.renders.program = SPLATDRAG_VERSION;
  if (const auto made = make_folder(options.data_dir); !made) return made;
  return serve(options, machine, signals, **logger, terminal);
}

template <class Number>
CLI::Option* add_bytes(CLI::App& command, const std::string& name, Number& value, const std::string& description) {
  return command.add_option(name, value, description + " (a number of bytes, or such as 512MiB)")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/true))
      ->check(CLI::PositiveNumber)
      ->type_name("BYTES");
}

template <class Number>
CLI::Option* add_count(CLI::App& command, const std::string& name, Number& value, const std::string& description,
                       std::int64_t low = 1, std::int64_t high = 1'000'000'000) {
  return command.add_option(name, value, description)->check(CLI::Range(low, high))->type_name("N");
}

void add_http_options(CLI::App& command, http::ServerOptions& options, http::GateOptions& gate) {
  command.add_option("--host", options.host, "Address to listen on")->type_name("HOST");
  command
      .add_option("--port", options.port, "Port to listen on; 0: any that is free, named in the first line of output")
      ->check(CLI::Range(0, 65535))
      ->type_name("N");
  command
      .add_option("--allowed-host", gate.allowed_hosts,
                  "A name the service goes by, beside --host and the loopback names; several may be given")
      ->type_name("NAME");
  command
      .add_option("--allowed-origin", gate.allowed_origins,
                  "Requests whose Origin is this one are taken, as those of the service's own page are: for a proxy "
                  "that puts the service under another name (https://name); several may be given")
      ->type_name("ORIGIN");
  add_count(command, "--max-connections", options.threads, "Connections served at a time");
  add_count(command, "--max-waiting", options.max_waiting, "Connections that may wait; more are turned away", 0);
  add_count(command, "--max-streams", options.dispatcher.max_streams, "Streams of events at a time", 0);
  add_count(command, "--max-sessions", gate.max_sessions, "Pages signed in at a time; the oldest makes room");
  add_bytes(command, "--max-header-bytes", options.connection.max_head_bytes, "Head of a request");
  add_bytes(command, "--max-json-bytes", options.dispatcher.max_json_bytes, "JSON body of a request, up to 1MiB")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{proto::JsonLimits().max_bytes}));
  add_bytes(command, "--max-upload-bytes", options.dispatcher.max_upload_bytes, "Uploaded file");
  add_count(command, "--min-bytes-per-second", options.connection.min_bytes_per_second,
            "Slower clients are cut off, after ten seconds of patience", 0);
}

void add_store_options(CLI::App& command, ServeOptions& options) {
  command.add_option("--data-dir", options.data_dir, "Folder for scenes and edits; nothing is written anywhere else")
      ->required()
      ->type_name("DIR");
  command.add_option("--scene-root", options.scenes.scene_root, "Folder below which clients may open files by path")
      ->check(CLI::ExistingDirectory)
      ->type_name("DIR");
  add_bytes(command, "--scene-memory", options.scenes.memory_bytes, "Memory for scenes and previews");
  add_count(command, "--max-gaussians", options.scenes.read.max_gaussians, "Gaussians of a scene");
  add_count(command, "--max-scenes", options.scenes.max_scenes, "Scenes held");
  add_count(command, "--max-previews", options.scenes.max_previews, "Previews in memory");
  add_count(command, "--preview-seconds", options.preview_seconds,
            "A preview nobody looks at is forgotten after so long");
  add_bytes(command, "--max-dataset-bytes", options.scenes.max_dataset_bytes, "Dataset, unpacked");
  add_count(command, "--max-dataset-files", options.scenes.max_dataset_files, "Files of a dataset");
  add_count(command, "--max-queued", options.edits.max_queued, "Edits that may wait");
  add_count(command, "--max-edit-records", options.edits.retention.max_count, "Ended edits that are remembered");
  add_count(command, "--pictured-views", options.edits.pictured_views, "Views rendered after each interval", 0);
  add_count(command, "--max-handles", options.edit_limits.handles, "Handles of an edit", 1, proto::max_handles);
  add_count(command, "--max-views", options.edit_limits.views, "Views that an edit looks through", 1,
            engine::params::max_views);
  add_count(command, "--max-image-side", options.edit_limits.image_side,
            "Pixels along a side of the pictures that an edit works on", 16, proto::max_camera_side);
  add_count(command, "--max-waiting-renders", options.renders.max_waiting, "Renders that may wait for a thread", 0);
  add_count(command, "--max-render-side", options.renders.max_side, "Pixels along a side of a render", 1,
            proto::max_camera_side);
}

}  // namespace

Result<std::string> read_token(const std::filesystem::path& file, std::string& warning) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0)
    return engine::fail(errno == ENOENT ? ErrorCode::not_found : ErrorCode::unavailable,
                        std::string("the token file cannot be read: ") + std::strerror(errno), file.string());
  std::ifstream in(file, std::ios::binary);
  constexpr std::size_t most = 4096;
  std::string text(most + 1, '\0');
  in.read(text.data(), std::streamsize(text.size()));
  text.resize(std::size_t(in.gcount()));
  if (in.bad() || (text.empty() && !in.eof()))
    return engine::fail(ErrorCode::unavailable, "the token file cannot be read", file.string());
  const auto is_blank = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
  while (!text.empty() && is_blank(text.back())) text.pop_back();
  text.erase(text.begin(), std::find_if_not(text.begin(), text.end(), is_blank));
  if (text.empty()) return engine::fail(ErrorCode::invalid_argument, "the token file is empty", file.string());
  if (text.size() > most || std::any_of(text.begin(), text.end(), [](char c) { return c <= 0x20 || c >= 0x7f; }))
    return engine::fail(ErrorCode::invalid_argument,
                        "a token is one word of printable ASCII, up to 4096 bytes; make one with: openssl rand -hex 32",
                        file.string());
  if ((status.st_mode & S_IROTH) != 0)
    warning = "other users of this machine can read the token file: chmod 600 " + file.string();
  return text;
}

bool is_loopback(const std::string& host) {
  return host == "localhost" || host == "::1" || host == "[::1]" || host.starts_with("127.");
}

void add_serve_command(CLI::App& program, Action& action) {
  CLI::App* const command = program.add_subcommand("serve", "Serves edits over HTTP, with a page to place points on");
  const auto options = std::make_shared<ServeOptions>();
  add_http_options(*command, options->http, options->gate);
  add_store_options(*command, *options);
  command
      ->add_option("--token-file", options->token_file,
                   "File with a token that every request must carry (\"Authorization: Bearer ...\")")
      ->type_name("FILE");
  command->add_flag("--insecure", options->insecure, "Listen to other machines without a token");
  add_count(*command, "--drain-seconds", options->drain_seconds,
            "When the service is stopped, a running edit may go on for so long to finish its interval", 0);
  command->add_option("--log-level", options->log_level, "Least level that is logged")
      ->check(CLI::IsMember({"debug", "info", "warn", "error", "off"}))
      ->type_name("LEVEL");
  command->add_option("--log-format", options->log_format, "For programs (json) or people (text)")
      ->check(CLI::IsMember({"json", "text"}))
      ->type_name("FORMAT");
  add_compute_options(*command, options->compute);
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server
