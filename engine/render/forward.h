// Forward splatting: a Gaussian scene and a camera in, pictures out.
// Source: Kerbl et al. 2023, "3D Gaussian Splatting for Real-Time Radiance Field Rendering", section 4 and eqs. 3-5;
// Zwicker et al. 2001, "EWA volume splatting", for the projection of a covariance.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/vec.h"
#include "engine/render/layers.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::render {

/// Side of a screen tile, pixels. Tile number t covers column t % tile_columns(), row t / tile_columns().
constexpr int tile_size = 16;
constexpr int log2_tile_size = 4;
static_assert(1 << log2_tile_size == tile_size);
constexpr int tile_columns(int width) { return (width + tile_size - 1) / tile_size; }
constexpr int tile_rows(int height) { return (height + tile_size - 1) / tile_size; }

/// Which program computes the picture. Both give the same picture to float rounding.
enum class Backend {
  simd,       ///< Vector instructions chosen at run time, all threads of the arena.
  reference,  ///< Plain scalar code, one thread: slow, obvious, the judge of the other one.
};

/// What a ray blends. All share: splats by view depth (ties by row), alpha = min(0.99, opacity * falloff),
/// contributions below 1/255 skipped.
enum class Semantics {
  dense_stop,    ///< A splat that would bring transmittance below 1e-4 is not blended and ends the ray. The default.
  dense_nostop,  ///< No such end. Reference backend only.
  tile16_stop,   ///< dense_stop, and a splat only reaches the tiles its 3-sigma square meets. Reference backend only.
};

/// Rows that are drawn with their colours blended towards another one: what a person has selected, say.
struct Tint {
  std::span<const std::uint8_t> rows = {};  ///< [layers.size()] 1: tinted. Empty: no row is.
  Vec3 color{0.0f};                         ///< Display-referred.
  float strength = 0;                       ///< Share of that colour, 0 to 1.
};

/// What a forward pass draws.
struct ForwardOptions {
  Vec3 background{0.0f};                     ///< Colour behind everything, display-referred.
  bool color = true;                         ///< Compute Rendering::color.
  bool depth = false;                        ///< Compute Rendering::depth and median_depth.
  int max_sh_degree = scene::max_sh_degree;  ///< Bands above this one are ignored.
  std::optional<scene::Rect> rect = {};      ///< Render only these pixels; pictures have the rectangle's size.
  std::vector<std::uint32_t> tiles = {};     ///< Not empty: render only these tiles (ascending); the rest stays zero.
  Backend backend = Backend::simd;
  Semantics semantics = Semantics::dense_stop;
  Tint tint = {};  ///< Costs a look at each visible splat.
};

/// Pictures of the camera's size, or of options.rect. Those not asked for are empty.
/// With blending weights w_i (front to back, w_i = T_i alpha_i):
struct Rendering {
  scene::Image color;         ///< [3] sum w_i c_i + T_final background
  scene::Image alpha;         ///< [1] 1 - T_final
  scene::Image depth;         ///< [1] sum w_i z_i, world units along the optical axis; divide by alpha for a mean.
  scene::Image median_depth;  ///< [1] z of the splat at which T falls below one half; 0 where it never does.
  scene::Image weight;        ///< [1] sum w_i weight_i, where weights were given
};

/// Renders a cloud, or layers of two, through `camera`. Layers give the bytes of the merged cloud, unless a changed
/// row and another one have the very same depth: ties are drawn in the order of the layers' rows.
///   weight   [layers.size()] or empty: an arbitrary number per Gaussian, blended like a colour (1 for members of a
///            mask)
///   returns  finite pictures for every finite cloud and valid camera
///   bytes    the same for any number of threads; they may differ between backends and instruction sets
///   throws   std::bad_alloc, also where splats reach more than 2^32 tiles in all
/// Precondition: validate(camera) holds; options.rect lies inside the picture; tiles and rect are not both given.
[[nodiscard]] Rendering forward(const Layers& layers, const scene::Camera& camera, const ForwardOptions& options = {},
                                std::span<const float> weight = {});

struct PixelHit;

/// Memory that a sequence of renderings shares. Not for two threads at once.
class Workspace {
 public:
  Workspace();
  ~Workspace();
  Workspace(Workspace&&) noexcept;
  Workspace& operator=(Workspace&&) noexcept;

 private:
  friend void forward(const Layers&, const scene::Camera&, const ForwardOptions&, std::span<const float>, Workspace&,
                      Rendering&);
  friend void raise_to_largest_weights(const Layers&, const scene::Camera&, Workspace&, std::span<float>);
  friend void add_weight_sums(const Layers&, const scene::Camera&, const scene::Image&, Workspace&, std::span<double>,
                              std::span<double>);
  friend std::optional<PixelHit> pick(const Layers&, const scene::Camera&, DVec2, Workspace&);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The same, into pictures and memory of an earlier call, which a frame of the same size then does not allocate again:
/// a fifth of the time of a small scene.
void forward(const Layers& layers, const scene::Camera& camera, const ForwardOptions& options,
             std::span<const float> weight, Workspace& workspace, Rendering& out);

/// Instruction sets compiled in and supported by this processor, best first ("AVX2", "SSE4", ...).
[[nodiscard]] std::vector<std::string> simd_targets();
/// The one in use.
[[nodiscard]] std::string simd_target();
/// Restricts the choice to the named one (results are reproducible per instruction set).
///   errors  invalid_argument: not in simd_targets()
[[nodiscard]] Result<void> pin_simd_target(const std::string& name);

}  // namespace engine::render
