#include "engine/io/colmap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "engine/core/rng.h"
#include "tests/engine/io/colmap_samples.h"

namespace engine::io {
namespace {

using samples::as_bytes;

constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

ColmapCameras known_cameras() {
  return *parse_colmap_cameras(as_bytes(samples::binary(samples::cameras())), ColmapEncoding::binary, "cameras.bin");
}

/// The error's "where" for images with one thing changed.
std::string where_of(const std::function<void(samples::ColmapImage&)>& change) {
  auto images = samples::images();
  change(images[1]);
  const std::string bytes = samples::binary(images);
  const auto parsed = parse_colmap_images(as_bytes(bytes), ColmapEncoding::binary, "images.bin", known_cameras());
  return parsed ? "no error" : parsed.error().where;
}

TEST(ColmapCameras, ReadEveryKnownModel) {
  const auto cameras = known_cameras();
  ASSERT_EQ(cameras.size(), 8u);
  const Lens simple = cameras.at(1), opencv = cameras.at(5), fisheye = cameras.at(6), radial_fisheye = cameras.at(900);
  EXPECT_EQ(simple.fx, 50);
  EXPECT_EQ(simple.fy, 50);
  EXPECT_EQ(simple.cx, 32);
  EXPECT_EQ(simple.cy, 24);
  EXPECT_TRUE(simple.is_pinhole());
  EXPECT_TRUE(cameras.at(2).is_pinhole());
  EXPECT_FALSE(cameras.at(3).is_pinhole());
  EXPECT_EQ(opencv.fy, 51);
  EXPECT_EQ(opencv.k, (std::array<double, 4>{0.01, -0.002, 0, 0}));
  EXPECT_EQ(opencv.p, (std::array<double, 2>{0.001, 0.0005}));
  EXPECT_EQ(fisheye.model, LensModel::fisheye);
  EXPECT_EQ(fisheye.k, (std::array<double, 4>{0.01, -0.002, 0.001, 0.0005}));
  EXPECT_EQ(radial_fisheye.model, LensModel::fisheye);
  EXPECT_EQ(radial_fisheye.k, (std::array<double, 4>{0.01, -0.002, 0, 0}));
}

TEST(ColmapModel, IsTheSameInBothEncodings) {
  const std::string text_cameras = samples::text(samples::cameras());
  const auto cameras = parse_colmap_cameras(as_bytes(text_cameras), ColmapEncoding::text, "cameras.txt");
  ASSERT_TRUE(cameras) << cameras.error().message;
  EXPECT_EQ(*cameras, known_cameras());

  const std::string binary_images = samples::binary(samples::images()), text_images = samples::text(samples::images());
  const auto a = parse_colmap_images(as_bytes(binary_images), ColmapEncoding::binary, "images.bin", *cameras);
  const auto b = parse_colmap_images(as_bytes(text_images), ColmapEncoding::text, "images.txt", *cameras);
  ASSERT_TRUE(a) << a.error().message;
  ASSERT_TRUE(b) << b.error().message << b.error().where;
  ASSERT_EQ(a->size(), 3u);
  ASSERT_EQ(b->size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ((*a)[i].name, (*b)[i].name);
    EXPECT_EQ((*a)[i].rotation, (*b)[i].rotation);
    EXPECT_EQ((*a)[i].translation, (*b)[i].translation);
    EXPECT_EQ((*a)[i].lens, (*b)[i].lens);
  }
  EXPECT_EQ((*a)[0].name, "b 2.png");
  EXPECT_EQ((*a)[0].where, "images.bin:image[0]");
  EXPECT_EQ((*b)[0].where, "images.txt:line[3]");

  const std::string binary_points = samples::binary(samples::points()), text_points = samples::text(samples::points());
  const auto p = parse_colmap_points(as_bytes(binary_points), ColmapEncoding::binary, "points3D.bin");
  const auto q = parse_colmap_points(as_bytes(text_points), ColmapEncoding::text, "points3D.txt");
  ASSERT_TRUE(p);
  ASSERT_TRUE(q);
  EXPECT_EQ(*p, *q);
  EXPECT_EQ((*p)[1], (Point{{-1e6, 1.0 / 3, 5}, {1, 2, 3}}));
}

TEST(ColmapText, MayHaveWindowsLineEndsAndNoLastLine) {
  const std::string text = "# comment\r\n3 PINHOLE 64 48 50 51 32 24\r\n\r\n4 PINHOLE 32\t24 50 51 16 12";
  const auto cameras = parse_colmap_cameras(as_bytes(text), ColmapEncoding::text, "cameras.txt");
  ASSERT_TRUE(cameras) << cameras.error().message;
  EXPECT_EQ(cameras->at(4).height, 24);
  const std::string images = "1 1 0 0 0 0 0 0 3 a.jpg";
  const auto shots = parse_colmap_images(as_bytes(images), ColmapEncoding::text, "images.txt", *cameras);
  ASSERT_TRUE(shots) << shots.error().message;
  EXPECT_EQ(shots->at(0).name, "a.jpg");
}

TEST(ColmapImages, PoseIsCamFromWorld) {
  auto images = samples::images();
  images.resize(1);
  const double half = std::sqrt(0.5);
  images[0].pose = {half, 0, 0, half, 1, 2, 3};  // a quarter turn about z: x becomes y
  const std::string bytes = samples::binary(images);
  const auto shots = parse_colmap_images(as_bytes(bytes), ColmapEncoding::binary, "images.bin", known_cameras());
  ASSERT_TRUE(shots);
  const DVec3 in_cam = (*shots)[0].rotation * DVec3(1, 0, 0) + (*shots)[0].translation;
  EXPECT_LT(glm::length(in_cam - DVec3(1, 3, 3)), 1e-15);
}

TEST(ColmapImages, NormaliseTheQuaternion) {
  auto images = samples::images();
  for (double& value : images[0].pose) value *= 3;
  const std::string bytes = samples::binary(images), plain = samples::binary(samples::images());
  const auto scaled = parse_colmap_images(as_bytes(bytes), ColmapEncoding::binary, "images.bin", known_cameras());
  const auto unit = parse_colmap_images(as_bytes(plain), ColmapEncoding::binary, "images.bin", known_cameras());
  ASSERT_TRUE(scaled);
  for (int i = 0; i < 3; ++i) EXPECT_LT(glm::length((*scaled)[0].rotation[i] - (*unit)[0].rotation[i]), 1e-15);
}

TEST(ColmapImages, NameTheBadField) {
  EXPECT_EQ(where_of([](auto&) {}), "no error");
  EXPECT_EQ(where_of([](auto& image) { image.camera_id = 77; }), "images.bin:image[1].camera_id");
  EXPECT_EQ(where_of([](auto& image) { image.pose[2] = nan_value; }), "images.bin:image[1].qy");
  EXPECT_EQ(where_of([](auto& image) { image.pose[5] = -1 / 0.0; }), "images.bin:image[1].ty");
  EXPECT_EQ(where_of([](auto& image) { image.pose[0] = 0; }), "images.bin:image[1].qw");       // zero quaternion
  EXPECT_EQ(where_of([](auto& image) { image.pose[0] = 1e-200; }), "images.bin:image[1].qw");  // its square underflows
  EXPECT_EQ(where_of([](auto& image) { image.pose[0] = 1e200; }), "images.bin:image[1].qw");   // its square overflows
  EXPECT_EQ(where_of([](auto& image) { image.name.clear(); }), "images.bin:image[1].name");
}

TEST(ColmapText, NamesTheBadField) {
  const auto where = [](const std::string& text) {
    return parse_colmap_images(as_bytes(text), ColmapEncoding::text, "images.txt", known_cameras()).error().where;
  };
  EXPECT_EQ(where("1 1 0 0 0 0 0 0 99 a.jpg\n\n"), "images.txt:line[1].camera_id");
  EXPECT_EQ(where("1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 zero 0 0 0 0 1 b.jpg\n\n"), "images.txt:line[3].qy");
  EXPECT_EQ(where("1 1 0 0 0 0 nan 0 1 a.jpg\n\n"), "images.txt:line[1].ty");
  EXPECT_EQ(where("1 1 0 0\n"), "images.txt:line[1].qz");
  EXPECT_EQ(where("1 1 0 0 0 0 0 0 1\n"), "images.txt:line[1].name");
  const auto camera_where = [](const std::string& text) {
    return parse_colmap_cameras(as_bytes(text), ColmapEncoding::text, "cameras.txt").error().where;
  };
  EXPECT_EQ(camera_where("1 PINHOLE 64 48 50 51 32\n"), "cameras.txt:line[1].params");
  EXPECT_EQ(camera_where("1 PINHOLE 64 48 50 51 32 24 5\n"), "cameras.txt:line[1].params");
  EXPECT_EQ(camera_where("1 PINHOLE -64 48 50 51 32 24\n"), "cameras.txt:line[1].width");
  EXPECT_EQ(camera_where("1 PINHOLE 64 0 50 51 32 24\n"), "cameras.txt:line[1].height");
  const std::string points = "1 0 0 0 10 20 256 0\n";
  EXPECT_EQ(parse_colmap_points(as_bytes(points), ColmapEncoding::text, "points3D.txt").error().where,
            "points3D.txt:line[1].b");
}

TEST(ColmapCameras, RefuseOtherModelsByName) {
  for (const int model : {6, 7, 10}) {
    const std::string bytes = samples::binary(std::vector<samples::ColmapCamera>{{1, model, 64, 48, {1, 2, 3}}});
    const auto binary = parse_colmap_cameras(as_bytes(bytes), ColmapEncoding::binary, "cameras.bin");
    EXPECT_EQ(binary.error().code, ErrorCode::unsupported);
    EXPECT_EQ(binary.error().where, "cameras.bin:camera[0].model");
    EXPECT_NE(binary.error().message.find(samples::model_name(model)), std::string::npos) << binary.error().message;
    EXPECT_NE(binary.error().message.find("colmap image_undistorter"), std::string::npos);
  }
  for (const std::int32_t model : {11, -1, std::numeric_limits<std::int32_t>::max()}) {
    const std::string bytes = samples::binary(std::vector<samples::ColmapCamera>{{1, model, 64, 48, {1, 2, 3}}});
    const auto binary = parse_colmap_cameras(as_bytes(bytes), ColmapEncoding::binary, "cameras.bin");
    EXPECT_EQ(binary.error().code, ErrorCode::unsupported);
    EXPECT_NE(binary.error().message.find(std::to_string(model)), std::string::npos);
  }
  const std::string text = "1 HOLOGRAM 64 48 1 2 3\n";
  const auto unknown = parse_colmap_cameras(as_bytes(text), ColmapEncoding::text, "cameras.txt");
  EXPECT_EQ(unknown.error().code, ErrorCode::unsupported);
  EXPECT_NE(unknown.error().message.find("HOLOGRAM"), std::string::npos);
}

TEST(ColmapCameras, RefuseWhatIsDescribedTwiceOrHasNoSize) {
  const auto where = [](const std::vector<samples::ColmapCamera>& cameras) {
    const std::string bytes = samples::binary(cameras);
    return parse_colmap_cameras(as_bytes(bytes), ColmapEncoding::binary, "cameras.bin").error().where;
  };
  EXPECT_EQ(where({{1, 0, 64, 48, {1, 2, 3}}, {1, 0, 64, 48, {1, 2, 3}}}), "cameras.bin:camera[1].camera_id");
  EXPECT_EQ(where({{1, 0, 0, 48, {1, 2, 3}}}), "cameras.bin:camera[0].width");
  EXPECT_EQ(where({{1, 0, 64, std::uint64_t{1} << 63, {1, 2, 3}}}), "cameras.bin:camera[0].height");
  EXPECT_EQ(where({{1, 0, 64, 48, {1, nan_value, 3}}}), "cameras.bin:camera[0].params[1]");
}

TEST(ColmapBinary, BelievesNoCount) {
  for (const std::uint64_t count : {std::uint64_t{1} << 63, ~std::uint64_t{0}, std::uint64_t{4}}) {
    SCOPED_TRACE(count);
    for (std::string bytes : {samples::binary(samples::images()), samples::binary(samples::points())}) {
      std::memcpy(bytes.data(), &count, 8);
      EXPECT_FALSE(parse_colmap_images(as_bytes(bytes), ColmapEncoding::binary, "images.bin", known_cameras()));
      EXPECT_FALSE(parse_colmap_points(as_bytes(bytes), ColmapEncoding::binary, "points3D.bin"));
      EXPECT_FALSE(parse_colmap_cameras(as_bytes(bytes), ColmapEncoding::binary, "cameras.bin"));
    }
  }
  // The number of 2D points of the last image, and the length of the last track.
  std::string images = samples::binary(samples::images());
  const std::uint64_t absurd = std::uint64_t{1} << 61;  // times 24 overflows 64 bits
  std::memcpy(images.data() + images.size() - 24 - 8, &absurd, 8);
  EXPECT_EQ(parse_colmap_images(as_bytes(images), ColmapEncoding::binary, "images.bin", known_cameras()).error().where,
            "images.bin:image[2]");
  std::string points = samples::binary(samples::points());
  std::memcpy(points.data() + points.size() - 8 - 8, &absurd, 8);
  EXPECT_EQ(parse_colmap_points(as_bytes(points), ColmapEncoding::binary, "points3D.bin").error().where,
            "points3D.bin:point[2]");
}

TEST(ColmapBinary, CutAnywhereOrExtendedIsANamedError) {
  const auto cameras = known_cameras();
  const auto check = [](const std::string& whole, const auto& parse) {
    for (std::size_t size = 0; size < whole.size(); ++size) {
      const std::string cut = whole.substr(0, size);
      const auto parsed = parse(cut);
      ASSERT_FALSE(parsed) << "cut at " << size;
      EXPECT_EQ(parsed.error().code, ErrorCode::corrupt_data) << "cut at " << size;
      EXPECT_FALSE(parsed.error().where.empty());
    }
    EXPECT_TRUE(parse(whole));
    EXPECT_FALSE(parse(whole + '\0'));
  };
  check(samples::binary(samples::cameras()), [](const std::string& bytes) {
    return parse_colmap_cameras(as_bytes(bytes), ColmapEncoding::binary, "cameras.bin");
  });
  check(samples::binary(samples::images()), [&](const std::string& bytes) {
    return parse_colmap_images(as_bytes(bytes), ColmapEncoding::binary, "images.bin", cameras);
  });
  check(samples::binary(samples::points()), [](const std::string& bytes) {
    return parse_colmap_points(as_bytes(bytes), ColmapEncoding::binary, "points3D.bin");
  });
}

TEST(ColmapText, CutAnywhereIsAModelOrANamedError) {
  // A text that ends within a number is a shorter number: only missing fields can be told.
  const auto cameras = known_cameras();
  const auto sound = [](const auto& parsed) { return parsed || !parsed.error().where.empty(); };
  const std::string c = samples::text(samples::cameras()), i = samples::text(samples::images()),
                    p = samples::text(samples::points());
  for (std::size_t size = 0; size < std::max({c.size(), i.size(), p.size()}); ++size) {
    EXPECT_TRUE(sound(parse_colmap_cameras(as_bytes(c.substr(0, size)), ColmapEncoding::text, "cameras.txt")));
    EXPECT_TRUE(sound(parse_colmap_images(as_bytes(i.substr(0, size)), ColmapEncoding::text, "images.txt", cameras)));
    EXPECT_TRUE(sound(parse_colmap_points(as_bytes(p.substr(0, size)), ColmapEncoding::text, "points3D.txt")));
  }
}

TEST(Colmap, SurvivesThousandsOfCorruptedFiles) {
  const auto cameras = known_cameras();
  const std::string files[] = {samples::binary(samples::cameras()), samples::binary(samples::images()),
                               samples::binary(samples::points()),  samples::text(samples::cameras()),
                               samples::text(samples::images()),    samples::text(samples::points())};
  for (std::uint64_t seed = 0; seed < 12000; ++seed) {
    Rng rng(seed);
    std::string bytes = files[seed % 6];
    for (auto changes = 1 + rng.below(4); changes > 0; --changes)
      bytes[rng.below(std::uint32_t(bytes.size()))] = rng.below(4) == 0 ? '\xff' : char(rng.below(256));
    const auto encoding = seed % 6 < 3 ? ColmapEncoding::binary : ColmapEncoding::text;
    SCOPED_TRACE(seed);
    const auto fine = [](const auto& parsed) { return parsed || !parsed.error().where.empty(); };
    EXPECT_TRUE(fine(parse_colmap_cameras(as_bytes(bytes), encoding, "cameras")));
    const auto shots = parse_colmap_images(as_bytes(bytes), encoding, "images", cameras);
    EXPECT_TRUE(fine(shots));
    for (const Shot& shot : shots.value_or(std::vector<Shot>())) {
      EXPECT_NEAR(glm::determinant(shot.rotation), 1, 1e-12);
    }
    EXPECT_TRUE(fine(parse_colmap_points(as_bytes(bytes), encoding, "points")));
  }
}

}  // namespace
}  // namespace engine::io
