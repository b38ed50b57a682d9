// One trained scene in the formats of another program (PlayCanvas' splat-transform), and the same in ours.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>

#include "engine/io/axes.h"
#include "engine/io/scene_file.h"
#include "engine/io/zip_archive.h"
#include "tests/engine/io/agreement.h"
#include "tests/support/data.h"

namespace engine::io {
namespace {

namespace fs = std::filesystem;

constexpr double rounding = 2e-6;  // of floats on the way, beside what a format rounds

/// Three components rounded by `step` / 2 each, and the largest from the unit length: it is at least a half, so its own
/// error is at most 3 times theirs, and the angle twice the length of all four.
double rotation_bound(double step) { return 2 * std::sqrt(3.0 + 9.0) * step / 2; }

struct Playbot : testing::Test {
  const fs::path there = support::data_dir() / "scenes" / "playbot";

  SceneFile read(const fs::path& path, const ReadOptions& options = {}) const {
    auto scene = read_scene(path, options);
    EXPECT_TRUE(scene) << path << ": " << scene.error().message << " (" << scene.error().where << ")";
    return scene ? std::move(*scene) : SceneFile{random_cloud(1, 0, 1), inria_layout(0)};
  }
  SceneFile reference() const { return read(there / "playbot_31k.ply"); }
};

double spread(const std::vector<float>& values) {
  const auto [low, high] = std::ranges::minmax(values);
  return double(high) - double(low);
}

/// For each row of `a` one of `b`, each once: the nearest in all attributes among those whose means are within reach.
std::vector<std::uint32_t> matched(const scene::GaussianCloud& a, const scene::GaussianCloud& b,
                                   std::array<double, 3> reach) {
  std::vector<std::uint32_t> by_x = in_order(b.size());
  std::ranges::sort(by_x, {}, [&](std::uint32_t j) { return b.mean.x[j]; });
  std::vector<bool> taken(b.size());
  std::vector<std::uint32_t> order(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Vec3 at = a.mean.get(i);
    auto j = std::ranges::lower_bound(by_x, float(at.x - reach[0]), {}, [&](std::uint32_t k) { return b.mean.x[k]; });
    double best = 1e30;
    std::uint32_t found = std::uint32_t(b.size());
    for (; j != by_x.end() && double(b.mean.x[*j]) <= double(at.x) + reach[0]; ++j) {
      const Vec3 away = b.mean.get(*j) - at, scale = b.log_scale.get(*j) - a.log_scale.get(i);
      if (taken[*j] || std::abs(away.y) > reach[1] || std::abs(away.z) > reach[2]) continue;
      const double distance = double(glm::dot(scale, scale)) +
                              std::pow(opacity_of(b.opacity_logit[*j]) - opacity_of(a.opacity_logit[i]), 2) +
                              std::pow(axes_angle(a.rotation.get(i), b.rotation.get(*j)), 2);
      if (distance < best) best = distance, found = *j;
    }
    EXPECT_LT(found, b.size()) << "nothing near row " << i;
    if (found == b.size()) return in_order(a.size());
    taken[found] = true;
    order[i] = found;
  }
  return order;
}

/// The reference as an .spz file can hold it: what lies outside of its ranges is at their ends.
scene::GaussianCloud within_spz(scene::GaussianCloud cloud) {
  const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
  for (std::size_t k = 0; k < cloud.sh.size(); ++k)
    cloud.sh[k] = k % coefficients == 0 ? std::clamp(cloud.sh[k], -0.5f / 0.15f, 0.5f / 0.15f)
                                        : std::clamp(cloud.sh[k], -1.0f, 127.0f / 128);
  return cloud;
}

void expect_spz(const Differences& most, double sh_step) {
  for (const double mean : most.mean) EXPECT_LE(mean, 0.5 / 4096 + rounding);
  EXPECT_LE(most.log_scale, 0.5 / 16 + rounding);
  EXPECT_LE(most.rotation_rad, rotation_bound(1 / (511 * std::sqrt(2.0))));
  EXPECT_LE(most.opacity, 0.5 / 255 + rounding);
  EXPECT_LE(most.f_dc, 0.5 / 255 / 0.15 + rounding);
  EXPECT_LE(most.sh, sh_step / 2 + rounding);
}

TEST_F(Playbot, GltfIsTheSameToRounding) {
  REQUIRE_SHARED(there);
  const SceneFile ply = reference(), glb = read(there / "playbot_31k.glb");
  ASSERT_EQ(glb.cloud.size(), 31'000u);
  EXPECT_EQ(glb.cloud.mean, ply.cloud.mean);
  EXPECT_EQ(glb.cloud.sh, ply.cloud.sh);
  const Differences most = differences(ply.cloud, glb.cloud, in_order(ply.cloud.size()));
  EXPECT_LE(most.log_scale, rounding);
  EXPECT_LE(most.rotation_rad, rounding);
  EXPECT_LE(most.opacity, rounding);
}

TEST_F(Playbot, SpzAgreesWithinItsBits) {
  REQUIRE_SHARED(there);
  const scene::GaussianCloud ply = within_spz(reference().cloud);
  // The writer keeps 4 of 8 bits of SH beyond degree 1, rounded twice: steps of 16 / 128, and of 1 / 128 before.
  for (const char* name :
       {"playbot_31k.spz", "playbot_31k_v3.spz", "spz-ext/v3_with_trailer.spz", "spz-ext/v4_declares_rub.spz"}) {
    SCOPED_TRACE(name);
    const SceneFile spz = read(there / name);
    ASSERT_EQ(spz.cloud.size(), ply.size());
    expect_spz(differences(ply, spz.cloud, in_order(ply.size())), 17.0 / 128);
  }
  EXPECT_EQ(read(there / "spz-ext/v3_with_trailer.spz").origin.spz_extensions.size(), 1u);
}

// These two have the numbers of the first, byte for byte, and declare other axes for them: what is declared counts, so
// they are the scene as it looks when its numbers are taken so.
TEST_F(Playbot, SpzTakesTheAxesThatAreDeclared) {
  REQUIRE_SHARED(there);
  const SceneFile rub = read(there / "spz-ext/v4_declares_rub.spz");
  for (const auto& [name, axes] :
       {std::pair("spz-ext/v4_declares_rdf.spz", "RDF"), {"spz-ext/v4_declares_rfu.spz", "RFU"}}) {
    const SceneFile other = read(there / name);
    EXPECT_EQ(other.origin.axes, axes);
    scene::GaussianCloud turned = rub.cloud;
    turn(turned, rdf_from(axes) * glm::transpose(rdf_from("RUB")));
    const Differences most = differences(turned, other.cloud, in_order(turned.size()));
    for (const double mean : most.mean) EXPECT_LE(mean, rounding) << axes;
    EXPECT_LE(most.rotation_rad, 2e-3) << axes;  // of acos() near 1, in float
    EXPECT_LE(most.sh, rounding) << axes;
  }
}

TEST_F(Playbot, CompressedPlyAgreesWithinItsBits) {
  REQUIRE_SHARED(there);
  const SceneFile ply = reference(), packed = read(there / "playbot_31k.compressed.ply");
  ASSERT_EQ(packed.cloud.size(), ply.cloud.size());
  // A chunk's range is within the scene's: 11, 10 and 11 bits of that at worst.
  const std::array<double, 3> reach{0.5 * spread(ply.cloud.mean.x) / 2047 + rounding,
                                    0.5 * spread(ply.cloud.mean.y) / 1023 + rounding,
                                    0.5 * spread(ply.cloud.mean.z) / 2047 + rounding};
  const Differences most = differences(ply.cloud, packed.cloud, matched(ply.cloud, packed.cloud, reach));
  double scales = 0, colours = 0;
  for (const auto* axis : {&ply.cloud.log_scale.x, &ply.cloud.log_scale.y, &ply.cloud.log_scale.z})
    scales = std::max(scales, spread(*axis));
  for (std::size_t c = 0; c < 3; ++c) {
    std::vector<float> channel;
    for (std::size_t i = 0; i < ply.cloud.size(); ++i) channel.push_back(ply.cloud.sh_row(i)[9 * c]);
    colours = std::max(colours, spread(channel));
  }
  EXPECT_LE(most.log_scale, 0.5 * scales / 1023 + rounding);
  EXPECT_LE(most.rotation_rad, rotation_bound(std::sqrt(2.0) / 1023));
  EXPECT_LE(most.opacity, 0.5 / 255 + rounding);
  EXPECT_LE(most.f_dc, 0.5 * colours / 255 + rounding);
  EXPECT_LE(most.sh, 0.5 * 8 / 256 + rounding);
}

/// Half of the widest gap between two entries of a codebook: no farther is a value from the nearest one within.
double half_gap(const nlohmann::json& codebook) {
  auto values = codebook.get<std::vector<double>>();
  std::ranges::sort(values);
  double widest = 0;
  for (std::size_t k = 1; k < values.size(); ++k) widest = std::max(widest, values[k] - values[k - 1]);
  return widest / 2;
}

TEST_F(Playbot, SogAgreesWithinItsBitsAndPalettes) {
  REQUIRE_SHARED(there);
  const SceneFile ply = reference(), sog = read(there / "playbot_31k.sog");
  ASSERT_EQ(sog.cloud.size(), ply.cloud.size());
  EXPECT_EQ(sog.origin.version, 2);
  const std::string file = support::read_file(there / "playbot_31k.sog");
  const auto archive = ZipArchive::open(as_span(file), "playbot_31k.sog");
  ASSERT_TRUE(archive);
  const auto text = archive->read("meta.json", 1 << 20, nullptr);
  ASSERT_TRUE(text);
  const auto meta = nlohmann::json::parse(reinterpret_cast<const char*>(text->bytes.data()),
                                          reinterpret_cast<const char*>(text->bytes.data()) + text->bytes.size());
  // A step of the logarithm, n = log(1 + |p|), is 1 + |p| steps of the position; this scene reaches 1.1. The writer
  // cuts where it could round, so that a whole step is lost here, and of rotations and opacity, too.
  std::array<double, 3> reach{};
  for (std::size_t c = 0; c < 3; ++c)
    reach[c] =
        (meta["means"]["maxs"][c].get<double>() - meta["means"]["mins"][c].get<double>()) / 65535 * 2.1 + rounding;
  const auto order = matched(ply.cloud, sog.cloud, reach);
  const Differences most = differences(ply.cloud, sog.cloud, order);
  EXPECT_LE(most.log_scale, half_gap(meta["scales"]["codebook"]) + rounding);
  EXPECT_LE(most.f_dc, half_gap(meta["sh0"]["codebook"]) + rounding);
  EXPECT_LE(most.rotation_rad, rotation_bound(2 * std::sqrt(2.0) / 255));
  EXPECT_LE(most.opacity, 1.0 / 255 + rounding);
  // A palette of 16,384 for 31,000 has no bound by bits; how well it does is a matter of its writer.
  double square = 0;
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t k = 0; k < ply.cloud.sh_stride(); ++k)
      if (k % 9 != 0) square += std::pow(double(ply.cloud.sh_row(i)[k]) - double(sog.cloud.sh_row(order[i])[k]), 2);
  EXPECT_LE(std::sqrt(square / double(24 * order.size())), 0.03);
}

TEST_F(Playbot, AFolderIsReadAsTheBundleIs) {
  REQUIRE_SHARED(there);
  const SceneFile ply = reference();
  for (const char* path : {"streamed/3_0", "streamed/3_0/meta.json"}) {
    const SceneFile folder = read(there / path);  // the level that the other files were made of
    EXPECT_EQ(folder.cloud.mean, ply.cloud.mean) << path;
    EXPECT_EQ(folder.cloud.log_scale, ply.cloud.log_scale) << path;
    EXPECT_EQ(folder.cloud.sh, ply.cloud.sh) << path;
  }
}

TEST_F(Playbot, AStreamedSceneIsItsFinestLevelOrTheOneAskedFor) {
  REQUIRE_SHARED(there);
  const std::vector<std::size_t> counts{500'000, 250'000, 125'000, 31'000, 8'406, 3'000, 1'873};
  for (int level = 0; level < int(counts.size()); ++level) {
    const SceneFile scene = read(there / "streamed", {.level = level});
    EXPECT_EQ(scene.cloud.size(), counts[std::size_t(level)]);
    EXPECT_EQ(scene.origin.left_out.size(), 1u);
  }
  EXPECT_EQ(read(there / "streamed/lod-meta.json", {.level = 3}).cloud.mean, reference().cloud.mean);
  const auto none = read_scene(there / "streamed", {.level = 7});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(none.error().where, "streamed:lod-meta.json:lodLevels");
}

TEST_F(Playbot, CutAnywhereItIsAnErrorWithAnAddress) {
  REQUIRE_SHARED(there);
  MemoryFile file;
  for (const char* name : {"playbot_31k.compressed.ply", "playbot_31k.sog", "playbot_31k.glb", "playbot_31k.spz",
                           "playbot_31k_v3.spz", "spz-ext/v3_with_trailer.spz", "spz-ext/v4_declares_rdf.spz"}) {
    const std::string bytes = support::read_file(there / name);
    Rng rng(7);
    for (int k = 0; k < 300; ++k) {
      // The heads and tails byte by byte, and places in between.
      const std::size_t size = k < 100   ? std::size_t(k)
                               : k < 200 ? bytes.size() - 1 - std::size_t(k - 100)
                                         : std::size_t(rng.below(std::uint32_t(bytes.size())));
      file.set(bytes.substr(0, size));
      const auto scene = read_scene(file.path());
      ASSERT_FALSE(scene) << name << " cut at byte " << size;
      ASSERT_FALSE(scene.error().message.empty());
      ASSERT_FALSE(scene.error().where.empty()) << name << " cut at byte " << size << ": " << scene.error().message;
    }
  }
}

TEST_F(Playbot, WhatWeWriteComesBackWithinItsBitsAndThenToTheByte) {
  REQUIRE_SHARED(there);
  const support::TempDir folder;
  for (const fs::path& source : {there / "playbot_31k.ply", support::data_dir() / "fox" / "point_cloud.ply"}) {
    const SceneFile scene = read(source);
    for (const auto& [format, name] : names<SceneFormat>) {
      SCOPED_TRACE(std::string(name) + " of " + source.filename().string());
      const fs::path first = folder.path() / "first", second = folder.path() / "second";
      const auto written = write_scene(first, scene, format);
      ASSERT_TRUE(written) << written.error().message;
      EXPECT_EQ(*detect_format(first), format);
      const SceneFile back = read(first);
      EXPECT_EQ(back.origin.format, format);
      ASSERT_TRUE(write_scene(second, back, format));
      EXPECT_TRUE(support::read_file(first) == support::read_file(second)) << "a second pass must change nothing";
      ASSERT_EQ(back.cloud.size(), scene.cloud.size());
      const auto order = written_order(scene, format);
      std::vector<std::uint32_t> place(order.size());
      for (std::size_t k = 0; k < order.size(); ++k) place[order[k]] = std::uint32_t(k);
      if (back.cloud.sh_degree != scene.cloud.sh_degree) continue;  // .splat
      const auto& held = format == SceneFormat::spz ? within_spz(scene.cloud) : scene.cloud;
      const Differences most = differences(held, back.cloud, place);
      switch (format) {
        case SceneFormat::ply:
          EXPECT_EQ(back.cloud, scene.cloud);
          break;
        case SceneFormat::spz:
          if (source.filename() == "playbot_31k.ply") expect_spz(most, 2.0 / 128);  // 1 has no byte
          break;
        case SceneFormat::glb:
          EXPECT_EQ(back.cloud.mean, scene.cloud.mean);
          EXPECT_LE(most.log_scale, rounding);
          EXPECT_EQ(most.sh, 0);
          break;
        case SceneFormat::sog:
          // Twice: where two components tie, the neighbour that gives itself again is taken.
          EXPECT_LE(most.rotation_rad, rotation_bound(2 * std::sqrt(2.0) / 255));
          EXPECT_LE(most.opacity, 0.5 / 255 + rounding);
          EXPECT_LE(most.log_scale, 0.1);  // the widest gap of 256 that fit these scenes; most are a tenth of it
          EXPECT_LE(most.f_dc, 0.1);
          EXPECT_LE(most.sh, 0.1);
          break;
        default:
          EXPECT_LE(most.rotation_rad, rotation_bound(2 * std::sqrt(2.0) / 1023));
          EXPECT_LE(most.opacity, 0.5 / 255 + rounding);
          EXPECT_LE(most.sh, 0.5 * 8 / 256 + rounding);
          break;
      }
    }
  }
}

}  // namespace
}  // namespace engine::io
