// What becomes of the place that a dragged part comes from.
#pragma once

#include "engine/params/choices.h"

namespace engine::working {

using params::Mode;

/// Logit of the opacity an original is lowered to: 0.01 in a move (about to vanish, unless nothing else fills its
/// place and the optimisation wants it back), 0.5 in an extend. Opacity grows with its logit, so min(alpha, keep) is
/// the smaller logit, without rounding.
[[nodiscard]] float keep_logit(Mode mode);

}  // namespace engine::working
