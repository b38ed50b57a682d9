// splatdrag convert: a scene from one file format to another.
#include <array>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "engine/io/scene_file.h"
#include "engine/io/scene_loss.h"
#include "server/cli/commands.h"
#include "server/cli/folders.h"

namespace server::cli {
namespace {

namespace io = engine::io;
using engine::propagate;

struct ConvertOptions {
  std::string in, out;
  int level = 0;
};

/// What the format cannot hold of this scene at all.
std::vector<std::string> dropped(const io::SceneFile& scene, io::SceneFormat format) {
  std::vector<std::string> lost;
  if (format == io::SceneFormat::ply) return lost;
  const std::string name = "." + std::string(io::extension_of(format));
  if (format == io::SceneFormat::splat && scene.cloud.sh_degree > 0)
    lost.push_back(name + " holds no view-dependent colour: SH of degree 1 and up is dropped");
  if (scene.cloud.extra_stride > 0) lost.push_back(name + " holds no further properties: they are dropped");
  return lost;
}

/// What the origin's file said and the format cannot.
std::vector<std::string> unsaid(const io::SceneOrigin& origin, io::SceneFormat format) {
  std::vector<std::string> lost;
  if (!origin.spz_extensions.empty() && format != io::SceneFormat::spz)
    lost.push_back(std::to_string(origin.spz_extensions.size()) + " extensions of the .spz file are dropped");
  if (origin.antialiased && format != io::SceneFormat::spz && format != io::SceneFormat::sog)
    lost.push_back("that the scene was trained with anti-aliasing is dropped");
  return lost;
}

/// Of values beyond what the format has room for.
std::string clipped_in_numbers(const io::AttributeLoss& loss) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.2g %% of them, by %.3g at most", 100 * loss.clipped_part,
                loss.most_clipped);
  return text.data();
}

std::string in_numbers(const io::AttributeLoss& loss) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.3g at most, %.2g on average", loss.largest, loss.mean);
  return text.data();
}

Result<void> run(const ConvertOptions& options, Terminal& terminal) {
  const auto format = io::format_for(options.out);
  if (!format) return propagate(format);
  if (auto safe = keep_input_safe(options.in, options.out); !safe) return safe;
  const io::ReadOptions reading{.level = options.level};
  const auto scene = io::read_scene(options.in, reading);
  if (!scene) return propagate(scene);
  const auto warn = [&](const std::string& lost) { terminal.err << "warning: " << lost << '\n'; };
  for (const std::string& left_out : scene->origin.left_out) warn("left out: " + left_out);
  for (const std::string& lost : dropped(*scene, *format)) warn(lost);
  for (const std::string& lost : unsaid(scene->origin, *format)) warn(lost);
  if (auto written = io::write_scene(options.out, *scene, *format); !written) return written;
  if (*format != io::SceneFormat::ply) {
    // What was written is read again: no formula, but what a reader will find.
    const auto back = io::read_scene(options.out);
    if (!back) return propagate(back);
    const std::string extension = "." + std::string(io::extension_of(*format));
    for (const io::AttributeLoss& loss : io::scene_loss(*scene, *back, *format)) {
      if (loss.clipped_part > 0)
        warn(extension + " clips " + loss.attribute + ": " + clipped_in_numbers(loss) + " (" + loss.unit + ")");
      if (loss.largest > 0)
        warn(extension + " rounds " + loss.attribute + ": " + in_numbers(loss) + " (" + loss.unit + ")");
    }
  }
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
