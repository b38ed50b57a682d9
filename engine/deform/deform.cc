#include "engine/deform/deform.h"

#include <cassert>

#include "engine/core/parallel.h"
#include "engine/deform/rotate_sh.h"

namespace engine::deform {

Deformation deformation(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                        std::span<const std::uint16_t> handle_of, std::span<const HandleMotion> handles,
                        Interpolation interpolation) {
  Deformation result;
  result.mean.resize(rows.size());
  result.rotation.resize(rows.size());
  result.turn.resize(rows.size());
  result.moves.resize(rows.size());
  constexpr std::size_t grain = 1024;
  parallel_for(rows.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const std::size_t row = rows[k];
      assert(handle_of[row] != 0);
      const int group = handles[handle_of[row] - 1u].group;
      const Vec3 old_mean = cloud.mean.get(row);
      const Quat old_rotation = cloud.rotation.get(row);
      const GaussianMotion motion = gaussian_motion(DVec3(old_mean), handles, group, interpolation);
      const Vec3 mean(motion.mean);
      const Quat rotation(motion.rotation * DQuat(old_rotation));
      result.mean.set(k, mean);
      result.rotation.set(k, rotation);
      result.turn[k] = motion.rotation;
      result.moves[k] = mean != old_mean || rotation != old_rotation;
    }
  });
  return result;
}

void apply(const Deformation& deformation, std::size_t k, bool with_sh, scene::GaussianCloud& cloud, std::size_t row) {
  cloud.mean.set(row, deformation.mean.get(k));
  const DQuat& turn = deformation.turn[k];
  if (turn.w == 1 && turn.x == 0 && turn.y == 0 && turn.z == 0) return;  // also -0.0 in the quaternion stays
  cloud.rotation.set(row, deformation.rotation.get(k));
  if (!with_sh || cloud.sh_degree == 0) return;
  const ShRotation rotation = sh_rotation(turn);
  const std::size_t count = scene::sh_coefficients(cloud.sh_degree);
  for (std::size_t channel = 0; channel < 3; ++channel)
    rotate_sh(rotation, cloud.sh_row(row).subspan(channel * count, count));
}

}  // namespace engine::deform
