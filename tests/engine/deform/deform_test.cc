#include "engine/deform/deform.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/scene/sh.h"
#include "tests/engine/scene/random_cloud.h"

namespace engine::deform {
namespace {

std::vector<std::uint32_t> all_rows(std::size_t n) {
  std::vector<std::uint32_t> rows(n);
  for (std::size_t i = 0; i < n; ++i) rows[i] = std::uint32_t(i);
  return rows;
}

const std::vector<Drag> turning{
    {DVec3(1, 0, 0), DVec3(0.2, 1, 0)}, {DVec3(-1, 0, 0), DVec3(-0.7, -1, 0.3)}, {DVec3(0, 0, 1), DVec3(0.5, 0, 1.5)}};

TEST(Deformation, ColourTurnsWithTheGaussian) {
  scene::GaussianCloud cloud = scene::random_cloud(30, 3, 21);
  const scene::GaussianCloud before = cloud;
  const auto motions = handle_motions(turning, Rotation::shortest_arc);
  const auto rows = all_rows(cloud.size());
  const Deformation moved =
      deformation(cloud, rows, std::vector<std::uint16_t>(rows.size(), 1), motions, Interpolation::rigid);
  for (std::size_t k = 0; k < rows.size(); ++k) apply(moved, k, true, cloud, k);
  EXPECT_EQ(cloud.opacity_logit, before.opacity_logit);
  EXPECT_EQ(cloud.log_scale, before.log_scale);
  Rng rng(5);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const DVec3 d = glm::normalize(DVec3(rng.normal(), rng.normal(), rng.normal()));
    const DVec3 turned = moved.turn[i] * d;
    double from[16], to[16];
    scene::sh_basis(3, d.x, d.y, d.z, from);
    scene::sh_basis(3, turned.x, turned.y, turned.z, to);
    for (std::size_t c = 0; c < 3; ++c) {
      double old_colour = 0, new_colour = 0;
      for (std::size_t k = 0; k < 16; ++k) {
        old_colour += from[k] * double(before.sh_row(i)[16 * c + k]);
        new_colour += to[k] * double(cloud.sh_row(i)[16 * c + k]);
      }
      EXPECT_NEAR(new_colour, old_colour, 3e-6) << i << " " << c;  // coefficients of several units, stored as float
    }
    // A local axis, carried to the world before and after, turned by the same rotation.
    const DVec3 axis_before = glm::normalize(DQuat(before.rotation.get(i))) * DVec3(1, 0, 0);
    const DVec3 axis_after = glm::normalize(DQuat(cloud.rotation.get(i))) * DVec3(1, 0, 0);
    EXPECT_LT(glm::distance(moved.turn[i] * axis_before, axis_after), 1e-6) << i;
  }
}

TEST(Deformation, WithoutRotationTheBytesOfQuaternionAndColourStay) {
  scene::GaussianCloud cloud = scene::random_cloud(4, 3, 21);
  cloud.rotation.set(0, {1.0f, -0.0f, 0.0f, -0.0f});
  cloud.sh_row(0)[5] = -0.0f;
  const scene::GaussianCloud before = cloud;
  const auto motions = handle_motions(std::vector<Drag>{{DVec3(0), DVec3(1, 0, 0)}}, Rotation::shortest_arc);
  const auto rows = all_rows(4);
  const Deformation moved = deformation(cloud, rows, std::vector<std::uint16_t>(4, 1), motions, Interpolation::paper);
  for (std::size_t k = 0; k < 4; ++k) apply(moved, k, true, cloud, k);
  EXPECT_TRUE(std::signbit(cloud.rotation.x[0]) && std::signbit(cloud.rotation.z[0]));
  EXPECT_EQ(cloud.rotation, before.rotation);
  EXPECT_EQ(std::memcmp(cloud.sh.data(), before.sh.data(), before.sh.size() * sizeof(float)), 0);
  EXPECT_NE(cloud.mean, before.mean);
}

TEST(Deformation, SaysWhatDoesNotMove) {
  scene::GaussianCloud cloud = scene::random_cloud(2, 0, 21);
  cloud.mean.set(0, {0, 0, 0});
  cloud.mean.set(1, {0.5f, 0, 0});
  const std::vector<Drag> drags{{DVec3(0), DVec3(0), 0, true}, {DVec3(1, 0, 0), DVec3(1, 1, 0)}};
  const Deformation moved = deformation(cloud, all_rows(2), std::vector<std::uint16_t>{1, 2},
                                        handle_motions(drags, Rotation::shortest_arc), Interpolation::paper);
  EXPECT_EQ(moved.moves, (std::vector<std::uint8_t>{0, 1}));
}

TEST(Deformation, AnUnnormalisedQuaternionKeepsItsLength) {
  scene::GaussianCloud cloud = scene::random_cloud(20, 0, 21);
  for (std::size_t i = 0; i < 20; ++i) {
    const float length = std::pow(10.0f, float(i) - 10.0f);
    cloud.rotation.set(i, length * glm::normalize(cloud.rotation.get(i)));
  }
  const Deformation moved = deformation(cloud, all_rows(20), std::vector<std::uint16_t>(20, 1),
                                        handle_motions(turning, Rotation::paper), Interpolation::smooth);
  for (std::size_t i = 0; i < 20; ++i)
    EXPECT_NEAR(glm::length(moved.rotation.get(i)) / glm::length(cloud.rotation.get(i)), 1, 1e-6) << i;
}

TEST(Deformation, GivesTheSameBytesForAnyNumberOfThreads) {
  const scene::GaussianCloud cloud = scene::random_cloud(5000, 1, 21);
  const auto motions = handle_motions(turning, Rotation::shortest_arc);
  const auto rows = all_rows(cloud.size());
  const std::vector<std::uint16_t> owner(rows.size(), 1);
  const Deformation alone = deformation(cloud, rows, owner, motions, Interpolation::smooth);
  for (int threads : {1, 2, 4}) {
    WorkArena arena(threads);
    arena.run([&] {
      const Deformation result = deformation(cloud, rows, owner, motions, Interpolation::smooth);
      EXPECT_EQ(result.mean, alone.mean) << threads;
      EXPECT_EQ(result.rotation, alone.rotation) << threads;
      EXPECT_EQ(result.moves, alone.moves) << threads;
    });
  }
}

}  // namespace
}  // namespace engine::deform
