#include "engine/edit/memory.h"

#include <algorithm>

namespace engine::edit {
namespace {

constexpr std::size_t most_kept = 8;  // a choice: groups of a drag; a body of 30,000 rows takes some 10 MB

/// The one that fits, made last of all; else one that is made now, in place of the one that was used longest ago.
template <class Kept, class Fits, class Make>
const Kept& find_or_make(std::list<Kept>& kept, Fits&& fits, Make&& make) {
  const auto found = std::ranges::find_if(kept, fits);
  if (found != kept.end()) {
    kept.splice(kept.end(), kept, found);
  } else {
    if (kept.size() == most_kept) kept.pop_front();
    kept.push_back(make());
  }
  return kept.back();
}

}  // namespace

const std::vector<select::Touch>& Memory::contact_of(const scene::LayeredCloud& scene,
                                                     std::span<const std::uint32_t> part,
                                                     std::span<const std::uint32_t> selected) {
  const auto fits = [&](const Contact& known) {
    return std::ranges::equal(known.part, part) && std::ranges::equal(known.selected, selected);
  };
  const auto make = [&] {
    return Contact{
        {part.begin(), part.end()}, {selected.begin(), selected.end()}, select::contact_of(scene, part, selected)};
  };
  return find_or_make(contacts_, fits, make).touches;
}

const deform::Body& Memory::body_of(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                    std::span<const deform::Drag> drags, std::span<const std::uint8_t> held) {
  return find_or_make(
      bodies_, [&](const deform::Body& body) { return body.is_of(cloud, rows, drags, held); },
      [&] { return deform::Body(cloud, rows, drags, held); });
}

}  // namespace engine::edit
