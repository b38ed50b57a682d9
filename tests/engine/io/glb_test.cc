#include "engine/io/glb.h"

#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "engine/io/axes.h"
#include "engine/io/checks.h"
#include "engine/io/gzip.h"
#include "engine/io/spz.h"
#include "engine/scene/sh.h"
#include "tests/engine/io/agreement.h"

namespace engine::io {
namespace {

using nlohmann::json;

/// A file in parts, to be changed and put together.
struct Parts {
  json tree;
  std::string binary;

  static Parts of(const scene::GaussianCloud& cloud) {
    const auto bytes = encode_glb(cloud, "a.glb").value();
    std::uint32_t size = 0;
    std::memcpy(&size, bytes.data() + 12, sizeof size);
    const auto* text = reinterpret_cast<const char*>(bytes.data());
    return {json::parse(text + 20, text + 20 + size), std::string(text + 28 + size, text + bytes.size())};
  }
  [[nodiscard]] std::string bytes() const {
    std::string text = tree.dump(), out = "glTF";
    text.resize((text.size() + 3) / 4 * 4, ' ');
    append(out, std::uint32_t(2)), append(out, std::uint32_t(28 + text.size() + binary.size()));
    append(out, std::uint32_t(text.size()));
    out += "JSON" + text;
    append(out, std::uint32_t(binary.size()));
    return out + std::string("BIN\0", 4) + binary;
  }
};

Result<DecodedScene> decode(const Parts& parts, const ReadOptions& options = {}) {
  const std::string bytes = parts.bytes();
  return decode_glb(as_span(bytes), "a.glb", options);
}

double colour(std::span<const float> sh, DVec3 d) {
  std::array<double, 16> basis{};
  scene::sh_basis(3, d.x, d.y, d.z, basis.data());
  double sum = 0;
  for (std::size_t k = 0; k < sh.size(); ++k) sum += basis[k] * double(sh[k]);
  return sum;
}

TEST(Glb, ComesBackToRoundingAndThenToTheByte) {
  for (int degree = 0; degree <= 3; ++degree) {
    const scene::GaussianCloud cloud = random_cloud(200, degree, 41);
    const auto bytes = encode_glb(cloud, "a.glb");
    ASSERT_TRUE(bytes);
    const auto back = decode_glb(*bytes, "a.glb", {});
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(back->cloud.mean, cloud.mean);
    EXPECT_EQ(back->cloud.sh, cloud.sh);
    const Differences most = differences(cloud, back->cloud, in_order(200));
    EXPECT_LE(most.log_scale, 1e-6);
    EXPECT_LE(most.rotation_rad, 1e-3);
    EXPECT_LE(most.opacity, 1e-7);
    EXPECT_EQ(back->origin.axes, "LUF");
    EXPECT_EQ(encode_glb(back->cloud, "a.glb").value(), *bytes);
  }
}

TEST(Glb, IsWhatTheSpecificationSays) {
  const scene::GaussianCloud cloud = random_cloud(5, 1, 42);
  const auto bytes = encode_glb(cloud, "a.glb").value();
  EXPECT_EQ(bytes.size() % 4, 0u);
  const Parts parts = Parts::of(cloud);
  EXPECT_EQ(parts.tree["asset"]["version"], "2.0");
  EXPECT_EQ(parts.tree["extensionsUsed"], json::array({"KHR_gaussian_splatting"}));
  const json& primitive = parts.tree["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 0);
  EXPECT_EQ(primitive["extensions"]["KHR_gaussian_splatting"]["kernel"], "ellipse");
  EXPECT_EQ(primitive["extensions"]["KHR_gaussian_splatting"]["colorSpace"], "srgb_rec709_display");
  for (const char* name :
       {"POSITION", "KHR_gaussian_splatting:ROTATION", "KHR_gaussian_splatting:SCALE", "KHR_gaussian_splatting:OPACITY",
        "KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", "KHR_gaussian_splatting:SH_DEGREE_1_COEF_2"}) {
    ASSERT_TRUE(primitive["attributes"].contains(name)) << name;
    const json& accessor = parts.tree["accessors"][primitive["attributes"][name].get<std::size_t>()];
    EXPECT_EQ(accessor["componentType"], 5126);
    EXPECT_EQ(accessor["count"], 5);
    EXPECT_EQ(parts.tree["bufferViews"][accessor["bufferView"].get<std::size_t>()]["byteOffset"].get<int>() % 4, 0);
  }
  // The scene is upright and looks to +z: what is right and down in our frame is at -x and -y in glTF's.
  EXPECT_EQ(parts.tree["accessors"][0]["min"][0].get<float>(), -scene::bounds(cloud).high.x);
  EXPECT_EQ(parts.tree["accessors"][0]["max"][1].get<float>(), -scene::bounds(cloud).low.y);
  EXPECT_EQ(parts.tree["accessors"][0]["max"][2].get<float>(), scene::bounds(cloud).high.z);
}

TEST(Glb, GaussiansAreWhereTheirNodesPutThem) {
  const scene::GaussianCloud cloud = random_cloud(60, 3, 43);
  Parts parts = Parts::of(cloud);
  const DQuat turn = glm::normalize(DQuat(0.9, 0.2, -0.3, 0.25));
  const DVec3 shift(1, -2, 0.5), above(0, 3, 0);
  const double scale = 2.5;
  parts.tree["scenes"][0]["nodes"] = {1};
  parts.tree["nodes"] = json::array(
      {{{"mesh", 0},
        {"rotation", {turn.x, turn.y, turn.z, turn.w}},
        {"scale", {scale, scale, scale}},
        {"translation", {shift.x, shift.y, shift.z}}},
       {{"children", {0}}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, above.x, above.y, above.z, 1}}}});
  const auto moved = decode(parts);
  ASSERT_TRUE(moved) << moved.error().message;
  const DMat3 to_rdf = rdf_from("LUF");
  const DMat3 r = to_rdf * glm::mat3_cast(turn) * glm::transpose(to_rdf);
  Rng rng(44);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const DVec3 expected = scale * (r * DVec3(cloud.mean.get(i))) + to_rdf * (shift + above);
    EXPECT_LT(glm::length(DVec3(moved->cloud.mean.get(i)) - expected), 1e-5);
    const DMat3 shape = scale * scale * (r * covariance(cloud, i) * glm::transpose(r)),
                found = covariance(moved->cloud, i);
    for (int c = 0; c < 3; ++c)
      EXPECT_LT(glm::length(found[c] - shape[c]), 1e-4 * glm::length(shape[0] + shape[1] + shape[2]));
    const DVec3 d = glm::normalize(DVec3(rng.normal(), rng.normal(), rng.normal()));
    EXPECT_NEAR(colour(moved->cloud.sh_row(i).first(16), r * d), colour(cloud.sh_row(i).first(16), d), 1e-5);
  }
}

TEST(Glb, AMirrorIsFollowedAndAnUnevenScaleRefused) {
  const scene::GaussianCloud cloud = random_cloud(30, 2, 45);
  Parts parts = Parts::of(cloud);
  parts.tree["nodes"][0]["scale"] = {-2, 2, 2};
  const auto mirrored = decode(parts);
  ASSERT_TRUE(mirrored) << mirrored.error().message;
  const DMat3 m(-1, 0, 0, 0, 1, 0, 0, 0, 1);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_LT(glm::length(DVec3(mirrored->cloud.mean.get(i)) - 2.0 * (m * DVec3(cloud.mean.get(i)))), 1e-5);
    const DMat3 shape = 4.0 * (m * covariance(cloud, i) * m), found = covariance(mirrored->cloud, i);
    for (int c = 0; c < 3; ++c)
      EXPECT_LT(glm::length(found[c] - shape[c]), 1e-4 * glm::length(shape[0] + shape[1] + shape[2]));
  }
  for (const json& scale : {json{1, 2, 1}, json{0, 0, 0}, json{1, 1, 1.001}}) {
    parts.tree["nodes"][0]["scale"] = scale;
    const auto refused = decode(parts);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::unsupported);
    EXPECT_EQ(refused.error().where, "a.glb:nodes[0]");
  }
}

TEST(Glb, QuantisedAttributesMeanWhatTheyAreNormalisedTo) {
  Parts parts = Parts::of(random_cloud(1, 0, 46));
  const auto accessor = [&](const char* name) -> json& {
    return parts.tree["accessors"][parts.tree["meshes"][0]["primitives"][0]["attributes"][name].get<std::size_t>()];
  };
  const auto put = [&](const char* name, const std::string& bytes, int type, bool normalized) {
    json& a = accessor(name);
    const json& view = parts.tree["bufferViews"][a["bufferView"].get<std::size_t>()];
    parts.binary.replace(view["byteOffset"].get<std::size_t>(), bytes.size(), bytes);
    a["componentType"] = type;
    if (normalized) a["normalized"] = true;
  };
  put("KHR_gaussian_splatting:OPACITY", std::string("\x33", 1), 5121, true);
  put("KHR_gaussian_splatting:ROTATION", std::string("\x00\x80\x00\x00\x00\x00\x00\x00", 8), 5122, true);
  put("KHR_gaussian_splatting:SCALE", std::string("\xfd\xfe\x02", 3), 5120, false);  // -3, -2, 2: logarithms
  const auto scene = decode(parts);
  ASSERT_TRUE(scene) << scene.error().message;
  EXPECT_NEAR(opacity_of(scene->cloud.opacity_logit[0]), 0.2, 1e-6);
  EXPECT_LT(axes_angle(scene->cloud.rotation.get(0), {0, 1, 0, 0}), 1e-3);
  EXPECT_EQ(scene->cloud.log_scale.get(0), Vec3(-3, -2, 2));
}

/// A file whose Gaussians are an .spz file.
Parts with_spz(std::span<const std::byte> spz) {
  Parts parts;
  parts.binary = std::string(reinterpret_cast<const char*>(spz.data()), spz.size());
  parts.tree = {{"asset", {{"version", "2.0"}}},
                {"extensionsRequired", {"KHR_gaussian_splatting", "KHR_gaussian_splatting_compression_spz_2"}},
                {"nodes", json::array({{{"mesh", 0}}})},
                {"buffers", json::array({{{"byteLength", spz.size()}}})},
                {"bufferViews", json::array({{{"buffer", 0}, {"byteLength", spz.size()}}})}};
  json gaussians;
  gaussians["extensions"]["KHR_gaussian_splatting_compression_spz_2"]["bufferView"] = 0;
  json primitive = {{"mode", 0}, {"attributes", json::object()}};
  primitive["extensions"]["KHR_gaussian_splatting"] = gaussians;
  parts.tree["meshes"] = json::array({{{"primitives", json::array({primitive})}}});
  return parts;
}

// The draft's logarithms show by a sign, which a primitive of large Gaussians alone has not.
TEST(Glb, AFilesScalesAreAllLogarithmsOrNone) {
  Parts parts = Parts::of(random_cloud(2, 0, 57));
  const json& primitive = parts.tree["meshes"][0]["primitives"][0];
  const auto scale = primitive["attributes"]["KHR_gaussian_splatting:SCALE"].get<std::size_t>();
  const json& view = parts.tree["bufferViews"][parts.tree["accessors"][scale]["bufferView"].get<std::size_t>()];
  const std::array<float, 6> scales{0.5f, 1, 2, 0.25f, 3, -1};  // one row each for two primitives
  std::memcpy(parts.binary.data() + view["byteOffset"].get<std::size_t>(), scales.data(), sizeof scales);
  json second = primitive;
  for (auto& [name, index] : second["attributes"].items()) {
    json accessor = parts.tree["accessors"][index.get<std::size_t>()];
    const auto type = accessor["type"].get<std::string>();
    const int components = type == "SCALAR" ? 1 : type == "VEC3" ? 3 : 4;
    accessor["byteOffset"] = components * (accessor["componentType"] == 5126 ? 4 : 1);
    accessor["count"] = 1;
    index = parts.tree["accessors"].size();
    parts.tree["accessors"].push_back(accessor);
  }
  for (const auto& [name, index] : parts.tree["meshes"][0]["primitives"][0]["attributes"].items())
    parts.tree["accessors"][index.get<std::size_t>()]["count"] = 1;
  parts.tree["meshes"][0]["primitives"].push_back(second);
  const auto scene = decode(parts);
  ASSERT_TRUE(scene) << scene.error().message << scene.error().where;
  ASSERT_EQ(scene->cloud.size(), 2u);
  EXPECT_EQ(scene->cloud.log_scale.get(0), Vec3(0.5f, 1, 2));
  EXPECT_EQ(scene->cloud.log_scale.get(1), Vec3(0.25f, 3, -1));
}

TEST(Glb, ReadsAnSpzPart) {
  const scene::GaussianCloud cloud = random_cloud(80, 2, 47);
  for (const int version : {3, 4}) {
    const auto spz = encode_spz(cloud, "a.spz", {.version = version}).value();
    Parts parts = with_spz(spz);
    const auto scene = decode(parts);
    ASSERT_TRUE(scene) << scene.error().message << scene.error().where;
    const auto alone = decode_spz(spz, "a.spz", {});
    EXPECT_EQ(scene->cloud.mean, alone->cloud.mean);
    EXPECT_EQ(scene->cloud.sh, alone->cloud.sh);
    EXPECT_EQ(scene->origin.packing, "SPZ within glTF");
    parts.binary.resize(parts.binary.size() / 2);
    EXPECT_FALSE(decode(parts));
  }
}

TEST(Glb, AnSpzPartIsBelievedAsFarAsItsBytesBearItOut) {
  for (const int version : {3, 4}) {
    const auto spz = encode_spz(random_cloud(80, 3, 54), "a.spz", {.version = version}).value();
    std::vector<std::byte> lies = spz;
    if (version == 3) {
      lies.resize(16 + 80 * 65);
      ASSERT_TRUE(GzipReader(spz).read(lies));
    }
    const std::uint32_t count = 40'000'000;
    std::memcpy(lies.data() + 8, &count, sizeof count);
    if (version == 3) lies = gzip(lies);
    const Parts parts = with_spz(lies);
    const std::string bytes = parts.bytes();
    EXPECT_EQ(expected_glb_bytes(as_span(bytes)), bytes.size());
    const auto scene = decode(parts);
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().code, ErrorCode::corrupt_data);
    EXPECT_EQ(scene.error().where, "a.glb:meshes[0].primitives[0]");
  }
}

TEST(Glb, WhatAnSpzPartSaysBesideItsGaussiansIsKeptOrSaidToBeLeftOut) {
  SpzOptions options{.antialiased = true};
  options.extensions = {{0x12340001, std::vector<std::byte>(18)}, {0xADBE0002, std::vector<std::byte>(12)}};
  const auto spz = encode_spz(random_cloud(3, 1, 58), "a.spz", options).value();
  Parts parts = with_spz(spz);
  for (const int nodes : {1, 2}) {
    parts.tree["nodes"] = json::array();
    for (int k = 0; k < nodes; ++k) parts.tree["nodes"].push_back({{"mesh", 0}});
    const auto scene = decode(parts);
    ASSERT_TRUE(scene) << scene.error().message;
    EXPECT_TRUE(scene->origin.antialiased);
    EXPECT_EQ(scene->origin.left_out, std::vector<std::string>{"extensions of SPZ parts"});
  }
}

TEST(Glb, SpzPartsThatAreCopiedAreCounted) {
  const scene::GaussianCloud cloud = random_cloud(5'000, 3, 55);
  const auto spz = encode_spz(cloud, "a.spz").value();
  Parts parts = with_spz(spz);
  // What unpacking takes is lent besides; a part that is the whole scene needs no more.
  MemoryBudget budget(5'000 * cloud_row_bytes(3) - 1);
  ASSERT_TRUE(decode(parts, {.memory = &budget}));
  parts.tree["nodes"] = json::array({{{"mesh", 0}}, {{"mesh", 0}, {"translation", {0, 0, 7}}}});
  const auto scene = decode(parts);
  ASSERT_TRUE(scene) << scene.error().message;
  const auto alone = decode_spz(spz, "a.spz", {});
  ASSERT_EQ(scene->cloud.size(), 10'000u);
  EXPECT_EQ(scene->cloud.mean.get(17), alone->cloud.mean.get(17));
  EXPECT_EQ(scene->cloud.mean.get(5'017).z, alone->cloud.mean.get(17).z + 7);
  const auto refused = decode(parts, {.memory = &budget});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::too_large);
  EXPECT_EQ(refused.error().where, "a.glb:spz");
  EXPECT_EQ(budget.lent(), 0u);
}

TEST(Glb, SeveralPrimitivesAreOneSceneAndMeshesAreSaidToBeLeftOut) {
  Parts parts = Parts::of(random_cloud(4, 1, 48));
  json triangles = {{"attributes", {{"POSITION", 0}}}, {"mode", 4}};
  parts.tree["meshes"][0]["primitives"].push_back(triangles);
  parts.tree["meshes"].push_back(parts.tree["meshes"][0]);
  parts.tree["nodes"] = json::array({{{"mesh", 0}}, {{"mesh", 1}, {"translation", {0, 0, 7}}}});
  parts.tree["scenes"][0]["nodes"] = {0, 1};
  const auto scene = decode(parts);
  ASSERT_TRUE(scene) << scene.error().message;
  ASSERT_EQ(scene->cloud.size(), 8u);
  EXPECT_EQ(scene->cloud.mean.get(5).z, scene->cloud.mean.get(1).z + 7);
  EXPECT_EQ(scene->origin.left_out, std::vector<std::string>{"meshes of triangles, lines or points"});
}

TEST(Glb, NamesWhatDoesNotFit) {
  const Parts good = Parts::of(random_cloud(6, 1, 49));
  ASSERT_TRUE(decode(good));
  const auto refused = [&](auto&& change, ErrorCode code, const std::string& where) {
    Parts parts = good;
    change(parts);
    const auto scene = decode(parts);
    ASSERT_FALSE(scene) << where;
    EXPECT_EQ(scene.error().code, code) << where << ": " << scene.error().message;
    EXPECT_EQ(scene.error().where, where) << scene.error().message;
  };
  using enum ErrorCode;
  refused([](Parts& p) { p.tree["meshes"][0]["primitives"][0].erase("extensions"); }, unsupported, "a.glb");
  refused([](Parts& p) { p.tree["accessors"][0]["count"] = 1e9; }, corrupt_data, "a.glb:accessors[0]");
  refused([](Parts& p) { p.tree["accessors"][0]["count"] = 5; }, corrupt_data,
          "a.glb:meshes[0].primitives[0].attributes");
  refused([](Parts& p) { p.tree["bufferViews"][0]["byteStride"] = 0; }, corrupt_data, "a.glb:accessors[0]");
  refused([](Parts& p) { p.tree["bufferViews"][0]["byteOffset"] = -4; }, corrupt_data, "a.glb:bufferViews[0]");
  refused([](Parts& p) { p.tree["bufferViews"][2]["byteLength"] = 1e18; }, corrupt_data, "a.glb:bufferViews[2]");
  refused([](Parts& p) { p.tree["accessors"][3]["type"] = "VEC2"; }, corrupt_data, "a.glb:accessors[3]");
  refused([](Parts& p) { p.tree["buffers"][0]["uri"] = "/etc/passwd"; }, unsupported, "a.glb:bufferViews[0]");
  refused([](Parts& p) { p.tree["nodes"][0]["children"] = {0}; }, corrupt_data, "a.glb:nodes[0]");
  refused([](Parts& p) { p.tree["scenes"][0]["nodes"] = {0, 0}; }, corrupt_data, "a.glb:nodes[0]");
  refused([](Parts& p) { p.tree["nodes"] = {{{"children", {1, 1}}}, {{"mesh", 0}}}; }, corrupt_data, "a.glb:nodes[1]");
  refused([](Parts& p) { p.tree["scenes"][0]["nodes"] = {9}; }, corrupt_data, "a.glb:scenes[0].nodes[0]");
  refused([](Parts& p) { p.tree["extensionsRequired"] = {"KHR_draco_mesh_compression"}; }, unsupported,
          "a.glb:extensionsRequired[0]");
  refused(
      [](Parts& p) { p.tree["meshes"][0]["primitives"][0]["extensions"]["KHR_gaussian_splatting"]["kernel"] = "cube"; },
      unsupported, "a.glb:meshes[0].primitives[0].extensions.KHR_gaussian_splatting.kernel");
  refused(
      [](Parts& p) {
        p.tree["meshes"][0]["primitives"][0]["attributes"].erase("KHR_gaussian_splatting:SH_DEGREE_1_COEF_1");
      },
      corrupt_data, "a.glb:meshes[0].primitives[0].attributes");
  refused(
      [](Parts& p) {
        p.binary.replace(p.tree["bufferViews"][4]["byteOffset"].get<std::size_t>(), 4, "\x00\x00\x40\x40", 4);
      },
      corrupt_data, "a.glb:vertex[0].opacity");
}

TEST(Glb, NaNIsNamedAndZeroIsSmallOrNoTurn) {
  const Parts good = Parts::of(random_cloud(6, 0, 56));
  const auto with = [&](const char* name, std::size_t row, std::size_t channels, float value) {
    Parts parts = good;
    const json& accessor =
        parts.tree["accessors"]
                  [parts.tree["meshes"][0]["primitives"][0]["attributes"][std::string("KHR_gaussian_splatting:") + name]
                       .get<std::size_t>()];
    const json& view = parts.tree["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    for (std::size_t c = 0; c < channels; ++c)
      std::memcpy(parts.binary.data() + view["byteOffset"].get<std::size_t>() + 4 * (channels * row + c), &value, 4);
    return decode(parts);
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto refused = [](const Result<DecodedScene>& scene, const std::string& where) {
    ASSERT_FALSE(scene) << where;
    EXPECT_EQ(scene.error().code, ErrorCode::corrupt_data);
    EXPECT_EQ(scene.error().where, where);
  };
  refused(with("SCALE", 3, 3, nan), "a.glb:vertex[3].scale_0");
  refused(with("ROTATION", 4, 4, nan), "a.glb:vertex[4].rot_0");
  refused(with("SH_DEGREE_0_COEF_0", 5, 3, nan), "a.glb:vertex[5].f_dc_0");
  const auto scale = with("SCALE", 3, 3, 0), rotation = with("ROTATION", 4, 4, 0);
  ASSERT_TRUE(scale && rotation);
  EXPECT_EQ(scale->cloud.log_scale.get(3), Vec3(-20));
  EXPECT_LT(axes_angle(rotation->cloud.rotation.get(4), {1, 0, 0, 0}), 1e-3);
}

// Views may overlap: that is how attributes share data. What is read of them is counted by accessors, not by bytes.
TEST(Glb, ViewsThatOverlapCostNoMoreThanTheLimitAllows) {
  Parts parts = Parts::of(random_cloud(1000, 3, 50));
  for (json& view : parts.tree["bufferViews"]) view["byteOffset"] = 0, view["byteLength"] = 16000;
  const auto overlapping = decode(parts);
  ASSERT_FALSE(overlapping) << "positions are no opacities";
  EXPECT_EQ(overlapping.error().code, ErrorCode::corrupt_data);
  // One small mesh, in a thousand nodes.
  Parts many = Parts::of(random_cloud(1000, 3, 51));
  for (int k = 1; k < 1000; ++k) {
    many.tree["nodes"].push_back({{"mesh", 0}});
    many.tree["scenes"][0]["nodes"].push_back(k);
  }
  EXPECT_EQ(decode(many, {.max_memory_bytes = 100 << 20}).error().code, ErrorCode::too_large);
  const std::string bytes = many.bytes();
  EXPECT_EQ(expected_glb_bytes(as_span(bytes)), 1'000'000 * cloud_row_bytes(3));
}

// A mesh may be in many nodes: what they name together is limited as it is counted, not once all of it is listed.
TEST(Glb, PrimitivesOfManyNodesAreCountedAsTheyAreFound) {
  const auto in_nodes = [](Parts parts, int nodes) {
    parts.tree["nodes"] = json::array(), parts.tree["scenes"][0]["nodes"] = json::array();
    for (int k = 0; k < nodes; ++k) {
      parts.tree["nodes"].push_back({{"mesh", 0}});
      parts.tree["scenes"][0]["nodes"].push_back(k);
    }
    return parts;
  };
  const Parts one = Parts::of(random_cloud(1, 0, 53));
  ASSERT_TRUE(decode(in_nodes(one, 10'000)));
  const auto refused = [&](const Parts& parts, const std::string& where, const ReadOptions& options = {}) {
    const auto scene = decode(parts, options);
    ASSERT_FALSE(scene) << where;
    EXPECT_EQ(scene.error().code, ErrorCode::too_large) << scene.error().message;
    EXPECT_EQ(scene.error().where, where) << scene.error().message;
  };
  refused(in_nodes(one, 10'001), "a.glb:nodes[10000]");
  // The 101st node is broken: the Gaussians of the hundred before it are too many already.
  Parts broken = in_nodes(one, 101);
  broken.tree["nodes"][100]["mesh"] = 7;
  EXPECT_EQ(decode(broken).error().code, ErrorCode::corrupt_data);
  refused(broken, "a.glb:header", {.max_gaussians = 99});
  Parts triangles = one;
  triangles.tree["meshes"][0]["primitives"] = json::array();
  for (int k = 0; k < 2'000; ++k) triangles.tree["meshes"][0]["primitives"].push_back({{"mode", 4}});
  refused(in_nodes(triangles, 600), "a.glb:nodes[500]");
}

// JSON takes 50 times its size as a tree: it is counted, also where only the size of the scene is asked for.
TEST(Glb, JsonTakesNoMoreMemoryThanThereIs) {
  Parts parts = Parts::of(random_cloud(1000, 0, 52));
  parts.tree["nodes"] = json::array({{{"mesh", 0}}, {{"mesh", 0}}, {{"mesh", 0}}});
  parts.tree["scenes"][0]["nodes"] = {0, 1, 2};
  parts.tree["extras"] = json::array();
  for (int k = 0; k < 10'000; ++k) parts.tree["extras"].push_back(json::object());
  const std::string bytes = parts.bytes();
  MemoryBudget enough(8 << 20), little(1 << 20);
  EXPECT_EQ(expected_glb_bytes(as_span(bytes), {.memory = &enough}), 3000 * cloud_row_bytes(0));
  EXPECT_EQ(expected_glb_bytes(as_span(bytes), {.memory = &little}), bytes.size());
  EXPECT_EQ(little.lent(), 0u);
  const auto scene = decode(parts, {.memory = &little});
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::too_large);

  parts.tree["extras"] = std::string(std::size_t(16) << 20, ' ');
  const auto large = decode(parts);
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().code, ErrorCode::too_large);
  EXPECT_EQ(large.error().where, "a.glb:json");
}

}  // namespace
}  // namespace engine::io
