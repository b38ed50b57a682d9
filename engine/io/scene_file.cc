#include "engine/io/scene_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <numeric>
#include <optional>
#include <string>

#include "engine/core/atomic_file.h"
#include "engine/io/checks.h"
#include "engine/io/compressed_ply.h"
#include "engine/io/glb.h"
#include "engine/io/input_file.h"
#include "engine/io/ply.h"
#include "engine/io/sog.h"
#include "engine/io/splat.h"
#include "engine/io/spz.h"
#include "engine/io/zip_archive.h"

namespace engine::io {
namespace {

constexpr std::uint64_t probe_bytes =
    64 * splat_record_bytes;  // enough records for random bytes to give themselves away

using Decode = Result<DecodedScene> (*)(std::span<const std::byte>, const std::string&, const ReadOptions&);

Result<SceneFile> with_inria_layout(Result<DecodedScene> scene) {
  if (!scene) return propagate(scene);
  const int sh_degree = scene->cloud.sh_degree;
  return SceneFile{std::move(scene->cloud), inria_layout(sh_degree), std::move(scene->origin)};
}

/// Of a format that holds nothing but Gaussians.
Result<DecodedScene> with_origin(Result<scene::GaussianCloud> cloud, SceneFormat format, const char* packing) {
  if (!cloud) return propagate(cloud);
  DecodedScene scene{std::move(*cloud), {}};
  scene.origin.format = format;
  scene.origin.packing = packing;
  return scene;
}

Result<DecodedScene> decode_splat_scene(std::span<const std::byte> bytes, const std::string& file,
                                        const ReadOptions& options) {
  return with_origin(decode_splat(bytes, file, options), SceneFormat::splat, "bytes");
}

/// Formats that are decoded from memory.
Result<SceneFile> read_whole(const InputFile& file, const ReadOptions& options, Decode decode) {
  if (file.size() > options.max_memory_bytes)
    return fail(ErrorCode::too_large,
                file.name() + " has " + std::to_string(file.size()) + " bytes; the limit (max_memory_bytes) is " +
                    std::to_string(options.max_memory_bytes),
                file.name());
  const auto lent = take_from(options.memory, file.size(), file.name());
  if (!lent) return propagate(lent);
  const auto bytes = file.read_at(0, file.size());
  if (!bytes) return propagate(bytes);
  return with_inria_layout(decode(*bytes, file.name(), options));
}

Result<SceneFile> read_any_ply(const InputFile& file, const ReadOptions& options) {
  auto header = read_ply_header(file);
  if (!header) return propagate(header);
  if (is_compressed_ply(*header))
    return with_inria_layout(with_origin(read_compressed_ply(file, *header, options), SceneFormat::compressed_ply,
                                         "bits, in chunks of 256 with a range each"));
  return read_ply(file, std::move(*header), options);
}

enum class Kind { ply, spz, glb, zip, splat, other };

Kind kind_of(std::span<const std::byte> start, std::uint64_t size) {
  if (starts_like_ply({reinterpret_cast<const char*>(start.data()), start.size()})) return Kind::ply;
  if (looks_like_spz(start)) return Kind::spz;
  if (looks_like_glb(start)) return Kind::glb;
  if (looks_like_zip(start)) return Kind::zip;
  if (looks_like_splat(start, size)) return Kind::splat;
  return Kind::other;
}

Result<SceneFile> read_detected(const InputFile& file, const ReadOptions& options) {
  if (file.size() == 0) return fail(ErrorCode::corrupt_data, file.name() + " is empty", file.name());
  const auto start = file.read_at(0, std::min(file.size(), probe_bytes));
  if (!start) return propagate(start);
  switch (kind_of(*start, file.size())) {
    case Kind::ply:
      return read_any_ply(file, options);
    case Kind::spz:
      return read_whole(file, options, decode_spz);
    case Kind::glb:
      return read_whole(file, options, decode_glb);
    case Kind::zip:
      return read_whole(file, options, decode_sog);
    case Kind::splat:
      return read_whole(file, options, decode_splat_scene);
    case Kind::other:
      break;
  }
  return fail(ErrorCode::unsupported,
              file.name() + " (" + std::to_string(file.size()) +
                  " bytes) is none of the scene formats known here: 3DGS .ply (binary, also compressed by SuperSplat), "
                  ".spz, .sog, .glb, and .splat, whose size is a multiple of 32 bytes",
              file.name());
}

/// The folder that a path means if it means a SOG scene in a folder: itself, or that of its meta.json.
std::optional<std::filesystem::path> sog_folder(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return path;
  const auto name = path.filename();
  if (name != "meta.json" && name != "lod-meta.json") return std::nullopt;
  return path.has_parent_path() ? path.parent_path() : ".";
}

/// What a scene's .spz file says beside its Gaussians: what the one it came from said. Version 4 for all that does not
/// come from an older one: only that says what its axes are.
SpzOptions spz_options(const SceneOrigin& origin) {
  SpzOptions options;
  options.antialiased = origin.antialiased;
  if (origin.format != SceneFormat::spz) return options;
  options.version = origin.version == 4 ? 4 : 3;
  options.axes = origin.axes;
  options.extensions = origin.spz_extensions;
  return options;
}

}  // namespace

Result<SceneFile> read_scene(const std::filesystem::path& path, const ReadOptions& options) {
  if (const auto folder = sog_folder(path))
    return within_memory(folder->filename().string(),
                         [&] { return with_inria_layout(read_sog_folder(*folder, options)); });
  auto file = InputFile::open(path);
  if (!file) return propagate(file);
  file->show_to(options.witness);
  return within_memory(file->name(), [&] { return read_detected(*file, options); });
}

Result<SceneFormat> detect_format(const std::filesystem::path& path) {
  if (sog_folder(path)) return SceneFormat::sog;
  const auto file = InputFile::open(path);
  if (!file) return propagate(file);
  const auto start = file->read_at(0, std::min(file->size(), probe_bytes));
  if (!start) return propagate(start);
  switch (kind_of(*start, file->size())) {
    case Kind::ply: {
      const auto header = read_ply_header(*file);
      if (!header) return propagate(header);
      return is_compressed_ply(*header) ? SceneFormat::compressed_ply : SceneFormat::ply;
    }
    case Kind::spz:
      return SceneFormat::spz;
    case Kind::glb:
      return SceneFormat::glb;
    case Kind::zip:
      return SceneFormat::sog;
    default:
      return SceneFormat::splat;
  }
}

std::vector<std::uint32_t> written_order(const SceneFile& scene, SceneFormat format) {
  // A compressed .ply lives of neighbours in one chunk. One that comes from such a file has them there already, and in
  // the order of the file it gives the same bytes again.
  const bool by_place = format == SceneFormat::sog ||
                        (format == SceneFormat::compressed_ply && scene.origin.format != SceneFormat::compressed_ply);
  if (by_place) return sog_order(scene.cloud);
  std::vector<std::uint32_t> order(scene.cloud.size());
  std::iota(order.begin(), order.end(), 0u);
  return order;
}

Result<void> write_scene(const std::filesystem::path& path, const SceneFile& scene, SceneFormat format) {
  const std::string name = path.filename().string();
  return within_memory(name, [&]() -> Result<void> {
    if (format == SceneFormat::ply) return write_ply(path, scene.cloud, scene.layout);
    if (auto writable = check_writable(scene.cloud, name); !writable) return writable;
    const auto write = [&](const Result<std::vector<std::byte>>& bytes) -> Result<void> {
      if (!bytes) return propagate(bytes);
      return write_file(path, *bytes);
    };
    switch (format) {
      case SceneFormat::compressed_ply:
        return write(encode_compressed_ply(scene.cloud, written_order(scene, format)));
      case SceneFormat::splat:
        return write(encode_splat(scene.cloud));
      case SceneFormat::sog:
        return write(encode_sog(scene.cloud, scene.origin.antialiased, name));
      case SceneFormat::glb:
        return write(encode_glb(scene.cloud, name));
      default:
        return write(encode_spz(scene.cloud, name, spz_options(scene.origin)));
    }
  });
}

Result<SceneFormat> format_for(const std::filesystem::path& path) {
  std::string name = path.filename().string();
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  if (name.ends_with(".compressed.ply")) return SceneFormat::compressed_ply;
  for (const auto& [format, text] : names<SceneFormat>)
    if (name.ends_with("." + std::string(extension_of(format)))) return format;
  return fail(ErrorCode::unsupported,
              "cannot tell the scene format from '" + path.extension().string() +
                  "'; scenes are written as .ply, .compressed.ply, .splat, .spz, .sog or .glb",
              path.filename().string());
}

}  // namespace engine::io
