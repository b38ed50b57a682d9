#include "server/edits/estimate.h"

#include <algorithm>

#include "engine/edit/optimise.h"

namespace server::edits {
namespace {

// Fitted to edits of the demo scene (150,000 Gaussians, with and without its cameras, pictures of 256 to 1024 pixels,
// 1 and 5 intervals; of corrections 192 to 640 pixels, 1 and 4 intervals, a 25th and a 6th of the pictures to be
// filled), rounded up.
constexpr double pixel_part = 0.1;  // of the probe's time
constexpr double mask_share = 0.1;  // of a whole frame's time
constexpr double near_mask_share = 0.25;
constexpr double mask_pixel_seconds = 1e-8;  // to unite, dilate and keep a mask
constexpr double row_seconds = 2e-8;         // to copy one Gaussian
constexpr double dome_seconds = 1e-7;        // per Gaussian, to find virtual cameras
constexpr double drag_seconds = 2e-6;        // to deform, paste and relocate one dragged Gaussian
constexpr double jpeg_pixel_seconds = 1.5e-8;
constexpr double write_seconds = 1e-3;                    // until a picture is on disk
constexpr double least_part = 0.06, part_of_dragged = 7;  // of a whole frame's time: an iteration
constexpr double observe_share = 0.7;                     // of a whole frame's time: what a camera has seen
constexpr double correction_frames = 2.5;
constexpr double correction_pixel_seconds = 2e-7;  // to fill a picture, where a tenth of it is to be filled
constexpr double least_seconds = 0.05;             // records, checkpoints, the version file

constexpr std::size_t frame_row_bytes = 200, frame_pixel_bytes = 32, trained_pixel_bytes = 36, frozen_row_bytes = 24;
constexpr std::size_t corrected_pixel_bytes = 30, corrected_row_bytes = 100;

}  // namespace

double frame_seconds(const Workload& work, std::size_t pixels) {
  if (work.probe_pixels == 0) return 0;
  return work.probe_seconds * (1 - pixel_part + pixel_part * double(pixels) / double(work.probe_pixels));
}

double estimated_seconds(const Workload& work) {
  const double intervals = work.intervals, n = double(work.gaussians), pictured = double(work.pictured),
               views = double(work.views), pixels = double(work.view_pixels);
  const double view_frame = frame_seconds(work, work.view_pixels);
  const double masks = (work.virtual_views ? near_mask_share : mask_share) *
                           (2 * double(work.candidates) * frame_seconds(work, comparison_pixels) +
                            (intervals + 1) * views * view_frame) +
                       mask_pixel_seconds * views * pixels * (1 + intervals / 10);
  const double pictures = (intervals + 1) * (pictured * (view_frame + jpeg_pixel_seconds * pixels) + row_seconds * n) +
                          2 * intervals * pictured * write_seconds;
  const double rows = row_seconds * n * (work.layered ? 3 : 2) + (work.virtual_views ? dome_seconds * n : 0) +
                      drag_seconds * double(work.dragged) * intervals;
  const double part = n > 0 ? std::min(1.0, least_part + part_of_dragged * double(work.dragged) / n) : 0.0;
  const double iterations =
      work.iterations > 0 ? intervals * (double(work.rounds) * views + part * double(work.iterations)) * view_frame
                          : 0.0;
  const double corrections =
      work.corrected
          ? observe_share * double(work.candidates) * frame_seconds(work, work.candidate_pixels) + views * view_frame +
                intervals * double(work.rounds) * views *
                    (correction_frames * view_frame + correction_pixel_seconds * pixels)
          : 0.0;
  return least_seconds + masks + pictures + iterations + corrections + rows;
}

std::uint64_t estimated_bytes(const Workload& work) {
  const std::uint64_t n = work.gaussians;
  const std::uint64_t rows = (work.layered ? n : 0) + n + std::uint64_t(work.intervals) * work.copies + n + work.copies;
  const std::uint64_t trained =
      work.iterations > 0 ? work.views * trained_pixel_bytes * work.view_pixels +
                                std::min<std::uint64_t>(work.views * frozen_row_bytes * n, engine::edit::frozen_memory)
                          : 0;
  const std::uint64_t corrected = work.corrected ? work.views * corrected_pixel_bytes * work.view_pixels +
                                                       n * (work.row_bytes + corrected_row_bytes)
                                                 : 0;
  return rows * work.row_bytes + n * frame_row_bytes + (work.views + frame_pixel_bytes) * work.view_pixels + trained +
         corrected;
}

}  // namespace server::edits
