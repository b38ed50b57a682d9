// splatdrag convert: a scene from one file format to another.
#include <memory>
#include <string>

#include "engine/io/scene_file.h"
#include "server/cli/commands.h"
#include "server/cli/folders.h"
#include "server/cli/scene_writing.h"

namespace server::cli {
namespace {

namespace io = engine::io;
using engine::propagate;

struct ConvertOptions {
  std::string in, out;
  int level = 0;
};

Result<void> run(const ConvertOptions& options, Terminal& terminal) {
  const auto format = io::format_for(options.out);
  if (!format) return propagate(format);
  if (auto safe = keep_input_safe(options.in, options.out); !safe) return safe;
  const io::ReadOptions reading{.level = options.level};
  const auto scene = io::read_scene(options.in, reading);
  if (!scene) return propagate(scene);
  for (const std::string& left_out : scene->origin.left_out) terminal.err << "warning: left out: " << left_out << '\n';
  if (auto written = write_and_tell(options.out, *scene, *format, terminal); !written) return written;
  terminal.out << options.out << ": " << scene->cloud.size() << " Gaussians\n";
  return {};
}

}  // namespace

void add_convert_command(CLI::App& program, Action& action) {
  CLI::App* const command = program.add_subcommand("convert", "Converts a scene to another file format");
  const auto options = std::make_shared<ConvertOptions>();
  command
      ->add_option(
          "--in", options->in,
          "Scene: .ply (also compressed), .splat, .spz, .sog or .glb, by content; also the folder of a SOG scene")
      ->required()
      ->type_name("FILE");
  command
      ->add_option("--out", options->out,
                   "File to write, by extension: .ply keeps everything, .glb all but further properties; .spz, .sog, "
                   ".compressed.ply and .splat round")
      ->required()
      ->type_name("FILE");
  command->add_option("--level", options->level, "Of detail, of a streamed SOG scene: 0 is the finest")
      ->check(CLI::NonNegativeNumber);
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server::cli
