// Selections made wider or narrower, and freed of crumbs.
#pragma once

#include <cstddef>

#include "engine/core/soa.h"
#include "engine/select/shapes.h"

namespace engine::select {

/// The selected rows and all within `distance` of one of them, by means.
///   distance  world units, above 0
[[nodiscard]] RowSet expanded(const Array3& mean, const RowSet& selected, double distance);

/// The selected rows but for those within `distance` of one that is not selected. Where all rows are selected, or none,
/// nothing changes.
[[nodiscard]] RowSet shrunk(const Array3& mean, const RowSet& selected, double distance);

/// The n largest connected pieces of the selected rows, by number of rows; of equally large ones those that begin with
/// a lower row. Rows hang together where one is among the 8 nearest selected ones of the other (24 nearest, where that
/// joins pieces), and not farther than three times the spacing (mean distance to those 8) of either.
[[nodiscard]] RowSet largest_pieces(const Array3& mean, const RowSet& selected, std::size_t n);

}  // namespace engine::select
