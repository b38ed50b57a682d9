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
  std::string extensions;                 ///< Before the table of contents in version 4, else at the end.
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
    return bytes + extensions;
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
  auto scene = decode_spz(as_span(bytes), "a.spz", options);
  if (!scene) return propagate(scene);
  return std::move(scene->cloud);
}

ReadOptions as_stored() {
  ReadOptions options;
  options.spz_frame = SpzFrame::as_stored;
  return options;
}

/// The cloud of a file that is sound, in the frame that options ask for.
scene::GaussianCloud cloud_of(std::span<const std::byte> bytes, const ReadOptions& options = {}) {
  auto scene = decode_spz(bytes, "a.spz", options);
  EXPECT_TRUE(scene) << scene.error().message;
  return scene ? std::move(scene->cloud) : scene::GaussianCloud{};
}

/// An extension record.
std::string record(std::uint32_t type, const std::string& payload) {
  std::string bytes;
  append(bytes, type), append(bytes, std::uint32_t(payload.size()));
  return bytes + payload;
}

std::string declares_axes(std::uint32_t number) {
  std::string payload;
  append(payload, number);
  return record(0xADBE0003, payload);
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
  const auto zeros = [&](std::size_t bytes_per_row) { return std::string(bytes_per_row * parts.count, '\0'); };
  parts.attributes = {zeros(9), zeros(1), zeros(3), zeros(3), zeros(3), ""};
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
  const scene::GaussianCloud turned = cloud_of(*bytes), stored = cloud_of(*bytes, as_stored());
  const auto* const rdf = &turned;
  const auto* const rub = &stored;
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
    const int version = 3 + degree % 2;
    const auto bytes = encode_spz(cloud, "a.spz", {.version = version});
    ASSERT_TRUE(bytes);
    const scene::GaussianCloud there = cloud_of(*bytes);
    const auto* const back = &there;
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
    EXPECT_EQ(encode_spz(*back, "a.spz", {.version = version}).value(), *bytes)
        << "a second pass must lose nothing more";
  }
}

TEST(Spz, EveryRotationComesBackWhateverItsSignAndLength) {
  scene::GaussianCloud cloud = random_cloud(1000, 0, 11);
  cloud.rotation.set(0, {0, 0, 0, 0});
  cloud.rotation.set(1, {-1e30f, 1e30f, 1e30f, -1e30f});
  cloud.rotation.set(2, {0, 0, 0, -1e-30f});
  const scene::GaussianCloud there = cloud_of(encode_spz(cloud, "a.spz").value());
  const auto* const back = &there;
  EXPECT_LT(angle_between(back->rotation.get(0), {1, 0, 0, 0}), 1e-6);
  EXPECT_LT(angle_between(back->rotation.get(1), {-1, 1, 1, -1}), 0.004);
  EXPECT_LT(angle_between(back->rotation.get(2), {0, 0, 0, 1}), 1e-6);
  for (std::size_t i = 3; i < 1000; ++i)
    EXPECT_LT(angle_between(back->rotation.get(i), cloud.rotation.get(i)), 0.004) << i;
}

TEST(Spz, SpendsFewerFractionalBitsOnAWideScene) {
  scene::GaussianCloud cloud = random_cloud(2, 0, 1);
  cloud.mean.set(1, {30000.0f, 0.25f, -8.0f});
  const scene::GaussianCloud there = cloud_of(encode_spz(cloud, "a.spz").value());
  const auto* const back = &there;
  EXPECT_EQ(back->mean.get(1), cloud.mean.get(1));
  cloud.mean.x[1] = 9e6f;
  const auto refused = encode_spz(cloud, "a.spz");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::unprocessable);
}

// Found by tests/fuzz: -2^23 steps were read and could not be written.
TEST(Spz, WritesTheFarthestThatItReads) {
  for (const std::uint32_t axes : {4u, 6u, 12u}) {
    Parts parts = one_gaussian(3, 0);
    parts.fractional_bits = 0, parts.flags = 2;
    parts.extensions = declares_axes(axes);
    parts.attributes[0] = fixed24({-8388608, 8388607, -8388608});
    const std::string packed = zipped(parts.unpacked());
    const auto scene = decode_spz(as_span(packed), "a.spz", {});
    ASSERT_TRUE(scene);
    for (const char* written : {"RUB", "RDF", "RFU"}) {
      const auto bytes = encode_spz(scene->cloud, "a.spz", {.axes = written});
      ASSERT_TRUE(bytes) << bytes.error().message;
      const scene::GaussianCloud back = cloud_of(*bytes);
      for (int c = 0; c < 3; ++c) EXPECT_LE(std::abs(back.mean.get(0)[c] - scene->cloud.mean.get(0)[c]), 1.0f);
    }
  }
}

TEST(Spz, KeepsUnknownExtensionsOfEveryVersion) {
  for (std::uint32_t version = 1; version <= 4; ++version) {
    SCOPED_TRACE(version);
    Parts parts = one_gaussian(version, 1);
    parts.flags = 2;
    parts.extensions = record(0x12340001, "hints for a viewer") + record(0xADBE0002, std::string(12, 'x'));
    const std::string bytes = version == 4 ? parts.v4() : zipped(parts.unpacked());
    const auto scene = decode_spz(as_span(bytes), "a.spz", {});
    ASSERT_TRUE(scene) << scene.error().message;
    ASSERT_EQ(scene->origin.spz_extensions.size(), 2u);
    EXPECT_EQ(scene->origin.spz_extensions[0].type, 0x12340001u);
    EXPECT_EQ(scene->origin.spz_extensions[0].payload.size(), 18u);
    EXPECT_EQ(scene->origin.axes, "RUB");
    EXPECT_FALSE(scene->origin.axes_declared);
    for (const int written : {3, 4}) {
      const auto again =
          encode_spz(scene->cloud, "a.spz", {.version = written, .extensions = scene->origin.spz_extensions});
      ASSERT_TRUE(again);
      const auto back = decode_spz(*again, "a.spz", {});
      ASSERT_TRUE(back) << back.error().message;
      EXPECT_EQ(back->origin.spz_extensions, scene->origin.spz_extensions);
    }
  }
}

TEST(Spz, ComesFromTheAxesThatItDeclares) {
  // In all 16 frames, one point one unit to the right, two down and three to the front.
  const std::vector<std::pair<std::uint32_t, std::array<int, 3>>> stored{
      {0, {1, -2, -3}}, {1, {-1, 2, -3}},  {2, {1, 2, -3}},  {3, {-1, -2, -3}},  {4, {1, -2, -3}}, {5, {-1, 2, 3}},
      {6, {1, 2, 3}},   {7, {-1, -2, 3}},  {8, {1, -2, 3}},  {9, {-1, 3, 2}},    {10, {1, 3, 2}},  {11, {-1, 3, -2}},
      {12, {1, 3, -2}}, {13, {-1, -3, 2}}, {14, {1, -3, 2}}, {15, {-1, -3, -2}}, {16, {1, -3, -2}}};
  for (const std::uint32_t version : {2u, 3u, 4u})
    for (const auto& [number, at] : stored) {
      SCOPED_TRACE(number);
      Parts parts = one_gaussian(version, 1);
      parts.flags = 2;
      parts.extensions = declares_axes(number);
      parts.attributes[0] = fixed24({4096 * at[0], 4096 * at[1], 4096 * at[2]});
      const std::string bytes = version == 4 ? parts.v4() : zipped(parts.unpacked());
      const auto scene = decode_spz(as_span(bytes), "a.spz", {});
      ASSERT_TRUE(scene) << scene.error().message;
      EXPECT_EQ(scene->cloud.mean.get(0), Vec3(1, 2, 3)) << scene->origin.axes;
      EXPECT_EQ(scene->origin.axes_declared, number != 0);
    }
}

TEST(Spz, TheSameSceneInWhicheverAxesItIsStored) {
  scene::GaussianCloud cloud = random_cloud(200, 3, 21);
  for (float& value : cloud.sh) value *= 0.35f;  // turned, none may leave the range that the format has
  const scene::GaussianCloud there = cloud_of(encode_spz(cloud, "a.spz").value());
  for (const char* axes : {"RDF", "RFU", "LUF", "RUF", "LBD", "RBU"}) {
    SCOPED_TRACE(axes);
    for (const int version : {3, 4}) {
      const auto bytes = encode_spz(cloud, "a.spz", {.version = version, .axes = axes});
      ASSERT_TRUE(bytes);
      const auto back = decode_spz(*bytes, "a.spz", {});
      ASSERT_TRUE(back) << back.error().message;
      EXPECT_EQ(back->origin.axes, axes);
      EXPECT_TRUE(back->origin.axes_declared);
      for (std::size_t i = 0; i < cloud.size(); ++i) {
        for (int c = 0; c < 3; ++c)
          EXPECT_LE(std::abs(back->cloud.mean.get(i)[c] - cloud.mean.get(i)[c]), 0.5001f / 4096);
        EXPECT_EQ(back->cloud.log_scale.get(i), there.log_scale.get(i));
        EXPECT_LT(covariance_difference(back->cloud, there, i), 0.02) << i;
        for (std::size_t j = 0; j < cloud.sh_stride(); ++j)  // a quarter turn mixes up to 4 coefficients, each rounded
          EXPECT_NEAR(back->cloud.sh_row(i)[j], there.sh_row(i)[j], 2.5f / 128) << i << " " << j;
      }
    }
  }
  EXPECT_EQ(encode_spz(cloud, "a.spz", {.axes = "RRU"}).error().code, ErrorCode::invalid_argument);
}

TEST(Spz, AsManyExtensionsAsAreReadAreReadAgainOnceTheyAreWritten) {
  constexpr std::size_t most = 1 << 20;
  for (const std::uint32_t version : {3u, 4u}) {
    Parts parts = one_gaussian(version, 0);
    parts.flags = 2;
    const auto read = [&](const std::string& extensions) {
      parts.extensions = extensions;
      const std::string bytes = version == 4 ? parts.v4() : zipped(parts.unpacked());
      return decode_spz(as_span(bytes), "a.spz", {});
    };
    const auto full = read(record(7, std::string(most - 8, 'x')));
    ASSERT_TRUE(full) << full.error().message;
    const auto written = encode_spz(full->cloud, "b.spz", {.extensions = full->origin.spz_extensions}).value();
    const auto again = decode_spz(written, "b.spz", {});
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_EQ(again->origin.spz_extensions, full->origin.spz_extensions);
    for (const std::string& more : {record(7, std::string(most - 7, 'x')),
                                    declares_axes(4) + record(7, std::string(most - 8, 'x')) + record(7, "")}) {
      const auto refused = read(more);
      ASSERT_FALSE(refused) << version;
      EXPECT_EQ(refused.error().code, ErrorCode::too_large);
      EXPECT_EQ(refused.error().where, "a.spz:extensions");
    }
  }
}

TEST(Spz, BelievesNoExtensionBeforeCheckingIt) {
  const auto refused = [](std::uint32_t version, const std::string& extensions, ErrorCode code) {
    Parts parts = one_gaussian(version, 0);
    parts.flags = 2;
    parts.extensions = extensions;
    const auto cloud = decode(version == 4 ? parts.v4() : zipped(parts.unpacked()));
    EXPECT_TRUE(!cloud && cloud.error().code == code && cloud.error().where == "a.spz:extensions") << version;
  };
  for (const std::uint32_t version : {1u, 3u, 4u}) {
    refused(version, "hints for a viewer", ErrorCode::corrupt_data);
    refused(version, record(7, "four").substr(0, 11), ErrorCode::corrupt_data);
    refused(version, record(7, "") + "x", ErrorCode::corrupt_data);
    refused(version, declares_axes(17), ErrorCode::unsupported);
    refused(version, record(0xADBE0003, "12345"), ErrorCode::corrupt_data);
    refused(version, record(7, std::string(1 << 20, 'x')), ErrorCode::too_large);
  }
}

TEST(Spz, BytesThatNoFlagCallsExtensionsAreSaidToBeLeftOut) {
  Parts parts = one_gaussian(4, 0);
  parts.extensions = declares_axes(6);
  const std::string bytes = parts.v4();
  const auto scene = decode_spz(as_span(bytes), "a.spz", {});
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->origin.axes, "RUB");
  ASSERT_EQ(scene->origin.left_out.size(), 1u);
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
