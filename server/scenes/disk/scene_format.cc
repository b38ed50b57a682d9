#include "server/scenes/disk/scene_format.h"

#include <algorithm>
#include <cstddef>
#include <span>
#include <string_view>

#include "engine/io/checks.h"
#include "engine/io/compressed_ply.h"
#include "engine/io/glb.h"
#include "engine/io/input_file.h"
#include "engine/io/sog.h"
#include "engine/io/splat.h"
#include "engine/io/spz.h"
#include "engine/io/zip_archive.h"
#include "engine/scene/overlay.h"

namespace server::scenes {

namespace io = engine::io;
using engine::propagate;

namespace {

bool is_ply(std::span<const std::byte> start) {
  return io::starts_like_ply({reinterpret_cast<const char*>(start.data()), start.size()});
}

std::uint64_t column_bytes(const io::PlyLayout& layout) { return sizeof(io::PlyColumn) * layout.columns.size(); }

std::uint64_t expected_of_ply(const io::InputFile& file) {
  const auto header = io::read_ply_header(file);
  if (!header || !io::element_offsets(*header, file)) return 0;  // counts that the file bears out, or none
  if (io::is_compressed_ply(*header)) {
    const auto* const sh = header->find("sh");
    const std::uint64_t values = sh ? sh->properties.size() : 0;
    const std::uint64_t row = io::cloud_row_bytes(0) + sizeof(float) * values;
    return header->find("vertex")->count * row + file.size() +
           column_bytes(io::inria_layout(engine::scene::max_sh_degree));
  }
  const auto layout = io::make_layout(*header, file.name());
  if (!layout) return 0;
  const auto& vertex = layout->vertex();
  return vertex.count * (io::cloud_row_bytes(layout->sh_degree) + layout->extra_stride) + column_bytes(*layout) +
         (file.size() - vertex.count * vertex.stride);
}

}  // namespace

std::uint64_t expected_memory_bytes(const std::filesystem::path& path, const io::ReadOptions& options) {
  const auto file = io::InputFile::open(path);
  if (!file) return 0;
  const auto start = file->read_at(0, std::min<std::uint64_t>(file->size(), 64));
  if (!start) return 0;
  if (is_ply(*start)) return expected_of_ply(*file);
  if (io::looks_like_spz(*start)) {
    const auto more = file->read_at(0, std::min<std::uint64_t>(file->size(), 4096));
    return more ? io::expected_spz_bytes(*more, file->size()) + column_bytes(io::inria_layout(3)) : 0;
  }
  if (const bool glb = io::looks_like_glb(*start); glb || io::looks_like_zip(*start)) {
    const auto expected = io::within_memory(file->name(), [&]() -> Result<std::uint64_t> {
      const auto lent = engine::take_from(options.memory, file->size(), file->name());
      if (!lent) return propagate(lent);
      const auto whole = file->read_at(0, file->size());
      if (!whole) return propagate(whole);
      return glb ? io::expected_glb_bytes(*whole, options) : io::expected_sog_bytes(*whole, options);
    });
    return expected ? *expected + column_bytes(io::inria_layout(3)) : 0;
  }
  return file->size() / io::splat_record_bytes * io::cloud_row_bytes(0) + file->size() +
         column_bytes(io::inria_layout(0));
}

std::uint64_t memory_bytes(const io::SceneFile& file) {
  const io::PlyLayout& layout = file.layout;
  return engine::scene::memory_bytes(file.cloud) + layout.before.size() + layout.after.size() + column_bytes(layout);
}

}  // namespace server::scenes
