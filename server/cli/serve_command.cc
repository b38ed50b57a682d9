// splatdrag serve: the options of the service, and its start.
#include <spdlog/logger.h>

#include <filesystem>
#include <map>
#include <memory>

#include "engine/params/params.h"
#include "proto/camera.h"
#include "proto/edit_request.h"
#include "server/cli/commands.h"
#include "server/cli/compute.h"
#include "server/cli/folders.h"
#include "server/edits/machine_memory.h"
#include "server/http/library_messages.h"
#include "server/http/log.h"
#include "server/service/serve.h"

namespace server::cli {
namespace {

using engine::propagate;
using service::ServeOptions;

/// What the command line says beyond what the service needs to know.
struct ServeCommandOptions : ServeOptions {
  std::string log_level = "info", log_format = "json", role = "all";
  ComputeOptions compute;
};

Result<void> run(const ServeCommandOptions& given, Terminal& terminal) {
  service::EndSignals signals(/*hangup=*/!given.token_file.empty() ||
                              !given.audit_log.empty());  // before any thread is started
  ServeOptions options = given;
  options.edits.role = engine::value_named<edits::Role>(given.role).value_or(edits::Role::all);
  if (const auto checked = service::check_role(options); !checked) return checked;
  const auto format = given.log_format == "text" ? http::LogFormat::text : http::LogFormat::json;
  const auto logger = http::make_logger(terminal.err, given.log_level, format);
  if (!logger) return propagate(logger);
  const http::LibraryMessages messages(**logger);
  if (const auto checked = service::check_tokens(options, **logger); !checked) return checked;
  options.threads = given.compute.threads;
  const auto computing = compute(given.compute, [&](const Machine& machine) -> Result<void> {
    options.threads_here = machine.threads;
    options.simd = machine.simd;
    return {};
  });
  if (!computing) return computing;
  if (const auto made = make_folder(options.data_dir); !made) return made;
  return service::serve(std::move(options), signals, **logger, terminal.out);
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

CLI::Option* add_seconds(CLI::App& command, const std::string& name, double& value, const std::string& description) {
  const std::map<std::string, double> units{{"s", 1}, {"min", 60}, {"h", 3600}, {"d", 24 * 3600}};
  return command.add_option(name, value, description + " (a number of seconds, or such as 90min)")
      ->transform(CLI::AsNumberWithUnit(units))
      ->check(CLI::PositiveNumber)
      ->type_name("SECONDS");
}

void add_http_options(CLI::App& command, http::ServerOptions& options, http::AccessOptions& access) {
  command.add_option("--host", options.host, "Address to listen on")->type_name("HOST");
  command
      .add_option("--port", options.port, "Port to listen on; 0: any that is free, named in the first line of output")
      ->check(CLI::Range(0, 65535))
      ->type_name("N");
  command
      .add_option("--allowed-host", access.allowed_hosts,
                  "A name the service goes by, beside --host and the loopback names; several may be given")
      ->type_name("NAME");
  command
      .add_option("--allowed-origin", access.allowed_origins,
                  "Requests whose Origin is this one are taken, as those of the service's own page are: for a proxy "
                  "that puts the service under another name (https://name); several may be given")
      ->type_name("ORIGIN");
  command.add_flag("--trust-proxy", access.trust_proxy,
                   "Believe the last entries of X-Forwarded-For and X-Forwarded-Proto: for a service that is reached "
                   "through a proxy alone. Behind TLS its cookie is then Secure");
  add_count(command, "--max-connections", options.lobby.max_connections,
            "Connections open at a time; one that is waited for makes room for a new one");
  add_count(
      command, "--max-connections-per-client", options.lobby.max_connections_per_client,
      "Connections from one address (of IPv6: its /64) at a time; not with --trust-proxy, where all come from the "
      "proxy. 0: any number",
      0);
  add_count(command, "--max-requests", options.workers.threads, "Requests answered at a time");
  add_count(command, "--max-waiting", options.workers.max_waiting,
            "Requests that may wait for their turn, and as many uploads; more are turned away", 0);
  add_count(command, "--max-requests-per-client", options.workers.max_per_client,
            "Requests of one client that are answered or wait, beside streams of events; with --trust-proxy, of one "
            "forwarded address");
  add_count(command, "--max-uploads", options.workers.max_uploads,
            "Requests at a time whose bodies are still to come, of those answered; one client may have half of them");
  add_count(command, "--max-streams", options.dispatcher.max_streams,
            "Streams of events at a time, beside the requests", 0);
  add_count(command, "--max-sessions", access.max_sessions, "Pages signed in at a time; the oldest makes room");
  add_bytes(command, "--max-header-bytes", options.lobby.connection.max_head_bytes, "Head of a request");
  add_bytes(command, "--max-json-bytes", options.dispatcher.max_json_bytes, "JSON body of a request, up to 1MiB")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{proto::JsonLimits().max_bytes}));
  add_bytes(command, "--max-upload-bytes", options.dispatcher.max_upload_bytes, "Uploaded file");
  add_bytes(command, "--max-unsent-bytes", options.lobby.max_unsent_bytes,
            "Answers in memory that clients are slow to take; beyond, who has taken nothing for longest is cut off");
  add_count(command, "--min-bytes-per-second", options.lobby.connection.min_bytes_per_second,
            "Slower clients are cut off, after ten seconds of patience", 0);
}

void add_store_options(CLI::App& command, ServeOptions& options) {
  command.add_option("--data-dir", options.data_dir, "Folder for scenes and edits; nothing is written anywhere else")
      ->required()
      ->type_name("DIR");
  command
      .add_option(
          "--store", options.edits.store,
          "Database for the records of edits, in place of a file in the data folder: "
          "postgresql://USER@HOST/DATABASE. It belongs to this data folder alone. A password is better given by "
          "the environment (PGPASSFILE, PGPASSWORD) than here")
      ->type_name("URL");
  command
      .add_option("--lease-seconds", options.lease_seconds,
                  "With --store: an edit whose service has not been heard of for so long may be taken over")
      ->check(CLI::Range(3, 3600))
      ->type_name("N");
  command.add_option("--scene-root", options.scenes.scene_root, "Folder below which clients may open files by path")
      ->check(CLI::ExistingDirectory)
      ->type_name("DIR");
  command
      .add_option("--model-dir", options.model_dir,
                  "Folder of pre-trained networks, for the corrector sd and the loss lpips")
      ->check(CLI::ExistingDirectory)
      ->type_name("DIR");
  add_bytes(command, "--scene-memory", options.scenes.memory_bytes, "Memory for scenes and previews");
  options.edits.memory_bytes = edits::usual_edit_memory();
  add_bytes(command, "--edit-memory", options.edits.memory_bytes,
            "What one edit may take, by its estimate; usually half of what the machine and its control group have");
  add_seconds(command, "--edit-time", options.edits.longest_seconds,
              "What one edit may take, by its estimate; one that has worked for twice as long ends with the intervals "
              "it has");
  options.work_memory_bytes = edits::usual_work_memory();
  add_bytes(command, "--work-memory", options.work_memory_bytes,
            "What renders, and the reading of uploads, may take together at a time, beside scenes and edits; usually a "
            "quarter of what the machine and its control group have");
  add_count(command, "--max-gaussians", options.scenes.read.max_gaussians, "Gaussians of a scene");
  add_count(command, "--max-scenes", options.scenes.max_scenes, "Scenes held");
  add_count(command, "--max-previews", options.scenes.max_previews, "Previews in memory");
  add_count(command, "--preview-seconds", options.preview_seconds,
            "A preview nobody looks at is forgotten after so long");
  add_bytes(command, "--max-dataset-bytes", options.scenes.max_dataset_bytes, "Dataset, unpacked");
  add_count(command, "--max-dataset-files", options.scenes.max_dataset_files, "Files of a dataset");
  add_count(command, "--max-queued", options.edits.max_queued, "Edits that may wait");
  add_count(command, "--max-edit-records", options.edits.retention.max_count, "Ended edits that are remembered");
  add_count(command, "--edit-attempts", options.edits.attempts,
            "An edit during which the service has died so often in a row, at the same place, has failed");
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

void add_serve_command(CLI::App& program, Action& action) {
  CLI::App* const command = program.add_subcommand("serve", "Serves edits over HTTP, with a page to place points on");
  const auto options = std::make_shared<ServeCommandOptions>();
  add_http_options(*command, options->http, options->access);
  add_store_options(*command, *options);
  command
      ->add_option("--role", options->role,
                   "With --store: a front, which answers requests, or a worker, which carries edits out, of any number "
                   "over one data folder that all of them see; or all of the service, alone")
      ->check(CLI::IsMember({"all", "front", "worker"}))
      ->type_name("ROLE");
  command
      ->add_option(
          "--token-file", options->token_file,
          "File with the token that every request must carry (\"Authorization: Bearer ...\"): one word; or with "
          "several, a line for each: a name, its scopes (read, edit, admin, with commas between several), the secret. "
          "SIGHUP has it read again")
      ->type_name("FILE");
  command
      ->add_option(
          "--audit-log", options->audit_log,
          "File to which a line of JSON is appended for each request that changes something, and for each that "
          "is refused for its token; SIGHUP has it opened again")
      ->type_name("FILE");
  command->add_flag("--insecure", options->insecure, "Listen to other machines without a token");
  add_count(*command, "--drain-seconds", options->drain_seconds,
            "When the service is stopped, a running edit may go on for so long to finish its interval", 0);
  add_count(*command, "--unready-seconds", options->unready_seconds,
            "When the service is stopped, it goes on serving for so long while /readyz says that it ends", 0);
  command->add_option("--log-level", options->log_level, "Least level that is logged")
      ->check(CLI::IsMember({"debug", "info", "warn", "error", "off"}))
      ->type_name("LEVEL");
  command->add_option("--log-format", options->log_format, "For programs (json) or people (text)")
      ->check(CLI::IsMember({"json", "text"}))
      ->type_name("FORMAT");
  add_compute_options(*command, options->compute);
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server::cli
