#include "engine/render/frozen_view.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <new>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/render/backward_stages.h"
#include "engine/render/color_tiles.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

[[maybe_unused]] bool contains(scene::Rect outer, scene::Rect inner) {
  return inner.empty() ||
         (inner.x0 >= outer.x0 && inner.y0 >= outer.y0 && inner.x1 <= outer.x1 && inner.y1 <= outer.y1);
}

}  // namespace

scene::Rect whole_tiles(scene::Rect rect, const scene::Camera& camera) {
  if (rect.empty()) return {};
  const auto down = [](int pixel) { return std::max(pixel, 0) / tile_size * tile_size; };
  const auto up = [](int pixel, int limit) { return std::min((pixel + tile_size - 1) / tile_size * tile_size, limit); };
  return {down(rect.x0), down(rect.y0), up(rect.x1, camera.width), up(rect.y1, camera.height)};
}

struct FrozenView::Impl {
  scene::Camera camera;
  scene::Rect region;
  Vec3 background;
  int columns = 0;                        ///< Tiles across the whole picture.
  std::vector<Splat> splats;              ///< Those that reach the region, by depth.
  std::vector<std::uint32_t> tile_begin;  ///< [tiles of the picture + 1] into entries
  std::vector<std::uint32_t> entries;     ///< Indices into splats.
  scene::Image color;

  [[nodiscard]] std::span<const std::uint32_t> list(std::size_t tile) const {
    return std::span(entries).subspan(tile_begin[tile], tile_begin[tile + 1] - tile_begin[tile]);
  }
};

namespace {

/// The tiles of a region of whole tiles, ascending.
std::vector<std::uint32_t> tiles_of(scene::Rect region, int columns) {
  std::vector<std::uint32_t> tiles;
  for (int y = region.y0; y < region.y1; y += tile_size)
    for (int x = region.x0; x < region.x1; x += tile_size)
      tiles.push_back(std::uint32_t(y / tile_size * columns + x / tile_size));
  return tiles;
}

}  // namespace

FrozenView::FrozenView(const Layers& frozen, const scene::Camera& camera, scene::Rect region, Vec3 background)
    : impl_(std::make_unique<Impl>()) {
  assert(scene::validate(camera) && !region.empty() && whole_tiles(region, camera) == region);
  Impl& view = *impl_;
  view.camera = camera, view.region = region, view.background = background, view.columns = tile_columns(camera.width);
  restore(frozen);
  view.color = scene::Image(region.width(), region.height(), 3);
  const std::vector<std::uint32_t> tiles = tiles_of(region, view.columns);
  parallel_for(tiles.size(), 1, [&](std::size_t i, std::size_t) {
    draw_tile(view.splats.data(), view.list(tiles[i]), tiles[i], view.columns, background, region, view.color);
  });
}

void FrozenView::restore(const Layers& frozen) {
  Impl& view = *impl_;
  TileGrid grid = whole_grid(view.camera);
  grid.wanted.assign(std::size_t(grid.columns) * std::size_t(grid.rows), 0);
  for (const std::uint32_t tile : tiles_of(view.region, grid.columns)) grid.wanted[tile] = 1;
  ForwardBuffers buffers;
  // Within all of the picture: the lists are to be those of a picture that was not cut.
  project(frozen, view_params<float>(view.camera), frozen.base->sh_degree, {}, Culling::exact, grid.pixels, buffers);
  sort_by_depth(buffers);
  bin(grid, buffers);

  const std::span<const std::uint32_t> entries(buffers.entries.data(), buffers.tile_begin.back());
  std::vector<std::uint32_t> number(buffers.block_sizes.size() * project_block, 0);  // among those kept, plus one
  for (const std::uint32_t splat : entries) number[splat] = 1;
  view.splats.clear(), view.splats.reserve(std::size_t(std::count(number.begin(), number.end(), 1u)));
  for (const DepthKey& keyed : buffers.by_depth) {
    if (number[keyed.splat] == 0) continue;
    view.splats.push_back(buffers.splats[keyed.splat]);
    number[keyed.splat] = std::uint32_t(view.splats.size());
  }
  view.entries.clear(), view.entries.reserve(entries.size());
  for (const std::uint32_t splat : entries) view.entries.push_back(number[splat] - 1);
  view.tile_begin = buffers.tile_begin;
}

void FrozenView::let_go() {
  // Not `= {}`, which keeps the memory.
  impl_->splats = std::vector<Splat>();
  impl_->entries = std::vector<std::uint32_t>();
  impl_->tile_begin = std::vector<std::uint32_t>();
}
bool FrozenView::is_let_go() const { return impl_->tile_begin.empty(); }

FrozenView::~FrozenView() = default;
FrozenView::FrozenView(FrozenView&&) noexcept = default;
FrozenView& FrozenView::operator=(FrozenView&&) noexcept = default;

const scene::Camera& FrozenView::camera() const { return impl_->camera; }
scene::Rect FrozenView::region() const { return impl_->region; }
const scene::Image& FrozenView::color() const { return impl_->color; }
std::size_t FrozenView::splats() const { return impl_->splats.size(); }
std::size_t FrozenView::memory_bytes() const {
  return sizeof(Impl) + impl_->splats.capacity() * sizeof(Splat) +
         (impl_->entries.capacity() + impl_->tile_begin.capacity()) * sizeof(std::uint32_t) +
         impl_->color.data.capacity() * sizeof(float);
}

struct LocalFrame::Impl {
  ForwardBuffers changeable;  ///< Of the changeable Gaussians alone.
  ForwardBuffers merged;      ///< splats, entries, tile_begin, tile_group, pairs_before and ray_ends: of both.
  Buffer<std::uint32_t> frozen_before;  ///< As changeable.splats: how many frozen splats lie in front of each.
  scene::Rect reach;
  std::vector<std::uint32_t> tiles;  ///< Reached.
  std::vector<std::uint32_t> rows;   ///< 0, 1, 2, ...
  PairSums pairs;
  bool drawn = false;  ///< Since project() and merge(): ray_ends are those of `merged`.
};

LocalFrame::LocalFrame() : impl_(std::make_unique<Impl>()) {}
LocalFrame::~LocalFrame() = default;
LocalFrame::LocalFrame(LocalFrame&&) noexcept = default;
LocalFrame& LocalFrame::operator=(LocalFrame&&) noexcept = default;

scene::Rect LocalFrame::project(const scene::GaussianCloud& changeable, const scene::Camera& camera) {
  assert(scene::validate(camera));
  const TileGrid grid = whole_grid(camera);
  ForwardBuffers& buffers = impl_->changeable;
  impl_->drawn = false;
  count_up(changeable.size(), impl_->rows);
  render::project(changeable, view_params<float>(camera), changeable.sh_degree, grid.pixels, impl_->rows, buffers);
  sort_by_depth(buffers);
  bin(grid, buffers);

  impl_->tiles.clear();
  scene::Rect reach;
  for (std::size_t tile = 0; tile + 1 < buffers.tile_begin.size(); ++tile) {
    if (buffers.tile_begin[tile] == buffers.tile_begin[tile + 1]) continue;
    const int x = int(tile) % grid.columns * tile_size, y = int(tile) / grid.columns * tile_size;
    if (impl_->tiles.empty()) reach = {x, y, x, y};
    reach = {std::min(reach.x0, x), reach.y0, std::max(reach.x1, x + tile_size), y + tile_size};
    impl_->tiles.push_back(std::uint32_t(tile));
  }
  return impl_->reach = whole_tiles(reach, camera);
}

namespace {

/// The frozen splats, and in the blocks after them the changeable ones as they lie. Returns where these begin.
std::size_t lay_splats(std::span<const Splat> frozen, const ForwardBuffers& top, ForwardBuffers& merged) {
  const std::size_t frozen_blocks = chunk_count(frozen.size(), project_block);
  const std::size_t blocks = frozen_blocks + top.block_sizes.size();
  // Entries are numbered in 32 bits, and so are splats.
  if (blocks * project_block > std::numeric_limits<std::int32_t>::max()) throw std::bad_alloc();
  Splat* const splats = merged.splats.reserve(blocks * project_block);
  merged.tile_group = top.tile_group;
  merged.pairs_before.assign(frozen_blocks, 0);
  merged.pairs_before.insert(merged.pairs_before.end(), top.pairs_before.begin(), top.pairs_before.end());
  parallel_for(frozen.size(), 4096, [&](std::size_t begin, std::size_t end) {
    std::copy(frozen.data() + begin, frozen.data() + end, splats + begin);
  });
  const std::size_t first_change = frozen_blocks * project_block;
  for (std::size_t b = 0; b < top.block_sizes.size(); ++b)
    std::copy_n(top.splats.data() + b * project_block, top.block_sizes[b], splats + first_change + b * project_block);
  return first_change;
}

/// How many frozen splats lie in front of each changeable one. Of the same depth, a frozen one does, as rows of a base
/// do.
///   frozen  by depth
///   out     as top.splats
void count_frozen_before(std::span<const Splat> frozen, const ForwardBuffers& top, std::uint32_t* out) {
  parallel_for(top.by_depth.size(), 512, [&](std::size_t begin, std::size_t end) {
    const auto depth = [&](std::size_t t) { return top.splats[top.by_depth[t].splat].depth; };
    auto at = std::ranges::upper_bound(frozen, depth(begin), {}, &Splat::depth);
    for (std::size_t t = begin; t < end; ++t) {
      while (at != frozen.end() && at->depth <= depth(t)) ++at;
      out[top.by_depth[t].splat] = std::uint32_t(at - frozen.begin());
    }
  });
}

/// A tile's list of both, by depth.
///   first_change  what is added to the numbers of `above`
///   to            room for both
void merge_lists(std::span<const std::uint32_t> below, std::span<const std::uint32_t> above,
                 const std::uint32_t* frozen_before, std::size_t first_change, std::uint32_t* to) {
  std::size_t a = 0;
  for (const std::uint32_t change : above) {
    for (; a < below.size() && below[a] < frozen_before[change]; ++a) *to++ = below[a];
    *to++ = std::uint32_t(first_change) + change;
  }
  std::copy(below.begin() + std::ptrdiff_t(a), below.end(), to);
}

}  // namespace

void LocalFrame::merge(const FrozenView& frozen) {
  Impl& frame = *impl_;
  const FrozenView::Impl& view = *frozen.impl_;
  const ForwardBuffers& top = frame.changeable;
  ForwardBuffers& merged = frame.merged;
  assert(!frozen.is_let_go());
  frame.drawn = false;
  assert(top.tile_begin.size() == view.tile_begin.size() && contains(view.region, frame.reach));

  const std::size_t first_change = lay_splats(view.splats, top, merged);
  std::uint32_t* const frozen_before = frame.frozen_before.reserve(top.block_sizes.size() * project_block);
  count_frozen_before(view.splats, top, frozen_before);

  const std::size_t all_tiles = view.tile_begin.size() - 1;
  const auto list_of_change = [&](std::size_t tile) {
    return std::span(top.entries.data() + top.tile_begin[tile], top.tile_begin[tile + 1] - top.tile_begin[tile]);
  };
  merged.tile_begin.assign(all_tiles + 1, 0);
  std::uint64_t total = 0;
  std::size_t next = 0;
  for (std::size_t tile = 0; tile < all_tiles; ++tile) {
    merged.tile_begin[tile] = std::uint32_t(total);
    if (next == frame.tiles.size() || frame.tiles[next] != tile) continue;
    ++next;
    total += view.list(tile).size() + list_of_change(tile).size();
    if (total > std::numeric_limits<std::uint32_t>::max()) throw std::bad_alloc();
  }
  merged.tile_begin[all_tiles] = std::uint32_t(total);
  std::uint32_t* const entries = merged.entries.reserve(std::size_t(total));
  parallel_for(frame.tiles.size(), 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t tile = frame.tiles[i];
      merge_lists(view.list(tile), list_of_change(tile), frozen_before, first_change,
                  entries + merged.tile_begin[tile]);
    }
  });
}

std::span<const std::uint32_t> LocalFrame::tiles() const { return impl_->tiles; }
float LocalFrame::nearest_depth(std::size_t i) const {
  const ForwardBuffers& top = impl_->changeable;  // whose lists are by depth
  return top.splats[top.entries[top.tile_begin[impl_->tiles[i]]]].depth;
}
std::size_t LocalFrame::entries() const {
  return impl_->merged.tile_begin.empty() ? 0 : impl_->merged.tile_begin.back();
}

void LocalFrame::forward(const FrozenView& frozen, scene::Image& color) {
  const FrozenView::Impl& view = *frozen.impl_;
  assert(color.width == view.region.width() && color.height == view.region.height() && color.channels == 3);
  ForwardBuffers& merged = impl_->merged;
  RayEnds* const ends = merged.ray_ends.reserve(merged.tile_begin.size() - 1);
  parallel_for(impl_->tiles.size(), 1, [&](std::size_t i, std::size_t) {
    const std::uint32_t tile = impl_->tiles[i], first = merged.tile_begin[tile], last = merged.tile_begin[tile + 1];
    draw_tile(merged.splats.data(), {merged.entries.data() + first, last - first}, tile, view.columns, view.background,
              view.region, color, ends + tile);
  });
  impl_->drawn = true;
}

void LocalFrame::backward(const FrozenView& frozen, const scene::GaussianCloud& changeable, const scene::Image& v_color,
                          Gradients& out) {
  const FrozenView::Impl& view = *frozen.impl_;
  assert(v_color.width == view.region.width() && v_color.height == view.region.height() && v_color.channels == 3);
  assert(out.size() == changeable.size() && out.sh_degree == changeable.sh_degree);
  const std::vector<std::uint32_t>& rows = impl_->rows;
  assert(rows.size() == changeable.size());
  TileGrid grid = whole_grid(view.camera);
  grid.pixels = view.region;
  const UpstreamPlanes upstream{.color = &v_color};
  const ForwardBuffers& top = impl_->changeable;
  assert(impl_->drawn);
  walk_tiles(impl_->merged, impl_->merged.ray_ends.data(), grid, upstream, view.background, impl_->pairs);
  project_layers_vjp(changeable, view_params<float>(view.camera), changeable.sh_degree, rows, top.first_pair.data(),
                     impl_->pairs, out);
}

}  // namespace engine::render
