#include "server/edits/estimate.h"

#include <algorithm>
#include <numeric>
#include <string>
#include <vector>

#include "engine/edit/optimise.h"
#include "engine/edit/views.h"
#include "engine/edit/workload.h"
#include "server/edits/convert.h"

namespace server::edits {
namespace {

namespace edit = engine::edit;
namespace scene = engine::scene;

constexpr int virtual_cameras_looked_for = 8;  // they stand around the part alike: a few tell what all will see

// Larger pictures are not rendered to see how long they take: a frame's time goes with its pixels.
constexpr int most_measured_side = 1024;

constexpr double load_seconds = 1e-3, publish_seconds = 6e-3, flatten_row_seconds = 2e-8;

constexpr std::size_t frame_row_bytes = 200, frame_pixel_bytes = 32, trained_pixel_bytes = 36, frozen_row_bytes = 24;
constexpr std::size_t corrected_pixel_bytes = 36, corrected_row_bytes = 100;
constexpr std::size_t repainted_pixel_bytes = 52, history_pixel_bytes = 6;

/// Some of the cameras that the edit would make for itself.
std::vector<scene::Camera> some_virtual_cameras(const scene::GaussianCloud& cloud, edit::Request request) {
  request.params.views = std::min(request.params.views, virtual_cameras_looked_for);
  return edit::candidate_cameras(cloud, {}, request);
}

/// Of networks, and of what they compute.
std::uint64_t model_bytes(const JobWorkload& work) {
  std::uint64_t networks = 0, computed = 0;
  if (const auto& repainter = work.models.repainter) {
    const bool learns = work.edit.first_tuning > 0 || work.edit.later_tuning > 0;
    networks += repainter->network_bytes;
    computed = learns ? std::max(repainter->painting_bytes, repainter->learning_bytes) : repainter->painting_bytes;
  }
  if (const auto& perceptual = work.models.perceptual) {
    networks += perceptual->network_bytes;
    computed = std::max(computed, perceptual->pixel_bytes * work.edit.view_pixels);
  }
  return networks + computed;
}

/// Virtual cameras stand around what is dragged.
std::string around(const edit::Request& request) {
  std::string place = " around";
  if (!request.handles.empty())
    for (int axis = 0; axis < 3; ++axis) place += " " + std::to_string(request.handles[0].source[axis]);
  return place;
}

}  // namespace

std::vector<scene::Camera> cameras_of(const engine::io::Dataset* dataset) {
  if (dataset == nullptr) return {};
  return engine::io::cameras_of(*dataset);
}

std::size_t view_pixels_at(int max_image_side, std::span<const scene::Camera> dataset) {
  const auto side = std::size_t(max_image_side);
  return dataset.empty() ? side * side : edit::view_pixels(dataset, max_image_side);  // virtual cameras are square
}

JobWorkload memory_workload_of(const scene::LayeredCloud& version, const edit::Request& request,
                               const edit::PreviewOutcome& preview, std::span<const scene::Camera> dataset,
                               bool corrected, int pictured) {
  const scene::GaussianCloud& cloud = *version.base;
  const edit::Params& params = request.params;
  JobWorkload work;
  work.row_bytes = cloud.size() == 0 ? 0 : scene::memory_bytes(cloud) / cloud.size();
  work.layered = version.overlay != nullptr;
  work.copies = preview.overlay.added();
  work.edit = edit::workload_of(version.size(), request, corrected);
  work.edit.dragged = std::accumulate(preview.counts.begin(), preview.counts.end(), std::size_t{0});
  work.edit.candidates = dataset.empty() ? std::size_t(params.views) : dataset.size();
  work.edit.virtual_views = dataset.empty();
  work.edit.views = dataset.empty() ? std::size_t(params.views) : edit::views_at_most(dataset, params);
  work.edit.view_pixels = view_pixels_at(params.max_image_side, dataset);
  work.edit.shown = work.edit.kept = true;
  work.edit.pictured = std::min(std::size_t(std::max(0, pictured)), work.edit.views);
  return work;
}

JobWorkload workload_of(const scene::LayeredCloud& version, const edit::Request& request,
                        const edit::PreviewOutcome& preview, std::span<const scene::Camera> dataset, bool corrected,
                        int pictured, const std::string& scene_id, SpeedLog& log) {
  const scene::GaussianCloud& cloud = *version.base;
  std::vector<scene::Camera> cameras(dataset.begin(), dataset.end());
  if (cameras.empty()) cameras = some_virtual_cameras(cloud, request);
  const scene::GaussianCloud& copies = preview.overlay.rows;
  std::vector<std::uint32_t> rows(copies.size());
  std::iota(rows.begin(), rows.end(), 0u);

  JobWorkload work = memory_workload_of(version, request, preview, dataset, corrected, pictured);
  work.edit.covered = edit::covered_part(copies, rows, cameras);
  const int side = std::min(request.params.max_image_side, most_measured_side);
  const std::string picture =
      scene_id + (dataset.empty() ? around(request) : " in its views") + ", " + std::to_string(side) + " pixels";
  const MachineSpeed speed = log.speed_of(picture, [&] { return edit::measured_frames(cloud, cameras, side); });
  work.edit.frame = speed.frame;
  work.edit.slowness = speed.slowness;
  // The preview has been a trial of the drag, whose time no count of rows tells: bodies are solved for.
  const double as_usual = speed.slowness / speed.now;
  work.edit.assign_seconds = preview.assign_seconds * as_usual;
  work.edit.drag_seconds = preview.drag_seconds * as_usual;
  return work;
}

void add_models(JobWorkload& work, const models::Costs& costs) {
  work.models = costs;
  work.edit.repainted = costs.repainter.has_value();
  work.edit.repaint_time = costs.repainter ? repaint_time_of(*costs.repainter) : edit::RepaintTime{};
  work.edit.perceptual_pixel_seconds = costs.perceptual ? costs.perceptual->pixel_seconds : 0;
}

std::uint64_t measuring_bytes(const JobWorkload& work) {
  constexpr std::size_t most_pixels = std::size_t(most_measured_side) * most_measured_side;
  return work.edit.gaussians * frame_row_bytes + std::min(work.edit.view_pixels, most_pixels) * frame_pixel_bytes;
}

double seconds_to_load(std::size_t gaussians, bool layered) {
  return load_seconds + (layered ? flatten_row_seconds * double(gaussians) : 0);
}

double seconds_to_publish(std::size_t gaussians) { return publish_seconds + flatten_row_seconds * double(gaussians); }

double estimated_seconds(const JobWorkload& work) {
  return seconds_to_load(work.edit.gaussians, work.layered) + seconds_of(edit::plan_of(work.edit)) +
         seconds_to_publish(work.edit.gaussians);
}

std::uint64_t estimated_bytes(const JobWorkload& work) {
  const std::uint64_t n = work.edit.gaussians, views = work.edit.views, pixels = work.edit.view_pixels;
  const std::uint64_t rows =
      (work.layered ? n : 0) + n + std::uint64_t(work.edit.intervals) * work.copies + n + work.copies;
  const std::uint64_t trained = work.edit.iterations > 0
                                    ? views * trained_pixel_bytes * pixels +
                                          std::min<std::uint64_t>(views * frozen_row_bytes * n, edit::frozen_memory)
                                    : 0;
  const std::uint64_t corrected = work.edit.corrected
                                      ? views * corrected_pixel_bytes * pixels +
                                            n * (work.row_bytes + corrected_row_bytes) + edit::witness_bytes(work.edit)
                                      : 0;
  const std::uint64_t history = history_pixel_bytes * (std::uint64_t(work.edit.intervals) + 1);
  const std::uint64_t repainted = work.edit.repainted ? views * (repainted_pixel_bytes + history) * pixels : 0;
  return rows * work.row_bytes + n * frame_row_bytes + (views + frame_pixel_bytes) * pixels + trained + corrected +
         repainted + model_bytes(work);
}

}  // namespace server::edits
