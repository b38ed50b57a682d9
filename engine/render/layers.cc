#include "engine/render/layers.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace engine::render {
namespace {

std::size_t count_below(std::span<const std::uint32_t> ascending, std::size_t row) {
  return std::size_t(std::lower_bound(ascending.begin(), ascending.end(), row) - ascending.begin());
}

}  // namespace

std::uint32_t Layers::merged_row(std::size_t row) const {
  const auto without_removed = [&](std::size_t base_row) {
    return std::uint32_t(base_row - (count_below(hidden, base_row) - count_below(changed, base_row)));
  };
  if (row < base->size()) return without_removed(row);
  const std::size_t j = row - base->size();
  if (j < changed.size()) return without_removed(changed[j]);
  return std::uint32_t(base->size() - hidden.size() + j);
}

DrawnVersion::DrawnVersion(scene::LayeredCloud version) : version_(std::move(version)) {
  if (!version_.overlay) return;
  const scene::Overlay& overlay = *version_.overlay;
  hidden_.reserve(overlay.removed.size() + overlay.changed.size());
  std::merge(overlay.removed.begin(), overlay.removed.end(), overlay.changed.begin(), overlay.changed.end(),
             std::back_inserter(hidden_));
}

Layers DrawnVersion::layers() const {
  Layers layers(*version_.base);
  if (!version_.overlay) return layers;
  layers.top = &version_.overlay->rows;
  layers.hidden = hidden_;
  layers.changed = version_.overlay->changed;
  return layers;
}

}  // namespace engine::render
