// kill -9 at any moment: no accepted edit is lost, its result has the bytes of an undisturbed run, and what was being
// removed is there whole or gone.
//
// Everything that starts threads happens in children: the process that forks has only one.
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>

#include "engine/core/rng.h"
#include "engine/edit/edit.h"
#include "engine/jobs/sqlite_store.h"
#include "server/edits/convert.h"
#include "tests/server/edits/service_support.h"
#include "tests/support/child.h"

namespace server::edits {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr const char* first_edit = "e000001";
constexpr const char* first_scene = "s000001";

using support::Child;

/// The data folder as a service that has just started sees it.
struct Opened {
  explicit Opened(const fs::path& data)
      : store(open_scenes(data)), service(open_service(*store, data, 32, /*attempts=*/0)), folder(data) {
    spdlog::set_level(spdlog::level::warn);
  }
  void expect(bool condition, const char* what) const {
    if (!condition) throw std::runtime_error(what);
  }
  std::unique_ptr<scenes::SceneStore> store;
  std::unique_ptr<EditService> service;
  fs::path folder;
};

/// Seconds of work, so that 20 kills find it at 20 different places.
proto::EditRequest long_edit() {
  proto::EditRequest request = move_ball(first_scene, 20);
  request.params.views = 120;
  request.params.max_image_side = 320;
  return request;
}

void make_scene(const fs::path& data) {
  fs::create_directories(data);
  const Child child([&](const Child&) { (void)add_ball(*open_scenes(data), data); });
  ASSERT_TRUE(child.ended_well());
}

/// Submits the edit, if that has not been done, waits for its end and leaves its result's bytes in a file.
///   at_next  called when it has finished one interval more, and when it has finished two
void carry_out(const fs::path& data, const proto::EditRequest& request, const std::function<void()>& at_next = {}) {
  const Opened opened(data);
  const auto id = value(opened.service->submit(request, "key")).status.id;
  const std::size_t before = value(opened.service->find(id)).finished_intervals.size();
  for (std::size_t more = 1; at_next && more <= 2; ++more) {
    (void)wait_for_interval(*opened.service, id, before + more);
    at_next();
  }
  const auto done = wait_for_end(*opened.service, id);
  opened.expect(done.state == "succeeded", "the edit did not succeed");
  opened.expect(done.warnings.empty(), "the edit had to begin again");
  opened.expect(done.finished_intervals.size() == 20, "an interval is missing");
  for (int u = 1; u <= 20; ++u)
    for (int view = 0; view < 2; ++view)
      for (const char* stage : {"before", "deformed"})
        (void)value(opened.service->interval_picture(id, u, view, stage));
  opened.expect(value(opened.store->find(first_scene)).versions.size() == 2, "not one version more");
  support::write_file(data / "result", version_bytes(*opened.store, first_scene, *done.result_version));
}

int finished_intervals(const fs::path& data) {
  const auto records = value(engine::jobs::SqliteStore::open({.folder = data / "edits", .max_deaths = 0}));
  const auto job = records->find(first_edit);
  return job ? job->finished_intervals : 0;
}

TEST(EditKill, AtTwentyMomentsChangesNoByteOfTheResult) {
  const support::TempDir dir;
  const fs::path calm = dir.path() / "calm", rough = dir.path() / "rough";
  make_scene(calm);
  make_scene(rough);
  const Child undisturbed([&](const Child&) { carry_out(calm, long_edit()); });
  ASSERT_TRUE(undisturbed.ended_well());

  constexpr int kills = 20;
  engine::Rng rng(2026);
  using std::chrono::microseconds, std::chrono::steady_clock;
  microseconds interval = 1min;  // the shortest so far: the machine may be slow now and then
  int killed = 0, resumed = 0, finished = 0;
  for (int round = 0; round < kills; ++round) {
    SCOPED_TRACE(round);
    const Child child([&](const Child& self) { carry_out(rough, long_edit(), [&] { self.say('i'); }); });
    // It has an interval for each round. Behind that, its time begins only once it has made some way.
    if (finished <= round) {
      ASSERT_EQ(child.hear(), 'i');
      const auto next = steady_clock::now();
      ASSERT_EQ(child.hear(), 'i');
      interval = std::min(interval, std::chrono::duration_cast<microseconds>(steady_clock::now() - next));
    }
    // Whoever is woken late takes an interval to be shorter than any is.
    const auto at_most = std::max<microseconds>(interval, 20ms);
    std::this_thread::sleep_for(microseconds(rng.below(std::uint32_t(at_most.count()))));
    child.kill();
    if (!child.ended_well()) ++killed;
    const int now = finished_intervals(rough);
    EXPECT_GE(now, finished) << "what the record promises stays promised";
    if (now > finished && finished > 0) ++resumed;
    finished = now;
  }
  const Child last([&](const Child&) { carry_out(rough, long_edit()); });
  ASSERT_TRUE(last.ended_well());
  EXPECT_EQ(support::read_file(rough / "result"), support::read_file(calm / "result"));
  RecordProperty("killed", killed);
  RecordProperty("resumed", resumed);
  EXPECT_GE(killed, kills - 4) << "the edit was over before it could be disturbed";
  EXPECT_GE(resumed, 5) << "hardly a round got far enough to matter";
}

/// Ends the process, as running out of memory does.
class Killer final : public engine::optim::PerceptualLoss {
 public:
  Result<double> evaluate(const engine::scene::Image&, const engine::scene::Image&, engine::scene::Image&) override {
    ::kill(::getpid(), SIGKILL);
    return 0.0;
  }
};

TEST(EditKill, AnEditThatEndsTheServiceAtTheSamePlaceIsGivenUp) {
  const support::TempDir dir;
  make_scene(dir.path());
  proto::EditRequest request = move_ball(first_scene);
  request.params.iterations = 2;
  Killer killer;
  const auto open = [&](scenes::SceneStore& store) {
    return value(EditService::open(
        store, {.folder = dir.path() / "edits", .pictured_views = 2, .threads = 1, .perceptual = &killer}));
  };
  for (int death = 0; death < 3; ++death) {
    const Child child([&](const Child&) {
      const auto store = open_scenes(dir.path());
      const auto service = open(*store);
      (void)wait_for_end(*service, value(service->submit(request, "key")).status.id);
    });
    EXPECT_FALSE(child.ended_well()) << "attempt " << death;
  }
  const Child fourth([&](const Child&) {
    const auto store = open_scenes(dir.path());
    const auto service = open(*store);
    const auto given_up = value(service->find(first_edit));
    if (given_up.state != "failed" || !given_up.error) throw std::runtime_error("it is " + given_up.state);
    if (given_up.error->message.find("3 times in a row while it was at this job (interval 1, optimise)") ==
        std::string::npos)
      throw std::runtime_error(given_up.error->message);
    const auto next = value(service->submit(move_ball(first_scene), "another")).status.id;
    if (wait_for_end(*service, next).state != "succeeded") throw std::runtime_error("the queue does not go on");
  });
  EXPECT_TRUE(fourth.ended_well());
}

TEST(EditKill, BetweenAcceptanceAndStartLosesNoEdit) {
  const support::TempDir dir;
  make_scene(dir.path());
  constexpr int edits = 8;
  for (int i = 0; i < edits; ++i) {
    const Child child([&](const Child& self) {
      const Opened opened(dir.path());
      (void)value(opened.service->submit(move_ball(first_scene), std::to_string(i)));
      self.say('a');
      std::this_thread::sleep_for(1min);
    });
    ASSERT_EQ(child.hear(), 'a');
    child.kill();
    (void)child.ended_well();
  }
  const Child last([&](const Child&) {
    const Opened opened(dir.path());
    const auto all = value(opened.service->list({}));
    opened.expect(all.size() == edits, "an accepted edit is lost");
    for (const auto& status : all)
      opened.expect(wait_for_end(*opened.service, status.id).state == "succeeded", "an edit did not succeed");
    opened.expect(value(opened.store->find(first_scene)).versions.size() == edits + 1, "not one version for each");
  });
  EXPECT_TRUE(last.ended_well());
}

/// What edit::run() gives if it is told to keep interval `kept`.
engine::scene::GaussianCloud kept_after(scenes::SceneStore& store, int kept) {
  const auto input = engine::scene::flatten(value(store.load(first_scene, "0")).cloud);
  int done = 0;
  engine::edit::Observer observer;
  observer.interval_done = [&](const engine::edit::IntervalDone& interval) -> Result<void> {
    done = interval.interval;
    return {};
  };
  observer.keep = [&] { return done == kept; };
  const auto outcome = value(engine::edit::run(input, {}, value(to_engine(long_edit())), {}, observer));
  return engine::scene::flatten(input, outcome.overlay);
}

/// A process begins the long edit, asks something of it once `intervals` of it are finished, and is killed `delay`
/// later.
template <class Ask>
void kill_after(const fs::path& data, int intervals, Ask ask, std::chrono::microseconds delay) {
  const Child child([&](const Child& self) {
    const Opened opened(data);
    const auto id = value(opened.service->submit(long_edit(), "")).status.id;
    (void)wait_for_interval(*opened.service, id, intervals);
    ask(*opened.service, id);
    self.say('a');
    std::this_thread::sleep_for(1min);
  });
  ASSERT_EQ(child.hear(), 'a');
  std::this_thread::sleep_for(delay);
  child.kill();
  (void)child.ended_well();
}

TEST(EditKill, DuringAStopKeepsAWholeInterval) {
  engine::Rng rng(7);
  for (int round = 0; round < 4; ++round) {
    SCOPED_TRACE(round);
    const support::TempDir dir;
    make_scene(dir.path());
    const auto stop = [](EditService& service, const std::string& id) { (void)value(service.stop(id)); };
    ASSERT_NO_FATAL_FAILURE(kill_after(dir.path(), 2, stop, std::chrono::microseconds(rng.below(150'000))));
    const Child next([&](const Child&) {
      const Opened opened(dir.path());
      const auto done = wait_for_end(*opened.service, first_edit);
      opened.expect(done.state == "succeeded" && done.stopped_early, "it was not kept");
      const int kept = done.finished_intervals.back().interval;
      opened.expect(kept >= 2 && kept < 20, "it kept another interval");
      const auto version = value(opened.store->load(first_scene, std::to_string(*done.result_version)));
      opened.expect(engine::scene::flatten(version.cloud) == kept_after(*opened.store, kept), "it kept other bytes");
    });
    EXPECT_TRUE(next.ended_well());
  }
}

TEST(EditKill, DuringACancelLeavesNoVersion) {
  engine::Rng rng(8);
  for (int round = 0; round < 6; ++round) {
    SCOPED_TRACE(round);
    const support::TempDir dir;
    make_scene(dir.path());
    const auto cancel = [](EditService& service, const std::string& id) { (void)value(service.cancel(id)); };
    ASSERT_NO_FATAL_FAILURE(kill_after(dir.path(), 1, cancel, std::chrono::microseconds(rng.below(30'000))));
    const Child next([&](const Child&) {
      const Opened opened(dir.path());
      opened.expect(value(opened.service->find(first_edit)).state == "cancelled", "it goes on");
      opened.expect(value(opened.store->find(first_scene)).versions.size() == 1, "it left a version");
      opened.expect(!fs::exists(dir.path() / "edits/jobs" / first_edit), "it left files");
    });
    EXPECT_TRUE(next.ended_well());
  }
}

TEST(EditKill, DuringTheRemovalOfAnEditOrASceneLeavesItWholeOrGone) {
  engine::Rng rng(9);
  int whole = 0, gone = 0;
  for (int round = 0; round < 16; ++round) {
    SCOPED_TRACE(round);
    const bool of_scene = round % 2 == 1;
    const support::TempDir dir;
    make_scene(dir.path());
    const Child child([&](const Child& self) {
      const Opened opened(dir.path());
      const auto id = value(opened.service->submit(move_ball(first_scene), "")).status.id;
      opened.expect(wait_for_end(*opened.service, id).state == "succeeded", "the edit did not succeed");
      self.say('r');
      std::this_thread::sleep_for(500us);  // so that the kill may come first
      value(of_scene ? opened.service->remove_scene(first_scene) : opened.service->remove(id));
      std::this_thread::sleep_for(1min);
    });
    ASSERT_EQ(child.hear(), 'r');
    std::this_thread::sleep_for(std::chrono::microseconds(rng.below(2'500)));
    child.kill();
    (void)child.ended_well();
    const Child next([&](const Child& self) {
      const Opened opened(dir.path());
      const auto status = opened.service->find(first_edit);
      const auto scene = opened.store->find(first_scene);
      if (of_scene) {
        opened.expect(status.has_value(), "the edit is lost");
        if (scene) (void)value(opened.store->load(first_scene, "1"));
        opened.expect(scene.has_value() == fs::exists(dir.path() / "scenes" / first_scene), "half a scene");
      } else {
        opened.expect(scene.has_value() && scene->versions.size() == 2, "the result is lost");
        if (status) (void)value(opened.service->interval_picture(first_edit, 2, 1, "deformed"));
        opened.expect(status.has_value() == fs::exists(dir.path() / "edits/jobs" / first_edit), "half an edit");
      }
      self.say((of_scene ? scene.has_value() : status.has_value()) ? 'w' : 'g');
    });
    ++(next.hear() == 'w' ? whole : gone);
    EXPECT_TRUE(next.ended_well());
  }
  RecordProperty("whole", whole);
  RecordProperty("gone", gone);
}

}  // namespace
}  // namespace server::edits
