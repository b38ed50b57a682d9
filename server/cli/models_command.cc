// splatdrag models: which pre-trained networks are installed, and where those go that are missing.
#include <filesystem>
#include <memory>
#include <string>

#include "server/cli/commands.h"
#include "server/models/models.h"

namespace server::cli {
namespace {

using engine::ErrorCode;
using engine::fail;

Result<void> run(const std::filesystem::path& folder, Terminal& terminal) {
  const models::Models models(folder);
  std::string missing;
  for (const models::Finding& finding : models.findings()) {
    terminal.out << finding.name << ": " << (finding.usable ? "ready, " : "not usable: ") << finding.message << '\n';
    if (!finding.usable) missing += (missing.empty() ? "" : ", ") + finding.name;
  }
  if (missing.empty()) return {};
  return fail(ErrorCode::not_found, "not all models can be used: " + missing, folder.string());
}

}  // namespace

void add_models_command(CLI::App& program, Action& action) {
  CLI::App* const command =
      program.add_subcommand("models", "Checks the pre-trained networks below a folder, and says what is missing");
  const auto folder = std::make_shared<std::filesystem::path>();
  command->add_option("--model-dir", *folder, "Folder of pre-trained networks: stable-diffusion/, lora/ and lpips/")
      ->required()
      ->check(CLI::ExistingDirectory)
      ->type_name("DIR");
  command->callback([folder, &action] { action = [folder](Terminal& terminal) { return run(*folder, terminal); }; });
}

}  // namespace server::cli
