#include "server/service/render_service.h"

#include <algorithm>
#include <chrono>
#include <new>
#include <span>
#include <sstream>

#include "server/http/negotiation.h"
#include "server/pictures/pictures.h"

namespace server::service {
namespace {

namespace render = engine::render;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::scene::Camera;
using Clock = std::chrono::steady_clock;

/// Pixels of the largest picture whose memory a canvas keeps for the next one; larger pictures give theirs back. Four
/// megapixels hold any window of the page; a choice.
constexpr std::int64_t max_kept_pixels = std::int64_t{1} << 22;

/// The same of Gaussians: what a canvas keeps is not counted, so it must be little. A gigabyte; a choice.
constexpr std::size_t max_kept_rows = std::size_t{1} << 23;

std::size_t rows_of(const scenes::LoadedVersion& version) {
  return version.cloud.base->size() + (version.cloud.overlay ? version.cloud.overlay->rows.size() : 0);
}

/// Bytes while a picture is made, about: its splats with their places in tiles, from the 13.8 GB that two renders of 50
/// million Gaussians took; its layers, in floats and encoded.
std::uint64_t picture_bytes(std::size_t rows, const Camera& camera) {
  return 140 * std::uint64_t{rows} + 64 * std::uint64_t(camera.width) * std::uint64_t(camera.height);
}

double milliseconds_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

/// 1 for each row that the version changed or added against version 0: all that lie on top.
std::vector<float> weights_of_changes(const render::Layers& layers) {
  std::vector<float> weights(layers.size(), 0.0f);
  std::fill(weights.begin() + std::ptrdiff_t(layers.base->size()), weights.end(), 1.0f);
  return weights;
}

/// One byte for each row of the layers, from one for each row of the merged cloud; 0 for hidden ones.
std::vector<std::uint8_t> on_layers(const render::Layers& layers, std::span<const std::uint8_t> merged) {
  std::vector<std::uint8_t> bytes(layers.size(), 0);
  const std::size_t base_rows = layers.base->size();
  auto next_hidden = layers.hidden.begin();
  std::size_t at = 0, changed = 0;
  for (std::size_t row = 0; row < base_rows; ++row) {
    if (next_hidden == layers.hidden.end() || *next_hidden != row) {
      bytes[row] = merged[at++];
      continue;
    }
    ++next_hidden;
    if (changed < layers.changed.size() && layers.changed[changed] == row) bytes[base_rows + changed++] = merged[at++];
  }
  std::copy(merged.begin() + std::ptrdiff_t(at), merged.end(), bytes.begin() + std::ptrdiff_t(base_rows + changed));
  return bytes;
}

}  // namespace

RenderService::RenderService(const RenderServiceOptions& options)
    : options_(options),
      arena_(options.threads, engine::Priority::high),
      slots_({.slots = arena_.threads(), .waiting = options.max_waiting}, "pictures") {
  arena_.start_threads();
}

std::string RenderService::etag(const scenes::LoadedVersion& version, const PictureOrder& order) const {
  const Camera& camera = order.camera;
  std::ostringstream text;
  text << std::hexfloat << version.key << ' ' << options_.program << ' ' << render::simd_target() << ' '
       << int(order.content) << ' ' << int(order.format) << ' ' << order.sh_degree << ' ' << order.quality << ' '
       << camera.width << ' ' << camera.height;
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) text << ' ' << value;
  for (int i = 0; i < 3; ++i) {
    text << ' ' << camera.translation[i] << ' ' << order.background[i];
    for (int j = 0; j < 3; ++j) text << ' ' << camera.rotation[i][j];
  }
  if (order.selection) text << ' ' << order.selection->id;
  return http::etag_of(text.str());
}

Result<void> RenderService::check(const Camera& camera) const {
  if (auto valid = engine::scene::validate(camera); !valid) return valid;
  if (camera.width <= options_.max_side && camera.height <= options_.max_side) return {};
  return fail(ErrorCode::too_large,
              "the picture would have " + std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                  " pixels; the service's option --max-render-side allows " + std::to_string(options_.max_side) +
                  " a side: ask for a smaller one with max_side",
              "max_side");
}

Result<void> RenderService::run_in_turn(const std::function<void()>& work) {
  const auto slot = slots_.acquire();
  if (!slot) return propagate(slot);
  try {
    arena_.run(work);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::too_large, "this does not fit into the memory of the machine: ask for smaller pictures");
  }
  return {};
}

Result<void> RenderService::on_canvas(const scenes::LoadedVersion& version, const Camera& camera,
                                      const std::function<void(Canvas&)>& work) {
  if (auto sound = check(camera); !sound) return sound;
  const auto slot = slots_.acquire();
  if (!slot) return propagate(slot);
  const std::size_t rows = rows_of(version);
  const auto share = engine::take_from(options_.memory, picture_bytes(rows, camera), "version");
  if (!share) return propagate(share);
  std::unique_ptr<Canvas> canvas;
  {
    const std::lock_guard lock(mutex_);
    if (!canvases_.empty()) {
      canvas = std::move(canvases_.back());
      canvases_.pop_back();
    }
  }
  try {
    if (!canvas) canvas = std::make_unique<Canvas>();
    work(*canvas);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::too_large, "the picture does not fit into the memory of the machine: ask for a smaller one");
  }
  if (std::int64_t{camera.width} * camera.height > max_kept_pixels || rows > max_kept_rows) return {};
  const std::lock_guard lock(mutex_);
  canvases_.push_back(std::move(canvas));
  return {};
}

Result<Picture> RenderService::render(const scenes::LoadedVersion& version, const PictureOrder& order) {
  render::ForwardOptions forward;
  forward.background = order.background;
  forward.max_sh_degree = order.sh_degree;
  forward.color = pictures::needs_color(order.content);
  forward.depth = pictures::needs_depth(order.content, order.format);
  Picture picture;
  Result<std::vector<std::byte>> encoded;
  auto done = on_canvas(version, order.camera, [&](Canvas& canvas) {
    const auto begin = Clock::now();
    arena_.run([&] {
      const render::DrawnVersion drawn(version.cloud);
      const render::Layers layers = drawn.layers();
      const auto tinted =
          order.selection ? on_layers(layers, order.selection->selected.rows) : std::vector<std::uint8_t>();
      forward.tint = {.rows = tinted, .color = pictures::tint_color, .strength = pictures::tint_share};
      const auto weights = order.content == PictureContent::mask ? weights_of_changes(layers) : std::vector<float>();
      render::forward(layers, order.camera, forward, weights, canvas.workspace, canvas.rendering);
    });
    picture.render_ms = milliseconds_since(begin);
    // Still at this place, since it takes a core as rendering does, but not in the arena: one thread does it.
    const auto rendered = Clock::now();
    encoded = pictures::encode_content(canvas.rendering, order.content, order.format,
                                       {.jpeg_quality = order.quality, .png_bits = 8});
    picture.encode_ms = milliseconds_since(rendered);
  });
  if (!done) return propagate(done);
  if (!encoded) return propagate(encoded);
  picture.bytes.assign(reinterpret_cast<const char*>(encoded->data()), encoded->size());
  return picture;
}

Result<engine::scene::Image> RenderService::colors(const scenes::LoadedVersion& version, const Camera& camera) {
  engine::scene::Image colors;
  auto done = on_canvas(version, camera, [&](Canvas& canvas) {
    arena_.run([&] {
      const render::DrawnVersion drawn(version.cloud);
      render::forward(drawn.layers(), camera, {}, {}, canvas.workspace, canvas.rendering);
    });
    colors = canvas.rendering.color;
  });
  if (!done) return propagate(done);
  return colors;
}

Result<std::optional<render::PixelHit>> RenderService::pick(const scenes::LoadedVersion& version, const Camera& camera,
                                                            engine::DVec2 pixel) {
  std::optional<render::PixelHit> hit;
  auto done = on_canvas(version, camera, [&](Canvas& canvas) {
    arena_.run([&] {
      const render::DrawnVersion drawn(version.cloud);
      hit = render::pick(drawn.layers(), camera, pixel, canvas.workspace);
    });
  });
  if (!done) return propagate(done);
  return hit;
}

}  // namespace server::service
