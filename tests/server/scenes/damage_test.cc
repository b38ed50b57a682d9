// What a disk may do to the store: every single damage is named or harmless, none is served, none costs another scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <random>

#include "server/scenes/check.h"
#include "tests/server/scenes/store_support.h"

namespace server::scenes {
namespace {

using engine::scene::random_cloud;

void flip(const fs::path& file, std::size_t bit) {
  std::string bytes = support::read_file(file);
  bytes.at(bit / 8) = char(bytes.at(bit / 8) ^ 1 << bit % 8);
  support::write_file(file, bytes);
}

struct DamageTest : StoreFixture {
  /// A scene with two versions over its base and a dataset.
  std::string add_whole(std::uint64_t seed) {
    const std::string id = add(40, seed);
    const auto cloud = random_cloud(40, 1, seed);
    EXPECT_TRUE(add_version(*store, id, 0, "e00000" + std::to_string(2 * seed), small_edit(cloud)));
    EXPECT_TRUE(add_version(*store, id, 0, "e00000" + std::to_string(2 * seed + 1), small_edit(cloud, 2)));
    write_zip(temp.path() / "data.zip", {{"transforms.json", transforms_json()}, {"images/notes.txt", "of no use"}});
    const auto put = store->put_dataset_zip(id, temp.path() / "data.zip", "data.zip");
    EXPECT_TRUE(put) << put.error().message;
    return id;
  }
  /// Everything a client may get of a scene, by name; an error where there is one.
  std::map<std::string, Result<std::string>> all_of(const std::string& id) {
    std::map<std::string, Result<std::string>> got;
    for (const char* version : {"0", "1", "2"}) {
      const auto file = store->file(id, version, FileFormat::ply);
      got[std::string("file ") + version] =
          file ? Result<std::string>(support::read_file(file->path)) : engine::propagate(file);
      const auto loaded = store->load(id, version);
      got[std::string("load ") + version] = loaded ? Result<std::string>(loaded->key) : engine::propagate(loaded);
    }
    const auto info = store->find(id);
    got["info"] = info ? Result<std::string>(info->name) : engine::propagate(info);
    const auto dataset = store->dataset(id);
    got["dataset"] =
        dataset ? Result<std::string>(std::to_string((*dataset)->views.size())) : engine::propagate(dataset);
    return got;
  }
  void reopen() {
    store.reset();
    open();
  }
};

TEST_F(DamageTest, ABitOfTheBaseIsNamedAndNotServed) {
  const std::string id = add_whole(1);
  reopen();
  const auto whole = store->file(id, "0", FileFormat::ply);
  ASSERT_TRUE(whole);
  const std::string file = "scenes/" + id + "/base.ply";
  flip(whole->path, 8 * fs::file_size(whole->path) - 100);
  for (const auto& [name, got] : all_of(id)) {
    if (name == "info" || name == "dataset") continue;
    ASSERT_FALSE(got) << name;
    EXPECT_EQ(got.error().code, ErrorCode::corrupt_data) << name;
    EXPECT_EQ(got.error().where, file) << name << ": " << got.error().message;
  }
}

TEST_F(DamageTest, OfTwoVersionsThatChangePlacesNeitherIsServed) {
  const std::string id = add_whole(1);
  reopen();
  const fs::path versions = options.folder / id / "versions";
  fs::rename(versions / "1.overlay", versions / "3.overlay");
  fs::rename(versions / "2.overlay", versions / "1.overlay");
  fs::rename(versions / "3.overlay", versions / "2.overlay");
  EXPECT_EQ(store->load(id, "1").error().where, "scenes/" + id + "/versions/1.overlay");
  EXPECT_EQ(store->load(id, "2").error().where, "scenes/" + id + "/versions/2.overlay");
  EXPECT_TRUE(store->load(id, "0"));
}

TEST_F(DamageTest, AWrittenDownloadIsMadeAgain) {
  const std::string id = add_whole(1);
  const auto first = store->file(id, "1", FileFormat::ply);
  ASSERT_TRUE(first);
  const std::string whole = support::read_file(first->path);
  flip(first->path, 8 * (whole.size() - 5));
  const auto second = store->file(id, "1", FileFormat::ply);
  ASSERT_TRUE(second);
  EXPECT_EQ(support::read_file(second->path), whole);
  EXPECT_EQ(second->etag, first->etag);
}

TEST_F(DamageTest, AStoreOfAnEarlierReleaseGetsItsDigestsWhenItIsRead) {
  const std::string id = add_whole(1);
  const fs::path file = options.folder / id / "scene.json";
  auto document = nlohmann::json::parse(support::read_file(file));
  document["manifest"] = 1;
  document.erase("xxh3"), document.erase("base_xxh3"), document["dataset"].erase("xxh3");
  for (auto& version : document["versions"]) version.erase("xxh3");
  support::write_file(file, document.dump());
  fs::remove(options.folder / id / "dataset.1.xxh3");
  support::write_file(options.folder / "next_scene", "2\n");
  reopen();
  ASSERT_TRUE(store->damaged().empty() && store->recovered().empty());
  for (const auto& [name, got] : all_of(id)) EXPECT_TRUE(got) << name << ": " << got.error().message;
  reopen();
  flip(options.folder / id / "versions/1.overlay", 300);
  const auto first = store->load(id, "1");
  ASSERT_FALSE(first);
  EXPECT_EQ(first.error().where, "scenes/" + id + "/versions/1.overlay");
  reopen();  // the base is in memory
  flip(options.folder / id / "base.ply", 8 * 500);
  const auto second = store->load(id, "2");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().where, "scenes/" + id + "/base.ply");
}

TEST_F(DamageTest, TheCounterOfScenesComesBackFromTheScenes) {
  for (const char* damaged : {"", "\n", "abc\n", "3", "-1\n", "0\n", "9 0011\n"}) {
    const std::string id = add(10, 1, 0);
    support::write_file(options.folder / "next_scene", damaged);
    reopen();
    ASSERT_EQ(store->recovered().size(), 1u) << '"' << damaged << '"';
    EXPECT_EQ(store->recovered()[0].where, "scenes/next_scene");
    EXPECT_GT(add(10, 1, 0), id) << '"' << damaged << '"';
  }
}

/// What check_store() names.
std::vector<std::string> damaged_below(const fs::path& folder) {
  const auto checked = check_store(folder);
  if (!checked) return {checked.error().message};
  std::vector<std::string> places;
  for (const auto& damage : checked->damaged) places.push_back(damage.where);
  return places;
}

TEST_F(DamageTest, CheckNamesEveryFileThatIsDamagedOrGone) {
  const std::string id = add_whole(1);
  EXPECT_EQ(check_store(options.folder).error().code, ErrorCode::conflict) << "the store is at work";
  store.reset();
  EXPECT_TRUE(damaged_below(options.folder).empty());
  EXPECT_EQ(check_store(options.folder)->files, 8u) << "manifest, base, 2 versions, a list and its 2 files, counter";
  for (const char* name : {"base.ply", "versions/1.overlay", "versions/2.overlay", "dataset.1.xxh3",
                           "dataset.1/transforms.json", "dataset.1/images/notes.txt"}) {
    const fs::path file = options.folder / id / name;
    const std::string whole = support::read_file(file);
    const std::vector<std::string> place{"scenes/" + id + "/" + name};
    flip(file, 4 * whole.size());
    EXPECT_EQ(damaged_below(options.folder), place);
    fs::remove(file);
    EXPECT_EQ(damaged_below(options.folder), place);
    support::write_file(file, whole);
  }
  fs::remove(options.folder / id / "scene.json");
  EXPECT_EQ(damaged_below(options.folder), std::vector<std::string>{"scenes/" + id + "/scene.json"});
  support::write_file(options.folder / "next_scene", "");
  EXPECT_EQ(damaged_below(options.folder).back(), "scenes/next_scene");
  EXPECT_TRUE(damaged_below(temp.path() / "nothing").empty());
}

TEST_F(DamageTest, IsNamedOrHarmlessWhereverItIs) {
  const std::string victim = add_whole(1), other = add_whole(2);
  reopen();
  const auto before = all_of(victim), others = all_of(other);
  for (const auto& [name, got] : before) ASSERT_TRUE(got) << name << ": " << got.error().message;
  store.reset();
  fs::rename(options.folder, temp.path() / "sound");
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(temp.path() / "sound" / victim))
    if (entry.is_regular_file()) files.push_back(entry.path().lexically_relative(temp.path() / "sound"));
  files.emplace_back("next_scene");
  std::ranges::sort(files);
  std::mt19937_64 random(20);
  int named = 0;
  for (int round = 0; round < 200; ++round) {
    const fs::path& file = files[random() % files.size()];
    const bool cut = random() % 4 == 0;
    SCOPED_TRACE("round " + std::to_string(round) + ", " + file.string() + (cut ? ", cut" : ", a bit"));
    store.reset();
    fs::remove_all(options.folder);
    fs::copy(temp.path() / "sound", options.folder, fs::copy_options::recursive);
    const std::size_t size = fs::file_size(options.folder / file);
    if (cut) {
      fs::resize_file(options.folder / file, random() % size);
    } else {
      flip(options.folder / file, random() % (8 * size));
    }

    const auto listed = damaged_below(options.folder);
    EXPECT_EQ(listed.size(), 1u);
    open();
    bool says_so = !store->damaged().empty() || !store->recovered().empty();
    for (const auto& [name, got] : all_of(victim)) {
      const std::string place = "scenes/" + file.generic_string();
      if (got) {
        EXPECT_EQ(*got, *before.at(name)) << name;
      } else if (store->damaged().empty()) {
        EXPECT_EQ(got.error().where, place) << name << ": " << got.error().message;
      }
      says_so |= !got;
    }
    for (const auto& [name, got] : all_of(other)) {
      ASSERT_TRUE(got) << name << ": " << got.error().message;
      EXPECT_EQ(*got, *others.at(name)) << name;
    }
    EXPECT_TRUE(says_so);
    named += says_so ? 1 : 0;
  }
  EXPECT_GT(named, 100);
}

}  // namespace
}  // namespace server::scenes
