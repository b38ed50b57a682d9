#include "server/service/routes/scene_routes.h"

#include <atomic>
#include <chrono>
#include <thread>

#include "engine/io/image_file.h"
#include "tests/server/service/routes/route_support.h"

namespace server::service::routes {
namespace {

using engine::ErrorCode;
using SceneRoutes = RouteFixture;

FakeCall uploading(const std::string& bytes, const std::string& name) {
  FakeCall request;
  request.json_body = false;
  request.upload = bytes;
  request.upload_name = name;
  return request;
}

TEST_F(SceneRoutes, AddAnUploadedScene) {
  write(temp.path() / "a.ply", GaussianWall::cloud());
  const std::string bytes = support::read_file(temp.path() / "a.ply");
  const auto reply = call("POST", "/v1/scenes", uploading(bytes, "red chair.ply"));
  ASSERT_TRUE(reply) << reply.error().message;
  EXPECT_EQ(reply->status, 201);
  EXPECT_EQ(header_of(*reply, "Location"), "/v1/scenes/s000001");
  const json scene = json::parse(reply->body);
  EXPECT_EQ(scene["id"], "s000001");
  EXPECT_EQ(scene["name"], "red chair");
  EXPECT_EQ(scene["gaussians"], 441);
  EXPECT_EQ(scene["views"], 50);
  EXPECT_EQ(scene["created"], "2023-11-14T22:13:20.000Z");
  EXPECT_EQ(scene["bounds"]["low"], json::parse("[-1.0, -1.0, 0.0]"));
  EXPECT_EQ(json::parse(call("GET", "/v1/scenes/{id}", about("s000001"))->body), scene);
  EXPECT_EQ(json::parse(call("GET", "/v1/scenes", {})->body)["scenes"], json::array({scene}));
}

TEST_F(SceneRoutes, NameAnUploadAsTheQuerySays) {
  write(temp.path() / "a.ply", GaussianWall::cloud());
  FakeCall request = uploading(support::read_file(temp.path() / "a.ply"), "");
  request.in_query["name"] = "stool";
  EXPECT_EQ(json::parse(call("POST", "/v1/scenes", request)->body)["name"], "stool");
  request.in_query["name"] = "";
  EXPECT_EQ(call("POST", "/v1/scenes", request).error().where, "name");
  request.in_query.clear();
  EXPECT_EQ(json::parse(call("POST", "/v1/scenes", request)->body)["name"], "upload");
}

TEST_F(SceneRoutes, SayWhereAnUploadIsDamaged) {
  const auto reply = call("POST", "/v1/scenes", uploading("ply\nformat nonsense\n", "chair.ply"));
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(reply.error().where, "chair.ply:header");
}

TEST_F(SceneRoutes, AddAFileBelowTheSceneRoot) {
  write(options.scene_root / "table.ply", GaussianWall::cloud());
  const auto reply = call("POST", "/v1/scenes", with_body("", R"({"path":"table.ply","name":"desk"})"));
  ASSERT_TRUE(reply) << reply.error().message;
  EXPECT_EQ(json::parse(reply->body)["name"], "desk");
  EXPECT_EQ(call("POST", "/v1/scenes", with_body("", R"({"path":"../x.ply"})")).error().where, "path");
  EXPECT_EQ(call("POST", "/v1/scenes", with_body("", R"({"file":"x.ply"})")).error().where, "file");
  FakeCall twice = with_body("", R"({"path":"table.ply","name":"desk"})");
  twice.in_query["name"] = "table";
  EXPECT_EQ(call("POST", "/v1/scenes", twice).error().where, "name");
}

TEST_F(SceneRoutes, ChangeAndRemoveAScene) {
  const std::string id = add_wall();
  const auto patched = call("PATCH", "/v1/scenes/{id}", with_body(id, R"({"name":"wall 2","up":[0,0,1]})"));
  ASSERT_TRUE(patched) << patched.error().message;
  EXPECT_EQ(json::parse(patched->body)["up"], json::parse("[0.0, 0.0, 1.0]"));
  const auto forgotten = call("PATCH", "/v1/scenes/{id}", with_body(id, R"({"up":null})"));
  EXPECT_TRUE(json::parse(forgotten->body)["up"].is_null());
  EXPECT_EQ(json::parse(forgotten->body)["name"], "wall 2");
  EXPECT_EQ(call("DELETE", "/v1/scenes/{id}", about(id))->status, 204);
  EXPECT_EQ(call("DELETE", "/v1/scenes/{id}", about(id)).error().code, ErrorCode::not_found);
  EXPECT_EQ(call("GET", "/v1/scenes/{id}", about(id)).error().where, "scene");
}

TEST_F(SceneRoutes, TellOfAVersionWhatItsSceneTellsOfIt) {
  const std::string id = add_wall();
  engine::scene::Overlay removal;
  removal.removed = {3, 5};
  ASSERT_TRUE(add_version(*store, id, 0, "e000001", removal));
  const json scene = json::parse(call("GET", "/v1/scenes/{id}", about(id))->body);
  FakeCall request = about(id);
  for (const char* version : {"0", "1"}) {
    request.in_path["v"] = version;
    const auto reply = call("GET", "/v1/scenes/{id}/versions/{v}", request);
    ASSERT_TRUE(reply) << reply.error().message;
    EXPECT_EQ(json::parse(reply->body), scene["versions"][std::stoul(version)]);
  }
  for (const char* none : {"2", "01", "-1", "p000001", "latest"}) {
    request.in_path["v"] = none;
    const auto reply = call("GET", "/v1/scenes/{id}/versions/{v}", request);
    ASSERT_FALSE(reply) << none;
    EXPECT_EQ(reply.error().code, ErrorCode::not_found);
    EXPECT_EQ(reply.error().where, "version");
  }
}

TEST_F(SceneRoutes, LeaveASceneToTheEditThatNeedsIt) {
  const std::string id = add_wall();
  http::Router guarded;
  const auto refuse = [](const std::string&, const auto&) -> engine::Result<void> {
    return engine::fail(ErrorCode::conflict, "edit e000001 runs on it");
  };
  add_scene_routes(guarded, {*store, renders, *views, refuse, refuse});
  for (const http::Route& route : guarded.routes()) {
    if (route.method == "DELETE") {
      EXPECT_EQ(route.handler(about(id)).error().code, ErrorCode::conflict);
    }
    if (route.method == "PATCH" && route.path.ends_with("/{v}")) {
      EXPECT_TRUE(route.handler(with_body(id, R"({"name":"nor is a version's"})")));
    } else if (route.method == "PATCH") {
      EXPECT_EQ(route.handler(with_body(id, R"({"up":[0,0,1]})")).error().code, ErrorCode::conflict);
      EXPECT_TRUE(route.handler(with_body(id, R"({"name":"its name is of no matter to an edit"})")));
    }
    if (route.method == "PUT") {
      EXPECT_EQ(route.handler(with_body(id, R"({"path":"."})")).error().code, ErrorCode::conflict);
    }
  }
  EXPECT_TRUE(store->find(id));
}

TEST_F(SceneRoutes, ShowFiftyVirtualViewsOfASceneWithoutDataset) {
  const std::string id = add_wall();
  const auto reply = call("GET", "/v1/scenes/{id}/views", about(id));
  ASSERT_TRUE(reply) << reply.error().message;
  const json all = json::parse(reply->body);
  EXPECT_EQ(all["kind"], "virtual");
  EXPECT_EQ(all["views"].size(), 50u);
  EXPECT_EQ(all["views"][0]["name"], "virtual_00");
  EXPECT_EQ(all["views"][0]["photo"], false);
  EXPECT_EQ(call("GET", "/v1/scenes/{id}/views", about(id))->body, reply->body);
}

TEST_F(SceneRoutes, FindViewsForWhoeverIsStillThere) {
  const std::string id = add_wall();
  FakeCall first = about(id);
  std::atomic<bool> begun = false, left = false;
  first.has_gone = [&] {
    begun = true;
    while (!left) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return true;
  };
  engine::Result<http::Reply> of_first, of_second;
  std::thread one([&] { of_first = call("GET", "/v1/scenes/{id}/views", first); });
  while (!begun) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  std::thread two([&] { of_second = call("GET", "/v1/scenes/{id}/views", about(id)); });
  // Nothing else waits for them.
  EXPECT_EQ(renders.waiting(), 0u);
  EXPECT_TRUE(renders.run_in_turn([] {}));
  std::this_thread::sleep_for(std::chrono::milliseconds(20));  // the second now waits for the first
  left = true;
  one.join(), two.join();
  EXPECT_EQ(of_first.error().code, ErrorCode::cancelled);
  ASSERT_TRUE(of_second) << of_second.error().message;
  EXPECT_EQ(json::parse(of_second->body)["views"].size(), 50u);
}

/// A photo of the wall as the camera of transforms_json() sees it, which looks from z = 4 in OpenGL's axes.
void zip_capture(const std::filesystem::path& zip, const std::string& photo) {
  scenes::write_zip(zip,
                    {{"transforms.json", scenes::transforms_json()}, {"images/a.png", photo}, {"images/b.png", photo}});
}

std::string png(const engine::scene::Image& image) {
  const auto bytes = engine::io::encode_image(image, engine::io::ImageFormat::png);
  return {reinterpret_cast<const char*>(bytes->data()), bytes->size()};
}

TEST_F(SceneRoutes, CompareADatasetWithItsPhotos) {
  const std::string id = add_wall();
  zip_capture(temp.path() / "plain.zip", png(engine::scene::Image(64, 48, 3, 0.5f)));
  FakeCall request = uploading(support::read_file(temp.path() / "plain.zip"), "capture.zip");
  request.in_path = {{"id", id}};
  const auto wrong = call("PUT", "/v1/scenes/{id}/dataset", request);
  ASSERT_TRUE(wrong) << wrong.error().message << wrong.error().where;
  const json far = json::parse(wrong->body)["dataset"];
  EXPECT_EQ(far["photos"], 2);
  EXPECT_LT(far["psnr_mean_db"].get<double>(), 15);
  ASSERT_EQ(far["warnings"].size(), 1u);
  EXPECT_NE(far["warnings"][0].get<std::string>().find("another frame"), std::string::npos);

  const auto camera = store->dataset(id).value()->views[0].camera;
  const auto seen = renders.colors(store->load(id, "0").value(), camera);
  ASSERT_TRUE(seen);
  zip_capture(temp.path() / "right.zip", png(*seen));
  request.upload = support::read_file(temp.path() / "right.zip");
  const auto right = call("PUT", "/v1/scenes/{id}/dataset", request);
  ASSERT_TRUE(right);
  const json near = json::parse(right->body)["dataset"];
  EXPECT_GT(near["psnr_mean_db"].get<double>(), 45);
  EXPECT_TRUE(near["warnings"].empty());
  EXPECT_EQ(json::parse(call("GET", "/v1/scenes/{id}/views", about(id))->body)["views"][0]["photo"], true);
}

TEST_F(SceneRoutes, ShowAPhotoOfTheDatasetAndTakeTheDatasetAway) {
  const std::string id = add_wall();
  engine::scene::Image photo(64, 48, 3, 0.5f);
  zip_capture(temp.path() / "plain.zip", png(photo));
  FakeCall request = uploading(support::read_file(temp.path() / "plain.zip"), "capture.zip");
  request.in_path = {{"id", id}};
  ASSERT_TRUE(call("PUT", "/v1/scenes/{id}/dataset", request));
  const std::string view = store->dataset(id).value()->views[0].camera.name;
  const auto shown = [&](const std::string& name, const std::string& side) {
    FakeCall asked = about(id);
    asked.in_query = {{"view", name}, {"max_side", side}};
    return call("GET", "/v1/scenes/{id}/photo", asked);
  };
  for (const auto& [side, width, height] : {std::tuple{"200", 64, 48}, std::tuple{"32", 32, 24}}) {
    const auto found = shown(view, side);
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_EQ(found->media_type, "image/jpeg");
    EXPECT_FALSE(found->etag.empty());
    const auto image = engine::io::decode_image(std::as_bytes(std::span(found->body)), "photo.jpg");
    ASSERT_TRUE(image);
    EXPECT_EQ(image->width, width);
    EXPECT_EQ(image->height, height);
    EXPECT_NEAR(image->data[0], 0.5f, 0.02f);
  }
  // Who has it already is told so without a look at it: it takes no memory.
  const auto& first = store->dataset(id).value()->views[0];
  const std::string tag = shown(view, "32")->etag;
  EXPECT_NE(shown(view, "64")->etag, tag);
  const auto within = [&](std::uint64_t bytes, const std::string& known) {
    engine::MemoryBudget budget(bytes, "--work-memory", std::chrono::milliseconds(20));
    RenderService counted({.threads = 2, .max_side = 256, .memory = &budget});
    router = {};
    add_scene_routes(router, {*store, counted, *views, {}, {}});
    FakeCall asked = about(id);
    asked.in_query = {{"view", view}, {"max_side", "32"}};
    asked.known_etag = known;
    return call("GET", "/v1/scenes/{id}/photo", asked);
  };
  const std::uint64_t needed = engine::io::photo_memory(first);
  EXPECT_EQ(within(needed, "another")->status, 200);
  EXPECT_EQ(within(needed - 1, "another").error().code, ErrorCode::too_large);
  EXPECT_EQ(within(1, tag)->status, 304);
  connect();
  // Another photo in its place is another one, of the same size, too.
  std::filesystem::last_write_time(first.photo,
                                   std::filesystem::last_write_time(first.photo) + std::chrono::seconds(1));
  EXPECT_NE(shown(view, "32")->etag, tag);

  EXPECT_EQ(shown("none.png", "64").error().where, "view");
  EXPECT_EQ(shown("", "64").error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(shown(view, "0").error().where, "max_side");
  EXPECT_EQ(shown(view, "100000").error().where, "max_side");

  // Somebody puts a link to a picture elsewhere in the photo's place, or takes it away.
  const std::filesystem::path file = store->dataset(id).value()->views[0].photo;
  support::write_file(temp.path() / "secret.png", png(photo));
  std::filesystem::remove(file);
  for (const bool is_link : {true, false}) {
    SCOPED_TRACE(is_link);
    is_link ? std::filesystem::create_symlink(temp.path() / "secret.png", file) : void(std::filesystem::remove(file));
    const auto refused = shown(view, "64");
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().where, "view");
    EXPECT_EQ(refused.error().message.find(temp.path().string()), std::string::npos) << refused.error().message;
  }

  const auto gone = call("DELETE", "/v1/scenes/{id}/dataset", about(id));
  ASSERT_TRUE(gone) << gone.error().message;
  EXPECT_TRUE(json::parse(gone->body)["dataset"].is_null());
  EXPECT_EQ(json::parse(call("GET", "/v1/scenes/{id}/views", about(id))->body)["kind"], "virtual");
  EXPECT_EQ(shown(view, "64").error().where, "dataset");
  EXPECT_EQ(call("DELETE", "/v1/scenes/{id}/dataset", about(id)).error().code, ErrorCode::not_found);
  open();
  connect();
  EXPECT_FALSE(store->find(id)->dataset);
  for (const auto& entry : std::filesystem::directory_iterator(options.folder / id))
    EXPECT_FALSE(entry.path().filename().string().starts_with("dataset")) << entry.path();
  EXPECT_TRUE(call("PUT", "/v1/scenes/{id}/dataset", request)) << "and another one can come";
}

TEST_F(SceneRoutes, CallAVersionByAName) {
  const std::string id = add_wall();
  const auto named = call("PATCH", "/v1/scenes/{id}/versions/{v}", with_body(id, R"({"name": "the wall"})"));
  ASSERT_TRUE(named) << named.error().message;
  EXPECT_EQ(json::parse(named->body)["name"], "the wall");
  EXPECT_EQ(json::parse(call("GET", "/v1/scenes/{id}", about(id))->body)["versions"][0]["name"], "the wall");
  const auto forgotten = call("PATCH", "/v1/scenes/{id}/versions/{v}", with_body(id, R"({"name": null})"));
  EXPECT_TRUE(json::parse(forgotten->body)["name"].is_null());
  for (const char* wrong : {"{}", R"({"name": ""})", R"({"name": 3})", R"({"name": "a", "kept": true})"})
    EXPECT_EQ(call("PATCH", "/v1/scenes/{id}/versions/{v}", with_body(id, wrong)).error().code,
              ErrorCode::invalid_argument)
        << wrong;
}

TEST_F(SceneRoutes, KeepADatasetThatCannotBeComparedAndSayWhy) {
  const std::string id = add_wall();
  std::filesystem::resize_file(options.folder / id / "base.ply", 100);
  open();
  connect();
  zip_capture(temp.path() / "plain.zip", png(engine::scene::Image(64, 48, 3, 0.5f)));
  FakeCall request = uploading(support::read_file(temp.path() / "plain.zip"), "capture.zip");
  request.in_path = {{"id", id}};
  const auto put = call("PUT", "/v1/scenes/{id}/dataset", request);
  ASSERT_TRUE(put) << put.error().message;
  const json dataset = json::parse(put->body)["dataset"];
  EXPECT_TRUE(dataset["psnr_mean_db"].is_null());
  ASSERT_EQ(dataset["warnings"].size(), 1u);
  EXPECT_NE(dataset["warnings"][0].get<std::string>().find("could not be compared"), std::string::npos);
  EXPECT_EQ(json::parse(call("GET", "/v1/scenes/{id}", about(id))->body)["dataset"], dataset);
}

TEST_F(SceneRoutes, WhoeverMayStoreNothingMoreMayReplaceADatasetAndNeedNotSendMore) {
  const std::string id = add_wall();
  scenes::write_zip(temp.path() / "bare.zip", {{"transforms.json", scenes::transforms_json()}});
  FakeCall request = uploading(support::read_file(temp.path() / "bare.zip"), "capture.zip");
  request.in_path = {{"id", id}};
  const auto may_store = [&](std::uint64_t bytes) {
    request.by = std::make_shared<const http::Token>(
        http::Token{.name = "studio", .edit = true, .secret = "s", .quotas = {.bytes = bytes}});
  };
  may_store(1'000'000);
  const auto put = [&] { return call("PUT", "/v1/scenes/{id}/dataset", request); };
  ASSERT_TRUE(put());
  may_store(store->bytes_of("studio"));
  const auto again = put();
  EXPECT_TRUE(again) << again.error().message;

  request.declared = 10'000'000;
  request.upload = "nobody reads this";
  const auto long_one = put();
  ASSERT_FALSE(long_one);
  EXPECT_EQ(long_one.error().code, ErrorCode::quota_exceeded);
  const auto scene = call("POST", "/v1/scenes", request);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::quota_exceeded);
}

TEST_F(SceneRoutes, TakeADatasetWithoutPhotosAndNameWhatIsMissing) {
  const std::string id = add_wall();
  scenes::write_zip(temp.path() / "bare.zip", {{"transforms.json", scenes::transforms_json()}});
  FakeCall request = uploading(support::read_file(temp.path() / "bare.zip"), "capture.zip");
  request.in_path = {{"id", id}};
  const auto bare = call("PUT", "/v1/scenes/{id}/dataset", request);
  ASSERT_TRUE(bare) << bare.error().message;
  EXPECT_TRUE(json::parse(bare->body)["dataset"]["psnr_mean_db"].is_null());
  EXPECT_EQ(json::parse(bare->body)["views"], 2);
  scenes::write_zip(temp.path() / "half.zip", {{"transforms.json", scenes::transforms_json()},
                                               {"images/a.png", png(engine::scene::Image(64, 48, 3))}});
  request.upload = support::read_file(temp.path() / "half.zip");
  const auto half = call("PUT", "/v1/scenes/{id}/dataset", request);
  ASSERT_FALSE(half);
  EXPECT_EQ(half.error().code, ErrorCode::not_found);
  EXPECT_NE(half.error().message.find("images/b.png"), std::string::npos);
  request.in_path["id"] = "s000099";
  EXPECT_EQ(call("PUT", "/v1/scenes/{id}/dataset", request).error().where, "scene");
  EXPECT_EQ(call("PUT", "/v1/scenes/{id}/dataset", with_body(id, R"({"path":"/etc"})")).error().where, "path");
}

TEST_F(SceneRoutes, SendAVersionAsAFile) {
  const std::string id = add_wall();
  ASSERT_TRUE(store->patch(id, {"t\xc3\xa4 \"1\"", {}}));
  const auto reply = call("GET", "/v1/scenes/{id}/versions/{v}/file", about(id));
  ASSERT_TRUE(reply) << reply.error().message;
  ASSERT_TRUE(reply->file);
  EXPECT_EQ(support::read_file(*reply->file), support::read_file(options.folder / id / "base.ply"));
  EXPECT_FALSE(reply->etag.empty());
  EXPECT_NE(reply->hold, nullptr);
  EXPECT_EQ(header_of(*reply, "Content-Disposition"),
            "attachment; filename=\"t__ _1_.ply\"; filename*=UTF-8''t%C3%A4%20%221%22.ply");
  FakeCall request = about(id);
  request.in_query["format"] = "splat";
  EXPECT_EQ(std::filesystem::file_size(*call("GET", "/v1/scenes/{id}/versions/{v}/file", request)->file), 441 * 32u);
  request.in_query["format"] = "obj";
  EXPECT_EQ(call("GET", "/v1/scenes/{id}/versions/{v}/file", request).error().where, "format");
  EXPECT_EQ(call("GET", "/v1/scenes/{id}/versions/{v}/file", about(id, "4")).error().where, "version");
}

}  // namespace
}  // namespace server::service::routes
