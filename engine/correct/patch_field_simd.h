// The inner part of improve(), in vectors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/correct/patch_field.h"

namespace engine::correct {

/// improve() for centres [begin, end).
void improve_range(const PatchQuery& query, std::span<const PatchMatch> matches, int step, std::uint64_t seed,
                   std::size_t begin, std::size_t end, std::span<PatchMatch> out);

}  // namespace engine::correct
