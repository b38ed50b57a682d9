// A checksum for bytes that only this program writes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace engine {

/// FNV-1a, 64 bits: any one changed byte changes it. Against accidents, not against forgers.
/// Source: Fowler, Noll and Vo, draft-eastlake-fnv.
[[nodiscard]] constexpr std::uint64_t fnv1a(std::span<const std::byte> bytes) noexcept {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const std::byte byte : bytes) hash = (hash ^ std::uint64_t(byte)) * 0x100000001b3u;
  return hash;
}

}  // namespace engine
