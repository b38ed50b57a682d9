#include "engine/io/ply.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <numeric>

#include "engine/core/parallel.h"
#include "tests/engine/io/samples.h"
#include "tests/support/data.h"

namespace engine::io {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

class Ply : public ::testing::Test {
 protected:
  /// Reads bytes as a file chair.ply.
  Result<SceneFile> read(const std::string& bytes, const ReadOptions& options = {}) {
    support::write_file(input(), bytes);
    return read_ply(input(), options);
  }
  std::string written(const scene::GaussianCloud& cloud, const PlyLayout& layout) {
    const auto path = folder_.path() / "out.ply";
    const auto done = write_ply(path, cloud, layout);
    EXPECT_TRUE(done) << done.error().message;
    return done ? support::read_file(path) : "";
  }
  void expect_error(const std::string& bytes, ErrorCode code, const std::string& message, const std::string& where) {
    const auto scene = read(bytes);
    ASSERT_FALSE(scene) << message;
    EXPECT_EQ(int(scene.error().code), int(code)) << scene.error().message;
    EXPECT_NE(scene.error().message.find(message), std::string::npos) << scene.error().message;
    EXPECT_EQ(scene.error().where, where);
  }
  [[nodiscard]] std::filesystem::path input() const { return folder_.path() / "chair.ply"; }

  support::TempDir folder_;
};

std::size_t header_size(const std::string& bytes) {
  const std::string end = "end_header\n";
  return bytes.find(end) + end.size();
}

/// A file as no trainer writes it but the format allows: properties in random order and of random types, unknown ones
/// among them, comments, CRLF, -0.0, other elements before and after. `row_bytes`: of a vertex.
std::string wild_ply(int degree, std::uint64_t seed, std::size_t count, std::size_t* row_bytes = nullptr) {
  Rng rng(seed, 5);
  const char* types[] = {"char", "uint8", "short", "ushort", "int", "uint32", "float", "double"};
  const std::size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  struct Property {
    std::string name;
    std::size_t type;
    bool known;
  };
  std::vector<Property> properties;
  for (const auto& name : gaussian_names(degree))
    properties.push_back({name, rng.below(4) == 0 ? std::size_t(rng.below(8)) : 6, true});
  for (std::size_t k = 0; k < 12; ++k) properties.push_back({"extra_" + std::to_string(k), k % 8, false});
  for (const char* name : {"nx", "ny", "nz"}) properties.push_back({name, 6, false});
  for (std::size_t k = properties.size(); k > 1; --k)
    std::swap(properties[k - 1], properties[rng.below(std::uint32_t(k))]);

  const std::string eol = rng.below(2) ? "\r\n" : "\n";
  std::string bytes = "ply" + eol + "comment trained with love" + eol + "format  binary_little_endian 1.0" + eol;
  bytes += "element camera 2" + eol + "property double fov" + eol + "property char flag" + eol;
  bytes += "element vertex  " + std::to_string(count) + eol;
  for (const auto& property : properties) {
    bytes += std::string("property ") + types[property.type] + " " + property.name + eol;
    if (rng.below(8) == 0) bytes += "comment in between \xc3\xa9" + eol;
  }
  bytes += "obj_info anything" + eol + "element tail 3" + eol + "property ushort t" + eol + "end_header" + eol;
  for (int i = 0; i < 18; ++i) append(bytes, std::uint8_t(rng.next()));
  std::size_t row = 0;
  for (const auto& property : properties) row += sizes[property.type];
  for (std::size_t i = 0; i < count; ++i) {
    for (const auto& [name, type, known] : properties) {
      if (name[0] == 'n') {
        append(bytes, i % 3 == 0 ? 0.0f : -0.0f);
      } else if (type == 6 && known) {
        append(bytes, rng.below(10) == 0 ? -0.0f : rng.normal());
      } else if (type == 7 && known) {
        append(bytes, rng.below(10) == 0 ? -0.0 : double(rng.normal()) / 3.0);  // not a float
      } else {
        for (std::size_t b = 0; b < sizes[type]; ++b) append(bytes, std::uint8_t(rng.next()));
      }
    }
  }
  for (int i = 0; i < 6; ++i) append(bytes, std::uint8_t(rng.next()));
  if (row_bytes) *row_bytes = row;
  return bytes;
}

TEST_F(Ply, GivesAnyFileBackByteForByte) {
  for (int degree = 0; degree <= 3; ++degree) {
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
      SCOPED_TRACE(testing::Message() << "degree " << degree << ", seed " << seed);
      const std::string bytes = wild_ply(degree, seed, 7);
      const auto scene = read(bytes);
      ASSERT_TRUE(scene) << scene.error().message;
      EXPECT_EQ(scene->cloud.size(), 7u);
      EXPECT_EQ(scene->cloud.sh_degree, degree);
      EXPECT_EQ(written(scene->cloud, scene->layout), bytes);
    }
  }
}

TEST_F(Ply, SurvivingRowsAreTheInputBytesAndCopiesFollowThem) {
  std::size_t row = 0;
  const std::string bytes = wild_ply(2, 3, 7, &row);
  const auto scene = read(bytes);
  ASSERT_TRUE(scene);
  auto cloud = scene::select(scene->cloud, std::vector<std::uint8_t>{0, 1, 1, 0, 1, 0, 1});
  scene::append_rows(cloud, scene->cloud, std::vector<std::uint32_t>{3, 3, 0, 6, 5, 1, 2});

  const std::string header = scene->layout.header.text;
  const std::string rows = bytes.substr(header.size() + 18, 7 * row);
  std::string expected = header;
  expected.replace(expected.find("vertex  7") + 8, 1, "11");
  expected += bytes.substr(header.size(), 18);
  for (const std::size_t i : {1, 2, 4, 6, 3, 3, 0, 6, 5, 1, 2}) expected += rows.substr(i * row, row);
  expected += bytes.substr(bytes.size() - 6);
  EXPECT_EQ(written(cloud, scene->layout), expected);
}

TEST_F(Ply, PutsEveryPropertyWhereItBelongs) {
  const auto scene = read(simple_ply(3, 2));
  ASSERT_TRUE(scene) << scene.error().message;
  const auto value = [](std::size_t property) { return 0.01f * float(property + 1) + 1.0f; };  // of row 1
  const auto& cloud = scene->cloud;
  EXPECT_EQ(cloud.mean.get(1), Vec3(value(0), value(1), value(2)));
  EXPECT_EQ(cloud.opacity_logit[1], value(51));
  EXPECT_EQ(cloud.log_scale.get(1), Vec3(value(52), value(53), value(54)));
  EXPECT_EQ(cloud.rotation.w[1], value(55));
  EXPECT_EQ(cloud.rotation.z[1], value(58));
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(cloud.sh_row(1)[c * 16], value(3 + c));
    for (std::size_t k = 1; k < 16; ++k) EXPECT_EQ(cloud.sh_row(1)[c * 16 + k], value(6 + c * 15 + k - 1));
  }
  EXPECT_EQ(cloud.extra_stride, 0u);
}

TEST_F(Ply, ManyBlocksComeOutTheSameForAnyNumberOfThreads) {
  const scene::GaussianCloud cloud = random_cloud(50'000, 3, 1);  // 12 MB of rows
  const std::string bytes = written(cloud, inria_layout(3));
  for (const int threads : {1, 4}) {
    WorkArena arena(threads);
    arena.run([&] {
      const auto scene = read(bytes);
      ASSERT_TRUE(scene) << scene.error().message;
      EXPECT_EQ(scene->cloud, cloud);
      EXPECT_EQ(written(scene->cloud, scene->layout), bytes);
    });
  }
}

TEST_F(Ply, WritesThe62PropertiesOfTheReferenceInItsOrder) {
  const std::string header = inria_layout(3).header.text;
  EXPECT_EQ(std::ranges::count(header, '\n'), 3 + 62 + 1);
  EXPECT_NE(header.find("x\nproperty float y\nproperty float z\nproperty float nx"), std::string::npos);
  EXPECT_NE(header.find("f_rest_44\nproperty float opacity\nproperty float scale_0"), std::string::npos);
  EXPECT_EQ(inria_layout(0).header.text.find("f_rest"), std::string::npos);
}

TEST_F(Ply, NormalsCostMemoryOnlyWhenOneOfThemIsNotZero) {
  const scene::GaussianCloud cloud = random_cloud(40'000, 0, 2);
  std::string bytes = written(cloud, inria_layout(0));
  auto scene = read(bytes);
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->cloud.extra_stride, 0u);
  const std::size_t stride = scene->layout.vertex().stride;
  bytes[bytes.size() - stride + 16 + 3] = char(0x80);  // ny of the last row: -0.0
  scene = read(bytes);
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->cloud.extra_stride, 4u);
  EXPECT_EQ(written(scene->cloud, scene->layout), bytes);
}

TEST_F(Ply, BandsDroppedBecauseTheyAreZeroAreWrittenAsZeros) {
  scene::GaussianCloud cloud = random_cloud(5, 3, 4);
  for (std::size_t i = 0; i < 5; ++i)
    for (std::size_t j = 0; j < 48; ++j)
      if (j % 16 >= 4) cloud.sh_row(i)[j] = 0.0f;
  const std::string bytes = written(cloud, inria_layout(3));
  auto scene = read(bytes);
  ASSERT_TRUE(scene);
  scene::drop_empty_sh_bands(scene->cloud);
  EXPECT_EQ(scene->cloud.sh_degree, 1);
  EXPECT_EQ(written(scene->cloud, scene->layout), bytes);
}

TEST_F(Ply, AValueInAnotherTypeKeepsItsBytesUntilItChanges) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex 2\n";
  for (const auto& name : gaussian_names(0))
    bytes += (name == "x"         ? "property double "
              : name == "opacity" ? "property uchar "
                                  : "property float ") +
             name + "\n";
  bytes += "end_header\n";
  const std::size_t begin = bytes.size();
  constexpr double x = 1.0 / 3.0;
  for (int i = 0; i < 2; ++i) {
    append(bytes, x);
    for (int p = 1; p < 6; ++p) append(bytes, 1.0f);
    append(bytes, std::uint8_t(200));
    for (int p = 7; p < 14; ++p) append(bytes, 1.0f);
  }
  auto scene = read(bytes);
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_EQ(scene->cloud.mean.x[0], float(x));
  EXPECT_EQ(scene->cloud.opacity_logit[1], 200.0f);
  scene->cloud.mean.x[1] = 0.5f;
  scene->cloud.opacity_logit[1] = 1e9f;
  const std::string out = written(scene->cloud, scene->layout);
  const std::size_t row = (bytes.size() - begin) / 2;
  EXPECT_EQ(out.substr(0, begin + row), bytes.substr(0, begin + row));
  double new_x = 0;
  std::memcpy(&new_x, out.data() + begin + row, sizeof new_x);
  EXPECT_EQ(new_x, 0.5);
  EXPECT_EQ(std::uint8_t(out[begin + row + 28]), 255);  // saturated
}

TEST_F(Ply, NamesTheValueThatIsNotFinite) {
  const std::string good = simple_ply(1, 3);
  const auto with = [&](std::size_t property, float value) {
    std::string bytes = good;
    std::memcpy(bytes.data() + header_size(good) + (2 * 23 + property) * 4, &value, 4);
    return bytes;
  };
  expect_error(with(15, nan), ErrorCode::corrupt_data, "NaN or infinite", "chair.ply:vertex[2].opacity");
  expect_error(with(8, infinity), ErrorCode::corrupt_data, "NaN or infinite", "chair.ply:vertex[2].f_rest_2");
}

TEST_F(Ply, ADoubleBeyondFloatIsNotFinite) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex 1\n";
  for (const auto& name : gaussian_names(0)) bytes += "property double " + name + "\n";
  bytes += "end_header\n";
  for (int p = 0; p < 14; ++p) append(bytes, p == 2 ? -1e300 : 1.0);
  expect_error(bytes, ErrorCode::corrupt_data, "NaN or infinite", "chair.ply:vertex[0].z");
}

TEST_F(Ply, AcceptsAZeroQuaternion) {
  scene::GaussianCloud cloud = random_cloud(2, 0, 9);
  cloud.rotation.set(1, {0, 0, 0, 0});
  const std::string bytes = written(cloud, inria_layout(0));
  ASSERT_TRUE(read(bytes));
}

TEST_F(Ply, RefusesAPointCloudWithAHelpfulSentence) {
  std::string cloud = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n";
  for (const char* format : {"ascii", "binary_little_endian"})
    expect_error("ply\nformat " + std::string(format) + " 1.0\n" + cloud +
                     "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 1\n3 0 0 0\n",
                 ErrorCode::unsupported, "point cloud or mesh, not a trained Gaussian scene", "chair.ply:header");
}

TEST_F(Ply, SaysWhatIsWrongWithTheHeader) {
  const std::string good = simple_ply(1, 2), where = "chair.ply:header";
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string bytes = good;
    return bytes.replace(bytes.find(from), from.size(), to);
  };
  const auto unsupported = ErrorCode::unsupported, corrupt = ErrorCode::corrupt_data;
  expect_error(replaced("binary_little_endian", "ascii"), unsupported, "save it as binary_little_endian", where);
  expect_error(replaced("little", "big"), unsupported, "big-endian", where);
  expect_error(replaced("float rot_2", "float rot_9"), corrupt, "property 'rot_2' is missing", where);
  expect_error(replaced("float f_dc_1", "float f_dc_9"), corrupt, "property 'f_dc_1' is missing", where);
  expect_error(replaced("float f_rest_8\n", "float other\n"), unsupported, "8 f_rest properties", where);
  expect_error(replaced("float f_rest_8\n", "float f_rest_08\n"), unsupported, "8 f_rest properties", where);
  expect_error(replaced("float f_rest_3\n", "float f_rest_11\n"), corrupt, "'f_rest_3' is missing", where);
  expect_error(replaced("float rot_3\n", "float rot_3\nproperty list uchar int l\n"), unsupported,
               "element 'vertex' has a list", where);
  expect_error(replaced("end_header", "element face 1\nproperty list uchar int v\nend_header"), unsupported,
               "element 'face' has a list", where);
  expect_error(replaced("element vertex", "element vertices"), unsupported, "no 'vertex' element", where);
  expect_error(replaced("vertex 2", "vertex 0").substr(0, header_size(good)), ErrorCode::unprocessable,
               "holds no Gaussians", where);
}

TEST_F(Ply, KeepsAnEmptyElementOfAnyKind) {
  std::string bytes = simple_ply(1, 2);
  bytes.replace(bytes.find("end_header"), 10, "element face 0\nproperty list uchar int vertex_indices\nend_header");
  const auto scene = read(bytes);
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_EQ(written(scene->cloud, scene->layout), bytes);
}

TEST_F(Ply, BelievesNoCountThatTheFileDoesNotBear) {
  const std::string good = simple_ply(0, 2);
  const auto with_count = [&](const std::string& count) {
    std::string bytes = good;
    return bytes.replace(bytes.find("vertex 2") + 7, 1, count);
  };
  const auto corrupt = ErrorCode::corrupt_data;
  for (const char* count : {"3", "4294967298", "9223372036854775808", "18446744073709551615", "329406144173384850"})
    expect_error(with_count(count), corrupt,
                 "announces " + std::string(count) + " vertex rows of 56 bytes each; only 112", "chair.ply:vertex");
  for (const char* count : {"-2", "1e9", "2.0", "0x2", "+2", "36893488147419103234"})
    expect_error(with_count(count), corrupt, "found '" + std::string(count) + "'", "chair.ply:header");
  expect_error(with_count("1"), corrupt, "end at byte", "chair.ply:header");
  expect_error(good + "\n", corrupt, "end at byte", "chair.ply:header");
}

TEST_F(Ply, ACutAtAnyByteIsAnError) {
  const std::string bytes = wild_ply(1, 6, 2);
  MemoryFile file;
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    file.set(bytes.substr(0, size));
    ASSERT_FALSE(read_ply(file.path())) << "cut at byte " << size;
  }
  file.set(bytes);
  ASSERT_TRUE(read_ply(file.path()));
}

TEST_F(Ply, KeepsTheLimitsAndNamesThem) {
  ReadOptions options;
  options.max_gaussians = 2;
  auto scene = read(simple_ply(0, 3), options);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::too_large);
  EXPECT_NE(scene.error().message.find("max_gaussians"), std::string::npos);
  options.max_gaussians = 3;
  options.max_memory_bytes = 3 * 56 - 1;
  scene = read(simple_ply(0, 3), options);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::too_large);
  EXPECT_NE(scene.error().message.find("max_memory_bytes"), std::string::npos);
  options.max_memory_bytes = 3 * 56;
  EXPECT_TRUE(read(simple_ply(0, 3), options));
}

TEST_F(Ply, NamesAFileThatCannotBeRead) {
  const auto missing = read_ply(folder_.path() / "absent.ply");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::not_found);
  const auto is_folder = read_ply(folder_.path());
  ASSERT_FALSE(is_folder);
  EXPECT_EQ(is_folder.error().code, ErrorCode::invalid_argument);
  const auto device = read_ply("/dev/null");
  ASSERT_FALSE(device);
  EXPECT_EQ(device.error().code, ErrorCode::invalid_argument);
}

TEST_F(Ply, NeverWritesAPoisonedEmptyOrForeignScene) {
  const auto path = folder_.path() / "out.ply";
  support::write_file(path, "old");
  scene::GaussianCloud poisoned = random_cloud(3, 1, 1);
  poisoned.log_scale.y[2] = nan;
  const auto refused = write_ply(path, poisoned, inria_layout(1));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "out.ply:vertex[2].scale_1");
  EXPECT_FALSE(write_ply(path, scene::GaussianCloud{}, inria_layout(0)));
  EXPECT_FALSE(write_ply(path, random_cloud(3, 2, 1), inria_layout(1)));
  scene::GaussianCloud ragged = random_cloud(3, 0, 1);
  ragged.mean.y.pop_back();
  EXPECT_FALSE(write_ply(path, ragged, inria_layout(0)));
  scene::GaussianCloud extra = random_cloud(3, 0, 1);
  extra.extra_stride = 2;
  extra.resize(3);
  EXPECT_FALSE(write_ply(path, extra, inria_layout(0)));
  EXPECT_EQ(support::read_file(path), "old");
}

}  // namespace
}  // namespace engine::io
