// Is every number a number? Asked of files when they are read and of scenes before they are written.
#pragma once

#include <cstddef>
#include <optional>
#include <span>

namespace engine {

/// Index of the first NaN or infinity in `values`, if there is one. Looks at the bits, so no compiler flag can
/// optimise the question away.
[[nodiscard]] std::optional<std::size_t> first_not_finite(std::span<const float> values) noexcept;

}  // namespace engine
