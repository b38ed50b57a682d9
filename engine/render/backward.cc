#include "engine/render/backward.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <functional>
#include <optional>

#include "engine/core/parallel.h"
#include "engine/render/backward_stages.h"
#include "engine/render/reference/backward_reference.h"

namespace engine::render {
namespace {

/// Is the pixel one that the options ask for?
class Wanted {
 public:
  Wanted(const ForwardOptions& options, const scene::Camera& camera)
      : area_(rect_of(options, camera)), columns_(tile_columns(camera.width)) {
    if (options.tiles.empty()) return;
    tiles_.assign(std::size_t(columns_) * std::size_t(tile_rows(camera.height)), 0);
    for (const std::uint32_t tile : options.tiles) tiles_[tile] = 1;
  }
  [[nodiscard]] scene::Rect area() const { return area_; }
  [[nodiscard]] const std::vector<std::uint8_t>& tiles() const { return tiles_; }  ///< As TileGrid::wanted.
  [[nodiscard]] bool operator()(int x, int y) const {
    return tiles_.empty() || tiles_[std::size_t(y / tile_size * columns_ + x / tile_size)] != 0;
  }

 private:
  scene::Rect area_;
  int columns_;
  std::vector<std::uint8_t> tiles_;
};

/// A plane of the whole picture that is zero where nothing is wanted. Empty for an empty image.
std::vector<float> whole_plane(const scene::Image& image, int channel, const Wanted& wanted, int width, int height) {
  if (image.channels == 0) return {};
  std::vector<float> plane(std::size_t(width) * std::size_t(height), 0.0f);
  const scene::Rect area = wanted.area();
  for (int y = area.y0; y < area.y1; ++y)
    for (int x = area.x0; x < area.x1; ++x)
      if (wanted(x, y))
        plane[std::size_t(y) * std::size_t(width) + std::size_t(x)] = image.at(x - area.x0, y - area.y0, channel);
  return plane;
}

Vec3 vector_of(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }

void backward_scalar(const Layers& layers, const scene::Camera& camera, const BackwardOptions& options,
                     const Upstream& upstream, std::span<const std::uint32_t> rows, Gradients& out) {
  const Wanted wanted(options.forward, camera);
  const auto plane = [&](const scene::Image& image, int channel) {
    return whole_plane(image, channel, wanted, camera.width, camera.height);
  };
  const ReferenceUpstream<float> whole{
      .color = {plane(upstream.color, 0), plane(upstream.color, 1), plane(upstream.color, 2)},
      .depth = plane(upstream.depth, 0),
      .alpha = plane(upstream.alpha, 0)};
  const auto v = backward_reference<float>(layers, camera, options, whole, rows);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    out.mean.set(r, out.mean.get(r) + vector_of(v.mean[r]));
    out.log_scale.set(r, out.log_scale.get(r) + vector_of(v.log_scale[r]));
    out.rotation.w[r] += v.rotation[r][0], out.rotation.x[r] += v.rotation[r][1];
    out.rotation.y[r] += v.rotation[r][2], out.rotation.z[r] += v.rotation[r][3];
    out.opacity_logit[r] += v.opacity_logit[r];
    out.mean2d_x_px[r] = v.mean2d_px[r][0], out.mean2d_y_px[r] = v.mean2d_px[r][1];
  }
  for (std::size_t i = 0; i < out.sh.size(); ++i) out.sh[i] += v.sh[i];
}

}  // namespace

void Gradients::reset(std::size_t rows, int degree) {
  sh_degree = degree;
  for (Array3* array : {&mean, &log_scale})
    for (std::vector<float>* component : {&array->x, &array->y, &array->z}) component->assign(rows, 0.0f);
  for (std::vector<float>* component :
       {&rotation.w, &rotation.x, &rotation.y, &rotation.z, &opacity_logit, &mean2d_x_px, &mean2d_y_px})
    component->assign(rows, 0.0f);
  sh.assign(rows * 3 * scene::sh_coefficients(degree), 0.0f);
}

namespace {

/// Planes of a tile that is not wholly shown: zero where it is not.
struct PaddedTile {
  std::array<std::array<float, TilePixels::count>, 5> planes;
};

/// dL/d(pictures) of the tile whose first pixel is (x0, y0), where it lies, or padded. Nothing if none of it is shown.
std::optional<TileUpstream> upstream_of_tile(const UpstreamPlanes& upstream, scene::Rect area, int x0, int y0,
                                             PaddedTile& padded) {
  const scene::Rect part = part_of_tile(x0, y0, area);
  if (part.empty()) return std::nullopt;
  const bool whole = part == whole_tile;
  const auto plane = [&](const scene::Image* image, int channel, std::size_t number) -> const float* {
    if (image == nullptr) return nullptr;
    const float* const shown = image->plane(channel).data() + place_in(area, x0 + part.x0, y0 + part.y0);
    if (whole) return shown;
    padded.planes[number].fill(0.0f);
    float* const to = padded.planes[number].data();
    for (int y = part.y0; y < part.y1; ++y)
      std::copy_n(shown + std::ptrdiff_t(y - part.y0) * area.width(), part.width(), to + y * tile_size + part.x0);
    return to;
  };
  return TileUpstream{.red = plane(upstream.color, 0, 0),
                      .green = plane(upstream.color, 1, 1),
                      .blue = plane(upstream.color, 2, 2),
                      .depth = plane(upstream.depth, 0, 3),
                      .alpha = plane(upstream.alpha, 0, 4),
                      .stride = whole ? area.width() : tile_size};
}

/// Whether anything is to be pulled back. NaN is something.
bool any(const TileUpstream& upstream) {
  for (const float* plane : {upstream.red, upstream.green, upstream.blue, upstream.depth, upstream.alpha}) {
    if (plane == nullptr) continue;
    for (int y = 0; y < tile_size; ++y)
      for (int x = 0; x < tile_size; ++x)
        if (plane[y * upstream.stride + x] != 0) return true;
  }
  return false;
}

/// fetch_tile() of the colours that upstream_of_tile() finds.
void fetch_upstream(const UpstreamPlanes& upstream, scene::Rect area, int x0, int y0) {
  const scene::Rect part = part_of_tile(x0, y0, area);
  if (upstream.color == nullptr || part.empty()) return;
  for (int channel = 0; channel < 3; ++channel)
    fetch_tile(upstream.color->plane(channel).data() + place_in(area, x0 + part.x0, y0 + part.y0), area.width(),
               part.width(), part.height());
}

}  // namespace

GroupGradient* PairSums::zeroed(std::size_t n) {
  if (n > sums_.capacity() || !still_zero_) zeros_ = 0;
  GroupGradient* const sums = sums_.reserve(n);
  if (zeros_ < n) {
    parallel_for(n - zeros_, 4096, [&](std::size_t first, std::size_t last) {
      std::fill(sums + zeros_ + first, sums + zeros_ + last, GroupGradient{});
    });
    zeros_ = n;
  }
  still_zero_ = false;
  return sums;
}

void walk_tiles(const ForwardBuffers& forward, const RayEnds* ends, const TileGrid& grid,
                const UpstreamPlanes& upstream, Vec3 background, PairSums& sums) {
  GroupGradient* const first_sums = sums.zeroed(forward.pairs_before.back());
  const int side = forward.tile_group;
  const auto walk_tile = [&](int column, int row) {
    const auto tile = std::size_t(row * grid.columns + column);
    const std::uint32_t first = forward.tile_begin[tile], last = forward.tile_begin[tile + 1];
    const std::span list(forward.entries.data() + first, last - first);
    const auto may_change = [&](std::uint32_t splat) {
      const std::uint32_t* const before = forward.pairs_before.data() + splat / project_block;
      return before[0] != before[1] && forward.splats[splat].pairs.any();  // frozen ones are blocks by themselves
    };
    const auto asked = std::find_if(list.begin(), list.end(), may_change);
    if (asked == list.end()) return;
    const TilePlace place = place_of(tile, grid.columns, grid.pixels);
    PaddedTile padded;
    const auto tile_upstream = upstream_of_tile(upstream, grid.pixels, place.x0, place.y0, padded);
    if (!tile_upstream || !any(*tile_upstream)) return;
    RayEnds anew;
    if (ends == nullptr) {
      TilePixels pixels;
      composite_tile(forward.splats.data(), list, place, {}, {}, pixels, &anew);
    }
    const TilePairs tile_pairs{.pairs_before = forward.pairs_before.data(),
                               .group_column = std::uint32_t(column / side),
                               .group_row = std::uint32_t(row / side),
                               .sums = first_sums};
    composite_tile_vjp(forward.splats.data(), list, std::size_t(asked - list.begin()), place.x0, place.y0,
                       *tile_upstream, background, ends != nullptr ? ends[tile] : anew, tile_pairs);
  };
  // A group's tiles follow each other on one thread, since they add to the same sums.
  const auto groups = [side](int tiles) { return (tiles + side - 1) / side; };
  parallel_for(std::size_t(groups(grid.columns) * groups(grid.rows)), 1, [&](std::size_t group, std::size_t) {
    const int column0 = int(group) % groups(grid.columns) * side, row0 = int(group) / groups(grid.columns) * side;
    const int columns = std::min(side, grid.columns - column0), rows = std::min(side, grid.rows - row0);
    for (int i = 0; i < columns * rows; ++i) {
      const bool last = i + 1 == columns * rows;  // then the next group's first is mostly the next tile
      fetch_upstream(upstream, grid.pixels, (column0 + (last ? side : (i + 1) % columns)) * tile_size,
                     (row0 + (last ? 0 : (i + 1) / columns)) * tile_size);
      walk_tile(column0 + i % columns, row0 + i / columns);
    }
  });
}

void project_layers_vjp(const Layers& layers, const ViewParams<float>& view, int sh_degree,
                        std::span<const std::uint32_t> rows, const std::uint32_t* first_pair, PairSums& sums,
                        Gradients& out) {
  const RowPairs row_pairs{.first_pair = first_pair, .pairs = sums.data()};
  const std::size_t base_rows = layers.base->size();
  const auto of_base = std::size_t(std::lower_bound(rows.begin(), rows.end(), base_rows) - rows.begin());
  parallel_for(rows.size(), project_vjp_block, [&](std::size_t begin, std::size_t end) {
    const std::size_t split = std::clamp(of_base, begin, end);
    if (begin < split) project_rows_vjp(*layers.base, 0, view, sh_degree, rows, row_pairs, begin, split, out);
    if (split < end) project_rows_vjp(*layers.top, base_rows, view, sh_degree, rows, row_pairs, split, end, out);
  });
  sums.all_read();
}

namespace {

const scene::Image* plane_or_none(const scene::Image& image) { return image.channels != 0 ? &image : nullptr; }

/// What a backward pass works in. The stages fill it from top to bottom.
struct BackwardBuffers {
  ForwardBuffers forward;
  PairSums pairs;
};

void backward_simd(const Layers& layers, const scene::Camera& camera, const BackwardOptions& options,
                   const Upstream& upstream, std::span<const std::uint32_t> rows, BackwardBuffers& work,
                   Gradients& out) {
  if (rows.empty()) return;
  const Wanted wanted(options.forward, camera);
  const auto view = view_params<float>(camera);
  const int sh_degree = std::min(layers.base->sh_degree, options.forward.max_sh_degree);
  const TileGrid grid{.columns = tile_columns(camera.width),
                      .rows = tile_rows(camera.height),
                      .pixels = wanted.area(),
                      .wanted = wanted.tiles()};
  ForwardBuffers& forward = work.forward;
  project(layers, view, sh_degree, grid.pixels, rows, forward);
  sort_by_depth(forward);
  bin(grid, forward);

  const UpstreamPlanes planes{.color = plane_or_none(upstream.color),
                              .depth = plane_or_none(upstream.depth),
                              .alpha = plane_or_none(upstream.alpha)};
  walk_tiles(forward, nullptr, grid, planes, options.forward.background, work.pairs);
  project_layers_vjp(layers, view, sh_degree, rows, forward.first_pair.data(), work.pairs, out);
}

}  // namespace

struct BackwardWorkspace::Impl {
  BackwardBuffers buffers;
};

BackwardWorkspace::BackwardWorkspace() : impl_(std::make_unique<Impl>()) {}
BackwardWorkspace::~BackwardWorkspace() = default;
BackwardWorkspace::BackwardWorkspace(BackwardWorkspace&&) noexcept = default;
BackwardWorkspace& BackwardWorkspace::operator=(BackwardWorkspace&&) noexcept = default;

void backward(const Layers& layers, const scene::Camera& camera, const BackwardOptions& options,
              const Upstream& upstream, std::span<const std::uint32_t> rows, BackwardWorkspace& workspace,
              Gradients& out) {
  assert(scene::validate(camera));
  assert(options.forward.tiles.empty() || !options.forward.rect);
  assert(std::adjacent_find(rows.begin(), rows.end(), std::greater_equal<>()) == rows.end());
  assert(rows.empty() || rows.back() < layers.size());
  [[maybe_unused]] const auto fits = [&](const scene::Image& image, int channels) {
    const scene::Rect area = rect_of(options.forward, camera);
    return image.channels == 0 ||
           (image.width == area.width() && image.height == area.height() && image.channels == channels);
  };
  assert(fits(upstream.color, 3) && fits(upstream.depth, 1) && fits(upstream.alpha, 1));
  assert(out.size() == rows.size() && out.sh_degree == layers.base->sh_degree);
  assert(options.forward.backend == Backend::reference ||
         (options.forward.semantics == Semantics::dense_stop && options.alpha_clamp == AlphaClamp::exact));
  if (options.forward.backend == Backend::reference) {
    backward_scalar(layers, camera, options, upstream, rows, out);
  } else {
    backward_simd(layers, camera, options, upstream, rows, workspace.impl_->buffers, out);
  }
}

}  // namespace engine::render
