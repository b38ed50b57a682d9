// One folder of scenes in the hands of several processes: here, of several stores.
#include <thread>

#include "tests/server/scenes/store_support.h"

namespace server::scenes {
namespace {

class SharingTest : public StoreFixture {
 protected:
  SharingTest() {
    store.reset();
    options.sharing = Sharing::shared;
    open();
    store->let_others_in();
    other = join();
  }
  [[nodiscard]] std::unique_ptr<SceneStore> join() const {
    auto opened = SceneStore::open(options);
    if (!opened) throw std::runtime_error(opened.error().message);
    return std::move(*opened);
  }
  [[nodiscard]] Result<SceneInfo> add_to(SceneStore& to, const std::string& name) const {
    const fs::path file = temp.path() / (name + ".ply");
    write(file, engine::scene::random_cloud(20, 0, 1));
    return to.add_upload(file, "chair.ply", name);
  }
  /// What is on its way to become a version, or was when a process was killed.
  [[nodiscard]] fs::path unnamed_overlay(const std::string& id) const {
    const fs::path file = options.folder / id / "versions/7.overlay";
    fs::create_directories(file.parent_path());
    support::write_file(file, "bytes");
    return file;
  }
  std::unique_ptr<SceneStore> other;
};

TEST_F(SharingTest, WhatOneHasDoneTheOtherSees) {
  const std::string id = add();
  EXPECT_EQ(other->find(id)->name, "chair");
  ASSERT_TRUE(other->patch(id, {.name = "seat", .up = {}}));
  EXPECT_EQ(store->find(id)->name, "seat");
  ASSERT_TRUE(store->patch(id, {.name = "sofa", .up = {}})) << "and it is changed from there";
  EXPECT_EQ(other->find(id)->name, "sofa");
  ASSERT_EQ(add_version(*store, id, 0, "e000001", small_edit(cloud_of(id, "0"))).value(), 1);
  EXPECT_EQ(store->load(id, "1")->key, other->load(id, "1")->key) << "entity tags are the same";
  EXPECT_EQ(cloud_of(id, "1"), engine::scene::flatten(other->load(id, "1")->cloud));
  ASSERT_TRUE(other->remove_version(id, "1"));
  EXPECT_EQ(store->load(id, "1").error().code, ErrorCode::not_found);
  ASSERT_TRUE(other->remove(id));
  EXPECT_EQ(store->find(id).error().code, ErrorCode::not_found);
  EXPECT_TRUE(store->list().empty());
  EXPECT_EQ(store->usage().memory_bytes, 0u);
}

TEST_F(SharingTest, WhatSomebodyStoresThroughOneCountsInTheOther) {
  const auto upload = [&](SceneStore& to) {
    write(temp.path() / "up.ply", engine::scene::random_cloud(20, 0, 1));
    return to.add_upload(temp.path() / "up.ply", "chair.ply", "", {.name = "studio", .max_bytes = 3000});
  };
  const auto first = upload(*store);
  ASSERT_TRUE(first) << first.error().message;
  ASSERT_GT(2 * first->disk_bytes, 3000u);
  const auto second = upload(*other);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::quota_exceeded);
  ASSERT_TRUE(other->remove(first->id));
  EXPECT_TRUE(upload(*store));
}

TEST_F(SharingTest, ADatasetIsTheOneThatCameLast) {
  const std::string id = add();
  const auto put = [&](SceneStore& to) {
    write_zip(temp.path() / "data.zip", {{"transforms.json", transforms_json()}});
    return to.put_dataset_zip(id, temp.path() / "data.zip", "data.zip");
  };
  ASSERT_TRUE(put(*store));
  EXPECT_EQ(other->dataset(id).value()->views.size(), 2u);
  ASSERT_TRUE(put(*other));
  EXPECT_EQ(store->find(id)->dataset->number, 2);
  EXPECT_EQ(store->dataset(id).value()->views.size(), 2u);
  EXPECT_FALSE(fs::exists(options.folder / id / "dataset.1"));
  ASSERT_TRUE(store->remove_dataset(id));
  EXPECT_EQ(other->dataset(id).value(), nullptr);
  EXPECT_FALSE(fs::exists(options.folder / id / "dataset.2"));
}

TEST_F(SharingTest, NoNumberIsGivenTwice) {
  constexpr int each = 12;
  std::thread one([&] {
    for (int i = 0; i < each; ++i) EXPECT_TRUE(add_to(*store, "a" + std::to_string(i)));
  });
  for (int i = 0; i < each; ++i) EXPECT_TRUE(add_to(*other, "b" + std::to_string(i)));
  one.join();
  const auto all = store->list();
  EXPECT_EQ(all.size(), 2u * each);
  EXPECT_EQ(all.back().id, "s000024");
  EXPECT_EQ(other->list().size(), all.size());
  ASSERT_TRUE(other->remove("s000024"));
  EXPECT_EQ(add_to(*store, "c")->id, "s000025");
}

TEST_F(SharingTest, NoChangeIsLost) {
  const std::string id = add();
  const auto edit = [&](SceneStore& with, const std::string& letter) {
    for (int i = 0; i < 10; ++i) {
      EXPECT_TRUE(add_version(with, id, 0, letter + std::to_string(i), small_edit(cloud_of(id, "0"))));
      EXPECT_TRUE(with.patch(id, {.name = letter, .up = {}}));
    }
  };
  std::thread one([&] { edit(*store, "x"); });
  edit(*other, "y");
  one.join();
  const auto scene = store->find(id);
  ASSERT_EQ(scene->versions.size(), 21u);
  for (const VersionInfo& version : scene->versions)
    EXPECT_TRUE(other->load(id, std::to_string(version.version))) << version.version;
}

TEST_F(SharingTest, WhoComesLaterTouchesNothingThatOthersHaveInWork) {
  const auto scratch = store->scratch();
  ASSERT_TRUE(scratch);
  const std::string id = add();
  const auto file = store->file(id, "0", FileFormat::splat);
  const fs::path overlay = unnamed_overlay(id);
  const auto third = join();
  EXPECT_FALSE(third->is_alone());
  EXPECT_TRUE(fs::exists(scratch->folder()));
  EXPECT_TRUE(fs::exists(file->path));
  EXPECT_TRUE(fs::exists(overlay));
  const auto same = third->file(id, "0", FileFormat::splat);
  EXPECT_EQ(same->etag, file->etag);
  EXPECT_NE(same->path, file->path) << "each goes when its own process lets go of it";
}

TEST_F(SharingTest, TheFirstOfAllPutsThingsInOrder) {
  const fs::path overlay = unnamed_overlay(add());
  store.reset();
  other.reset();
  const auto first = join();
  EXPECT_TRUE(first->is_alone());
  EXPECT_FALSE(fs::exists(overlay));
}

TEST_F(SharingTest, OthersWaitUntilThingsAreInOrder) {
  store.reset();
  other.reset();
  const auto first = join();
  std::thread later([&] { EXPECT_FALSE(join()->is_alone()); });
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  EXPECT_TRUE(first->is_alone());
  first->let_others_in();
  later.join();
}

TEST_F(SharingTest, WhoWantsTheFolderAloneAndWhoSharesItKeepEachOtherOut) {
  StoreOptions alone = options;
  alone.sharing = Sharing::alone;
  EXPECT_EQ(SceneStore::open(alone).error().code, ErrorCode::conflict);
  store.reset();
  other.reset();
  const auto opened = SceneStore::open(alone);
  ASSERT_TRUE(opened);
  EXPECT_EQ(FolderLock::take(options.folder, Sharing::shared, {}).error().code, ErrorCode::conflict);
}

TEST_F(SharingTest, PreviewsOfTwoAreNotCalledTheSame) {
  const std::string id = add();
  const auto here = store->add_preview(id, 0, small_edit(cloud_of(id, "0")));
  const auto there = other->add_preview(id, 0, small_edit(cloud_of(id, "0"), 2));
  EXPECT_NE(here->version, there->version);
  EXPECT_EQ(other->load(id, here->version).error().code, ErrorCode::not_found) << "it is in one memory alone";
}

}  // namespace
}  // namespace server::scenes
