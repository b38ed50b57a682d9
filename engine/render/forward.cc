#include "engine/render/forward.h"

#include <hwy/targets.h>

#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/render/reference/forward_reference.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

/// Gives a picture its shape; memory of the right size is kept. Only parts that nobody writes need to be zero.
void shape(scene::Image& image, bool wanted, int width, int height, int channels, bool zero) {
  if (!wanted) {
    image = {};
  } else if (image.width != width || image.height != height || image.channels != channels) {
    image = scene::Image(width, height, channels);
  } else if (zero) {
    std::fill(image.data.begin(), image.data.end(), 0.0f);
  }
}

void shape(const ForwardOptions& options, bool weighted, int width, int height, Rendering& out) {
  const bool zero = !options.tiles.empty();
  shape(out.alpha, true, width, height, 1, zero);
  shape(out.color, options.color, width, height, 3, zero);
  shape(out.depth, options.depth, width, height, 1, zero);
  shape(out.median_depth, options.depth, width, height, 1, zero);
  shape(out.weight, weighted, width, height, 1, zero);
}

/// Copies the pixels of a finished tile that lie within `area` to the pictures, whose first pixel is area's.
void store_tile(const TilePixels& tile, int x0, int y0, scene::Rect area, Rendering& out) {
  const scene::Rect part = part_of_tile(x0, y0, area);
  auto store = [&](const float* from, scene::Image& image, int channel = 0) {
    if (image.channels == 0) return;
    copy_tile_plane(from, part, image.plane(channel).data() + place_in(area, x0 + part.x0, y0 + part.y0), area.width());
  };
  store(tile.alpha, out.alpha);
  store(tile.red, out.color, 0);
  store(tile.green, out.color, 1);
  store(tile.blue, out.color, 2);
  store(tile.depth, out.depth);
  store(tile.median_depth, out.median_depth);
  store(tile.weight, out.weight);
}

/// Blends the colours of tinted rows among the projected splats.
void apply(const Tint& tint, ForwardBuffers& buffers) {
  if (tint.rows.empty()) return;
  const float kept = 1 - tint.strength;
  const Vec3 added = tint.strength * tint.color;
  parallel_for(buffers.block_sizes.size(), 16, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b)
      for (std::size_t i = b * project_block; i < b * project_block + buffers.block_sizes[b]; ++i) {
        Splat& splat = buffers.splats[i];
        if (tint.rows[splat.row] == 0) continue;
        splat.red = kept * splat.red + added.x;
        splat.green = kept * splat.green + added.y;
        splat.blue = kept * splat.blue + added.z;
      }
  });
}

void forward_simd(const Layers& layers, const scene::Camera& camera, const ForwardOptions& options,
                  std::span<const float> weight, ForwardBuffers& buffers, Rendering& out) {
  TileGrid grid{.columns = tile_columns(camera.width),
                .rows = tile_rows(camera.height),
                .pixels = rect_of(options, camera),
                .wanted = {}};
  std::vector<std::uint32_t> tiles = options.tiles;
  if (!tiles.empty()) {
    grid.wanted.assign(std::size_t(grid.columns) * std::size_t(grid.rows), 0);
    for (const std::uint32_t tile : tiles) grid.wanted[tile] = 1;
  } else {
    for (int ty = grid.pixels.y0 / tile_size; ty * tile_size < grid.pixels.y1; ++ty)
      for (int tx = grid.pixels.x0 / tile_size; tx * tile_size < grid.pixels.x1; ++tx)
        tiles.push_back(std::uint32_t(ty * grid.columns + tx));
  }

  const auto view = view_params<float>(camera);
  const int sh_degree = options.color ? std::min(layers.base->sh_degree, options.max_sh_degree) : -1;
  // Where a tenth of the picture or less is wanted, most splats are elsewhere.
  const double part = double(grid.pixels.width()) * grid.pixels.height() / (double(camera.width) * camera.height);
  project(layers, view, sh_degree, weight, part < 0.1 ? Culling::by_bound : Culling::exact, grid.pixels, buffers);
  if (options.color) apply(options.tint, buffers);
  sort_by_depth(buffers);
  bin(grid, buffers);

  shape(options, !weight.empty(), grid.pixels.width(), grid.pixels.height(), out);
  const Channels channels{.color = options.color, .depth = options.depth, .weight = !weight.empty()};
  parallel_for(tiles.size(), 1, [&](std::size_t begin, std::size_t end) {
    TilePixels pixels;
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t tile = tiles[i];
      const std::uint32_t first = buffers.tile_begin[tile], last = buffers.tile_begin[tile + 1];
      const TilePlace place = place_of(tile, grid.columns, grid.pixels);
      composite_tile(buffers.splats.data(), {buffers.entries.data() + first, last - first}, place, channels,
                     options.background, pixels);
      store_tile(pixels, place.x0, place.y0, grid.pixels, out);
    }
  });
}

/// Copies `area` of a whole plane, or only the wanted tiles of it.
void copy_wanted(const std::vector<float>& from, int width, const ForwardOptions& options, scene::Rect area,
                 std::span<float> to) {
  std::vector<std::uint8_t> wanted;
  const int columns = tile_columns(width);
  if (!options.tiles.empty()) {
    wanted.assign(std::size_t(columns) * std::size_t(tile_rows(area.y1)), 0);
    for (const std::uint32_t tile : options.tiles) wanted[tile] = 1;
  }
  for (int y = area.y0; y < area.y1; ++y)
    for (int x = area.x0; x < area.x1; ++x)
      if (wanted.empty() || wanted[std::size_t(y / tile_size * columns + x / tile_size)])
        to[std::size_t(y - area.y0) * std::size_t(area.width()) + std::size_t(x - area.x0)] =
            from[std::size_t(y) * std::size_t(width) + std::size_t(x)];
}

void forward_scalar(const Layers& layers, const scene::Camera& camera, const ForwardOptions& options,
                    std::span<const float> weight, Rendering& out) {
  const auto whole = forward_reference<float>(layers, camera, options, weight);
  const scene::Rect area = rect_of(options, camera);
  shape(options, !weight.empty(), area.width(), area.height(), out);
  auto copy = [&](const std::vector<float>& from, scene::Image& to, int plane = 0) {
    if (to.channels != 0) copy_wanted(from, camera.width, options, area, to.plane(plane));
  };
  for (int c = 0; c < 3; ++c) copy(whole.color[std::size_t(c)], out.color, c);
  copy(whole.alpha, out.alpha);
  copy(whole.depth, out.depth);
  copy(whole.median_depth, out.median_depth);
  copy(whole.weight, out.weight);
}

}  // namespace

Workspace::Workspace() : impl_(std::make_unique<Impl>()) {}
Workspace::~Workspace() = default;
Workspace::Workspace(Workspace&&) noexcept = default;
Workspace& Workspace::operator=(Workspace&&) noexcept = default;

void forward(const Layers& layers, const scene::Camera& camera, const ForwardOptions& options,
             std::span<const float> weight, Workspace& workspace, Rendering& out) {
  assert(scene::validate(camera));
  assert(weight.empty() || weight.size() == layers.size());
  assert(options.tint.rows.empty() || options.tint.rows.size() == layers.size());
  assert(options.tiles.empty() || !options.rect);
  assert(options.semantics == Semantics::dense_stop || options.backend == Backend::reference);
  if (options.backend == Backend::reference) {
    forward_scalar(layers, camera, options, weight, out);
  } else {
    forward_simd(layers, camera, options, weight, workspace.impl_->buffers, out);
  }
}

Rendering forward(const Layers& layers, const scene::Camera& camera, const ForwardOptions& options,
                  std::span<const float> weight) {
  Workspace workspace;
  Rendering out;
  forward(layers, camera, options, weight, workspace, out);
  return out;
}

namespace {

/// Targets that are compiled in, supported and not excluded by a pin.
std::vector<std::int64_t> supported_targets() {
  // Asking Highway 1.0 resets its choice to everything the processor has, pinned or not: put ours back.
  const std::int64_t supported = hwy::SupportedTargets();
  hwy::GetChosenTarget().Update(supported);
  std::vector<std::int64_t> bits;  // Highway gives better instruction sets lower bits
  for (std::int64_t rest = supported & HWY_TARGETS; rest != 0; rest &= rest - 1) bits.push_back(rest & -rest);
  return bits;
}

}  // namespace

std::vector<std::string> simd_targets() {
  std::vector<std::string> names;
  for (const std::int64_t target : supported_targets()) names.emplace_back(hwy::TargetName(target));
  return names;
}

std::string simd_target() { return simd_targets().front(); }

Result<void> pin_simd_target(const std::string& name) {
  hwy::DisableTargets(0);
  std::string known;
  for (const std::int64_t target : supported_targets()) {
    if (hwy::TargetName(target) == name) {
      hwy::DisableTargets(~target);
      supported_targets();  // puts the choice into effect
      return {};
    }
    known += std::string(known.empty() ? "" : ", ") + hwy::TargetName(target);
  }
  return fail(ErrorCode::invalid_argument, "instruction set '" + name + "' is not one of this machine's: " + known,
              "simd");
}

}  // namespace engine::render
