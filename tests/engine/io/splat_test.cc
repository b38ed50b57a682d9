#include "engine/io/splat.h"

#include <gtest/gtest.h>

#include <limits>

#include "engine/io/quantised.h"
#include "tests/engine/io/samples.h"

namespace engine::io {
namespace {

std::string record(Vec3 position, Vec3 sigma, std::initializer_list<int> rgba, std::initializer_list<int> rotation) {
  std::string bytes;
  for (int c = 0; c < 3; ++c) append(bytes, position[c]);
  for (int c = 0; c < 3; ++c) append(bytes, sigma[c]);
  for (const int u : rgba) append(bytes, std::uint8_t(u));
  for (const int u : rotation) append(bytes, std::uint8_t(u));
  return bytes;
}

TEST(LogitOfByte, IsFiniteAtTheEndsAndComesBackAsTheSameByte) {
  EXPECT_NEAR(logit_of_byte(0), -6.926f, 1e-3f);
  EXPECT_NEAR(logit_of_byte(255), 6.926f, 1e-3f);
  EXPECT_NEAR(logit_of_byte(51), std::log(0.25f), 1e-6f);  // 0.2 / 0.8
  for (int u = 0; u < 256; ++u) EXPECT_EQ(byte_of_logit(logit_of_byte(std::uint8_t(u))), u);
  EXPECT_EQ(byte_of_logit(1e30f), 255);
  EXPECT_EQ(byte_of_logit(-1e30f), 0);
}

TEST(Splat, DecodesARecord) {
  const std::string bytes = record({1, -2, 3}, {1.0f, 0.5f, 0.0f}, {255, 0, 128, 255}, {128, 128, 192, 64});
  const auto cloud = decode_splat(as_span(bytes), "a.splat", {});
  ASSERT_TRUE(cloud) << cloud.error().message;
  ASSERT_EQ(cloud->size(), 1u);
  EXPECT_EQ(cloud->mean.get(0), Vec3(1, -2, 3));
  EXPECT_FLOAT_EQ(cloud->log_scale.x[0], 0.0f);
  EXPECT_FLOAT_EQ(cloud->log_scale.y[0], std::log(0.5f));
  EXPECT_EQ(cloud->log_scale.z[0], -20.0f);  // sigma 0, where the engine saturates
  EXPECT_FLOAT_EQ(cloud->sh_row(0)[0], float(0.5 / sh_c0));
  EXPECT_FLOAT_EQ(cloud->sh_row(0)[1], float(-0.5 / sh_c0));
  EXPECT_EQ(cloud->opacity_logit[0], logit_of_byte(255));
  EXPECT_LT(angle_between(cloud->rotation.get(0), {0, 0, 1, -1}), 1e-6);
}

TEST(Splat, ARotationOfNothingIsTheIdentityBothWays) {
  const std::string bytes = record({0, 0, 0}, {1, 1, 1}, {0, 0, 0, 9}, {128, 128, 128, 128});
  auto cloud = decode_splat(as_span(bytes), "a.splat", {});
  ASSERT_TRUE(cloud);
  EXPECT_EQ(cloud->rotation.get(0), Quat(1, 0, 0, 0));
  cloud->rotation.set(0, {0, 0, 0, 0});
  EXPECT_EQ(std::to_integer<int>(encode_splat(*cloud)[28]), 255);
  EXPECT_EQ(std::to_integer<int>(encode_splat(*cloud)[29]), 128);
}

TEST(Splat, ComesBackWithinItsRounding) {
  for (int degree = 0; degree <= 3; ++degree) {
    const scene::GaussianCloud cloud = random_cloud(500, degree, 8);
    const auto back = decode_splat(encode_splat(cloud), "a.splat", {});
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back->mean, cloud.mean);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      EXPECT_NEAR(back->log_scale.y[i], cloud.log_scale.y[i], 1e-5f);
      EXPECT_LT(angle_between(back->rotation.get(i), cloud.rotation.get(i)), 0.02) << i;
      EXPECT_EQ(byte_of_logit(back->opacity_logit[i]), byte_of_logit(cloud.opacity_logit[i]));
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(back->sh_row(i)[c], cloud.sh_row(i)[c * scene::sh_coefficients(degree)], 0.0071f) << i;
    }
  }
}

TEST(Splat, SaturatesScalesThatAFloatCannotHold) {
  scene::GaussianCloud cloud = random_cloud(1, 0, 1);
  cloud.log_scale.set(0, {500.0f, -500.0f, 0.0f});
  const auto back = decode_splat(encode_splat(cloud), "a.splat", {});
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_FLOAT_EQ(back->log_scale.x[0], 20.0f);
  EXPECT_FLOAT_EQ(back->log_scale.y[0], -20.0f);
}

TEST(Splat, NamesWhatIsWrong) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  const std::string good = record({0, 0, 0}, {1, 1, 1}, {1, 2, 3, 4}, {255, 128, 128, 128});
  const auto error_of = [](const std::string& bytes) {
    const auto cloud = decode_splat(as_span(bytes), "a.splat", {});
    EXPECT_FALSE(cloud);
    return cloud ? Error{} : cloud.error();
  };
  EXPECT_EQ(error_of(good + "x").code, ErrorCode::corrupt_data);
  EXPECT_EQ(error_of("").code, ErrorCode::unprocessable);
  EXPECT_EQ(error_of(good + record({0, nan, 0}, {1, 1, 1}, {1, 2, 3, 4}, {255, 128, 128, 128})).where,
            "a.splat:vertex[1].y");
  EXPECT_EQ(error_of(good + record({0, 0, 0}, {1, 1, -1}, {1, 2, 3, 4}, {255, 128, 128, 128})).where,
            "a.splat:vertex[1].scale_2");
  EXPECT_EQ(error_of(good + record({0, 0, 0}, {nan, 1, 1}, {1, 2, 3, 4}, {255, 128, 128, 128})).where,
            "a.splat:vertex[1].scale_0");
  ReadOptions options;
  options.max_gaussians = 1;
  const auto too_many = decode_splat(as_span(good + good), "a.splat", options);
  ASSERT_FALSE(too_many);
  EXPECT_EQ(too_many.error().code, ErrorCode::too_large);
}

TEST(LooksLikeSplat, TellsRecordsFromTextAndNoise) {
  const auto records = encode_splat(random_cloud(40, 0, 3));
  EXPECT_TRUE(looks_like_splat(records, records.size()));
  EXPECT_FALSE(looks_like_splat(records, records.size() + 1));
  EXPECT_FALSE(looks_like_splat({}, 0));
  std::string text;
  while (text.size() < 640) text += "The quick brown fox jumps over the lazy dog. ";
  text.resize(640);
  EXPECT_FALSE(looks_like_splat(as_span(text), text.size()));
  Rng rng(4);
  std::string noise;
  for (int i = 0; i < 160; ++i) append(noise, rng.next());
  EXPECT_FALSE(looks_like_splat(as_span(noise), noise.size()));
}

}  // namespace
}  // namespace engine::io
