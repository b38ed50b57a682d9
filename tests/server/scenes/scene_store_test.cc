#include "server/scenes/scene_store.h"

#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <limits>
#include <set>
#include <thread>

#include "engine/io/spz.h"
#include "tests/server/scenes/store_support.h"
#include "tests/support/full_disk.h"

namespace {
std::atomic<bool> folders_cannot_be_synced = false;
}

/// Stands in for the C library's in this program, so that a test can let it fail where no limit of the system would.
extern "C" int fsync(int file) {
  struct stat about {};
  if (folders_cannot_be_synced && ::fstat(file, &about) == 0 && S_ISDIR(about.st_mode)) {
    errno = EIO;
    return -1;
  }
  return int(::syscall(SYS_fsync, file));
}

namespace server::scenes {
namespace {

using engine::io::SceneFormat;
using engine::scene::random_cloud;
using SceneStoreTest = StoreFixture;

std::vector<std::string> entries(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  return names;
}

TEST_F(SceneStoreTest, TakesUploadsOfEveryFormat) {
  const auto cloud = random_cloud(40, 2, 3);
  for (const auto& [format, name] : engine::names<SceneFormat>) {
    write(temp.path() / "in", cloud, format);
    const auto added = store->add_upload(temp.path() / "in", "my chair.bin", "");
    ASSERT_TRUE(added) << name << ": " << added.error().message;
    EXPECT_EQ(added->format, name);
    EXPECT_EQ(added->name, "my chair");
    EXPECT_EQ(added->versions.size(), 1u);
    EXPECT_EQ(added->versions[0].gaussians, 40u);
    EXPECT_EQ(cloud_of(added->id, "0").size(), 40u);
    EXPECT_GT(added->radius, 0.5);
    EXPECT_LT(added->low.x, added->centre.x);
  }
  EXPECT_EQ(store->list().size(), engine::names<SceneFormat>.size());
}

TEST_F(SceneStoreTest, RefusesGarbageAndKeepsNothingOfIt) {
  support::write_file(temp.path() / "in", "this is no scene");
  const auto added = store->add_upload(temp.path() / "in", "../notes.txt", "notes");
  ASSERT_FALSE(added);
  EXPECT_EQ(added.error().code, ErrorCode::unsupported);
  EXPECT_EQ(added.error().where, "notes.txt");
  EXPECT_TRUE(store->list().empty());
  EXPECT_TRUE(entries(options.folder / ".scratch").empty());
}

TEST_F(SceneStoreTest, RefusesEveryCutFile) {
  write(temp.path() / "whole.ply", random_cloud(3, 0, 1));
  const std::string whole = support::read_file(temp.path() / "whole.ply");
  for (std::size_t size = 0; size < whole.size(); size += 7) {
    support::write_file(temp.path() / "in", whole.substr(0, size));
    const auto added = store->add_upload(temp.path() / "in", "chair.ply", "");
    ASSERT_FALSE(added) << size;
    EXPECT_TRUE(added.error().where.starts_with("chair.ply")) << size << ": " << added.error().where;
  }
  EXPECT_EQ(entries(options.folder).size(), 2u) << "only the lock and the scratch folder";
}

TEST_F(SceneStoreTest, NamesThePlaceOfAPoisonedValue) {
  auto cloud = random_cloud(10, 0, 1);
  write(temp.path() / "in.ply", cloud);
  std::string bytes = support::read_file(temp.path() / "in.ply");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bytes.data() + bytes.size() - 4, &nan, 4);
  support::write_file(temp.path() / "in.ply", bytes);
  const auto added = store->add_upload(temp.path() / "in.ply", "chair.ply", "");
  ASSERT_FALSE(added);
  EXPECT_EQ(added.error().where, "chair.ply:vertex[9].rot_3");
}

TEST_F(SceneStoreTest, CountsIdsUpAndUsesNoneTwice) {
  EXPECT_EQ(add(), "s000001");
  EXPECT_EQ(add(), "s000002");
  ASSERT_TRUE(store->remove("s000002"));
  EXPECT_EQ(add(), "s000003");
  ASSERT_TRUE(store->remove("s000003"));
  open();
  EXPECT_EQ(add(), "s000004");
}

TEST_F(SceneStoreTest, KeepsEverythingAcrossARestart) {
  const std::string id = add(60, 4, 3);
  const auto base = cloud_of(id, "0");
  ASSERT_EQ(add_version(*store, id, 0, "e000001", small_edit(base)).value(), 1);
  ASSERT_TRUE(store->patch(id, {"table", engine::DVec3(0, 0, 1)}));
  const auto before = store->find(id).value();
  const std::string key = store->load(id, "1")->key;
  const auto edited = cloud_of(id, "1");
  open();
  const auto after = store->find(id).value();
  EXPECT_EQ(after.name, "table");
  EXPECT_EQ(after.up, engine::DVec3(0, 0, 1));
  EXPECT_EQ(after.created, before.created);
  EXPECT_EQ(after.disk_bytes, before.disk_bytes);
  EXPECT_EQ(after.memory_bytes, 0u) << "read when it is needed";
  ASSERT_EQ(after.versions.size(), 2u);
  EXPECT_EQ(after.versions[1].parent, 0);
  EXPECT_EQ(after.versions[1].edit, "e000001");
  EXPECT_EQ(store->load(id, "1")->key, key);
  EXPECT_EQ(cloud_of(id, "1"), edited);
  EXPECT_EQ(cloud_of(id, "0"), base);
}

TEST_F(SceneStoreTest, KeepsChainsOfVersionsAsOneOverlayEach) {
  const std::string id = add(30, 5);
  std::vector<GaussianCloud> expected{cloud_of(id, "0")};
  for (int v = 0; v < 4; ++v) {
    const int parent = v == 3 ? 1 : v;  // the last one goes back and takes another way
    const Overlay overlay = small_edit(expected[std::size_t(parent)], 0.5f + float(v));
    expected.push_back(flatten(expected[std::size_t(parent)], overlay));
    ASSERT_EQ(add_version(*store, id, parent, "e" + std::to_string(v), overlay).value(), v + 1);
  }
  for (const bool restarted : {false, true}) {
    if (restarted) open();
    for (int v = 4; v >= 0; --v) {
      SCOPED_TRACE(v);
      EXPECT_EQ(cloud_of(id, std::to_string(v)), expected[std::size_t(v)]);
      const auto loaded = store->load(id, std::to_string(v)).value();
      EXPECT_EQ(loaded.cloud.base->size(), 30u) << "the same form, whatever is in memory";
      EXPECT_EQ(loaded.cloud.overlay == nullptr, v == 0);
      EXPECT_EQ(store->find(id)->versions[std::size_t(v)].gaussians, expected[std::size_t(v)].size());
    }
  }
}

TEST_F(SceneStoreTest, MakesOneVersionForOneEdit) {
  const std::string id = add();
  const Overlay overlay = small_edit(cloud_of(id, "0"));
  EXPECT_EQ(add_version(*store, id, 0, "e000001", overlay).value(), 1);
  EXPECT_EQ(add_version(*store, id, 0, "e000001", overlay).value(), 1);
  open();
  EXPECT_EQ(add_version(*store, id, 0, "e000001", overlay).value(), 1);
  EXPECT_EQ(add_version(*store, id, 0, "e000002", overlay).value(), 2);
}

TEST_F(SceneStoreTest, DeletesAVersionAndNothingOfThoseMadeFromIt) {
  const std::string id = add();
  for (int v = 0; v < 3; ++v)
    ASSERT_EQ(
        *add_version(*store, id, v, "e00000" + std::to_string(v + 1), small_edit(cloud_of(id, std::to_string(v)))),
        v + 1);
  const auto bytes_of = [&](const std::string& version) {
    const auto file = store->file(id, version, FileFormat::ply);
    return file ? support::read_file(file->path) : file.error().message;
  };
  const std::string second = bytes_of("2"), third = bytes_of("3");
  const auto held = store->load(id, "1");
  ASSERT_TRUE(held);
  ASSERT_TRUE(store->remove_version(id, "1"));
  const auto check = [&] {
    const auto gone = store->load(id, "1");
    ASSERT_FALSE(gone);
    EXPECT_EQ(gone.error().code, ErrorCode::not_found);
    EXPECT_EQ(gone.error().where, "version");
    EXPECT_NE(gone.error().message.find("there are 0, 2 to 3"), std::string::npos) << gone.error().message;
    EXPECT_EQ(store->file(id, "1", FileFormat::ply).error().code, ErrorCode::not_found);
    EXPECT_EQ(store->remove_version(id, "1").error().code, ErrorCode::not_found);
    EXPECT_EQ(bytes_of("2"), second);
    EXPECT_EQ(bytes_of("3"), third);
    const SceneInfo info = *store->find(id);
    ASSERT_EQ(info.versions.size(), 3u);
    EXPECT_EQ(info.versions[1].version, 2);
    EXPECT_EQ(info.versions[1].parent, 0) << "the nearest one that is left";
    EXPECT_EQ(info.versions[2].parent, 2);
    EXPECT_EQ(entries(options.folder / id / "versions"), (std::vector<std::string>{"2.overlay", "3.overlay"}));
  };
  check();
  open();
  check();
  EXPECT_GT(held->cloud.size(), 0u) << "whoever holds it keeps it";
  ASSERT_TRUE(store->remove_version(id, "3"));
  open();
  EXPECT_EQ(*add_version(*store, id, 2, "e000009", small_edit(cloud_of(id, "2"))), 4) << "no number is used twice";
}

TEST_F(SceneStoreTest, CallsAVersionByANameThatOutlivesARestart) {
  const std::string id = add();
  ASSERT_TRUE(add_version(*store, id, 0, "e000001", small_edit(cloud_of(id, "0"))));
  const auto renamed = store->rename_version(id, "1", "ball on the right");
  ASSERT_TRUE(renamed) << renamed.error().message;
  EXPECT_EQ(renamed->name, "ball on the right");
  EXPECT_EQ(renamed->edit, "e000001");
  ASSERT_TRUE(store->rename_version(id, "0", "as it came"));
  open();
  EXPECT_EQ(store->find(id)->versions[0].name, "as it came");
  EXPECT_EQ(store->find(id)->versions[1].name, "ball on the right");
  ASSERT_TRUE(store->rename_version(id, "1", ""));
  EXPECT_EQ(store->find_version(id, "1")->name, "");
  EXPECT_EQ(store->rename_version(id, "7", "none").error().code, ErrorCode::not_found);
  EXPECT_EQ(store->rename_version(id, "1", std::string(1000, 'x')).error().where, "name");
}

TEST_F(SceneStoreTest, DeletesNoVersionThatOthersNeedOrThatIsNone) {
  const std::string id = add();
  ASSERT_TRUE(add_version(*store, id, 0, "e000001", small_edit(cloud_of(id, "0"))));
  const auto preview = store->add_preview(id, 0, small_edit(cloud_of(id, "0")));
  ASSERT_TRUE(preview);
  EXPECT_EQ(store->remove_version(id, "0").error().code, ErrorCode::conflict);
  for (const std::string& none :
       {std::string("2"), std::string("01"), std::string("-1"), std::string("all"), preview->version})
    EXPECT_EQ(store->remove_version(id, none).error().code, ErrorCode::not_found) << none;
  EXPECT_EQ(store->remove_version("s000077", "1").error().where, "scene");
  EXPECT_EQ(store->find(id)->versions.size(), 2u);
}

TEST_F(SceneStoreTest, AVersionThatIsDeletedWhileOthersReadItIsThereOrNot) {
  const std::string id = add();
  for (int round = 0; round < 20; ++round) {
    const int version =
        *add_version(*store, id, 0, "e0000" + std::to_string(10 + round), small_edit(cloud_of(id, "0")));
    const std::string name = std::to_string(version);
    open();  // nothing of it is in memory
    std::vector<std::thread> readers;
    for (int reader = 0; reader < 3; ++reader)
      readers.emplace_back([&, reader] {
        const auto loaded = reader == 0 ? store->file(id, name, FileFormat::ply).map([](const auto&) {})
                                        : store->load(id, name).map([](const auto&) {});
        EXPECT_TRUE(loaded || loaded.error().code == ErrorCode::not_found) << loaded.error().message;
      });
    EXPECT_TRUE(store->remove_version(id, name));
    for (std::thread& reader : readers) reader.join();
    EXPECT_EQ(store->load(id, name).error().code, ErrorCode::not_found);
    EXPECT_TRUE(entries(options.folder / id / "versions").empty());
  }
}

TEST_F(SceneStoreTest, WhatAnEditHasMadeIsNoVersionUntilItIsTakenIn) {
  const std::string id = add();
  const auto made = store->make_version(id, 0, "e000001", 1, small_edit(cloud_of(id, "0")));
  ASSERT_TRUE(made);
  EXPECT_EQ(store->find(id)->versions.size(), 1u);
  EXPECT_EQ(store->made_versions(), std::vector<std::string>{"e000001-1"});
  open();  // it waits for as long as it takes
  EXPECT_EQ(store->take_in(id, parse_made_version(to_text(*made)).value()).value(), 1);
  EXPECT_TRUE(store->made_versions().empty());
  EXPECT_EQ(cloud_of(id, "1"), flatten(cloud_of(id, "0"), small_edit(cloud_of(id, "0"))));
  EXPECT_EQ(store->find(id)->versions[1].created, made->version.created);
  ASSERT_TRUE(store->remove_version(id, "1"));
  EXPECT_EQ(store->take_in(id, *made).value(), 1);
  EXPECT_EQ(store->find(id)->versions.size(), 1u) << "what was deleted does not come back";
}

TEST_F(SceneStoreTest, WhatIsTakenInIsThereOnceWhereverThatWasCutShort) {
  const std::string id = add();
  const auto overlay = small_edit(cloud_of(id, "0"));
  const auto made = store->make_version(id, 0, "e000001", 1, overlay);
  fs::create_directories(options.folder / id / "versions");
  fs::create_hard_link(options.folder / ".made/e000001-1", options.folder / id / "versions/1.overlay");
  EXPECT_EQ(store->take_in(id, *made).value(), 1) << "cut short before the manifest was written";
  fs::create_hard_link(options.folder / id / "versions/1.overlay", options.folder / ".made/e000001-1");
  open();
  EXPECT_EQ(store->take_in(id, *made).value(), 1) << "cut short after that";
  EXPECT_TRUE(store->made_versions().empty());
  EXPECT_EQ(store->find(id)->versions.size(), 2u);
  const auto second = store->make_version(id, 0, "e000001", 2, overlay);
  EXPECT_EQ(second->version.version, 1) << "the edit has its version";
  EXPECT_EQ(store->take_in(id, *second).value(), 1);
}

TEST_F(SceneStoreTest, AVersionWhoseParentIsDeletedMeanwhileIsSaidToBeMadeFromTheUpload) {
  const std::string id = add();
  ASSERT_EQ(add_version(*store, id, 0, "e1", small_edit(cloud_of(id, "0"))).value(), 1);
  const auto made = store->make_version(id, 1, "e2", 1, small_edit(cloud_of(id, "1")));
  const auto expected = flatten(cloud_of(id, "1"), small_edit(cloud_of(id, "1")));
  ASSERT_TRUE(store->remove_version(id, "1"));
  EXPECT_EQ(store->take_in(id, *made).value(), 2);
  open();
  EXPECT_EQ(store->find(id)->versions[1].parent, 0);
  EXPECT_EQ(cloud_of(id, "2"), expected);
}

TEST_F(SceneStoreTest, AVersionOfASceneThatIsGoneIsNotTakenIn) {
  const std::string id = add();
  const auto made = store->make_version(id, 0, "e1", 1, small_edit(cloud_of(id, "0")));
  ASSERT_TRUE(store->remove(id));
  EXPECT_EQ(store->take_in(id, *made).error().code, ErrorCode::not_found);
  store->discard_made("e1-1");
  EXPECT_TRUE(store->made_versions().empty());
}

TEST(MadeVersion, ThatMakesNoSenseIsNamed) {
  EXPECT_EQ(parse_made_version("{").error().code, ErrorCode::corrupt_data);
  MadeVersion made;
  made.version.version = 3, made.version.parent = 1;
  made.digest = "0123456789abcdef";
  made.file = "../scene.json";
  EXPECT_EQ(parse_made_version(to_text(made)).error().where, "result:file");
}

TEST_F(SceneStoreTest, NeverKeepsAPoisonedVersion) {
  const std::string id = add();
  Overlay overlay = small_edit(cloud_of(id, "0"));
  overlay.rows.mean.x[0] = std::numeric_limits<float>::infinity();
  EXPECT_EQ(add_version(*store, id, 0, "e1", overlay).error().code, ErrorCode::internal);
  EXPECT_EQ(store->add_preview(id, 0, overlay).error().code, ErrorCode::internal);
  EXPECT_EQ(store->find(id)->versions.size(), 1u);
}

TEST_F(SceneStoreTest, UndoGivesTheInputBackByteForByte) {
  // A column that no Gaussian has, and a comment: what other programs put there.
  write(temp.path() / "in.ply", random_cloud(20, 1, 9));
  std::string bytes = support::read_file(temp.path() / "in.ply");
  bytes.insert(bytes.find("element"), "comment made by a trainer\n");
  support::write_file(temp.path() / "in.ply", bytes);
  const std::string id = store->add_upload(temp.path() / "in.ply", "chair.ply", "")->id;
  const auto base = store->load(id, "0")->cloud.base;
  ASSERT_TRUE(add_version(*store, id, 0, "e1", small_edit(*base)));
  ASSERT_TRUE(add_version(*store, id, 0, "e2", engine::scene::no_change(*base)));
  const auto original = store->file(id, "0", FileFormat::ply);
  ASSERT_TRUE(original);
  EXPECT_EQ(support::read_file(original->path), bytes);
  EXPECT_EQ(original->download_name, "chair.ply");
  const auto edited = store->file(id, "1", FileFormat::ply);
  ASSERT_TRUE(edited) << edited.error().message;
  EXPECT_NE(support::read_file(edited->path), bytes);
  EXPECT_NE(support::read_file(edited->path).find("comment made by a trainer"), std::string::npos);
  EXPECT_EQ(edited->download_name, "chair-v1.ply");
  EXPECT_NE(edited->etag, original->etag);
  const auto unchanged = store->file(id, "2", FileFormat::ply);
  ASSERT_TRUE(unchanged);
  EXPECT_EQ(support::read_file(unchanged->path), bytes);
}

TEST_F(SceneStoreTest, WritesEveryFormatOnDemandAndOnce) {
  const std::string id = add();
  ASSERT_TRUE(add_version(*store, id, 0, "e1", small_edit(cloud_of(id, "0"))));
  for (const auto& [format, name] : engine::names<FileFormat>) {
    const auto file = store->file(id, "1", format);
    ASSERT_TRUE(file) << file.error().message;
    const auto read = engine::io::read_scene(file->path);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->cloud.size(), 50u);
    EXPECT_EQ(read->origin.format, format) << name;
    EXPECT_EQ(store->file(id, "1", format)->path, file->path);
  }
  EXPECT_EQ(entries(options.folder / id / "files").size(), engine::names<FileFormat>.size());
  open();
  EXPECT_FALSE(fs::exists(options.folder / id / "files")) << "a cache does not outlive the service";
}

TEST_F(SceneStoreTest, AnEditedSceneKeepsWhatItsFileSaidBesideItsGaussians) {
  const std::vector<engine::io::SpzExtension> extensions{{0x12340001, std::vector<std::byte>(7)}};
  const auto bytes =
      engine::io::encode_spz(random_cloud(40, 1, 3), "", {.version = 4, .axes = "RFU", .extensions = extensions});
  ASSERT_TRUE(bytes);
  support::write_file(temp.path() / "in", {reinterpret_cast<const char*>(bytes->data()), bytes->size()});
  const auto added = store->add_upload(temp.path() / "in", "chair.spz", "");
  ASSERT_TRUE(added);
  open();  // and a restart in between
  ASSERT_TRUE(add_version(*store, added->id, 0, "e1", small_edit(cloud_of(added->id, "0"))));
  const auto file = store->file(added->id, "1", FileFormat::spz);
  ASSERT_TRUE(file);
  const auto read = engine::io::read_scene(file->path);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->origin.axes, "RFU");
  EXPECT_EQ(read->origin.version, 4);
  EXPECT_EQ(read->origin.spz_extensions, extensions);
}

TEST_F(SceneStoreTest, RemovesWrittenFilesThatNobodyReads) {
  options.file_cache_bytes = 1;
  open();
  const std::string id = add();
  ASSERT_TRUE(add_version(*store, id, 0, "e1", small_edit(cloud_of(id, "0"))));
  {
    const auto ply = store->file(id, "1", FileFormat::ply), splat = store->file(id, "1", FileFormat::splat);
    ASSERT_TRUE(ply && splat);
    EXPECT_TRUE(fs::exists(ply->path) && fs::exists(splat->path)) << "both are held";
  }
  ASSERT_TRUE(store->file(id, "1", FileFormat::spz));
  EXPECT_EQ(entries(options.folder / id / "files").size(), 1u);
}

TEST_F(SceneStoreTest, RemovesWhatACrashLeftBehind) {
  const std::string id = add();
  ASSERT_TRUE(add_version(*store, id, 0, "e1", small_edit(cloud_of(id, "0"))));
  const fs::path folder = options.folder / id;
  store.reset();
  support::write_file(folder / "versions" / "2.overlay", "half of it");
  support::write_file(folder / ".splatdrag-1-0.tmp", "half of it");
  fs::create_directories(folder / "dataset.1" / "images");
  fs::create_directories(options.folder / ".removed-s000008");
  fs::create_directories(options.folder / "s000009");  // removed while somebody still read it
  support::write_file(options.folder / "s000009" / "scene.json.removed", "x");
  fs::create_directories(options.folder / ".scratch" / "3");
  support::write_file(options.folder / "notes.txt", "somebody else's");
  open();
  EXPECT_EQ(entries(folder), (std::vector<std::string>{"base.ply", "scene.json", "versions"}));
  EXPECT_EQ(entries(folder / "versions"), std::vector<std::string>{"1.overlay"});
  EXPECT_FALSE(fs::exists(options.folder / ".removed-s000008"));
  EXPECT_FALSE(fs::exists(options.folder / "s000009"));
  EXPECT_TRUE(entries(options.folder / ".scratch").empty());
  EXPECT_TRUE(fs::exists(options.folder / "notes.txt"));
  EXPECT_EQ(add(), "s000010") << "the number of the scene that was removed is not used again";
}

TEST_F(SceneStoreTest, LeavesADamagedSceneAloneAndSaysSo) {
  const std::string good = add(), bad = add(), gone = add(), half = add();
  ASSERT_TRUE(add_version(*store, half, 0, "e1", small_edit(cloud_of(half, "0"))));
  store.reset();
  fs::remove(options.folder / half / "scene.json");  // as in a backup that was restored in part
  support::write_file(options.folder / bad / "scene.json", "{");
  fs::remove(options.folder / gone / "base.ply");
  open();
  EXPECT_TRUE(store->find(good));
  EXPECT_EQ(store->find(bad).error().code, ErrorCode::not_found);
  ASSERT_EQ(store->damaged().size(), 3u);
  EXPECT_NE(store->damaged()[0].where.find("s00000"), std::string::npos);
  EXPECT_TRUE(fs::exists(options.folder / bad / "base.ply"));
  EXPECT_TRUE(fs::exists(options.folder / half / "base.ply"));
  EXPECT_TRUE(fs::exists(options.folder / half / "versions" / "1.overlay"));
}

TEST_F(SceneStoreTest, IsOneAtATime) {
  const auto second = SceneStore::open(options);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::conflict);
}

TEST_F(SceneStoreTest, IsOneAtATimeEvenIfItsLockFileIsRemoved) {
  fs::remove(options.folder / ".lock");
  const auto second = SceneStore::open(options);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::conflict);
}

TEST_F(SceneStoreTest, DropsWhatNobodyHoldsToStayWithinItsMemory) {
  const std::string first = add(1000, 1), second = add(1000, 2);
  const std::uint64_t one = store->find(first)->memory_bytes;
  ASSERT_GT(one, 0u);
  options.memory_bytes = one + one / 2;
  open();
  ASSERT_TRUE(store->load(first, "0"));
  ASSERT_TRUE(store->load(second, "0"));
  EXPECT_EQ(store->find(first)->memory_bytes, 0u);
  EXPECT_LE(store->usage().memory_bytes, options.memory_bytes);
  const auto held = store->load(second, "0");
  const auto refused = store->load(first, "0");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::busy);
  EXPECT_NE(refused.error().message.find("--scene-memory"), std::string::npos);
}

TEST_F(SceneStoreTest, RefusesAnUploadThatNeverFitsItsMemory) {
  options.memory_bytes = 10'000;
  open();
  write(temp.path() / "in.ply", random_cloud(1000, 3, 1));
  const auto refused = store->add_upload(temp.path() / "in.ply", "big.ply", "");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::too_large);
  EXPECT_EQ(refused.error().where, "big.ply");
  EXPECT_NE(refused.error().message.find("--scene-memory"), std::string::npos);
  EXPECT_TRUE(store->list().empty());
}

TEST_F(SceneStoreTest, ReadsAnUploadOnlyOnceThereIsMemoryForIt) {
  for (const auto& [format, name] : engine::names<SceneFormat>) {
    const std::string first = add(1000, 1, 3);
    options.memory_bytes = 2 * store->find(first)->memory_bytes - 1;
    open();
    const auto held = store->load(first, "0").value();
    write(temp.path() / "in", random_cloud(1000, 3, 2), format);
    const auto refused = store->add_upload(temp.path() / "in", "chair", "");
    ASSERT_EQ(refused.has_value(), format == SceneFormat::splat) << "which keeps no SH, and fits";
    if (!refused) {
      EXPECT_EQ(refused.error().code, ErrorCode::busy) << "it would fit if nobody held the other one";
    }
    EXPECT_LE(store->usage().memory_bytes, options.memory_bytes);
  }
}

TEST_F(SceneStoreTest, CallsItsLimitsByTheirOptions) {
  options.read.max_gaussians = 10;
  open();
  write(temp.path() / "in.ply", random_cloud(11, 0, 1));
  const auto refused = store->add_upload(temp.path() / "in.ply", "a.ply", "");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("--max-gaussians"), std::string::npos) << refused.error().message;
}

TEST_F(SceneStoreTest, TakesAFileByAnyName) {
  write(options.scene_root / "scene", random_cloud(5, 0, 1));
  for (const char* name : {"scene", "upload", "copy", "base.ply", "scene.json", ".scratch"}) {
    write(temp.path() / "in", random_cloud(5, 0, 1));
    const auto added = store->add_upload(temp.path() / "in", name, "");
    EXPECT_TRUE(added) << name << ": " << added.error().message;
  }
  EXPECT_TRUE(store->add_path("scene", ""));
}

TEST_F(SceneStoreTest, CutsALongNameBetweenCharacters) {
  std::string name;
  for (int i = 0; i < 100; ++i) name += "\xc3\xa4\xe2\x82\xac";  // two bytes, then three
  for (const char* more : {"", "a", "bc", "def"}) {
    write(temp.path() / "in", random_cloud(5, 0, 1));
    const auto added = store->add_upload(temp.path() / "in", name + more, "");
    ASSERT_TRUE(added) << added.error().message;
    EXPECT_NE(static_cast<unsigned char>(added->name[0]) & 0xc0, 0x80) << "the rest of a character";
    EXPECT_GT(added->name.size(), 190u);
  }
}

TEST_F(SceneStoreTest, RefusesMoreScenesThanTheLimit) {
  options.max_scenes = 1;
  open();
  add();
  write(temp.path() / "in.ply", random_cloud(5, 0, 1));
  const auto refused = store->add_upload(temp.path() / "in.ply", "b.ply", "");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::too_large);
  EXPECT_NE(refused.error().message.find("--max-scenes"), std::string::npos);
}

TEST_F(SceneStoreTest, StoresNoMoreForSomebodyThanTheyMay) {
  const auto upload = [&](const Uploader& uploader) {
    write(temp.path() / "up.ply", random_cloud(50, 0, 1));
    return store->add_upload(temp.path() / "up.ply", "chair.ply", "", uploader);
  };
  const auto first = upload({.name = "studio"});
  ASSERT_TRUE(first) << first.error().message;
  const std::uint64_t bytes = first->disk_bytes;
  EXPECT_EQ(first->uploader, "studio");
  EXPECT_EQ(store->bytes_of("studio"), bytes);
  EXPECT_EQ(store->bytes_of("others"), 0u);
  EXPECT_EQ(store->bytes_of(""), 0u);

  const Uploader studio{.name = "studio", .max_bytes = 2 * bytes + 10};
  EXPECT_TRUE(store->check_quota(studio, bytes + 10));
  ASSERT_TRUE(upload(studio));
  const auto refused = upload(studio);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::quota_exceeded);
  EXPECT_EQ(refused.error().where, "bytes");
  EXPECT_NE(refused.error().message.find("studio may store " + std::to_string(2 * bytes + 10)), std::string::npos)
      << refused.error().message;
  EXPECT_FALSE(store->check_quota(studio, 11));
  EXPECT_TRUE(upload({.name = "others", .max_bytes = bytes})) << "everybody has their own";

  // Unpacked datasets count for who brought them in, whosever the scene is; one that is replaced gives way.
  write_zip(temp.path() / "data.zip", {{"transforms.json", transforms_json()}});
  const auto put = [&](const Uploader& uploader) {
    return store->put_dataset_zip(first->id, temp.path() / "data.zip", "data.zip", uploader);
  };
  const auto too_large = put(studio);
  ASSERT_FALSE(too_large);
  EXPECT_EQ(too_large.error().code, ErrorCode::quota_exceeded);
  EXPECT_FALSE(store->find(first->id)->dataset);
  const auto with_dataset = put({.name = "third"});
  ASSERT_TRUE(with_dataset) << with_dataset.error().message;
  const std::uint64_t dataset_bytes = with_dataset->disk_bytes - bytes;
  EXPECT_EQ(store->bytes_of("third"), dataset_bytes);
  EXPECT_EQ(store->bytes_of("studio"), 2 * bytes);
  EXPECT_TRUE(put({.name = "third", .max_bytes = dataset_bytes}));
  EXPECT_FALSE(put({.name = "third", .max_bytes = dataset_bytes - 1}));
  const Uploader full{.name = "third", .max_bytes = dataset_bytes};
  EXPECT_FALSE(store->check_quota(full, 1));
  EXPECT_TRUE(store->check_quota(full, dataset_bytes, first->id)) << "in place of what goes";
  EXPECT_FALSE(store->check_quota(full, dataset_bytes + 1, first->id));
  EXPECT_FALSE(store->check_quota({.name = "studio", .max_bytes = 2 * bytes}, 1, first->id)) << "it is another's";

  open();
  EXPECT_EQ(store->bytes_of("studio"), 2 * bytes) << "it outlives a restart";
  EXPECT_EQ(store->bytes_of("third"), dataset_bytes);
  ASSERT_TRUE(store->remove(first->id));
  EXPECT_EQ(store->bytes_of("third"), 0u);
  EXPECT_TRUE(upload(studio));
}

TEST_F(SceneStoreTest, ManyUploadsAtOnceDoNotPassAQuotaTogether) {
  for (int i = 0; i < 6; ++i) write(temp.path() / ("up" + std::to_string(i) + ".ply"), random_cloud(50, 0, 1));
  const std::uint64_t bytes = fs::file_size(temp.path() / "up0.ply");
  std::atomic<int> taken = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 6; ++i)
    threads.emplace_back([&, i] {
      const auto added = store->add_upload(temp.path() / ("up" + std::to_string(i) + ".ply"), "a.ply", "",
                                           {.name = "studio", .max_bytes = 2 * bytes});
      if (added) ++taken;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(taken, 2);
  EXPECT_EQ(store->list().size(), 2u);
}

TEST_F(SceneStoreTest, SaysWhatThereIsNot) {
  const std::string id = add();
  EXPECT_EQ(store->find("s000099").error().where, "scene");
  EXPECT_EQ(store->remove("../x").error().code, ErrorCode::not_found);
  for (const char* version : {"1", "-1", "00", "+0", "0x", "", "p000001", "p1", "one", "99999999999999999999"}) {
    const auto loaded = store->load(id, version);
    ASSERT_FALSE(loaded) << version;
    EXPECT_EQ(loaded.error().code, ErrorCode::not_found);
    EXPECT_EQ(loaded.error().where, "version");
    EXPECT_FALSE(store->file(id, version, FileFormat::ply));
  }
  EXPECT_EQ(add_version(*store, id, 3, "e1", Overlay{}).error().where, "version");
}

TEST_F(SceneStoreTest, ChangesNameAndUp) {
  const std::string id = add();
  EXPECT_FALSE(store->find(id)->up);
  ASSERT_TRUE(store->patch(id, {std::nullopt, engine::DVec3(0, 2, 0)}));
  EXPECT_EQ(store->find(id)->up, engine::DVec3(0, 2, 0));
  ASSERT_TRUE(store->patch(id, {"stool", std::nullopt}));
  EXPECT_EQ(store->find(id)->up, engine::DVec3(0, 2, 0));
  ASSERT_TRUE(store->patch(id, {std::nullopt, std::optional<engine::DVec3>()}));
  EXPECT_FALSE(store->find(id)->up);
  EXPECT_EQ(store->find(id)->name, "stool");
  EXPECT_EQ(store->patch(id, {"", {}}).error().where, "name");
  EXPECT_EQ(store->patch(id, {"a\nb", {}}).error().where, "name");
  EXPECT_EQ(store->patch(id, {{}, engine::DVec3(0)}).error().where, "up");
}

TEST_F(SceneStoreTest, RemovesASceneButNotFromThoseWhoHoldIt) {
  const std::string id = add();
  ASSERT_TRUE(add_version(*store, id, 0, "e1", small_edit(cloud_of(id, "0"))));
  const auto held = store->load(id, "1").value();
  auto file = store->file(id, "1", FileFormat::ply).value();
  auto original = store->file(id, "0", FileFormat::ply).value();
  ASSERT_TRUE(store->remove(id));
  EXPECT_EQ(store->find(id).error().code, ErrorCode::not_found);
  EXPECT_EQ(store->load(id, "1").error().code, ErrorCode::not_found);
  EXPECT_EQ(engine::scene::flatten(held.cloud).size(), 50u);
  EXPECT_TRUE(fs::exists(file.path) && fs::exists(original.path)) << "somebody downloads them";
  file.hold.reset();
  original.hold.reset();
  EXPECT_FALSE(fs::exists(options.folder / id));
  EXPECT_EQ(store->remove(id).error().code, ErrorCode::not_found);
}

TEST_F(SceneStoreTest, LeavesNothingOfASceneThatIsRemovedWhileItIsRead) {
  for (int round = 0; round < 15; ++round) {
    const std::string id = add(3000, 1, 3);
    open();
    std::thread reader([&] { (void)store->file(id, "0", FileFormat::splat); });
    std::this_thread::sleep_for(std::chrono::milliseconds(round % 4));
    EXPECT_TRUE(store->remove(id));
    reader.join();
    ASSERT_FALSE(fs::exists(options.folder / id)) << round;
    ASSERT_EQ(store->usage().memory_bytes, 0u) << round;
  }
}

TEST_F(SceneStoreTest, ForgetsAPreviewNobodyLooksAt) {
  const std::string id = add(), other = add();
  const auto base = cloud_of(id, "0");
  const auto preview = store->add_preview(id, 0, small_edit(base)).value();
  EXPECT_EQ(preview.version, "p000001");
  EXPECT_EQ(preview.expires, now + options.preview_lifetime);
  EXPECT_EQ(cloud_of(id, "p000001"), flatten(base, small_edit(base)));
  EXPECT_FALSE(store->load(other, "p000001")) << "it is another scene's";
  now += options.preview_lifetime - std::chrono::seconds(1);
  EXPECT_TRUE(store->load(id, "p000001")) << "looking at it puts its end off";
  now += options.preview_lifetime - std::chrono::seconds(1);
  const auto file = store->file(id, "p000001", FileFormat::ply);
  ASSERT_TRUE(file);
  EXPECT_EQ(file->download_name, "chair-p000001.ply");
  EXPECT_EQ(store->usage().previews, 1u);
  now += options.preview_lifetime;
  EXPECT_EQ(store->load(id, "p000001").error().code, ErrorCode::not_found);
  EXPECT_EQ(store->usage().previews, 0u);
}

TEST_F(SceneStoreTest, PreviewsOverAVersionAndKeepsFewOfThem) {
  options.max_previews = 2;
  open();
  const std::string id = add();
  ASSERT_TRUE(add_version(*store, id, 0, "e1", small_edit(cloud_of(id, "0"))));
  const auto parent = cloud_of(id, "1");
  const auto first = store->add_preview(id, 1, small_edit(parent, 3)).value();
  EXPECT_EQ(cloud_of(id, first.version), flatten(parent, small_edit(parent, 3)));
  now += std::chrono::seconds(1);
  const auto second = store->add_preview(id, 1, small_edit(parent)).value();
  now += std::chrono::seconds(1);
  (void)store->load(id, first.version);
  const auto third = store->add_preview(id, 1, small_edit(parent)).value();
  EXPECT_TRUE(store->load(id, first.version));
  EXPECT_FALSE(store->load(id, second.version)) << "the one not looked at for longest makes room";
  EXPECT_TRUE(store->load(id, third.version));
  EXPECT_NE(store->load(id, first.version)->key, store->load(id, third.version)->key);
}

TEST_F(SceneStoreTest, GivesEveryVersionAKeyOfItsOwn) {
  const std::string first = add(), second = add();
  ASSERT_TRUE(add_version(*store, first, 0, "e1", small_edit(cloud_of(first, "0"))));
  std::set<std::string> keys{store->load(first, "0")->key, store->load(first, "1")->key, store->load(second, "0")->key};
  store.reset();
  fs::remove_all(options.folder);
  open();
  keys.insert(store->load(add(), "0")->key);
  EXPECT_EQ(keys.size(), 4u) << "a scene of the same id in a new data folder is another one";
}

TEST_F(SceneStoreTest, GivesOtherKeysUnderAnotherVersionOfTheProgram) {
  const std::string id = add();
  const std::string key = store->load(id, "0")->key, original = store->file(id, "0", FileFormat::ply)->etag,
                    made = store->file(id, "0", FileFormat::spz)->etag;
  options.program_release = "1.2.3";
  open();
  EXPECT_NE(store->load(id, "0")->key, key);
  EXPECT_NE(store->file(id, "0", FileFormat::spz)->etag, made);
  EXPECT_EQ(store->file(id, "0", FileFormat::ply)->etag, original) << "the bytes that were uploaded";
}

TEST_F(SceneStoreTest, OpensFilesBelowTheSceneRootOnly) {
  write(options.scene_root / "table.ply", random_cloud(10, 0, 1));
  const auto added = store->add_path("table.ply", "");
  ASSERT_TRUE(added) << added.error().message;
  EXPECT_EQ(added->name, "table");
  EXPECT_TRUE(fs::exists(options.scene_root / "table.ply")) << "it is copied";
  write(temp.path() / "secret.ply", random_cloud(10, 0, 1));
  EXPECT_EQ(store->add_path("../secret.ply", "").error().where, "path");
  EXPECT_EQ(store->add_path("chair.ply", "").error().code, ErrorCode::not_found);
  EXPECT_EQ(store->add_path(".", "").error().code, ErrorCode::invalid_argument);
}

TEST_F(SceneStoreTest, TellsNobodyWhereItsFoldersAre) {
  fs::create_directories(options.scene_root / "demo");
  support::write_file(options.scene_root / "notes.txt", "x");
  const std::string id = add(100, 1, 1);
  std::vector<engine::Error> errors{store->add_path("demo", "").error(),
                                    store->put_dataset_path(id, "notes.txt").error()};
  for (const engine::Error& error : errors) EXPECT_EQ(error.where, "path");
  fs::remove_all(options.folder / ".scratch");
  support::write_file(options.folder / ".scratch", "no folder");
  errors.push_back(store->scratch().error());
  errors.push_back(store->add_path("notes.txt", "").error());
  fs::remove(options.folder / ".scratch");
  open();
  fs::remove(options.folder / id / "base.ply");
  errors.push_back(store->load(id, "0").error());
  fs::remove_all(options.folder / id);
  errors.push_back(store->patch(id, {"table", {}}).error());
  errors.push_back(store->remove(id).error());
  for (const engine::Error& error : errors) {
    EXPECT_FALSE(error.message.empty());
    for (const std::string& text : {error.message, error.where})
      EXPECT_EQ(text.find(temp.path().string()), std::string::npos) << text;
  }
}

TEST_F(SceneStoreTest, TakesADatasetFromAZipFile) {
  const std::string id = add();
  EXPECT_EQ(store->dataset(id).value(), nullptr);
  for (const char* prefix : {"", "capture/", "a/b/"}) {
    write_zip(temp.path() / "data.zip", {{std::string(prefix) + "transforms.json", transforms_json()}});
    const auto put = store->put_dataset_zip(id, temp.path() / "data.zip", "data.zip");
    ASSERT_TRUE(put) << put.error().message;
    ASSERT_TRUE(put->dataset);
    EXPECT_EQ(put->dataset->kind, "transforms");
    EXPECT_EQ(put->dataset->views, 2u);
    EXPECT_EQ(put->dataset->photos, 0u);
    EXPECT_EQ(store->dataset(id).value()->views.size(), 2u);
  }
  EXPECT_EQ(entries(options.folder / id),
            (std::vector<std::string>{"base.ply", "dataset.3", "dataset.3.xxh3", "scene.json"}));
  EXPECT_EQ(store->find(id)->dataset->number, 3);
  ASSERT_TRUE(store->set_dataset_quality(id, 3, 12.5, 10, "a.png", {"far off"}));
  ASSERT_TRUE(store->set_dataset_quality(id, 2, 30, 20, "b.png", {})) << "about one that has been replaced: dropped";
  open();
  EXPECT_EQ(store->find(id)->dataset->psnr_mean_db, 12.5);
  EXPECT_EQ(store->find(id)->dataset->warnings, std::vector<std::string>{"far off"});
  EXPECT_EQ(store->dataset(id).value()->views[1].camera.name, "images/b.png");
}

TEST_F(SceneStoreTest, KeepsThePhotosOfAReplacedDatasetForThoseWhoReadThem) {
  const std::string id = add();
  write_zip(temp.path() / "data.zip", {{"transforms.json", transforms_json()}});
  ASSERT_TRUE(store->put_dataset_zip(id, temp.path() / "data.zip", "data.zip"));
  auto held = store->dataset(id).value();
  const fs::path folder = held->root;
  ASSERT_TRUE(store->put_dataset_zip(id, temp.path() / "data.zip", "data.zip"));
  EXPECT_TRUE(fs::exists(folder));
  held.reset();
  EXPECT_FALSE(fs::exists(folder));
}

TEST_F(SceneStoreTest, RefusesADatasetAndKeepsTheOneBefore) {
  const std::string id = add();
  write_zip(temp.path() / "good.zip", {{"transforms.json", transforms_json()}});
  ASSERT_TRUE(store->put_dataset_zip(id, temp.path() / "good.zip", "good.zip"));
  write_zip(temp.path() / "bad.zip", {{"readme.txt", "nothing here"}});
  EXPECT_EQ(store->put_dataset_zip(id, temp.path() / "bad.zip", "bad.zip").error().code, ErrorCode::not_found);
  write_zip(temp.path() / "evil.zip", {{"../transforms.json", transforms_json()}});
  EXPECT_EQ(store->put_dataset_zip(id, temp.path() / "evil.zip", "evil.zip").error().where,
            "evil.zip:../transforms.json");
  EXPECT_EQ(store->dataset(id).value()->views.size(), 2u);
  EXPECT_TRUE(entries(options.folder / ".scratch").empty());
}

TEST_F(SceneStoreTest, TakesADatasetBelowTheSceneRoot) {
  const std::string id = add();
  fs::create_directories(options.scene_root / "capture" / "images");
  support::write_file(options.scene_root / "capture" / "transforms.json", transforms_json());
  const auto put = store->put_dataset_path(id, "capture");
  ASSERT_TRUE(put) << put.error().message;
  EXPECT_EQ(put->dataset->views, 2u);
  open();
  EXPECT_EQ(store->dataset(id).value()->views.size(), 2u);
  support::write_file(temp.path() / "a.png", "x");
  fs::create_symlink(temp.path() / "a.png", options.scene_root / "capture" / "images" / "a.png");
  EXPECT_EQ(store->put_dataset_path(id, "capture").error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(store->put_dataset_path(id, "..").error().where, "path");
}

TEST_F(SceneStoreTest, SaysThatTheDiskIsFullAndHarmsNothing) {
  const std::string id = add(200);
  const auto base = cloud_of(id, "0");
  Overlay large = engine::scene::no_change(base);
  for (std::uint32_t i = 0; i < 200; ++i) large.changed.push_back(i);
  engine::scene::append_rows(large.rows, base, large.changed);
  write(options.scene_root / "table.ply", base);
  write_zip(temp.path() / "data.zip", {{"transforms.json", transforms_json() + std::string(9000, ' ')}});
  const auto before = entries(options.folder / id);
  const auto code = [](const auto& result) { return result ? ErrorCode::internal : result.error().code; };
  {
    const support::FullDisk full(6000);
    EXPECT_EQ(code(add_version(*store, id, 0, "e1", large)), ErrorCode::no_space);
    EXPECT_EQ(code(store->add_path("table.ply", "")), ErrorCode::no_space);
    EXPECT_EQ(code(store->put_dataset_zip(id, temp.path() / "data.zip", "data.zip")), ErrorCode::no_space);
    EXPECT_EQ(code(store->file(id, "0", FileFormat::splat)), ErrorCode::no_space);
  }
  {
    const support::FullDisk full(10);
    EXPECT_EQ(code(store->patch(id, {"table", {}})), ErrorCode::no_space);
  }
  EXPECT_TRUE(entries(options.folder / ".scratch").empty());
  EXPECT_EQ(store->find(id)->name, "chair");
  fs::remove(options.folder / id / "files");
  EXPECT_EQ(entries(options.folder / id), before);
  EXPECT_EQ(add_version(*store, id, 0, "e1", large).value(), 1) << "once there is room again";
  open();
  EXPECT_EQ(cloud_of(id, "0"), base);
  EXPECT_EQ(store->list().size(), 1u);
}

/// As long as it lives, no folder of this process can be synced: what was written and renamed may or may not last.
class NoSyncOfFolders {
 public:
  NoSyncOfFolders() { folders_cannot_be_synced = true; }
  ~NoSyncOfFolders() { folders_cannot_be_synced = false; }
  NoSyncOfFolders(const NoSyncOfFolders&) = delete;
  NoSyncOfFolders& operator=(const NoSyncOfFolders&) = delete;
};

TEST_F(SceneStoreTest, AgreesWithItsManifestWhateverBecomesOfAChange) {
  const std::string id = add();
  {
    const NoSyncOfFolders broken;  // the manifest is written and renamed, and then it fails
    const auto changed = store->patch(id, {"table", {}});
    ASSERT_FALSE(changed);
    EXPECT_NE(changed.error().message.find("cannot sync"), std::string::npos) << changed.error().message;
  }
  EXPECT_EQ(store->find(id)->name, "table") << "what its file says, lasting or not";
  open();
  EXPECT_EQ(store->find(id)->name, "table");
}

TEST_F(SceneStoreTest, StaysWholeUnderThreadsThatAddLoadAndRemove) {
  const std::string id = add(200, 1);
  options.memory_bytes = 6 * store->find(id)->memory_bytes;
  open();
  const auto base = cloud_of(id, "0");
  const auto work = [&](unsigned seed) {
    for (unsigned round = 0; round < 6; ++round) {
      const fs::path in = temp.path() / ("in" + std::to_string(seed));
      write(in, random_cloud(200, 1, seed));
      const auto added = store->add_upload(in, "chair.ply", "");
      ASSERT_TRUE(added) << added.error().message;
      const std::string edit = "e" + std::to_string(seed) + "-" + std::to_string(round);
      ASSERT_TRUE(add_version(*store, id, 0, edit, small_edit(base)));
      const auto loaded = store->load(id, std::to_string(1 + round));
      if (loaded) {
        EXPECT_EQ(loaded->cloud.size(), 200u);
      } else {
        EXPECT_EQ(loaded.error().code, ErrorCode::busy);
      }
      (void)store->load(added->id, "0");
      (void)store->add_preview(id, 0, small_edit(base));
      (void)store->file(id, "1", FileFormat::splat);
      (void)store->list();
      (void)store->usage();
      EXPECT_TRUE(store->patch(id, {"name " + edit, {}}));
      EXPECT_TRUE(store->remove(added->id));
    }
  };
  std::thread one(work, 11), two(work, 12);
  one.join();
  two.join();
  EXPECT_EQ(store->list().size(), 1u);
  EXPECT_EQ(store->find(id)->versions.size(), 13u);
  EXPECT_LE(store->usage().memory_bytes, options.memory_bytes);
  EXPECT_EQ(entries(options.folder).size(), 5u)
      << "the lock, the counter, the scratch folder, that of what is made, one scene";
}

TEST_F(SceneStoreTest, TwoThreadsThatPublishOneEditMakeOneVersion) {
  const std::string id = add();
  const Overlay overlay = small_edit(cloud_of(id, "0"));
  std::thread one([&] { EXPECT_EQ(add_version(*store, id, 0, "e1", overlay).value(), 1); });
  std::thread two([&] { EXPECT_EQ(add_version(*store, id, 0, "e1", overlay).value(), 1); });
  one.join();
  two.join();
  EXPECT_EQ(store->find(id)->versions.size(), 2u);
}

}  // namespace
}  // namespace server::scenes
