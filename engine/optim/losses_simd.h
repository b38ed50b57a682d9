// The vector kernels behind losses.h, chosen at run time. Only losses.cc includes this header.
#pragma once

#include "engine/optim/losses.h"
#include "engine/optim/picture_view.h"
#include "engine/scene/image.h"

namespace engine::optim {

/// Most columns and rows of a tile that ssim_tile() takes. A tile recomputes a rim of its neighbours; this size costs a
/// fifth more arithmetic than a whole picture would, and keeps what is in flight in 70 kB of stack.
constexpr int ssim_tile_width = 128, ssim_tile_height = 64;

/// One channel of a comparison.
struct SsimChannel {
  PictureView rendered, target;  ///< One channel.
  MaskView mask;
  MutablePictureView v_rendered;
  float scale = 1;  ///< Factor of the gradient.
};

/// Adds scale * gradient to the pixels of `tile` (the gradient of the sum over the whole picture).
///   returns  the sum of 1 - term over the pixels of the tile
double ssim_tile(const SsimChannel& channel, SsimTerm term, scene::Rect tile);

/// Smooth L1 of one row.
///   mask     [n] or null
///   v        [n], slope * gradient is added
///   returns  the sum over the row
double smooth_l1_row(const float* rendered, const float* target, const std::uint8_t* mask, int n, SmoothL1 kind,
                     float scale, float slope, float* v);

}  // namespace engine::optim
