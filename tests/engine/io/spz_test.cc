#include "engine/io/spz.h"

#include <gtest/gtest.h>
#include <zstd.h>

#include <array>
#include <cstring>
#include <numbers>

#include "engine/io/checks.h"
#include "engine/io/gzip.h"
#include "engine/io/quantised.h"
#include "tests/engine/io/samples.h"

namespace engine::io {
namespace {

/// An .spz file in parts, to be put together as any version.
struct Parts {
  std::uint32_t magic = 0x5053474e, version = 2, count = 1;
  int sh_degree = 0, fractional_bits = 12, flags = 0;
  std::array<std::string, 6> attributes;  ///< positions, alphas, colors, scales, rotations, sh
  std::string extensions;                 ///< Version 4.
  int extra_streams = 0;                  ///< Added to the number of streams that the header gives.

  [[nodiscard]] std::string header(int last) const {
    std::string bytes;
    append(bytes, magic), append(bytes, version), append(bytes, count);
    for (const int u : {sh_degree, fractional_bits, flags, last}) append(bytes, std::uint8_t(u));
    return bytes;
  }
  [[nodiscard]] std::string unpacked() const {
    std::string bytes = header(0);
    for (const auto& attribute : attributes) bytes += attribute;
    return bytes;
  }
  [[nodiscard]] std::string v4() const {
    std::string table, streams;
    int count_of_streams = 0;
    for (const auto& attribute : attributes) {
      if (attribute.empty()) continue;
      std::string packed(ZSTD_compressBound(attribute.size()), '\0');
      packed.resize(ZSTD_compress(packed.data(), packed.size(), attribute.data(), attribute.size(), 3));
      append(table, std::uint64_t(packed.size())), append(table, std::uint64_t(attribute.size()));
      streams += packed;
      ++count_of_streams;
    }
    std::string bytes = header(count_of_streams + extra_streams);
    append(bytes, std::uint32_t(32 + extensions.size()));
    return bytes + std::string(12, '\0') + extensions + table + streams;
  }
};

std::string zipped(const std::string& bytes) {
  const auto packed = gzip(as_span(bytes));
  return {reinterpret_cast<const char*>(packed.data()), packed.size()};
}

Result<scene::GaussianCloud> decode(const std::string& bytes, const ReadOptions& options = {}) {
  return decode_spz(as_span(bytes), "a.spz", options);
}

ReadOptions as_stored() {
  ReadOptions options;
  options.spz_frame = SpzFrame::as_stored;
  return options;
}

std::string fixed24(std::initializer_list<int> values) {
  std::string bytes;
  for (const int value : values)
    for (int b = 0; b < 3; ++b) append(bytes, std::uint8_t(std::uint32_t(value) >> 8 * b));
  return bytes;
}

/// One Gaussian; SH byte j is j.
Parts one_gaussian(std::uint32_t version, int degree) {
  Parts parts;
  parts.version = version;
  parts.sh_degree = degree;
  parts.attributes[0] = version == 1 ? std::string("\x00\x3c\x00\xc1\x01\x00", 6) : fixed24({4096, -8192, 0x7fffff});
  parts.attributes[1] = std::string(1, char(51));
  parts.attributes[2] = std::string("\x00\xff\x80", 3);
  parts.attributes[3] = std::string("\x00\xa0\xff", 3);
  if (version <= 2) {
    parts.attributes[4] = std::string("\xff\x80\x80", 3);
  } else {  // the largest is w (3); y is negative, of magnitude 511
    append(parts.attributes[4], std::uint32_t(3u << 30 | 0u << 20 | (512u | 511u) << 10 | 0u));
  }
  const int sh_bytes = 3 * ((degree + 1) * (degree + 1) - 1);
  for (int j = 0; j < sh_bytes; ++j) parts.attributes[5] += char(j);
  return parts;
}

TEST(Spz, DecodesEveryVersion) {
  for (std::uint32_t version = 1; version <= 4; ++version) {
    SCOPED_TRACE(version);
    const Parts parts = one_gaussian(version, 2);
    const auto cloud = decode(version == 4 ? parts.v4() : zipped(parts.unpacked()), as_stored());
    ASSERT_TRUE(cloud) << cloud.error().message;
    ASSERT_EQ(cloud->size(), 1u);
    if (version == 1) {
      EXPECT_EQ(cloud->mean.get(0), Vec3(1.0f, -2.5f, std::ldexp(1.0f, -24)));  // the last is the smallest half
    } else {
      EXPECT_EQ(cloud->mean.get(0), Vec3(1.0f, -2.0f, 8388607.0f / 4096.0f));
    }
    EXPECT_FLOAT_EQ(cloud->opacity_logit[0], std::log(0.25f));
    EXPECT_FLOAT_EQ(cloud->sh_row(0)[0], -0.5f / 0.15f);
    EXPECT_FLOAT_EQ(cloud->sh_row(0)[9], 0.5f / 0.15f);
    EXPECT_EQ(cloud->log_scale.get(0), Vec3(-10.0f, 0.0f, 5.9375f));
    if (version <= 2) {
      EXPECT_LT(angle_between(cloud->rotation.get(0), {0, 1, 0, 0}), 0.02);
    } else {
      EXPECT_LT(angle_between(cloud->rotation.get(0), {1, 0, -1, 0}), 1e-6);
    }
    for (std::size_t k = 1; k < 9; ++k)
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_EQ(cloud->sh_row(0)[c * 9 + k], (float(3 * (k - 1) + c) - 128.0f) / 128.0f);
  }
}

/// Colour of one channel seen along d. Source: formats of trained scenes (Kerbl et al. 2023), real SH to degree 3.
double colour(const float* sh, DVec3 d) {
  const double x = d.x, y = d.y, z = d.z;
  const std::array<double, 16> basis = {0.28209479177387814,
                                        -0.4886025119029199 * y,
                                        0.4886025119029199 * z,
                                        -0.4886025119029199 * x,
                                        1.0925484305920792 * x * y,
                                        -1.0925484305920792 * y * z,
                                        0.31539156525252005 * (2 * z * z - x * x - y * y),
                                        -1.0925484305920792 * x * z,
                                        0.5462742152960396 * (x * x - y * y),
                                        -0.5900435899266435 * y * (3 * x * x - y * y),
                                        2.890611442640554 * x * y * z,
                                        -0.4570457994644658 * y * (4 * z * z - x * x - y * y),
                                        0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y),
                                        -0.4570457994644658 * x * (4 * z * z - x * x - y * y),
                                        1.445305721320277 * z * (x * x - y * y),
                                        -0.5900435899266435 * x * (x * x - 3 * y * y)};
  double sum = 0;
  for (std::size_t k = 0; k < 16; ++k) sum += sh[k] * basis[k];
  return sum;
}

TEST(Spz, CountsWhatItUnpacksToBeforeItDoes) {
  Parts parts;
  parts.count = 1'000'000;
  parts.attributes = {std::string(9'000'000, '\0'), std::string(1'000'000, '\0'), std::string(3'000'000, '\0'),
                      std::string(3'000'000, '\0'), std::string(3'000'000, '\0'), ""};
  const std::string unpacked = parts.unpacked();
  const auto bytes = gzip(std::as_bytes(std::span(unpacked)));
  EXPECT_LT(bytes.size(), std::size_t{50'000});
  const auto start = std::span(bytes).first(4096);
  EXPECT_EQ(expected_spz_bytes(start, bytes.size()), 1'000'000 * cloud_row_bytes(0));
  EXPECT_EQ(expected_spz_bytes(start, 1'000), 1'000u) << "no 1,000 bytes unpack to that";
  EXPECT_EQ(expected_spz_bytes(start.first(8), bytes.size()), bytes.size());
  MemoryBudget little(10 << 20), enough(20 << 20);
  ReadOptions reading;
  reading.memory = &little;
  const auto refused = decode_spz(bytes, "a.spz", reading);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::too_large);
  EXPECT_EQ(refused.error().where, "a.spz");
  reading.memory = &enough;
  EXPECT_TRUE(decode_spz(bytes, "a.spz", reading));
  EXPECT_EQ(enough.lent(), 0u);
}

TEST(Spz, TheTwoFramesShowTheSameSceneTurned) {
  const auto bytes = encode_spz(random_cloud(20, 3, 5), "a.spz");
  ASSERT_TRUE(bytes);
  const auto rdf = decode_spz(*bytes, "a.spz", {}), rub = decode_spz(*bytes, "a.spz", as_stored());
  ASSERT_TRUE(rdf && rub);
  const auto turn = [](DVec3 v) { return DVec3(v.x, -v.y, -v.z); };
  Rng rng(6);
  for (std::size_t i = 0; i < 20; ++i) {
    EXPECT_EQ(DVec3(rdf->mean.get(i)), turn(DVec3(rub->mean.get(i))));
    const DVec3 d = glm::normalize(DVec3(rng.normal(), rng.normal(), rng.normal()));
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(colour(&rdf->sh_row(i)[c * 16], d), colour(&rub->sh_row(i)[c * 16], turn(d)), 1e-12);
    // A local axis, turned to the world and then to the other frame, is where the other quaternion puts it turned.
    const DQuat q = glm::normalize(DQuat(rdf->rotation.get(i))), p = glm::normalize(DQuat(rub->rotation.get(i)));
    EXPECT_LT(glm::length(q * d - turn(p * turn(d))), 1e-12);
  }
}

TEST(Spz, ComesBackWithinItsRounding) {
  for (int degree = 0; degree <= 3; ++degree) {
    const scene::GaussianCloud cloud = random_cloud(500, degree, 8);
    const auto bytes = encode_spz(cloud, "a.spz");
    ASSERT_TRUE(bytes);
    const auto back = decode_spz(*bytes, "a.spz", {});
    ASSERT_TRUE(back) << back.error().message;
    ASSERT_EQ(back->sh_degree, degree);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Vec3 mean_error = back->mean.get(i) - cloud.mean.get(i);
      const Vec3 scale_error = back->log_scale.get(i) - cloud.log_scale.get(i);
      for (int c = 0; c < 3; ++c) {
        EXPECT_LE(std::abs(mean_error[c]), 0.5001f / 4096);
        EXPECT_LE(std::abs(scale_error[c]), 0.5001f / 16);
      }
      EXPECT_LT(angle_between(back->rotation.get(i), cloud.rotation.get(i)), 0.004) << i;
      EXPECT_EQ(byte_of_logit(back->opacity_logit[i]), byte_of_logit(cloud.opacity_logit[i]));
      for (std::size_t j = 0; j < cloud.sh_stride(); ++j) {
        const bool dc = j % scene::sh_coefficients(degree) == 0;
        EXPECT_NEAR(back->sh_row(i)[j], cloud.sh_row(i)[j], dc ? 0.0131f : 1.001f / 128) << j;
      }
    }
    EXPECT_EQ(encode_spz(*back, "a.spz").value(), *bytes) << "a second pass must lose nothing more";
  }
}

TEST(Spz, EveryRotationComesBackWhateverItsSignAndLength) {
  scene::GaussianCloud cloud = random_cloud(1000, 0, 11);
  cloud.rotation.set(0, {0, 0, 0, 0});
  cloud.rotation.set(1, {-1e30f, 1e30f, 1e30f, -1e30f});
  cloud.rotation.set(2, {0, 0, 0, -1e-30f});
  const auto back = decode_spz(encode_spz(cloud, "a.spz").value(), "a.spz", {});
  ASSERT_TRUE(back);
  EXPECT_LT(angle_between(back->rotation.get(0), {1, 0, 0, 0}), 1e-6);
  EXPECT_LT(angle_between(back->rotation.get(1), {-1, 1, 1, -1}), 0.004);
  EXPECT_LT(angle_between(back->rotation.get(2), {0, 0, 0, 1}), 1e-6);
  for (std::size_t i = 3; i < 1000; ++i)
    EXPECT_LT(angle_between(back->rotation.get(i), cloud.rotation.get(i)), 0.004) << i;
}

TEST(Spz, SpendsFewerFractionalBitsOnAWideScene) {
  scene::GaussianCloud cloud = random_cloud(2, 0, 1);
  cloud.mean.set(1, {30000.0f, 0.25f, -8.0f});
  const auto back = decode_spz(encode_spz(cloud, "a.spz").value(), "a.spz", {});
  ASSERT_TRUE(back);
  EXPECT_EQ(back->mean.get(1), cloud.mean.get(1));
  cloud.mean.x[1] = 9e6f;
  const auto refused = encode_spz(cloud, "a.spz");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::unprocessable);
}

TEST(Spz, SkipsTheExtensionsOfVersion4AndRefusesOlderOnes) {
  Parts parts = one_gaussian(4, 0);
  parts.flags = 2;
  parts.extensions = "hints for a viewer";
  EXPECT_TRUE(decode(parts.v4()));
  parts.version = 3;
  const auto old = decode(zipped(parts.unpacked()));
  ASSERT_FALSE(old);
  EXPECT_EQ(old.error().code, ErrorCode::unsupported);
}

TEST(Spz, NamesWhatIsWrong) {
  const Parts good = one_gaussian(2, 1);
  ASSERT_TRUE(decode(zipped(good.unpacked())));
  const auto code_of = [](const std::string& bytes, const ReadOptions& options = {}) {
    const auto cloud = decode(bytes, options);
    EXPECT_FALSE(cloud);
    return cloud ? ErrorCode::internal : cloud.error().code;
  };
  const auto changed = [&](auto change) {
    Parts parts = good;
    change(parts);
    return zipped(parts.unpacked());
  };
  using enum ErrorCode;
  EXPECT_EQ(code_of(changed([](Parts& p) { p.magic = 1; })), unsupported);
  EXPECT_EQ(code_of(changed([](Parts& p) { p.version = 5; })), unsupported);
  EXPECT_EQ(code_of(changed([](Parts& p) { p.version = 4; })), unsupported);  // not in gzip
  EXPECT_EQ(code_of(changed([](Parts& p) { p.sh_degree = 4; })), unsupported);
  EXPECT_EQ(code_of(changed([](Parts& p) { p.fractional_bits = 200; })), corrupt_data);
  EXPECT_EQ(code_of(changed([](Parts& p) { p.count = 0; })), unprocessable);
  EXPECT_EQ(code_of(changed([](Parts& p) { p.count = 2; })), corrupt_data);
  EXPECT_EQ(code_of(changed([](Parts& p) { p.count = 40'000'000; })), corrupt_data);  // refused before it allocates
  EXPECT_EQ(code_of(changed([](Parts& p) { p.count = 0xffffffff; })), too_large);
  EXPECT_EQ(code_of(changed([](Parts& p) { p.attributes[5].pop_back(); })), corrupt_data);
  EXPECT_EQ(code_of(changed([](Parts& p) { p.attributes[5] += 'x'; })), corrupt_data);
  EXPECT_EQ(code_of(zipped(good.unpacked()) + "x"), corrupt_data);
  EXPECT_EQ(code_of(zipped("short")), corrupt_data);
  ReadOptions little;
  little.max_memory_bytes = 100;
  EXPECT_EQ(code_of(zipped(good.unpacked()), little), too_large);
}

TEST(Spz, AHalfFloatThatIsInfiniteIsNamed) {
  Parts parts = one_gaussian(1, 0);
  parts.attributes[0] = std::string("\x00\x3c\x00\x7c\x00\x3c", 6);
  const auto cloud = decode(zipped(parts.unpacked()));
  ASSERT_FALSE(cloud);
  EXPECT_EQ(cloud.error().where, "a.spz:vertex[0].y");
}

TEST(Spz, Version4BelievesNeitherItsTableNorItsFrames) {
  const Parts good = one_gaussian(4, 1);
  ASSERT_TRUE(decode(good.v4()));
  const auto refused = [](const std::string& bytes) {
    const auto cloud = decode(bytes);
    return !cloud && cloud.error().code == ErrorCode::corrupt_data;
  };
  const auto with_u64 = [&](std::size_t at, std::uint64_t value) {
    std::string bytes = good.v4();
    std::memcpy(bytes.data() + at, &value, sizeof value);
    return bytes;
  };
  EXPECT_TRUE(refused(with_u64(32, ~std::uint64_t{0})));  // compressed size of the positions
  EXPECT_TRUE(refused(with_u64(40, ~std::uint64_t{0})));  // their uncompressed size
  EXPECT_TRUE(refused(with_u64(32 + 5 * 16, 1)));         // the last stream then ends early
  EXPECT_TRUE(refused(good.v4() + "x"));
  Parts parts = good;
  parts.extra_streams = 1;
  EXPECT_TRUE(refused(parts.v4()));
  parts = good;
  parts.attributes[1] += 'x';
  EXPECT_TRUE(refused(parts.v4()));
  std::string far_table = good.v4();
  far_table[17] = char(0x7f);  // tocByteOffset
  EXPECT_TRUE(refused(far_table));
}

}  // namespace
}  // namespace engine::io
