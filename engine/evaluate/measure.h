// How near an edited scene comes to the truth, at cameras that the edit has not seen.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/evaluate/cases.h"
#include "engine/evaluate/judged_view.h"
#include "engine/optim/perceptual.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/scene/image.h"

namespace engine::evaluate {

/// How near pictures come to the truth over one region, all held-out views together.
struct RegionQuality {
  double psnr_db = 0;      ///< Of the mean square error over its pixels; 100 where nothing differs.
  double ssim = 0;         ///< Mean of SSIM's map; windows reach beyond the pixels that count.
  std::size_t pixels = 0;  ///< Pixels of the region. 0: the rest says nothing.
  /// How much finer structure there is than in the truth, both as root mean squares of what a mean of 3 x 3 pixels has
  /// and one of 9 x 9 has not: below 1 it is smeared, above it is rough. Errors of phase, which dB are full of, do not
  /// matter. Nothing where the truth is of one colour.
  std::optional<double> detail = {};
};

/// Sums a RegionQuality up, picture by picture.
class RegionQualitySum {
 public:
  ///   counts  the pixels of the region; all three have one size
  void add(const scene::Image& result, const scene::Image& truth, const scene::Mask& counts);
  [[nodiscard]] RegionQuality quality() const;

 private:
  double squares_ = 0, dissimilarity_ = 0;
  double structure_ = 0, true_structure_ = 0;  ///< Sums of squares of `detail`.
  std::size_t pixels_ = 0;
};

/// A render as a screen shows it.
[[nodiscard]] scene::Image picture(const scene::GaussianCloud& cloud, const scene::Camera& camera);
/// The pixels that are not in the mask.
[[nodiscard]] scene::Mask complement(scene::Mask mask);

/// The view that was taken nearest to view v from another place; v if there is none.
[[nodiscard]] std::size_t nearest_view(std::span<const scene::Camera> views, std::size_t v);

/// What judge() finds.
struct Quality {
  RegionQuality edited;   ///< What the part dominates before or after, and 4 pixels (at 360 of height) around it.
  RegionQuality vacated;  ///< What it dominates before, and not after.
  RegionQuality arrived;  ///< What it dominates after.
  RegionQuality outside;  ///< All that is not `edited`.
  /// Mean distance from where a Gaussian of the part should be to the nearest one there, world units: of those that the
  /// capture shows before the move.
  double miss = 0;
};

/// Rows of a cloud.
struct RowsOf {
  const scene::GaussianCloud& cloud;
  std::span<const std::uint32_t> rows;
};
/// The regions of a part that is `before` in one scene and `after` in another.
[[nodiscard]] JudgedRegions judged_regions(RowsOf before, RowsOf after, const scene::Camera& camera);
[[nodiscard]] JudgedRegions judged_regions(const Case& the_case, const scene::Camera& camera);

/// The views that a case is judged at: its own, or else rendered from its truth, which takes a while. The case must
/// outlive it.
class JudgedViews {
 public:
  explicit JudgedViews(const Case& the_case);
  [[nodiscard]] const Case& of() const { return case_; }
  [[nodiscard]] std::span<const JudgedView> all() const { return case_.judged.empty() ? rendered_ : case_.judged; }

 private:
  const Case& case_;
  std::vector<JudgedView> rendered_;
};

/// Judges `result` at these views; `miss` is not known.
[[nodiscard]] Quality judge(std::span<const JudgedView> views, const scene::GaussianCloud& result);
/// Judges `result`, which came of the case's `before`.
[[nodiscard]] Quality judge(const JudgedViews& views, const scene::GaussianCloud& result);

/// How far what held-out views show of the edited region looks from what they should show: the mean of a perceptual
/// loss over the views that see it, each on the box around the region, in which all else is as it should be.
///   errors  those of the loss
[[nodiscard]] Result<double> perceptual_distance(std::span<const JudgedView> views, const scene::GaussianCloud& result,
                                                 optim::PerceptualLoss& loss);

/// How well corrected views of one edit agree where the part has gone: each pixel there, carried to the nearest other
/// view by the true depth, against what that view shows.
struct Agreement {
  double psnr_db = 0;      ///< Of the mean square difference over those pixels.
  std::size_t pixels = 0;  ///< Pixels that two views show. 0: the rest says nothing.
};
///   pictures  per view, in its size
[[nodiscard]] Agreement agreement(const Case& the_case, std::span<const scene::Camera> views,
                                  std::span<const scene::Image> pictures);

/// A case at one view, side by side: before, deformed, result, truth, and four times the difference of the last two.
[[nodiscard]] scene::Image comparison(const Case& the_case, const scene::GaussianCloud& deformed,
                                      const scene::GaussianCloud& result, const scene::Camera& camera);

}  // namespace engine::evaluate
