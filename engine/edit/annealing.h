// How the strength of a correction falls within an interval.
// Source: 3DGS-Drag (ICLR 2025), section 3.4, "Annealed Dataset Editing", eq. 5.
#pragma once

#include "engine/edit/request.h"

namespace engine::edit {

/// S(a), a = 1..A: from params.strength_initial to params.strength_final, as params.annealing says.
[[nodiscard]] double strength_of(const Params& params, int a);

}  // namespace engine::edit
