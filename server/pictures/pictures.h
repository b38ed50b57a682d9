// What is done with rendered pictures before they are shown.
#pragma once

#include "engine/core/vec.h"
#include "engine/scene/image.h"

namespace server::pictures {

/// What is singled out for people is tinted: magenta, which is rare in photographs, and so much that the picture still
/// shows. A choice.
inline const engine::Vec3 tint_color{1.0f, 0.1f, 0.6f};
inline constexpr float tint_share = 0.5f;

/// The picture with the pixels of the mask tinted. Both have the same size.
[[nodiscard]] engine::scene::Image with_mask_shown(const engine::scene::Image& picture,
                                                   const engine::scene::Mask& mask);

/// PSNR in dB, peak 1, over the pixels that are not in the mask; infinity if those are equal or there are none.
[[nodiscard]] double psnr_outside(const engine::scene::Image& a, const engine::scene::Image& b,
                                  const engine::scene::Mask& mask);

/// Values limited to 0..1, as a photo has them.
[[nodiscard]] engine::scene::Image clamped(engine::scene::Image picture);

/// Mean depth of what is seen: sum of w z over alpha; 0 where alpha is below 1/255.
[[nodiscard]] engine::scene::Image mean_depth(const engine::scene::Image& depth, const engine::scene::Image& alpha);

/// Depth as shades for people: white is the nearest, dark grey the farthest point of the picture, black is nothing.
[[nodiscard]] engine::scene::Image shaded_depth(const engine::scene::Image& mean_depth);

}  // namespace server::pictures
