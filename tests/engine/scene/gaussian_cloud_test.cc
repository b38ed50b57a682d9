#include "engine/scene/gaussian_cloud.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "tests/engine/scene/random_cloud.h"

namespace engine::scene {
namespace {

TEST(AppendRows, CopiesEverythingAlsoFromTheCloudItself) {
  GaussianCloud cloud = random_cloud(5, 2, 1, 3);
  const GaussianCloud before = cloud;
  append_rows(cloud, cloud, std::vector<std::uint32_t>{4, 1});
  ASSERT_EQ(cloud.size(), 7u);
  EXPECT_EQ(select(cloud, std::vector<std::uint8_t>{1, 1, 1, 1, 1, 0, 0}), before);
  EXPECT_EQ(select(cloud, std::vector<std::uint8_t>{0, 0, 0, 0, 0, 1, 1}).mean.get(0), before.mean.get(4));
  EXPECT_EQ(std::memcmp(cloud.sh_row(6).data(), before.sh_row(1).data(), before.sh_stride() * sizeof(float)), 0);
  EXPECT_EQ(std::memcmp(cloud.extra_row(5).data(), before.extra_row(4).data(), 3), 0);
}

TEST(DropEmptyShBands, KeepsABandWithOneNegativeZero) {
  GaussianCloud cloud = random_cloud(4, 3, 1);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t k = 4; k < 16; ++k) cloud.sh_row(i)[c * 16 + k] = 0.0f;
  cloud.sh_row(2)[16 + 7] = -0.0f;  // degree 2, green
  GaussianCloud dropped = cloud;
  drop_empty_sh_bands(dropped);
  EXPECT_EQ(dropped.sh_degree, 2);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t k = 0; k < 9; ++k) EXPECT_EQ(dropped.sh_row(i)[c * 9 + k], cloud.sh_row(i)[c * 16 + k]);
  cloud.sh_row(2)[16 + 7] = 0.0f;
  drop_empty_sh_bands(cloud);
  EXPECT_EQ(cloud.sh_degree, 1);
}

TEST(FirstNotFinite, NamesRowAndProperty) {
  GaussianCloud cloud = random_cloud(9, 3, 1);
  EXPECT_FALSE(first_not_finite(cloud));
  cloud.sh_row(7)[2 * 16 + 5] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(first_not_finite(cloud), "[7].f_rest_34");
  cloud.opacity_logit[3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(first_not_finite(cloud), "[3].opacity");
}

}  // namespace
}  // namespace engine::scene
