#include "engine/edit/paste.h"

#include <algorithm>
#include <cassert>

#include "engine/core/parallel.h"

namespace engine::edit {

std::vector<std::uint32_t> copy_and_paste(WorkingScene& working, const PlannedMotion& motion, Mode mode,
                                          bool rotate_sh) {
  assert(motion.deformation.size() == motion.rows.size());
  std::vector<std::uint32_t> left_behind;  // rows that need a new row for their copy
  std::vector<std::uint32_t> copies;       // where each moving Gaussian is written
  std::vector<std::size_t> entries;        // its entry of the deformation
  for (std::size_t k = 0; k < motion.rows.size(); ++k) {
    const std::uint32_t row = motion.rows[k];
    working.note_mean(row);
    if (motion.removes) left_behind.push_back(row);
    if (!motion.deformation.moves[k]) continue;
    entries.push_back(k);
    if (mode == Mode::move && working.role()[row] == working::Role::copy) {
      copies.push_back(row);
    } else {
      copies.push_back(std::uint32_t(working.size() + left_behind.size()));
      left_behind.push_back(row);
    }
  }
  if (!motion.removes)
    working.append(working.cloud(), left_behind, std::vector<working::Role>(left_behind.size(), working::Role::copy),
                   left_behind);
  for (const std::uint32_t row : left_behind) {
    float& logit = working.gaussians().opacity_logit[row];
    logit = std::min(logit, working::keep_logit(mode));
    working.leave_behind(row);
  }
  constexpr std::size_t grain = 512;  // turning SH of degree 3 costs a few microseconds a row
  parallel_for(entries.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k)
      deform::apply(motion.deformation, entries[k], rotate_sh, working.gaussians(), copies[k]);
  });
  const std::uint32_t first =
      working.append(working.cloud(), motion.continued,
                     std::vector<working::Role>(motion.continued.size(), working::Role::continued), motion.continued);
  for (std::uint32_t k = 0; k < motion.continued.size(); ++k) {
    working.gaussians().mean.set(first + k, Vec3(DVec3(working.cloud().mean.get(first + k)) + motion.shift[k]));
    copies.push_back(first + k);
  }
  std::sort(copies.begin(), copies.end());
  return copies;
}

}  // namespace engine::edit
