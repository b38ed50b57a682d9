// The order of splats by depth: a stable radix sort of the bits that differ, least significant first.
#include <algorithm>
#include <bit>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/render/splats.h"

namespace engine::render {
namespace {

constexpr int most_bits = 11;            // of a digit: its counts are to stay in the first cache
constexpr std::size_t most_chunks = 32;  // of a pass: their counts are added up by one thread

/// A digit of a key.
struct Digit {
  std::uint32_t least;  ///< Of all keys.
  int shift, bits;

  [[nodiscard]] std::size_t buckets() const { return std::size_t{1} << bits; }
  [[nodiscard]] std::size_t operator()(const DepthKey& keyed) const {
    return (keyed.key - least) >> shift & (buckets() - 1);
  }
};

/// One pass: counts the digits of chunks side by side; then each chunk moves its elements to the places that lesser
/// digits, and the chunks before it, leave.
///   length, least_grain  of what is cut into chunks
///   each    each(begin, end, use) calls use() for the elements of a part of it
///   counts  scratch
template <class Each>
void sort_by_digit(const Digit& digit, std::size_t length, std::size_t least_grain, Each&& each,
                   std::vector<std::uint32_t>& counts, DepthKey* to) {
  const std::size_t grain = std::max(least_grain, (length + most_chunks - 1) / most_chunks);
  const std::size_t chunks = chunk_count(length, grain), buckets = digit.buckets();
  counts.resize(chunks * buckets);
  parallel_for(length, grain, [&](std::size_t begin, std::size_t end) {
    std::uint32_t* const count = counts.data() + begin / grain * buckets;
    std::fill_n(count, buckets, 0u);
    each(begin, end, [&](const DepthKey& keyed) { ++count[digit(keyed)]; });
  });
  std::uint32_t sum = 0;
  for (std::size_t bucket = 0; bucket < buckets; ++bucket)
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) sum += std::exchange(counts[chunk * buckets + bucket], sum);
  parallel_for(length, grain, [&](std::size_t begin, std::size_t end) {
    std::uint32_t* const place = counts.data() + begin / grain * buckets;
    each(begin, end, [&](const DepthKey& keyed) { to[place[digit(keyed)]++] = keyed; });
  });
}

}  // namespace

void sort_by_depth(ForwardBuffers& buffers) {
  KeyRange range;
  for (const KeyRange& of_block : buffers.key_ranges) range.extend(of_block);
  const std::vector<std::size_t>& sizes = buffers.block_sizes;
  const auto n = std::accumulate(sizes.begin(), sizes.end(), std::size_t{0});
  for (auto& buffer : buffers.sorted) buffer.reserve(n);
  buffers.by_depth = {buffers.sorted[0].data(), n};
  if (n == 0) return;

  const int width = std::max(1, int(std::bit_width(range.largest - range.least)));
  const int passes = (width + most_bits - 1) / most_bits, bits = (width + passes - 1) / passes;
  std::vector<std::uint32_t> counts;
  // The first pass takes the keys from where projection left them.
  const auto projected = [&](std::size_t begin, std::size_t end, auto&& use) {
    for (std::size_t b = begin; b < end; ++b)
      for (const DepthKey& keyed : std::span(buffers.keys.data() + b * project_block, sizes[b])) use(keyed);
  };
  sort_by_digit({range.least, 0, bits}, sizes.size(), 8, projected, counts, buffers.sorted[0].data());
  for (int p = 1; p < passes; ++p) {
    const std::span<const DepthKey> from = buffers.by_depth;
    const auto sorted = [&](std::size_t begin, std::size_t end, auto&& use) {
      for (const DepthKey& keyed : from.subspan(begin, end - begin)) use(keyed);
    };
    DepthKey* const to = buffers.sorted[std::size_t(p % 2)].data();
    sort_by_digit({range.least, p * bits, bits}, n, 8 * project_block, sorted, counts, to);
    buffers.by_depth = {to, n};
  }
}

}  // namespace engine::render
