#include "server/scenes/uploads/scene_statistics.h"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace server::scenes {
namespace {

template <class T>
double median(std::vector<T> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return double(*middle);
}

}  // namespace

SceneStatistics statistics(const engine::scene::GaussianCloud& cloud) {
  SceneStatistics found;
  const auto box = engine::scene::bounds(cloud);
  found.low = engine::DVec3(box.low), found.high = engine::DVec3(box.high);
  found.centre = {median(cloud.mean.x), median(cloud.mean.y), median(cloud.mean.z)};
  std::vector<double> distances(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i)
    distances[i] = glm::length(engine::DVec3(cloud.mean.get(i)) - found.centre);
  found.radius = median(std::move(distances));
  return found;
}

}  // namespace server::scenes
