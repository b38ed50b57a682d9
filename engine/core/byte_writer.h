// Little-endian values into bytes: what a ByteReader reads back.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "engine/core/byte_reader.h"

namespace engine {

/// Bytes that grow at their end.
class ByteWriter {
 public:
  template <Scalar T>
  void write(T value) {
    write_all(std::span<const T>(&value, 1));
  }
  /// The values themselves; how many there are is for the caller to write down.
  template <class T>
  requires Scalar<std::remove_const_t<T>>
  void write_all(std::span<T> values) {
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
  }
  /// Its length in 32 bits, then its characters.
  void write_string(std::string_view text) {
    write(std::uint32_t(text.size()));
    bytes_.append(text);
  }

  [[nodiscard]] std::span<const std::byte> bytes() const { return std::as_bytes(std::span(bytes_)); }
  [[nodiscard]] std::string take() && { return std::move(bytes_); }

 private:
  std::string bytes_;
};

}  // namespace engine
