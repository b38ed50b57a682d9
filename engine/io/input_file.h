// Reading a file at given places, without believing anything about it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/file_descriptor.h"
#include "engine/core/result.h"
#include "engine/io/read_options.h"

namespace engine::io {

/// A regular file, open for reading. Not mapped into memory: a file that someone cuts short while we read it is then
/// an error and not a SIGBUS, and its pages do not count as ours.
class InputFile {
 public:
  /// errors  not_found, invalid_argument (a folder, a device, a pipe), unavailable (not permitted)
  [[nodiscard]] static Result<InputFile> open(const std::filesystem::path& path);

  [[nodiscard]] std::uint64_t size() const { return size_; }       ///< Bytes, when it was opened.
  [[nodiscard]] const std::string& name() const { return name_; }  ///< Base name, for Error::where.

  /// From now on shows all that is read.
  void show_to(ReadWitness witness) { witness_ = std::move(witness); }

  /// Fills `into` from `offset` on; corrupt_data if the file ends first.
  [[nodiscard]] Result<void> read_at(std::uint64_t offset, std::span<std::byte> into) const;
  /// `size` bytes from `offset` on. The caller has checked that a vector of that size is acceptable.
  [[nodiscard]] Result<std::vector<std::byte>> read_at(std::uint64_t offset, std::uint64_t size) const;

 private:
  InputFile(FileDescriptor fd, std::filesystem::path path, std::uint64_t size);

  FileDescriptor fd_;
  std::filesystem::path path_;
  std::string name_;
  std::uint64_t size_ = 0;
  ReadWitness witness_;
};

}  // namespace engine::io
