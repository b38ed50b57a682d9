#include "engine/working/working_scene.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <utility>

#include "engine/core/rows.h"
#include "engine/scene/cloud_arrays.h"
#include "engine/scene/opacity.h"
#include "engine/working/mode.h"

namespace engine::working {
namespace {

/// Every column has a value for each row.
bool is_whole(const Members& members) {
  const std::size_t count = members.cloud.size();
  return members.inputs.size() <= count && members.role.size() == count && members.handle.size() == count &&
         members.parent.size() == count && members.mean_at_deform.x.size() == count &&
         members.mean_at_deform.y.size() == count && members.mean_at_deform.z.size() == count;
}

/// Every number is one: what comes from disk may be anything.
bool is_finite(const Members& members) {
  const auto all = [](const std::vector<float>& values) {
    return std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
  };
  return !scene::first_not_finite(members.cloud) && all(members.mean_at_deform.x) && all(members.mean_at_deform.y) &&
         all(members.mean_at_deform.z);
}

}  // namespace

float keep_logit(Mode mode) { return mode == Mode::move ? float(scene::logit(0.01)) : 0.0f; }

WorkingScene::WorkingScene(const scene::GaussianCloud& input, const Frame& frame, HandleColumn handle)
    : frame_(frame),
      input_rows_(input.size()),
      cloud_(frame.edit_from_world(input)),
      handle_(std::move(handle)),
      role_(input.size()),
      parent_(input.size()),
      mean_at_deform_(cloud_.mean) {
  assert(handle_.size() == input.size());
  std::transform(handle_.begin(), handle_.end(), role_.begin(),
                 [](std::uint16_t owner) { return owner == 0 ? Role::frozen : Role::held; });
  std::iota(parent_.begin(), parent_.end(), 0u);
}

std::vector<std::uint32_t> WorkingScene::dragged_rows() const { return rows_where(role_, is_dragged); }

std::vector<std::uint32_t> WorkingScene::rows_that_left() const { return rows_where(role_, has_left); }

std::vector<std::uint32_t> WorkingScene::member_rows() const {
  return rows_where(role_, [](Role role) { return role != Role::frozen; });
}

std::vector<std::uint32_t> WorkingScene::rows_of(Role role) const {
  return rows_where(role_, [&](Role other) { return other == role; });
}

std::uint32_t WorkingScene::append(const scene::GaussianCloud& from, std::span<const std::uint32_t> rows,
                                   std::span<const Role> role, std::span<const std::uint32_t> ancestor) {
  assert(rows.size() == role.size() && rows.size() == ancestor.size());
  const auto first = std::uint32_t(size());
  scene::append_rows(cloud_, from, rows);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    assert(!is_of_input(role[k]) && (role[k] != Role::copy || handle_[ancestor[k]] != 0));
    role_.push_back(role[k]);
    handle_.push_back(is_dragged(role[k]) ? handle_[ancestor[k]] : std::uint16_t{0});
    parent_.push_back(parent_[ancestor[k]]);
    mean_at_deform_.push_back(mean_at_deform_.get(ancestor[k]));
  }
  return first;
}

void WorkingScene::leave_behind(std::uint32_t row) {
  assert(is_dragged(role_[row]));
  handle_[row] = 0;
  role_[row] = row < input_rows_ ? Role::original : Role::trail;
}

void WorkingScene::relight(std::uint32_t row) {
  assert(stays(role_[row]));
  role_[row] = Role::relit;
}

void WorkingScene::give_up(std::uint32_t row) {
  assert(stays(role_[row]));
  role_[row] = Role::original;
  float& logit = cloud_.opacity_logit[row];
  logit = std::min(logit, keep_logit(Mode::move));
}

bool WorkingScene::check() const {
  const std::size_t n = size();
  if (input_rows_ > n || cloud_.size() != n || handle_.size() != n || parent_.size() != n ||
      mean_at_deform_.x.size() != n || mean_at_deform_.y.size() != n || mean_at_deform_.z.size() != n)
    return false;
  for (std::size_t row = 0; row < n; ++row) {
    if (is_of_input(role_[row]) != (row < input_rows_)) return false;
    if (is_dragged(role_[row]) != (handle_[row] != 0)) return false;
    if (row < input_rows_ ? parent_[row] != row : parent_[row] >= input_rows_) return false;
  }
  return true;
}

scene::GaussianCloud WorkingScene::unedited(const scene::GaussianCloud& input,
                                            std::span<const std::uint32_t> rows) const {
  std::vector<std::uint32_t> of_input;
  for (const std::uint32_t row : rows)
    if (row < input_rows_) of_input.push_back(row);
  return frame_.edit_from_world(scene::gather(input, of_input));
}

void copy_row(const scene::GaussianCloud& from, std::size_t a, scene::GaussianCloud& to, std::size_t b) {
  scene::visit_arrays(
      [&](std::size_t stride, auto& target, const auto& source) {
        std::copy_n(source.begin() + std::ptrdiff_t(a * stride), stride, target.begin() + std::ptrdiff_t(b * stride));
      },
      to, from);
}

Members members_of(const WorkingScene& working) {
  Members members;
  const std::vector<std::uint32_t> rows = working.member_rows();
  for (const std::uint32_t row : rows) {
    if (row < working.input_rows_) members.inputs.push_back(row);
    members.role.push_back(working.role_[row]);
    members.handle.push_back(working.handle_[row]);
    members.parent.push_back(working.parent_[row]);
    members.mean_at_deform.push_back(working.mean_at_deform_.get(row));
  }
  members.cloud = scene::gather(working.cloud_, rows);
  return members;
}

Result<WorkingScene> restore(const Members& members, const scene::GaussianCloud& input, const Frame& frame) {
  const auto of_another = [] { return fail(ErrorCode::invalid_argument, "the rows are those of another scene"); };
  if (!is_whole(members) || !is_finite(members) || members.cloud.sh_degree != input.sh_degree ||
      members.cloud.extra_stride != input.extra_stride)
    return of_another();
  WorkingScene working(input, frame, HandleColumn(input.size(), 0));
  const std::size_t inputs = members.inputs.size();
  for (std::size_t k = 0; k < inputs; ++k) {
    const std::uint32_t row = members.inputs[k];
    const bool ascends = k == 0 || row > members.inputs[k - 1];
    if (row >= input.size() || !ascends || members.role[k] == Role::frozen) return of_another();
    copy_row(members.cloud, k, working.cloud_, row);
    working.role_[row] = members.role[k];
    working.handle_[row] = members.handle[k];
    working.parent_[row] = members.parent[k];
    working.mean_at_deform_.set(row, members.mean_at_deform.get(k));
  }
  std::vector<std::uint32_t> appended(members.cloud.size() - inputs);
  std::iota(appended.begin(), appended.end(), std::uint32_t(inputs));
  scene::append_rows(working.cloud_, members.cloud, appended);
  for (const std::uint32_t k : appended) {
    working.role_.push_back(members.role[k]);
    working.handle_.push_back(members.handle[k]);
    working.parent_.push_back(members.parent[k]);
    working.mean_at_deform_.push_back(members.mean_at_deform.get(k));
  }
  if (!working.check()) return of_another();
  return working;
}

}  // namespace engine::working
