#include "engine/edit/memory.h"

#include <algorithm>
#include <chrono>

namespace engine::edit {
namespace {

// Choices: the groups of a drag; and rows of what is kept besides what was asked for last, some 50 MB of bodies.
constexpr std::size_t most_kept = 8, most_rows = 400'000;

}  // namespace

/// The one that fits, which then is the last one; else one that is made now, in place of those that were used longest
/// ago.
///   rows_of  how many rows one of them is about
template <class T, class Fits, class Make, class RowsOf>
const T& Memory::find_or_make(std::list<Noted<T>>& known, Fits&& fits, Make&& make, RowsOf&& rows_of) {
  const auto noted = std::ranges::find_if(known, fits, &Noted<T>::found);
  if (noted != known.end()) {
    known.splice(known.end(), known, noted);
    saved_seconds_ += known.back().seconds;
    return known.back().found;
  }
  const auto begin = std::chrono::steady_clock::now();
  known.push_back({make()});
  known.back().seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::size_t rows = 0;
  for (const Noted<T>& one : known) rows += rows_of(one.found);
  while (known.size() > 1 && (known.size() > most_kept || rows > most_rows)) {
    rows -= rows_of(known.front().found);
    known.pop_front();
  }
  return known.back().found;
}

const select::Contact& Memory::contact_of(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part,
                                          std::span<const std::uint32_t> selected) {
  const auto fits = [&](const KnownContact& known) {
    return std::ranges::equal(known.part, part) && std::ranges::equal(known.selected, selected);
  };
  const auto make = [&] {
    return KnownContact{
        {part.begin(), part.end()}, {selected.begin(), selected.end()}, select::contact_of(scene, part, selected)};
  };
  return find_or_make(contacts_, fits, make, [](const KnownContact& known) { return known.part.size(); }).contact;
}

const std::vector<std::uint32_t>& Memory::crumbs_of(const scene::LayeredCloud& scene,
                                                    std::span<const std::uint32_t> selected) {
  return find_or_make(
             crumbs_, [&](const Crumbs& known) { return std::ranges::equal(known.selected, selected); },
             [&] {
               return Crumbs{{selected.begin(), selected.end()}, select::crumbs_of(scene, selected)};
             },
             [](const Crumbs& known) { return known.selected.size(); })
      .rows;
}

const select::Stance& Memory::stance_of(const scene::LayeredCloud& scene, const Array3& means,
                                        std::span<const std::uint32_t> part, std::span<const select::Touch> touches,
                                        std::span<const std::uint32_t> moved) {
  return find_or_make(
      stances_, [&](const select::Stance& stance) { return stance.is_of(part, moved); },
      [&] { return select::Stance(scene, means, part, touches, moved); },
      [](const select::Stance& stance) { return stance.size(); });
}

const deform::Body& Memory::body_of(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                    std::span<const deform::Drag> drags, std::span<const std::uint8_t> held) {
  return find_or_make(
      bodies_, [&](const deform::Body& body) { return body.is_of(cloud, rows, drags, held); },
      [&] { return deform::Body(cloud, rows, drags, held); }, [](const deform::Body& body) { return body.size(); });
}

}  // namespace engine::edit
