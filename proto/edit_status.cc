#include "proto/edit_status.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "proto/error_code.h"

namespace proto {
namespace {

using nlohmann::ordered_json;

/// One line: an event's data is one, and nobody reads a poll's answer.
std::string text_of(const ordered_json& value) {
  return value.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

template <class T>
ordered_json or_null(const std::optional<T>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json or_null(const std::string& text) { return text.empty() ? ordered_json(nullptr) : ordered_json(text); }

template <class Items, class Encode>
ordered_json list_of(const Items& items, Encode encode_item) {
  ordered_json list = ordered_json::array();
  for (const auto& item : items) list.push_back(encode_item(item));
  return list;
}

ordered_json encode(const EditRequest& request) { return ordered_json::parse(to_json(request)); }

ordered_json encode(const GaussianCounts& counts) {
  return {{"input", counts.input},   {"output", counts.output},         {"removed", counts.removed},
          {"copies", counts.copies}, {"changeable", counts.changeable}, {"crumbs", counts.crumbs},
          {"relit", counts.relit}};
}

ordered_json encode(const Uncovered& uncovered) {
  return {{"view", uncovered.view},
          {"area", uncovered.area},
          {"open", uncovered.open},
          {"open_box", or_null(uncovered.open_box)}};
}

ordered_json encode(const HandleCount& handle) { return {{"gaussians", handle.gaussians}}; }

ordered_json encode(const engine::Error& error) {
  return {{"code", name_of(error.code)}, {"detail", error.message}, {"where", error.where}};
}

std::string link_of_edit(const std::string& id) { return "/v1/edits/" + id; }
std::string link_of_scene(const std::string& id) { return "/v1/scenes/" + id; }
std::string link_of_version(const std::string& scene, const std::string& version) {
  return link_of_scene(scene) + "/versions/" + version;
}

ordered_json encode(const FinishedInterval& finished, const std::string& id) {
  const std::string renders_link = link_of_edit(id) + "/intervals/" + std::to_string(finished.interval) + "/renders/";
  ordered_json renders = ordered_json::array();
  for (std::size_t k = 0; k < finished.renders.size(); ++k) {
    ordered_json stages = ordered_json::object();
    for (const std::string& stage : finished.renders[k].stages)
      stages[stage] = renders_link + std::to_string(k) + "?stage=" + stage;
    renders.push_back({{"view", finished.renders[k].view}, {"stages", std::move(stages)}});
  }
  return {{"interval", finished.interval},
          {"seconds", finished.seconds},
          {"positions", finished.positions},
          {"loss", or_null(finished.loss)},
          {"renders", std::move(renders)}};
}

ordered_json encode(const Part& part) {
  return {{"group", part.group}, {"how", part.how}, {"why", part.why}, {"settled", part.settled}};
}

ordered_json links_of(const EditStatus& status) {
  const std::string self = link_of_edit(status.id);
  ordered_json links{{"self", self},
                     {"events", self + "/events"},
                     {"stop", self + "/stop"},
                     {"cancel", self + "/cancel"},
                     {"scene", link_of_scene(status.scene)},
                     {"result", nullptr},
                     {"file", nullptr}};
  if (status.result_version) {
    const std::string result = link_of_version(status.scene, std::to_string(*status.result_version));
    links["result"] = result;
    links["file"] = result + "/file?format=ply";
  }
  return links;
}

ordered_json encode(const EditStatus& status) {
  ordered_json out{{"id", status.id},
                   {"scene", status.scene},
                   {"version", status.version},
                   {"state", status.state},
                   {"stopped_early", status.stopped_early},
                   {"queue_position", or_null(status.queue_position)},
                   {"stage", or_null(status.stage)},
                   {"progress", status.progress},
                   {"eta_seconds", or_null(status.eta_seconds)},
                   {"interval", status.interval},
                   {"intervals", status.intervals},
                   {"iteration", status.iteration},
                   {"iterations", status.iterations},
                   {"loss", or_null(status.loss)},
                   {"finished_intervals", list_of(status.finished_intervals,
                                                  [&](const auto& finished) { return encode(finished, status.id); })},
                   {"handles", list_of(status.handles, [](const auto& handle) { return encode(handle); })},
                   {"parts", list_of(status.parts, [](const auto& part) { return encode(part); })},
                   {"request", encode(status.request)},
                   {"timings", list_of(status.timings,
                                       [](const auto& timing) {
                                         return ordered_json{{"stage", timing.stage}, {"seconds", timing.seconds}};
                                       })},
                   {"gaussians", nullptr},
                   {"uncovered", list_of(status.uncovered, [](const auto& view) { return encode(view); })},
                   {"warnings", status.warnings},
                   {"result_version", or_null(status.result_version)},
                   {"error", nullptr},
                   {"created", status.created},
                   {"started", or_null(status.started)},
                   {"ended", or_null(status.ended)},
                   {"simd", or_null(status.simd)},
                   {"links", links_of(status)}};
  if (status.gaussians) out["gaussians"] = encode(*status.gaussians);
  if (status.error) out["error"] = encode(*status.error);
  return out;
}

}  // namespace

std::string to_json(const EditStatus& status) { return text_of(encode(status)); }

std::string to_json(const std::vector<EditStatus>& edits) {
  return text_of({{"edits", list_of(edits, [](const EditStatus& status) { return encode(status); })}});
}

std::string to_json(const EditEstimate& estimate) {
  return text_of({{"valid", true},
                  {"handles", list_of(estimate.handles, [](const auto& handle) { return encode(handle); })},
                  {"views", estimate.views},
                  {"intervals", estimate.intervals},
                  {"parts", list_of(estimate.parts, [](const auto& part) { return encode(part); })},
                  {"estimate", {{"seconds", estimate.seconds}, {"memory_bytes", estimate.memory_bytes}}},
                  {"request", encode(estimate.request)},
                  {"warnings", estimate.warnings}});
}

std::string to_json(const Preview& preview) {
  ordered_json handles = ordered_json::array();
  for (std::size_t i = 0; i < std::min(preview.handles.size(), preview.positions.size()); ++i)
    handles.push_back({{"gaussians", preview.handles[i].gaussians}, {"position", preview.positions[i]}});
  const std::string link = link_of_version(preview.scene, preview.version);
  return text_of(
      {{"scene", preview.scene},
       {"version", preview.version},
       {"parent", preview.parent},
       {"expires", preview.expires},
       {"handles", std::move(handles)},
       {"intervals", preview.intervals},
       {"parts", list_of(preview.parts, [](const auto& part) { return encode(part); })},
       {"gaussians", encode(preview.gaussians)},
       {"seconds", preview.seconds},
       {"warnings", preview.warnings},
       {"links", {{"render", link + "/render"}, {"pick", link + "/pick"}, {"file", link + "/file?format=ply"}}}});
}

}  // namespace proto
