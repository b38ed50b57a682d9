// What a zip file says about its directory, before anybody loads that.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>

#include "engine/core/result.h"

namespace engine::io {

/// What an end record says.
struct ZipDirectory {
  std::uint64_t entries = 0;
  std::uint64_t bytes = 0;  ///< Size of the directory itself.
};

/// The largest numbers that any end record within reach of the file's end gives, in its form for large files (zip64)
/// too: which of several a reader will believe need not be known. Zeros if there is none: then it is no zip file.
///   errors  those of io::InputFile
[[nodiscard]] Result<ZipDirectory> largest_directory(const std::filesystem::path& zip);
/// The same of a zip file in memory.
[[nodiscard]] ZipDirectory largest_directory(std::span<const std::byte> zip);

}  // namespace engine::io
