#include "engine/correct/patch_field.h"

#include <algorithm>
#include <cassert>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/correct/patch_field_simd.h"

namespace engine::correct {

Planes::Planes(const scene::Image& image) : Planes(image.width, image.height) {
  assert(image.channels == 3);
  std::copy(image.data.begin(), image.data.end(), data.begin());
}

PatchSource patch_source(const scene::Image& picture, const scene::Mask& allowed) {
  assert(picture.width == allowed.width && picture.height == allowed.height);
  const int width = picture.width, height = picture.height;
  PatchSource source{Planes(picture), scene::Mask(width, height), {}};
  // Length of the run of allowed pixels that ends here, along the row; then the same along the column.
  std::vector<int> run(picture.pixels(), 0);
  for (int y = 0; y < height; ++y)
    for (int x = 0, length = 0; x < width; ++x) {
      length = allowed.at(x, y) != 0 ? length + 1 : 0;
      run[source.picture.index(x, y)] = length;
    }
  for (int x = 0; x < width; ++x)
    for (int y = 0, length = 0; y < height; ++y) {
      length = run[source.picture.index(x, y)] >= patch_side ? length + 1 : 0;
      if (length >= patch_side) source.centre_allowed.at(x - patch_radius, y - patch_radius) = 1;
    }
  for (std::size_t i = 0; i < source.centre_allowed.data.size(); ++i)
    if (source.centre_allowed.data[i] != 0) source.centres.push_back(std::uint32_t(i));
  return source;
}

std::vector<PatchMatch> random_field(const PatchQuery& query, std::uint64_t seed) {
  std::vector<std::size_t> first{0};  // [source] allowed centres of the sources before it
  for (const PatchSource& source : query.sources) first.push_back(first.back() + source.centres.size());
  assert(first.back() > 0);
  std::vector<PatchMatch> field(query.centres.size());
  Rng rng(seed);
  for (PatchMatch& match : field) {
    const std::size_t drawn = rng.below(std::uint32_t(first.back()));
    const auto next = std::upper_bound(first.begin(), first.end(), drawn);
    match.source = std::uint32_t(next - first.begin() - 1);
    const PatchSource& source = query.sources[match.source];
    const std::uint32_t pixel = source.centres[drawn - first[match.source]];
    match.centre = {std::int16_t(pixel % std::uint32_t(source.picture.width)),
                    std::int16_t(pixel / std::uint32_t(source.picture.width))};
  }
  return field;
}

std::vector<PatchMatch> double_size_field(const PatchQuery& query, const PatchField& coarse, std::uint64_t seed) {
  std::vector<PatchMatch> field = random_field(query, seed);
  const int coarse_height = int(coarse.number.size()) / coarse.width;
  for (std::size_t k = 0; k < field.size(); ++k) {
    const Pixel here = query.centres[k];
    const int x = here.x / 2, y = here.y / 2;
    if (x >= coarse.width || y >= coarse_height) continue;
    const std::uint32_t number = coarse.number[std::size_t(y) * std::size_t(coarse.width) + std::size_t(x)];
    if (number == no_centre) continue;
    const PatchMatch& found = coarse.matches[number];
    const scene::Mask& allowed = query.sources[found.source].centre_allowed;
    const int there_x = 2 * found.centre.x + here.x % 2, there_y = 2 * found.centre.y + here.y % 2;
    if (there_x >= allowed.width || there_y >= allowed.height || allowed.at(there_x, there_y) == 0) continue;
    field[k] = {found.source, {std::int16_t(there_x), std::int16_t(there_y)}, 0};
  }
  return field;
}

void improve(const PatchQuery& query, std::span<const PatchMatch> matches, int step, std::uint64_t seed,
             std::span<PatchMatch> out) {
  assert(matches.size() == query.centres.size() && out.size() == matches.size());
  constexpr std::size_t centres_per_task = 512;  // about a millisecond of work
  parallel_for(query.centres.size(), centres_per_task,
               [&](std::size_t begin, std::size_t end) { improve_range(query, matches, step, seed, begin, end, out); });
}

}  // namespace engine::correct
