#include "engine/edit/workload.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "engine/edit/handles.h"
#include "engine/edit/views.h"
#include "engine/render/forward.h"
#include "engine/repair/witnesses.h"
#include "engine/working/footprint.h"

namespace engine::edit {
namespace {

constexpr int times_each = 3;  // the first one of a size also warms up

// A ball of Gaussians in a picture, and how long it took where the plan's figures were measured.
constexpr std::size_t yardstick_gaussians = 20'000;
constexpr int yardstick_side = 256;
constexpr int yardstick_times = 5;
constexpr double yardstick_seconds = 1.0e-3;

constexpr std::size_t most_cameras = 12, most_rows = 3000;

/// Every so many of them, up to `most`.
std::size_t step_through(std::size_t count, std::size_t most) { return (count + most - 1) / most; }

double best_seconds(const scene::GaussianCloud& scene, const scene::Camera& camera, render::Workspace& workspace,
                    int times = times_each) {
  double best = std::numeric_limits<double>::infinity();
  render::Rendering rendering;
  for (int i = 0; i < times; ++i) {
    const auto start = std::chrono::steady_clock::now();
    render::forward(scene, camera, {}, {}, workspace, rendering);
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return best;
}

std::size_t pixels_of(const scene::Camera& camera) { return std::size_t(camera.width) * std::size_t(camera.height); }

/// Evenly spread on a sphere of radius 1, by a spiral; a third as wide as they are apart.
scene::GaussianCloud yardstick() {
  scene::GaussianCloud ball;
  ball.resize(yardstick_gaussians);
  const double golden_angle = std::numbers::pi * (3 - std::sqrt(5.0));
  const float log_scale = std::log(1.2f / std::sqrt(float(yardstick_gaussians)));
  for (std::size_t i = 0; i < ball.size(); ++i) {
    const double z = 1 - 2 * (double(i) + 0.5) / double(ball.size()), ring = std::sqrt(1 - z * z);
    ball.mean.set(i, Vec3(ring * std::cos(golden_angle * double(i)), ring * std::sin(golden_angle * double(i)), z));
    ball.log_scale.set(i, Vec3(log_scale));
    ball.rotation.set(i, Quat(1, 0, 0, 0));
  }
  return ball;
}

}  // namespace

double measured_slowness() {
  const scene::Camera camera =
      scene::look_at(DVec3(0, 0, -3), DVec3(0), DVec3(0, -1, 0), 0.8, yardstick_side, yardstick_side);
  render::Workspace workspace;
  return best_seconds(yardstick(), camera, workspace, yardstick_times) / yardstick_seconds;
}

FrameTime measured_frames(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras,
                          int max_image_side) {
  if (cameras.empty()) return {};
  const scene::Camera large = scene::fit_within(cameras[cameras.size() / 2], std::max(max_image_side, comparison_side));
  const scene::Camera small = scene::fit_within(large, std::max(1, std::max(large.width, large.height) / 4));
  render::Workspace workspace;
  const double small_seconds = best_seconds(scene, small, workspace);
  const double large_seconds = best_seconds(scene, large, workspace);
  const double more_pixels = double(pixels_of(large)) - double(pixels_of(small));
  const double pixel = more_pixels > 0 ? std::max(0.0, large_seconds - small_seconds) / more_pixels : 0.0;
  return {std::max(0.0, large_seconds - pixel * double(pixels_of(large))), pixel};
}

double covered_part(const scene::GaussianCloud& scene, std::span<const std::uint32_t> rows,
                    std::span<const scene::Camera> cameras) {
  if (rows.empty() || cameras.empty()) return 0;
  std::vector<std::uint32_t> some;
  for (std::size_t k = 0; k < rows.size(); k += step_through(rows.size(), most_rows)) some.push_back(rows[k]);
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t k = 0; k < cameras.size(); k += step_through(cameras.size(), most_cameras), ++count) {
    const scene::Rect rect = working::touched_rect(scene, some, cameras[k]);
    sum += double(rect.width()) * double(rect.height()) / double(pixels_of(cameras[k]));
  }
  return sum / double(count);
}

std::size_t view_pixels(std::span<const scene::Camera> cameras, int max_image_side) {
  std::size_t sum = 0;
  for (const scene::Camera& camera : cameras) sum += pixels_of(scene::fit_within(camera, max_image_side));
  return cameras.empty() ? 0 : sum / cameras.size();
}

Workload workload_of(std::size_t gaussians, const Request& request, bool corrected) {
  Workload work;
  work.gaussians = gaussians;
  work.intervals = resolved_intervals(request);
  work.corrections = request.params.annealing_steps;
  work.iterations = request.params.iterations;
  work.corrected = corrected;
  work.first_tuning = request.params.tuning_steps, work.later_tuning = request.params.tuning_steps_later;
  work.mean_strength = (request.params.strength_initial + request.params.strength_final) / 2;
  work.vacates = departure_of(request) == Mode::move;
  work.selected = request.selected && request.crumbs != Crumbs::keep &&
                  (request.mode == Mode::remove || request.params.interpolation == Interpolation::arap);
  return work;
}

std::uint64_t witness_bytes(const Workload& work) {
  if (!work.corrected || !work.vacates) return 0;
  const std::uint64_t pixels = std::min<std::uint64_t>(work.view_pixels, repair::witness_side * repair::witness_side);
  return std::min(work.candidates, repair::most_witnesses) * pixels * sizeof(float);
}

Workload measured(Workload work, const State& state, const scene::GaussianCloud& input,
                  std::span<const scene::Camera> candidates, const Params& params) {
  std::vector<std::uint32_t> dragged = state.scene.dragged_rows();
  for (std::uint32_t& row : dragged) row = state.scene.parent()[row];
  const std::span<const scene::Camera> cameras = candidates.empty() ? std::span(state.views) : candidates;
  work.dragged = dragged.size();
  work.covered = covered_part(input, dragged, cameras);
  work.candidates = candidates.size();
  work.views = state.views.empty() ? views_at_most(candidates, params) : state.views.size();
  work.view_pixels = view_pixels(cameras, params.max_image_side);
  work.frame = measured_frames(input, cameras, params.max_image_side);
  work.slowness = measured_slowness();
  return work;
}

}  // namespace engine::edit
