// What repeats in a picture goes on where nothing is known of it: checks, stripes, tiles, the pattern of a wall.
// Source: He and Sun 2012, "Statistics of patch offsets for image completion", section 2: few shifts explain most of a
// picture. Theirs are counted over nearest patches, and a cut chooses one for each pixel; here the surroundings of the
// hole are compared as a whole, and the shifts that hold around a pixel foretell it together.
#pragma once

#include "engine/scene/image.h"

namespace engine::correct {

/// Fills the pixels of a hole that repetitions foretell: around which the picture comes out alike under a shift that
/// leads to something known. Returns which; all others stay as they are. A hole of fewer than 16 x 16 pixels is filled
/// from its rim as well, and is left alone; so is one in surroundings of one colour.
///   picture  [3] finite, where it is not known as well
///   known    in the picture's size: pixels to go by
///   hole     in the picture's size: pixels wanted, if they are not known
/// Same bytes for any number of threads. Takes up to 320 bytes for each pixel of the hole, and 16 for each of the
/// picture and thread.
[[nodiscard]] scene::Mask continue_repeats(scene::Image& picture, const scene::Mask& known, const scene::Mask& hole);

}  // namespace engine::correct
