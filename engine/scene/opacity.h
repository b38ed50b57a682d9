// How a 3D Gaussian scene stores opacity: as its logit, of which training may take any step.
// Source: Kerbl et al. 2023, section 5.1 (opacity is the sigmoid of what is optimised).
#pragma once

#include <cmath>

namespace engine::scene {

/// What is stored for an opacity: log(p / (1 - p)), the inverse of render::opacity(). Rounded to float by whoever
/// stores it.
///   opacity  0 to 1; -infinity and infinity for the ends
[[nodiscard]] inline double logit(double opacity) { return std::log(opacity / (1 - opacity)); }

}  // namespace engine::scene
