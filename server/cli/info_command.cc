// splatdrag info: what is in a scene file and its dataset.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/io/compressed_ply.h"
#include "engine/io/dataset.h"
#include "engine/io/input_file.h"
#include "engine/io/ply_header.h"
#include "engine/io/scene_file.h"
#include "engine/io/spz.h"
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
};

constexpr std::array quantiles{0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0};

/// Name of the format of a file that io::read_scene() has accepted.
Result<std::string> format_name(const std::string& file) {
  const auto input = io::InputFile::open(file);
  if (!input) return propagate(input);
  const auto start = input->read_at(0, std::min<std::uint64_t>(input->size(), 64));
  if (!start) return propagate(start);
  if (!io::starts_like_ply({reinterpret_cast<const char*>(start->data()), start->size()}))
    return std::string(io::looks_like_spz(*start) ? "spz" : "splat");
  const auto header = io::read_ply_header(*input);
  if (!header) return propagate(header);
  return std::string(io::is_compressed_ply(*header) ? "compressed ply" : "ply");
}

ordered_json quantiles_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  ordered_json out = ordered_json::array();
  for (const double q : quantiles) out.push_back(values[std::size_t(std::llround(q * double(values.size() - 1)))]);
  return out;
}

std::vector<std::string> extra_properties(const io::PlyLayout& layout) {
  std::vector<std::string> names;
  for (const io::PlyProperty& property : layout.vertex().properties)
    if (!io::field_named(property.name)) names.push_back(property.name);
  return names;
}

std::size_t memory_bytes(const scene::GaussianCloud& cloud) {
  constexpr std::size_t floats_beside_sh = 3 + 3 + 4 + 1;
  return cloud.size() * ((floats_beside_sh + cloud.sh_stride()) * sizeof(float) + cloud.extra_stride);
}

ordered_json describe(const io::SceneFile& file, const std::string& format) {
  const scene::GaussianCloud& cloud = file.cloud;
  std::vector<double> opacity, sigma;
  opacity.reserve(cloud.size());
  sigma.reserve(3 * cloud.size());
  for (const float logit : cloud.opacity_logit) opacity.push_back(engine::render::opacity<double>(logit));
  for (const auto* axis : {&cloud.log_scale.x, &cloud.log_scale.y, &cloud.log_scale.z})
    for (const float log_scale : *axis) sigma.push_back(std::exp(double(log_scale)));
  const scene::Bounds bounds = scene::bounds(cloud);
  return {
      {"format", format},
      {"gaussians", cloud.size()},
      {"sh_degree", cloud.sh_degree},
      {"bounds",
       {{"low", {bounds.low.x, bounds.low.y, bounds.low.z}}, {"high", {bounds.high.x, bounds.high.y, bounds.high.z}}}},
      {"memory_bytes", memory_bytes(cloud)},
      {"quantiles", quantiles},
      {"opacity", quantiles_of(std::move(opacity))},
      {"sigma", quantiles_of(std::move(sigma))},
      {"extra_properties", extra_properties(file.layout)}};
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
  out << "format       " << info["format"].get<std::string>() << '\n'
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
}

void print_dataset(std::ostream& out, const ordered_json& info) {
  out << "dataset      " << info["kind"].get<std::string>() << ", " << info["views"].size() << " views, "
      << info["points"] << " points\n";
  for (const ordered_json& view : info["views"])
    out << "  " << view["name"].get<std::string>() << "  " << view["width"] << " x " << view["height"]
        << (view["photo"].get<bool>() ? "" : "  no photo") << '\n';
}

Result<void> run(const InfoOptions& options, Terminal& terminal) {
  const auto file = io::read_scene(options.scene);
  if (!file) return propagate(file);
  const auto format = format_name(options.scene);
  if (!format) return propagate(format);
  ordered_json info{{"scene", describe(*file, *format)}};
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
  command->add_option("--scene", options->scene, "Scene: .ply, .splat or .spz")->required()->type_name("FILE");
  command->add_option("--dataset", options->dataset, "Folder with the scene's cameras, to list them, too")
      ->type_name("DIR");
  command->add_flag("--json", options->json, "As JSON, for programs");
  command->callback([options, &action] { action = [options](Terminal& terminal) { return run(*options, terminal); }; });
}

}  // namespace server::cli
