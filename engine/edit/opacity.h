// Opacities of the copy-and-paste step.
#pragma once

#include "engine/edit/request.h"
#include "engine/scene/opacity.h"

namespace engine::edit {

/// Logit of the opacity an original is lowered to: 0.01 in a move (about to vanish, unless the optimisation wants it
/// back), 0.5 in an extend. Opacity grows with its logit, so min(alpha, keep) is the smaller logit, without rounding.
inline float keep_logit(Mode mode) { return mode == Mode::move ? float(scene::logit(0.01)) : 0.0f; }

}  // namespace engine::edit
