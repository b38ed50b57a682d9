// Which pixels of a view an edit may change.
// Source: 3DGS-Drag (ICLR 2025), section 3.3, the local editing mask; the radius of the dilation is our choice.
#pragma once

#include "engine/scene/image.h"

namespace engine::mask {

/// Pixels in which the Gaussians of the 3D mask carry at least `threshold` of the picture.
///   weight   one channel: sum of the blending weights of the masked Gaussians, 0 to 1 (they were rendered as colour 1)
///   returns  same size as `weight`; a pixel that is not a number stays outside
[[nodiscard]] scene::Mask mask2d(const scene::Image& weight, float threshold = 0.5f);

/// Radius of the dilation for a picture of this height: 10 px at 512 px, in proportion, at least 1 px.
[[nodiscard]] int dilation_radius(int picture_height);

/// Pixels by which outlines of things are blurred in a picture of this height: 2 px at 512 px, in proportion, at
/// least 1.
[[nodiscard]] int blur_radius(int picture_height);

/// Sets every pixel whose centre is within `radius_px` (a disc, its rim included) of the centre of a set one.
/// Exact, O(pixels) for any radius; a radius of 0 or less changes nothing.
[[nodiscard]] scene::Mask dilate(const scene::Mask& mask, int radius_px);

/// Keeps the pixels whose disc of `radius_px` lies within the mask (and may reach beyond the picture). A radius of 0 or
/// less changes nothing.
[[nodiscard]] scene::Mask eroded(const scene::Mask& mask, int radius_px);

/// The union of the discs of `radius_px` that lie within the mask (and may reach beyond the picture): what is thinner
/// is lost, what is thicker stays as it is but for its corners. A radius of 0 or less changes nothing.
[[nodiscard]] scene::Mask opened(const scene::Mask& mask, int radius_px);

/// into |= other. Both have the same size (asserted).
void unite(scene::Mask& into, const scene::Mask& other);

}  // namespace engine::mask
