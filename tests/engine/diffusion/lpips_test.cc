#include "engine/diffusion/lpips.h"

#include <ATen/Parallel.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "engine/core/finite.h"
#include "engine/core/rng.h"
#include "tests/engine/diffusion/vgg.h"

namespace engine::diffusion {
namespace {

std::map<std::string, weights::FloatTensor> even_weights() {
  std::map<std::string, weights::FloatTensor> tensors;
  int depth = 0;
  for (const int channels : {64, 128, 256, 512, 512})
    tensors.emplace("lin" + std::to_string(depth++) + ".model.1.weight",
                    weights::FloatTensor{{1, channels, 1, 1}, std::vector<float>(std::size_t(channels), 0.1f)});
  return tensors;
}

/// Made once for all tests of a process.
Lpips& lpips() {
  static const auto made =
      Lpips::create({file_of(cheap_vgg16(), "vgg16"), file_of(even_weights(), "linear")}).value().release();
  return *made;
}

scene::Image random_picture(int width, int height, std::uint64_t seed) {
  scene::Image picture(width, height, 3);
  Rng rng(seed);
  for (float& value : picture.data) value = rng.uniform();
  return picture;
}

TEST(Lpips, EqualPicturesAreAtDistanceZeroWithoutASlope) {
  const scene::Image picture = random_picture(24, 17, 1);
  scene::Image gradient;
  const auto value = lpips().evaluate(picture, picture, gradient);
  ASSERT_TRUE(value) << value.error().message;
  EXPECT_EQ(*value, 0);
  EXPECT_EQ(gradient, scene::Image(24, 17, 3));
}

TEST(Lpips, TheGradientLeadsDownhill) {
  scene::Image picture = random_picture(24, 17, 1), gradient;
  const scene::Image target = random_picture(24, 17, 2);
  const double before = lpips().evaluate(picture, target, gradient).value();
  EXPECT_GT(before, 0);
  double slope = 0;
  for (const float v : gradient.data) slope += double(v) * double(v);
  const double step = 1e-4 * before / slope;
  for (std::size_t i = 0; i < picture.data.size(); ++i) picture.data[i] -= float(step) * gradient.data[i];
  const double after = lpips().evaluate(picture, target, gradient).value();
  EXPECT_NEAR((before - after) / (1e-4 * before), 1, 0.05) << "by as much as it says";
}

TEST(Lpips, SmallPicturesAreDrawnOutAndHaveFiniteGradients) {
  for (const auto& [width, height] : {std::pair(1, 1), std::pair(3, 40), std::pair(15, 16)}) {
    scene::Image gradient;
    const auto value = lpips().evaluate(random_picture(width, height, 3), random_picture(width, height, 4), gradient);
    ASSERT_TRUE(value) << value.error().message;
    EXPECT_GT(*value, 0);
    EXPECT_EQ(gradient.width, width);
    EXPECT_FALSE(first_not_finite(gradient.data));
  }
}

/// With biases far below zero no feature is ever seen, and lengths are zero everywhere.
TEST(Lpips, WhereNoFeatureIsSeenNothingIsDividedByZero) {
  auto vgg = cheap_vgg16();
  for (float& value : vgg.at("features.0.bias").values) value = -1e3f;
  for (auto& [name, tensor] : vgg)
    if (name.ends_with(".bias") && name != "features.0.bias")
      for (float& value : tensor.values) value = -1;
  const auto blind = Lpips::create({file_of(vgg, "vgg16"), file_of(even_weights(), "linear")});
  ASSERT_TRUE(blind);
  scene::Image gradient;
  const auto value = (*blind)->evaluate(random_picture(16, 16, 5), random_picture(16, 16, 6), gradient);
  ASSERT_TRUE(value);
  EXPECT_EQ(*value, 0);
  EXPECT_EQ(gradient, scene::Image(16, 16, 3));
}

TEST(Lpips, WhatDoesNotFitIsNamed) {
  scene::Image gradient;
  EXPECT_EQ(lpips().evaluate(scene::Image(16, 16, 3), scene::Image(16, 17, 3), gradient).error().code,
            ErrorCode::invalid_argument);
  EXPECT_FALSE(lpips().evaluate(scene::Image(16, 16, 1), scene::Image(16, 16, 1), gradient));
  EXPECT_FALSE(lpips().evaluate({}, {}, gradient));
  auto linear = even_weights();
  linear.erase("lin3.model.1.weight");
  const auto vgg = file_of(cheap_vgg16(), "vgg16");
  EXPECT_EQ(Lpips::create({vgg, file_of(linear, "linear")}).error().where, "linear:lin3.model.1.weight");
  linear = even_weights();
  linear.at("lin0.model.1.weight").values[7] = std::nanf("");
  EXPECT_EQ(Lpips::create({vgg, file_of(linear, "linear")}).error().where, "linear:lin0.model.1.weight[7]");
  EXPECT_EQ(Lpips::create({file_of({}, "none"), file_of(linear, "linear")}).error().where, "none:features.0.weight");
}

TEST(Lpips, APictureThatIsNotFiniteIsNoDistance) {
  const scene::Image target = random_picture(16, 16, 1);
  for (const float poison : {std::nanf(""), std::numeric_limits<float>::infinity()}) {
    scene::Image picture = random_picture(16, 16, 2), gradient;
    picture.data[3] = poison;
    const auto value = lpips().evaluate(picture, target, gradient);
    ASSERT_FALSE(value);
    EXPECT_EQ(value.error().code, ErrorCode::internal);
    EXPECT_EQ(value.error().where, "lpips");
  }
}

TEST(Lpips, EndsBetweenTwoConvolutionsOnTheWayThereAndBack) {
  const scene::Image picture = random_picture(16, 16, 1), target = random_picture(16, 16, 2);
  scene::Image gradient;
  int asked = 0;
  lpips().ask([&]() -> Result<void> { return ++asked, Result<void>{}; });
  ASSERT_TRUE(lpips().evaluate(picture, target, gradient));
  EXPECT_EQ(asked, 3 * 13) << "the target's features, the picture's, and the way back";
  for (const int last : {1, 13, 14, 26, 27, 33, 39}) {
    int left = last;
    lpips().ask([&]() -> Result<void> {
      if (--left > 0) return {};
      EXPECT_EQ(left, 0) << "nothing is asked after it";
      return fail(ErrorCode::cancelled, "enough");
    });
    EXPECT_EQ(lpips().evaluate(picture, target, gradient).error().code, ErrorCode::cancelled) << last;
  }
  lpips().ask({});
  EXPECT_TRUE(lpips().evaluate(picture, target, gradient));
}

TEST(Lpips, ComputesWithAsManyThreadsAsItIsTold) {
  const int before = at::get_num_threads();
  const weights::LpipsFiles files{file_of(cheap_vgg16(), "vgg16"), file_of(even_weights(), "linear")};
  const auto on_two = Lpips::create(files, 2).value();
  EXPECT_EQ(on_two->identity(), files.digest());
  scene::Image gradient;
  ASSERT_TRUE(on_two->evaluate(random_picture(16, 16, 1), random_picture(16, 16, 2), gradient));
  EXPECT_EQ(at::get_num_threads(), 2);
  at::set_num_threads(before);
}

}  // namespace
}  // namespace engine::diffusion
