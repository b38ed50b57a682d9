#include "engine/repair/trust.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/neighbours/point_index.h"
#include "engine/render/largest_weight.h"
#include "engine/render/project.h"

namespace engine::repair {
namespace {

using working::Role;

// A Gaussian that was only seen through others that let through less than this was hardly trained: it may have any
// colour. Its largest blending weight is about its opacity times the largest transmittance in front of it.
constexpr float observed_transmittance = 0.05f;
// Opacity below which a Gaussian is too faint for its weight to tell; it hardly shows either.
constexpr float least_opacity = 0.05f;

// So much farther from its neighbours than in the input a copy is trusted fully, and not at all.
constexpr float tolerable_stretch = 1.6f, torn_stretch = 3.0f;
// So many neighbours say how far it is: enough that the optimisation, which moves each a little, does not matter.
constexpr std::size_t neighbours_asked = 16;

/// How much farther copies are from their neighbours than their parents are from each other, by the parent's row: for
/// each parent its first copy is asked, the others are children of the optimisation. 1 where nothing is known.
std::vector<float> stretch_by_parent(const WorkingScene& working, std::span<const std::uint32_t> copies) {
  std::vector<float> stretch(working.input_rows(), 1.0f);
  std::vector<std::uint8_t> seen(working.input_rows(), 0);
  std::vector<std::uint32_t> first_copies;
  std::vector<float> points;
  for (const std::uint32_t row : copies) {
    const std::uint32_t parent = working.parent()[row];
    if (seen[parent] != 0) continue;
    seen[parent] = 1;
    first_copies.push_back(row);
    for (int axis = 0; axis < 3; ++axis) points.push_back(working.cloud().mean.get(parent)[axis]);
  }
  if (first_copies.size() <= neighbours_asked) return stretch;
  const std::size_t asked = neighbours_asked + 1;  // the nearest is the copy itself
  const auto nearest = neighbours::PointIndex(points, 3).nearest(points, asked);
  for (std::size_t k = 0; k < first_copies.size(); ++k) {
    double before = 0, now = 0;
    for (const neighbours::Neighbour& neighbour : std::span(nearest).subspan(k * asked, asked)) {
      before += std::sqrt(double(neighbour.squared_distance));
      now += glm::distance(DVec3(working.cloud().mean.get(first_copies[k])),
                           DVec3(working.cloud().mean.get(first_copies[neighbour.index])));
    }
    if (before > 0) stretch[working.parent()[first_copies[k]]] = float(now / before);
  }
  return stretch;
}

}  // namespace

std::vector<float> shown_rows(const scene::GaussianCloud& scene, std::span<const scene::Camera> cameras) {
  std::vector<float> weight = render::largest_weights(scene, cameras);
  for (std::size_t i = 0; i < weight.size(); ++i)
    weight[i] /= std::max(render::opacity<float>(scene.opacity_logit[i]), least_opacity);
  return weight;
}

std::vector<float> observed_rows(std::vector<float> shown) {
  for (float& part : shown) part = std::min(part / observed_transmittance, 1.0f);
  return shown;
}

std::vector<float> trust_of_rows(const WorkingScene& working, std::span<const float> observed, Mode mode) {
  assert(observed.size() == working.input_rows());
  std::vector<float> trust(working.role().size());
  std::vector<std::uint32_t> copies;
  for (std::uint32_t row = 0; row < trust.size(); ++row) {
    trust[row] = observed[working.parent()[row]];
    if (working::has_left(working.role()[row]) && mode == Mode::move) trust[row] = 0;
    if (working.role()[row] == Role::seed) trust[row] = 1;
    if (working.role()[row] == Role::copy) copies.push_back(row);
  }
  const std::vector<float> stretch = stretch_by_parent(working, copies);
  for (const std::uint32_t row : copies)
    trust[row] *=
        std::clamp((torn_stretch - stretch[working.parent()[row]]) / (torn_stretch - tolerable_stretch), 0.0f, 1.0f);
  return trust;
}

}  // namespace engine::repair
