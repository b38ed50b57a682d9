#include "proto/edit_request.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
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

constexpr std::array<std::string_view, 17> request_fields{
    "scene",     "version", "mode",   "preset", "prompt", "negative_prompt", "lora",   "allow_slow", "handles",
    "selection", "heal",    "attach", "crumbs", "shadow", "settle",          "region", "params"};
constexpr std::array<std::string_view, 6> config_fields{"start",   "direction",  "voxel_size",
                                                        "cluster", "local_mask", "mode"};

/// What a request is read for.
enum class Wanted {
  edit,      ///< It says what moves, or removes what it selects.
  selection  ///< That alone: nothing has to move.
};

EditRequest read_request(const JsonField& field, Wanted wanted) {
  const Members members(field, request_fields);
  EditRequest request;
  if (const auto f = members.optional("scene")) request.scene = f->text();
  if (const auto f = members.optional("version")) request.version = f->whole(0, no_limit);
  if (const auto f = members.optional("mode")) request.mode = f->one_of(engine::names<Mode>);
  if (const auto f = members.optional("preset")) request.preset = f->one_of(engine::names<Preset>);
  if (const auto f = members.optional("prompt"); f && !f->is_null()) request.prompt = f->text();
  if (const auto f = members.optional("negative_prompt"); f && !f->is_null()) request.negative_prompt = f->text();
  if (const auto f = members.optional("lora"); f && !f->is_null()) request.lora = f->text();
  if (const auto f = members.optional("allow_slow")) request.allow_slow = f->boolean();
  const auto selection = members.optional("selection");
  // What is selected can be removed without a word on where it is.
  const bool may_lack_handles = wanted == Wanted::selection || (request.mode == Mode::remove && selection.has_value());
  if (const auto handles = may_lack_handles ? members.optional("handles") : members.required("handles"))
    for (const JsonField& handle : handles->elements(may_lack_handles ? 0 : 1, max_handles, "handles"))
      request.handles.push_back(read_handle(handle, selection.has_value()));
  if (selection) request.selection = read_selection(*selection);
  if (const auto f = members.optional("heal")) request.heal = read_selection(*f);
  if (const auto f = members.optional("attach")) request.attach = f->one_of(engine::names<Attach>);
  if (const auto f = members.optional("crumbs")) request.crumbs = f->one_of(engine::names<Crumbs>);
  if (const auto f = members.optional("shadow")) request.shadow = f->one_of(engine::names<ShadowOfPart>);
  if (const auto f = members.optional("settle")) request.settle = f->one_of(engine::names<Settle>);
  if (const auto f = members.optional("region")) request.region = read_region(*f, "size");
  if (const auto f = members.optional("params")) request.params = read_params(*f);
  return request;
}

EditRequest read_edit_request(const JsonField& field) { return read_request(field, Wanted::edit); }

/// One element per handle, or a refusal that says how many there are.
std::vector<JsonField> per_handle(const JsonField& field, std::size_t handles, const std::string& things) {
  return field.elements(handles, handles, things + ", as many as start has");
}

EditRequest read_released_config(const JsonField& field) {
  const Members members(field, config_fields);
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

template <std::size_t N>
bool is_one_of(std::string_view name, const std::array<std::string_view, N>& names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

template <std::size_t N>
std::ptrdiff_t fields_in_common(const json& document, const std::array<std::string_view, N>& names) {
  return std::count_if(names.begin(), names.end(), [&](std::string_view name) { return document.contains(name); });
}

/// Letters to put in, leave out or exchange that make one of the other (Levenshtein 1966). Names beyond any field's
/// length are not looked at: they are nothing misspelt, and a file may have a million letters.
std::size_t letters_between(std::string_view a, std::string_view b) {
  constexpr std::size_t longest = 32;
  if (a.size() > longest || b.size() > longest) return std::max(a.size(), b.size());
  std::array<std::size_t, longest + 1> row{};
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t exchanged = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = std::exchange(row[j], std::min({exchanged, row[j] + 1, row[j - 1] + 1}));
    }
  }
  return row[b.size()];
}

template <std::size_t N>
std::size_t letters_to_nearest(std::string_view name, const std::array<std::string_view, N>& names) {
  std::size_t least = std::numeric_limits<std::size_t>::max();
  for (const std::string_view known : names) least = std::min(least, letters_between(name, known));
  return least;
}

template <std::size_t N>
std::string joined(const std::array<std::string_view, N>& names) {
  std::string text;
  for (const std::string_view name : names) text += (text.empty() ? "" : ", ") + std::string(name);
  return text;
}

/// What a document is most likely meant to be that has nothing by which forms are told apart.
struct Guess {
  std::optional<std::string> misspelt;  ///< The field of neither form that is nearest to one.
  bool is_request = false, is_released = false;
};

Guess guess_at(const json& document) {
  Guess guess;
  if (!document.is_object()) return guess;
  const auto of_request = fields_in_common(document, request_fields),
             of_config = fields_in_common(document, config_fields);
  std::size_t least = std::numeric_limits<std::size_t>::max();
  bool is_nearer_to_config = false;
  for (const auto& member : document.items()) {
    if (is_one_of(member.key(), request_fields) || is_one_of(member.key(), config_fields)) continue;
    const std::size_t to_request = letters_to_nearest(member.key(), request_fields),
                      to_config = letters_to_nearest(member.key(), config_fields);
    if (guess.misspelt && std::min(to_request, to_config) >= least) continue;
    guess.misspelt = member.key();
    least = std::min(to_request, to_config);
    is_nearer_to_config = to_config < to_request;
  }
  if (of_request == 0 && of_config == 0) return guess;
  guess.is_released = of_config > of_request || (of_config == of_request && is_nearer_to_config);
  guess.is_request = !guess.is_released;
  return guess;
}

Result<RequestFile> decode_either(const json& document, const std::string& name) {
  const auto in_file = [&](Result<EditRequest> request, bool released) -> Result<RequestFile> {
    if (!request) return propagate(request);
    return RequestFile{std::move(*request), name, released};
  };
  if (is_edit_request(document)) return in_file(decode(document, name, read_edit_request), false);
  if (is_released_config(document)) return in_file(decode(document, name, read_released_config), true);
  const Guess guess = guess_at(document);
  const std::string where =
      guess.misspelt ? name + (name.empty() ? "" : ".") + printable(*guess.misspelt) : name;  // says what was meant
  if (guess.misspelt && (guess.is_request || guess.is_released))
    return fail(ErrorCode::invalid_argument,
                "unknown field; there are " + (guess.is_released ? joined(config_fields) : joined(request_fields)),
                where);
  // All its fields are known: what is missing is said.
  if (guess.is_request) return in_file(decode(document, name, read_edit_request), false);
  if (guess.is_released) return in_file(decode(document, name, read_released_config), true);
  return fail(ErrorCode::invalid_argument,
              "expected an edit request (with handles, or a selection to remove) or a 3DGS-Drag configuration (with "
              "start, direction and voxel_size)",
              where);
}

bool is_request(const json& document) { return is_edit_request(document) || is_released_config(document); }

/// Whether the document is a request, if a wrong one, though members of it are objects: it has a word that one field
/// says, and no member is a request itself, beside which such a word would be a comment.
bool is_one_that_lacks_something(const json& document) {
  constexpr std::array words{"mode", "preset", "attach", "crumbs", "shadow", "settle", "version"};
  if (!document.is_object()) return false;
  return std::any_of(words.begin(), words.end(),
                     [&](const char* word) { return document.contains(word) && !document[word].is_object(); }) &&
         std::none_of(document.begin(), document.end(), is_request);
}

/// The requests of a file of several, by name; none if the document is something else.
std::vector<std::string> request_names(const json& document) {
  std::vector<std::string> names;
  if (!document.is_object() || is_request(document) || is_one_that_lacks_something(document)) return names;
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

/// Of a file, the request that is meant.
struct Chosen {
  const json* request;
  std::string name;  ///< Among several; empty if the file is one.
};

Result<Chosen> choose(const json& document, std::string_view name) {
  const auto names = request_names(document);
  if (names.empty()) {
    if (name.empty() || !is_request(document)) return Chosen{&document, ""};
    return fail(ErrorCode::invalid_argument, "the file holds one request, which has no name: leave the name out");
  }
  if (name.empty() && names.size() > 1)
    return fail(ErrorCode::invalid_argument, "the file holds several requests; choose one by name: " + listed(names));
  const std::string chosen(name.empty() ? names.front() : name);
  if (std::find(names.begin(), names.end(), chosen) == names.end())
    return fail(ErrorCode::not_found, "there is no request \"" + printable(chosen) + "\"; there are: " + listed(names));
  return Chosen{&document[chosen], printable(chosen)};
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
  const auto chosen = choose(*document, name);
  if (!chosen) return propagate(chosen);
  return decode_either(*chosen->request, chosen->name);
}

Result<Selection> parse_selection_file(std::string_view text, std::string_view name, const JsonLimits& limits) {
  const auto document = parse_document(text, limits);
  if (!document) return propagate(document);
  if (document->is_array()) {
    if (!name.empty())
      return fail(ErrorCode::invalid_argument,
                  "the file is a list of operations, which has no name: leave the name out");
    std::optional<Error> error;
    Selection operations = read_selection(JsonField(*document, "selection", error));
    if (error) return tl::make_unexpected(std::move(*error));
    return operations;
  }
  const auto chosen = choose(*document, name);
  if (!chosen) return propagate(chosen);
  const json& request = *chosen->request;
  const std::string where = (chosen->name.empty() ? "" : chosen->name + ".") + "selection";
  const auto selects_nothing = [&] { return fail(ErrorCode::invalid_argument, "the request selects nothing", where); };
  if (is_released_config(request) && !is_edit_request(request)) return selects_nothing();  // none of its fields could
  auto read =
      decode(request, chosen->name, [](const JsonField& field) { return read_request(field, Wanted::selection); });
  if (!read) return propagate(read);
  if (!read->selection) return selects_nothing();
  return *std::move(read->selection);
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
  if (request.negative_prompt) out["negative_prompt"] = *request.negative_prompt;
  if (request.lora) out["lora"] = *request.lora;
  if (request.allow_slow) out["allow_slow"] = true;
  ordered_json& handles = out["handles"] = ordered_json::array();
  for (const Handle& handle : request.handles) handles.push_back(encode(handle));
  if (request.selection) out["selection"] = encode(*request.selection);
  if (request.heal) out["heal"] = encode(*request.heal);
  if (request.attach) out["attach"] = name_of(*request.attach);
  if (request.crumbs) out["crumbs"] = name_of(*request.crumbs);
  if (request.shadow) out["shadow"] = name_of(*request.shadow);
  if (request.settle) out["settle"] = name_of(*request.settle);
  if (request.region) out["region"] = {{"center", request.region->center}, {"size", request.region->size}};
  out["params"] = encode(request.params);
  return pretty(out);
}

}  // namespace proto
