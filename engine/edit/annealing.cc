#include "engine/edit/annealing.h"

namespace engine::edit {

double strength_of(const Params& params, int a) {
  const int steps = params.annealing_steps;
  const double done = params.annealing == Annealing::paper ? double(a - 1) / steps
                      : steps > 1                          ? double(a - 1) / (steps - 1)
                                                           : 0;
  return params.strength_initial - done * (params.strength_initial - params.strength_final);
}

}  // namespace engine::edit
