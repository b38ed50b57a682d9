// What a caller may choose about reading scenes, and the limits every reader keeps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "engine/core/memory_budget.h"

namespace engine::io {

/// Is shown what is read of a file, as it is read: the place of the first byte, and the bytes. Some may be shown twice,
/// or not at all, where a reader has no use for them.
using ReadWitness = std::function<void(std::uint64_t offset, std::span<const std::byte> bytes)>;

/// The frame an .spz file is taken to be in.
enum class SpzFrame {
  declared,  ///< What an extension declares, else right, up, back, as the format's own library writes; turned into
             ///< right, down, front as in a .ply.
  as_stored  ///< Numbers as they are, for tools that write .spz without converting.
};

/// How a scene file is read. The limits are choices.
struct ReadOptions {
  std::uint64_t max_gaussians = 50'000'000;  ///< Larger files are refused (too_large).
  std::uint64_t max_memory_bytes = std::uint64_t(16)
                                   << 30;  ///< Size of the scene in memory; more is refused (too_large).
  SpzFrame spz_frame = SpzFrame::declared;
  int level = 0;                   ///< Of detail, of a streamed SOG: 0 is the finest.
  ReadWitness witness = {};        ///< Of a scene's file: for a checksum that costs no reading of its own.
  MemoryBudget* memory = nullptr;  ///< Lends what unpacking takes beside the scene; null: nobody counts it.
};

}  // namespace engine::io
