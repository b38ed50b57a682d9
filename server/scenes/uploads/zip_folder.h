// Unpacks zip files from strangers, within limits.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "engine/core/result.h"

namespace server::scenes {

using engine::Result;

struct ZipLimits {
  std::uint64_t max_bytes = std::uint64_t{8} << 30;  ///< --max-dataset-bytes: unpacked, all files together.
  /// --max-dataset-files: files and folders, those included that a longer name implies.
  std::size_t max_files = 20'000;
  /// Unpacked bytes per byte of the zip file. Photos come to 1, text files of cameras to 5.
  std::uint64_t max_ratio = 100;
  /// Bytes that may be unpacked whatever the ratio: small files of zeros are no attack.
  std::uint64_t free_bytes = std::uint64_t{64} << 20;
};

/// Unpacks a zip file into an empty folder. Limits are enforced on the bytes that come out, not on what headers say;
/// nothing is written outside the folder. On an error the folder holds whatever had been unpacked: its owner removes
/// it. Not synced.
///   name    of the zip file, for `where`
///   errors  corrupt_data: no zip file, damaged, cut short, two entries of one name;
///           unsupported: encrypted or compressed in a way we do not know;
///           too_large: names the limit;
///           invalid_argument: an entry with an absolute name, with "..", with control characters, a link or a device;
///           no_space. `where` is "<name>:<entry>".
[[nodiscard]] Result<void> unzip(const std::filesystem::path& zip, const std::string& name,
                                 const std::filesystem::path& into, const ZipLimits& limits);

}  // namespace server::scenes
