// Surfaces covered with Gaussians: flat ones, that lie in the surface and carry its lit colour.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/procedural/light.h"
#include "engine/procedural/surface.h"
#include "engine/scene/camera.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::procedural {

/// Gaussians on the surfaces of objects.
struct Surfels {
  scene::GaussianCloud cloud;         ///< SH degree 1: glazed things look a little different from each side.
  std::vector<std::uint16_t> object;  ///< [N] number of the object each Gaussian belongs to.
  float spacing = 0;                  ///< Of Gaussians where a patch's density is 1, world units.
};

/// Covers what the cameras can see of the objects with about `count` Gaussians; what no camera can see stays empty.
///
/// Gaussians sit in rows along the patches, a little jittered, and overlap so that surfaces are closed. The short axis
/// is the surface normal. A Gaussian is kept if from some camera a ray reaches it, or the surface right beside it, in
/// front of which nothing stands.
///   count    at least 1; the result is within 1 % of it unless the cameras see next to nothing
///   shading  objects that cast shadows and send light back; empty: those that are covered
///   returns  the same bytes for the same arguments, for any number of threads; but for the colours, for any shading
[[nodiscard]] Surfels make_surfels(std::span<const Object> objects, const Light& light,
                                   std::span<const scene::Camera> cameras, std::size_t count, std::uint64_t seed,
                                   std::span<const Object> shading = {});

/// What make_surfels() has left out because no camera can see it: with it, things are closed all over, and what stands
/// may be taken away.
///   seen  what it returned for the same other arguments
[[nodiscard]] Surfels make_unseen_surfels(const Surfels& seen, std::span<const Object> objects, const Light& light,
                                          std::span<const scene::Camera> cameras, std::size_t count, std::uint64_t seed,
                                          std::span<const Object> shading = {});

/// Covers the objects all over, inside and behind too, whether any camera sees it or not.
///   spacing  of Gaussians where a patch's density is 1, world units
///   cameras  for which glazed things are painted
///   shading  as for make_surfels()
///   returns  Gaussians by object and patch, in order; the same bytes for the same arguments, for any number of threads
[[nodiscard]] Surfels cover_all(std::span<const Object> objects, const Light& light,
                                std::span<const scene::Camera> cameras, float spacing, std::uint64_t seed,
                                std::span<const Object> shading = {});

}  // namespace engine::procedural
