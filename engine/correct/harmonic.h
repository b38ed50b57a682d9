// Smooth filling: the harmonic function with the values around it.
// Source: Perez et al. 2003, "Poisson image editing", section 2, without guidance.
#pragma once

#include "engine/scene/image.h"

namespace engine::correct {

/// Overwrites the unknown pixels of every channel with the solution of Laplace's equation that meets the known pixels
/// around them; at the rim of the picture nothing flows (Neumann). Where a patch of unknown pixels touches no known one
/// it keeps its values. Conjugate gradients in double; O(pixels^1.5).
///   unknown  in the picture's size
void fill_harmonic(scene::Image& image, const scene::Mask& unknown);

}  // namespace engine::correct
