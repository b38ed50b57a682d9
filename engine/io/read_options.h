// What a caller may choose about reading scenes, and the limits every reader keeps.
#pragma once

#include <cstdint>

namespace engine::io {

/// The frame an .spz file is taken to be in; its header does not tell.
enum class SpzFrame {
  rub,       ///< Right, up, back, as the format's own library writes; turned into right, down, forward as in a .ply.
  as_stored  ///< Numbers as they are, for tools that write .spz without converting.
};

/// How a scene file is read. The limits are choices.
struct ReadOptions {
  std::uint64_t max_gaussians = 50'000'000;  ///< Larger files are refused (too_large).
  std::uint64_t max_memory_bytes = std::uint64_t(16)
                                   << 30;  ///< Size of the scene in memory; more is refused (too_large).
  SpzFrame spz_frame = SpzFrame::rub;
};

}  // namespace engine::io
