#include "engine/optim/schedule.h"

#include <utility>

namespace engine::optim {

Result<void> validate(const LearningRates& rates) {
  for (const auto& [value, name] : {std::pair{rates.position, "position"},
                                    {rates.sh_dc, "sh_dc"},
                                    {rates.sh_rest, "sh_rest"},
                                    {rates.opacity_logit, "opacity_logit"},
                                    {rates.log_scale, "log_scale"},
                                    {rates.rotation, "rotation"}})
    if (!(value >= 0 && std::isfinite(value)))
      return fail(ErrorCode::invalid_argument, "A learning rate must be 0 or more.", name);
  if (!(rates.mask_radii > 0 && std::isfinite(rates.mask_radii)))
    return fail(ErrorCode::invalid_argument, "The number of mask radii must be above 0.", "mask_radii");
  if (!(rates.most_widths > 0))
    return fail(ErrorCode::invalid_argument, "The number of widths must be above 0.", "most_widths");
  if (!(rates.last > 0 && rates.last <= 1))
    return fail(ErrorCode::invalid_argument, "The last factor on the learning rates must be above 0 and at most 1.",
                "last");
  return {};
}

}  // namespace engine::optim
