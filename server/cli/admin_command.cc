// splatdrag admin: looks after a service's data folder while no service is at work on it, and at its queue at any time.
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>

#include "server/cli/commands.h"
#include "server/cli/queue_report.h"
#include "server/edits/operation.h"
#include "server/edits/records.h"
#include "server/scenes/check.h"
#include "server/scenes/scene_store.h"

namespace server::cli {
namespace {

namespace fs = std::filesystem;
using engine::Error;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;

Result<void> check_is_folder(const fs::path& folder) {
  std::error_code error;
  if (fs::is_directory(folder, error)) return {};
  return fail(ErrorCode::not_found, "there is no such folder", folder.string());
}

/// Another service's folder is one that cannot be used now.
Error in_use(Error error) {
  if (error.code == ErrorCode::conflict) error.code = ErrorCode::unavailable;
  return error;
}

struct AdminOptions {
  fs::path folder;
  std::string store;                  ///< rebuild, queue, workers, requeue: as of edits::ServiceOptions.
  bool failed = false, json = false;  ///< queue, workers
  std::string edit;                   ///< requeue
};

Result<void> check(const AdminOptions& options, Terminal& terminal) {
  const fs::path& folder = options.folder;
  if (auto exists = check_is_folder(folder); !exists) return exists;
  const auto scenes = scenes::check_store(folder / "scenes");
  if (!scenes) return tl::make_unexpected(in_use(scenes.error()));
  const auto edits = edits::check_records(folder / "edits");
  if (!edits) return propagate(edits);
  for (const auto* damaged : {&scenes->damaged, &edits->damaged})
    for (const Error& damage : *damaged) terminal.out << damage.where << ": " << damage.message << '\n';
  for (const std::string& file : scenes->unchecked)
    terminal.out << file << ": has no checksum yet, it gets one when it is read\n";
  if (edits->in_database)
    terminal.out << "the records of edits are in a database, which looks after itself: they were not looked at\n";
  const std::size_t files = scenes->files + edits->files, count = scenes->damaged.size() + edits->damaged.size();
  terminal.out << files << " files, " << count << " damaged, " << scenes->unchecked.size() << " without checksum\n";
  if (count == 0) return {};
  return fail(ErrorCode::corrupt_data, std::to_string(count) + " damaged or lost: see above", folder.string());
}

Result<void> rebuild(const AdminOptions& options, Terminal& terminal) {
  const fs::path& folder = options.folder;
  if (auto exists = check_is_folder(folder); !exists) return exists;
  const auto scenes = scenes::SceneStore::open({.folder = folder / "scenes", .scene_root = {}});
  if (!scenes) return tl::make_unexpected(in_use(scenes.error()));
  const auto rebuilt = edits::rebuild_records(**scenes, folder / "edits", options.store);
  if (!rebuilt) return propagate(rebuilt);
  for (const std::string& aside : rebuilt->moved_away) terminal.out << "what was there is now " << aside << '\n';
  for (const Error& finding : rebuilt->findings) terminal.out << finding.message << '\n';
  return {};
}

Result<void> queue(const AdminOptions& options, Terminal& terminal) {
  const auto look = edits::look_at_queue(options.folder / "edits", options.store, options.failed);
  if (!look) return propagate(look);
  terminal.out << (options.json ? queue_json(*look) : queue_table(*look));
  return {};
}

Result<void> workers(const AdminOptions& options, Terminal& terminal) {
  const auto look = edits::look_at_queue(options.folder / "edits", options.store, /*with_failed=*/false);
  if (!look) return propagate(look);
  terminal.out << (options.json ? workers_json(*look) : workers_table(*look));
  return {};
}

Result<void> requeue(const AdminOptions& options, Terminal& terminal) {
  const auto edit = edits::requeue_edit(options.folder / "edits", options.store, options.edit);
  if (!edit) return propagate(edit);
  const edits::QueueLook look{{*edit}, std::nullopt};
  if (options.json) {
    terminal.out << queue_json(look);
  } else {
    terminal.out << edit->id << " is queued again, "
                 << (edit->finished_intervals == 0
                         ? "from the start"
                         : "after interval " + std::to_string(edit->finished_intervals) + ", from its checkpoint")
                 << '\n';
  }
  return {};
}

std::shared_ptr<AdminOptions> add(
    CLI::App& admin, const std::string& name, const std::string& description,
    Result<void> (*run)(const AdminOptions&, Terminal&), Action& action,
    const std::string& whose = "Data folder of the service, which does not run meanwhile") {
  CLI::App* const command = admin.add_subcommand(name, description);
  const auto options = std::make_shared<AdminOptions>();
  command->add_option("--data-dir,--data", options->folder, whose)->required()->type_name("DIR");
  command->callback([options, run, &action] { action = [=](Terminal& terminal) { return run(*options, terminal); }; });
  return options;
}

/// Those that ask of the queue, whoever is at work on it.
void add_queue_commands(CLI::App& admin, Action& action) {
  const std::string whose = "Data folder of the service";
  const auto add_common = [&](const std::string& name, const std::shared_ptr<AdminOptions>& options) {
    CLI::App* const command = admin.get_subcommand(name);
    command
        ->add_option("--store", options->store,
                     "Database with the records of edits, where the service has them in one (--store there)")
        ->type_name("URL");
    command->add_flag("--json", options->json, "JSON in place of a table");
    return command;
  };
  auto options = add(admin, "queue", "Lists the edits that wait or run: in which order, how old, with what deaths",
                     queue, action, whose);
  add_common("queue", options)
      ->add_flag("--failed", options->failed, "Lists the edits on record that have failed, too");
  add_common("workers",
             add(admin, "workers", "Lists who works on which edit, since when, and until when the claim lasts", workers,
                 action, whose));
  options =
      add(admin, "requeue", "Has an edit that failed taken up again, from its last checkpoint, if that is still there",
          requeue, action, whose);
  add_common("requeue", options)->add_option("EDIT", options->edit, "Its id: e000012")->required();
}

}  // namespace

void add_admin_command(CLI::App& program, Action& action) {
  CLI::App* const admin =
      program.add_subcommand("admin", "Checks and mends the data folder of a service, and looks at its queue");
  admin->require_subcommand(1);
  add(*admin, "check", "Reads all that is stored and names what is damaged or lost; changes nothing", check, action);
  const auto options =
      add(*admin, "rebuild",
          "Makes the records of edits again from the notes beside them; what was there is kept aside", rebuild, action);
  admin->get_subcommand("rebuild")
      ->add_option(
          "--store", options->store,
          "Makes them in this database (postgresql://USER@HOST/DATABASE), where they are from then on; without "
          "it, in a file of the data folder")
      ->type_name("URL");
  add_queue_commands(*admin, action);
}

}  // namespace server::cli
