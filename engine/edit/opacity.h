// Opacities of the copy-and-paste step.
#pragma once

#include <algorithm>
#include <cmath>

#include "engine/edit/request.h"

namespace engine::edit {

/// Splats below this are not blended by any 3DGS rasteriser.
constexpr double faintest_visible = 1.0 / 255;

/// Opacity of a stored logit. Saturates beyond +-30, where float opacities are 0 and 1 anyway, so that exp stays finite
/// and every Gaussian keeps some weight in an average.
inline double opacity(float logit) { return 1 / (1 + std::exp(-std::clamp(double(logit), -30.0, 30.0))); }

/// Logit of the opacity an original is lowered to: 0.01 in a move (about to vanish, unless the optimisation wants it
/// back), 0.5 in an extend. Opacity grows with its logit, so min(alpha, keep) is the smaller logit, without rounding.
inline float keep_logit(Mode mode) { return mode == Mode::move ? float(std::log(0.01 / 0.99)) : 0.0f; }

}  // namespace engine::edit
