// Zip files in memory: the files within one, and one made of files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/core/memory_budget.h"
#include "engine/core/result.h"

struct zip;

namespace engine::io {

/// Do these first bytes of a file say zip?
[[nodiscard]] bool looks_like_zip(std::span<const std::byte> bytes);

/// A file out of an archive, and the memory lent for it.
struct UnpackedFile {
  std::vector<std::byte> bytes;
  MemoryBudget::Share memory;
};

/// A zip file from a stranger. Believes its directory only as far as the bytes bear it out.
class ZipArchive {
 public:
  ///   bytes   outlive this
  ///   file    for error addresses
  ///   errors  corrupt_data: no zip file, damaged; too_large: more than `max_entries` files
  [[nodiscard]] static Result<ZipArchive> open(std::span<const std::byte> bytes, const std::string& file,
                                               std::uint64_t max_entries = 10'000);

  /// Names of the files, and where they are in the directory.
  [[nodiscard]] const std::map<std::string, std::uint64_t>& names() const { return names_; }

  /// A file whole.
  ///   most    bytes; asked of what comes out, not of what the directory says
  ///   errors  not_found; too_large: more than `most`, or than the budget; corrupt_data
  ///           unsupported: encrypted, or packed in a way we do not know
  ///   `where` is "<file>:<name>"
  [[nodiscard]] Result<UnpackedFile> read(const std::string& name, std::uint64_t most, MemoryBudget* budget) const;

 private:
  struct Discard {
    void operator()(zip* archive) const;
  };
  std::unique_ptr<zip, Discard> archive_;
  std::string file_;
  std::map<std::string, std::uint64_t> names_;
};

/// A file for an archive.
struct NamedFile {
  std::string name;
  std::vector<std::byte> bytes;
};

/// A zip file of these files in their order, stored as they are: the same bytes every time, with one date for all.
///   errors  invalid_argument: no files; internal: libzip fails
[[nodiscard]] Result<std::vector<std::byte>> make_zip(std::span<const NamedFile> files);

}  // namespace engine::io
