#include "engine/deform/deform.h"

#include <cassert>

#include "engine/core/parallel.h"
#include "engine/scene/rotate_sh.h"
#include "engine/scene/stretch.h"

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

Deformation at_rest(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows) {
  Deformation out;
  out.mean.resize(rows.size());
  out.rotation.resize(rows.size());
  for (std::size_t k = 0; k < rows.size(); ++k) {
    out.mean.set(k, cloud.mean.get(rows[k]));
    out.rotation.set(k, cloud.rotation.get(rows[k]));
  }
  out.turn.assign(rows.size(), DQuat(1, 0, 0, 0));
  out.moves.assign(rows.size(), 0);
  out.stretches.assign(rows.size(), 0);
  out.map.assign(rows.size(), DMat3(1.0));
  return out;
}

Deformation deformation(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                        const RigidMotion& motion) {
  Deformation out = at_rest(cloud, rows);
  const DMat3 map = motion.scale * glm::mat3_cast(motion.turn);
  const bool turns = motion.turn != DQuat(1, 0, 0, 0) || motion.scale != 1;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const DVec3 old_mean(out.mean.get(k));
    const Quat old_rotation = out.rotation.get(k);
    // The motion, written so that a shift alone is one, and none is exactly none.
    const DVec3 arm = old_mean - motion.centre;
    const Vec3 mean(old_mean + (turns ? motion.shift + (map * arm - arm) : motion.shift));
    const Quat rotation(motion.turn * DQuat(old_rotation));
    out.moves[k] = mean != out.mean.get(k) || rotation != old_rotation || motion.scale != 1;
    out.mean.set(k, mean), out.rotation.set(k, rotation);
    out.turn[k] = motion.turn;
    out.stretches[k] = motion.scale != 1;
    out.map[k] = map;
  }
  return out;
}

void scatter(const Deformation& from, std::span<const std::size_t> at, Deformation& into) {
  for (std::size_t k = 0; k < at.size(); ++k) {
    into.mean.set(at[k], from.mean.get(k)), into.rotation.set(at[k], from.rotation.get(k));
    into.turn[at[k]] = from.turn[k], into.moves[at[k]] = from.moves[k];
    into.stretches[at[k]] = from.stretches[k], into.map[at[k]] = from.map[k];
  }
}

void apply(const Deformation& deformation, std::size_t k, bool with_sh, scene::GaussianCloud& cloud, std::size_t row) {
  cloud.mean.set(row, deformation.mean.get(k));
  const DQuat& turn = deformation.turn[k];
  const bool stretches = !deformation.stretches.empty() && deformation.stretches[k] != 0;
  if (stretches) scene::stretch(cloud, row, deformation.map[k]);
  if (turn.w == 1 && turn.x == 0 && turn.y == 0 && turn.z == 0) return;  // also -0.0 in the quaternion stays
  if (!stretches) cloud.rotation.set(row, deformation.rotation.get(k));
  if (!with_sh || cloud.sh_degree == 0) return;
  const scene::ShRotation rotation = scene::sh_rotation(turn);
  const std::size_t count = scene::sh_coefficients(cloud.sh_degree);
  for (std::size_t channel = 0; channel < 3; ++channel)
    scene::rotate_sh(rotation, cloud.sh_row(row).subspan(channel * count, count));
}

}  // namespace engine::deform
