// A picture of a whole cloud in which everything may change: forward() and backward() that project, sort and list once
// for both. For clouds of which most is frozen see frozen_view.h.
#pragma once

#include <memory>

#include "engine/core/vec.h"
#include "engine/render/backward.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::render {

/// Its memory, among it 8 bytes per pixel, is used again from picture to picture. Not for two threads at once.
/// backward() comes after forward().
class Frame {
 public:
  Frame();
  ~Frame();
  Frame(Frame&&) noexcept;
  Frame& operator=(Frame&&) noexcept;

  /// Overwrites `color`, [3] and of the camera's size, with the bytes of render::forward().
  ///   background  colour behind everything, display-referred
  ///   throws      std::bad_alloc, as render::backward() does
  void forward(const scene::GaussianCloud& cloud, const scene::Camera& camera, Vec3 background, scene::Image& color);

  /// Adds dL/d(row) of all rows to out, with the bytes of render::backward().
  ///   cloud    the one that forward() drew, unchanged since
  ///   v_color  [3] dL/dcolor, of the camera's size
  ///   out      of cloud.size() rows and its degree
  void backward(const scene::GaussianCloud& cloud, const scene::Image& v_color, Gradients& out);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace engine::render
