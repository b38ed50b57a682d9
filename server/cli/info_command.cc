// splatdrag info: what is in a scene file and its dataset.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/io/dataset.h"
#include "engine/io/scene_file.h"
#include "engine/render/project.h"
#include "proto/json_text.h"
#include "server/cli/commands.h"

namespace server::cli {
namespace {

namespace io = engine::io;
namespace scene = engine::scene;
using engine::propagate;
using nlohmann::ordered_json;

struct InfoOptions {
  std::string scene, dataset;
  bool json = false;
  int level = 0;
};

constexpr std::array quantiles{0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0};

ordered_json quantiles_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  ordered_json out = ordered_json::array();
  for (const double q : quantiles) out.push_back(values[std::size_t(std::llround(q * double(values.size() - 1)))]);
  return out;
}

/// What rows hold beside the Gaussian; the other formats have no room for it, and a layout only for when they become a
/// .ply file.
std::vector<std::string> extra_properties(const io::PlyLayout& layout, io::SceneFormat format) {
  std::vector<std::string> names;
  if (format != io::SceneFormat::ply) return names;
  for (const io::PlyProperty& property : layout.vertex().properties)
    if (!io::field_named(property.name)) names.push_back(property.name);
  return names;
}

/// "0xADBE0002" for each record of an .spz file that is kept unread.
std::vector<std::string> extension_types(const io::SceneOrigin& origin) {
  std::vector<std::string> types;
  for (const io::SpzExtension& extension : origin.spz_extensions) {
    std::array<char, 16> text{};
    std::snprintf(text.data(), text.size(), "0x%08X", unsigned(extension.type));
    types.emplace_back(text.data());
  }
  return types;
}

std::size_t memory_bytes(const scene::GaussianCloud& cloud) {
  constexpr std::size_t floats_beside_sh = 3 + 3 + 4 + 1;
  return cloud.size() * ((floats_beside_sh + cloud.sh_stride()) * sizeof(float) + cloud.extra_stride);
}

/// Others call the second format by two words, and so does this program since its beginning.
std::string format_name(io::SceneFormat format) {
  return format == io::SceneFormat::compressed_ply ? "compressed ply" : std::string(engine::name_of(format));
}

ordered_json describe(const io::SceneFile& file) {
  const scene::GaussianCloud& cloud = file.cloud;
  std::vector<double> opacity, sigma;
  opacity.reserve(cloud.size());
  sigma.reserve(3 * cloud.size());
  for (const float logit : cloud.opacity_logit) opacity.push_back(engine::render::opacity<double>(logit));
  for (const auto* axis : {&cloud.log_scale.x, &cloud.log_scale.y, &cloud.log_scale.z})
    for (const float log_scale : *axis) sigma.push_back(std::exp(double(log_scale)));
  const scene::Bounds bounds = scene::bounds(cloud);
  return {
      {"format", format_name(file.origin.format)},
      {"version", file.origin.version},
      {"axes", {{"stored", file.origin.axes}, {"declared", file.origin.axes_declared}, {"read_as", "RDF"}}},
      {"compression", file.origin.packing.empty() ? "none" : file.origin.packing},
      {"gaussians", cloud.size()},
      {"sh_degree", cloud.sh_degree},
      {"bounds",
       {{"low", {bounds.low.x, bounds.low.y, bounds.low.z}}, {"high", {bounds.high.x, bounds.high.y, bounds.high.z}}}},
      {"memory_bytes", memory_bytes(cloud)},
      {"quantiles", quantiles},
      {"opacity", quantiles_of(std::move(opacity))},
      {"sigma", quantiles_of(std::move(sigma))},
      {"extra_properties", extra_properties(file.layout, file.origin.format)},
      {"antialiased", file.origin.antialiased},
      {"spz_extensions", extension_types(file.origin)},
      {"left_out", file.origin.left_out}};
}

ordered_json describe(const io::Dataset& dataset) {
  ordered_json views = ordered_json::array();
  for (const io::View& view : dataset.views)
    views.push_back({{"name", view.camera.name},
                     {"width", view.camera.width},
                     {"height", view.camera.height},
                     {"photo", !view.photo.empty()}});
  return {{"kind", dataset.kind}, {"points", dataset.points.size()}, {"views", std::move(views)}};
}

void print(std::ostream& out, const std::string& label, const ordered_json& values) {
  out << label;
  for (const ordered_json& value : values) out << "  " << value.get<double>();
  out << '\n';
}

void print_scene(std::ostream& out, const ordered_json& info) {
  const int version = info["version"].get<int>();
  out << "format       " << info["format"].get<std::string>() << (version > 0 ? " " + std::to_string(version) : "")
      << '\n'
      << "axes         " << info["axes"]["stored"].get<std::string>()
      << (info["axes"]["declared"].get<bool>() ? ", as the file declares" : ", as the format has them")
      << "; read as RDF\n"
      << "compression  " << info["compression"].get<std::string>() << '\n'
      << "Gaussians    " << info["gaussians"] << '\n'
      << "SH degree    " << info["sh_degree"] << '\n'
      << "memory       " << std::round(info["memory_bytes"].get<double>() / 1e5) / 10 << " MB\n";
  print(out, "lowest     ", info["bounds"]["low"]);
  print(out, "highest    ", info["bounds"]["high"]);
  print(out, "quantile   ", info["quantiles"]);
  print(out, "opacity    ", info["opacity"]);
  print(out, "sigma      ", info["sigma"]);
  if (!info["extra_properties"].empty()) {
    out << "also holds  ";
    for (const ordered_json& name : info["extra_properties"]) out << ' ' << name.get<std::string>();
    out << '\n';
  }
  for (const ordered_json& type : info["spz_extensions"]) out << "extension    " << type.get<std::string>() << '\n';
  for (const ordered_json& text : info["left_out"]) out << "left out     " << text.get<std::string>() << '\n';
}

void print_dataset(std::ostream& out, const ordered_json& info) {
  out << "dataset      " << info["kind"].get<std::string>() << ", " << info["views"].size() << " views, "
      << info["points"] << " points\n";
  for (const ordered_json& view : info["views"])
    out << "  " << view["name"].get<std::string>() << "  " << view["width"] << " x " << view["height"]
        << (view["photo"].get<bool>() ? "" : "  no photo") << '\n';
}

Result<void> run(const InfoOptions& options, Terminal& terminal) {
  const io::ReadOptions reading{.level = options.level};
  const auto file = io::read_scene(options.scene, reading);
  if (!file) return propagate(file);
  ordered_json info{{"scene", describe(*file)}};
  if (!options.dataset.empty()) {
    const auto dataset = io::read_dataset(options.dataset);
    if (!dataset) return propagate(dataset);
    info["dataset"] = describe(*dataset);
  }
  if (options.json) {
    terminal.out << proto::pretty(info) << '\n';
    return {};
  }
  print_scene(terminal.out, info["scene"]);
  if (info.contains("dataset")) print_dataset(terminal.out, info["dataset"]);
  return {};
}

}  // namespace

void add_info_command(CLI::App& program, Action& action) {
  CLI::App* const command = program.add_subcommand("info", "Says what a scene file holds");
  const auto options = std::make_shared<InfoOptions>();
  command
      ->add_option("--scene", options->scene, "Scene: .ply, .splat, .spz, .sog or .glb, or the folder of a SOG scene")
      ->required()
      ->type_name("FILE");
  command->add_option("--dataset", options->dataset, "Folder with the scene's cameras, to list them, too")
      ->type_name("DIR");
  command->add_option("--level", options->level, "Of detail, of a streamed SOG scene: 0 is the finest")
      ->check(CLI::NonNegativeNumber);
  command->add_flag("--json", options->json, "As JSON, for programs");
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server::cli
