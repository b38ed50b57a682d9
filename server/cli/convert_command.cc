// splatdrag convert: a scene from one file format to another.
#include <memory>
#include <string>
#include <vector>

#include "engine/io/scene_file.h"
#include "server/cli/commands.h"
#include "server/cli/folders.h"

namespace server::cli {
namespace {

namespace io = engine::io;
using engine::propagate;

struct ConvertOptions {
  std::string in, out;
};

/// What the format cannot hold of this scene.
std::vector<std::string> losses(const io::SceneFile& scene, io::SceneFormat format) {
  std::vector<std::string> lost;
  if (format == io::SceneFormat::ply) return lost;
  const std::string name = format == io::SceneFormat::splat ? ".splat" : ".spz";
  if (format == io::SceneFormat::splat && scene.cloud.sh_degree > 0)
    lost.push_back(name + " holds no view-dependent colour: SH of degree 1 and up is dropped");
  if (scene.cloud.extra_stride > 0) lost.push_back(name + " holds no further properties: they are dropped");
  lost.push_back(name + " rounds: " +
                 (format == io::SceneFormat::splat ? "colours, opacities and rotations to 8 bits"
                                                   : "positions to 24 bits, all else to 8 bits or so"));
  return lost;
}

Result<void> run(const ConvertOptions& options, Terminal& terminal) {
  const auto format = io::format_for(options.out);
  if (!format) return propagate(format);
  if (auto safe = keep_input_safe(options.in, options.out); !safe) return safe;
  const auto scene = io::read_scene(options.in);
  if (!scene) return propagate(scene);
  for (const std::string& lost : losses(*scene, *format)) terminal.err << "warning: " << lost << '\n';
  if (auto written = io::write_scene(options.out, *scene, *format); !written) return written;
  terminal.out << options.out << ": " << scene->cloud.size() << " Gaussians\n";
  return {};
}

}  // namespace

void add_convert_command(CLI::App& program, Action& action) {
  CLI::App* const command = program.add_subcommand("convert", "Converts a scene to another file format");
  const auto options = std::make_shared<ConvertOptions>();
  command->add_option("--in", options->in, "Scene: .ply (also compressed), .splat or .spz, by content")
      ->required()
      ->type_name("FILE");
  command
      ->add_option("--out", options->out, "File to write, by extension: .ply keeps everything, .spz and .splat round")
      ->required()
      ->type_name("FILE");
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server::cli
