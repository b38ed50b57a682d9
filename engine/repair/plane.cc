#include "engine/repair/plane.h"

#include <Eigen/Dense>

namespace engine::repair {

Plane plane_of(std::span<const DVec3> points) {
  Plane plane;
  for (const DVec3 point : points) plane.middle += point / double(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const DVec3 point : points) {
    const DVec3 offset = point - plane.middle;
    const Eigen::Vector3d column(offset.x, offset.y, offset.z);
    spread += column * column.transpose();
  }
  const Eigen::Vector3d least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  plane.normal = {least.x(), least.y(), least.z()};
  return plane;
}

}  // namespace engine::repair
