// Little-endian values out of bytes that nobody has checked yet.
#pragma once

#include <algorithm>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>

namespace engine {

static_assert(std::endian::native == std::endian::little, "the formats read here are little-endian, as is the host");

template <class T>
concept Scalar = std::integral<T> || std::floating_point<T> || std::same_as<T, std::byte>;

/// A position in a span of bytes that never moves past its end. A read that does not fit gives zero (or nothing) and
/// leaves the reader failed for good, so a parser reads several fields and asks ok() once, before it believes them.
/// Ask has() before allocating for a count that the bytes themselves state.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] std::size_t offset() const { return offset_; }  ///< Bytes read so far.
  [[nodiscard]] std::size_t remaining() const { return bytes_.size() - offset_; }

  /// What was read makes no sense: nothing after it does either.
  void fail() { ok_ = false; }

  /// Are there `count` more items of `size` bytes each? Cannot overflow.
  [[nodiscard]] bool has(std::uint64_t count, std::uint64_t size = 1) const {
    return ok_ && (size == 0 || count <= remaining() / size);
  }

  template <Scalar T>
  [[nodiscard]] T read() {
    T value{};
    if (const auto bytes = take(sizeof(T)); !bytes.empty()) std::memcpy(&value, bytes.data(), sizeof(T));
    return value;
  }

  /// The next `count` items of `size` bytes each.
  [[nodiscard]] std::span<const std::byte> take(std::uint64_t count, std::uint64_t size = 1) {
    if (!(ok_ = has(count, size))) return {};
    const auto taken = bytes_.subspan(offset_, std::size_t(count * size));
    offset_ += taken.size();
    return taken;
  }

  /// As many values as `into` has room for; none of them if they do not all fit.
  template <Scalar T>
  void read_all(std::span<T> into) {
    if (const auto bytes = take(into.size(), sizeof(T)); !bytes.empty())
      std::memcpy(into.data(), bytes.data(), bytes.size());
  }

  /// A string of ByteWriter: its length in 32 bits, then its characters.
  [[nodiscard]] std::string read_string() {
    const auto bytes = take(read<std::uint32_t>());
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }

  /// The characters up to the next zero byte, which is read too. No zero byte: failed.
  [[nodiscard]] std::string read_c_string() {
    const auto rest = bytes_.subspan(offset_);
    const auto end = std::find(rest.begin(), rest.end(), std::byte{0});
    if (!(ok_ = ok_ && end != rest.end())) return {};
    const auto length = std::size_t(end - rest.begin());
    offset_ += length + 1;
    return {reinterpret_cast<const char*>(rest.data()), length};
  }

 private:
  std::span<const std::byte> bytes_;
  std::size_t offset_ = 0;
  bool ok_ = true;
};

}  // namespace engine
