// splatdrag admin: looks after a service's data folder while no service is at work on it.
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>

#include "server/cli/commands.h"
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

Result<void> check(const fs::path& folder, Terminal& terminal) {
  if (auto exists = check_is_folder(folder); !exists) return exists;
  const auto scenes = scenes::check_store(folder / "scenes");
  if (!scenes) return tl::make_unexpected(in_use(scenes.error()));
  const auto edits = edits::check_records(folder / "edits");
  if (!edits) return propagate(edits);
  for (const auto* damaged : {&scenes->damaged, &edits->damaged})
    for (const Error& damage : *damaged) terminal.out << damage.where << ": " << damage.message << '\n';
  for (const std::string& file : scenes->unchecked)
    terminal.out << file << ": has no checksum yet, it gets one when it is read\n";
  const std::size_t files = scenes->files + edits->files, count = scenes->damaged.size() + edits->damaged.size();
  terminal.out << files << " files, " << count << " damaged, " << scenes->unchecked.size() << " without checksum\n";
  if (count == 0) return {};
  return fail(ErrorCode::corrupt_data, std::to_string(count) + " damaged or lost: see above", folder.string());
}

Result<void> rebuild(const fs::path& folder, Terminal& terminal) {
  if (auto exists = check_is_folder(folder); !exists) return exists;
  const auto scenes = scenes::SceneStore::open({.folder = folder / "scenes", .scene_root = {}});
  if (!scenes) return tl::make_unexpected(in_use(scenes.error()));
  const auto rebuilt = edits::rebuild_records(**scenes, folder / "edits");
  if (!rebuilt) return propagate(rebuilt);
  for (const fs::path& file : rebuilt->moved_away) terminal.out << "what was there is now " << file.string() << '\n';
  for (const Error& finding : rebuilt->findings) terminal.out << finding.message << '\n';
  return {};
}

void add(CLI::App& admin, const std::string& name, const std::string& description,
         Result<void> (*run)(const fs::path&, Terminal&), Action& action) {
  CLI::App* const command = admin.add_subcommand(name, description);
  const auto folder = std::make_shared<fs::path>();
  command->add_option("--data-dir,--data", *folder, "Data folder of the service, which does not run meanwhile")
      ->required()
      ->type_name("DIR");
  command->callback([folder, run, &action] { action = [=](Terminal& terminal) { return run(*folder, terminal); }; });
}

}  // namespace

void add_admin_command(CLI::App& program, Action& action) {
  CLI::App* const admin = program.add_subcommand("admin", "Checks and mends the data folder of a service");
  admin->require_subcommand(1);
  add(*admin, "check", "Reads all that is stored and names what is damaged or lost; changes nothing", check, action);
  add(*admin, "rebuild", "Makes the records of edits again from the notes beside them; what was there is kept aside",
      rebuild, action);
}

}  // namespace server::cli
