// Counter-based random numbers: the n-th number of a stream is a pure function of (seed, stream, n), so results do not
// depend on the order in which threads ask.
// Source: Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3", Philox4x32-10.
#pragma once

#include <array>
#include <cstdint>

namespace engine {

/// One block of four random words for a key and a 128-bit counter.
[[nodiscard]] std::array<std::uint32_t, 4> philox4x32(std::array<std::uint32_t, 4> counter,
                                                      std::array<std::uint32_t, 2> key) noexcept;

/// A seed of its own for each purpose (four numbers) of a seed: 64 bits of philox. Whoever is given one may count up
/// from it for more: ranges of two of them overlap only by chance, which for a million seeds each is below 2^-40.
[[nodiscard]] std::uint64_t derived_seed(std::uint64_t seed, std::array<std::uint32_t, 4> purpose) noexcept;

/// A stream of numbers named by (seed, stream). Cheap to make: give every Gaussian, view or iteration its own.
class Rng {
 public:
  explicit Rng(std::uint64_t seed, std::uint64_t stream = 0) noexcept : seed_(seed), stream_(stream) {}

  [[nodiscard]] std::uint32_t next() noexcept;
  [[nodiscard]] float uniform() noexcept;                       ///< in [0, 1)
  [[nodiscard]] float uniform(float low, float high) noexcept;  ///< in [low, high)
  [[nodiscard]] float normal() noexcept;                        ///< mean 0, variance 1
  [[nodiscard]] std::uint32_t below(std::uint32_t n) noexcept;  ///< in [0, n); n > 0

 private:
  std::uint64_t seed_, stream_;
  std::uint64_t block_ = 0;
  std::array<std::uint32_t, 4> words_{};
  unsigned used_ = 4;
};

}  // namespace engine
