#include "engine/io/compressed_ply.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "engine/io/quantised.h"
#include "engine/io/scene_file.h"
#include "tests/engine/io/compressed_sample.h"
#include "tests/support/data.h"

namespace engine::io {
namespace {

class CompressedPly : public ::testing::Test {
 protected:
  Result<SceneFile> read(const std::string& bytes) {
    const auto path = folder_.path() / "chair.ply";
    support::write_file(path, bytes);
    return read_scene(path);
  }
  Error error_of(const std::string& bytes) {
    const auto scene = read(bytes);
    EXPECT_FALSE(scene);
    return scene ? Error{} : scene.error();
  }
  support::TempDir folder_;
};

TEST_F(CompressedPly, DecodesTheEndsAndTheMiddleOfEachRange) {
  CompressedSample sample;
  sample.ranges = {{-1, -2, -3, 1, 2, 3, -8, -7, -6, 0, 1, 2, 0.0f, 0.25f, 0.5f, 1.0f, 0.75f, 1.5f}};
  sample.rows = {{0, 0, 0, 0}, {0xffffffff, 1u << 30 | 1023u << 20 | 511u << 10 | 512u, 0xffffffff, 0xffffffff}};
  const auto scene = read(sample.bytes());
  ASSERT_TRUE(scene) << scene.error().message;
  const auto& cloud = scene->cloud;
  ASSERT_EQ(cloud.size(), 2u);
  EXPECT_EQ(cloud.mean.get(0), Vec3(-1, -2, -3));
  EXPECT_EQ(cloud.mean.get(1), Vec3(1, 2, 3));
  EXPECT_EQ(cloud.log_scale.get(0), Vec3(-8, -7, -6));
  EXPECT_EQ(cloud.log_scale.get(1), Vec3(0, 1, 2));
  EXPECT_FLOAT_EQ(cloud.sh_row(0)[0], float(-0.5 / sh_c0));
  EXPECT_FLOAT_EQ(cloud.sh_row(0)[2], 0.0f);
  EXPECT_FLOAT_EQ(cloud.sh_row(1)[1], float(0.25 / sh_c0));
  EXPECT_EQ(cloud.opacity_logit[0], logit_of_byte(0));
  EXPECT_EQ(cloud.opacity_logit[1], logit_of_byte(255));
  // x is left out (index 1), w is 1023 -> sqrt(1/2), y and z are next to 0: a quarter turn about x.
  EXPECT_LT(angle_between(cloud.rotation.get(1), {1, 1, 0, 0}), 0.003);
  // The layout it gets is INRIA's, so it can be written as one.
  EXPECT_EQ(scene->layout.columns.size(), 17u);
}

TEST_F(CompressedPly, TheFieldsOfAWordAre11And10And11Bits) {
  CompressedSample sample;
  sample.ranges = {{0, 0, 0, 2047, 1023, 2047, 0, 0, 0, 2047, 1023, 2047, 0, 0, 0, 255, 255, 255}};
  sample.rows = {{1234u << 21 | 567u << 11 | 89u, 0, 11u << 21 | 22u << 11 | 33u, 1u << 24 | 2u << 16 | 3u << 8 | 51u}};
  const auto scene = read(sample.bytes());
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_EQ(scene->cloud.mean.get(0), Vec3(1234, 567, 89));
  EXPECT_EQ(scene->cloud.log_scale.get(0), Vec3(11, 22, 33));
  for (std::size_t c = 0; c < 3; ++c) EXPECT_FLOAT_EQ(scene->cloud.sh_row(0)[c], float((double(c) + 0.5) / sh_c0));
  EXPECT_FLOAT_EQ(scene->cloud.opacity_logit[0], std::log(0.25f));
}

TEST_F(CompressedPly, TheOlderVariantWithoutColourRangesGoesFromZeroToOne) {
  CompressedSample sample = CompressedSample::random(3, 0);
  sample.colour_ranges = false;
  sample.rows[0][3] = 0xff00ff80;
  const auto scene = read(sample.bytes());
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_FLOAT_EQ(scene->cloud.sh_row(0)[0], float(0.5 / sh_c0));
  EXPECT_FLOAT_EQ(scene->cloud.sh_row(0)[1], float(-0.5 / sh_c0));
}

TEST_F(CompressedPly, EachVertexUsesTheRangeOfItsChunk) {
  CompressedSample sample = CompressedSample::random(600, 0);
  ASSERT_EQ(sample.ranges.size(), 3u);
  for (std::size_t i : {0, 255, 256, 511, 512, 599}) sample.rows[i][0] = 0;
  const auto scene = read(sample.bytes());
  ASSERT_TRUE(scene) << scene.error().message;
  for (std::size_t i : {0, 255, 256, 511, 512, 599}) EXPECT_EQ(scene->cloud.mean.x[i], sample.ranges[i / 256][0]) << i;
}

TEST_F(CompressedPly, ReadsTheShElementOfEveryDegree) {
  for (int degree = 1; degree <= 3; ++degree) {
    CompressedSample sample = CompressedSample::random(2, degree);
    const std::size_t coefficients = scene::sh_coefficients(degree);
    for (std::size_t j = 0; j < sample.sh[1].size(); ++j) sample.sh[1][j] = std::uint8_t(j + 1);
    sample.sh[0][0] = 0, sample.sh[0][1] = 255, sample.sh[0][2] = 128;
    const auto scene = read(sample.bytes());
    ASSERT_TRUE(scene) << scene.error().message;
    ASSERT_EQ(scene->cloud.sh_degree, degree);
    EXPECT_EQ(scene->cloud.sh_row(0)[1], -4.0f);
    EXPECT_EQ(scene->cloud.sh_row(0)[2], 4.0f);
    EXPECT_EQ(scene->cloud.sh_row(0)[3], 1.0f / 64);  // the writer puts 0 to 1/32 there
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t k = 1; k < coefficients; ++k)
        EXPECT_FLOAT_EQ(scene->cloud.sh_row(1)[c * coefficients + k],
                        ((float(c * (coefficients - 1) + k) + 0.5f) / 256 - 0.5f) * 8);
  }
}

TEST_F(CompressedPly, NamesWhatIsWrong) {
  const CompressedSample good = CompressedSample::random(300, 1);
  ASSERT_TRUE(read(good.bytes()));
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string bytes = good.bytes();
    return bytes.replace(bytes.find(from), from.size(), to);
  };
  EXPECT_NE(error_of(replaced("min_scale_y", "min_scale_w")).message.find("'min_scale_y'"), std::string::npos);
  EXPECT_NE(error_of(replaced("max_g", "max_q")).message.find("'max_g'"), std::string::npos);
  EXPECT_NE(error_of(replaced("uint packed_color", "float packed_color")).message.find("of type uint"),
            std::string::npos);
  EXPECT_NE(error_of(replaced("uchar f_rest_4", "char f_rest_4")).message.find("of type uchar"), std::string::npos);
  EXPECT_NE(error_of(replaced("property uchar f_rest_8\n", "")).message.find("has 8 properties"), std::string::npos);
  CompressedSample sample = good;
  sample.ranges.pop_back();
  EXPECT_NE(error_of(sample.bytes()).message.find("300 Gaussians take 2 chunks of 256; found 1"), std::string::npos);
  sample = good;
  sample.sh.pop_back();
  EXPECT_NE(error_of(sample.bytes()).message.find("299 rows of SH"), std::string::npos);
  sample = good;
  sample.ranges[1][7] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(error_of(sample.bytes()).where, "chair.ply:chunk[1].min_scale_y");
  sample = good;
  sample.ranges[1][0] = -3e38f, sample.ranges[1][3] = 3e38f;  // wide, but every value in between is a float
  EXPECT_TRUE(read(sample.bytes()));
  EXPECT_EQ(error_of(replaced("vertex 300", "vertex 9223372036854775808")).code, ErrorCode::too_large);
  EXPECT_EQ(error_of(good.bytes() + "x").code, ErrorCode::corrupt_data);
}

}  // namespace
}  // namespace engine::io
