// Rows by where their mean lies, or by number.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/core/soa.h"
#include "engine/select/operation.h"

namespace engine::select {

/// One byte per row: 1 if it is named, or selected.
using RowSet = std::vector<std::uint8_t>;

/// The rotation of a quaternion (w, x, y, z) of any length; none for one of length 0.
[[nodiscard]] DMat3 rotation_of(DQuat q);

// Each is one linear scan, computed in double. Precondition: validate() holds.
[[nodiscard]] RowSet rows_in(const Array3& mean, const Sphere& sphere);
[[nodiscard]] RowSet rows_in(const Array3& mean, const Box& box);
[[nodiscard]] RowSet rows_in(const Array3& mean, const Plane& plane);
[[nodiscard]] RowSet rows_in(const Array3& mean, const Rows& rows);

}  // namespace engine::select
