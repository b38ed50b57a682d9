#include "engine/core/rng.h"

#include <cmath>
#include <numbers>

namespace engine {

std::array<std::uint32_t, 4> philox4x32(std::array<std::uint32_t, 4> c, std::array<std::uint32_t, 2> key) noexcept {
  // Multipliers and Weyl constants of the paper's Philox-4x32.
  constexpr std::uint64_t m0 = 0xD2511F53u, m1 = 0xCD9E8D57u;
  constexpr std::uint32_t w0 = 0x9E3779B9u, w1 = 0xBB67AE85u;
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t p0 = m0 * c[0], p1 = m1 * c[2];
    c = {std::uint32_t(p1 >> 32) ^ c[1] ^ key[0], std::uint32_t(p1), std::uint32_t(p0 >> 32) ^ c[3] ^ key[1],
         std::uint32_t(p0)};
    key[0] += w0;
    key[1] += w1;
  }
  return c;
}

std::uint64_t derived_seed(std::uint64_t seed, std::array<std::uint32_t, 4> purpose) noexcept {
  const auto words = philox4x32(purpose, {std::uint32_t(seed), std::uint32_t(seed >> 32)});
  return std::uint64_t(words[1]) << 32 | words[0];
}

std::uint32_t Rng::next() noexcept {
  if (used_ == 4) {
    words_ = philox4x32(
        {std::uint32_t(block_), std::uint32_t(block_ >> 32), std::uint32_t(stream_), std::uint32_t(stream_ >> 32)},
        {std::uint32_t(seed_), std::uint32_t(seed_ >> 32)});
    ++block_;
    used_ = 0;
  }
  return words_[used_++];
}

float Rng::uniform() noexcept { return float(next() >> 8) * 0x1p-24f; }
float Rng::uniform(float low, float high) noexcept { return low + (high - low) * uniform(); }

float Rng::normal() noexcept {
  // Box-Muller; the first number is moved off zero, where the logarithm is infinite.
  const double u = (double(next()) + 0.5) * 0x1p-32;
  const double v = double(next()) * 0x1p-32;
  return float(std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v));
}

std::uint32_t Rng::below(std::uint32_t n) noexcept {
  return std::uint32_t((std::uint64_t(next()) * n) >> 32);  // bias below n / 2^32, far below what any caller can see
}

}  // namespace engine
