#include "server/scenes/catalogue/manifest.h"

#include <nlohmann/json.hpp>

#include "tests/server/scenes/store_support.h"

namespace server::scenes {
namespace {

Manifest full_manifest() {
  Manifest manifest;
  SceneInfo& scene = manifest.scene;
  scene.id = "s000007";
  scene.name = "a \"chair\"\xc3\xa9";
  scene.uploader = "studio";
  scene.created = Time(std::chrono::milliseconds(1'700'000'000'123));
  scene.format = "ply";
  scene.sh_degree = 3;
  scene.low = {-1, -2, -3.5}, scene.high = {1, 2, 0.1}, scene.centre = {0.1, 0.2, 0.3};
  scene.radius = 1.25;
  scene.up = engine::DVec3(0, -1, 0);
  scene.dataset = DatasetInfo{"colmap", 50, 49, 35.5, 20.25, "0001.jpg", {"one"}};
  scene.versions = {{0, std::nullopt, "", "as it came", scene.created, 100, 0},
                    {1, 0, "e000001", "", scene.created, 120, 4096}};
  manifest.nonce = "abc";
  manifest.base = "base.ply";
  manifest.base_disk_bytes = 1, manifest.base_memory_bytes = 2;
  manifest.overlay_memory_bytes = {0, 99};
  manifest.base_digest = "00112233445566ff";
  manifest.overlay_digests = {"", "0123456789abcdef"};
  manifest.dataset = DatasetLocation{"dataset.3/chair", false, 1234, "fedcba9876543210", "other"};
  manifest.next_dataset = 4;
  manifest.next_version = 5;
  return manifest;
}

TEST(Manifest, ComesBackAsItWasWritten) {
  const support::TempDir temp;
  ASSERT_TRUE(write_manifest(temp.path(), full_manifest()));
  const auto read = read_manifest(temp.path());
  ASSERT_TRUE(read) << read.error().message << read.error().where;
  const support::TempDir again;
  ASSERT_TRUE(write_manifest(again.path(), *read));
  EXPECT_EQ(support::read_file(temp.path() / manifest_name), support::read_file(again.path() / manifest_name));
  EXPECT_EQ(read->scene.versions[1].edit, "e000001");
  EXPECT_EQ(read->scene.uploader, "studio");
  EXPECT_EQ(read->dataset->uploader, "other");
  EXPECT_EQ(read->scene.dataset->psnr_mean_db, 35.5);
  EXPECT_EQ(read->scene.up, engine::DVec3(0, -1, 0));
}

/// Every member of a document, as a pointer.
std::vector<nlohmann::json::json_pointer> members(const nlohmann::json& document) {
  std::vector<nlohmann::json::json_pointer> found;
  const nlohmann::json flat = document.flatten();
  for (const auto& member : flat.items()) found.emplace_back(member.key());
  return found;
}

TEST(Manifest, RefusesEveryMissingAndEveryWrongField) {
  const support::TempDir temp;
  ASSERT_TRUE(write_manifest(temp.path(), full_manifest()));
  const auto whole = nlohmann::json::parse(support::read_file(temp.path() / manifest_name));
  std::size_t refused = 0;
  const auto expect_refused = [&](const nlohmann::json& document, const std::string& what) {
    support::write_file(temp.path() / manifest_name, document.dump());
    const auto read = read_manifest(temp.path());
    ASSERT_FALSE(read) << what;
    EXPECT_EQ(read.error().code, ErrorCode::corrupt_data) << what;
    EXPECT_NE(read.error().where.find(manifest_name), std::string::npos) << what;
    ++refused;
  };
  for (const auto& member : members(whole)) {
    nlohmann::json other_type = whole;
    other_type[member] = nlohmann::json::object();
    expect_refused(other_type, member.to_string());
    nlohmann::json removal{{"op", "remove"}, {"path", member.to_string()}};
    const nlohmann::json missing = whole.patch(nlohmann::json::array({removal}));
    if (member.to_string().find("warnings") == std::string::npos) expect_refused(missing, "no " + member.to_string());
  }
  nlohmann::json unknown = whole;
  unknown["dataset"]["colour"] = 1;
  expect_refused(unknown, "unknown field");
  EXPECT_GT(refused, 50u);
}

TEST(Manifest, RefusesPathsThatLeadOut) {
  const support::TempDir temp;
  ASSERT_TRUE(write_manifest(temp.path(), full_manifest()));
  for (const char* path : {"/etc/passwd", "../other/base.ply", ""}) {
    auto document = nlohmann::json::parse(support::read_file(temp.path() / manifest_name));
    document["base"] = path;
    const support::TempDir other;
    support::write_file(other.path() / manifest_name, document.dump());
    EXPECT_FALSE(read_manifest(other.path())) << path;
  }
}

TEST(Manifest, NamesTheFieldAndSurvivesACut) {
  const support::TempDir temp;
  ASSERT_TRUE(write_manifest(temp.path(), full_manifest()));
  const std::string whole = support::read_file(temp.path() / manifest_name);
  for (std::size_t size = 0; size + 2 < whole.size(); ++size) {
    support::write_file(temp.path() / manifest_name, whole.substr(0, size));
    ASSERT_FALSE(read_manifest(temp.path())) << size;
  }
  auto document = nlohmann::json::parse(whole);
  document["versions"][1]["gaussians"] = -1;
  support::write_file(temp.path() / manifest_name, document.dump());
  EXPECT_TRUE(read_manifest(temp.path()).error().where.ends_with("scene.json:versions[1].gaussians"));
}

TEST(Manifest, KnowsItselfByEveryBit) {
  const support::TempDir temp;
  ASSERT_TRUE(write_manifest(temp.path(), full_manifest()));
  const std::string whole = support::read_file(temp.path() / manifest_name);
  for (std::size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    std::string damaged = whole;
    damaged[bit / 8] = char(damaged[bit / 8] ^ 1 << bit % 8);
    support::write_file(temp.path() / manifest_name, damaged);
    const auto read = read_manifest(temp.path());
    ASSERT_FALSE(read) << "bit " << bit << " of \"" << damaged.substr(bit / 8, 20) << '"';
    ASSERT_EQ(read.error().code, ErrorCode::corrupt_data) << bit;
  }
}

/// What releases before checksums wrote.
std::string of_format_1(nlohmann::json document) {
  document["manifest"] = 1;
  document.erase("uploader"), document["dataset"].erase("uploader");
  document.erase("xxh3"), document.erase("base_xxh3"), document["dataset"].erase("xxh3");
  for (auto& version : document["versions"]) version.erase("xxh3");
  return document.dump();
}

TEST(Manifest, OfAnEarlierReleaseHasNoDigests) {
  const support::TempDir temp;
  ASSERT_TRUE(write_manifest(temp.path(), full_manifest()));
  const auto whole = nlohmann::json::parse(support::read_file(temp.path() / manifest_name));
  support::write_file(temp.path() / manifest_name, of_format_1(whole));
  const auto read = read_manifest(temp.path());
  ASSERT_TRUE(read) << read.error().message << read.error().where;
  EXPECT_EQ(read->base_digest, "");
  EXPECT_EQ(read->overlay_digests, (std::vector<std::string>{"", ""}));
  EXPECT_EQ(read->dataset->list_digest, "");
  EXPECT_EQ(read->scene.versions[1].edit, "e000001");
}

TEST(Manifest, SaysThatThereIsNone) {
  const support::TempDir temp;
  EXPECT_EQ(read_manifest(temp.path()).error().code, ErrorCode::not_found);
}

}  // namespace
}  // namespace server::scenes
