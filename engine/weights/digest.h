// Whether networks are those of before: a digest of what was read of them.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "engine/weights/safetensors.h"

namespace engine::weights {

/// XXH3 with 64 bits of all that is added, in its order. Against accidents, not against forgers.
/// Source: Y. Collet, xxHash, whose output is fixed since 0.8.0.
class Digest {
 public:
  Digest();
  ~Digest();
  Digest(Digest&&) noexcept;
  Digest& operator=(Digest&&) noexcept;

  /// Their number, too: "ab" and "c" are others than "a" and "bc".
  void add(std::span<const std::byte> bytes);
  void add(std::string_view text) { add(std::as_bytes(std::span(text.data(), text.size()))); }
  /// Name, type, shape and numbers. Reads them, at several gigabytes a second.
  void add(std::string_view name, const StoredTensor& tensor);
  [[nodiscard]] std::string text() const;  ///< 16 hexadecimal digits.

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace engine::weights
