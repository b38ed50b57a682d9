// Random overlays, for tests of whatever handles them.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/core/rng.h"
#include "engine/scene/overlay.h"

namespace engine::scene {

/// Removes and changes some of the base's rows and adds others. `like` makes rows: like(n, seed) has the base's shape.
template <class MakeRows>
Overlay random_overlay(std::size_t base_rows, std::size_t added, std::uint64_t seed, MakeRows&& like) {
  Overlay overlay;
  Rng rng(seed, 5);
  for (std::size_t i = 0; i < base_rows; ++i) {
    const std::uint32_t die = rng.below(5);
    if (die == 0) overlay.removed.push_back(std::uint32_t(i));
    if (die == 1) overlay.changed.push_back(std::uint32_t(i));
  }
  overlay.rows = like(overlay.changed.size() + added, seed + 1);
  return overlay;
}

}  // namespace engine::scene
