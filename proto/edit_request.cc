#include "proto/edit_request.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "proto/json_document.h"
#include "proto/json_fields.h"
#include "proto/json_text.h"
#include "proto/params_fields.h"
#include "proto/selection_fields.h"

namespace proto {
namespace {

using engine::Error;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using nlohmann::json;
using nlohmann::ordered_json;

constexpr int no_limit = std::numeric_limits<int>::max();

/// selected  a selection says what moves: the radius may be left out
Handle read_handle(const JsonField& field, bool selected) {
  const Members members(field, {"source", "target", "radius", "group", "rotation", "scale"});
  Handle handle;
  if (const auto source = members.required("source")) handle.source = source->point();
  if (const auto target = members.optional("target")) handle.target = target->point();
  if (const auto radius = selected ? members.optional("radius") : members.required("radius"))
    handle.radius = radius->length();
  if (const auto group = members.optional("group")) handle.group = group->whole(0, no_limit);
  if (const auto rotation = members.optional("rotation")) {
    handle.rotation = rotation->numbers<4>(-max_coordinate, max_coordinate);
    if (handle.rotation == std::array<double, 4>{}) rotation->refuse("expected a quaternion that is not zero");
  }
  if (const auto scale = members.optional("scale")) handle.scale = scale->number(min_scale, max_scale);
  return handle;
}

Region read_region(const JsonField& field, std::string_view size_name) {
  const Members members(field, {"center", size_name});
  Region region;
  if (const auto center = members.required("center")) region.center = center->point();
  if (const auto size = members.required(size_name)) region.size = size->edges();
  return region;
}

constexpr auto request_fields = {"scene",     "version", "mode",   "preset", "prompt", "handles",
                                 "selection", "heal",    "attach", "crumbs", "region", "params"};

EditRequest read_edit_request(const JsonField& field) {
  const Members members(field, {"scene", "version", "mode", "preset", "prompt", "handles", "selection", "heal",
                                "attach", "crumbs", "region", "params"});
  EditRequest request;
  if (const auto f = members.optional("scene")) request.scene = f->text();
  if (const auto f = members.optional("version")) request.version = f->whole(0, no_limit);
  if (const auto f = members.optional("mode")) request.mode = f->one_of(engine::names<Mode>);
  if (const auto f = members.optional("preset")) request.preset = f->one_of(engine::names<Preset>);
  if (const auto f = members.optional("prompt"); f && !f->is_null()) request.prompt = f->text();
  const auto selection = members.optional("selection");
  // What is selected can be removed without a word on where it is.
  const bool may_lack_handles = request.mode == Mode::remove && selection.has_value();
  if (const auto handles = may_lack_handles ? members.optional("handles") : members.required("handles"))
    for (const JsonField& handle : handles->elements(may_lack_handles ? 0 : 1, max_handles, "handles"))
      request.handles.push_back(read_handle(handle, selection.has_value()));
  if (selection) request.selection = read_selection(*selection);
  if (const auto f = members.optional("heal")) request.heal = read_selection(*f);
  if (const auto f = members.optional("attach")) request.attach = f->one_of(engine::names<Attach>);
  if (const auto f = members.optional("crumbs")) request.crumbs = f->one_of(engine::names<Crumbs>);
  if (const auto f = members.optional("region")) request.region = read_region(*f, "size");
  if (const auto f = members.optional("params")) request.params = read_params(*f);
  return request;
}

/// One element per handle, or a refusal that says how many there are.
std::vector<JsonField> per_handle(const JsonField& field, std::size_t handles, const std::string& things) {
  return field.elements(handles, handles, things + ", as many as start has");
}

EditRequest read_released_config(const JsonField& field) {
  const Members members(field, {"start", "direction", "voxel_size", "cluster", "local_mask", "mode"});
  EditRequest request;
  if (const auto start = members.required("start"))
    for (const JsonField& source : start->elements(1, max_handles, "points"))
      request.handles.push_back({.source = source.point(), .target = {}});
  const std::size_t n = request.handles.size();
  if (const auto f = members.required("direction")) {
    const auto directions = per_handle(*f, n, "directions");
    for (std::size_t i = 0; i < directions.size(); ++i) {
      const Point motion = directions[i].point();
      if (motion == Point{}) continue;
      const Point& source = request.handles[i].source;
      request.handles[i].target = Point{source[0] + motion[0], source[1] + motion[1], source[2] + motion[2]};
    }
  }
  if (const auto f = members.required("voxel_size"))
    for (Handle& handle : request.handles) handle.radius = f->length();
  if (const auto f = members.optional("cluster")) {
    const auto groups = per_handle(*f, n, "numbers");
    for (std::size_t i = 0; i < groups.size(); ++i) request.handles[i].group = groups[i].whole(0, no_limit);
  }
  if (const auto f = members.optional("local_mask")) request.region = read_region(*f, "xyz");
  if (const auto f = members.optional("mode")) request.mode = f->one_of(engine::names<Mode>);
  return request;
}

template <class Read>
Result<EditRequest> decode(const json& document, const std::string& where, Read read) {
  std::optional<Error> error;
  EditRequest request = read(JsonField(document, where, error));
  if (error) return tl::make_unexpected(std::move(*error));
  return request;
}

bool is_released_config(const json& document) {
  return document.contains("start") || document.contains("direction") || document.contains("voxel_size");
}

bool is_edit_request(const json& document) { return document.contains("handles") || document.contains("selection"); }

/// Whether it has a field of an edit request, without what makes it one: a word is misspelt, most likely.
bool is_nearly_an_edit_request(const json& document) {
  return std::any_of(request_fields.begin(), request_fields.end(),
                     [&](const char* field) { return document.contains(field); });
}

Result<RequestFile> decode_either(const json& document, const std::string& name) {
  const auto in_file = [&](Result<EditRequest> request, bool released) -> Result<RequestFile> {
    if (!request) return propagate(request);
    return RequestFile{std::move(*request), name, released};
  };
  if (is_edit_request(document)) return in_file(decode(document, name, read_edit_request), false);
  if (is_released_config(document)) return in_file(decode(document, name, read_released_config), true);
  if (is_nearly_an_edit_request(document)) return in_file(decode(document, name, read_edit_request), false);
  std::string where = name;
  if (document.is_object() && !document.empty())
    where += (name.empty() ? "" : ".") + printable(document.begin().key());  // nothing else says what was meant
  return fail(ErrorCode::invalid_argument,
              "expected an edit request (with handles, or a selection to remove) or a 3DGS-Drag configuration (with "
              "start, direction and "
              "voxel_size)",
              where);
}

/// The requests of a file of several, by name; none if the document is something else.
std::vector<std::string> request_names(const json& document) {
  std::vector<std::string> names;
  if (!document.is_object()) return names;
  for (const auto& member : document.items()) {
    if (member.value().is_object())
      names.push_back(member.key());
    else if (!member.value().is_string())
      return {};
  }
  return names;
}

std::string listed(const std::vector<std::string>& names) {
  constexpr std::size_t max_listed = 20;  // names in a message: it stays readable
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), max_listed); ++i)
    text += (i == 0 ? "" : ", ") + printable(names[i]);
  return names.size() > max_listed ? text + ", ..." : text;
}

ordered_json encode(const Handle& handle) {
  ordered_json out{{"source", handle.source}};
  if (handle.target) out["target"] = *handle.target;
  if (handle.radius) out["radius"] = *handle.radius;
  out["group"] = handle.group;
  if (handle.rotation) out["rotation"] = *handle.rotation;
  if (handle.scale) out["scale"] = *handle.scale;
  return out;
}

}  // namespace

Result<EditRequest> parse_edit_request(std::string_view text, const JsonLimits& limits) {
  const auto document = parse_document(text, limits);
  if (!document) return propagate(document);
  return decode(*document, "", read_edit_request);
}

Result<EditRequest> parse_released_config(std::string_view text, const JsonLimits& limits) {
  const auto document = parse_document(text, limits);
  if (!document) return propagate(document);
  return decode(*document, "", read_released_config);
}

Result<RequestFile> parse_request_file(std::string_view text, std::string_view name, const JsonLimits& limits) {
  const auto document = parse_document(text, limits);
  if (!document) return propagate(document);
  if (is_edit_request(*document) || is_released_config(*document)) {
    if (name.empty()) return decode_either(*document, "");
    return fail(ErrorCode::invalid_argument, "the file holds one request, which has no name: leave the name out");
  }
  const auto names = request_names(*document);
  if (names.empty()) return decode_either(*document, "");
  if (name.empty() && names.size() > 1)
    return fail(ErrorCode::invalid_argument, "the file holds several requests; choose one by name: " + listed(names));
  const std::string chosen(name.empty() ? names.front() : name);
  if (std::find(names.begin(), names.end(), chosen) == names.end())
    return fail(ErrorCode::not_found, "there is no request \"" + printable(chosen) + "\"; there are: " + listed(names));
  return decode_either((*document)[chosen], printable(chosen));
}

Result<Selection> parse_selection_file(std::string_view text, const JsonLimits& limits) {
  const auto document = parse_document(text, limits);
  if (!document) return propagate(document);
  if (document->is_array()) {
    std::optional<Error> error;
    Selection operations = read_selection(JsonField(*document, "selection", error));
    if (error) return tl::make_unexpected(std::move(*error));
    return operations;
  }
  const bool is_alone = document->size() == 1 && document->contains("selection");
  if (is_alone || !is_nearly_an_edit_request(*document)) return parse_selection(text, limits);
  auto request = decode(*document, "", read_edit_request);
  if (!request) return propagate(request);
  if (!request->selection) return fail(ErrorCode::invalid_argument, "the edit request selects nothing", "selection");
  return *std::move(request->selection);
}

std::string RequestFile::address_of(std::string_view field) const {
  std::string in_request(field);
  if (released) {
    const auto bracket = field.find(']');
    if (field.ends_with(".radius")) {
      in_request = "voxel_size";
    } else if (field.starts_with("handles[") && bracket != std::string_view::npos) {
      const std::string index(field.substr(7, bracket - 6));
      in_request = field.ends_with(".group")    ? "cluster" + index
                   : field.ends_with(".target") ? "direction" + index
                                                : "start" + index;
    } else if (field == "region.size") {
      in_request = "local_mask.xyz";
    } else if (field.starts_with("region")) {
      in_request = "local_mask" + std::string(field.substr(6));
    }
  }
  return name.empty() ? in_request : name + "." + in_request;
}

std::string to_json(const EditRequest& request) {
  ordered_json out = ordered_json::object();
  if (request.scene) out["scene"] = *request.scene;
  if (request.version) out["version"] = *request.version;
  out["mode"] = name_of(request.mode);
  if (request.preset) out["preset"] = name_of(*request.preset);
  if (request.prompt) out["prompt"] = *request.prompt;
  ordered_json& handles = out["handles"] = ordered_json::array();
  for (const Handle& handle : request.handles) handles.push_back(encode(handle));
  if (request.selection) out["selection"] = encode(*request.selection);
  if (request.heal) out["heal"] = encode(*request.heal);
  if (request.attach) out["attach"] = name_of(*request.attach);
  if (request.crumbs) out["crumbs"] = name_of(*request.crumbs);
  if (request.region) out["region"] = {{"center", request.region->center}, {"size", request.region->size}};
  out["params"] = encode(request.params);
  return pretty(out);
}

}  // namespace proto
