// What a disk may do to the queue: each damage is named or harmless, and none loses a job.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <vector>

#include "engine/jobs/notes.h"
#include "tests/engine/jobs/jobs_support.h"

namespace engine::jobs {
namespace {

namespace fs = std::filesystem;

TEST(Damage, OfAnyFileOfTheQueueIsNamedOrHarmless) {
  // A store as a crash leaves it: half of the jobs in the file, half in its log.
  const support::TempDir alive, sound, damaged;
  std::map<std::string, Job> promised;
  for (const int half : {0, 1}) {
    const auto store = open_store(alive.path());
    const auto queue = open_queue(*store, alive.path());
    for (int i = 6 * half; i < 6 * half + 6; ++i) {
      const std::string text = std::to_string(i), payload = std::string(std::size_t(40 * i), 'p') + text;
      const std::string id = value(queue->submit({.lane = "a" + text, .payload = payload})).job.id;
      if (i % 3 == 0) value(queue->cancel(id));
      promised[id] = value(queue->find(id));
    }
    if (half == 1) fs::copy(alive.path(), sound.path(), fs::copy_options::recursive);
  }
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(sound.path()))
    if (entry.is_regular_file()) files.push_back(entry.path().lexically_relative(sound.path()));
  std::ranges::sort(files);
  ASSERT_GE(files.size(), 14u);

  std::mt19937_64 random(19);
  int named = 0;
  for (int round = 0; round < 200; ++round) {
    const fs::path file =
        round % 2 == 0 ? fs::path(round % 4 == 0 ? "jobs.db" : "jobs.db-wal") : files[random() % files.size()];
    const bool cut = random() % 4 == 0;
    SCOPED_TRACE("round " + std::to_string(round) + ", " + file.string() + (cut ? ", cut" : ", a bit"));
    const fs::path folder = damaged.path() / std::to_string(round);
    fs::copy(sound.path(), folder, fs::copy_options::recursive);
    std::string bytes = support::read_file(folder / file);
    const std::size_t at = random() % (8 * bytes.size());
    if (cut) {
      bytes.resize(at / 8);
    } else {
      bytes[at / 8] = char(bytes[at / 8] ^ 1 << at % 8);
    }
    support::write_file(folder / file, bytes);

    for (const bool rebuilt : {false, true}) {
      if (rebuilt) {
        fs::remove(folder / "jobs.db");
        fs::remove(folder / "jobs.db-wal");
      }
      const auto store = SqliteStore::open({.folder = folder, .must_exist = !rebuilt});
      if (!store) {
        EXPECT_FALSE(rebuilt);
        EXPECT_TRUE(store.error().code == ErrorCode::corrupt_data || store.error().code == ErrorCode::unsupported)
            << store.error().message;
        EXPECT_EQ(store.error().where, (folder / "jobs.db").string());
        ++named;
        continue;  // and everything comes back from the notes
      }
      const auto queue = open_queue(**store, folder);
      named += queue->findings().empty() ? 0 : 1;
      for (const auto& [id, before] : promised) {
        const auto job = queue->find(id);
        if (!job && file == "jobs/" + id + ".job" && rebuilt) continue;  // two losses at once, and said so
        ASSERT_TRUE(job) << id << ": " << job.error().message;
        EXPECT_EQ(job->payload, before.payload) << id;
        EXPECT_EQ(job->lane, before.lane) << id;
        EXPECT_EQ(job->state, before.state) << id;
      }
      EXPECT_EQ(value(queue->list()).size(), promised.size() - (rebuilt && file.extension() == ".job" ? 1 : 0));
      break;
    }
    fs::remove_all(folder);
  }
  EXPECT_GT(named, 100);
}

}  // namespace
}  // namespace engine::jobs
