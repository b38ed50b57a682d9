#include "engine/scene/overlay.h"

#include <algorithm>
#include <cassert>
#include <iterator>
#include <limits>
#include <string>

#include "engine/core/parallel.h"
#include "engine/scene/cloud_arrays.h"

namespace engine::scene {
namespace {

/// Rows that lie one after the other in their source and in the result.
struct RowRange {
  std::size_t first = 0;   ///< First row in the result.
  bool from_base = false;  ///< Whether the source is the base; otherwise it is Overlay::rows.
  std::size_t source = 0;  ///< First row in the source.
  std::size_t count = 0;
};

/// The ranges of rows that the result is made of, in its order.
std::vector<RowRange> ranges_of(std::size_t base_rows, const Overlay& overlay) {
  std::vector<RowRange> ranges;
  std::size_t result = 0;
  const auto add = [&](bool from_base, std::size_t source, std::size_t count) {
    if (count == 0) return;
    ranges.push_back({result, from_base, source, count});
    result += count;
  };
  std::size_t next = 0, removed = 0, changed = 0;  // next: first row of the base that has not been dealt with
  while (removed < overlay.removed.size() || changed < overlay.changed.size()) {
    const bool is_removal = changed == overlay.changed.size() ||
                            (removed < overlay.removed.size() && overlay.removed[removed] < overlay.changed[changed]);
    const std::size_t row = is_removal ? overlay.removed[removed] : overlay.changed[changed];
    add(true, next, row - next);
    next = row + 1;
    if (is_removal)
      ++removed;
    else
      add(false, changed++, 1);
  }
  add(true, next, base_rows - next);
  add(false, overlay.changed.size(), overlay.added());
  return ranges;
}

template <class T>
void copy_rows(const std::vector<T>& from, std::vector<T>& to, const RowRange& range, std::size_t stride = 1) {
  std::copy_n(from.begin() + std::ptrdiff_t(range.source * stride), range.count * stride,
              to.begin() + std::ptrdiff_t(range.first * stride));
}

/// Fills a cloud of the right size, array by array.
GaussianCloud assemble(const GaussianCloud& base, const GaussianCloud& rows, std::span<const RowRange> ranges) {
  GaussianCloud out;
  out.sh_degree = base.sh_degree;
  out.extra_stride = base.extra_stride;
  out.resize(ranges.empty() ? 0 : ranges.back().first + ranges.back().count);
  visit_arrays(
      [&](std::size_t stride, auto& to, const auto& from_base, const auto& from_rows) {
        for (const RowRange& range : ranges) copy_rows(range.from_base ? from_base : from_rows, to, range, stride);
      },
      out, base, rows);
  return out;
}

Result<void> check_rows(const std::vector<std::uint32_t>& rows, const std::string& name, std::size_t base_rows) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto where = [&] { return name + "[" + std::to_string(i) + "]"; };
    if (rows[i] >= base_rows)
      return fail(ErrorCode::corrupt_data,
                  "row " + std::to_string(rows[i]) + " is not one of the base's " + std::to_string(base_rows), where());
    if (i > 0 && rows[i] <= rows[i - 1])
      return fail(ErrorCode::corrupt_data,
                  "rows must ascend: " + std::to_string(rows[i]) + " follows " + std::to_string(rows[i - 1]), where());
  }
  return {};
}

bool has_all_arrays(const GaussianCloud& cloud) {
  bool good = true;
  visit_arrays([&](std::size_t stride, const auto& array) { good = good && array.size() == cloud.size() * stride; },
               cloud);
  return good;
}

}  // namespace

std::size_t LayeredCloud::size() const {
  return overlay ? base->size() - overlay->removed.size() + overlay->added() : base->size();
}

Overlay no_change(const GaussianCloud& base) {
  Overlay overlay;
  overlay.rows.sh_degree = base.sh_degree;
  overlay.rows.extra_stride = base.extra_stride;
  return overlay;
}

Result<void> validate(const Overlay& overlay, const GaussianCloud& base) {
  if (auto good = check_rows(overlay.removed, "removed", base.size()); !good) return good;
  if (auto good = check_rows(overlay.changed, "changed", base.size()); !good) return good;
  for (std::size_t i = 0; i < overlay.changed.size(); ++i)
    if (std::binary_search(overlay.removed.begin(), overlay.removed.end(), overlay.changed[i]))
      return fail(ErrorCode::corrupt_data, "row " + std::to_string(overlay.changed[i]) + " is also removed",
                  "changed[" + std::to_string(i) + "]");
  const auto bad_rows = [](const std::string& message) { return fail(ErrorCode::corrupt_data, message, "rows"); };
  const GaussianCloud& rows = overlay.rows;
  if (rows.sh_degree != base.sh_degree)
    return bad_rows("SH degree " + std::to_string(rows.sh_degree) + ", the base has " + std::to_string(base.sh_degree));
  if (rows.extra_stride != base.extra_stride)
    return bad_rows(std::to_string(rows.extra_stride) + " opaque bytes a row, the base has " +
                    std::to_string(base.extra_stride));
  if (!has_all_arrays(rows)) return bad_rows("the arrays differ in length");
  if (rows.size() < overlay.changed.size())
    return bad_rows(std::to_string(rows.size()) + " rows for " + std::to_string(overlay.changed.size()) +
                    " changed ones");
  if (base.size() - overlay.removed.size() + overlay.added() > std::numeric_limits<std::uint32_t>::max())
    return bad_rows("more rows than 32 bits can count");
  return {};
}

GaussianCloud flatten(const GaussianCloud& base, const Overlay& overlay) {
  return assemble(base, overlay.rows, ranges_of(base.size(), overlay));
}

GaussianCloud flatten(const LayeredCloud& cloud) {
  return cloud.overlay ? flatten(*cloud.base, *cloud.overlay) : *cloud.base;
}

namespace {

/// Rows of two clouds, counted through both, as ranges to assemble.
///   first_rows  of the first cloud, which is counted first
std::vector<RowRange> ranges_of_rows(std::span<const std::uint32_t> numbers, std::size_t first_rows) {
  std::vector<RowRange> ranges;
  for (const std::uint32_t number : numbers) {
    const bool is_first = number < first_rows;
    const std::size_t source = is_first ? number : number - first_rows;
    if (!ranges.empty() && ranges.back().from_base == is_first && ranges.back().source + ranges.back().count == source)
      ++ranges.back().count;
    else
      ranges.push_back({ranges.empty() ? 0 : ranges.back().first + ranges.back().count, is_first, source, 1});
  }
  return ranges;
}

}  // namespace

Overlay compose(std::size_t base_rows, const Overlay& lower, const Overlay& upper) {
  // Every row that lower's result takes from the base or from lower.rows either stays, goes, or takes a value of
  // upper.rows. Values of the composed rows are first noted as numbers into `pool`: lower.rows, then upper.rows.
  const std::size_t lower_rows = lower.rows.size();
  Overlay out;
  std::vector<std::uint32_t> changed_values, added_values;
  std::size_t removed = 0, changed = 0;  // of upper's lists, as far as they have been dealt with
  for (const RowRange& range : ranges_of(base_rows, lower)) {
    const std::size_t end = range.first + range.count;
    const bool is_base_row = range.from_base || range.source < lower.changed.size();
    const auto base_row = [&](std::size_t row) {
      return std::uint32_t(range.from_base ? range.source + (row - range.first) : lower.changed[range.source]);
    };
    std::size_t row = range.first;
    const auto keep_until = [&](std::size_t next) {  // rows [row, next) are untouched by upper
      if (!range.from_base)
        for (; row < next; ++row) {
          if (is_base_row) out.changed.push_back(base_row(row));
          (is_base_row ? changed_values : added_values).push_back(std::uint32_t(range.source + (row - range.first)));
        }
      row = next;
    };
    while (true) {
      const std::size_t next_removed = removed < upper.removed.size() ? upper.removed[removed] : end;
      const std::size_t next_changed = changed < upper.changed.size() ? upper.changed[changed] : end;
      if (std::min(next_removed, next_changed) >= end) break;
      keep_until(std::min(next_removed, next_changed));
      if (next_removed < next_changed) {
        if (is_base_row) out.removed.push_back(base_row(row));
        ++removed;
      } else {
        if (is_base_row) out.changed.push_back(base_row(row));
        (is_base_row ? changed_values : added_values).push_back(std::uint32_t(lower_rows + changed));
        ++changed;
      }
      ++row;
    }
    keep_until(end);
  }
  for (std::size_t j = upper.changed.size(); j < upper.rows.size(); ++j)
    added_values.push_back(std::uint32_t(lower_rows + j));

  std::vector<std::uint32_t> removed_below = lower.removed, all_removed;
  std::merge(removed_below.begin(), removed_below.end(), out.removed.begin(), out.removed.end(),
             std::back_inserter(all_removed));
  out.removed = std::move(all_removed);

  std::vector<std::uint32_t> values = std::move(changed_values);
  values.insert(values.end(), added_values.begin(), added_values.end());
  out.rows = assemble(lower.rows, upper.rows, ranges_of_rows(values, lower_rows));
  return out;
}

GaussianCloud gather(const LayeredCloud& cloud, std::span<const std::uint32_t> rows) {
  const Overlay nothing;
  const Overlay& overlay = cloud.overlay ? *cloud.overlay : nothing;
  const auto ranges = ranges_of(cloud.base->size(), overlay);
  std::vector<RowRange> wanted;
  for (const std::uint32_t row : rows) {
    assert(row < cloud.size());
    const RowRange& range =
        *std::prev(std::upper_bound(ranges.begin(), ranges.end(), row,
                                    [](std::size_t r, const RowRange& candidate) { return r < candidate.first; }));
    const std::size_t source = range.source + (row - range.first);
    if (!wanted.empty() && wanted.back().from_base == range.from_base &&
        wanted.back().source + wanted.back().count == source)
      ++wanted.back().count;
    else
      wanted.push_back({wanted.empty() ? 0 : wanted.back().first + wanted.back().count, range.from_base, source, 1});
  }
  return assemble(*cloud.base, overlay.rows, wanted);
}

Array3 means(const LayeredCloud& cloud) {
  if (!cloud.overlay) return cloud.base->mean;
  Array3 out;
  out.resize(cloud.size());
  for (const RowRange& range : ranges_of(cloud.base->size(), *cloud.overlay)) {
    const Array3& from = range.from_base ? cloud.base->mean : cloud.overlay->rows.mean;
    copy_rows(from.x, out.x, range);
    copy_rows(from.y, out.y, range);
    copy_rows(from.z, out.z, range);
  }
  return out;
}

std::size_t count_within(const LayeredCloud& cloud, DVec3 point, double radius) {
  const auto is_within = [&](Vec3 mean) {
    const DVec3 offset = DVec3(mean) - point;
    return glm::dot(offset, offset) < radius * radius;
  };
  const auto count = [&](const Array3& mean) {
    constexpr std::size_t rows_per_task = 65536;  // a choice
    std::vector<std::size_t> partial(chunk_count(mean.size(), rows_per_task), 0);
    parallel_for(mean.size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
      std::size_t found = 0;
      for (std::size_t i = begin; i < end; ++i) found += is_within(mean.get(i));
      partial[begin / rows_per_task] = found;
    });
    std::size_t sum = 0;
    for (const std::size_t found : partial) sum += found;
    return sum;
  };
  std::size_t found = count(cloud.base->mean);
  if (!cloud.overlay) return found;
  found += count(cloud.overlay->rows.mean);
  for (const auto* hidden : {&cloud.overlay->removed, &cloud.overlay->changed})
    for (const std::uint32_t row : *hidden) found -= is_within(cloud.base->mean.get(row));
  return found;
}

std::size_t memory_bytes(const GaussianCloud& cloud) {
  std::size_t bytes = 0;
  visit_arrays([&](std::size_t, const auto& array) { bytes += array.capacity() * sizeof(array[0]); }, cloud);
  return bytes;
}

std::size_t memory_bytes(const Overlay& overlay) {
  return (overlay.removed.capacity() + overlay.changed.capacity()) * sizeof(std::uint32_t) + memory_bytes(overlay.rows);
}

}  // namespace engine::scene
