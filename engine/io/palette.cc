#include "engine/io/palette.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <unordered_set>

#include "engine/core/parallel.h"

namespace engine::io {
namespace {

constexpr std::size_t max_samples = std::size_t(1) << 22;  // of a codebook: a choice; more change it in the sixth digit
constexpr int codebook_iterations = 100, direction_iterations = 4, split_iterations = 6;

Codebook codebook_of_sorted(std::vector<float> values) {
  values.erase(std::unique(values.begin(), values.end()), values.end());
  Codebook codebook;
  codebook.used = values.size();
  std::ranges::fill(codebook.values, values.back());
  std::ranges::copy(values, codebook.values.begin());
  return codebook;
}

/// All different values, if they are no more than a codebook holds; else nothing.
std::vector<float> few_values(std::span<const float> values) {
  std::unordered_set<float> seen;
  for (const float value : values)
    if (seen.insert(value + 0.0f).second && seen.size() > codebook_entries) return {};  // +0: one zero, not two
  std::vector<float> all(seen.begin(), seen.end());
  std::ranges::sort(all);
  return all;
}

/// Part of the rows: places in an order of them.
struct Cell {
  std::size_t begin = 0, end = 0;
  double error = 0;  ///< Sum of squared distances from the mean.
};

class Splitter {
 public:
  Splitter(std::span<const float> rows, std::size_t dimensions) : rows_(rows), d_(dimensions) {
    order_.resize(rows.size() / dimensions);
    std::iota(order_.begin(), order_.end(), 0u);
  }

  Palette run(std::size_t max_entries) {
    std::vector<Cell> cells{{0, order_.size(), 0}};
    cells[0].error = error_of(cells[0], mean_of(cells[0]));
    while (cells.size() < max_entries) {
      // The half of the cells with the larger errors, or as many as may still be added.
      std::vector<std::size_t> by_error(cells.size());
      std::iota(by_error.begin(), by_error.end(), std::size_t{0});
      std::ranges::stable_sort(by_error, [&](std::size_t a, std::size_t b) { return cells[a].error > cells[b].error; });
      by_error.resize(std::min((cells.size() + 1) / 2, max_entries - cells.size()));
      while (!by_error.empty() && !(cells[by_error.back()].error > 0)) by_error.pop_back();
      if (by_error.empty()) break;
      std::vector<Cell> second(by_error.size());
      parallel_for(by_error.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) second[k] = split(cells[by_error[k]]);
      });
      for (const Cell& cell : second)
        if (cell.end > cell.begin) cells.push_back(cell);
    }
    Palette palette;
    palette.entries.resize(cells.size() * d_);
    palette.labels.resize(order_.size());
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const auto mean = mean_of(cells[k]);
      for (std::size_t c = 0; c < d_; ++c) palette.entries[k * d_ + c] = float(mean[c]);
      for (std::size_t at = cells[k].begin; at < cells[k].end; ++at) palette.labels[order_[at]] = std::uint32_t(k);
    }
    return palette;
  }

 private:
  using Vector = std::vector<double>;

  [[nodiscard]] const float* row(std::size_t at) const { return rows_.data() + order_[at] * d_; }

  [[nodiscard]] Vector mean_of(const Cell& cell) const {
    Vector mean(d_);
    for (std::size_t at = cell.begin; at < cell.end; ++at)
      for (std::size_t c = 0; c < d_; ++c) mean[c] += double(row(at)[c]);
    for (double& value : mean) value /= double(std::max<std::size_t>(cell.end - cell.begin, 1));
    return mean;
  }

  [[nodiscard]] double error_of(const Cell& cell, const Vector& mean) const {
    double sum = 0;
    for (std::size_t at = cell.begin; at < cell.end; ++at) sum += distance(row(at), mean);
    return sum;
  }

  [[nodiscard]] double distance(const float* from, const Vector& to) const {
    double sum = 0;
    for (std::size_t c = 0; c < d_; ++c) sum += (double(from[c]) - to[c]) * (double(from[c]) - to[c]);
    return sum;
  }

  /// The direction in which the rows spread most, by power iteration from their most spread coordinate; times the
  /// spread.
  [[nodiscard]] Vector spread_of(const Cell& cell, const Vector& mean) const {
    Vector variance(d_);
    for (std::size_t at = cell.begin; at < cell.end; ++at)
      for (std::size_t c = 0; c < d_; ++c) variance[c] += std::pow(double(row(at)[c]) - mean[c], 2);
    Vector direction(d_);
    direction[std::size_t(std::ranges::max_element(variance) - variance.begin())] = 1;
    double spread = 0;
    for (int iteration = 0; iteration < direction_iterations; ++iteration) {
      Vector next(d_);
      for (std::size_t at = cell.begin; at < cell.end; ++at) {
        double along = 0;
        for (std::size_t c = 0; c < d_; ++c) along += (double(row(at)[c]) - mean[c]) * direction[c];
        for (std::size_t c = 0; c < d_; ++c) next[c] += along * (double(row(at)[c]) - mean[c]);
      }
      double length = 0;
      for (const double value : next) length += value * value;
      length = std::sqrt(length);
      if (!(length > 0)) break;
      for (std::size_t c = 0; c < d_; ++c) direction[c] = next[c] / length;
      spread = std::sqrt(length / double(cell.end - cell.begin));
    }
    for (double& value : direction) value *= spread;
    return direction;
  }

  /// Leaves one half in `cell` and gives the other; an empty one where no two halves differ.
  Cell split(Cell& cell) {
    const Vector mean = mean_of(cell), spread = spread_of(cell, mean);
    std::array<Vector, 2> centres{mean, mean};
    for (std::size_t c = 0; c < d_; ++c) centres[0][c] -= spread[c], centres[1][c] += spread[c];
    std::size_t middle = cell.begin;
    for (int iteration = 0; iteration < split_iterations; ++iteration) {
      const auto first = order_.begin() + std::ptrdiff_t(cell.begin), last = order_.begin() + std::ptrdiff_t(cell.end);
      const auto cut = std::stable_partition(first, last, [&](std::uint32_t i) {
        const float* at = rows_.data() + i * d_;
        return distance(at, centres[0]) <= distance(at, centres[1]);
      });
      const auto found = std::size_t(cut - order_.begin());
      if (found == cell.begin || found == cell.end) {
        cell.error = 0;  // rounding alone tells them apart
        return {};
      }
      const bool same = found == middle;
      middle = found;
      centres[0] = mean_of({cell.begin, middle, 0}), centres[1] = mean_of({middle, cell.end, 0});
      if (same) break;
    }
    Cell second{middle, cell.end, 0};
    cell.end = middle;
    cell.error = error_of(cell, centres[0]);
    second.error = error_of(second, centres[1]);
    return second;
  }

  std::span<const float> rows_;
  std::size_t d_;
  std::vector<std::uint32_t> order_;
};

/// A palette of all different rows, if they are no more than that; else none.
Palette exact_palette(std::span<const float> rows, std::size_t d, std::size_t most) {
  const std::size_t n = rows.size() / d;
  std::vector<std::uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0u);
  const auto row = [&](std::uint32_t i) { return rows.subspan(i * d, d); };
  std::ranges::sort(
      order, [&](std::uint32_t a, std::uint32_t b) { return std::ranges::lexicographical_compare(row(a), row(b)); });
  Palette palette;
  palette.labels.resize(n);
  std::size_t count = 0;
  for (std::size_t k = 0; k < n; ++k) {
    if (k == 0 || !std::ranges::equal(row(order[k - 1]), row(order[k]))) {
      if (++count > most) return {};
      palette.entries.insert(palette.entries.end(), row(order[k]).begin(), row(order[k]).end());
    }
    palette.labels[order[k]] = std::uint32_t(count - 1);
  }
  return palette;
}

}  // namespace

std::uint8_t Codebook::nearest(float value) const {
  const auto end = values.begin() + std::ptrdiff_t(used);
  const auto above = std::lower_bound(values.begin(), end, value);
  if (above == values.begin()) return 0;
  if (above == end) return std::uint8_t(used - 1);
  const auto below = above - 1;
  return std::uint8_t((double(value) - double(*below) <= double(*above) - double(value) ? below : above) -
                      values.begin());
}

Codebook codebook_of(std::span<const float> values) {
  if (values.empty()) return {};
  if (auto few = few_values(values); !few.empty()) return codebook_of_sorted(std::move(few));
  const std::size_t step = (values.size() + max_samples - 1) / max_samples;
  std::vector<float> sorted;
  sorted.reserve(values.size() / step + 3);
  for (std::size_t i = 0; i < values.size(); i += step) sorted.push_back(values[i] + 0.0f);
  const auto [low, high] = std::ranges::minmax(values);
  sorted.push_back(low), sorted.push_back(high);
  std::ranges::sort(sorted);
  std::vector<double> sums(sorted.size() + 1);
  for (std::size_t i = 0; i < sorted.size(); ++i) sums[i + 1] = sums[i] + double(sorted[i]);

  // Half of the entries where the values are dense, half at equal steps: tails need some, too.
  std::vector<double> centres;
  constexpr std::size_t half = codebook_entries / 2;
  for (std::size_t k = 0; k < half; ++k) {
    const double t = (double(k) + 0.5) / double(half);
    centres.push_back(double(sorted[std::size_t(t * double(sorted.size()))]));
    centres.push_back(double(low) + t * (double(high) - double(low)));
  }
  std::ranges::sort(centres);
  for (int iteration = 0; iteration < codebook_iterations; ++iteration) {
    bool moved = false;
    std::vector<double> next;
    std::size_t begin = 0;
    for (std::size_t k = 0; k < centres.size(); ++k) {
      const auto end =
          k + 1 == centres.size()
              ? sorted.size()
              : std::size_t(std::upper_bound(sorted.begin() + std::ptrdiff_t(begin), sorted.end(),
                                             0.5 * (centres[k] + centres[k + 1]),
                                             [](double limit, float value) { return limit < double(value); }) -
                            sorted.begin());
      if (end == begin) {
        moved = true;
        continue;  // nothing is nearest to this one
      }
      next.push_back((sums[end] - sums[begin]) / double(end - begin));
      moved = moved || next.back() != centres[k];
      begin = end;
    }
    centres = std::move(next);
    if (!moved) break;
  }
  std::vector<float> rounded(centres.begin(), centres.end());
  std::ranges::sort(rounded);
  Codebook codebook = codebook_of_sorted(std::move(rounded));
  // Entries that no value uses go, so that a scene that was read gives the same codebook again.
  std::array<bool, codebook_entries> used{};
  for (const float value : values) used[codebook.nearest(value)] = true;
  std::vector<float> kept;
  for (std::size_t k = 0; k < codebook.used; ++k)
    if (used[k]) kept.push_back(codebook.values[k]);
  return codebook_of_sorted(std::move(kept));
}

Palette palette_of(std::span<const float> rows, std::size_t dimensions, std::size_t max_entries,
                   std::size_t exact_entries) {
  if (auto exact = exact_palette(rows, dimensions, exact_entries); !exact.labels.empty()) return exact;
  return Splitter(rows, dimensions).run(max_entries);
}

}  // namespace engine::io
