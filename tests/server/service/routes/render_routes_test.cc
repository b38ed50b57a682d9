#include "server/service/routes/render_routes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/io/image_file.h"
#include "tests/server/service/routes/route_support.h"

namespace server::service::routes {
namespace {

using engine::ErrorCode;
using RenderRoutes = RouteFixture;

const std::string render_path = "/v1/scenes/{id}/versions/{v}/render", pick_path = "/v1/scenes/{id}/versions/{v}/pick",
                  select_path = "/v1/scenes/{id}/versions/{v}/select";

FakeCall from_front(FakeCall request) {
  request.in_query = {{"eye", "0,0,-4"}, {"target", "0,0,0"}, {"width", "64"}, {"height", "48"}};
  return request;
}

engine::scene::Image decoded(const http::Reply& reply) {
  const auto image = engine::io::decode_image(std::as_bytes(std::span(reply.body)), "reply");
  if (!image) throw std::runtime_error(image.error().message);
  return *image;
}

TEST_F(RenderRoutes, SendAPictureWithItsTagAndTiming) {
  FakeCall request = from_front(about(add_wall()));
  const auto reply = call("GET", render_path, request);
  ASSERT_TRUE(reply) << reply.error().message << reply.error().where;
  EXPECT_EQ(reply->media_type, "image/jpeg");
  EXPECT_EQ(header_of(*reply, "Vary"), "Accept");
  EXPECT_NE(header_of(*reply, "Server-Timing").find("render;dur="), std::string::npos);
  EXPECT_FALSE(reply->etag.empty());
  const auto image = decoded(*reply);
  EXPECT_EQ(image.width, 64);
  EXPECT_EQ(image.height, 48);
  EXPECT_GT(image.at(32, 24, 2), 0.9f) << "the wall is blue";
}

TEST_F(RenderRoutes, MakePicturesInMemoryThatIsCounted) {
  const FakeCall request = from_front(about(add_wall()));
  const std::uint64_t needed = 140 * 441 + 64 * 64 * 48;
  const auto answer_with = [&](std::uint64_t bytes, std::uint64_t others) {
    engine::MemoryBudget budget(bytes, "--work-memory", std::chrono::milliseconds(20));
    const auto held = budget.take(others, "others");
    RenderService counted({.threads = 2, .max_side = 256, .memory = &budget});
    router = {};
    add_render_routes(router, {*store, *views, counted, *selections});
    return call("GET", render_path, request);
  };
  EXPECT_TRUE(answer_with(needed, 0));
  EXPECT_EQ(answer_with(needed - 1, 0).error().code, engine::ErrorCode::too_large);
  EXPECT_EQ(answer_with(needed, 1).error().code, engine::ErrorCode::unavailable);
}

TEST_F(RenderRoutes, AnswerAKnownTagWithoutAPicture) {
  FakeCall request = from_front(about(add_wall()));
  const auto first = call("GET", render_path, request);
  request.known_etag = first->etag;
  const auto second = call("GET", render_path, request);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->status, 304);
  EXPECT_TRUE(second->body.empty());
  EXPECT_EQ(header_of(*second, "Server-Timing"), "");
  EXPECT_EQ(header_of(*second, "Vary"), "Accept") << "as with the picture";
}

TEST_F(RenderRoutes, TagPicturesOfAnotherProgramDifferently) {
  const std::string id = add_wall();
  const auto version = store->load(id, "0");
  ASSERT_TRUE(version);
  const RenderService older({.threads = 1, .program = "1.0"}), newer({.threads = 1, .program = "1.1"});
  EXPECT_NE(older.etag(*version, {}), newer.etag(*version, {}));
}

TEST_F(RenderRoutes, TagDifferentPicturesDifferently) {
  const std::string id = add_wall();
  ASSERT_TRUE(add_version(*store, id, 0, "e1", scenes::small_edit(cloud_of(id, "0"))));
  std::set<std::string> tags;
  const auto tag = [&](const std::string& version, const std::string& name, const std::string& value) {
    FakeCall request = from_front(about(id, version));
    if (!name.empty()) request.in_query[name] = value;
    const auto reply = call("GET", render_path, request);
    EXPECT_TRUE(reply) << name;
    if (reply) tags.insert(reply->etag);
  };
  tag("0", "", "");
  tag("1", "", "");
  tag("0", "width", "65"), tag("0", "fov", "51"), tag("0", "eye", "0,0,-4.1"), tag("0", "up", "1,0,0");
  tag("0", "what", "depth"), tag("0", "format", "png"), tag("0", "background", "1,1,1"), tag("0", "quality", "50");
  tag("0", "sh_degree", "0"), tag("0", "max_side", "32");
  EXPECT_EQ(tags.size(), 12u);
  tag("0", "background", "0,0,0");
  EXPECT_EQ(tags.size(), 12u) << "what is said and what is meant anyway are the same";
}

TEST_F(RenderRoutes, GiveTheSameBytesWhateverIsInMemory) {
  const std::string id = add_wall();
  ASSERT_TRUE(add_version(*store, id, 0, "e1", scenes::small_edit(cloud_of(id, "0"))));
  FakeCall request = from_front(about(id, "1"));
  request.in_query["format"] = "png";
  const auto before = call("GET", render_path, request);
  open();
  connect();
  const auto after = call("GET", render_path, request);
  ASSERT_TRUE(before && after);
  EXPECT_EQ(before->body, after->body);
  EXPECT_EQ(before->etag, after->etag);
}

TEST_F(RenderRoutes, ChooseTheFormatByWhatIsAccepted) {
  const std::string id = add_wall();
  const auto type = [&](const std::string& accept, const std::string& what, const std::string& format) {
    FakeCall request = from_front(about(id));
    request.accept = accept;
    request.in_query["what"] = what;
    if (!format.empty()) request.in_query["format"] = format;
    const auto reply = call("GET", render_path, request);
    return reply ? std::to_string(reply->status) + " " + reply->media_type : reply.error().message;
  };
  EXPECT_EQ(type("", "color", ""), "200 image/jpeg");
  EXPECT_EQ(type("image/png,*/*;q=0", "color", ""), "200 image/png");
  EXPECT_EQ(type("image/x-exr", "depth", ""), "200 image/x-exr");
  EXPECT_EQ(type("*/*", "mask", ""), "200 image/png");
  EXPECT_EQ(type("text/html", "color", ""), "406 application/problem+json");
  EXPECT_EQ(type("text/html", "color", "png"), "200 image/png") << "format is the last word";
}

TEST_F(RenderRoutes, ShowDepthAndAlphaAndWhatAVersionChanged) {
  const std::string id = add_wall();
  const auto base = cloud_of(id, "0");
  scenes::Overlay edit = engine::scene::no_change(base);
  std::vector<std::uint32_t> left;
  for (std::uint32_t i = 0; i < base.size(); ++i)
    if (base.mean.x[i] < -0.05f) left.push_back(i);
  edit.changed = left;
  engine::scene::append_rows(edit.rows, base, left);
  ASSERT_TRUE(add_version(*store, id, 0, "e1", edit));
  const auto picture = [&](const std::string& version, const std::string& what, const std::string& format) {
    FakeCall request = from_front(about(id, version));
    request.in_query["what"] = what, request.in_query["format"] = format;
    const auto reply = call("GET", render_path, request);
    if (!reply) throw std::runtime_error(reply.error().message);
    return decoded(*reply);
  };
  const auto mask = picture("1", "mask", "png");
  EXPECT_EQ(mask.at(24, 24), 1.0f);
  EXPECT_EQ(mask.at(40, 24), 0.0f);
  EXPECT_EQ(mask.at(1, 1), 0.0f);
  EXPECT_EQ(picture("0", "mask", "png").at(24, 24), 0.0f) << "version 0 changed nothing";
  EXPECT_GT(picture("0", "alpha", "png").at(32, 24), 0.95f);
  EXPECT_LT(picture("0", "alpha", "png").at(1, 1), 0.05f);
  EXPECT_GT(picture("0", "depth", "png").at(32, 24), 0.05f);
}

TEST_F(RenderRoutes, TakeACameraInTheBody) {
  const std::string id = add_wall();
  const auto posted = call("POST", render_path,
                           with_body(id, R"({"camera":{"eye":[0,0,-4],"target":[0,0,0],"width":64,"height":48}})"));
  const auto got = call("GET", render_path, from_front(about(id)));
  ASSERT_TRUE(posted && got);
  EXPECT_EQ(posted->etag, got->etag);
  EXPECT_EQ(posted->body, got->body);
}

TEST_F(RenderRoutes, UseTheSceneSUp) {
  const std::string id = add_wall();
  const auto before = call("GET", render_path, from_front(about(id)));
  ASSERT_TRUE(store->patch(id, {{}, engine::DVec3(1, 0, 0)}));
  const auto after = call("GET", render_path, from_front(about(id)));
  ASSERT_TRUE(before && after);
  EXPECT_NE(before->etag, after->etag);
}

TEST_F(RenderRoutes, LookThroughEveryViewOfTheScene) {
  const std::string id = add_wall();
  const auto set = views->views_of(id);
  ASSERT_TRUE(set) << set.error().message;
  EXPECT_TRUE((*set)->is_virtual);
  ASSERT_FALSE((*set)->views.empty());
  FakeCall request = about(id);
  request.in_query = {{"view", (*set)->views[0].camera.name}, {"max_side", "32"}};
  const auto reply = call("GET", render_path, request);
  ASSERT_TRUE(reply) << reply.error().message;
  EXPECT_EQ(decoded(*reply).width, 32);
  request.in_query["view"] = "0001.jpg";
  const auto missing = call("GET", render_path, request);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::not_found);
  EXPECT_EQ(missing.error().where, "view");
}

TEST_F(RenderRoutes, RefuseWhatTheyCannotRender) {
  const std::string id = add_wall();
  const auto refused = [&](const FakeCall& request) {
    const auto reply = call("GET", render_path, request);
    return reply ? engine::Error{ErrorCode::internal, "accepted", "accepted"} : reply.error();
  };
  FakeCall large = from_front(about(id));
  large.in_query["width"] = "257";
  EXPECT_EQ(refused(large).code, ErrorCode::too_large);
  EXPECT_NE(refused(large).message.find("--max-render-side allows 256"), std::string::npos) << "it names the limit";
  large.in_query["max_side"] = "256";
  EXPECT_EQ(refused(large).message, "accepted");
  FakeCall blind = from_front(about(id));
  blind.in_query["eye"] = "0,0,0";
  EXPECT_EQ(refused(blind).code, ErrorCode::invalid_argument);
  EXPECT_EQ(refused(blind).where, "target");
  EXPECT_EQ(refused(from_front(about(id, "1"))).where, "version");
  EXPECT_EQ(refused(from_front(about("s000099"))).where, "scene");
  EXPECT_EQ(refused(about(id)).where, "eye");
  const auto body =
      call("POST", render_path, with_body(id, R"({"camera":{"eye":[0,0,0],"target":[0,0,0],"width":64,"height":48}})"));
  ASSERT_FALSE(body);
  EXPECT_EQ(body.error().where, "camera.target");
}

TEST_F(RenderRoutes, PickThePointUnderAPixel) {
  const std::string id = add_wall();
  const std::string camera = R"("camera":{"eye":[0,0,-4],"target":[0,0,0],"width":64,"height":48})";
  const auto reply = call("POST", pick_path, with_body(id, "{" + camera + R"(,"x":32,"y":24,"radius":0.15})"));
  ASSERT_TRUE(reply) << reply.error().message << reply.error().where;
  const json hit = json::parse(reply->body);
  EXPECT_EQ(hit["hit"], true);
  EXPECT_NEAR(hit["depth"].get<double>(), 4, 0.05);
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(hit["point"][std::size_t(axis)].get<double>(), 0, 0.05);
  EXPECT_LT(hit["normal"][2].get<double>(), -0.9) << "towards the camera";
  EXPECT_EQ(hit["gaussian"], 220);
  EXPECT_EQ(hit["gaussians_in_radius"], 9);
  const auto miss = call("POST", pick_path, with_body(id, "{" + camera + R"(,"x":0.5,"y":0.5,"radius":1})"));
  ASSERT_TRUE(miss);
  EXPECT_EQ(json::parse(miss->body), json::parse(R"({"hit":false,"point":null,"depth":null,"normal":null,
    "gaussian":null,"gaussians_in_radius":null})"));
}

TEST_F(RenderRoutes, PickThroughCamerasLargerThanAnyRender) {
  const std::string id = add_wall();
  const std::string camera = R"("camera":{"eye":[0,0,-4],"target":[0,0,0],"width":640,"height":480})";
  const auto picked = [&](double x, double y) {
    const auto reply =
        call("POST", pick_path,
             with_body(id, "{" + camera + ",\"x\":" + std::to_string(x) + ",\"y\":" + std::to_string(y) + "}"));
    return reply ? json::parse(reply->body) : json{{"hit", reply.error().message}};
  };
  const json middle = picked(320, 240), left = picked(250, 240);
  ASSERT_EQ(middle["hit"], true);
  EXPECT_NEAR(middle["point"][0].get<double>(), 0, 0.05);
  ASSERT_EQ(left["hit"], true);
  EXPECT_NEAR(left["point"][0].get<double>(), -70 / 240.0 * 4 * std::tan(25 * std::numbers::pi / 180), 0.05);
  EXPECT_EQ(picked(1, 1)["hit"], false);
}

TEST_F(RenderRoutes, LookAlongTheirOwnUp) {
  FakeCall request = from_front(about(add_wall()));
  request.in_query["up"] = "0,0,1";
  EXPECT_TRUE(call("GET", render_path, request));
  request.in_query["up"] = "0,-1e-11,0";
  const auto short_up = call("GET", render_path, request);
  request.in_query["up"] = "0,-1,0";
  const auto up = call("GET", render_path, request);
  ASSERT_TRUE(short_up && up);
  EXPECT_EQ(short_up->etag, up->etag) << "its length does not matter";
}

TEST_F(RenderRoutes, CountTheGaussiansOfASphere) {
  const std::string id = add_wall();
  const auto reply = call("POST", pick_path, with_body(id, R"({"point":[0,0,0],"radius":0.05})"));
  ASSERT_TRUE(reply) << reply.error().message;
  EXPECT_EQ(json::parse(reply->body), json::parse(R"({"hit":true,"point":[0.0,0.0,0.0],"depth":null,"normal":null,
    "gaussian":null,"gaussians_in_radius":1})"));
}

TEST_F(RenderRoutes, NameEveryWrongFieldOfAPick) {
  const std::string id = add_wall();
  const std::string camera = R"("camera":{"eye":[0,0,-4],"target":[0,0,0],"width":64,"height":48})";
  const auto where = [&](const std::string& body, const std::string& version = "0") {
    FakeCall request = with_body(id, body);
    request.in_path["v"] = version;
    const auto reply = call("POST", pick_path, request);
    return reply ? "accepted" : reply.error().where;
  };
  EXPECT_EQ(where("{" + camera + R"(,"x":64.5,"y":1})"), "x");
  EXPECT_EQ(where("{" + camera + R"(,"x":1,"y":48.5})"), "y");
  EXPECT_EQ(where("{" + camera + R"(,"x":64,"y":48})"), "accepted");
  EXPECT_EQ(where("{" + camera + R"(,"x":1,"y":1})", "7"), "version");
  EXPECT_EQ(where(R"({"view":"nowhere","x":1,"y":1})"), "view");
  EXPECT_EQ(where(R"({"point":[0,0,0],"radius":-1})"), "radius");
  EXPECT_EQ(where("{"), "line 1, column 1");
}

/// The left half of the wall, and a camera on it.
const std::string left_half = R"({"selection": [{"plane": {"point": [-0.05, 0, 0], "normal": [-1, 0, 0]}}]})";

TEST_F(RenderRoutes, SelectAndSayWhat) {
  const std::string id = add_wall();
  const auto reply = call("POST", select_path, with_body(id, left_half));
  ASSERT_TRUE(reply) << reply.error().message << reply.error().where;
  const json answer = json::parse(reply->body);
  EXPECT_EQ(answer["count"], 10 * 21);
  EXPECT_NEAR(answer["bounds"]["low"][0].get<double>(), -1.0, 1e-6);
  EXPECT_NEAR(answer["bounds"]["high"][0].get<double>(), -0.1, 1e-6);
  EXPECT_NEAR(answer["centre"][0].get<double>(), -0.55, 1e-6);
  EXPECT_EQ(answer["undecided"], 0);
  EXPECT_TRUE(answer["border"].is_null()) << "nothing was grown";
  EXPECT_EQ(answer["warnings"], json::array());
  EXPECT_EQ(json::parse(call("POST", select_path, with_body(id, left_half))->body)["id"], answer["id"]);
  const auto nothing = call("POST", select_path, with_body(id, R"({"selection": []})"));
  ASSERT_TRUE(nothing) << "it is not an error";
  EXPECT_EQ(json::parse(nothing->body)["count"], 0);
  EXPECT_EQ(json::parse(nothing->body)["warnings"], json::array({"nothing is selected"}));
}

TEST_F(RenderRoutes, SayWhetherAWholeHasBordersFartherOutAndIn) {
  // A red square within a green one on the wall: two borders, and none beyond.
  scenes::GaussianCloud cloud = GaussianWall::cloud();
  for (std::size_t row = 0; row < cloud.size(); ++row) {
    const auto mean = cloud.mean.get(row);
    const float away = std::max(std::abs(mean.x), std::abs(mean.y));
    const std::size_t colour = away < 0.35f ? 0 : away < 0.65f ? 1 : 2;
    for (std::size_t c = 0; c < 3; ++c) cloud.sh[row * 3 + c] = c == colour ? 1.5f : -1.5f;
  }
  write(temp.path() / "target.ply", cloud);
  const auto added = store->add_upload(temp.path() / "target.ply", "target.ply", "");
  ASSERT_TRUE(added) << added.error().message;
  const auto border = [&](const std::string& wider) {
    const auto reply = call("POST", select_path, with_body(added->id, R"({"selection": [{"grow": {"inside": [[0, 0, 0]],
      "whole": true, "wider": )" + wider + "}}]}"));
    return json::parse(reply->body)["border"];
  };
  const json out = border("64"), in = border("-64");
  EXPECT_FALSE(out["more"].get<bool>()) << "that it asked for more than there are was told";
  EXPECT_FALSE(in["less"].get<bool>());
  EXPECT_LT(in["wider"].get<int>(), out["wider"].get<int>()) << out << in;
  EXPECT_TRUE(out["less"].get<bool>()) << out << in;
  EXPECT_TRUE(in["more"].get<bool>()) << out << in;
}

TEST_F(RenderRoutes, SelectByWhatACameraShows) {
  const std::string id = add_wall();
  const auto count = [&](const std::string& depth) {
    const auto reply =
        call("POST", select_path,
             with_body(id, R"({"selection": [{"stroke": {"camera": {"eye": [0, 0, -4], "target": [0, 0, 0],
      "up": [0, -1, 0], "width": 64, "height": 48}, "points": [[32, 24]], "radius": 0.5, "depth": ")" +
                               depth + R"("}}]})"));
    return reply ? json::parse(reply->body)["count"].get<int>() : -1;
  };
  EXPECT_EQ(count("through"), 1);
  EXPECT_EQ(count("visible"), 0) << "half of it shows beside so small a disc";
}

TEST_F(RenderRoutes, TintWhatIsSelected) {
  const std::string id = add_wall();
  const auto reply = call("POST", select_path, with_body(id, left_half));
  ASSERT_TRUE(reply);
  FakeCall request = from_front(about(id));
  request.in_query["format"] = "png";
  const auto plain = call("GET", render_path, request);
  request.in_query["selection"] = json::parse(reply->body)["id"].get<std::string>();
  const auto tinted = call("GET", render_path, request);
  ASSERT_TRUE(plain && tinted);
  EXPECT_NE(plain->etag, tinted->etag);
  const auto before = decoded(*plain), after = decoded(*tinted);
  int left = 0;
  for (int y = 0; y < before.height; ++y)
    for (int x = 0; x < before.width; ++x) {
      const float change = after.at(x, y, 0) - before.at(x, y, 0);
      if (x > 34) {
        EXPECT_EQ(change, 0) << x << ' ' << y;
      } else if (change > 0.2f) {
        ++left;
      }
    }
  EXPECT_GT(left, 100);
  request.known_etag = tinted->etag;
  EXPECT_EQ(call("GET", render_path, request)->status, 304);
  const auto posted =
      call("POST", render_path,
           with_body(id, R"({"camera": {"eye": [0, 0, -4], "target": [0, 0, 0], "width": 64, "height": 48},
                                     "format": "png", "selection": ")" +
                             request.in_query["selection"] + R"("})"));
  ASSERT_TRUE(posted) << posted.error().message;
  EXPECT_EQ(posted->etag, tinted->etag);
}

TEST_F(RenderRoutes, TintWhatIsSelectedInAnEditedVersion) {
  const std::string id = add_wall();
  const auto base = cloud_of(id, "0");
  scenes::Overlay edit =
      engine::scene::no_change(base);  // the first column goes, the last one is another, one is added
  std::vector<std::uint32_t> last;
  for (std::uint32_t row = 0; row < base.size(); ++row) {
    if (row % 21 == 0) edit.removed.push_back(row);
    if (row % 21 == 20) last.push_back(row);
  }
  edit.changed = last;
  last.push_back(5);
  engine::scene::append_rows(edit.rows, base, last);
  ASSERT_TRUE(add_version(*store, id, 0, "e1", edit));
  write(temp.path() / "merged.ply", cloud_of(id, "1"));
  const std::string merged = store->add_upload(temp.path() / "merged.ply", "merged.ply", "")->id;
  const auto picture = [&](const std::string& scene, const std::string& version) {
    FakeCall select = with_body(scene, R"({"selection": [{"rows": [[15, 25], [390, 421]]}]})");
    select.in_path["v"] = version;
    const auto made = call("POST", select_path, select);
    if (!made) throw std::runtime_error(made.error().message);
    FakeCall request = from_front(about(scene, version));
    request.in_query["eye"] = "1.3,-0.7,-4";  // from aside: no two have the same depth
    request.in_query["format"] = "png";
    request.in_query["selection"] = json::parse(made->body)["id"].get<std::string>();
    return call("GET", render_path, request)->body;
  };
  EXPECT_EQ(cloud_of(id, "1").size(), 421u);
  EXPECT_TRUE(picture(id, "1") == picture(merged, "0"));
}

TEST_F(RenderRoutes, NameASelectionThatIsNotThere) {
  const std::string id = add_wall();
  FakeCall request = from_front(about(id));
  request.in_query["selection"] = "q0123456789abcdef";
  const auto lost = call("GET", render_path, request);
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::not_found);
  EXPECT_EQ(lost.error().where, "selection");
  EXPECT_NE(lost.error().message.find("post it again"), std::string::npos);
  request.in_query["what"] = "depth";
  EXPECT_EQ(call("GET", render_path, request).error().code, ErrorCode::invalid_argument) << "only colours are tinted";
}

TEST_F(RenderRoutes, NameEveryWrongFieldOfASelection) {
  const std::string id = add_wall();
  const auto where = [&](const std::string& operation) {
    const auto reply = call("POST", select_path, with_body(id, R"({"selection": [)" + operation + "]}"));
    return reply ? "accepted" : reply.error().where;
  };
  EXPECT_EQ(where(R"({"rows": [[0, 441]]})"), "accepted");
  EXPECT_EQ(where(R"({"rows": [[0, 442]]})"), "selection[0].rows[0]");
  EXPECT_EQ(where(R"({"rows": [[3, 3]]})"), "selection[0].rows[0]");
  EXPECT_EQ(where(R"({"op": "subtract", "invert": true})"), "selection[0].op");
  EXPECT_EQ(where(R"({"grow": {"inside": [[0, 0, 0], [900, 0, 0]], "reach": 1}})"), "selection[0].grow.inside[1]");
  EXPECT_EQ(where(R"({"stroke": {"view": "nowhere", "points": [[1, 1]], "radius": 1}})"), "selection[0].stroke.view");
  EXPECT_EQ(where(R"({"stroke": {"camera": {"eye": [0, 0, -4], "target": [0, 0, 0], "width": 16384, "height": 16384},
                     "points": [[1, 1]], "radius": 1}})"),
            "selection[0].stroke.camera.width");
  std::string searches;
  for (int i = 0; i < 33; ++i) searches += std::string(i == 0 ? "" : ",") + R"({"expand": 1})";
  EXPECT_EQ(where(searches), "selection[32].expand");
}

}  // namespace
}  // namespace server::service::routes
