// Digests of stored files: a bit that flips on a disk, in memory or in a copy is found when the file is read.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "server/scenes/disk/disk.h"

namespace server::scenes {

using engine::Result;

/// XXH3 with 64 bits, as 16 hexadecimal digits: what `xxhsum -H3` prints. Against accidents, not against forgers.
/// Source: Y. Collet, xxHash, whose output is fixed since 0.8.0.
[[nodiscard]] std::string digest_of(std::span<const std::byte> bytes);
[[nodiscard]] inline std::string digest_of(std::string_view text) {
  return digest_of(std::as_bytes(std::span(text.data(), text.size())));
}
/// That of a file's bytes, read a piece at a time.
///   errors  those of InputFile
[[nodiscard]] Result<std::string> digest_of_file(const std::filesystem::path& file);

/// The digest of a file that somebody else reads, made of what they read: what is read in the order of the file costs
/// no second reading, and what was taken in is what was checked. For io::ReadOptions::witness.
class RunningDigest {
 public:
  RunningDigest();
  ~RunningDigest();
  RunningDigest(RunningDigest&&) = delete;

  void see(std::uint64_t offset, std::span<const std::byte> bytes);
  /// Reads what has not been seen, and holds it all against a digest. Once, at the end. Arguments and errors as
  /// check_digest().
  [[nodiscard]] Result<void> check(const std::filesystem::path& file, const std::string& digest,
                                   const std::string& where);

 private:
  friend Result<std::string> digest_of_file(const std::filesystem::path& file);
  [[nodiscard]] Result<std::string> finish(const std::filesystem::path& file);

  struct State;
  std::unique_ptr<State> state_;
  std::uint64_t seen_ = 0;  ///< Bytes from the file's beginning.
};

/// Whether a text can be a digest.
[[nodiscard]] bool is_digest(std::string_view text);

/// Reads the file and holds it against its digest; an empty digest is none, and nothing is read.
///   where   what to call the file in errors
///   errors  corrupt_data: it is not what was stored, or gone; unavailable: it may not be read
[[nodiscard]] Result<void> check_digest(const std::filesystem::path& file, const std::string& digest,
                                        const std::string& where);

/// Holds files against their digests, one that is asked for again and again not each time: a download in ranges comes
/// as hundreds of requests. A file that was found sound is taken to be so for `trust`, as long as its size, its times
/// and its place are the same. Safe to call from any thread.
class SoundFiles {
 public:
  explicit SoundFiles(std::chrono::seconds trust = std::chrono::seconds(60)) : trust_(trust) {}
  /// Arguments and errors as check_digest().
  [[nodiscard]] Result<void> check(const std::filesystem::path& file, const std::string& digest,
                                   const std::string& where);

 private:
  struct Found {
    FileStamp stamp;
    std::string digest;
    std::chrono::steady_clock::time_point until;
  };

  const std::chrono::seconds trust_;
  std::mutex mutex_;
  std::map<std::filesystem::path, Found> found_;
};

}  // namespace server::scenes
