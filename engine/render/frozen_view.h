// Rendering and differentiating a few changeable Gaussians amid many frozen ones, at the cost of the few.
//
// While a camera and the frozen Gaussians stay the same, so do the projection of the frozen ones, their order by depth
// and their lists per tile: FrozenView keeps them, for a part of the picture. LocalFrame projects the changeable ones,
// merges them into those lists, and blends only the tiles that they reach. Everywhere else the picture is the frozen
// one. Bytes are those of forward() and backward() on Layers of both, whose base the frozen cloud is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "engine/core/vec.h"
#include "engine/render/backward.h"
#include "engine/render/layers.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::render {

/// The rectangle grown to whole tiles, cut to the picture. An empty one stays empty.
[[nodiscard]] scene::Rect whole_tiles(scene::Rect rect, const scene::Camera& camera);

/// What frozen Gaussians put into a part of one camera's picture. Never changes once made, but for being let go.
class FrozenView {
 public:
  /// Projects, sorts, lists and renders: the one step that costs the size of the scene.
  ///   frozen  what is drawn; not needed afterwards
  ///   region  part of the picture, of whole tiles (asserted) and not empty
  ///   throws  std::bad_alloc, as forward() does
  FrozenView(const Layers& frozen, const scene::Camera& camera, scene::Rect region, Vec3 background = Vec3(0.0f));
  ~FrozenView();
  FrozenView(FrozenView&&) noexcept;
  FrozenView& operator=(FrozenView&&) noexcept;

  [[nodiscard]] const scene::Camera& camera() const;
  [[nodiscard]] scene::Rect region() const;
  /// The region of the picture, drawn of the frozen Gaussians alone.
  [[nodiscard]] const scene::Image& color() const;
  [[nodiscard]] std::size_t splats() const;  ///< Splats that reach the region; 0 while they are let go.
  [[nodiscard]] std::size_t memory_bytes() const;

  /// Lets splats and lists go, most of the memory. The picture stays; LocalFrame needs them back first.
  void let_go();
  [[nodiscard]] bool is_let_go() const;
  /// Makes splats and lists anew, as they were; costs a pass over the scene.
  ///   frozen  the layers that the constructor was given
  void restore(const Layers& frozen);

 private:
  friend class LocalFrame;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// One picture of changeable Gaussians over a FrozenView. Its memory is used again from picture to picture. Not for
/// two threads at once. project(), merge(), forward() and backward() come in this order.
class LocalFrame {
 public:
  LocalFrame();
  ~LocalFrame();
  LocalFrame(LocalFrame&&) noexcept;
  LocalFrame& operator=(LocalFrame&&) noexcept;

  /// Projects, sorts and lists the changeable Gaussians, all rows of `changeable`.
  ///   returns  the pixels of the tiles that they reach, as one rectangle; empty if there are none
  scene::Rect project(const scene::GaussianCloud& changeable, const scene::Camera& camera);

  /// Puts them among the frozen ones. Precondition: the rectangle that project() returned lies within frozen.region(),
  /// and its camera was frozen.camera(). Costs the splats of the region and the lists of the tiles that are reached.
  void merge(const FrozenView& frozen);

  /// The tiles that changeable Gaussians reach, ascending; numbered as in ForwardOptions::tiles.
  [[nodiscard]] std::span<const std::uint32_t> tiles() const;
  /// Depth of the nearest changeable Gaussian that reaches tiles()[i], world units along the optical axis.
  [[nodiscard]] float nearest_depth(std::size_t i) const;
  /// Places in the lists of those tiles: what blending and walking back cost.
  [[nodiscard]] std::size_t entries() const;

  /// Overwrites those tiles.
  ///   color  [3] picture of the region, elsewhere as FrozenView::color() has it
  void forward(const FrozenView& frozen, scene::Image& color);

  /// Adds dL/d(row) of all rows of `changeable` to out, as backward() does. Comes after forward().
  ///   v_color  [3] dL/dcolor, of the region; counts in those tiles
  ///   out      of changeable.size() rows and its degree
  void backward(const FrozenView& frozen, const scene::GaussianCloud& changeable, const scene::Image& v_color,
                Gradients& out);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace engine::render
