#include "tests/server/http/test_server.h"
#include <fstream>
#include <stdexcept>
#include <thread>

namespace server::http {

using engine::ErrorCode;
using engine::Result;
using namespace std::chrono_literals;

TestServer::TestServer(Router routes, ServerOptions options, AccessOptions access_options)
    : guard(std::move(access_options)) {
  options.port = 0;
  auto started = HttpServer::start(options, std::move(routes), guard, metrics, log.logger());
  if (!started) throw std::runtime_error(started.error().message);
  server = std::move(*started);
}

ServerOptions impatient() {
  ServerOptions options;
  options.lobby.connection.head_timeout = 400ms;
  options.lobby.connection.idle_timeout = 400ms;
  options.lobby.connection.stall_timeout = 400ms;
  options.lobby.connection.rate_grace = 600ms;
  options.grace = 2s;
  return options;
}

Router sample_routes(const std::filesystem::path& folder) {
  Router routes;
  const auto echo = [](const Call& call) -> Result<Reply> {
    Reply reply;
    reply.media_type = "text/plain";
    reply.body = "name=" + call.path("name") + " q=" + call.query("q").value_or("(none)") + " body=" + call.body();
    return reply;
  };
  routes.add({"GET", "/echo/{name}", echo, Body::none, {"q"}, Access::read});
  routes.add({"POST", "/echo/{name}", echo, Body::none, {"q"}, Access::read});
  routes.add({"POST", "/json", echo, Body::json, {}, Access::read});
  routes.add({"GET",
              "/json",
              [](const Call&) -> Result<Reply> { return Reply::json("{\"answer\":42}"); },
              Body::none,
              {},
              Access::read});
  routes.add({"POST",
              "/upload",
              [folder](const Call& call) -> Result<Reply> {
                if (call.is_json()) return Reply::json("{\"json\":" + call.body() + "}");
                const auto file = folder / "upload.bin";
                std::filesystem::remove(file);
                const auto received = call.receive(file);
                if (!received) return engine::propagate(received);
                return Reply::json("{\"filename\":\"" + received->filename +
                                       "\",\"bytes\":" + std::to_string(received->bytes) +
                                       ",\"on_disk\":" + std::to_string(std::filesystem::file_size(file)) + "}",
                                   201);
              },
              Body::upload,
              {},
              Access::read});
  routes.add({"GET",
              "/file",
              [folder](const Call&) -> Result<Reply> {
                Reply reply;
                reply.media_type = "application/octet-stream";
                reply.file = folder / "file.bin";
                reply.etag = "v1";
                reply.headers.emplace_back("Content-Disposition", "attachment; filename=\"file.bin\"");
                return reply;
              },
              Body::none,
              {},
              Access::read});
  routes.add({"GET",
              "/events",
              [](const Call&) -> Result<Reply> {
                Reply reply;
                reply.media_type = "text/event-stream";
                reply.events = [](EventSink& sink) {
                  int number = 1;
                  while (sink.send("tick", std::to_string(number), "{\"n\":" + std::to_string(number) + "}")) {
                    ++number;
                    std::this_thread::sleep_for(20ms);
                  }
                };
                return reply;
              },
              Body::none,
              {},
              Access::read});
  routes.add({"GET",
              "/two-events",
              [](const Call&) -> Result<Reply> {
                Reply reply;
                reply.media_type = "text/event-stream";
                reply.events = [](EventSink& sink) {
                  sink.send("edit", "1", "first\nsecond");
                  sink.keep_alive();
                  sink.send("edit", "2", "last");
                };
                return reply;
              },
              Body::none,
              {},
              Access::read});
  routes.add({"GET",
              "/bug",
              [](const Call&) -> Result<Reply> { throw std::logic_error("secret inner state"); },
              Body::none,
              {},
              Access::read});
  routes.add({"GET",
              "/slow",
              [](const Call&) -> Result<Reply> {
                std::this_thread::sleep_for(300ms);
                return Reply::json("{}");
              },
              Body::none,
              {},
              Access::read});
  routes.add({"GET",
              "/fail/{code}",
              [](const Call& call) -> Result<Reply> {
                return engine::fail(ErrorCode(std::stoi(call.path("code"))), "it did not work", "a.b[1]");
              },
              Body::none,
              {},
              Access::read});
  const auto picture = [](const Call& call) -> Result<Reply> {
    if (!call.accepts("image/png")) return engine::fail(ErrorCode::unsupported, "only image/png here", "Accept");
    if (call.has("pic1")) return Reply::not_modified("pic1");
    Reply reply;
    reply.media_type = "image/png";
    reply.etag = "pic1";
    reply.body = "PNG";
    reply.headers.emplace_back("Server-Timing", "render;dur=1\r\nSet-Cookie: evil=1");
    return reply;
  };
  for (const char* method : {"GET", "POST"}) routes.add({method, "/picture", picture, Body::none, {}, Access::read});
  routes.add({"DELETE",
              "/thing",
              [](const Call&) -> Result<Reply> { return Reply::no_content(); },
              Body::none,
              {},
              Access::read});
  routes.add(
      {"GET", "/open", [](const Call&) -> Result<Reply> { return Reply::json("{}"); }, Body::none, {}, Access::open});
  routes.add({"GET",
              "/",
              [](const Call&) -> Result<Reply> { return Reply::json("{\"root\":true}"); },
              Body::none,
              {},
              Access::open});
  return routes;
}

}  // namespace server::http
