#include "engine/select/spread.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/rows.h"
#include "engine/neighbours/neighbour_graph.h"
#include "engine/neighbours/point_index.h"

namespace engine::select {
namespace {

constexpr std::size_t neighbours_joined = 8;  // a surface's row has about six around it

std::vector<std::uint32_t> others_of(const RowSet& rows) {
  return rows_where(rows, [](std::uint8_t row) { return row == 0; });
}

/// Of `rows`, those not farther than `distance` from the box of `others`, axis by axis: no other can be near one.
std::vector<std::uint32_t> rows_near_box(const Array3& mean, const std::vector<std::uint32_t>& rows,
                                         const std::vector<std::uint32_t>& others, double distance) {
  DVec3 low(mean.get(others[0])), high = low;
  for (const std::uint32_t row : others)
    low = glm::min(low, DVec3(mean.get(row))), high = glm::max(high, DVec3(mean.get(row)));
  std::vector<std::uint32_t> near;
  for (const std::uint32_t row : rows) {
    const DVec3 at(mean.get(row));
    if (glm::all(glm::greaterThanEqual(at, low - distance)) && glm::all(glm::lessThanEqual(at, high + distance)))
      near.push_back(row);
  }
  return near;
}

/// Calls use(row) for those of `rows` that lie within `distance` of one of `others`.
template <class Use>
void each_within(const Array3& mean, const std::vector<std::uint32_t>& rows, const std::vector<std::uint32_t>& others,
                 double distance, Use&& use) {
  if (rows.empty() || others.empty()) return;
  const std::vector<std::uint32_t> near = rows_near_box(mean, rows, others, distance);
  if (near.empty()) return;
  const std::vector<std::uint32_t> asked = rows_near_box(mean, others, near, distance);
  if (asked.empty()) return;
  const DVec3 origin(mean.get(asked[0]));
  const neighbours::PointIndex index(neighbours::points_of(mean, asked, origin), 3);
  const auto nearest = index.nearest(neighbours::points_of(mean, near, origin), 1);
  for (std::size_t i = 0; i < near.size(); ++i)
    if (std::sqrt(double(nearest[i].squared_distance)) <= distance) use(near[i]);
}

/// What hangs together.
neighbours::Pieces pieces_of(const neighbours::NeighbourGraph& graph) {
  neighbours::Pieces pieces(graph.size());
  for (std::uint32_t node = 0; node < graph.size(); ++node)
    for (std::uint32_t edge = graph.begin[node]; edge < graph.begin[node + 1]; ++edge) {
      const std::uint32_t other = graph.to[edge];
      if (graph.length[edge] <= neighbours::joining_spacings * std::min(graph.spacing[node], graph.spacing[other]))
        pieces.join(node, other);
    }
  return pieces;
}

}  // namespace

RowSet expanded(const Array3& mean, const RowSet& selected, double distance) {
  RowSet out = selected;
  each_within(mean, others_of(selected), marked_rows(selected), distance, [&](std::uint32_t row) { out[row] = 1; });
  return out;
}

RowSet shrunk(const Array3& mean, const RowSet& selected, double distance) {
  RowSet out = selected;
  each_within(mean, marked_rows(selected), others_of(selected), distance, [&](std::uint32_t row) { out[row] = 0; });
  return out;
}

RowSet largest_pieces(const Array3& mean, const RowSet& selected, std::size_t n) {
  const std::vector<std::uint32_t> rows = marked_rows(selected);
  if (rows.empty()) return selected;
  const std::vector<float> points = neighbours::points_of(mean, rows, DVec3(mean.get(rows[0])));
  neighbours::Pieces pieces =
      pieces_of(neighbours::join_nearest(points, neighbours::PointIndex(points, 3), neighbours_joined));
  const std::vector<std::uint32_t> rows_of_piece = pieces.sizes();
  std::vector<std::uint32_t> by_size;  // pieces, by their lowest node
  for (std::uint32_t node = 0; node < rows.size(); ++node)
    if (rows_of_piece[node] > 0) by_size.push_back(node);
  std::sort(by_size.begin(), by_size.end(), [&](std::uint32_t a, std::uint32_t b) {
    return rows_of_piece[a] != rows_of_piece[b] ? rows_of_piece[a] > rows_of_piece[b] : a < b;
  });
  RowSet kept(rows.size(), 0);
  for (std::size_t i = 0; i < std::min(n, by_size.size()); ++i) kept[by_size[i]] = 1;
  RowSet out(selected.size(), 0);
  for (std::uint32_t node = 0; node < rows.size(); ++node) out[rows[node]] = kept[pieces.of(node)];
  return out;
}

}  // namespace engine::select
