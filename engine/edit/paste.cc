#include "engine/edit/paste.h"

#include <algorithm>
#include <cassert>

#include "engine/core/parallel.h"
#include "engine/edit/opacity.h"

namespace engine::edit {
namespace {

/// Appends a row like `row` for each of `rows`: the Gaussian and all columns.
void append_copies(WorkingScene& working, std::span<const std::uint32_t> rows) {
  scene::append_rows(working.cloud, working.cloud, rows);
  for (const std::uint32_t row : rows) {
    working.handle.push_back(working.handle[row]);
    working.role.push_back(Role::copy);
    working.parent.push_back(working.parent[row]);
    working.mean_at_deform.push_back(working.mean_at_deform.get(row));
  }
}

/// The row stays behind while its copy goes on.
void leave_behind(WorkingScene& working, std::uint32_t row, Mode mode) {
  float& logit = working.cloud.opacity_logit[row];
  logit = std::min(logit, keep_logit(mode));
  working.handle[row] = 0;
  working.role[row] = working.role[row] == Role::copy ? Role::trail : Role::original;
}

}  // namespace

std::vector<std::uint32_t> paste(WorkingScene& working, const deform::Deformation& deformation,
                                 std::span<const std::uint32_t> rows, Mode mode, bool rotate_sh) {
  assert(deformation.size() == rows.size());
  std::vector<std::uint32_t> left_behind;  // rows that need a new row for their copy
  std::vector<std::uint32_t> copies;       // where each moving Gaussian is written
  std::vector<std::size_t> entries;        // its entry of the deformation
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const std::uint32_t row = rows[k];
    working.mean_at_deform.set(row, working.cloud.mean.get(row));
    if (!deformation.moves[k]) continue;
    entries.push_back(k);
    if (mode == Mode::move && working.role[row] == Role::copy) {
      copies.push_back(row);
    } else {
      copies.push_back(std::uint32_t(working.role.size() + left_behind.size()));
      left_behind.push_back(row);
    }
  }
  append_copies(working, left_behind);
  for (const std::uint32_t row : left_behind) leave_behind(working, row, mode);
  constexpr std::size_t grain = 512;  // turning SH of degree 3 costs a few microseconds a row
  parallel_for(entries.size(), grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k)
      deform::apply(deformation, entries[k], rotate_sh, working.cloud, copies[k]);
  });
  return copies;
}

}  // namespace engine::edit
