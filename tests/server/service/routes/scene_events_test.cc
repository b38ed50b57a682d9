#include "server/service/routes/scene_events.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/server/edits/service_support.h"
#include "tests/server/service/routes/route_support.h"

namespace server::service::routes {
namespace {

using edits::value;
using namespace std::chrono_literals;

/// Takes events, and does something after each, until it has had enough; or for so long that what it waits for will not
/// come: a test fails then, and does not hang. (The stream says something every 20 ms.)
struct Listener : http::EventSink {
  const std::chrono::steady_clock::time_point latest = std::chrono::steady_clock::now() + 2min;
  bool is_late = false;
  std::vector<std::pair<std::string, json>> events;
  std::function<bool(const std::string& event, const json& data)> heard;
  bool listens = true;

  bool send(std::string_view event, std::string_view, std::string_view data) override {
    events.emplace_back(event, json::parse(data));
    is_late = std::chrono::steady_clock::now() > latest;
    return listens = !is_late && heard(events.back().first, events.back().second);
  }
  bool keep_alive() override { return listens; }
  bool open() const override { return listens; }
  [[nodiscard]] std::size_t count(const std::string& name) const {
    return std::size_t(std::ranges::count(events, name, &std::pair<std::string, json>::first));
  }
};

bool has_ended(const json& edit) {
  return edit["state"] == "succeeded" || edit["state"] == "failed" || edit["state"] == "cancelled";
}

class SceneEventsTest : public edits::ServiceTest {
 protected:
  SceneEventsTest() { add_scene_event_routes(router, *store, *service, {.look_every = 5ms, .sign_of_life = 20ms}); }

  void listen(Listener& listener) {
    FakeCall call;
    call.in_path = {{"id", scene}};
    const auto reply = value(router.routes().front().handler(call));
    EXPECT_EQ(reply.media_type, "text/event-stream");
    reply.events(listener);
    ASSERT_FALSE(listener.events.empty());
    ASSERT_FALSE(listener.is_late) << "the last it heard: " << listener.events.back().first << " "
                                   << listener.events.back().second;
  }

  http::Router router;
};

TEST_F(SceneEventsTest, TellTheSceneAndEachChangeOfItOnce) {
  Listener listener;
  listener.heard = [&](const std::string& event, const json& data) {
    if (event == "alive") return listener.count("alive") < 3;
    if (data["name"] == "ball") value(store->patch(scene, {.name = "marble", .up = {}}));
    return true;
  };
  ASSERT_NO_FATAL_FAILURE(listen(listener));
  std::vector<std::string> names;
  for (const auto& [event, data] : listener.events)
    if (event == "scene") names.push_back(data["name"]);
  EXPECT_EQ(names, (std::vector<std::string>{"ball", "marble"})) << "nothing twice";
  EXPECT_EQ(listener.count("alive"), 3u) << "a sign of life while nothing happens";
}

TEST_F(SceneEventsTest, TellAnEditToItsEndAndTheVersionBeforeIt) {
  Listener listener;
  std::string edit;
  listener.heard = [&](const std::string& event, const json& data) {
    if (edit.empty()) edit = submit(edits::move_ball(scene));
    return event != "edit" || !has_ended(data);
  };
  ASSERT_NO_FATAL_FAILURE(listen(listener));
  EXPECT_EQ(listener.events.back().second["state"], "succeeded");
  EXPECT_EQ(listener.events.back().second["id"], edit);
  std::size_t versions = 0;
  for (const auto& [event, data] : listener.events)
    if (event == "scene") versions = data["versions"].size();
  EXPECT_EQ(versions, 2u) << "whoever hears of the end knows the version";
}

TEST_F(SceneEventsTest, TellAnEditThatComesAndEndsBetweenTwoLooks) {
  wait_for_end(*service, submit(edits::move_ball(scene)));
  Listener listener;
  std::string edit;
  listener.heard = [&](const std::string& event, const json&) {
    if (edit.empty()) wait_for_end(*service, edit = submit(edits::move_ball(scene)));
    return event != "edit";
  };
  ASSERT_NO_FATAL_FAILURE(listen(listener));
  EXPECT_EQ(listener.events.back().second["id"], edit) << "and not the one that had ended before";
  EXPECT_EQ(listener.events.back().second["state"], "succeeded");
}

TEST_F(SceneEventsTest, TellOfAnEditThatOthersCancelAndOfASceneThatGoes) {
  const std::string edit = submit(edits::move_ball_for_long(scene));
  Listener listener;
  listener.heard = [&](const std::string& event, const json& data) {
    if (event == "edit" && data["state"] == "running") value(service->cancel(edit));
    if (event == "edit" && data["state"] == "cancelled") value(store->remove(scene));
    return true;
  };
  ASSERT_NO_FATAL_FAILURE(listen(listener));
  EXPECT_EQ(listener.events.back().first, "gone");
  FakeCall call;
  call.in_path = {{"id", scene}};
  EXPECT_EQ(router.routes().front().handler(call).error().code, engine::ErrorCode::not_found);
}

}  // namespace
}  // namespace server::service::routes
