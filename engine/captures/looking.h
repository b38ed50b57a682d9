// A person who selects a thing by clicks and looks at what is tinted before the next one: how selections are made.
#pragma once

#include "engine/captures/captured_case.h"
#include "engine/core/result.h"
#include "engine/scene/gaussian_cloud.h"
#include "engine/select/operation.h"

namespace engine::captures {

/// As many as a selection may take.
constexpr int most_clicks = 6;

/// What becomes of a click after which more pixels are wrong than before.
enum class WhenWorse {
  undone,  ///< At once.
  /// By the next click, on the largest patch that is wrong the other way; where that does not help, both go.
  corrected
};

/// The points that such a person ends with. Each click goes to the middle of the largest patch, in any of six photos'
/// views, that shows the part and is not tinted (on it), or is tinted and does not show it (not it), a little beside
/// (the noise of the case's clicks, less where a patch is narrow: people zoom in). A click that makes it worse counts
/// all the same; once it is undone, the next largest patch has its turn. It ends after most_clicks or when no patch is
/// wider than three pixels. What is meant is known from the true scene, as it is in a person's mind; clicks and tints
/// are on the trained one.
///   errors  unprocessable: no view shows the part; those of select::select(), where it refuses all clicks
[[nodiscard]] Result<select::Grow> clicks_of_a_looking_person(const CapturedCase& the_case,
                                                              const scene::GaussianCloud& scene, WhenWorse when_worse);

}  // namespace engine::captures
