#include "engine/working/frame.h"

namespace engine::working {
namespace {

void shift(scene::GaussianCloud& cloud, DVec3 by) {
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud.mean.set(i, Vec3(DVec3(cloud.mean.get(i)) + by));
}

}  // namespace

scene::Camera Frame::edit_from_world(scene::Camera camera) const {
  camera.translation += camera.rotation * origin_;
  return camera;
}

scene::GaussianCloud Frame::edit_from_world(scene::GaussianCloud cloud) const {
  if (!is_world()) shift(cloud, -origin_);
  return cloud;
}

scene::GaussianCloud Frame::world_from_edit(scene::GaussianCloud cloud) const {
  if (!is_world()) shift(cloud, origin_);
  return cloud;
}

}  // namespace engine::working
