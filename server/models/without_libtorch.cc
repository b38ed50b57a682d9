// What edits use of the models, where nothing is there to compute them: a reason.
#include "server/models/models.h"

namespace server::models {

using engine::ErrorCode;
using engine::fail;

struct Models::Loaded {};

bool Models::has_libtorch() { return false; }
std::shared_ptr<Models::Loaded> Models::nothing_loaded() { return nullptr; }

Result<std::unique_ptr<engine::correct::Repainter>> Models::repainter(const engine::params::Params& /*params*/,
                                                                      const Wishes& /*wishes*/) const {
  return fail(ErrorCode::unsupported, no_sd_, "params.corrector");
}

RepainterCost Models::cost(const engine::params::Params& /*params*/, const std::string& /*lora*/) const { return {}; }

PerceptualCost Models::lpips_cost() const { return {}; }

Result<std::unique_ptr<engine::optim::PerceptualLoss>> Models::lpips() const {
  return fail(ErrorCode::unsupported, no_lpips_, "params.perceptual");
}

}  // namespace server::models
