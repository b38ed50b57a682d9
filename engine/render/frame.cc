#include "engine/render/frame.h"

#include <cassert>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/render/backward_stages.h"
#include "engine/render/color_tiles.h"

namespace engine::render {

struct Frame::Impl {
  scene::Camera camera;
  Vec3 background{0.0f};
  TileGrid grid;
  ForwardBuffers buffers;
  PairSums pairs;
  std::vector<std::uint32_t> rows;  ///< 0, 1, 2, ...
};

Frame::Frame() : impl_(std::make_unique<Impl>()) {}
Frame::~Frame() = default;
Frame::Frame(Frame&&) noexcept = default;
Frame& Frame::operator=(Frame&&) noexcept = default;

void Frame::forward(const scene::GaussianCloud& cloud, const scene::Camera& camera, Vec3 background,
                    scene::Image& color) {
  assert(scene::validate(camera));
  assert(color.width == camera.width && color.height == camera.height && color.channels == 3);
  Impl& frame = *impl_;
  frame.camera = camera, frame.background = background;
  frame.grid = whole_grid(camera);
  ForwardBuffers& buffers = frame.buffers;
  count_up(cloud.size(), frame.rows);
  project(cloud, view_params<float>(camera), cloud.sh_degree, frame.grid.pixels, frame.rows, buffers);
  sort_by_depth(buffers);
  bin(frame.grid, buffers);
  const std::size_t tiles = buffers.tile_begin.size() - 1;
  RayEnds* const ends = buffers.ray_ends.reserve(tiles);
  parallel_for(tiles, 1, [&](std::size_t tile, std::size_t) {
    const std::uint32_t first = buffers.tile_begin[tile], last = buffers.tile_begin[tile + 1];
    draw_tile(buffers.splats.data(), {buffers.entries.data() + first, last - first}, std::uint32_t(tile),
              frame.grid.columns, background, frame.grid.pixels, color, ends + tile);
  });
}

void Frame::backward(const scene::GaussianCloud& cloud, const scene::Image& v_color, Gradients& out) {
  Impl& frame = *impl_;
  assert(v_color.width == frame.camera.width && v_color.height == frame.camera.height && v_color.channels == 3);
  assert(out.size() == cloud.size() && out.sh_degree == cloud.sh_degree);
  assert(frame.rows.size() == cloud.size());
  walk_tiles(frame.buffers, frame.buffers.ray_ends.data(), frame.grid, {.color = &v_color}, frame.background,
             frame.pairs);
  project_layers_vjp(cloud, view_params<float>(frame.camera), cloud.sh_degree, frame.rows,
                     frame.buffers.first_pair.data(), frame.pairs, out);
}

}  // namespace engine::render
