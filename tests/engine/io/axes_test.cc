#include "engine/io/axes.h"

#include <gtest/gtest.h>

#include "engine/scene/sh.h"
#include "tests/engine/io/samples.h"

namespace engine::io {
namespace {

double colour(std::span<const float> sh, DVec3 d) {
  std::array<double, 16> basis;
  scene::sh_basis(3, d.x, d.y, d.z, basis.data());
  double sum = 0;
  for (std::size_t k = 0; k < sh.size(); ++k) sum += basis[k] * double(sh[k]);
  return sum;
}

TEST(Axes, TheirLettersAreTheColumnsOfTheMatrix) {
  EXPECT_EQ(rdf_from("RDF"), DMat3(1.0));
  EXPECT_EQ(rdf_from("RUB") * DVec3(1, 2, 3), DVec3(1, -2, -3));
  EXPECT_EQ(rdf_from("LUF") * DVec3(1, 2, 3), DVec3(-1, -2, 3));
  EXPECT_EQ(rdf_from("RFU") * DVec3(1, 2, 3), DVec3(1, -3, 2));
}

TEST(Axes, ATurnedSceneIsTheSameSceneSeenTurned) {
  for (const char* axes : {"RUB", "LUF", "RUF", "LDF", "RFU", "LBU", "RBU", "LFU", "FLD"}) {
    SCOPED_TRACE(axes);
    const DMat3 m = rdf_from(axes);
    const scene::GaussianCloud before = random_cloud(50, 3, 4);
    scene::GaussianCloud after = before;
    turn(after, m);
    Rng rng(5);
    for (std::size_t i = 0; i < before.size(); ++i) {
      EXPECT_EQ(after.mean.get(i), Vec3(m * DVec3(before.mean.get(i))));
      EXPECT_EQ(after.log_scale.get(i), before.log_scale.get(i));
      const DMat3 expected = m * covariance(before, i) * glm::transpose(m);
      for (int c = 0; c < 3; ++c)
        EXPECT_LT(glm::length(covariance(after, i)[c] - expected[c]),
                  1e-5 * glm::length(expected[0] + expected[1] + expected[2]));
      const DVec3 d = glm::normalize(DVec3(rng.normal(), rng.normal(), rng.normal()));
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(colour(after.sh_row(i).subspan(16 * c, 16), m * d), colour(before.sh_row(i).subspan(16 * c, 16), d),
                    1e-6);
    }
  }
}

TEST(Axes, WhatChangesSignsAloneIsUndoneToTheBit) {
  for (const char* axes : {"RDF", "RUB", "LUF", "RUF", "LDB"}) {
    const scene::GaussianCloud before = random_cloud(50, 3, 6);
    scene::GaussianCloud there = before;
    turn(there, rdf_from(axes));
    EXPECT_EQ(there == before, std::string_view(axes) == "RDF");
    turn(there, rdf_from(axes));
    EXPECT_EQ(there, before) << axes;
  }
}

}  // namespace
}  // namespace engine::io
