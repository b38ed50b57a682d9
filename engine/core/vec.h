// Vectors, matrices and quaternions: GLM under the names the engine uses.
// GLM matrices are column-major: m[column][row]. Quaternion constructors take (w, x, y, z).
#pragma once

#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/matrix_float3x3.hpp>
#include <glm/ext/quaternion_double.hpp>
#include <glm/ext/quaternion_float.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

namespace engine {

using Vec2 = glm::vec2;
using Vec3 = glm::vec3;
using Mat3 = glm::mat3;
using Quat = glm::quat;
using DVec2 = glm::dvec2;
using DVec3 = glm::dvec3;
using DMat3 = glm::dmat3;
using DQuat = glm::dquat;

}  // namespace engine
