// What the tests of the edit service share: a small scene in a store, and edits of it.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "engine/io/scene_file.h"
#include "server/edits/edit_service.h"
#include "tests/engine/edit/samples.h"
#include "tests/engine/jobs/jobs_support.h"
#include "tests/support/data.h"

namespace server::edits {

using engine::ErrorCode;
using engine::jobs::code_of;
using engine::jobs::patience;
using engine::jobs::value;

inline std::unique_ptr<scenes::SceneStore> open_scenes(const std::filesystem::path& data) {
  return value(scenes::SceneStore::open({.folder = data / "scenes", .scene_root = {}}));
}

#ifdef __SANITIZE_THREAD__
inline constexpr bool under_thread_sanitizer = true;
#else
inline constexpr bool under_thread_sanitizer = false;
#endif

/// One thread to compute with: results are the same for any number, as the engine's tests show, and an edit that can
/// be interfered with must not be over too soon. Two where somebody watches how they share the work.
///   attempts  0: an edit is taken up again however often the process dies; for tests that kill it on purpose
inline std::unique_ptr<EditService> open_service(scenes::SceneStore& store, const std::filesystem::path& data,
                                                 std::size_t max_queued = 32, int attempts = 3) {
  return value(EditService::open(store, {.folder = data / "edits",
                                         .max_queued = max_queued,
                                         .pictured_views = 2,
                                         .attempts = attempts,
                                         .threads = under_thread_sanitizer ? 2 : 1}));
}

/// A ball of 200 Gaussians at the origin before a wall; without a dataset.
inline std::string add_ball(scenes::SceneStore& store, const std::filesystem::path& data) {
  namespace io = engine::io;
  io::SceneFile file{engine::edit::ball_before_wall(200), io::inria_layout(2)};
  file.cloud.extra_stride = 0;
  file.cloud.extra.clear();
  const auto path = data / "ball.ply";
  value(io::write_scene(path, file, io::SceneFormat::ply));
  return value(store.add_upload(path, "ball.ply", "ball")).id;
}

/// Moves the ball to the right, in small pictures. Deforms only, which is quick.
inline proto::EditRequest move_ball(const std::string& scene, int intervals = 2) {
  proto::EditRequest request;
  request.scene = scene;
  request.preset = proto::Preset::preview;
  request.handles.push_back({.source = {0, 0, 0}, .target = proto::Point{0.5, 0, 0}, .radius = 0.3});
  request.params.intervals = intervals;
  request.params.views = 3;
  request.params.max_image_side = 48;
  return request;
}

/// The same, each interval corrected twice and optimised a little.
inline proto::EditRequest move_and_correct_ball(const std::string& scene, int intervals = 2) {
  proto::EditRequest request = move_ball(scene, intervals);
  request.params.corrector = proto::Corrector::scene;
  request.params.annealing_steps = 2;
  request.params.iterations = 5;
  return request;
}

/// Deforms only, but with so many pictures that there is time to interfere: half a second in all, or two where
/// ThreadSanitizer looks at each access to memory, which makes a pixel cost forty times as much.
inline proto::EditRequest move_ball_slowly(const std::string& scene) {
  proto::EditRequest request = move_ball(scene, 20);
  request.params.views = under_thread_sanitizer ? 10 : 40;
  request.params.max_image_side = under_thread_sanitizer ? 112 : 256;
  return request;
}

/// The same with ten times as many pictures, for a test that ends the edit itself: however late the test comes to look
/// on a busy machine, the edit is still at work. What is to wait behind it must take longer, or it goes first.
inline proto::EditRequest move_ball_for_long(const std::string& scene, int longer = 1) {
  proto::EditRequest request = move_ball_slowly(scene);
  request.params.views = *request.params.views * 10 * longer;
  return request;
}

/// The edit once `wanted(status)` holds; ends the test when patience does.
template <class Wanted>
proto::EditStatus wait_for(EditService& service, const std::string& id, Wanted wanted) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  for (auto seen = service.version();; seen = service.wait_for_change(seen, std::chrono::seconds(1))) {
    proto::EditStatus status = value(service.find(id));
    if (wanted(status)) return status;
    if (std::chrono::steady_clock::now() > deadline) throw std::runtime_error(id + " still is " + status.state);
  }
}
inline proto::EditStatus wait_for_end(EditService& service, const std::string& id) {
  return wait_for(service, id, [](const auto& status) { return status.ended.has_value(); });
}
inline proto::EditStatus wait_for_interval(EditService& service, const std::string& id, std::size_t count = 1) {
  return wait_for(service, id, [=](const auto& status) {
    return status.finished_intervals.size() >= count || status.ended.has_value();
  });
}

/// The Gaussians of a version as the bytes of a file.
inline std::string version_bytes(scenes::SceneStore& store, const std::string& scene, int version) {
  return support::read_file(value(store.file(scene, std::to_string(version), scenes::FileFormat::ply)).path);
}

/// A data folder with one scene and the service on it.
class ServiceTest : public testing::Test {
 protected:
  void reopen(std::size_t max_queued = 32) {
    service.reset();
    store.reset();
    store = open_scenes(dir.path());
    service = open_service(*store, dir.path(), max_queued);
  }
  std::string submit(const proto::EditRequest& request, const std::string& key = "") {
    return value(service->submit(request, key)).status.id;
  }
  std::size_t versions() { return value(store->find(scene)).versions.size(); }

  support::TempDir dir;
  std::unique_ptr<scenes::SceneStore> store = open_scenes(dir.path());
  std::unique_ptr<EditService> service = open_service(*store, dir.path());
  std::string scene = add_ball(*store, dir.path());
};

}  // namespace server::edits
