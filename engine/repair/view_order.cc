#include "engine/repair/view_order.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace engine::repair {

std::vector<std::size_t> outward(std::span<const scene::Camera> views, std::size_t from) {
  std::vector<double> far(views.size(), 1e9);
  std::vector<std::uint8_t> done(views.size(), 0);
  std::vector<std::size_t> order;
  for (std::size_t next = from; order.size() < views.size();) {
    order.push_back(next);
    done[next] = 1;
    for (std::size_t v = 0; v < views.size(); ++v)
      far[v] = std::min(far[v], glm::distance(views[v].centre(), views[next].centre()));
    double least = 1e300;
    for (std::size_t v = 0; v < views.size(); ++v)
      if (done[v] == 0 && far[v] < least) least = far[v], next = v;
  }
  return order;
}

std::vector<std::size_t> nearest_views(std::span<const scene::Camera> views, std::size_t to, std::size_t count) {
  std::vector<double> distance;
  for (const scene::Camera& view : views) distance.push_back(glm::distance(view.centre(), views[to].centre()));
  std::vector<std::size_t> order(views.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return distance[a] < distance[b]; });
  order.resize(std::min(order.size(), count));
  return order;
}

}  // namespace engine::repair
