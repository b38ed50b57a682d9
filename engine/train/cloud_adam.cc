#include "engine/train/cloud_adam.h"

#include <array>
#include <vector>

namespace engine::train {
namespace {

/// The groups of parameters, in the order of step(). Named as in a .ply file where that has one name for them.
std::vector<optim::AdamLayout> layout(int sh_degree) {
  std::vector<optim::AdamLayout> groups;
  for (const char* name :
       {"x", "y", "z", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3", "opacity"})
    groups.push_back({name, 1});
  groups.push_back({"sh", 3 * scene::sh_coefficients(sh_degree)});
  return groups;
}

}  // namespace

CloudAdam::CloudAdam(std::size_t rows, int sh_degree, const optim::AdamOptions& options)
    : adam_(layout(sh_degree), rows, options) {}

Result<void> CloudAdam::step(scene::GaussianCloud& cloud, const render::Gradients& g, const IterationRates& rates,
                             const Mobility& mobility) {
  const std::array<double, 1> position{rates.position}, scale{rates.log_scale}, rotation{rates.rotation},
      opacity{rates.opacity_logit};
  std::vector<double> sh(cloud.sh_stride(), rates.sh_rest);
  for (std::size_t c = 0; c < 3; ++c) sh[c * scene::sh_coefficients(cloud.sh_degree)] = rates.sh_dc;
  const std::array<optim::AdamGroup, 12> groups{{{cloud.mean.x, g.mean.x, position, mobility.position},
                                                 {cloud.mean.y, g.mean.y, position, mobility.position},
                                                 {cloud.mean.z, g.mean.z, position, mobility.position},
                                                 {cloud.log_scale.x, g.log_scale.x, scale, mobility.others},
                                                 {cloud.log_scale.y, g.log_scale.y, scale, mobility.others},
                                                 {cloud.log_scale.z, g.log_scale.z, scale, mobility.others},
                                                 {cloud.rotation.w, g.rotation.w, rotation, mobility.others},
                                                 {cloud.rotation.x, g.rotation.x, rotation, mobility.others},
                                                 {cloud.rotation.y, g.rotation.y, rotation, mobility.others},
                                                 {cloud.rotation.z, g.rotation.z, rotation, mobility.others},
                                                 {cloud.opacity_logit, g.opacity_logit, opacity, mobility.others},
                                                 {cloud.sh, g.sh, sh, mobility.others}}};
  return adam_.step(groups);
}

}  // namespace engine::train
