#include "engine/io/sog.h"

#include <gtest/gtest.h>
#include <zip.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "engine/core/parallel.h"
#include "engine/io/checks.h"
#include "engine/io/scene_file.h"
#include "engine/io/webp.h"
#include "engine/io/zip_archive.h"
#include "tests/engine/io/agreement.h"
#include "tests/support/data.h"

namespace engine::io {
namespace {

using nlohmann::json;
using Bytes = std::vector<std::byte>;

Bytes bytes_of(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

/// A picture of one colour.
Bytes plain_webp(std::size_t width, std::size_t height, std::array<std::uint8_t, 4> rgba) {
  BytePicture picture;
  picture.width = width, picture.height = height;
  for (std::size_t i = 0; i < picture.pixels(); ++i) picture.rgba.insert(picture.rgba.end(), rgba.begin(), rgba.end());
  return encode_webp(picture, "").value();
}

/// A scene in parts, to be changed and put together.
struct Parts {
  json meta;
  std::map<std::string, Bytes> files;

  static Parts of(const scene::GaussianCloud& cloud) {
    const Bytes zip = encode_sog(cloud, false, "a.sog").value();
    const auto archive = ZipArchive::open(zip, "a.sog");
    Parts parts;
    for (const auto& [name, index] : archive->names()) parts.files[name] = archive->read(name, 1 << 24, nullptr)->bytes;
    const Bytes& text = parts.files["meta.json"];
    parts.meta = json::parse(reinterpret_cast<const char*>(text.data()),
                             reinterpret_cast<const char*>(text.data()) + text.size());
    parts.files.erase("meta.json");
    return parts;
  }
  [[nodiscard]] Bytes zip(const std::string& folder = "") const {
    std::vector<NamedFile> all{{folder + "meta.json", bytes_of(meta.dump())}};
    for (const auto& [name, bytes] : files) all.push_back({folder + name, bytes});
    return make_zip(all).value();
  }
};

Result<DecodedScene> decode(const Bytes& zip, const ReadOptions& options = {}) {
  return decode_sog(zip, "a.sog", options);
}

TEST(Sog, DecodesVersion2AsItsTextSays) {
  Parts parts;
  json book = json::array();
  for (int k = 0; k < 256; ++k) book.push_back(k / 100.0 - 1);
  parts.meta = {{"version", 2}, {"count", 1}, {"antialias", true}};
  parts.meta["means"] = {{"mins", {-1.0, 0.0, 0.0}}, {"maxs", {1.0, 2.0, 0.0}}, {"files", {"l.webp", "u.webp"}}};
  parts.meta["scales"] = {{"codebook", book}, {"files", json::array({"s.webp"})}};
  parts.meta["quats"] = {{"files", json::array({"q.webp"})}};
  parts.meta["sh0"] = {{"codebook", book}, {"files", json::array({"c.webp"})}};
  parts.meta["shN"] = {{"count", 66}, {"bands", 1}, {"codebook", book}, {"files", {"p.webp", "n.webp"}}};
  parts.files["l.webp"] = plain_webp(1, 1, {255, 255, 7, 255});
  parts.files["u.webp"] = plain_webp(1, 1, {255, 127, 0, 255});  // x 65535, y 32767, z 7
  parts.files["s.webp"] = plain_webp(1, 1, {0, 100, 255, 255});
  parts.files["q.webp"] = plain_webp(1, 1, {255, 0, 128, 253});  // x was the largest: w, y, z are kept
  parts.files["c.webp"] = plain_webp(1, 1, {0, 100, 200, 0});    // alpha 0, over which no colour may be lost
  parts.files["n.webp"] = plain_webp(1, 1, {65, 0, 0, 255});
  BytePicture palette;
  palette.width = 192, palette.height = 2;
  palette.rgba.assign(4 * 192 * 2, 0);
  for (std::size_t k = 0; k < 3; ++k)  // entry 65: the second of the second row
    for (std::size_t c = 0; c < 3; ++c) palette.pixel(192 + 3 + k)[c] = std::uint8_t(10 * (k + 1) + c);
  parts.files["p.webp"] = encode_webp(palette, "").value();

  for (const char* folder : {"", "my scene/"}) {
    const auto scene = decode(parts.zip(folder));
    ASSERT_TRUE(scene) << scene.error().message << scene.error().where;
    const auto& cloud = scene->cloud;
    EXPECT_FLOAT_EQ(cloud.mean.get(0).x, float(std::exp(1.0) - 1));
    EXPECT_FLOAT_EQ(cloud.mean.get(0).y, float(std::exp(2 * 32767 / 65535.0) - 1));
    EXPECT_EQ(cloud.mean.get(0).z, 0.0f);
    EXPECT_EQ(cloud.log_scale.get(0), Vec3(-1.0f, 0.0f, 1.55f));
    const double half = std::sqrt(0.5), small = (128 / 255.0 - 0.5) * std::sqrt(2.0);
    EXPECT_LT(angle_between(cloud.rotation.get(0),
                            Quat(float(half), float(std::sqrt(std::max(0.0, 1 - 2 * half * half - small * small))),
                                 float(-half), float(small))),
              1e-3);
    EXPECT_FLOAT_EQ(cloud.sh_row(0)[0], -1.0f);
    EXPECT_FLOAT_EQ(cloud.sh_row(0)[4], 0.0f);
    EXPECT_FLOAT_EQ(cloud.sh_row(0)[8], 1.0f);
    EXPECT_LT(opacity_of(cloud.opacity_logit[0]), 1.0 / 255);
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_FLOAT_EQ(cloud.sh_row(0)[4 * c + k + 1], float((10 * (double(k) + 1) + double(c)) / 100 - 1));
    EXPECT_TRUE(scene->origin.antialiased);
    EXPECT_EQ(scene->origin.version, 2);
  }
}

TEST(Sog, DecodesVersion1AsOldFilesHaveIt) {
  Parts parts;
  parts.meta["means"] = {{"shape", {2, 3}},
                         {"dtype", "float32"},
                         {"mins", {0.0, 0.0, 0.0}},
                         {"maxs", {1.0, 1.0, 1.0}},
                         {"files", {"l.webp", "u.webp"}}};
  parts.meta["scales"] = {
      {"shape", {2, 3}}, {"mins", {-4.0, -4.0, -4.0}}, {"maxs", {0.0, 0.0, 0.0}}, {"files", json::array({"s.webp"})}};
  parts.meta["quats"] = {{"encoding", "quaternion_packed"}, {"files", json::array({"q.webp"})}};
  parts.meta["sh0"] = {
      {"mins", {-1.0, -1.0, -1.0, -5.0}}, {"maxs", {1.0, 1.0, 1.0, 5.0}}, {"files", json::array({"c.webp"})}};
  parts.meta["shN"] = {{"mins", -1.0}, {"maxs", 1.0}, {"quantization", 8}, {"files", {"p.webp", "n.webp"}}};
  parts.files["l.webp"] = plain_webp(2, 1, {0, 0, 0, 255});
  parts.files["u.webp"] = plain_webp(2, 1, {0, 0, 0, 255});
  parts.files["s.webp"] = plain_webp(2, 1, {0, 255, 51, 255});
  parts.files["q.webp"] = plain_webp(2, 1, {128, 128, 128, 252});
  parts.files["c.webp"] = plain_webp(2, 1, {0, 255, 51, 255});
  parts.files["p.webp"] = plain_webp(512, 1, {0, 255, 51, 255});
  parts.files["n.webp"] = plain_webp(2, 1, {63, 0, 0, 255});
  const auto scene = decode(parts.zip());
  ASSERT_TRUE(scene) << scene.error().message << scene.error().where;
  EXPECT_EQ(scene->origin.version, 1);
  EXPECT_EQ(scene->cloud.sh_degree, 2);
  EXPECT_EQ(scene->cloud.log_scale.get(1), Vec3(-4.0f, 0.0f, -3.2f));
  EXPECT_FLOAT_EQ(scene->cloud.opacity_logit[1], 5.0f);
  EXPECT_FLOAT_EQ(scene->cloud.sh_row(1)[9], 1.0f);
  EXPECT_FLOAT_EQ(scene->cloud.sh_row(1)[18 + 3], -0.6f);
}

TEST(Sog, ComesBackWithinItsBits) {
  for (int degree = 0; degree <= 3; ++degree) {
    const scene::GaussianCloud cloud = random_cloud(700, degree, 31);
    const auto zip = encode_sog(cloud, true, "a.sog");
    ASSERT_TRUE(zip);
    const auto back = decode(*zip);
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_TRUE(back->origin.antialiased);
    const auto order = sog_order(cloud);
    std::vector<std::uint32_t> place(order.size());
    for (std::size_t k = 0; k < order.size(); ++k) place[order[k]] = std::uint32_t(k);
    const Differences most = differences(cloud, back->cloud, place);
    for (const double mean : most.mean)
      EXPECT_LE(mean, 0.5 * 3.2 / 65535 * 5) << "of a logarithm from -1.6 to 1.6, at 4";
    EXPECT_LE(most.rotation_rad, 0.04);
    EXPECT_LE(most.opacity, 0.5 / 255 + 1e-6);
    EXPECT_LE(most.log_scale, 0.03) << "9 units, by 256 entries";
    EXPECT_LE(most.sh, 0.01) << "the palette is exact, and its 256 numbers span 2";
    EXPECT_EQ(encode_sog(back->cloud, true, "a.sog").value(), *zip) << "a second pass must lose nothing more";
  }
}

TEST(Sog, TheSameBytesForAnyNumberOfThreads) {
  const scene::GaussianCloud cloud = random_cloud(70'000, 1, 32);  // more rows than a palette has entries
  Bytes first;
  for (const int threads : {1, 2, 5}) {
    WorkArena arena(threads);
    Bytes zip;
    arena.run([&] { zip = encode_sog(cloud, false, "a.sog").value(); });
    if (first.empty()) first = zip;
    EXPECT_TRUE(zip == first) << threads;
  }
}

TEST(Sog, NamesWhatDoesNotFit) {
  const Parts good = Parts::of(random_cloud(300, 1, 33));
  ASSERT_TRUE(decode(good.zip()));
  const auto refused = [&](auto&& change, ErrorCode code, const std::string& where) {
    Parts parts = good;
    change(parts);
    const auto scene = decode(parts.zip());
    ASSERT_FALSE(scene) << where;
    EXPECT_EQ(scene.error().code, code) << where << ": " << scene.error().message;
    EXPECT_EQ(scene.error().where, where) << scene.error().message;
  };
  using enum ErrorCode;
  refused([](Parts& p) { p.meta["version"] = 3; }, unsupported, "a.sog:meta.json:version");
  refused([](Parts& p) { p.meta["count"] = 0; }, unprocessable, "a.sog:header");
  refused([](Parts& p) { p.meta["count"] = 5000; }, corrupt_data, "a.sog:means_l.webp");
  refused([](Parts& p) { p.meta["count"] = 4294967296.0; }, too_large, "a.sog:header");
  refused([](Parts& p) { p.meta["count"] = -1; }, corrupt_data, "a.sog:meta.json:count");
  refused([](Parts& p) { p.meta.erase("quats"); }, corrupt_data, "a.sog:meta.json:quats");
  refused([](Parts& p) { p.meta["scales"]["codebook"] = json::array(); }, corrupt_data,
          "a.sog:meta.json:scales.codebook");
  refused([](Parts& p) { p.meta["scales"]["codebook"][7] = 1e39; }, corrupt_data, "a.sog:meta.json:scales.codebook");
  refused([](Parts& p) { p.meta["means"]["maxs"][1] = 1000; }, corrupt_data, "a.sog:meta.json:means");
  refused([](Parts& p) { p.meta["shN"]["bands"] = 2; }, corrupt_data, "a.sog:shN_centroids.webp");
  refused([](Parts& p) { p.meta["shN"]["count"] = 65536; }, corrupt_data, "a.sog:shN_centroids.webp");
  refused([](Parts& p) { p.meta["shN"]["count"] = 3; }, corrupt_data, "a.sog:vertex[0].f_rest");
  refused(
      [](Parts& p) {
        p.files["quats.webp"] = plain_webp(20, 20, {0, 0, 0, 251});
      },
      corrupt_data, "a.sog:vertex[0].rot");
  refused([](Parts& p) { p.files["scales.webp"] = bytes_of("RIFF0000WEBP"); }, corrupt_data, "a.sog:scales.webp");
  refused([](Parts& p) { p.files["scales.webp"] = bytes_of("\x89PNG\r\n\x1a\n and so on, and on"); }, unsupported,
          "a.sog:scales.webp");
  refused([](Parts& p) { p.files.erase("sh0.webp"); }, corrupt_data, "a.sog:sh0.webp");
  for (const char* name : {"../secret.webp", "/etc/passwd", "a/../../b", "C:\\x", "", "a\nb"})
    refused([&](Parts& p) { p.meta["means"]["files"][1] = name; }, corrupt_data, "a.sog:meta.json:means.files[1]");
}

TEST(Sog, APictureThatIsTooLargeForItsGaussiansIsNotDecoded) {
  Parts parts = Parts::of(random_cloud(300, 0, 34));
  // The head of a lossless picture of 16384 x 16384, a gigabyte, and a little of one colour.
  std::string bomb("RIFF\x26\0\0\0WEBPVP8L\x1a\0\0\0\x2f\xff\xff\xff\x0f", 25);
  bomb.resize(46, '\0');
  parts.files["means_u.webp"] = bytes_of(bomb);
  MemoryBudget budget(16 << 20);
  ReadOptions options;
  options.memory = &budget;
  const auto scene = decode(parts.zip(), options);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(scene.error().where, "a.sog:means_u.webp");
  // With a count that bears it out, the budget of the option ends it.
  parts.meta["count"] = 100'000'000;
  options.max_gaussians = 1'000'000'000;
  parts.files["means_l.webp"] = parts.files["means_u.webp"];
  const auto large = decode(parts.zip(), options);
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().code, ErrorCode::too_large);
  EXPECT_EQ(budget.lent(), 0u);
}

/// A zip file of one file, deflated.
Bytes deflated(const char* name, const std::string& text) {
  const support::TempDir folder;
  const auto path = folder.path() / "a.zip";
  int error = 0;
  zip_t* const archive = zip_open(path.c_str(), ZIP_CREATE, &error);
  const auto index = zip_file_add(archive, name, zip_source_buffer(archive, text.data(), text.size(), 0), 0);
  zip_set_file_compression(archive, zip_uint64_t(index), ZIP_CM_DEFLATE, 9);
  EXPECT_EQ(zip_close(archive), 0);
  return bytes_of(support::read_file(path));
}

TEST(Sog, AFileThatUnpacksToTooMuchIsNotUnpacked) {
  const auto zeros = [](std::size_t size) { return deflated("meta.json", std::string(size, '\0')); };
  const Bytes bomb = zeros(std::size_t(64) << 20);
  EXPECT_LT(bomb.size(), 100'000u);
  const auto scene = decode(bomb);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::too_large);
  EXPECT_EQ(scene.error().where, "a.sog:meta.json");
  // Within what a meta.json may have, the budget counts it.
  EXPECT_EQ(decode(zeros(256 << 10)).error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(decode(zeros((256 << 10) + 1)).error().code, ErrorCode::too_large)
      << "a streamed scene may have a thousand";
  MemoryBudget little(100 << 10);
  ReadOptions options;
  options.memory = &little;
  EXPECT_EQ(decode(zeros(200 << 10), options).error().code, ErrorCode::too_large);
}

TEST(Sog, AZipFileWithinAZipFileIsNoScene) {
  const Bytes inner = Parts::of(random_cloud(3, 0, 35)).zip();
  const auto named = [&](const char* name) { return decode(make_zip(std::vector<NamedFile>{{name, inner}}).value()); };
  const auto other = named("scene.sog"), meta = named("meta.json");
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::unsupported);
  ASSERT_FALSE(meta);
  EXPECT_EQ(meta.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(meta.error().where, "a.sog:meta.json");
}

TEST(Sog, AStreamedSceneMayBeZipped) {
  const Parts parts = Parts::of(random_cloud(20, 1, 40));
  const json lod = {{"lodLevels", 1},
                    {"filenames", {"0_0/meta.json"}},
                    {"tree", {{"lods", {{"0", {{"file", 0}, {"offset", 5}, {"count", 10}}}}}}}};
  std::vector<NamedFile> files{{"lod-meta.json", bytes_of(lod.dump())}, {"0_0/meta.json", bytes_of(parts.meta.dump())}};
  for (const auto& [name, bytes] : parts.files) files.push_back({"0_0/" + name, bytes});
  const Bytes zip = make_zip(files).value();
  json none = lod;
  none["lodLevels"] = 0;
  const auto refused = decode(make_zip(std::vector<NamedFile>{{"lod-meta.json", bytes_of(none.dump())}}).value());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(refused.error().where, "a.sog:lod-meta.json:lodLevels");
  const auto scene = decode(zip), whole = decode(parts.zip());
  ASSERT_TRUE(scene) << scene.error().message << scene.error().where;
  ASSERT_EQ(scene->cloud.size(), 10u);
  EXPECT_EQ(scene->cloud.mean.get(0), whole->cloud.mean.get(5));
  EXPECT_GE(expected_sog_bytes(zip), 10 * cloud_row_bytes(1));
}

struct SogFolder : testing::Test {
  support::TempDir temp;
  std::filesystem::path scene = temp.path() / "scene";

  void write(const Parts& parts, const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    support::write_file(folder / "meta.json", parts.meta.dump());
    for (const auto& [name, bytes] : parts.files)
      support::write_file(folder / name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }
};

TEST_F(SogFolder, MayNotPointOutOfItself) {
  Parts parts = Parts::of(random_cloud(10, 0, 36));
  write(parts, scene);
  ASSERT_TRUE(read_scene(scene));
  std::filesystem::rename(scene / "scales.webp", temp.path() / "scales.webp");
  std::filesystem::create_symlink(temp.path() / "scales.webp", scene / "scales.webp");
  const auto link = read_scene(scene);
  ASSERT_FALSE(link);
  EXPECT_EQ(link.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(link.error().where, "scene:scales.webp");
  std::filesystem::remove(scene / "scales.webp");
  const auto missing = read_scene(scene);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(missing.error().where, "scene:scales.webp");
  parts.meta["scales"]["files"][0] = "../scales.webp";
  write(parts, scene);
  const auto named = read_scene(scene / "meta.json");
  ASSERT_FALSE(named);
  EXPECT_EQ(named.error().where, "scene:meta.json:scales.files[0]");
}

TEST_F(SogFolder, AStreamedOneIsTheRowsOfItsTree) {
  const scene::GaussianCloud fine = random_cloud(40, 1, 37), coarse = random_cloud(7, 0, 38);
  write(Parts::of(fine), scene / "0_0");
  write(Parts::of(coarse), scene / "1_0");
  const auto lod = [](int file, int offset, int count) {
    return json{{"file", file}, {"offset", offset}, {"count", count}};
  };
  json tree = {{"children",
                {{{"lods", {{"0", lod(0, 0, 30)}, {"1", lod(1, 0, 5)}}}},
                 {{"lods", {{"1", lod(1, 5, 2)}}}},
                 {{"lods", {{"0", lod(0, 30, 10)}}}}}}};
  const auto set = [&](const json& with) {
    support::write_file(scene / "lod-meta.json", json{{"lodLevels", 2},
                                                      {"environment", nullptr},
                                                      {"filenames", {"0_0/meta.json", "1_0/meta.json"}},
                                                      {"tree", with}}
                                                     .dump());
  };
  set(tree);
  const auto all = read_scene(scene);
  ASSERT_TRUE(all) << all.error().message << all.error().where;
  const auto part0 = read_scene(scene / "0_0"), part1 = read_scene(scene / "1_0");
  ASSERT_TRUE(part0 && part1);
  ASSERT_EQ(all->cloud.size(), 42u) << "a branch without level 0 gives level 1";
  EXPECT_EQ(all->cloud.sh_degree, 1);
  EXPECT_EQ(all->cloud.mean.get(29), part0->cloud.mean.get(29));
  EXPECT_EQ(all->cloud.mean.get(30), part1->cloud.mean.get(5));
  EXPECT_EQ(all->cloud.sh_row(31)[4], part1->cloud.sh_row(6)[1]);
  EXPECT_EQ(all->cloud.mean.get(41), part0->cloud.mean.get(39));
  const auto coarser = read_scene(scene, {.level = 1});
  ASSERT_TRUE(coarser);
  EXPECT_EQ(coarser->cloud.size(), 5u + 2u + 10u);

  const auto refused = [&](const json& with, ErrorCode code, const std::string& where) {
    set(with);
    const auto read = read_scene(scene);
    ASSERT_FALSE(read) << where;
    EXPECT_EQ(read.error().code, code) << read.error().message;
    EXPECT_EQ(read.error().where, where);
  };
  refused({{"lods", {{"0", lod(0, 30, 11)}}}}, ErrorCode::corrupt_data, "scene:0_0/meta.json");
  refused({{"lods", {{"0", lod(2, 0, 1)}}}}, ErrorCode::corrupt_data, "scene:lod-meta.json:tree.lods.0.file");
  json deep = {{"lods", {{"0", lod(0, 0, 1)}}}};
  for (int depth = 0; depth < 100; ++depth) deep = {{"children", json::array({deep})}};
  set(deep);
  EXPECT_EQ(read_scene(scene).error().code, ErrorCode::corrupt_data);
  json many = json::array();
  for (int k = 0; k < 2000; ++k) many.push_back({{"lods", {{"0", lod(0, 0, 40)}}}});
  set({{"children", many}});
  EXPECT_EQ(read_scene(scene, {.max_gaussians = 50'000}).error().code, ErrorCode::too_large);
}

// Whole files are decoded, and each takes time: what a text of a few kilobytes can ask for is limited before that.
TEST_F(SogFolder, AStreamedOneDecodesNoMoreThanTwiceTheLimit) {
  const auto set = [&](const json& filenames) {
    json children = json::array();
    for (std::size_t k = 0; k < filenames.size(); ++k)
      children.push_back({{"lods", {{"0", {{"file", k}, {"offset", 0}, {"count", 1}}}}}});
    support::write_file(scene / "lod-meta.json",
                        json{{"lodLevels", 1}, {"filenames", filenames}, {"tree", {{"children", children}}}}.dump());
  };
  const Parts parts = Parts::of(random_cloud(40, 0, 42));
  for (const char* name : {"a", "b", "c"}) write(parts, scene / name);
  set({"a/meta.json", "b/meta.json", "c/meta.json"});
  ASSERT_TRUE(read_scene(scene, {.max_gaussians = 60}));
  const auto limited = read_scene(scene, {.max_gaussians = 59});
  ASSERT_FALSE(limited) << "3 rows, of files of 120";
  EXPECT_EQ(limited.error().code, ErrorCode::too_large);
  EXPECT_EQ(limited.error().where, "scene:lod-meta.json:filenames");
  for (const char* again : {"a/meta.json", "a/./meta.json", "a//meta.json"}) {
    set({"a/meta.json", "b/meta.json", again});
    const auto twice = read_scene(scene);
    ASSERT_FALSE(twice) << again;
    EXPECT_EQ(twice.error().code, ErrorCode::corrupt_data);
    EXPECT_EQ(twice.error().where, "scene:lod-meta.json:filenames[2]");
  }
  // One file under many names, as a zip file can have it, too.
  json many = json::array();
  for (int k = 0; k < 1001; ++k) {
    const std::string name = "a/" + std::to_string(k) + ".json";
    std::filesystem::create_hard_link(scene / "a/meta.json", scene / name);
    many.push_back(name);
  }
  set(many);
  const auto named = read_scene(scene);
  ASSERT_FALSE(named);
  EXPECT_EQ(named.error().code, ErrorCode::too_large);
  EXPECT_EQ(named.error().where, "scene:lod-meta.json:filenames");
}

TEST(Sog, TellsWhatItUnpacksToByItsText) {
  const Parts parts = Parts::of(random_cloud(300, 2, 39));
  const Bytes zip = parts.zip();
  EXPECT_GE(expected_sog_bytes(zip), 300 * cloud_row_bytes(2));
  EXPECT_EQ(expected_sog_bytes(std::span(zip).first(100)), 100u);
}

TEST(Sog, TheTreeOfAStreamedSceneTakesNoMoreMemoryThanThereIs) {
  std::string text = R"({"lodLevels": 1, "filenames": ["a/meta.json"], "tree": {"children": [{})";
  for (int k = 0; k < 100'000; ++k) text += ",{}";
  const Bytes bomb = deflated("lod-meta.json", text + "]}}");
  EXPECT_LT(bomb.size(), 5'000u);
  MemoryBudget enough(64 << 20), little(1 << 20);
  EXPECT_EQ(decode(bomb, {.memory = &enough}).error().code, ErrorCode::unprocessable) << "a scene of no Gaussians";
  EXPECT_EQ(decode(bomb, {.memory = &little}).error().code, ErrorCode::too_large);
  // The text fits a budget of which its tree leaves nothing: the scene that it names counts for nothing then.
  const Parts parts = Parts::of(random_cloud(2000, 1, 41));
  const json leaf = {{"lods", {{"0", {{"file", 0}, {"offset", 0}, {"count", 2000}}}}}};
  json children = json::array({leaf});
  for (int k = 0; k < 10'000; ++k) children.push_back(json::object());
  const json lod = {{"lodLevels", 1}, {"filenames", {"a/meta.json"}}, {"tree", {{"children", children}}}};
  const Bytes zip = make_zip(std::vector<NamedFile>{{"lod-meta.json", bytes_of(lod.dump())},
                                                    {"a/meta.json", bytes_of(parts.meta.dump())}})
                        .value();
  EXPECT_EQ(expected_sog_bytes(zip, {.memory = &enough}), 2000 * cloud_row_bytes(1));
  EXPECT_EQ(expected_sog_bytes(zip, {.memory = &little}), zip.size());
  EXPECT_EQ(little.lent(), 0u);
}

}  // namespace
}  // namespace engine::io
