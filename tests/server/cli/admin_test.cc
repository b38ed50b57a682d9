#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "engine/io/scene_file.h"
#include "engine/jobs/queue.h"
#include "engine/jobs/sqlite_store.h"
#include "server/cli/program.h"
#include "server/scenes/scene_store.h"
#include "tests/engine/scene/random_cloud.h"
#include "tests/support/data.h"

namespace server::cli {
namespace {

namespace fs = std::filesystem;

struct Finished {
  int status = 0;
  std::string out, err;
};

/// A data folder with a scene and an accepted edit.
class AdminTest : public testing::Test {
 protected:
  AdminTest() {
    const auto cloud = engine::scene::random_cloud(20, 0, 1);
    EXPECT_TRUE(
        engine::io::write_scene(data / "up.ply", {cloud, engine::io::inria_layout(0)}, engine::io::SceneFormat::ply));
    const auto store = scenes::SceneStore::open({.folder = data / "scenes", .scene_root = {}});
    EXPECT_TRUE((*store)->add_upload(data / "up.ply", "chair.ply", ""));
    const auto records = engine::jobs::SqliteStore::open({.folder = data / "edits"});
    const auto queue = engine::jobs::Queue::open(**records, {.folder = data / "edits/jobs"});
    EXPECT_TRUE((*queue)->submit({.lane = "s000001", .payload = "request"}));
  }
  [[nodiscard]] Finished admin(const std::string& command) const {
    std::ostringstream out, err;
    Terminal terminal{out, err};
    const std::string folder = data.string();
    const std::vector<const char*> argv{"splatdrag", "admin", command.c_str(), "--data", folder.c_str()};
    const int status = run_program(int(argv.size()), argv.data(), terminal);
    return {status, out.str(), err.str()};
  }

  support::TempDir temp;
  fs::path data = temp.path();
};

constexpr int damaged = 4, unavailable = 12;

TEST_F(AdminTest, CheckIsContentWithWhatIsSound) {
  const auto before = fs::last_write_time(data / "edits/jobs.db");
  const Finished run = admin("check");
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  EXPECT_EQ(run.out, "5 files, 0 damaged, 0 without checksum\n");
  EXPECT_EQ(fs::last_write_time(data / "edits/jobs.db"), before) << "it changes nothing";
}

TEST_F(AdminTest, CheckNamesWhatIsDamaged) {
  for (const char* name : {"scenes/s000001/base.ply", "scenes/s000001/scene.json", "scenes/next_scene", "edits/jobs.db",
                           "edits/jobs/e000001.job"}) {
    const std::string whole = support::read_file(data / name);
    std::string flipped = whole;
    const std::size_t at = std::string(name).ends_with("jobs.db") ? whole.find("request") : whole.size() / 2;
    flipped[at] = char(flipped[at] ^ 4);
    support::write_file(data / name, flipped);
    const Finished run = admin("check");
    EXPECT_EQ(run.status, damaged) << name << ": " << run.out;
    const std::string place = fs::path(name).extension() == ".job" ? "edits/jobs/e000001" : name;
    EXPECT_TRUE(run.out.starts_with(place)) << run.out;
    support::write_file(data / name, whole);
  }
  EXPECT_EQ(admin("check").status, 0);
}

TEST_F(AdminTest, CheckNeedsTheFolderForItself) {
  const auto store = scenes::SceneStore::open({.folder = data / "scenes", .scene_root = {}});
  EXPECT_EQ(admin("check").status, unavailable);
  EXPECT_EQ(admin("rebuild").status, unavailable);
}

TEST_F(AdminTest, RebuildBringsEditsBack) {
  support::write_file(data / "edits/jobs.db", "no store");
  EXPECT_EQ(admin("check").status, damaged);
  const Finished run = admin("rebuild");
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("e000001"), std::string::npos) << run.out;
  EXPECT_EQ(support::read_file(data / "edits/jobs.db.damaged-1"), "no store");
  EXPECT_EQ(admin("check").status, 0);
  const auto records = engine::jobs::SqliteStore::open({.folder = data / "edits"});
  EXPECT_EQ((*records)->find("e000001")->payload, "request");
}

}  // namespace
}  // namespace server::cli
