#include "engine/io/scene_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string>

#include "engine/core/atomic_file.h"
#include "engine/io/checks.h"
#include "engine/io/compressed_ply.h"
#include "engine/io/input_file.h"
#include "engine/io/ply.h"
#include "engine/io/splat.h"
#include "engine/io/spz.h"

namespace engine::io {
namespace {

constexpr std::uint64_t probe_bytes =
    64 * splat_record_bytes;  // enough records for random bytes to give themselves away

using Decode = Result<scene::GaussianCloud> (*)(std::span<const std::byte>, const std::string&, const ReadOptions&);

Result<SceneFile> with_inria_layout(Result<scene::GaussianCloud> cloud) {
  if (!cloud) return propagate(cloud);
  const int sh_degree = cloud->sh_degree;
  return SceneFile{std::move(*cloud), inria_layout(sh_degree)};
}

/// Formats that are decoded from memory.
Result<SceneFile> read_whole(const InputFile& file, const ReadOptions& options, Decode decode) {
  if (file.size() > options.max_memory_bytes)
    return fail(ErrorCode::too_large,
                file.name() + " has " + std::to_string(file.size()) + " bytes; the limit (max_memory_bytes) is " +
                    std::to_string(options.max_memory_bytes),
                file.name());
  const auto bytes = file.read_at(0, file.size());
  if (!bytes) return propagate(bytes);
  return with_inria_layout(decode(*bytes, file.name(), options));
}

Result<SceneFile> read_any_ply(const InputFile& file, const ReadOptions& options) {
  auto header = read_ply_header(file);
  if (!header) return propagate(header);
  if (is_compressed_ply(*header)) return with_inria_layout(read_compressed_ply(file, *header, options));
  return read_ply(file, std::move(*header), options);
}

Result<SceneFile> read_detected(const InputFile& file, const ReadOptions& options) {
  if (file.size() == 0) return fail(ErrorCode::corrupt_data, file.name() + " is empty", file.name());
  const auto start = file.read_at(0, std::min(file.size(), probe_bytes));
  if (!start) return propagate(start);
  if (starts_like_ply({reinterpret_cast<const char*>(start->data()), start->size()}))
    return read_any_ply(file, options);
  if (looks_like_spz(*start)) return read_whole(file, options, decode_spz);
  if (looks_like_splat(*start, file.size())) return read_whole(file, options, decode_splat);
  return fail(ErrorCode::unsupported,
              file.name() + " (" + std::to_string(file.size()) +
                  " bytes) is none of the scene formats known here: 3DGS .ply (binary, also compressed by SuperSplat), "
                  ".spz, and .splat, whose size is a multiple of 32 bytes",
              file.name());
}

}  // namespace

Result<SceneFile> read_scene(const std::filesystem::path& path, const ReadOptions& options) {
  auto file = InputFile::open(path);
  if (!file) return propagate(file);
  file->show_to(options.witness);
  return within_memory(file->name(), [&] { return read_detected(*file, options); });
}

Result<void> write_scene(const std::filesystem::path& path, const SceneFile& scene, SceneFormat format) {
  const std::string name = path.filename().string();
  return within_memory(name, [&]() -> Result<void> {
    if (format == SceneFormat::ply) return write_ply(path, scene.cloud, scene.layout);
    if (auto writable = check_writable(scene.cloud, name); !writable) return writable;
    if (format == SceneFormat::splat) return write_file(path, encode_splat(scene.cloud));
    const auto bytes = encode_spz(scene.cloud, name);
    if (!bytes) return propagate(bytes);
    return write_file(path, *bytes);
  });
}

Result<SceneFormat> format_for(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  if (extension == ".ply") return SceneFormat::ply;
  if (extension == ".splat") return SceneFormat::splat;
  if (extension == ".spz") return SceneFormat::spz;
  return fail(ErrorCode::unsupported,
              "cannot tell the scene format from '" + extension + "'; scenes are written as .ply, .splat or .spz",
              path.filename().string());
}

}  // namespace engine::io
