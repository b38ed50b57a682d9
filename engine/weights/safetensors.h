// Tensors in files, as pre-trained networks are published: read where they lie, written whole.
// Source: the safetensors format, https://github.com/huggingface/safetensors ("Format"): u64 length of the header, the
// header in JSON, then the tensors' bytes, little-endian, row-major, without holes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"

namespace engine::weights {

using Shape = std::vector<std::int64_t>;

/// "[320, 4, 3, 3]"
[[nodiscard]] std::string text_of(const Shape& shape);

/// A tensor where it lies in its file. The bytes live as long as TensorFile::owner().
struct StoredTensor {
  std::string dtype;  ///< As the file says it: "F16", "BF16", "F32" are numbers that read_floats() reads.
  Shape shape;        ///< Outermost first; empty for a single number.
  std::span<const std::byte> bytes;

  [[nodiscard]] std::uint64_t elements() const;  ///< Of a file's tensors it never overflows.
  /// Are its numbers of a type that read_floats() reads? Then elements() is no more than there are bytes: only such a
  /// tensor may be given memory for its numbers.
  [[nodiscard]] bool has_floats() const;
};

/// What a header may ask for. The largest that is known, of Stable Diffusion in one file, has 1,131 tensors in 150 KB.
constexpr std::uint64_t max_header_bytes = std::uint64_t{16} << 20;
constexpr std::size_t max_tensors = 1 << 16;
constexpr std::size_t max_metadata = 1 << 12;  // trainers write some dozens of texts
constexpr std::size_t max_dimensions = 8;

/// A safetensors file. Nothing of it is believed before it was checked: that each tensor has the bytes its type and
/// shape ask for, that tensors lie within the file, do not overlap and leave no hole.
class TensorFile {
 public:
  using Tensors = std::map<std::string, StoredTensor, std::less<>>;

  /// Mapped into memory, read only: several jobs and processes share one copy, and what nobody asks for is never read.
  /// A file that is cut short while it is in use ends the process (SIGBUS): models are installed, never uploaded.
  ///   errors  not_found, invalid_argument (no regular file); unsupported: a pickle (.ckpt, .pt, .bin), by its name or
  ///           its first bytes; corrupt_data, too_large (header): `where` is "FILE:header" or "FILE:TENSOR"
  [[nodiscard]] static Result<TensorFile> open(const std::filesystem::path& path);
  /// The same of a file in memory.
  ///   name  of the file, for errors
  [[nodiscard]] static Result<TensorFile> parse(std::vector<std::byte> bytes, std::string name);

  [[nodiscard]] const std::string& name() const { return name_; }  ///< Base name.
  [[nodiscard]] const Tensors& tensors() const { return tensors_; }
  [[nodiscard]] const std::map<std::string, std::string>& metadata() const { return metadata_; }
  [[nodiscard]] const StoredTensor* find(std::string_view tensor) const;  ///< Null if there is none of that name.
  [[nodiscard]] const std::shared_ptr<const void>& owner() const { return owner_; }

 private:
  std::string name_;
  std::shared_ptr<const void> owner_;
  Tensors tensors_;
  std::map<std::string, std::string> metadata_;

  static Result<TensorFile> read(std::span<const std::byte> bytes, std::string name, std::shared_ptr<const void> owner);
};

/// The numbers of a tensor, widened to float.
///   where   address of the tensor, for errors: "unet.safetensors:conv_in.weight"
///   into    as many as the tensor has elements
///   errors  unsupported: not has_floats(); corrupt_data: NaN or infinity, `where` with its index
[[nodiscard]] Result<void> read_floats(const StoredTensor& tensor, const std::string& where, std::span<float> into);

/// The numbers of an F32 tensor where they lie, which costs nothing; empty for other types, and where the address is
/// not that of a float.
///   errors  corrupt_data: NaN or infinity, as of read_floats()
[[nodiscard]] Result<std::span<const float>> floats_in_place(const StoredTensor& tensor, const std::string& where);

/// A tensor to write.
struct FloatTensor {
  Shape shape;
  std::vector<float> values;  ///< Row-major.
};

/// A file of F32 tensors, the same bytes every time.
[[nodiscard]] std::string encode_tensors(const std::map<std::string, FloatTensor>& tensors,
                                         const std::map<std::string, std::string>& metadata = {});

}  // namespace engine::weights
