// The arrays of a cloud, one after the other: for whatever treats them all alike.
#pragma once

#include <cstddef>
#include <tuple>

#include "engine/scene/gaussian_cloud.h"

namespace engine::scene {

/// Calls visit(stride, array...) for every array of a cloud, with the same array of each of `clouds`; `stride` is the
/// number of its values per row in the first.
template <class Visit, class... Clouds>
void visit_arrays(Visit&& visit, Clouds&... clouds) {
  visit(std::size_t{1}, clouds.mean.x...);
  visit(std::size_t{1}, clouds.mean.y...);
  visit(std::size_t{1}, clouds.mean.z...);
  visit(std::size_t{1}, clouds.log_scale.x...);
  visit(std::size_t{1}, clouds.log_scale.y...);
  visit(std::size_t{1}, clouds.log_scale.z...);
  visit(std::size_t{1}, clouds.rotation.w...);
  visit(std::size_t{1}, clouds.rotation.x...);
  visit(std::size_t{1}, clouds.rotation.y...);
  visit(std::size_t{1}, clouds.rotation.z...);
  visit(std::size_t{1}, clouds.opacity_logit...);
  const auto& first = std::get<0>(std::tie(clouds...));
  visit(first.sh_stride(), clouds.sh...);
  visit(first.extra_stride, clouds.extra...);
}

}  // namespace engine::scene
