// Fewer rows that stand for all: as many as a graph has room for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace engine::select {

/// Keeps a part of the rows, by chance: of each place about the same share. Which rows come first is drawn once and for
/// all, by their number: what fewer rows keep of what they share with more, those keep too, or have no room for.
///   rows     ascending; left with those that are kept, ascending
///   most     keeps so many, or all
///   returns  the others, ascending
[[nodiscard]] std::vector<std::uint32_t> thin_out(std::vector<std::uint32_t>& rows, std::size_t most);

}  // namespace engine::select
