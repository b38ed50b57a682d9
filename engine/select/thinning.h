// Fewer rows that stand for all: as many as a graph has room for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace engine::select {

/// Rows, each either kept or one of the others; both ascending.
struct Thinned {
  std::vector<std::uint32_t> kept, others;
};

/// Keeps all rows, or so many of them: by chance, of each place about the same share. Whose turn it is, is drawn once
/// and for all, by the row's number: of the rows that two lists share, the one keeps all that the other keeps, or the
/// other way round.
///   rows  ascending
///   most  so many are kept at most
[[nodiscard]] Thinned thin_out(std::span<const std::uint32_t> rows, std::size_t most);

}  // namespace engine::select
