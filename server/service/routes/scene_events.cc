#include "server/service/routes/scene_events.h"

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/edit_status.h"
#include "server/service/routes/scene_routes.h"

namespace server::service::routes {
namespace {

using edits::EditService;
using engine::propagate;
using engine::Result;
using http::Call;
using http::Reply;
using scenes::SceneStore;
using std::chrono::steady_clock;

constexpr std::size_t all_edits = 1000;  // that wait or run in one scene: more than any queue takes
constexpr std::size_t latest_edits = 8;  // more do not come and end between two looks

/// Ids count up: "e999999" is older than "e1000000".
bool came_before(const std::string& a, const std::string& b) {
  return a.size() != b.size() ? a.size() < b.size() : a < b;
}

/// Tells one listener of one scene, until that is gone or nobody listens any more.
class SceneStream {
 public:
  SceneStream(std::string id, SceneStore& store, EditService& service, const SceneEventOptions& options,
              http::EventSink& sink)
      : id_(std::move(id)), store_(store), service_(service), options_(options), sink_(sink) {}

  void operator()() {
    while (sink_.open()) {
      const auto seen = service_.version();  // before the look: what happens in between ends the wait at once
      std::vector<std::string> news;
      if (seen != looked_at_) {
        if (auto found = look_at_edits()) news = *std::move(found), looked_at_ = seen;
      }
      // An edit's version is there before the edit says so: told first, whoever hears of the end knows the version.
      if (!tell_scene()) return;
      for (const std::string& edit : news)
        if (!send("edit", edit)) return;
      if (steady_clock::now() - last_ >= options_.sign_of_life && !send("alive", "{}")) return;
      service_.wait_for_change(seen, options_.look_every);
    }
  }

 private:
  bool send(std::string_view event, std::string_view data) {
    last_ = steady_clock::now();
    return sink_.send(event, std::to_string(++events_), data);
  }

  bool tell_scene() {
    const auto scene = store_.find(id_);
    if (!scene) {
      send("gone", "{}");
      return false;
    }
    proto::Scene now = told(*scene);
    const std::string json = proto::to_json(now);
    now.memory_bytes = 0;  // changes whenever somebody looks, and is no news
    std::string news = proto::to_json(now);
    if (news == scene_) return true;
    scene_ = std::move(news);
    return send("scene", json);
  }

  /// Edits that wait or run, and each once more when it has ended; also one that came and ended between two looks.
  ///   errors  those of the store of edits; the next look tells what this one could not
  Result<std::vector<std::string>> look_at_edits() {
    const auto active = service_.list({.scene = id_, .active_only = true, .limit = all_edits});
    const auto latest = service_.list({.scene = id_, .limit = latest_edits});
    if (!active) return propagate(active);
    if (!latest) return propagate(latest);
    std::vector<std::string> news;
    std::map<std::string, std::string> now;
    for (const proto::EditStatus& edit : *active) {
      const std::string& status = now[edit.id] = proto::to_json(edit);
      if (const auto known = edits_.find(edit.id); known == edits_.end() || known->second != status)
        news.push_back(status);
    }
    for (const auto& [id, told] : edits_) {
      if (now.contains(id)) continue;
      const auto ended = service_.find(id);
      if (!ended && ended.error().code != engine::ErrorCode::not_found) return propagate(ended);
      if (ended) news.push_back(proto::to_json(*ended));
    }
    for (const proto::EditStatus& edit : *latest)
      if (newest_ && came_before(*newest_, edit.id) && !now.contains(edit.id) && !edits_.contains(edit.id))
        news.push_back(proto::to_json(edit));
    edits_ = std::move(now);
    newest_ = latest->empty() ? "" : latest->front().id;
    return news;
  }

  std::string id_;
  SceneStore& store_;
  EditService& service_;
  SceneEventOptions options_;
  http::EventSink& sink_;
  std::string scene_;                         ///< As last told, but for its memory.
  std::map<std::string, std::string> edits_;  ///< Those that were active at the last look, as told.
  std::optional<std::string> newest_;         ///< Id of the youngest edit at the last look; "": there was none.
  std::optional<std::uint64_t> looked_at_;    ///< What EditService::version() was then.
  std::uint64_t events_ = 0;
  steady_clock::time_point last_ = steady_clock::now();
};

}  // namespace

void add_scene_event_routes(http::Router& router, SceneStore& store, EditService& service,
                            const SceneEventOptions& options) {
  router.add({.method = "GET",
              .path = "/v1/scenes/{id}/events",
              .handler = [&store, &service, options](const Call& call) -> Result<Reply> {
                const std::string& id = call.path("id");
                if (const auto scene = store.find(id); !scene) return propagate(scene);
                Reply reply;
                reply.media_type = "text/event-stream";
                reply.events = [id, &store, &service, options](http::EventSink& sink) {
                  SceneStream(id, store, service, options, sink)();
                };
                return reply;
              },
              .queries = {},
              .access = http::Access::read});
}

}  // namespace server::service::routes
