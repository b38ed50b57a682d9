#include "engine/correct/scene_corrector.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/correct/harmonic.h"
#include "engine/correct/patch_field.h"
#include "engine/correct/pyramid.h"

namespace engine::correct {
namespace {

// Details smaller than 2^(6 S) pixels are made anew where there is a hint: at S = 0.5 those below 8 pixels. A choice.
constexpr double octaves_at_full_strength = 6;
// Pixels. A scale is coarse enough when no missing pixel is farther than this from a known one: the surroundings then
// say what is there. A choice.
constexpr int thin_px = 2;
// Each step away from known pixels divides the weight of a missing pixel in a comparison by this factor. A choice.
constexpr double falling_confidence = 1.3;
// Scales at most, which reach holes of some 2^8 pixels: a bound on time, a choice.
constexpr int max_scales = 8;
// Passes of the first round at the coarsest scale, where the search begins with random patches. A choice.
constexpr int first_passes = 8;
// Pixels. Patches are looked for at least this far around the edit; around a larger one, by half its box. A choice.
constexpr int min_padding_px = 24;

scene::Rect padded(scene::Rect box, const scene::Image& picture) {
  const int by = std::max(min_padding_px, std::max(box.width(), box.height()) / 2);
  return {std::max(box.x0 - by, 0), std::max(box.y0 - by, 0), std::min(box.x1 + by, picture.width),
          std::min(box.y1 + by, picture.height)};
}

/// The pictures that patches are taken from, at one scale.
struct SourceScale {
  std::vector<MaskedPicture> pictures;
  std::vector<scene::Mask> allowed;
};

std::vector<PatchSource> patch_sources(const SourceScale& scale) {
  std::vector<PatchSource> out;
  for (std::size_t s = 0; s < scale.pictures.size(); ++s)
    out.push_back(patch_source(scale.pictures[s].picture, scale.allowed[s]));
  return out;
}

SourceScale half_size(const SourceScale& fine) {
  SourceScale coarse;
  for (const MaskedPicture& picture : fine.pictures) coarse.pictures.push_back(correct::half_size(picture));
  for (const scene::Mask& allowed : fine.allowed) coarse.allowed.push_back(half_size_mask(allowed));
  return coarse;
}

scene::Mask unknown_of(const MaskedPicture& masked) {
  scene::Mask unknown(masked.picture.width, masked.picture.height);
  for (std::size_t i = 0; i < unknown.data.size(); ++i) unknown.data[i] = masked.confidence.data[i] < 0.5f;
  return unknown;
}

/// The work at one scale: fills the unknown pixels of a picture that has a first guess there.
class Synthesis {
 public:
  ///   coarser  the field found at half the size; empty: there is none yet
  ///   seed     this number and the next few hundred seed the passes
  Synthesis(scene::Image& picture, const scene::Mask& unknown, std::span<const PatchSource> sources,
            const PatchField& coarser, std::uint64_t seed)
      : picture_(picture), unknown_(unknown), sources_(sources), seed_(seed), target_(picture) {
    const std::vector<int> depth = depth_within(unknown);
    weight_.assign(depth.size() + Planes::spare, 0.0f);
    for (std::size_t i = 0; i < depth.size(); ++i) weight_[i] = float(std::pow(falling_confidence, -double(depth[i])));
    number_.assign(depth.size(), no_centre);
    for (int y = patch_radius; y < picture.height - patch_radius; ++y)
      for (int x = patch_radius; x < picture.width - patch_radius; ++x)
        if (touches_unknown(x, y)) {
          number_[target_.index(x, y)] = std::uint32_t(centres_.size());
          centres_.push_back({std::int16_t(x), std::int16_t(y)});
        }
    field_ = coarser.matches.empty() ? random_field(query(), seed_) : double_size_field(query(), coarser, seed_);
  }

  [[nodiscard]] PatchField field() && { return {picture_.width, std::move(number_), std::move(field_)}; }

  /// Searches, then lets the patches found vote for the colours.
  void round(int passes) {
    if (centres_.empty()) return;
    std::vector<PatchMatch> next(field_.size());
    for (int pass = 0; pass < passes; ++pass) {
      improve(query(), field_, 1 << (passes - 1 - pass) % 4, ++seed_, next);
      field_.swap(next);
    }
    vote();
  }

 private:
  [[nodiscard]] PatchQuery query() const { return {&target_, weight_, centres_, number_, sources_}; }

  [[nodiscard]] bool touches_unknown(int x, int y) const {
    for (int v = y - patch_radius; v <= y + patch_radius; ++v)
      for (int u = x - patch_radius; u <= x + patch_radius; ++u)
        if (unknown_.at(u, v) != 0) return true;
    return false;
  }

  void vote() {
    std::vector<float> distances;
    for (const PatchMatch& match : field_) distances.push_back(match.distance);
    const auto third_quarter = distances.begin() + std::ptrdiff_t(distances.size() * 3 / 4);
    std::nth_element(distances.begin(), third_quarter, distances.end());
    // Below half an 8-bit step nothing is better than anything else, and a field of perfect matches has no spread.
    const float spread = std::max(*third_quarter, 1e-5f);
    std::vector<float> worth(field_.size());
    for (std::size_t k = 0; k < field_.size(); ++k)
      worth[k] = std::exp(-field_[k].distance / (2 * spread)) * weight_[target_.index(centres_[k].x, centres_[k].y)];
    constexpr std::size_t rows_per_task = 8;  // a choice
    parallel_for(std::size_t(picture_.height), rows_per_task, [&](std::size_t begin, std::size_t end) {
      for (int y = int(begin); y < int(end); ++y)
        for (int x = 0; x < picture_.width; ++x)
          if (unknown_.at(x, y) != 0) vote(x, y, worth);
    });
    for (int c = 0; c < 3; ++c)
      std::copy_n(picture_.plane(c).data(), picture_.pixels(), target_.data.data() + std::size_t(c) * target_.pixels());
  }

  void vote(int x, int y, const std::vector<float>& worth) {
    float sum[3] = {}, weights = 0;
    for (int v = std::max(y - patch_radius, 0); v <= std::min(y + patch_radius, picture_.height - 1); ++v)
      for (int u = std::max(x - patch_radius, 0); u <= std::min(x + patch_radius, picture_.width - 1); ++u) {
        const std::uint32_t k = number_[target_.index(u, v)];
        if (k == no_centre) continue;
        const PatchMatch& match = field_[k];
        const Planes& source = sources_[match.source].picture;
        const std::size_t at = source.index(match.centre.x + x - u, match.centre.y + y - v);
        for (std::size_t c = 0; c < 3; ++c) sum[c] += worth[k] * source.data[c * source.pixels() + at];
        weights += worth[k];
      }
    if (weights > 0)  // a pixel in a corner may lie in no patch
      for (int c = 0; c < 3; ++c) picture_.at(x, y, c) = sum[c] / weights;
  }

  scene::Image& picture_;
  const scene::Mask& unknown_;
  std::span<const PatchSource> sources_;
  std::uint64_t seed_;
  Planes target_;
  std::vector<float> weight_;
  std::vector<Pixel> centres_;
  std::vector<std::uint32_t> number_;
  std::vector<PatchMatch> field_;
};

/// Scales until what is missing is thin, the finest first.
int scales_for(const scene::Mask& missing) {
  const std::vector<int> depth = depth_within(missing);
  const int deepest = *std::max_element(depth.begin(), depth.end());
  int scales = 1;
  while (scales < max_scales && deepest >> (scales - 1) > thin_px &&
         std::min(missing.width, missing.height) >> scales >= 2 * patch_side)
    ++scales;
  return scales;
}

/// The picture of a task at each scale, the finest first. Scales that are made anew go without its hints.
///   box      the part of the picture that patches are compared in
///   renewed  number of the finest scales that are made anew
std::vector<MaskedPicture> target_scales(const CorrectionTask& task, const scene::Mask& to_correct, scene::Rect box,
                                         float hint, int renewed) {
  MaskedPicture hinted{scene::cut_out(task.picture, box), scene::Image(box.width(), box.height(), 1, 1.0f)};
  MaskedPicture bare = hinted;
  const scene::Image trust = scene::cut_out(task.trust, box);
  const scene::Mask inside = scene::cut_out(to_correct, box);
  for (std::size_t i = 0; i < inside.data.size(); ++i) {
    if (inside.data[i] == 0) continue;
    bare.confidence.data[i] = 0;
    if (trust.data[i] < hint) hinted.confidence.data[i] = 0;
  }
  const int scales = std::max(scales_for(unknown_of(hinted)), renewed + 1);
  std::vector<MaskedPicture> out;
  for (int s = 0; s < scales; ++s) {
    if (s > 0) hinted = correct::half_size(hinted), bare = correct::half_size(bare);
    out.push_back(s < renewed ? bare : hinted);
  }
  return out;
}

/// The parts of examples that patches may be taken from, at each scale, the finest first.
std::vector<SourceScale> source_scales(std::span<const Example> buffer, std::span<const std::size_t> examples,
                                       std::size_t scales) {
  std::vector<SourceScale> out(1);
  for (const std::size_t e : examples) {
    const Example& example = buffer[e];
    if (example.box.empty()) continue;
    const scene::Rect part = padded(example.box, example.picture);
    scene::Mask allowed = scene::cut_out(example.excluded, part);
    for (std::uint8_t& flag : allowed.data) flag = flag == 0;
    out[0].allowed.push_back(std::move(allowed));
    out[0].pictures.push_back(
        {scene::cut_out(example.picture, part), scene::Image(part.width(), part.height(), 1, 1.0f)});
  }
  while (out.size() < scales) out.push_back(half_size(out.back()));
  return out;
}

void copy_where(const scene::Mask& where, const scene::Image& from, scene::Image& to) {
  for (int c = 0; c < to.channels; ++c)
    for (std::size_t i = 0; i < where.data.size(); ++i)
      if (where.data[i] != 0) to.plane(c)[i] = from.plane(c)[i];
}

/// Fills the unknown pixels, scale by scale; each begins with the field that the coarser one has found.
scene::Image synthesise(std::span<const MaskedPicture> targets, std::span<const SourceScale> sources, int rounds,
                        int passes, std::uint64_t seed) {
  scene::Image guess;
  PatchField found;
  for (std::size_t s = targets.size(); s-- > 0;) {
    const scene::Mask unknown = unknown_of(targets[s]);
    scene::Image picture = targets[s].picture;
    if (guess.data.empty())
      fill_harmonic(picture, unknown);
    else
      copy_where(unknown, double_size(guess, picture.width, picture.height), picture);
    const std::vector<PatchSource> patches = patch_sources(sources[s]);
    if (std::any_of(patches.begin(), patches.end(), [](const PatchSource& p) { return !p.centres.empty(); })) {
      Synthesis synthesis(picture, unknown, patches, found, seed + s * 1000);
      synthesis.round(found.matches.empty() ? first_passes : passes);
      for (int r = 1; r < rounds; ++r) synthesis.round(passes);
      found = std::move(synthesis).field();
    }
    guess = std::move(picture);
  }
  return guess;
}

}  // namespace

Result<void> SceneCorrector::fine_tune(std::span<const Example> buffer, int /*steps*/) {
  buffer_ = buffer;
  return {};
}

Result<std::vector<scene::Image>> SceneCorrector::correct(std::span<const CorrectionTask> tasks, double strength,
                                                          std::uint64_t seed) {
  const int renewed = int(std::lround(octaves_at_full_strength * strength));
  std::vector<scene::Image> out;
  for (const CorrectionTask& task : tasks) {
    out.push_back(task.picture);
    const scene::Mask to_correct = pixels_to_correct(task);
    const scene::Rect tight = bounding_box(to_correct);
    if (tight.empty()) continue;
    const scene::Rect box = padded(tight, task.picture);
    const auto targets = target_scales(task, to_correct, box, options_.hint, renewed);
    const auto examples = std::span(task.examples);
    const auto sources = source_scales(
        buffer_, examples.first(std::min(examples.size(), std::size_t(options_.sources))), targets.size());
    const scene::Image filled =
        synthesise(targets, sources, options_.rounds, options_.passes, seed + (out.size() - 1) * 1000003);
    scene::Image whole = task.picture;
    scene::paste(filled, box, whole);
    copy_where(to_correct, whole, out.back());
  }
  return out;
}

}  // namespace engine::correct
