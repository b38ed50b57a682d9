#include "server/service/routes/edit_routes.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "server/edits/convert.h"
#include "tests/server/edits/service_support.h"

namespace server::service::routes {
namespace {

using edits::code_of;
using edits::value;
using engine::ErrorCode;
using engine::Result;
using nlohmann::json;
using namespace std::chrono_literals;

/// A request as its handler sees it, after the service's door has let it in.
struct Request : http::Call {
  std::map<std::string, std::string, std::less<>> in_path, in_query, headers;
  std::string text, known_etag, nothing;
  http::TokenPtr by;

  const std::string& request_id() const override { return nothing; }
  const std::string& path(std::string_view name) const override { return in_path.find(name)->second; }
  std::optional<std::string> query(std::string_view name) const override {
    const auto found = in_query.find(name);
    return found == in_query.end() ? std::nullopt : std::optional(found->second);
  }
  std::string header(std::string_view name) const override {
    const auto found = headers.find(name);
    return found == headers.end() ? "" : found->second;
  }
  bool has_header(std::string_view name) const override { return headers.contains(name); }
  const std::string& body() const override { return text; }
  http::TokenPtr token() const override { return by; }
  bool is_json() const override { return true; }
  Result<http::UploadInfo> receive(const std::filesystem::path&) const override {
    return engine::fail(ErrorCode::internal, "no route of edits takes a file");
  }
  bool has(const std::string& etag) const override { return etag == known_etag; }
  bool accepts(std::string_view) const override { return true; }
};

struct Event {
  std::string name, id, data;
};

/// Takes events until it has had enough.
struct Listener : http::EventSink {
  std::vector<Event> events;
  int keep_alives = 0;
  std::function<bool()> listens = [] { return true; };

  bool send(std::string_view event, std::string_view id, std::string_view data) override {
    events.push_back({std::string(event), std::string(id), std::string(data)});
    return listens();
  }
  bool keep_alive() override {
    ++keep_alives;
    return listens();
  }
  bool open() const override { return listens(); }
};

std::string header_of(const http::Reply& reply, const std::string& name) {
  for (const auto& [key, text] : reply.headers)
    if (key == name) return text;
  return "";
}

class EditRoutesTest : public edits::ServiceTest {
 protected:
  EditRoutesTest() { add_edit_routes(router, *service, {.keep_alive = 40ms}); }

  const http::Route& route(const std::string& method, const std::string& path) const {
    for (const http::Route& known : router.routes())
      if (known.method == method && known.path == path) return known;
    throw std::runtime_error("no route " + method + " " + path);
  }
  Result<http::Reply> call(const std::string& method, const std::string& path, const Request& request) const {
    return route(method, path).handler(request);
  }
  static Request about(const std::string& id) {
    Request request;
    request.in_path["id"] = id;
    return request;
  }
  static Request with_body(std::string text) {
    Request request;
    request.text = std::move(text);
    return request;
  }
  Request edit_body() const { return with_body(proto::to_json(edits::move_ball(scene))); }
  std::string slow_edit() { return submit(edits::move_ball_slowly(scene)); }
  std::string long_edit(int longer = 1) { return submit(edits::move_ball_for_long(scene, longer)); }

  http::Router router;
};

TEST_F(EditRoutesTest, AreThoseOfTheContract) {
  std::vector<std::string> found;
  for (const http::Route& known : router.routes()) {
    found.push_back(known.method + " " + known.path);
    const bool reads = known.method == "GET" || known.path == "/v1/previews";
    const auto changes = known.path.ends_with("/requeue") ? http::Access::admin : http::Access::edit;
    EXPECT_EQ(known.access, reads ? http::Access::read : changes) << known.path;
  }
  std::sort(found.begin(), found.end());
  EXPECT_EQ(found, (std::vector<std::string>{
                       "DELETE /v1/edits/{id}", "GET /v1/edits", "GET /v1/edits/{id}", "GET /v1/edits/{id}/events",
                       "GET /v1/edits/{id}/intervals/{u}/renders/{k}", "POST /v1/edits", "POST /v1/edits/{id}/cancel",
                       "POST /v1/edits/{id}/requeue", "POST /v1/edits/{id}/stop", "POST /v1/previews"}));
  EXPECT_EQ(route("POST", "/v1/edits").body, http::Body::json);
  EXPECT_EQ(route("POST", "/v1/edits/{id}/stop").body, http::Body::none);
  EXPECT_EQ(route("POST", "/v1/edits").reads_with, "validate_only");
}

TEST_F(EditRoutesTest, AnEditIsAcceptedWithItsPlace) {
  const auto reply = value(call("POST", "/v1/edits", edit_body()));
  EXPECT_EQ(reply.status, 202);
  EXPECT_EQ(header_of(reply, "Location"), "/v1/edits/e000001");
  EXPECT_EQ(header_of(reply, "Retry-After"), "1");
  EXPECT_EQ(header_of(reply, "Idempotent-Replayed"), "");
  EXPECT_EQ(json::parse(reply.body).at("id"), "e000001");
  edits::wait_for_end(*service, "e000001");
  const json edit = json::parse(value(call("GET", "/v1/edits/{id}", about("e000001"))).body);
  EXPECT_EQ(edit.at("state"), "succeeded");
  EXPECT_EQ(edit.at("links").at("result"), "/v1/scenes/" + scene + "/versions/1");
}

TEST_F(EditRoutesTest, AFullQueueSaysWhenThereIsRoom) {
  reopen(/*max_queued=*/1);
  router = {};
  add_edit_routes(router, *service, {});
  proto::EditRequest long_edit = edits::move_ball(scene, 20);
  long_edit.params.views = 400;
  long_edit.params.max_image_side = 512;
  const std::string id = submit(long_edit);
  const auto known = edits::wait_for(*service, id, [](const auto& status) { return status.eta_seconds > 4; });
  const Request body = edit_body();
  EXPECT_EQ(value(call("POST", "/v1/edits", body)).status, 202);
  const auto refused = value(call("POST", "/v1/edits", body));
  EXPECT_EQ(refused.status, 429);
  EXPECT_EQ(json::parse(refused.body).at("code"), "busy");
  EXPECT_EQ(json::parse(refused.body).at("request_id"), body.request_id());
  const int seconds = std::stoi(header_of(refused, "Retry-After"));
  EXPECT_GT(seconds, 1);
  EXPECT_LE(seconds, std::ceil(2 * *known.eta_seconds)) << "it is what is left of the edit that runs";
  for (const auto& edit : value(service->list({}))) (void)value(service->cancel(edit.id));
}

TEST_F(EditRoutesTest, AQuotaIsThatOfTheTokenAndSaysWhichAndForHowLong) {
  Request body = edit_body();
  const auto with = [&](const http::Quotas& quotas) {
    body.by = std::make_shared<const http::Token>(
        http::Token{.name = "studio", .edit = true, .secret = "s", .quotas = quotas});
    return call("POST", "/v1/edits", body);
  };
  proto::EditRequest slow = edits::move_ball_for_long(scene, 2);
  slow.allow_slow = true;
  body.text = proto::to_json(slow);
  EXPECT_EQ(value(with({.edits = 1})).status, 202);
  body.text = edit_body().text;
  const auto many = value(with({.edits = 1}));
  EXPECT_EQ(many.status, 429);
  EXPECT_EQ(json::parse(many.body).at("code"), "quota_exceeded");
  EXPECT_EQ(json::parse(many.body).at("where"), "edits");
  EXPECT_GE(std::stoi(header_of(many, "Retry-After")), 1);
  body.text = proto::to_json(slow);
  EXPECT_EQ(value(with({.edits = 2})).status, 202);
  const double alone = value(service->estimate(slow)).seconds;
  const auto tired = value(with({.seconds = std::uint64_t(std::ceil(1.2 * alone))}));
  EXPECT_EQ(tired.status, 429);
  EXPECT_EQ(json::parse(tired.body).at("where"), "seconds");
  const int seconds = std::stoi(header_of(tired, "Retry-After"));
  const auto now = std::chrono::system_clock::now();
  const std::chrono::duration<double> left = std::chrono::ceil<std::chrono::days>(now) - now;
  EXPECT_NEAR(seconds, left.count(), 60) << "until the day is over, unless it just was";
  body.by = std::make_shared<const http::Token>(
      http::Token{.name = "idle", .edit = true, .secret = "i", .quotas = {.seconds = 0}});
  const auto never = call("POST", "/v1/edits", body);
  ASSERT_FALSE(never);
  EXPECT_EQ(never.error().code, ErrorCode::too_large) << "no day is long enough, and so there is none to wait for";
  EXPECT_EQ(never.error().where, "seconds");
  body.text = edit_body().text;
  EXPECT_EQ(value(with({.edits = 3})).status, 202);
  for (const auto& edit : value(service->list({}))) (void)service->cancel(edit.id);
}

TEST_F(EditRoutesTest, AskForNoMoreThanTheServiceAllows) {
  router = {};
  add_edit_routes(router, *service, {.limits = {.handles = 1, .views = 10, .image_side = 100}});
  proto::EditRequest good = edits::move_ball(scene);
  good.handles.resize(1);
  const auto refused = [&](const char* path, const std::function<void(proto::EditRequest&)>& change) {
    proto::EditRequest request = good;
    change(request);
    const auto reply = call("POST", path, with_body(proto::to_json(request)));
    if (reply) return std::string("accepted");
    EXPECT_EQ(reply.error().code, ErrorCode::too_large);
    const std::string& message = reply.error().message;
    const std::size_t option = message.find("--max-");
    return reply.error().where + " " + message.substr(option, message.find(' ', option) - option);
  };
  for (const char* path : {"/v1/edits", "/v1/previews"}) {
    EXPECT_EQ(refused(path, [](auto& r) { r.handles.push_back(r.handles[0]); }), "handles --max-handles");
    EXPECT_EQ(refused(path, [](auto& r) { r.params.views = 11; }), "params.views --max-views");
    EXPECT_EQ(refused(path, [](auto& r) { r.params.max_image_side = 101; }), "params.max_image_side --max-image-side");
  }
  EXPECT_EQ(refused("/v1/previews", [](auto& r) { r.params.views = 10, r.params.max_image_side = 100; }), "accepted");
  good.params.views = good.params.max_image_side = std::nullopt;
  const json edit = json::parse(value(call("POST", "/v1/edits", with_body(proto::to_json(good)))).body);
  EXPECT_EQ(edit.at("request").at("params").at("views"), 10) << "a default is no more than the limit";
  EXPECT_EQ(edit.at("request").at("params").at("max_image_side"), 100);
}

TEST_F(EditRoutesTest, ALimitAboveWhatThePresetAsksForChangesNothing) {
  const engine::edit::Params draft = edits::preset_params(proto::Preset::draft);
  router = {};
  add_edit_routes(router, *service, {.limits = {.views = draft.views + 1, .image_side = draft.max_image_side + 1}});
  proto::EditRequest request = edits::move_ball(scene);
  request.preset = proto::Preset::draft;
  request.params = {};
  Request only_validated = with_body(proto::to_json(request));
  only_validated.in_query["validate_only"] = "true";
  const json params = json::parse(value(call("POST", "/v1/edits", only_validated)).body).at("request").at("params");
  EXPECT_EQ(params.at("views"), draft.views);
  EXPECT_EQ(params.at("max_image_side"), draft.max_image_side);
}

TEST_F(EditRoutesTest, AKeyedRequestIsReplayed) {
  Request request = edit_body();
  request.headers["Idempotency-Key"] = "my key";
  (void)value(call("POST", "/v1/edits", request));
  const auto again = value(call("POST", "/v1/edits", request));
  EXPECT_EQ(again.status, 202);
  EXPECT_EQ(header_of(again, "Location"), "/v1/edits/e000001");
  EXPECT_EQ(header_of(again, "Idempotent-Replayed"), "true");
  request.text = proto::to_json(edits::move_ball(scene, 3));
  EXPECT_EQ(code_of(call("POST", "/v1/edits", request)), ErrorCode::unprocessable);
}

TEST_F(EditRoutesTest, AKeyIsShortAndPrintable) {
  for (const std::string& key : {std::string(), std::string(201, 'k'), std::string("tab\t"), std::string("\xc3\xa4")}) {
    Request request = edit_body();
    request.headers["Idempotency-Key"] = key;
    const auto reply = call("POST", "/v1/edits", request);
    ASSERT_FALSE(reply) << key;
    EXPECT_EQ(reply.error().code, ErrorCode::invalid_argument);
    EXPECT_EQ(reply.error().where, "Idempotency-Key");
  }
  Request request = edit_body();
  EXPECT_TRUE(value(service->list({})).empty()) << "none was accepted under a key that is none";
  request.headers["Idempotency-Key"] = std::string(200, '~');
  EXPECT_TRUE(call("POST", "/v1/edits", request));
}

TEST_F(EditRoutesTest, ValidationAloneAcceptsNothing) {
  Request request = edit_body();
  request.in_query["validate_only"] = "true";
  const auto reply = value(call("POST", "/v1/edits", request));
  EXPECT_EQ(reply.status, 200);
  EXPECT_EQ(json::parse(reply.body).at("valid"), true);
  EXPECT_GT(json::parse(reply.body).at("estimate").at("memory_bytes"), 0);
  EXPECT_TRUE(value(service->list({})).empty());
  request.in_query["validate_only"] = "yes";
  EXPECT_EQ(call("POST", "/v1/edits", request).error().where, "validate_only");
}

TEST_F(EditRoutesTest, ABadBodyIsRefusedByItsField) {
  const auto refused = [&](const std::string& path, const std::string& body) {
    const auto reply = call("POST", path, with_body(body));
    EXPECT_FALSE(reply);
    return reply ? std::string() : reply.error().where;
  };
  for (const char* path : {"/v1/edits", "/v1/previews"}) {
    SCOPED_TRACE(path);
    EXPECT_EQ(refused(path, R"({"handles": [{"source": [0,0,0], "radius": 1}], "colour": 3})"), "colour");
    EXPECT_EQ(refused(path, R"({"handles": [{"source": [0,0,0], "radius": 1}]})"), "scene");
    EXPECT_TRUE(refused(path, "{").starts_with("line 1"));
  }
}

TEST_F(EditRoutesTest, APreviewIsAnsweredAtOnce) {
  const auto reply = value(call("POST", "/v1/previews", edit_body()));
  EXPECT_EQ(reply.status, 200);
  const json preview = json::parse(reply.body);
  EXPECT_EQ(preview.at("version"), "p000001");
  EXPECT_EQ(preview.at("links").at("render"), "/v1/scenes/" + scene + "/versions/p000001/render");
  EXPECT_TRUE(store->load(scene, "p000001"));
}

TEST_F(EditRoutesTest, AListIsFiltered) {
  edits::wait_for_end(*service, submit(edits::move_ball(scene)));
  const auto running = long_edit();
  const auto listed = [&](std::map<std::string, std::string, std::less<>> query) {
    Request request;
    request.in_query = std::move(query);
    std::vector<std::string> ids;
    const json list = json::parse(value(call("GET", "/v1/edits", request)).body);
    for (const json& edit : list.at("edits")) ids.push_back(edit.at("id"));
    return ids;
  };
  EXPECT_EQ(listed({}), (std::vector<std::string>{running, "e000001"}));
  EXPECT_EQ(listed({{"active", "true"}}), (std::vector<std::string>{running}));
  EXPECT_EQ(listed({{"limit", "1"}}), (std::vector<std::string>{running}));
  EXPECT_TRUE(listed({{"scene", "s000077"}}).empty());
  for (const auto& [name, bad] : std::map<std::string, std::string>{{"limit", "0"}, {"active", "1"}}) {
    Request request;
    request.in_query[name] = bad;
    EXPECT_EQ(call("GET", "/v1/edits", request).error().where, name);
  }
  for (const char* bad : {"1001", "x", "1x", "", "99999999999999"}) {
    Request request;
    request.in_query["limit"] = bad;
    EXPECT_EQ(code_of(call("GET", "/v1/edits", request)), ErrorCode::invalid_argument) << bad;
  }
}

TEST_F(EditRoutesTest, PicturesOfIntervalsAreJpegAndKnownByTheirBytes) {
  edits::wait_for_end(*service, submit(edits::move_ball(scene)));
  Request request = about("e000001");
  request.in_path["u"] = "2";
  request.in_path["k"] = "1";
  const std::string path = "/v1/edits/{id}/intervals/{u}/renders/{k}";
  EXPECT_EQ(call("GET", path, request).error().where, "stage") << "which one?";
  request.in_query["stage"] = "deformed";
  const auto picture = value(call("GET", path, request));
  EXPECT_EQ(picture.media_type, "image/jpeg");
  EXPECT_TRUE(picture.body.starts_with("\xff\xd8\xff"));
  request.known_etag = picture.etag;
  EXPECT_EQ(value(call("GET", path, request)).status, 304);
  request.in_query["stage"] = "before";
  EXPECT_EQ(value(call("GET", path, request)).status, 200) << "another picture";
  for (const char* bad : {"3", "0", "-1", "x", "99999999999"}) {
    request.in_path["u"] = bad;
    EXPECT_EQ(code_of(call("GET", path, request)), ErrorCode::not_found) << bad;
  }
}

TEST_F(EditRoutesTest, CorrectedPicturesAreListedAndServed) {
  edits::wait_for_end(*service, submit(edits::move_and_correct_ball(scene)));
  const json edit = json::parse(value(call("GET", "/v1/edits/{id}", about("e000001"))).body);
  ASSERT_EQ(edit.at("state"), "succeeded");
  const json& stages = edit.at("finished_intervals").at(1).at("renders").at(0).at("stages");
  EXPECT_EQ(stages.at("corrected"), "/v1/edits/e000001/intervals/2/renders/0?stage=corrected");
  Request request = about("e000001");
  request.in_path["u"] = "2";
  request.in_path["k"] = "0";
  std::map<std::string, std::string> pictures;
  for (const char* stage : {"before", "deformed", "corrected", "optimised"}) {
    request.in_query["stage"] = stage;
    const auto picture = value(call("GET", "/v1/edits/{id}/intervals/{u}/renders/{k}", request));
    EXPECT_EQ(picture.media_type, "image/jpeg");
    EXPECT_TRUE(picture.body.starts_with("\xff\xd8\xff"));
    pictures[stage] = picture.body;
  }
  EXPECT_NE(pictures["deformed"], pictures["before"]);
  EXPECT_NE(pictures["corrected"], pictures["deformed"]);
  EXPECT_NE(pictures["optimised"], pictures["deformed"]);
}

TEST_F(EditRoutesTest, StopCancelAndDeleteAnswerByTheState) {
  const auto id = long_edit();
  edits::wait_for_interval(*service, id);
  EXPECT_EQ(code_of(call("DELETE", "/v1/edits/{id}", about(id))), ErrorCode::conflict);
  EXPECT_EQ(json::parse(value(call("POST", "/v1/edits/{id}/stop", about(id))).body).at("state"), "stop_requested");
  edits::wait_for_end(*service, id);
  EXPECT_EQ(code_of(call("POST", "/v1/edits/{id}/cancel", about(id))), ErrorCode::conflict);

  const auto other = long_edit();
  const auto cancelled = value(call("POST", "/v1/edits/{id}/cancel", about(other)));
  EXPECT_EQ(cancelled.status, 200);
  edits::wait_for_end(*service, other);
  EXPECT_EQ(json::parse(value(call("POST", "/v1/edits/{id}/cancel", about(other))).body).at("state"), "cancelled");

  EXPECT_EQ(value(call("DELETE", "/v1/edits/{id}", about(id))).status, 204);
  for (const auto& [method, path] :
       {std::pair{"DELETE", "/v1/edits/{id}"}, std::pair{"GET", "/v1/edits/{id}"},
        std::pair{"GET", "/v1/edits/{id}/events"}, std::pair{"POST", "/v1/edits/{id}/stop"},
        std::pair{"POST", "/v1/edits/{id}/cancel"}})
    EXPECT_EQ(code_of(call(method, path, about(id))), ErrorCode::not_found) << method << path;
}

TEST_F(EditRoutesTest, EventsTellEveryChangeOnceAndEndWithTheEdit) {
  const auto id = slow_edit();
  const auto reply = value(call("GET", "/v1/edits/{id}/events", about(id)));
  EXPECT_EQ(reply.media_type, "text/event-stream");
  Listener listener;
  reply.events(listener);
  ASSERT_GE(listener.events.size(), 20u) << "an interval each, at least";
  for (std::size_t i = 0; i < listener.events.size(); ++i) {
    EXPECT_EQ(listener.events[i].name, "edit");
    EXPECT_EQ(listener.events[i].id, std::to_string(i + 1));
    EXPECT_EQ(listener.events[i].data.find('\n'), std::string::npos);
    if (i > 0) {
      EXPECT_NE(listener.events[i].data, listener.events[i - 1].data) << "news only";
    }
  }
  EXPECT_EQ(json::parse(listener.events.back().data).at("state"), "succeeded");
  Listener late;
  reply.events(late);
  EXPECT_EQ(late.events.size(), 1u) << "of an ended edit there is one thing to say";
}

TEST_F(EditRoutesTest, NewsOfOtherEditsIsNoEvent) {
  const auto running = slow_edit(), waiting = long_edit();
  const auto reply = value(call("GET", "/v1/edits/{id}/events", about(waiting)));
  Listener listener;
  listener.listens = [&] { return !value(service->find(running)).ended; };
  reply.events(listener);
  EXPECT_LE(listener.events.size(), 2u);
  EXPECT_GT(listener.keep_alives, 0) << "a sign of life while nothing happens";
}

TEST_F(EditRoutesTest, AStreamEndsWhenItsListenerOrItsEditIsGone) {
  const auto running = long_edit();
  (void)long_edit(2);
  const auto reply = value(call("GET", "/v1/edits/{id}/events", about(running)));
  Listener gone;
  gone.listens = [] { return false; };
  reply.events(gone);
  EXPECT_TRUE(gone.events.empty());
  Listener leaving;
  leaving.listens = [&] { return leaving.events.size() < 3; };
  reply.events(leaving);
  EXPECT_EQ(leaving.events.size(), 3u);

  const auto waiting = value(call("GET", "/v1/edits/{id}/events", about("e000002")));
  Listener listener;
  std::thread remover([&] {
    std::this_thread::sleep_for(50ms);
    value(service->cancel("e000002"));
  });
  waiting.events(listener);
  remover.join();
  EXPECT_EQ(json::parse(listener.events.back().data).at("state"), "cancelled");
}

}  // namespace
}  // namespace server::service::routes
