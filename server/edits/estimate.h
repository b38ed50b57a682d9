// What an edit will cost, before it is done.
#pragma once

#include <cstddef>
#include <cstdint>

namespace server::edits {

/// What the cost of an edit depends on.
struct Workload {
  std::size_t gaussians = 0;         ///< N, of the version.
  std::size_t row_bytes = 0;         ///< Of one Gaussian in memory.
  bool layered = false;              ///< The version is an overlay: it is flattened first.
  std::size_t dragged = 0;           ///< |P_h|
  std::size_t copies = 0;            ///< Deformed copies in the result.
  int intervals = 1;                 ///< T
  std::size_t iterations = 0;        ///< Of the optimisation, all corrections of an interval together.
  std::size_t rounds = 1;            ///< A: times that an interval is optimised, and corrected before.
  bool corrected = false;            ///< By a corrector.
  std::size_t candidates = 0;        ///< C: cameras that are compared.
  std::size_t candidate_pixels = 0;  ///< Of one of them, as it comes.
  bool virtual_views = false;        ///< They have to be found first.
  std::size_t views = 0;             ///< V, that the edit looks through.
  std::size_t pictured = 0;          ///< Of them, those with intermediate pictures.
  std::size_t view_pixels = 0;       ///< Of one view, as the edit works on it.

  // One whole frame of this scene, rendered by this machine as it is now.
  double probe_seconds = 0;
  std::size_t probe_pixels = 0;
};

/// Pixels of the pictures on which candidates are compared.
constexpr std::size_t comparison_pixels = 192 * 144;

/// Time of a whole frame of `pixels`: nine tenths of the probe go with the Gaussians and are the same for every size,
/// one tenth goes with the pixels.
[[nodiscard]] double frame_seconds(const Workload& work, std::size_t pixels);

/// Seconds, about, with the machine to itself:
///     masks       share (2 C frame(192 x 144) + (T + 1) V frame(view)) + pixel V view (1 + T / 10)
///                                         only the part that moves is rendered: a tenth of the time of a frame, a
///                                         quarter through virtual views, which are close to it
///     pictures    (T + 1) (K (frame(view) + jpeg view) + row N) + 2 T K write
///     iterations  T (A V + iterations min(1, 0.06 + 7 |P_h| / N)) frame(view) [iterations]
///                                         each view is set up, each time; an iteration renders and differentiates a
///                                         part of one, which grows with what is dragged
///     corrections 0.7 C frame(candidate) + V frame(view) + T A V (2.5 frame(view) + synthesis view) [corrected]
///                                         what each camera has seen, and the unedited scene in each view; then, each
///                                         time, a view without the dragged part, the view as it is, and what fills
///                                         them
///     rows        row N (2 + [layered]) + dome N [virtual] + drag |P_h| T
/// It says nothing of the time an edit waits for others.
[[nodiscard]] double estimated_seconds(const Workload& work);

/// Bytes beside the scene as the service holds it, all of them given back at the end:
///     row_bytes ([layered] N                    the version as one cloud
///                + N + T copies                 the working scene
///                + N + copies)                  the scene of a picture, as long as it is rendered
///   + 200 N                                     splats of a frame, columns of the working scene
///   + V pixels + 32 pixels                      masks; one frame
///   + V 36 pixels [iterations]                  of each view, while it optimises: three pictures, at most
///   + min(V 24 N, frozen_memory) [iterations]   frozen splats of the views' regions, of 48 bytes, which are half of
///                                               them where the edit is large
///   + V 30 pixels [corrected]                   of each view: the unedited scene and its depth, what was vacated and
///                                               must not be learned from, and what it was corrected to
///   + (row_bytes + 100) N [corrected]           the unedited scene, its trust, and a search tree of it
[[nodiscard]] std::uint64_t estimated_bytes(const Workload& work);

}  // namespace server::edits
