#include "server/scenes/uploads/scene_root.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>

#include "tests/support/data.h"

namespace server::scenes {
namespace {

namespace fs = std::filesystem;
using engine::ErrorCode;

struct SceneRoot : testing::Test {
  support::TempDir temp;
  fs::path root = fs::canonical(temp.path()) / "root";

  SceneRoot() {
    fs::create_directories(root / "sub");
    fs::create_directories(temp.path() / "rootless");
    support::write_file(root / "sub" / "chair.ply", "x");
    support::write_file(temp.path() / "secret.ply", "x");
    support::write_file(temp.path() / "rootless" / "a.ply", "x");
    fs::create_symlink(temp.path() / "secret.ply", root / "link.ply");
    fs::create_symlink(temp.path(), root / "up");
    fs::create_symlink("sub/chair.ply", root / "inner.ply");
  }
  void expect_refused(const std::string& path, ErrorCode code) {
    const auto found = below_root(root, path);
    ASSERT_FALSE(found) << path;
    EXPECT_EQ(found.error().code, code) << path << ": " << found.error().message;
    EXPECT_EQ(found.error().where, "path");
  }
};

TEST_F(SceneRoot, FindsWhatLiesBelow) {
  EXPECT_EQ(below_root(root, "sub/chair.ply").value(), root / "sub/chair.ply");
  EXPECT_EQ(below_root(root, (root / "sub/chair.ply").string()).value(), root / "sub/chair.ply");
  EXPECT_EQ(below_root(root, "inner.ply").value(), root / "sub/chair.ply");
  EXPECT_EQ(below_root(root, ".").value(), root);
}

TEST_F(SceneRoot, RefusesWhatLeadsOut) {
  for (const char* path : {"../secret.ply", "sub/../../secret.ply", "sub/../sub/chair.ply", "link.ply", "up/secret.ply",
                           "/etc/passwd", "/nowhere/at/all", ""})
    expect_refused(path, ErrorCode::invalid_argument);
  expect_refused((temp.path() / "rootless" / "a.ply").string(), ErrorCode::invalid_argument);
  expect_refused(std::string("sub/chair.ply\0/../x", 19), ErrorCode::invalid_argument);
}

TEST_F(SceneRoot, SaysWhatIsNotThere) { expect_refused("sub/table.ply", ErrorCode::not_found); }

TEST_F(SceneRoot, OpensNothingOutsideWhileFilesAndLinksChangePlaces) {
  support::write_file(temp.path() / "secret.ply", "secret");
  const fs::path spot = root / "spot.ply", file = root / "file", link = root / "link";
  std::atomic<bool> done = false;
  std::thread swaps([&] {
    while (!done) {
      support::write_file(file, "open");
      fs::rename(file, spot);
      fs::create_symlink(temp.path() / "secret.ply", link);
      fs::rename(link, spot);
    }
  });
  int opened = 0, refused = 0;
  // Until both were met: on a busy machine the swaps begin late.
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  for (int i = 0; i < 3000 || ((opened == 0 || refused == 0) && std::chrono::steady_clock::now() < deadline); ++i) {
    const auto found = open_below_root(root, "spot.ply");
    if (!found) {
      EXPECT_EQ(found.error().where, "path");
      ++refused;
      continue;
    }
    char bytes[8] = {};
    EXPECT_GE(::pread(found->get(), bytes, sizeof bytes, 0), 0);
    EXPECT_NE(std::string(bytes), "secret") << i;
    ++opened;
  }
  done = true;
  swaps.join();
  EXPECT_GT(opened, 0);
  EXPECT_GT(refused, 0);
}

TEST_F(SceneRoot, OpensFilesOnly) {
  EXPECT_TRUE(open_below_root(root, "sub/chair.ply"));
  EXPECT_TRUE(open_below_root(root, "inner.ply")) << "a link that stays below";
  EXPECT_EQ(open_below_root(root, "sub").error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(open_below_root(root, "link.ply").error().code, ErrorCode::invalid_argument);
}

TEST_F(SceneRoot, OpensNothingWithoutARoot) {
  const auto found = below_root("", "chair.ply");
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, ErrorCode::invalid_argument);
  EXPECT_NE(found.error().message.find("--scene-root"), std::string::npos);
}

TEST_F(SceneRoot, FindsLinksThatLeadOut) {
  EXPECT_TRUE(check_links(root, root / "sub", 100));
  const auto found = check_links(root, root, 100);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, ErrorCode::invalid_argument);
  support::write_file(root / "sub" / "b.ply", "x");
  EXPECT_EQ(check_links(root, root / "sub", 1).error().code, ErrorCode::too_large);
}

}  // namespace
}  // namespace server::scenes
