// A version of a scene on disk: what it changes, beside the base.
//
// Little-endian: "SDOVERLY", format number (u32), 0 (u32); rows, SH degree, opaque bytes a row and a CRC-32 of the
// means of the base (u64, i32, u64, u32); number of removed and of changed rows (u64 each), the lists (u32 each), the
// rows (scene/cloud_bytes.h); a CRC-32 of all that. It is this program's own: to be read where it was written.
#pragma once

#include <filesystem>

#include "engine/core/result.h"
#include "engine/io/read_options.h"
#include "engine/scene/overlay.h"

namespace engine::io {

/// On disk, whole, when this returns (AtomicFile).
///   base    the cloud it was made for
///   errors  no_space, not_found (no such folder), unavailable; internal: a value is NaN or infinite
[[nodiscard]] Result<void> write_overlay(const std::filesystem::path& path, const scene::Overlay& overlay,
                                         const scene::GaussianCloud& base);

/// What write_overlay() wrote, valid for `base`.
///   options  max_gaussians of the result and max_memory_bytes of the overlay
///   errors   not_found; corrupt_data: damaged, or ends too early; unsupported: written by a later program; conflict:
///            made for another base; too_large. `where` is the file's name and what in it: "3:changed[2]"
[[nodiscard]] Result<scene::Overlay> read_overlay(const std::filesystem::path& path, const scene::GaussianCloud& base,
                                                  const ReadOptions& options = {});

}  // namespace engine::io
