#include "engine/captures/looking.h"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "engine/captures/outlines.h"
#include "engine/core/rng.h"
#include "engine/core/rows.h"
#include "engine/mask/mask.h"
#include "engine/render/forward.h"
#include "engine/render/pick.h"
#include "engine/select/select.h"
#include "engine/working/footprint.h"

namespace engine::captures {
namespace {

// These figures are choices, and part of the definition of the cases.
constexpr std::uint64_t seed = 12;      // of where clicks go
constexpr std::size_t every_photo = 5;  // is looked at: six of thirty
constexpr int least_depth = 2;          // pixels from a patch's middle to its rim: what a person takes for wrong
constexpr double noise_by_depth = 0.5;  // of that distance; no click is noisier
constexpr double click_noise_px = 2;    // as those of the cases' own clicks

/// A patch of pixels that are wrong in the same way.
struct Patch {
  std::size_t pixels = 0;
  std::size_t view = 0;
  int x = 0, y = 0, depth = 0;  ///< Its middle: of the pixel farthest from the rim, and how far that is.
  bool is_missed = false;       ///< Else it is tinted and should not be.
};

/// Steps to the nearest pixel that is not set, or beyond the picture: by rows and columns.
std::vector<int> depths(const scene::Mask& mask) {
  std::vector<int> depth(mask.data.size(), 0);
  const auto at = [&](int x, int y) {
    return x < 0 || y < 0 || x >= mask.width || y >= mask.height ? 0 : depth[std::size_t(y * mask.width + x)];
  };
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x)
      if (mask.at(x, y) != 0) depth[std::size_t(y * mask.width + x)] = 1 + std::min(at(x - 1, y), at(x, y - 1));
  for (int y = mask.height - 1; y >= 0; --y)
    for (int x = mask.width - 1; x >= 0; --x)
      if (int& here = depth[std::size_t(y * mask.width + x)]; here > 0)
        here = std::min(here, 1 + std::min(at(x + 1, y), at(x, y + 1)));
  return depth;
}

/// Connected patches of a mask, by shared edges, of which some pixel is deep enough.
void find_patches(const scene::Mask& wrong, std::size_t view, bool is_missed, std::vector<Patch>& patches) {
  const std::vector<int> depth = depths(wrong);
  scene::Mask open = wrong;
  std::vector<std::pair<int, int>> stack;
  for (int y = 0; y < wrong.height; ++y)
    for (int x = 0; x < wrong.width; ++x) {
      if (open.at(x, y) == 0) continue;
      Patch patch{.view = view, .is_missed = is_missed};
      open.at(x, y) = 0;
      stack.assign(1, {x, y});
      while (!stack.empty()) {
        const auto [px, py] = stack.back();
        stack.pop_back();
        ++patch.pixels;
        if (const int here = depth[std::size_t(py * wrong.width + px)]; here > patch.depth)
          patch.x = px, patch.y = py, patch.depth = here;
        for (const auto& [nx, ny] : {std::pair{px + 1, py}, {px - 1, py}, {px, py + 1}, {px, py - 1}}) {
          if (nx < 0 || ny < 0 || nx >= wrong.width || ny >= wrong.height || open.at(nx, ny) == 0) continue;
          open.at(nx, ny) = 0;
          stack.emplace_back(nx, ny);
        }
      }
      if (patch.depth >= least_depth) patches.push_back(patch);
    }
}

/// The person's eyes: what the views show of the part, and of a selection.
class Looking {
 public:
  Looking(const CapturedCase& the_case, const scene::GaussianCloud& scene) : scene_(scene) {
    for (std::size_t i = 0; i < the_case.cameras.size(); i += every_photo) cameras_.push_back(the_case.cameras[i]);
    meant_ = true_outlines(the_case, cameras_);
  }

  struct Seen {
    std::size_t wrong = 0;       ///< Pixels, over all views.
    std::vector<Patch> patches;  ///< Largest first.
  };
  Seen look_at(const std::vector<std::uint8_t>& selected) {
    Seen seen;
    const std::vector<std::uint32_t> rows = marked_rows(selected);
    for (std::size_t view = 0; view < cameras_.size(); ++view) {
      const scene::Mask tinted = mask::mask2d(working::footprint(scene_, rows, cameras_[view], workspace_));
      scene::Mask missed = meant_[view], extra = tinted;
      for (std::size_t i = 0; i < tinted.data.size(); ++i) {
        missed.data[i] &= std::uint8_t(1 - tinted.data[i]);
        extra.data[i] &= std::uint8_t(1 - meant_[view].data[i]);
      }
      seen.wrong += missed.area() + extra.area();
      find_patches(missed, view, true, seen.patches);
      find_patches(extra, view, false, seen.patches);
    }
    std::stable_sort(seen.patches.begin(), seen.patches.end(),
                     [](const Patch& a, const Patch& b) { return a.pixels > b.pixels; });
    return seen;
  }

  /// The surface that a click on the patch hits.
  std::optional<DVec3> click(const Patch& patch, Rng& rng) {
    const double noise = std::min(click_noise_px, noise_by_depth * double(patch.depth));
    DVec2 pixel(patch.x + 0.5, patch.y + 0.5);
    for (int axis = 0; axis < 2; ++axis) pixel[axis] += noise * std::clamp(double(rng.normal()), -2.0, 2.0);
    const auto hit = render::pick(scene_, cameras_[patch.view], pixel, workspace_);
    return hit ? std::optional(hit->point) : std::nullopt;
  }

 private:
  const scene::GaussianCloud& scene_;
  std::vector<scene::Camera> cameras_;
  std::vector<scene::Mask> meant_;
  render::Workspace workspace_;
};

/// What a person has clicked on, and sees of it.
struct Clicked {
  select::Grow clicks;
  Looking::Seen seen;
};

/// The largest patch that is wrong the other way.
std::optional<Patch> to_correct(const Clicked& worse, bool is_missed) {
  const auto found = std::ranges::find(worse.seen.patches, !is_missed, &Patch::is_missed);
  return found != worse.seen.patches.end() ? std::optional(*found) : std::nullopt;
}

}  // namespace

Result<select::Grow> clicks_of_a_looking_person(const CapturedCase& the_case, const scene::GaussianCloud& scene,
                                                WhenWorse when_worse) {
  Looking eyes(the_case, scene);
  select::Selector selector(scene);
  Clicked kept{{}, eyes.look_at(std::vector<std::uint8_t>(scene.size(), 0))};
  std::optional<Clicked> worse;  // since the last click, which is to be corrected by the next
  Patch patch;
  std::size_t next = 0;  // patch to click on
  std::optional<Error> refusal;
  for (int click = 0; click < most_clicks && (worse || next < kept.seen.patches.size()); ++click) {
    Rng rng(seed, std::uint64_t(click));
    const auto correction = worse ? to_correct(*worse, patch.is_missed) : std::nullopt;
    patch = correction ? *correction : kept.seen.patches[next++];
    Clicked tried{worse ? std::move(worse->clicks) : kept.clicks, {}};
    worse.reset();
    const auto point = eyes.click(patch, rng);
    if (!point) continue;
    (patch.is_missed ? tried.clicks.inside : tried.clicks.outside).push_back(*point);
    const auto selected = selector.select({{select::Op::add, tried.clicks}});
    if (!selected) {  // undone
      refusal = selected.error();
      continue;
    }
    tried.seen = eyes.look_at(selected->rows);
    if (tried.seen.wrong < kept.seen.wrong || kept.clicks.inside.empty())
      kept = std::move(tried), next = 0;
    else if (when_worse == WhenWorse::corrected && !correction && to_correct(tried, patch.is_missed))
      worse = std::move(tried);
  }
  if (kept.clicks.inside.empty() && refusal) return fail(refusal->code, refusal->message, refusal->where);
  if (kept.clicks.inside.empty())
    return fail(ErrorCode::unprocessable, "no photo shows the part to select wider than a few pixels");
  return std::move(kept.clicks);
}

}  // namespace engine::captures
